//! A simulated unit on a drive that is being planned, and the core that is run over it.
//!
//! All of it can be cloned: a manoeuvre is tried on a copy, from the present end of the drive.

use std::collections::VecDeque;

use ins_core::attitude::{Euler, from_euler};
use ins_core::config::HeadingSource;
use ins_core::earth::Geodetic;
use ins_core::{Config, Estimates, GnssFix, ImuSample, Navigator, Phase, Solution, Time};
use miette::{Result, miette};
use nalgebra::{UnitQuaternion, Vector3};

use super::manoeuvre::{Driver, Manoeuvre, Site};
use super::target::Target;
use crate::identify::analysis::unusable;
use crate::sim::car::{Car, DriveProfile};
use crate::sim::drive::{Recorder, Recording, truth_stride};
use crate::sim::gnss::arrivals;
use crate::sim::ideal::IdealSensors;
use crate::sim::motion::Mounted;
use crate::sim::noise::Random;
use crate::sim::{ErrorModel, SensorErrors};

/// One unit and its driver.
#[derive(Clone, Debug)]
pub struct DrivenUnit {
    course: DriveProfile,
    driver: Driver,
    mount: UnitQuaternion<f64>,
    recorder: Recorder,
    recording: Recording,
    /// Truth at the end of the recording.
    last: Solution,
    /// Its start by the stamps of the core, and the time driven before, s.
    since: Time,
    before_s: f64,
    /// Fixes that have not arrived, with their times of arrival.
    pending: VecDeque<(Time, GnssFix)>,
    /// Constant errors of the sensors, as estimated from a log.
    constant_errors: Option<Estimates>,
    pub navigator: Navigator,
}

impl DrivenUnit {
    /// A unit at switch-on, with any heading; the seed fixes its errors and all noise.
    pub fn switched_on(
        target: &Target,
        model: &ErrorModel,
        config: Config,
        seed: u64,
        mut driver: Driver,
    ) -> Result<Self> {
        let recording = Recording {
            seed,
            duration_s: 0.0,
            imu_hz: target.unit.imu_hz,
            truth_every: truth_stride(target.unit.imu_hz),
            origin: Geodetic {
                latitude_rad: 50.0_f64.to_radians(),
                longitude_rad: 10.0_f64.to_radians(),
                height_m: 200.0,
            },
            errors: model.clone(),
        };
        let course = DriveProfile::new(0.0, driver.heading_rad());
        let mut bench = Self::begin(course, driver, target.unit.mount(), recording, config)?;
        if let Some(sigma_deg) = model.given_heading_sigma_deg {
            let error = Random::stream(seed, "given heading").normal() * sigma_deg.to_radians();
            let given = bench.last.euler().heading_rad + error;
            bench.navigator = navigator(Config {
                heading: HeadingSource::Given(given),
                ..config
            })?;
        }
        Ok(bench)
    }

    /// Continues at the end of a recorded drive, with the core's estimates as the truth: the sigmas do
    /// not depend on the values.
    pub fn after(
        (navigator, before_s): (Navigator, f64),
        model: &ErrorModel,
        imu_hz: f64,
        seed: u64,
        driver: Driver,
    ) -> Result<Self> {
        let end = navigator
            .solution()
            .filter(|_| navigator.phase() == Phase::Navigating);
        let end = end.ok_or_else(|| {
            miette!(
                help = "nothing of it counts: plan a drive from the start, without the log",
                "the log ends without a solution"
            )
        })?;
        let known = navigator.estimates();
        let velocity = end.velocity_enu_mps.xy();
        let speed_mps = velocity.norm();
        // Below walking speed the velocity has no usable direction: the vehicle is taken at rest.
        let moves = speed_mps > 1.0;
        let (speed_mps, heading_rad) = if moves {
            (speed_mps, libm::atan2(velocity.x, velocity.y))
        } else {
            (0.0, end.euler().heading_rad)
        };
        let vehicle = from_euler(&Euler {
            heading_rad,
            ..Euler::default()
        });
        let recording = Recording {
            seed,
            duration_s: 0.0,
            imu_hz,
            truth_every: truth_stride(imu_hz),
            origin: end.position,
            errors: without_random_constants(model, &known),
        };
        let course = DriveProfile::new(speed_mps, heading_rad);
        let mount = vehicle.inverse() * end.attitude;
        let config = *navigator.config();
        let mut bench = Self::begin(course, driver, mount, recording, config)?;
        bench.constant_errors = Some(known);
        bench.since = end.time;
        bench.before_s = before_s;
        bench.recorder.imu.clear();
        bench.navigator = navigator;
        Ok(bench)
    }

    fn begin(
        course: DriveProfile,
        driver: Driver,
        mount: UnitQuaternion<f64>,
        recording: Recording,
        config: Config,
    ) -> Result<Self> {
        let motion = Mounted::new(Car::on_profile(course.clone()), mount);
        let sensors = IdealSensors::new(motion, recording.origin, Time::default());
        Ok(Self {
            course,
            driver,
            mount,
            recorder: Recorder::new(&recording, None, sensors.state()),
            recording,
            last: sensors.state().solution,
            since: Time::default(),
            before_s: 0.0,
            pending: VecDeque::new(),
            constant_errors: None,
            navigator: navigator(config)?,
        })
    }

    pub fn is_aligning(&self) -> bool {
        self.navigator.phase() != Phase::Navigating
    }

    /// Since the recording began, s.
    pub fn seconds(&self) -> f64 {
        self.last.time.as_seconds()
    }

    /// The same with the time driven before.
    pub fn total_seconds(&self) -> f64 {
        self.before_s + self.seconds()
    }

    /// End of a manoeuvre if it were driven next, s.
    pub fn seconds_after(&self, manoeuvre: Manoeuvre, site: &Site) -> f64 {
        let (mut course, mut driver) = (self.course.clone(), self.driver.clone());
        manoeuvre.drive(&mut course, site, &mut driver);
        course.now_s
    }

    pub fn drive(&mut self, manoeuvre: Manoeuvre, site: &Site) {
        manoeuvre.drive(&mut self.course, site, &mut self.driver);
        let motion = Mounted::new(Car::on_profile(self.course.clone()), self.mount);
        let mut sensors = IdealSensors::new(motion, self.last.position, self.last.time);
        let end = Time::default().plus_seconds(self.course.now_s);
        self.recorder.record_until(&mut sensors, end);
        self.last = sensors.state().solution;
        self.feed_core();
    }

    /// Feeds the recorded samples and fixes to the core.
    fn feed_core(&mut self) {
        let fixes = std::mem::take(&mut self.recorder.gnss);
        let Recording { errors, seed, .. } = &self.recording;
        let when = arrivals(
            &fixes,
            &errors.gnss.habits,
            *seed ^ self.course.now_s.to_bits(),
        );
        self.pending.extend(when.into_iter().zip(fixes));
        for sample in std::mem::take(&mut self.recorder.imu) {
            while let Some((_, fix)) = self
                .pending
                .pop_front_if(|(arrival, _)| *arrival < sample.time)
            {
                let _ = self.navigator.on_gnss(&GnssFix {
                    time: self.stamp(fix.time),
                    ..fix
                });
            }
            let _ = self.navigator.on_imu(&self.with_constant_errors(&sample));
        }
    }

    fn stamp(&self, time: Time) -> Time {
        self.since.plus_seconds(time.as_seconds())
    }

    /// A sample with the constant errors, the inverse of [`Estimates::corrected`].
    fn with_constant_errors(&self, sample: &ImuSample) -> ImuSample {
        let time = self.stamp(sample.time);
        let Some(known) = &self.constant_errors else {
            return ImuSample { time, ..*sample };
        };
        let seconds = (self.recording.errors.imu.output).per_rate(1.0 / self.recording.imu_hz);
        let values = |three: &[ins_core::Estimate; 3]| Vector3::from(three.map(|one| one.value));
        let beyond_level = sample.accel - seconds * known.level_force_mps2;
        let up = known
            .level_force_mps2
            .try_normalize(1.0)
            .unwrap_or_default();
        let turn = up.dot(&sample.gyro);
        let tipped = sample.gyro - turn * up;
        ImuSample {
            time,
            gyro: sample.gyro
                + seconds * values(&known.gyro_bias_radps)
                + known.turn_scale.value * turn * up
                + values(&known.gyro_scale).component_mul(&tipped)
                + values(&known.gyro_misalignment_rad).dot(&tipped) * up,
            accel: sample.accel
                + seconds * values(&known.accel_bias_mps2)
                + values(&known.accel_scale).component_mul(&beyond_level),
        }
    }

    /// True motion, ten times a second.
    pub fn truth(&self) -> &[Solution] {
        &self.recorder.truth
    }

    /// Truth at the end.
    pub fn end(&self) -> &Solution {
        &self.last
    }

    pub fn errors(&self) -> SensorErrors {
        self.recorder.errors(self.last.time)
    }
}

fn navigator(config: Config) -> Result<Navigator> {
    Navigator::new(config).map_err(unusable)
}

/// The model without random constants, those of GNSS as estimated; noise and drift remain.
fn without_random_constants(model: &ErrorModel, known: &Estimates) -> ErrorModel {
    let mut model = model.clone();
    for sensors in [&mut model.gyro_deg_h, &mut model.accel_mps2] {
        sensors.scale_sigma = 0.0;
        sensors.misalignment_sigma = 0.0;
        sensors.bias.set_initial_sigma(0.0);
    }
    let latency_s = known.gnss_latency_now_s.value;
    model.gnss.latency_s = [latency_s; 2];
    model.gnss.outages.clear();
    model.gnss.habits.clock_drift = known.clock_drift.value;
    model.gnss.habits.lever_arm_m = known.lever_arm_m.map(|arm| arm.value);
    model
}

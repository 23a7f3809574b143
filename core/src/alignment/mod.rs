//! Alignment: roll and pitch from rest or from a coarse mean, heading from the gyros or from
//! motion.
//!
//! Levelling ends with a heading that is given or gyrocompassed, or else with an INS that is
//! level but points anywhere: it runs free until motion shows where it points.

pub mod heading_from_motion;
pub mod levelling;
pub mod rest;

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};

use self::heading_from_motion::MotionSums;
use self::levelling::RestMean;
use self::rest::{RestDetector, Verdict};
use crate::attitude::{matrix, turned};
use crate::config::{Config, Feedback, HeadingSource};
use crate::earth::{GRAVITY_EQUATOR_MPS2, Geodetic, LocalEarth};
use crate::increments::Interval;
use crate::math;
use crate::mechanization::{Controls, Mechanization};
use crate::parameters::{Parameters, index};
use crate::samples::GnssFix;
use crate::solution::Phase;
use crate::time::Time;

/// Rest wanted for levelling, and for gyrocompassing, s.
const LEVEL_S: f64 = 8.0;
const GYROCOMPASS_S: f64 = 60.0;
/// Rest that is enough if motion ends it, s.
const LEAST_REST_S: f64 = 2.0;
/// Longest wait for rest, s; shorter when GNSS shows motion.
const WAIT_S: f64 = 20.0;
const WAIT_MOVING_S: f64 = 3.0;
/// Speed that shows motion beyond doubt, m/s.
const MOVING_MPS: f64 = 1.0;
/// Time constant of the mean that levels a start in motion, s.
const COARSE_S: f64 = 2.0;
/// Tilt that a start in motion leaves: accelerations of a tenth of gravity, rad.
const COARSE_TILT_RAD: f64 = 0.1;
/// Largest spread of a heading that is good enough to navigate on, rad.
const HEADING_SIGMA_RAD: f64 = 0.3;
/// Spread of a heading from motion beyond what its fit says, rad: latency in turns.
const MOTION_SIGMA_RAD: f64 = 0.05;
/// Longest window for the heading from motion, s.
const WINDOW_S: f64 = 20.0;
/// Tilt beyond which a heading found is not believed, rad.
const LARGEST_TILT_RAD: f64 = 0.5;
/// Spread of a gyro bias from the runaway of a window in steady motion, rad/s.
const RUNAWAY_SIGMA_RADPS: f64 = 1e-3;

/// Roll and pitch found with a spread, rad, and the heading with its spread, if it is known too.
struct Levelled {
    attitude: UnitQuaternion<f64>,
    tilt_sigma_rad: f64,
    heading: Option<(f64, f64)>,
}

/// The INS to start from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Aligned {
    /// Level, with a heading.
    pub ins: Mechanization,
    /// Spread of roll and pitch, rad; that of the azimuth is in [`Alignment::known`].
    pub tilt_sigma_rad: f64,
}

/// Alignment going on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alignment {
    start: Time,
    known: Parameters,
    detector: RestDetector,
    rest: RestMean,
    /// Mean of the last seconds, at rest or not.
    coarse_force_mps2: Option<Vector3<f64>>,
    /// Turn to the right since the beginning.
    coarse_turn_rad: f64,
    last_fix: Option<GnssFix>,
    finding: Option<Finding>,
    aligned: Option<Aligned>,
}

/// A level INS that points anywhere, and what it has seen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Finding {
    ins: Mechanization,
    motion: MotionSums,
    since: Time,
}

impl Finding {
    fn start(time: Time, position: Geodetic, attitude: UnitQuaternion<f64>) -> Self {
        Self {
            ins: Mechanization::new(position, Vector3::zeros(), attitude),
            motion: MotionSums::default(),
            since: time,
        }
    }
}

impl Alignment {
    /// Begins with levelling.
    pub fn new(start: Time, known: Parameters) -> Self {
        Self {
            start,
            known,
            detector: RestDetector::default(),
            rest: RestMean::default(),
            coarse_force_mps2: None,
            coarse_turn_rad: 0.0,
            last_fix: None,
            finding: None,
            aligned: None,
        }
    }

    /// Begins again after a hole: roll and pitch are kept as a start, heading has to be found.
    pub fn resume(
        time: Time,
        position: Geodetic,
        attitude: UnitQuaternion<f64>,
        known: Parameters,
    ) -> Self {
        Self {
            finding: Some(Finding::start(time, position, attitude)),
            ..Self::new(time, known)
        }
    }

    /// How far it has come.
    pub fn phase(&self) -> Phase {
        if self.finding.is_some() {
            Phase::FindingHeading
        } else {
            Phase::Levelling
        }
    }

    /// What is known of the sensors.
    pub fn known(&self) -> &Parameters {
        &self.known
    }

    /// Inertial samples are missing before `time`.
    pub fn on_hole(&mut self, time: Time) {
        let finding = self
            .finding
            .map(|f| Finding::start(time, f.ins.position, f.ins.attitude));
        *self = Self {
            finding,
            last_fix: self.last_fix,
            ..Self::new(time, self.known)
        };
    }

    /// The INS to start from, once it is aligned.
    pub fn aligned(&self) -> Option<&Aligned> {
        self.aligned.as_ref()
    }

    /// Takes the interval that ends at `time`.
    pub fn on_interval(&mut self, time: Time, interval: &Interval, config: &Config) {
        let verdict = self.detector.on_interval(interval);
        let Some(finding) = &mut self.finding else {
            self.level_coarsely(interval);
            if let Some(level) = verdict.and_then(|verdict| self.level(time, verdict, config)) {
                self.aligned = self.end_levelling(time, &level);
            }
            return;
        };
        let gyro_radps = compensation(&self.known, config);
        let interval = interval.without_bias(&gyro_radps, &self.known.vector(index::ACCEL));
        finding.ins.step(&interval, &Controls::default());
        if let Some(Verdict::Rest(block)) = verdict {
            let mut rest = RestMean::default();
            rest.add(&block);
            self.level_again(time, &rest, config);
        }
    }

    /// Takes a fix; `now` is the last inertial stamp.
    pub fn on_fix(&mut self, now: Time, fix: &GnssFix, config: &Config) {
        self.last_fix = Some(*fix);
        if fix.is_moving(config) {
            self.detector.on_motion();
        }
        self.aligned = self.find_heading(now, fix, config);
    }

    fn find_heading(&mut self, now: Time, fix: &GnssFix, config: &Config) -> Option<Aligned> {
        let (velocity, position) = (fix.velocity_en_mps?, fix.geodetic_or(0.0)?);
        let finding = self.finding.as_mut()?;
        let seconds = now.seconds_since(finding.since);
        let ins_velocity = finding.ins.velocity_enu_mps.xy();
        finding.motion.add(seconds, &ins_velocity, &velocity);
        if let Some(fit) = finding.motion.fit() {
            let tilt = tilt_of_slope(&fit.slope_mps2);
            if tilt.norm() < LARGEST_TILT_RAD {
                let mut ins =
                    Mechanization::new(position, fix.velocity_enu_mps(), finding.ins.attitude);
                ins.turn_heading(-fit.rotation_rad);
                ins.turn_platform(&-tilt);
                let sigma_rad = 3.0 * fit.sigma_rad + MOTION_SIGMA_RAD;
                self.known.set(index::AZIMUTH, 0.0, sigma_rad);
                return Some(Aligned {
                    ins,
                    tilt_sigma_rad: config.level_sigma(),
                });
            }
        }
        if seconds > WINDOW_S {
            self.begin_window(now, position);
        }
        None
    }

    /// Begins a new window; in steady motion the one before shows tilt and level gyro biases.
    fn begin_window(&mut self, now: Time, position: Geodetic) {
        let Some(Finding {
            mut ins, motion, ..
        }) = self.finding
        else {
            return;
        };
        if let Some(runaway) = motion.runaway() {
            // dV' = g x Phi, Phi' = -dw.
            let drift = -tilt_of_slope(&runaway.curvature_mps3);
            let drift = matrix(&ins.attitude).tr_mul(&drift);
            let variance = RUNAWAY_SIGMA_RADPS * RUNAWAY_SIGMA_RADPS;
            for axis in 0..2 {
                let found = drift.get(axis).copied().unwrap_or(0.0);
                let bias = self.known.value(index::GYRO + axis) + found;
                self.known.learn(index::GYRO + axis, bias, variance);
            }
            ins.turn_platform(&-tilt_of_slope(&runaway.slope_mps2));
        }
        self.finding = Some(Finding::start(now, position, ins.attitude));
    }

    fn level_coarsely(&mut self, interval: &Interval) {
        let force = interval.force_mps / interval.seconds;
        let mean = self.coarse_force_mps2.get_or_insert(force);
        *mean += math::min(interval.seconds / COARSE_S, 1.0) * (force - *mean);
        if let Some(up) = mean.try_normalize(GRAVITY_EQUATOR_MPS2 / 2.0) {
            self.coarse_turn_rad -= up.dot(&interval.angle_rad);
        }
    }

    /// Levels once there was rest enough, or waiting for it is in vain.
    #[inline(never)]
    fn level(&mut self, time: Time, verdict: Verdict, config: &Config) -> Option<Levelled> {
        if let Verdict::Rest(block) = verdict {
            self.rest.add(&block);
        }
        let fix = self.last_fix?;
        let position = fix.geodetic_or(0.0)?;
        let earth = LocalEarth::at(position.latitude_rad, position.height_m);
        let moving = verdict == Verdict::Motion;
        let waited = time.seconds_since(self.start);
        let compass = config.heading == HeadingSource::Auto
            && levelling::gyrocompass_sigma(&config.sensors, &earth, GYROCOMPASS_S)
                < HEADING_SIGMA_RAD;
        let wanted = if compass { GYROCOMPASS_S } else { LEVEL_S };
        if self.rest.seconds >= wanted || (moving && self.rest.seconds >= LEAST_REST_S) {
            Some(self.level_from_rest(&earth, config))
        } else if waited > WAIT_S
            || (waited > WAIT_MOVING_S && moving && fix.speed_mps() > MOVING_MPS)
        {
            Some(Levelled {
                attitude: levelling::level(&self.coarse_force_mps2?, 0.0),
                tilt_sigma_rad: COARSE_TILT_RAD,
                heading: given(config, self.coarse_turn_rad),
            })
        } else {
            None
        }
    }

    fn level_from_rest(&mut self, earth: &LocalEarth, config: &Config) -> Levelled {
        let rest = self.rest;
        let level = levelling::level(&rest.force_mps2, 0.0);
        let attitude = matrix(&level);
        self.learn_gyros(&rest, &attitude, earth, config);
        let sigma = levelling::gyrocompass_sigma(&config.sensors, earth, rest.seconds);
        let compass = (config.heading == HeadingSource::Auto && sigma < HEADING_SIGMA_RAD)
            .then(|| (levelling::gyrocompass(&attitude, &rest.rate_radps), sigma));
        Levelled {
            attitude: level,
            tilt_sigma_rad: config.level_sigma(),
            heading: given(config, 0.0).or(compass),
        }
    }

    /// Ends levelling: with a heading, or else by looking for one.
    fn end_levelling(&mut self, time: Time, level: &Levelled) -> Option<Aligned> {
        let fix = self.last_fix?;
        let position = fix.geodetic_or(0.0)?;
        let Some((heading_rad, sigma_rad)) = level.heading else {
            self.finding = Some(Finding::start(time, position, level.attitude));
            return None;
        };
        self.known.set(index::AZIMUTH, 0.0, sigma_rad);
        let attitude = turned(&level.attitude, heading_rad);
        let velocity = fix.velocity_enu_mps();
        Some(Aligned {
            ins: Mechanization::new(position, velocity, attitude),
            tilt_sigma_rad: level.tilt_sigma_rad,
        })
    }

    /// At rest the wandering INS is levelled again and again.
    #[inline(never)]
    fn level_again(&mut self, time: Time, rest: &RestMean, config: &Config) {
        let Some(Finding { ins, .. }) = self.finding else {
            return;
        };
        self.learn_gyros(rest, &matrix(&ins.attitude), &ins.local_earth(), config);
        let force = rest.force_mps2 - self.known.vector(index::ACCEL);
        let attitude = levelling::level(&force, ins.heading_rad());
        self.finding = Some(Finding::start(time, ins.position, attitude));
    }

    /// What gyros read at rest beyond the Earth rate is bias; the level Earth rate is unknown
    /// until heading is.
    fn learn_gyros(
        &mut self,
        rest: &RestMean,
        attitude: &Matrix3<f64>,
        earth: &LocalEarth,
        config: &Config,
    ) {
        let rate = earth.earth_rate();
        let bias = rest.rate_radps - attitude.tr_mul(&Vector3::new(0.0, 0.0, rate.z));
        let variance = rest::gyro_variance(&config.sensors, rest.seconds) + rate.y * rate.y;
        for (axis, bias) in bias.iter().enumerate() {
            self.known.learn(index::GYRO + axis, *bias, variance);
        }
    }
}

/// The heading given for the beginning, a turn later, with its spread.
fn given(config: &Config, turn_rad: f64) -> Option<(f64, f64)> {
    match config.heading {
        HeadingSource::Given(heading_rad) => Some((heading_rad + turn_rad, HEADING_SIGMA_RAD)),
        HeadingSource::Auto | HeadingSource::Motion => None,
    }
}

/// Gyro biases that are taken out of readings.
pub(crate) fn compensation(known: &Parameters, config: &Config) -> Vector3<f64> {
    match config.feedback {
        Feedback::Closed => known.vector(index::GYRO),
        Feedback::Open => Vector3::zeros(),
    }
}

/// Level tilt that makes the INS velocity run away at a slope: `dV_E' = -g Phi_N`.
fn tilt_of_slope(slope_mps2: &Vector2<f64>) -> Vector3<f64> {
    Vector3::new(slope_mps2.y, -slope_mps2.x, 0.0) / GRAVITY_EQUATOR_MPS2
}

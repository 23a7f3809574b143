//! Who is driven over simulated logs. All that studies know of the core's interface stands here.

use core::iter::Peekable;
use core::slice::Iter;

use ins_core::{
    BaroHeight, Config, ConfigError, Estimate, Estimates, GnssFix, ImuSample, Navigator, Phase,
    Solution, SolutionSigma, Time,
};
use nalgebra::Vector3;

use crate::compare::kalman::{self, Filter, index};
use crate::identify::configure;
use crate::identify::free_inertial::known;
use crate::identify::quantities::DEG_H_RADPS;
use crate::log::{GRAVITY_MPS2, Grade};
use crate::sim::SimulatedDrive;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claim {
    /// Value, SI.
    pub value: f64,
    pub sigma: Option<f64>,
    pub observable: bool,
}

impl Claim {
    /// Something that is said to stand on data.
    pub fn sure(value: f64, sigma: Option<f64>) -> Self {
        Self {
            value,
            sigma,
            observable: true,
        }
    }
}

/// All that is claimed at one time, body axes of the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claims {
    /// Spread of the solution's heading.
    pub heading: Claim,
    pub accel_bias_mps2: [Claim; 3],
    /// Where up is at the attitude that those are said to be of.
    pub up: Vector3<f64>,
    pub gyro_bias_radps: [Claim; 3],
    pub latency_s: Claim,
    pub lever_arm_m: [Option<Claim>; 3],
}

/// Somebody who is driven over a simulated log.
pub trait Subject {
    /// Takes one inertial sample and what has arrived by then; its stamp, or `None` at the end.
    fn step(&mut self) -> Option<Time>;
    fn solution(&self) -> Option<Solution>;
    /// How well it is said to be known.
    fn sigma(&self) -> Option<SolutionSigma>;
    /// What is claimed now; none without a solution.
    fn claims(&self) -> Option<Claims>;
}

/// Drives on to the end of the samples; `look` sees every truth with the sample at its time or, where
/// that is missing, the next.
pub fn drive<S: Subject>(
    subject: &mut S,
    truths: &[Solution],
    mut look: impl FnMut(&S, Time, &Solution),
) {
    let mut truths = truths.iter().peekable();
    while let Some(time) = subject.step() {
        while let Some(truth) = truths.next_if(|truth| truth.time <= time) {
            look(subject, time, truth);
        }
    }
}

/// The configuration that fits a class of simulated sensors: its preset, and what a data sheet of
/// such a unit says of noise and axes.
pub fn config_of(grade: Grade) -> Config {
    let errors = grade.errors();
    let (gyros, accels) = (&errors.gyro_deg_h, &errors.accel_mps2);
    let mut config = configure::config_of(grade, errors.imu.output, None);
    let sensors = &mut config.sensors;
    sensors.gyro_noise = (gyros.noise_times).map(|times| times * gyros.white_noise * DEG_H_RADPS);
    sensors.accel_noise = accels.noise_times.map(|times| times * accels.white_noise);
    sensors.cross_axis = gyros.misalignment_sigma;
    config
}

#[derive(Debug)]
pub struct Core<'a> {
    pub navigator: Navigator,
    samples: Iter<'a, ImuSample>,
    heights: Peekable<Iter<'a, BaroHeight>>,
    fixes: Peekable<core::iter::Zip<Iter<'a, GnssFix>, Iter<'a, Time>>>,
}

impl<'a> Core<'a> {
    pub fn new(config: Config, drive: &'a SimulatedDrive) -> Result<Self, ConfigError> {
        Ok(Self {
            navigator: Navigator::new(config)?,
            samples: drive.imu.iter(),
            heights: drive.baro.iter().peekable(),
            fixes: drive.gnss.iter().zip(&drive.arrivals).peekable(),
        })
    }
}

impl Subject for Core<'_> {
    fn step(&mut self) -> Option<Time> {
        let sample = self.samples.next()?;
        while let Some((fix, _)) = self.fixes.next_if(|(_, arrival)| **arrival < sample.time) {
            let _ = self.navigator.on_gnss(fix);
        }
        let _ = self.navigator.on_imu(sample);
        while let Some(height) = self.heights.next_if(|height| height.time <= sample.time) {
            let _ = self.navigator.on_baro(height);
        }
        Some(sample.time)
    }

    fn solution(&self) -> Option<Solution> {
        (self.navigator.phase() == Phase::Navigating)
            .then(|| self.navigator.solution())
            .flatten()
    }

    fn sigma(&self) -> Option<SolutionSigma> {
        self.navigator.sigma()
    }

    fn claims(&self) -> Option<Claims> {
        self.solution()?;
        let navigator = &self.navigator;
        let estimates = navigator.estimates();
        let mut claims = claims(&estimates, estimates.level_force_mps2.normalize());
        if let Some(sigma) = navigator.sigma() {
            claims.heading.sigma = Some(sigma.attitude_rad.z);
        }
        if navigator.config().gnss.lever_arm_sigma_m == 0.0 {
            // Told to be close, not found.
            claims.lever_arm_m = [None; 3];
        }
        Some(claims)
    }
}

/// The Kalman filter, told the true noise, given the same measurements.
#[derive(Debug)]
pub struct Kalman<'a> {
    pub run: kalman::Run<'a>,
    up: Vector3<f64>,
}

impl<'a> Kalman<'a> {
    /// Before the first sample; `up` is where the vehicle has it on the whole.
    pub fn new(
        imu: &'a [ImuSample],
        fixes: &'a [GnssFix],
        config: Config,
        noise: kalman::Noise,
        up: &Vector3<f64>,
    ) -> Result<Self, ConfigError> {
        Ok(Self {
            run: kalman::Run::new(imu, fixes, config, noise)?,
            up: *up,
        })
    }

    /// The bias that an accelerometer is felt to have, which this filter tells apart: see
    /// [`super::conditions`].
    fn felt(&self, filter: &Filter, axis: usize) -> Claim {
        let (known, up) = (&filter.nominal, &self.up);
        let mut row = kalman::States::zeros(filter.layout.size);
        row[index::ACCEL + axis] = 1.0;
        if let Some(at) = filter.layout.accel_scale {
            row[at + axis] = GRAVITY_MPS2 * up[axis];
        }
        let variance = row.dot(&(&filter.covariance * &row));
        Claim::sure(
            known.accel_bias_mps2[axis] + GRAVITY_MPS2 * known.accel_scale[axis] * up[axis],
            Some(variance.max(0.0).sqrt()),
        )
    }
}

impl Subject for Kalman<'_> {
    fn step(&mut self) -> Option<Time> {
        self.run.step(&mut |_, _| {})
    }

    fn solution(&self) -> Option<Solution> {
        self.run.filter().map(Filter::solution)
    }

    fn sigma(&self) -> Option<SolutionSigma> {
        let sigmas = self.run.filter()?.sigmas();
        let three = |at: usize| sigmas.fixed_rows::<3>(at).into_owned();
        Some(SolutionSigma {
            position_m: three(index::POSITION),
            velocity_mps: three(index::VELOCITY),
            attitude_rad: three(index::ATTITUDE),
        })
    }

    fn claims(&self) -> Option<Claims> {
        let filter = self.run.filter()?;
        let sigmas = filter.sigmas();
        let mut claims = claims(&filter.estimates(), self.up);
        claims.accel_bias_mps2 = [0, 1, 2].map(|axis| self.felt(filter, axis));
        claims.lever_arm_m = [0, 1, 2].map(|axis| {
            let arm_m = filter.nominal.lever_arm_m[axis];
            let sigma = |at| sigmas[at + axis];
            (filter.layout.lever_arm).map(|at| Claim::sure(arm_m, Some(sigma(at))))
        });
        Some(claims)
    }
}

fn claim(estimate: &Estimate) -> Claim {
    Claim {
        value: estimate.value,
        sigma: Some(estimate.sigma),
        observable: known(estimate),
    }
}

/// The heading is that of the solution, which has all in it that is known.
fn claims(estimates: &Estimates, up: Vector3<f64>) -> Claims {
    Claims {
        heading: claim(&estimates.azimuth_error_rad),
        accel_bias_mps2: estimates.accel_bias_mps2.each_ref().map(claim),
        up,
        gyro_bias_radps: estimates.gyro_bias_radps.each_ref().map(claim),
        latency_s: claim(&estimates.gnss_latency_now_s),
        lever_arm_m: estimates.lever_arm_m.each_ref().map(|arm| Some(claim(arm))),
    }
}

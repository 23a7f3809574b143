//! The estimators that studies run over simulated logs. All use of the core's interface by studies is here.

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
pub struct Parameter {
    /// Value, SI.
    pub value: f64,
    pub sigma: Option<f64>,
    pub observable: bool,
}

impl Parameter {
    /// Of a quantity that is always observable.
    pub fn observed(value: f64, sigma: Option<f64>) -> Self {
        Self {
            value,
            sigma,
            observable: true,
        }
    }
}

/// Parameters and their sigmas at one time, body axes of the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Its sigma is that of the solution's heading.
    pub heading: Parameter,
    pub accel_bias_mps2: [Parameter; 3],
    /// Up direction at the attitude that the accelerometer biases refer to.
    pub up: Vector3<f64>,
    pub gyro_bias_radps: [Parameter; 3],
    pub latency_s: Parameter,
    pub lever_arm_m: [Option<Parameter>; 3],
}

/// An estimator that is run over a simulated log.
pub trait Estimator {
    /// Processes one inertial sample and the fixes that have arrived by then; its stamp, or `None` at the end.
    fn step(&mut self) -> Option<Time>;
    fn solution(&self) -> Option<Solution>;
    /// Sigma of the solution.
    fn sigma(&self) -> Option<SolutionSigma>;
    /// Current estimates; `None` without a solution.
    fn parameters(&self) -> Option<Parameters>;
}

/// Runs to the end of the samples; `observe` gets every truth with the sample at its time or, if that is
/// missing, the next.
pub fn run<S: Estimator>(
    estimator: &mut S,
    truths: &[Solution],
    mut observe: impl FnMut(&S, Time, &Solution),
) {
    let mut truths = truths.iter().peekable();
    while let Some(time) = estimator.step() {
        while let Some(truth) = truths.next_if(|truth| truth.time <= time) {
            observe(estimator, time, truth);
        }
    }
}

/// Configuration for a class of simulated sensors: its preset, with the noise and misalignments of a data
/// sheet.
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

impl Estimator for Core<'_> {
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

    fn parameters(&self) -> Option<Parameters> {
        self.solution()?;
        let navigator = &self.navigator;
        let estimates = navigator.estimates();
        let mut parameters = parameters(&estimates, estimates.level_force_mps2.normalize());
        if let Some(sigma) = navigator.sigma() {
            parameters.heading.sigma = Some(sigma.attitude_rad.z);
        }
        if navigator.config().gnss.lever_arm_sigma_m == 0.0 {
            // Configured, not estimated.
            parameters.lever_arm_m = [None; 3];
        }
        Some(parameters)
    }
}

/// The Kalman filter, configured with the true noise, on the same measurements.
#[derive(Debug)]
pub struct Kalman<'a> {
    pub run: kalman::Run<'a>,
    up: Vector3<f64>,
}

impl<'a> Kalman<'a> {
    /// Before the first sample; `up` is its mean direction in the axes of the unit.
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

    /// Bias and scale error of an accelerometer, which this filter separates, as one apparent bias: see
    /// `truth.rs` of [`super::conditions`].
    fn apparent_accel_bias(&self, filter: &Filter, axis: usize) -> Parameter {
        let (known, up) = (&filter.nominal, &self.up);
        let mut row = kalman::States::zeros(filter.layout.size);
        row[index::ACCEL + axis] = 1.0;
        if let Some(at) = filter.layout.accel_scale {
            row[at + axis] = GRAVITY_MPS2 * up[axis];
        }
        let variance = row.dot(&(&filter.covariance * &row));
        Parameter::observed(
            known.accel_bias_mps2[axis] + GRAVITY_MPS2 * known.accel_scale[axis] * up[axis],
            Some(variance.max(0.0).sqrt()),
        )
    }
}

impl Estimator for Kalman<'_> {
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

    fn parameters(&self) -> Option<Parameters> {
        let filter = self.run.filter()?;
        let sigmas = filter.sigmas();
        let mut parameters = parameters(&filter.estimates(), self.up);
        parameters.accel_bias_mps2 = [0, 1, 2].map(|axis| self.apparent_accel_bias(filter, axis));
        parameters.lever_arm_m = [0, 1, 2].map(|axis| {
            let arm_m = filter.nominal.lever_arm_m[axis];
            let sigma = |at| sigmas[at + axis];
            (filter.layout.lever_arm).map(|at| Parameter::observed(arm_m, Some(sigma(at))))
        });
        Some(parameters)
    }
}

fn parameter(estimate: &Estimate) -> Parameter {
    Parameter {
        value: estimate.value,
        sigma: Some(estimate.sigma),
        observable: known(estimate),
    }
}

/// The solution already contains the estimate of its heading error.
fn parameters(estimates: &Estimates, up: Vector3<f64>) -> Parameters {
    Parameters {
        heading: parameter(&estimates.azimuth_error_rad),
        accel_bias_mps2: estimates.accel_bias_mps2.each_ref().map(parameter),
        up,
        gyro_bias_radps: estimates.gyro_bias_radps.each_ref().map(parameter),
        latency_s: parameter(&estimates.gnss_latency_now_s),
        lever_arm_m: estimates
            .lever_arm_m
            .each_ref()
            .map(|arm| Some(parameter(arm))),
    }
}

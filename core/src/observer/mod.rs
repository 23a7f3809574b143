//! The exact form of the compensation estimators: every control undone, all parameters jointly.
//!
//! Equation (6) of the thesis drops `K1 dV` and `dV'`, so (7) and (8) depend on the loop. Nothing need be
//! dropped, since every control is known. An observer estimates the error of the damped INS by the exact
//! (1)-(2), `dV' = f x Phi + C df`, `Phi' = -w_in x Phi - C dw`, with the controls as known inputs: its
//! innovations do not depend on the loops. They are linear in corrections to the parameters, through the
//! sensitivities of the error state to them, which the observer propagates and corrects alike. With optimal
//! gains the innovations are white, so least squares over them equal a Kalman filter with all parameters in
//! its state (Friedland's separate-bias estimation, IEEE TAC 14, 1969); for parameters that are random
//! walks see `Observer::add_walk`.

mod coloured_noise;
mod consistency;
mod divergence;
mod error_state;
mod jump;
mod mount_level;
mod process_noise;
mod propagation;
mod skew;
mod transient;
mod uncertainty;
mod update;
mod update_timing;

use nalgebra::{Matrix3, SVector, Vector3};

use self::coloured_noise::{ColouredNoise, CorrelationTime, FilterSensitivity};
use self::consistency::Consistency;
pub use self::divergence::{DataGap, Disturbance, RESET_MPS};
use self::error_state::{ErrorState, INITIAL_SENSITIVITIES};
pub use self::jump::AZIMUTH as AZIMUTH_JUMP;
use self::jump::Jump;
use self::process_noise::ProcessNoise;
use self::skew::SkewedArm;
use self::transient::TransientError;
use self::update_timing::UpdateTiming;
use crate::channel::Channel;
use crate::config::Config;
use crate::error_model::InsError;
use crate::innovations::{Innovations, NisTest, Resets};
use crate::least_squares::LeastSquares;
use crate::math::{self, singles};
use crate::parameters::{AGREES_SIGMAS, COUNT, PAIRS, Parameters, index};
use crate::time::Time;

/// One number for each parameter.
type Row = SVector<f32, COUNT>;

/// Initial averaging time of the level attitude of the mount, s: some manoeuvres.
const FIRST_LEVEL_S: f64 = 30.0;
/// Heights on Earth, above and below an INS that has not been given one, m.
const UNKNOWN_HEIGHT_M: f64 = 9000.0;

/// Parameters that are tested for jumps, and how.
const JUMPS: [(usize, jump::JumpTest); 3] = [
    (index::AZIMUTH, jump::AZIMUTH),
    (index::LATENCY, jump::LATENCY),
    (index::LATENCY, jump::INITIAL_LATENCY),
];
/// Before the first correction.
const CONSTANT: [Consistency; COUNT] = [Consistency::NEW; COUNT];

/// Observer of the INS error, and recursive least squares of the parameters that cause it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observer {
    /// At the horizon, with the parameters as estimated. The azimuth error is the first parameter.
    state: ErrorState<f64>,
    /// Friedland's V: partials of the state by each parameter.
    sensitivities: [ErrorState<f32>; COUNT],
    level: Channel,
    vertical: Channel,
    innovations: [Innovations; 4],
    coloured_noise: [ColouredNoise; 4],
    /// For the strength of the correlated noise of heights, and its correlation time.
    height_score: FilterSensitivity,
    height_correlation: CorrelationTime,
    gyro_noise: ProcessNoise,
    /// Running normalized innovation squared of the level axes and of the vertical, which diverges on its
    /// own.
    pub nis: NisTest,
    pub vertical_nis: NisTest,
    resets: Resets,
    vertical_resets: Resets,
    /// Of [`JUMPS`].
    jumps: [Jump; JUMPS.len()],
    /// Variance of an offset common to all measured headings, beyond their stated sigma, rad^2.
    heading_offset: f32,
    /// Corrections to the parameters.
    corrections: LeastSquares<COUNT, PAIRS>,
    /// Last solution; the latency is that of its time.
    parameters: Parameters,
    /// Specific force in the body at the level attitude of the mount, m/s^2.
    level_force_mps2: Vector3<f64>,
    gravity_mps2: f64,
    /// Averaging time of that, s.
    level_averaged_s: f64,
    /// The sigma that is updated next, and the part of the INS error's variance that is due to the
    /// parameters.
    next_sigma: u8,
    parameter_variance: InsError<f32>,
    /// Consistency of each parameter's corrections with its variance, and variance to be given back next.
    consistency: [Consistency; COUNT],
    reinflation: Option<f32>,
    /// Smoothing about which its rows and those of the arm were linearized, s^2; whether the arm is to be
    /// learnt anew.
    linearized_at_s2: f64,
    relearns_arm: bool,
    /// Error of each parameter if a long smoothing is wrong by its own size: of the low pass of the ring
    /// only the time constant is estimated, and a receiver may have another.
    by_shape: SVector<f32, COUNT>,
    /// Lever arm for which smoothing of unknown strength may pass.
    pub skewed_arm: SkewedArm,
    /// Time since the last solution, s; that between the two before it; and variance by which the azimuth
    /// has walked since then, rad^2.
    unsolved_s: f64,
    elapsed_s: f64,
    azimuth_walk: f64,
    /// At the horizon, in the body: the vertical, specific force, m/s^2, and its mean excess over that at
    /// the level attitude; transient tilt and velocity errors of the manoeuvre, and the tilt by what pulls at
    /// the gyros.
    up: Vector3<f64>,
    force_mps2: Vector3<f64>,
    excess_mps2: Vector3<f32>,
    tilt_transient: TransientError,
    velocity_transient: TransientError,
    pull_transient: TransientError,
    horizon: Time,
    level_timing: UpdateTiming,
    vertical_timing: UpdateTiming,
    /// When the biases of each axis were last given their random walk.
    last_walk: [Time; 3],
}

impl Observer {
    /// Starts with a tilt sigma and variances of the climb and of the position; `level_force_mps2` is the
    /// specific force at that attitude, body. The prior of the parameters comes by [`Self::set_prior`].
    #[expect(
        clippy::inline_always,
        reason = "made where it stays: otherwise it is copied over the stack"
    )]
    #[inline(always)]
    pub fn new(
        start: Time,
        tilt_sigma_rad: f64,
        [climb_variance, position_variance]: [f64; 2],
        level_force_mps2: Vector3<f64>,
        config: &Config,
    ) -> Self {
        let gnss = &config.gnss;
        let mut level = Channel::new(
            tilt_sigma_rad * tilt_sigma_rad,
            &gnss.velocity_mps,
            &gnss.position_m,
        );
        level.add_position_variance(position_variance);
        let mut vertical = Channel::new(0.0, &gnss.velocity_up_mps, &gnss.height_m);
        vertical.add_variance(climb_variance, 0.0);
        vertical.add_position_variance(UNKNOWN_HEIGHT_M * UNKNOWN_HEIGHT_M);
        Self {
            state: ErrorState::default(),
            sensitivities: INITIAL_SENSITIVITIES,
            level,
            vertical,
            innovations: [Innovations::default(); 4],
            coloured_noise: [ColouredNoise::new(start); 4],
            height_score: FilterSensitivity::default(),
            height_correlation: CorrelationTime::default(),
            gyro_noise: ProcessNoise::configured(),
            nis: NisTest::default(),
            vertical_nis: NisTest::default(),
            resets: Resets::default(),
            vertical_resets: Resets::default(),
            jumps: [Jump::default(); JUMPS.len()],
            heading_offset: 0.0,
            corrections: LeastSquares::EMPTY,
            parameters: Parameters::NONE,
            level_force_mps2,
            level_averaged_s: FIRST_LEVEL_S,
            next_sigma: 0,
            parameter_variance: InsError::default(),
            consistency: CONSTANT,
            reinflation: None,
            linearized_at_s2: 0.0,
            relearns_arm: false,
            by_shape: SVector::zeros(),
            skewed_arm: SkewedArm::default(),
            unsolved_s: 0.0,
            elapsed_s: 0.0,
            azimuth_walk: 0.0,
            gravity_mps2: level_force_mps2.norm(),
            up: level_force_mps2.normalize(),
            force_mps2: level_force_mps2,
            excess_mps2: Vector3::zeros(),
            tilt_transient: TransientError::default(),
            velocity_transient: TransientError::default(),
            pull_transient: TransientError::default(),
            horizon: start,
            level_timing: UpdateTiming::new(start),
            vertical_timing: UpdateTiming::new(start),
            last_walk: [start; 3],
        }
    }

    /// Sets the prior of the parameters, before anything else.
    pub fn set_prior(&mut self, prior: &Parameters, config: &Config) {
        self.parameters = *prior;
        let arm_m = prior.sigmas(index::LEVER_ARM);
        self.skewed_arm = SkewedArm::known(&arm_m, config.gnss.velocity_mps.white);
        self.corrections.set_prior(&prior.sigma);
        self.linearized_at_s2 = prior.value(index::SMOOTHING);
        self.state.error.tilt_rad.z = prior.value(index::AZIMUTH);
        let azimuth = prior.sigma(index::AZIMUTH);
        self.parameter_variance.tilt_rad.z = math::single(azimuth * azimuth);
    }

    /// After levelling by the accelerometers the tilt is correlated with their biases, `f x Phi + C b = 0`,
    /// with `C` from `body`.
    pub fn correlate_level(&mut self, body: &Matrix3<f64>) {
        let accels = self.sensitivities.iter_mut().enumerate().skip(index::ACCEL);
        for ((which, sensitivity), bias) in accels.zip(body.column_iter()) {
            let tilt = Vector3::new(-bias.y, bias.x, 0.0) / self.gravity_mps2;
            sensitivity.error.tilt_rad = singles(&tilt);
            let sigma = self.parameters.sigma(which);
            let variance = tilt.component_mul(&tilt) * (sigma * sigma);
            self.parameter_variance.tilt_rad += singles(&variance);
        }
    }

    /// After gyrocompassing to zero east rate, with `north_radps` of Earth rate, the azimuth error is
    /// correlated with the gyro biases, `w_N Phi_UP + (C b)_E = 0`.
    pub fn correlate_gyrocompass(&mut self, body: &Matrix3<f64>, north_radps: f64) {
        let mut by = Row::zeros();
        for (by, bias) in by.iter_mut().skip(index::GYRO).zip(&body.row(0)) {
            *by = math::single(-bias / north_radps);
        }
        self.corrections.redefine(index::AZIMUTH, &by);
        let without = self.parameters.sigma(index::AZIMUTH);
        let azimuth = f64::from(self.corrections.variance(index::AZIMUTH));
        self.widen(index::AZIMUTH, azimuth - without * without);
    }

    /// Time of the estimates: that of the last measurement, which lags behind the INS.
    pub fn horizon(&self) -> Time {
        self.horizon
    }

    /// Variance of position and of height, m^2.
    pub fn position_variance(&self) -> [f64; 2] {
        [self.level.position(), self.vertical.position()]
    }

    /// Error of the INS at the horizon.
    pub fn error(&self) -> &InsError {
        &self.state.error
    }

    /// Estimates of the parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Specific force in the body at the level attitude of the mount, m/s^2.
    pub fn level_force_mps2(&self) -> &Vector3<f64> {
        &self.level_force_mps2
    }

    /// Refers azimuth and latency to the horizon: the first of the steps that end with a solution. Time
    /// that passes between the steps belongs to the next solution.
    #[inline(never)]
    pub fn refer_to_horizon(&mut self) {
        self.refer_to_now();
        self.elapsed_s = self.unsolved_s;
        self.unsolved_s = 0.0;
    }

    /// Adds the azimuth's random walk, and tests azimuth and latency for jumps. If measured headings agree
    /// with the INS (`heading_aided`), a jump of the azimuth is taken for an offset of theirs as well.
    #[inline(never)]
    pub fn add_azimuth_walk(&mut self, heading_aided: bool, config: &Config) {
        let sigma = self.parameters.sigma(index::AZIMUTH);
        let (known, walked) = (sigma * sigma, self.azimuth_walk);
        self.add_walk(index::AZIMUTH, math::single(walked));
        self.azimuth_walk = 0.0;
        // By a gap in the data or a reset.
        if walked > known {
            self.widen(index::AZIMUTH, walked);
        }
        let inflation = self.inflation();
        for (number, (which, test)) in JUMPS.iter().enumerate() {
            let sigma = self.parameters.sigma(*which);
            let known = if *which == index::AZIMUTH {
                known + walked
            } else {
                sigma * sigma
            };
            let jump = self.jumps.get_mut(number);
            if let Some(variance) = jump.and_then(|jump| jump.detect(known, inflation, test))
                && !config.is_given(*which)
            {
                self.on_jump(*which, variance);
                if *which == index::AZIMUTH && heading_aided {
                    self.heading_offset += math::single(variance);
                }
            }
        }
    }

    /// Adds the random walk of the biases of one axis, in turn.
    #[inline(never)]
    pub fn add_bias_walk(&mut self, config: &Config) {
        let walked = self.last_walk.iter_mut().enumerate();
        let Some((axis, last)) = walked.min_by_key(|(_, last)| **last) else {
            return;
        };
        let seconds = self.horizon.seconds_since(*last);
        *last = self.horizon;
        let s = &config.sensors;
        for (first, walk) in [
            (index::GYRO, s.gyro_bias_walk),
            (index::ACCEL, s.accel_bias_walk),
        ] {
            self.add_walk(first + axis, math::single(walk * walk * seconds));
        }
    }

    /// Solves for the parameters.
    #[inline(never)]
    pub fn solve(&mut self) {
        let corrections = self.corrections.solve();
        self.corrections.zero_solution();
        let mut total = ErrorState::default();
        let sensitivities = estimated(&mut self.sensitivities, &self.corrections);
        for (sensitivity, by) in sensitivities.iter().zip(&corrections) {
            total.add_scaled(&sensitivity.double(), f64::from(*by));
        }
        self.state.add_scaled(&total, 1.0);
        self.parameters.value += corrections.map(f64::from);
        for (consistency, by) in self.consistency.iter_mut().zip(&corrections) {
            consistency.on_correction(*by);
        }
    }

    /// Refers azimuth and latency to the horizon, as the other parameters have moved them.
    fn refer_to_now(&mut self) {
        let azimuth = Row::from_fn(|which, _| match self.sensitivities.get(which) {
            Some(sensitivity) if which != index::AZIMUTH => sensitivity.error.tilt_rad.z,
            _ => 0.0,
        });
        self.redefine(index::AZIMUTH, &azimuth);
        let sensitivities = estimated(&mut self.sensitivities, &self.corrections);
        for (sensitivity, unit) in sensitivities.iter_mut().zip(&INITIAL_SENSITIVITIES) {
            sensitivity.error.tilt_rad.z = unit.error.tilt_rad.z;
        }
        let latency = row([(index::CLOCK_DRIFT, math::single(self.unsolved_s))]);
        let before = self.corrections.variance(index::LATENCY);
        self.redefine(index::LATENCY, &latency);
        let drifted = self.corrections.variance(index::LATENCY) - before;
        if let Some(consistency) = self.consistency.get_mut(index::LATENCY) {
            consistency.on_walk(drifted);
        }
        let p = &mut self.parameters;
        p.shift(
            index::LATENCY,
            self.unsolved_s * p.value(index::CLOCK_DRIFT),
        );
    }

    /// Replaces parameter `which` by itself plus `by` times the later ones.
    pub(super) fn redefine(&mut self, which: usize, by: &Row) {
        self.corrections.redefine(which, by);
        let Some(own) = self.sensitivities.get(which).copied() else {
            return;
        };
        for (sensitivity, by) in self.sensitivities.iter_mut().zip(by) {
            if *by != 0.0 {
                sensitivity.add_scaled(&own, -by);
            }
        }
    }

    /// Adds a random-walk step of this variance to a parameter.
    ///
    /// The INS error was caused by the parameter before the step, which is its present value less the step.
    /// The least squares know part of the step; the rest is process noise of the INS (Hsieh and Chen,
    /// Optimal solution of the two-stage Kalman estimator, IEEE TAC 44, 1999).
    pub(super) fn add_walk(&mut self, which: usize, variance: f32) {
        if let (Some(step), Some(mut caused)) = (
            self.corrections.diffuse(which, variance),
            self.sensitivities.get(which).copied(),
        ) {
            if which == index::AZIMUTH {
                // The platform has turned with it.
                caused.error.tilt_rad.z = 0.0;
            }
            for (sensitivity, by) in self.sensitivities.iter_mut().zip(&step.by) {
                sensitivity.add_scaled(&caused, *by);
            }
            let caused = caused.double();
            self.state.add_scaled(&caused, -f64::from(step.z));
            self.add_along(&caused, f64::from(step.variance));
        }
        if let Some(consistency) = self.consistency.get_mut(which) {
            consistency.on_walk(variance);
        }
    }

    /// Adds `variance` times `error error'` to the covariance of the INS error.
    pub(super) fn add_along(&mut self, error: &ErrorState<f64>, variance: f64) {
        for axis in 0..2 {
            self.level.add_along(&error.states(axis), 0.5 * variance);
        }
        self.vertical.add_along(&error.states(2), variance);
    }

    /// Adds to the stated variance of a parameter at once, before its turn.
    pub(super) fn widen(&mut self, which: usize, variance: f64) {
        if which == index::AZIMUTH {
            self.parameter_variance.tilt_rad.z += math::single(variance);
        }
        self.parameters.widen(which, variance);
    }

    /// Latency `seconds` before the horizon and its sigma, s.
    pub fn latency_before(&self, seconds: f64) -> (f64, f64) {
        let drift = -math::single(seconds);
        let coefficients = row([(index::LATENCY, 1.0), (index::CLOCK_DRIFT, drift)]);
        let p = &self.parameters;
        let value = p.value(index::LATENCY) - seconds * p.value(index::CLOCK_DRIFT);
        let variance = f64::from(self.corrections.variance_of(coefficients.into()));
        let inflation = self.inflation_of(index::LATENCY);
        (value, math::sqrt(variance * inflation))
    }

    /// Updates with a measured azimuth error, given its residual; whether it passed the gate.
    pub fn update_azimuth(&mut self, residual_rad: f64, sigma_rad: f64) -> bool {
        let by: [f32; COUNT] = core::array::from_fn(|which| {
            self.sensitivities
                .get(which)
                .map_or(0.0, |r| r.error.tilt_rad.z)
        });
        // Their common offset bounds what any number of them tell of the azimuth.
        let offset = math::max(f64::from(self.heading_offset), sigma_rad * sigma_rad);
        let own =
            f64::from(self.corrections.variance_of(by)) * self.inflation() + self.azimuth_walk;
        if residual_rad * residual_rad > AGREES_SIGMAS * AGREES_SIGMAS * (own + offset) {
            return false;
        }
        if own <= offset {
            return true;
        }
        let noise = offset * own / (own - offset);
        let mut row = by.map(|by| [by]);
        self.corrections.add(
            &mut row,
            [math::single(residual_rad)],
            [math::single(1.0 / (noise + self.azimuth_walk))],
        );
        // The next heading is compared with this solution.
        self.solve();
        true
    }

    /// Direct measurement of three parameters from `first` on, other than the azimuth.
    pub fn update_directly(&mut self, first: usize, value: &Vector3<f64>, variance: &Vector3<f64>) {
        let corrections = singles(&(value - self.parameters.vector(first)));
        self.corrections
            .add_direct(first, corrections.into(), singles(variance).into());
    }
}

/// A row with these elements, zero elsewhere.
fn row<const N: usize>(of: [(usize, f32); N]) -> Row {
    let mut row = Row::zeros();
    for (which, number) in of {
        if let Some(own) = row.get_mut(which) {
            *own = number;
        }
    }
    row
}

/// Sensitivities to the parameters that are estimated.
fn estimated<'a>(
    sensitivities: &'a mut [ErrorState<f32>; COUNT],
    parameters: &LeastSquares<COUNT, PAIRS>,
) -> &'a mut [ErrorState<f32>] {
    sensitivities
        .get_mut(..parameters.count())
        .unwrap_or_default()
}

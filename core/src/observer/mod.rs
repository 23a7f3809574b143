//! The exact form of the compensation estimators: every control undone, all parameters jointly.
//!
//! Equation (6) of the thesis drops `K1 dV` and `dV'`, so (7) and (8) depend on the loop. Nothing
//! need be dropped, since every control is known. An observer follows the error of the damped INS
//! by the exact (1)-(2), `dV' = f x Phi + C df`, `Phi' = -w_in x Phi - C dw`, with the controls as
//! known inputs: its innovations do not depend on the loops. They are linear in corrections to
//! the parameters, through the error that a unit of each would cause, which the observer follows
//! in the same way.
//! With gains at the noise optimum the innovations are white, so plain least squares over them
//! is what a Kalman filter with all parameters in its state would find (Friedland's separate-bias
//! estimation, IEEE TAC 14, 1969); with parameters that walk, see `Observer::let_walk`.

mod colour;
mod constancy;
mod doubt;
mod fix;
mod followed;
mod jump;
mod level;
mod manoeuvred;
mod pace;
mod passage;
mod process_noise;
mod spread;

use nalgebra::{Matrix3, SVector, Vector3};

use self::colour::{Colour, Persistence, Sensitivity};
use self::constancy::Constancy;
pub use self::doubt::{Hole, LOST_MPS};
use self::followed::{Followed, UNIT_RESPONSES};
pub use self::jump::AZIMUTH as AZIMUTH_JUMP;
use self::jump::Jump;
use self::manoeuvred::Manoeuvred;
use self::pace::Pace;
use self::process_noise::ProcessNoise;
use crate::channel::Channel;
use crate::config::Config;
use crate::error_model::InsError;
use crate::innovations::{Doubts, Innovations, Surprise};
use crate::least_squares::LeastSquares;
use crate::math::{self, singles};
use crate::parameters::{AGREES_SIGMAS, COUNT, PAIRS, Parameters, index};
use crate::time::Time;

/// One number for each parameter.
type Row = SVector<f32, COUNT>;

/// Time over which the level attitude of the mount is averaged at first, s: some manoeuvres.
const FIRST_LEVEL_S: f64 = 30.0;
/// Heights on Earth, above and below where an INS begins that has not been told one, m.
const UNKNOWN_HEIGHT_M: f64 = 9000.0;

/// Jumps that are looked for, and how.
const JUMPS: [(usize, jump::Sight); 3] = [
    (index::AZIMUTH, jump::AZIMUTH),
    (index::LATENCY, jump::LATENCY),
    (index::LATENCY, jump::BENDS),
];
/// Before anything has moved.
const CONSTANT: [Constancy; COUNT] = [Constancy::NEW; COUNT];

/// Observer of the INS error and running least squares of the parameters behind it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observer {
    /// As it is at the horizon with the parameters as they are known. The azimuth error is the
    /// first parameter.
    followed: Followed<f64>,
    /// What a unit of each parameter more would make of it.
    responses: [Followed<f32>; COUNT],
    level: Channel,
    vertical: Channel,
    innovations: [Innovations; 4],
    colours: [Colour; 4],
    /// To how strong that of heights is, and how long it lasts.
    height_sensitivity: Sensitivity,
    height_persistence: Persistence,
    gyro_noise: ProcessNoise,
    /// How the level innovations compare with what they should be, and those of the vertical, which goes
    /// wrong on its own.
    pub surprise: Surprise,
    pub vertical_surprise: Surprise,
    doubts: Doubts,
    vertical_doubts: Doubts,
    /// Of [`JUMPS`].
    jumps: [Jump; JUMPS.len()],
    /// Variance of an offset that all measured headings share beyond what they state, rad^2.
    heading_offset: f32,
    /// Corrections to the parameters.
    corrections: LeastSquares<COUNT, PAIRS>,
    /// Last solution; the latency is that of its moment.
    parameters: Parameters,
    /// Specific force in the body at the level attitude of the mount, m/s^2.
    level_force_mps2: Vector3<f64>,
    gravity_mps2: f64,
    /// Time over which that is averaged, s.
    levelled_s: f64,
    /// Whose spread is due next, and what the spreads of the parameters add to the variance of the
    /// INS error.
    next_spread: u8,
    added: InsError<f32>,
    /// How each parameter moves, and what is to be given back of the one whose turn it is.
    constancy: [Constancy; COUNT],
    given_back: Option<f32>,
    /// Smoothing with which it and the arm were learnt, s^2, and whether the arm is to be learnt anew.
    learnt_at_s2: f64,
    relearns_arm: bool,
    /// Since the horizon that the last solution was for, s; before it since the one before; and the
    /// azimuth's walk since then, rad^2.
    unsolved_s: f64,
    elapsed_s: f64,
    azimuth_walk: f64,
    /// The vertical in the body at the horizon, the force felt there, m/s^2, and its mean beyond that at the
    /// level attitude; how far the vertical was tipped, and velocity pulled, ENU.
    up: Vector3<f64>,
    felt: Vector3<f64>,
    beyond_mps2: Vector3<f32>,
    tipped: Manoeuvred,
    pulled: Manoeuvred,
    horizon: Time,
    level_pace: Pace,
    vertical_pace: Pace,
    /// When the biases of each axis last walked.
    walked: [Time; 3],
}

impl Observer {
    /// Starts on a level of some spread, and with a vertical velocity and a place of some variance;
    /// `level_force_mps2` is the specific force felt there, body. What is believed of the parameters
    /// comes by [`Self::believe`].
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
        level.doubt_position(position_variance);
        let mut vertical = Channel::new(0.0, &gnss.velocity_up_mps, &gnss.height_m);
        vertical.doubt(climb_variance, 0.0);
        vertical.doubt_position(UNKNOWN_HEIGHT_M * UNKNOWN_HEIGHT_M);
        Self {
            followed: Followed::default(),
            responses: UNIT_RESPONSES,
            level,
            vertical,
            innovations: [Innovations::default(); 4],
            colours: [Colour::new(start); 4],
            height_sensitivity: Sensitivity::default(),
            height_persistence: Persistence::default(),
            gyro_noise: ProcessNoise::configured(),
            surprise: Surprise::default(),
            vertical_surprise: Surprise::default(),
            doubts: Doubts::default(),
            vertical_doubts: Doubts::default(),
            jumps: [Jump::default(); JUMPS.len()],
            heading_offset: 0.0,
            corrections: LeastSquares::NOTHING,
            parameters: Parameters::NONE,
            level_force_mps2,
            levelled_s: FIRST_LEVEL_S,
            next_spread: 0,
            added: InsError::default(),
            constancy: CONSTANT,
            given_back: None,
            learnt_at_s2: 0.0,
            relearns_arm: false,
            unsolved_s: 0.0,
            elapsed_s: 0.0,
            azimuth_walk: 0.0,
            gravity_mps2: level_force_mps2.norm(),
            up: level_force_mps2.normalize(),
            felt: level_force_mps2,
            beyond_mps2: Vector3::zeros(),
            tipped: Manoeuvred::default(),
            pulled: Manoeuvred::default(),
            horizon: start,
            level_pace: Pace::new(start),
            vertical_pace: Pace::new(start),
            walked: [start; 3],
        }
    }

    /// Takes over what is believed of the parameters, before anything else.
    pub fn believe(&mut self, prior: &Parameters) {
        self.parameters = *prior;
        self.corrections.believe(&prior.sigma);
        self.learnt_at_s2 = prior.value(index::SMOOTHING);
        self.followed.error.tilt_rad.z = prior.value(index::AZIMUTH);
        let azimuth = prior.sigma(index::AZIMUTH);
        self.added.tilt_rad.z = math::single(azimuth * azimuth);
    }

    /// The accelerometers have levelled it, until they showed nothing: it leans by their biases,
    /// `f x Phi + C b = 0`, with `C` from `body`.
    pub fn believe_level(&mut self, body: &Matrix3<f64>) {
        let accels = self.responses.iter_mut().enumerate().skip(index::ACCEL);
        for ((which, response), bias) in accels.zip(body.column_iter()) {
            let tilt = Vector3::new(-bias.y, bias.x, 0.0) / self.gravity_mps2;
            response.error.tilt_rad = singles(&tilt);
            let sigma = self.parameters.sigma(which);
            let variance = tilt.component_mul(&tilt) * (sigma * sigma);
            self.added.tilt_rad += singles(&variance);
        }
    }

    /// The gyros have turned it, until they showed no Earth rate to the east of `north_radps`: its azimuth error
    /// has their biases in it, `w_N Phi_UP + (C b)_E = 0`.
    pub fn believe_gyrocompass(&mut self, body: &Matrix3<f64>, north_radps: f64) {
        let mut by = Row::zeros();
        for (by, bias) in by.iter_mut().skip(index::GYRO).zip(&body.row(0)) {
            *by = math::single(-bias / north_radps);
        }
        self.corrections.redefine(index::AZIMUTH, &by);
        let without = self.parameters.sigma(index::AZIMUTH);
        let azimuth = f64::from(self.corrections.variance(index::AZIMUTH));
        self.widen(index::AZIMUTH, azimuth - without * without);
    }

    /// The moment it stands at.
    pub fn horizon(&self) -> Time {
        self.horizon
    }

    /// Variance of position and of height, m^2.
    pub fn position_variance(&self) -> [f64; 2] {
        [self.level.position(), self.vertical.position()]
    }

    /// The error of the INS at the horizon.
    pub fn error(&self) -> &InsError {
        &self.followed.error
    }

    /// What is known of the parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Specific force in the body at the level attitude of the mount, m/s^2.
    pub fn level_force_mps2(&self) -> &Vector3<f64> {
        &self.level_force_mps2
    }

    /// Makes azimuth and latency those of the horizon: the first of the pieces that end with a
    /// solution. Time that passes between them is the next solution's.
    #[inline(never)]
    pub fn come_to_horizon(&mut self) {
        self.come_to_now();
        self.elapsed_s = self.unsolved_s;
        self.unsolved_s = 0.0;
    }

    /// Lets the azimuth have walked, and looks whether it or the latency has jumped. Where it is `headed`,
    /// agrees with measured headings, these are off by what seems to be a jump of the azimuth.
    #[inline(never)]
    pub fn let_azimuth_walk(&mut self, headed: bool, config: &Config) {
        let sigma = self.parameters.sigma(index::AZIMUTH);
        let (known, walked) = (sigma * sigma, self.azimuth_walk);
        self.let_walk(index::AZIMUTH, math::single(walked));
        self.azimuth_walk = 0.0;
        // By a hole, or lost.
        if walked > known {
            self.widen(index::AZIMUTH, walked);
        }
        let inflation = self.inflation();
        for (number, (which, sight)) in JUMPS.iter().enumerate() {
            let sigma = self.parameters.sigma(*which);
            let known = if *which == index::AZIMUTH {
                known + walked
            } else {
                sigma * sigma
            };
            let jump = self.jumps.get_mut(number);
            if let Some(variance) = jump.and_then(|jump| jump.square(known, inflation, sight))
                && !config.gives(*which)
            {
                self.on_jump(*which, variance);
                if *which == index::AZIMUTH && headed {
                    self.heading_offset += math::single(variance);
                }
            }
        }
    }

    /// Lets the biases of one axis have walked, that of which they last did longest ago.
    #[inline(never)]
    pub fn let_biases_walk(&mut self, config: &Config) {
        let walked = self.walked.iter_mut().enumerate();
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
            self.let_walk(first + axis, math::single(walk * walk * seconds));
        }
    }

    /// Solves for the parameters.
    #[inline(never)]
    pub fn solve(&mut self) {
        let corrections = self.corrections.solve();
        self.corrections.count_from_solution();
        let mut total = Followed::default();
        let responses = estimated(&mut self.responses, &self.corrections);
        for (response, by) in responses.iter().zip(&corrections) {
            total.add_scaled(&response.double(), f64::from(*by));
        }
        self.followed.add_scaled(&total, 1.0);
        self.parameters.value += corrections.map(f64::from);
        for (constancy, by) in self.constancy.iter_mut().zip(&corrections) {
            constancy.moved(*by);
        }
    }

    /// Makes azimuth and latency those of the horizon, where the other parameters have moved them.
    fn come_to_now(&mut self) {
        let azimuth = Row::from_fn(|which, _| match self.responses.get(which) {
            Some(response) if which != index::AZIMUTH => response.error.tilt_rad.z,
            _ => 0.0,
        });
        self.carry_forward(index::AZIMUTH, &azimuth);
        let responses = estimated(&mut self.responses, &self.corrections);
        for (response, unit) in responses.iter_mut().zip(&UNIT_RESPONSES) {
            response.error.tilt_rad.z = unit.error.tilt_rad.z;
        }
        let latency = row([(index::CLOCK_DRIFT, math::single(self.unsolved_s))]);
        let before = self.corrections.variance(index::LATENCY);
        self.carry_forward(index::LATENCY, &latency);
        let drifted = self.corrections.variance(index::LATENCY) - before;
        if let Some(constancy) = self.constancy.get_mut(index::LATENCY) {
            constancy.walked(drifted);
        }
        let p = &mut self.parameters;
        p.shift(
            index::LATENCY,
            self.unsolved_s * p.value(index::CLOCK_DRIFT),
        );
    }

    /// Makes parameter `which` that of now, where it is greater by `by` times the later ones.
    pub(super) fn carry_forward(&mut self, which: usize, by: &Row) {
        self.corrections.redefine(which, by);
        let Some(own) = self.responses.get(which).copied() else {
            return;
        };
        for (response, by) in self.responses.iter_mut().zip(by) {
            if *by != 0.0 {
                response.add_scaled(&own, -by);
            }
        }
    }

    /// Lets a parameter have walked by a variance.
    ///
    /// What the INS shows of it was caused by what it was before. That is what it is now less the
    /// step, of which the least squares know a part: the rest is noise of the INS (Hsieh and Chen,
    /// Optimal solution of the two-stage Kalman estimator, IEEE TAC 44, 1999).
    pub(super) fn let_walk(&mut self, which: usize, variance: f32) {
        if let (Some(step), Some(mut caused)) = (
            self.corrections.diffuse(which, variance),
            self.responses.get(which).copied(),
        ) {
            if which == index::AZIMUTH {
                // The platform has turned with it.
                caused.error.tilt_rad.z = 0.0;
            }
            for (response, by) in self.responses.iter_mut().zip(&step.by) {
                response.add_scaled(&caused, *by);
            }
            let caused = caused.double();
            self.followed.add_scaled(&caused, -f64::from(step.z));
            self.doubt_along(&caused, f64::from(step.variance));
        }
        if let Some(constancy) = self.constancy.get_mut(which) {
            constancy.walked(variance);
        }
    }

    /// The INS may err by `error` more, times a number of this variance.
    pub(super) fn doubt_along(&mut self, error: &Followed<f64>, variance: f64) {
        for axis in 0..2 {
            self.level.doubt_along(&error.states(axis), 0.5 * variance);
        }
        self.vertical.doubt_along(&error.states(2), variance);
    }

    /// States a parameter with this variance more, before its turn has come.
    pub(super) fn widen(&mut self, which: usize, variance: f64) {
        if which == index::AZIMUTH {
            self.added.tilt_rad.z += math::single(variance);
        }
        self.parameters.widen(which, variance);
    }

    /// Latency `seconds` before the horizon and its spread, s.
    pub fn latency_before(&self, seconds: f64) -> (f64, f64) {
        let drift = -math::single(seconds);
        let coefficients = row([(index::LATENCY, 1.0), (index::CLOCK_DRIFT, drift)]);
        let p = &self.parameters;
        let value = p.value(index::LATENCY) - seconds * p.value(index::CLOCK_DRIFT);
        let variance = f64::from(self.corrections.variance_of(coefficients.into()));
        let inflation = self.inflation_of(index::LATENCY);
        (value, math::sqrt(variance * inflation))
    }

    /// Takes a measured azimuth error that is off by `residual` of what it should be; whether it is
    /// credible.
    pub fn take_azimuth(&mut self, residual_rad: f64, sigma_rad: f64) -> bool {
        let by: [f32; COUNT] = core::array::from_fn(|which| {
            self.responses
                .get(which)
                .map_or(0.0, |r| r.error.tilt_rad.z)
        });
        // However many there are, they tell the azimuth no better than to this.
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
        // The next one is compared with what this one shows.
        self.solve();
        true
    }

    /// Adds a direct measurement of three parameters from `first` on, other than the azimuth.
    pub fn measure_directly(
        &mut self,
        first: usize,
        value: &Vector3<f64>,
        variance: &Vector3<f64>,
    ) {
        let corrections = singles(&(value - self.parameters.vector(first)));
        self.corrections
            .add_direct(first, corrections.into(), singles(variance).into());
    }
}

/// A number for each of some parameters, zero for all others.
fn row<const N: usize>(of: [(usize, f32); N]) -> Row {
    let mut row = Row::zeros();
    for (which, number) in of {
        if let Some(own) = row.get_mut(which) {
            *own = number;
        }
    }
    row
}

/// The responses to the parameters that are not known exactly.
fn estimated<'a>(
    responses: &'a mut [Followed<f32>; COUNT],
    parameters: &LeastSquares<COUNT, PAIRS>,
) -> &'a mut [Followed<f32>] {
    responses.get_mut(..parameters.count()).unwrap_or_default()
}

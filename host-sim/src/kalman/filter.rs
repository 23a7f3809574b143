//! The filter itself: predicts over intervals, corrects by fixes.

use ins_core::config::HeadingSource;
use ins_core::earth::Geodetic;
use ins_core::increments::Interval;
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{Estimate, Estimates, GnssFix, Navigator, Observability, Solution, Time};
use nalgebra::{SVector, Vector3};

use super::dynamics::Span;
use super::{Noise, STATES, StateMatrix, States, index};

/// Longest step of the covariance, s; a fix ends it earlier.
const COVARIANCE_STEP_S: f64 = 0.1;
/// Time constant of the acceleration by which a fix is carried to its own moment, s: short beside
/// a manoeuvre, long beside the vibration of an engine.
const ACCEL_S: f64 = 0.03;
/// An innovation this many sigmas away is an outlier, unless so many fixes in a row have one.
const GATE_SIGMAS: f64 = 5.0;
const LOST_FIXES: u32 = 10;
/// As in the core, a parameter counts as observed below this part of its spread at the start; the
/// azimuth of that of a heading known to 0.1 rad.
const OBSERVED: f64 = 0.33;
const AZIMUTH_RAD: f64 = 0.1;

/// An INS and the covariance of its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Stamp of the last interval's end.
    pub time: Time,
    /// The INS and its sensors, less all errors that were found.
    pub known: Known,
    /// Covariance of the errors that are left, as of the last covariance step.
    pub covariance: StateMatrix,
    noise: Noise,
    covariance_step_s: f64,
    span: Span,
    transition: StateMatrix,
    accel_mps2: Vector3<f64>,
    refused: u32,
}

/// The INS and what is taken out of its readings and stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Position, velocity and attitude.
    pub ins: Mechanization,
    /// Accelerometer biases, m/s^2.
    pub accel_bias_mps2: Vector3<f64>,
    /// Gyro biases, rad/s.
    pub gyro_bias_radps: Vector3<f64>,
    /// A fix stamped t shows the motion at t minus this, s.
    pub latency_s: f64,
}

/// What a fix did: all that a smoother needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// Transition of the errors since the last correction.
    pub transition: StateMatrix,
    /// Covariance before.
    pub predicted: StateMatrix,
    /// Covariance after.
    pub corrected: StateMatrix,
    /// Errors found, and taken out.
    pub errors: States,
}

/// Where the filter begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// When.
    pub time: Time,
    /// Aligned.
    pub ins: Mechanization,
    /// Spread of its roll and pitch, rad, if that is known.
    pub tilt_sigma_rad: Option<f64>,
    /// Spread of its heading, rad.
    pub heading_sigma_rad: f64,
    /// Gyro biases as the alignment knows them, rad/s.
    pub gyro_bias_radps: Vector3<f64>,
    /// Their spreads, rad/s.
    pub gyro_bias_sigma_radps: [f64; 3],
}

impl Start {
    /// Where the core's alignment has ended; `None` before. The error of a heading that is given
    /// nobody but the user knows.
    pub fn of(navigator: &Navigator, time: Time, noise: &Noise) -> Option<Self> {
        let ins = *navigator.mechanization()?;
        let estimates = navigator.estimates();
        let [x, y, z] = estimates.gyro_bias_radps;
        let given = matches!(navigator.config().heading, HeadingSource::Given(_));
        Some(Self {
            time,
            ins,
            tilt_sigma_rad: navigator.tilt_sigma_rad(),
            heading_sigma_rad: if given {
                noise.heading_sigma_rad
            } else {
                estimates.azimuth_error_rad.sigma
            },
            gyro_bias_radps: [x.value, y.value, z.value].into(),
            gyro_bias_sigma_radps: [x.sigma, y.sigma, z.sigma],
        })
    }
}

impl Filter {
    /// Begins on what the alignment found.
    pub fn new(start: &Start, noise: &Noise) -> Self {
        let gyro_sigma = start
            .gyro_bias_sigma_radps
            .map(|sigma| sigma.min(noise.gyro_bias_radps));
        Self {
            time: start.time,
            known: Known {
                ins: start.ins,
                accel_bias_mps2: Vector3::zeros(),
                gyro_bias_radps: start.gyro_bias_radps,
                latency_s: 0.0,
            },
            covariance: noise.start(
                start.ins.velocity_enu_mps.norm(),
                start.tilt_sigma_rad,
                start.heading_sigma_rad,
                gyro_sigma,
            ),
            noise: *noise,
            covariance_step_s: COVARIANCE_STEP_S,
            span: Span::default(),
            transition: StateMatrix::identity(),
            accel_mps2: Vector3::zeros(),
            refused: 0,
        }
    }

    /// Steps the covariance at every inertial sample, as most filters in firmware do.
    #[must_use]
    pub fn with_covariance_at_every_sample(self) -> Self {
        Self {
            covariance_step_s: 0.0,
            ..self
        }
    }

    /// One sigma of each error.
    pub fn sigmas(&self) -> States {
        self.covariance.diagonal().map(|v| v.max(0.0).sqrt())
    }

    /// Advances over the interval that ends at `time`.
    pub fn predict(&mut self, time: Time, raw: &Interval) {
        let interval = raw.without_bias(&self.known.gyro_bias_radps, &self.known.accel_bias_mps2);
        let before = self.known.ins.velocity_enu_mps;
        let step = self.known.ins.step(&interval, &Controls::default());
        let accel = (self.known.ins.velocity_enu_mps - before) / interval.seconds;
        let part = (interval.seconds / ACCEL_S).min(1.0);
        self.accel_mps2 += part * (accel - self.accel_mps2);
        self.span.add(&interval, &step);
        self.time = time;
        if self.span.seconds >= self.covariance_step_s {
            self.step_covariance();
        }
    }

    fn step_covariance(&mut self) {
        if self.span.seconds <= 0.0 {
            return;
        }
        let transition = self.span.transition(
            &self.known.ins.local_earth(),
            &self.known.ins.velocity_enu_mps,
        );
        // Half of the noise before and half after: exact to second order.
        let growth = 0.5 * self.span.seconds * self.noise.growth();
        add_to_diagonal(&mut self.covariance, &growth);
        self.covariance = transition * self.covariance * transition.transpose();
        add_to_diagonal(&mut self.covariance, &growth);
        make_symmetric(&mut self.covariance);
        self.transition = transition * self.transition;
        self.span = Span::default();
    }

    /// Compares a fix whose moment has just passed, and takes out the errors it shows.
    pub fn correct(&mut self, fix: &GnssFix) -> Correction {
        self.step_covariance();
        let predicted = self.covariance;
        let moment = fix.time.plus_seconds(-self.known.latency_s);
        let mut update = Update {
            errors: States::zeros(),
            covariance: self.covariance,
            gated: self.refused < LOST_FIXES,
            refused: false,
        };
        self.compare_velocity(fix, moment, &mut update);
        self.compare_position(fix, moment, &mut update);
        self.refused = if update.refused { self.refused + 1 } else { 0 };
        self.covariance = update.covariance;
        self.known = self.known.less(&update.errors);
        Correction {
            transition: core::mem::replace(&mut self.transition, StateMatrix::identity()),
            predicted,
            corrected: self.covariance,
            errors: update.errors,
        }
    }

    /// (5): `dV + a (tau - tau')`, at the moment of the fix.
    fn compare_velocity(&self, fix: &GnssFix, moment: Time, update: &mut Update) {
        let since_s = self.time.seconds_since(moment);
        let then = self.known.ins.velocity_enu_mps - since_s * self.accel_mps2;
        let difference = then - fix.velocity_enu_mps();
        let level = fix
            .sigma
            .velocity_mps
            .unwrap_or(self.noise.velocity_sigma_mps);
        let sigmas = [level, level, fix.sigma.velocity_up_mps.unwrap_or(level)];
        let has = [
            fix.velocity_en_mps.is_some(),
            fix.velocity_en_mps.is_some(),
            fix.velocity_up_mps.is_some(),
        ];
        for axis in (0..3).filter(|axis| has[*axis]) {
            let seen = Seen {
                state: index::VELOCITY + axis,
                by_latency: self.accel_mps2[axis],
                difference: difference[axis],
                variance: sigmas[axis] * sigmas[axis],
            };
            update.take(&seen);
        }
    }

    fn compare_position(&self, fix: &GnssFix, moment: Time, update: &mut Update) {
        let ins = self.known.ins.position;
        let has = [
            fix.position.is_some(),
            fix.position.is_some(),
            fix.height_m.is_some(),
        ];
        let there = fix.geodetic_or(ins.height_m).unwrap_or(Geodetic {
            height_m: fix.height_m.unwrap_or(ins.height_m),
            ..ins
        });
        let since_s = self.time.seconds_since(moment);
        let velocity = self.known.ins.velocity_enu_mps;
        let moved = since_s * (velocity - 0.5 * since_s * self.accel_mps2);
        let difference = ins.enu_from(&there) - moved;
        for axis in (0..3).filter(|axis| has[*axis]) {
            let sigma = self.noise.position_sigma_m[axis];
            update.take(&Seen {
                state: index::POSITION + axis,
                by_latency: velocity[axis] - since_s * self.accel_mps2[axis],
                difference: difference[axis],
                variance: sigma * sigma,
            });
        }
    }
}

impl Known {
    /// The same less errors that were found.
    pub(super) fn less(mut self, errors: &States) -> Self {
        let three = |at: usize| errors.fixed_rows::<3>(at).into_owned();
        let earth = self.ins.local_earth();
        self.ins.move_by(&earth, &-three(index::POSITION));
        self.ins.velocity_enu_mps -= three(index::VELOCITY);
        self.ins.turn_platform(&-three(index::ATTITUDE));
        self.accel_bias_mps2 += three(index::ACCEL);
        self.gyro_bias_radps += three(index::GYRO);
        self.latency_s += errors[index::LATENCY];
        self
    }

    /// In the core's terms, with the spreads of all errors. The azimuth error is what is left: the
    /// filter takes out all that it finds.
    pub fn estimates(&self, sigmas: &States, noise: &Noise) -> Estimates {
        let estimate = |value: f64, state: usize, start: f64| Estimate {
            value,
            sigma: sigmas[state],
            observability: if sigmas[state] < OBSERVED * start {
                Observability::Observable
            } else {
                Observability::NeedsTime
            },
        };
        let three = |values: Vector3<f64>, at: usize, start: f64| {
            [0, 1, 2].map(|axis| estimate(values[axis], at + axis, start))
        };
        Estimates {
            azimuth_error_rad: estimate(0.0, index::ATTITUDE + 2, AZIMUTH_RAD),
            accel_bias_mps2: three(self.accel_bias_mps2, index::ACCEL, noise.accel_bias_mps2),
            gyro_bias_radps: three(self.gyro_bias_radps, index::GYRO, noise.gyro_bias_radps),
            gnss_latency_s: estimate(self.latency_s, index::LATENCY, noise.latency_sigma_s),
            ..Estimates::default()
        }
    }

    /// Position, velocity and attitude.
    pub fn solution(&self, time: Time) -> Solution {
        Solution {
            time,
            position: self.ins.position,
            velocity_enu_mps: self.ins.velocity_enu_mps,
            attitude: self.ins.attitude,
        }
    }
}

/// One component of a fix: an error, and the latency's share.
struct Seen {
    state: usize,
    by_latency: f64,
    difference: f64,
    variance: f64,
}

/// A fix being taken, component by component.
struct Update {
    errors: States,
    covariance: StateMatrix,
    gated: bool,
    refused: bool,
}

impl Update {
    /// Joseph's form, written out for a row of two entries.
    fn take(&mut self, seen: &Seen) {
        let p = &self.covariance;
        // P H^T.
        let ph: SVector<f64, STATES> =
            p.column(seen.state) + seen.by_latency * p.column(index::LATENCY);
        let hph = ph[seen.state] + seen.by_latency * ph[index::LATENCY];
        let variance = hph + seen.variance;
        let expected = self.errors[seen.state] + seen.by_latency * self.errors[index::LATENCY];
        let innovation = seen.difference - expected;
        if self.gated && innovation * innovation > GATE_SIGMAS * GATE_SIGMAS * variance {
            self.refused = true;
            return;
        }
        let gain = ph / variance;
        self.errors += innovation * gain;
        // (I - K H) P (I - K H)^T + K R K^T.
        let cross = gain * ph.transpose();
        self.covariance += gain * (variance * gain.transpose()) - cross - cross.transpose();
        make_symmetric(&mut self.covariance);
    }
}

fn add_to_diagonal(matrix: &mut StateMatrix, values: &States) {
    for (state, value) in values.iter().enumerate() {
        matrix[(state, state)] += value;
    }
}

fn make_symmetric(matrix: &mut StateMatrix) {
    *matrix = 0.5 * (*matrix + matrix.transpose());
}

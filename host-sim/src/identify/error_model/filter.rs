//! The likelihood of a drive under an error model of its gyros: a Kalman filter over
//! thesis equation (1) with the biases of (3) or (4).
//!
//! Constants and trends of the biases start without knowledge, so that the likelihood is the
//! restricted one (REML): it says nothing of their spread and does not bias the other variances.

use std::ops::Range;

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use super::interval::Measured;
use super::record::{Difference, Epoch, Felt, Record};
use crate::sim::ErrorModel;
use crate::sim::errors::{BiasModel, Law};
use crate::sim::receiver::Correlated;

/// Velocity error, tilt, random part of the biases of gyros and accelerometers.
const VELOCITY: usize = 0;
const TILT: usize = 2;
const RANDOM: usize = 5;
const ACCEL_RANDOM: usize = 8;
/// Noise of GNSS velocity that has a memory.
const MEMORY: usize = 11;
const SIZE: usize = 13;

/// What stays as it is over a drive: constants and trends of the gyro biases, errors of the
/// accelerometers and of scales, lever arm and latency, less what the navigator has found of them.
/// What gyros level in the mount make of turns about its vertical is in those of the accelerometers:
/// no turn tells them apart.
const CONSTANT: usize = 0;
const TREND: usize = 3;
const ACCEL: usize = 6;
const ACCEL_SCALE: usize = 9;
const GYRO_SCALE: usize = 12;
const LEVER_ARM: usize = 15;
const LATENCY: usize = 18;
const PARAMETERS: usize = 19;
/// A row of their effects; the last one is that of the measurements.
const ROWS: usize = PARAMETERS + 1;
const MEAN: usize = PARAMETERS;

type Vector = SVector<f64, SIZE>;
type Matrix = SMatrix<f64, SIZE, SIZE>;
type Parameters = SVector<f64, PARAMETERS>;

/// What is believed at the start of velocity and tilt, m/s and rad; of the azimuth at least.
const START_SIGMA: [f64; RANDOM] = [1.0, 1.0, 0.01, 0.01, 0.05];
/// And of the parameters: rad/s for a constant and for what a trend does over a drive (100 deg/h:
/// nothing, beside what a drive tells, and so are these of m and s).
const BIAS_SIGMA: f64 = 5e-4;
const LEVER_ARM_SIGMA: f64 = 1.0;
const LATENCY_SIGMA: f64 = 0.1;

/// What sensors of a class may be off by, one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Class {
    pub accel_bias_mps2: f64,
    /// How they move from there, m/s^2.
    pub accel_dynamics: Dynamics,
    pub accel_scale: f64,
    pub gyro_scale: f64,
}

impl Class {
    pub fn of(model: &ErrorModel) -> Self {
        Self {
            accel_bias_mps2: model.accel_mps2.bias.initial_sigma(),
            accel_dynamics: Dynamics::of(&model.accel_mps2.bias, 1.0),
            accel_scale: model.accel_mps2.scale_sigma,
            gyro_scale: model.gyro_deg_h.scale_sigma,
        }
    }
}

/// How the random part of a bias moves. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Jumps at whole multiples of an interval since the start of the log, or exponentially
    /// correlated.
    pub law: Law,
    /// Spread of a jump, or standard deviation, rad/s of gyros.
    pub size: f64,
    /// Interval, or correlation time, s.
    pub time_s: f64,
}

impl Dynamics {
    /// Of a model whose unit is so much in SI.
    pub fn of(bias: &BiasModel, unit: f64) -> Self {
        let (law, size, time_s) = match *bias {
            BiasModel::Wave {
                jump_sigma,
                interval_s,
                ..
            } => (Law::Wave, jump_sigma, interval_s),
            BiasModel::Continuous {
                correlated_sigma,
                correlation_time_s,
                ..
            } => (Law::Continuous, correlated_sigma, correlation_time_s),
        };
        let size = size * unit;
        Self { law, size, time_s }
    }

    /// As a noise with a memory, which it is in (4).
    fn correlated(&self) -> Correlated {
        Correlated {
            sigma: self.size,
            time_s: self.time_s,
        }
    }

    /// What the trend of a bias is multiplied by: jumps so far, or time.
    fn trend_at(&self, time_s: f64) -> f64 {
        match self.law {
            Law::Wave => (time_s / self.time_s).floor(),
            Law::Continuous => time_s,
        }
    }

    /// Part of an epoch that lies before a jump; none without one.
    fn jump_in(&self, epoch: &Epoch) -> Option<f64> {
        if self.law == Law::Continuous {
            return None;
        }
        let jump_s = self.time_s * self.trend_at(epoch.start_s + epoch.seconds);
        let part = (jump_s - epoch.start_s) / epoch.seconds;
        (part > 0.0).then_some(part)
    }

    /// The random part over an epoch, from when until when: in jumps it stays as it is in the middle.
    fn mean_over(&self, epoch: &Epoch) -> ([f64; 2], Mean) {
        match self.law {
            Law::Wave => ([epoch.middle_s(); 2], Mean::STILL),
            Law::Continuous => {
                let mean = Mean::new(&self.correlated(), epoch.seconds, PARTS);
                ([epoch.start_s, epoch.start_s + epoch.seconds], mean)
            }
        }
    }

    /// The same over an epoch with a jump, after which this part of it lies.
    fn mean_over_jump(&self, part: f64) -> Mean {
        let jump = self.size * self.size;
        Mean {
            kept: 1.0,
            variance: part * part * jump,
            covariance: part * jump,
            step: (1.0, jump),
        }
    }

    fn initial_variance(&self) -> f64 {
        match self.law {
            Law::Wave => 0.0,
            Law::Continuous => self.size * self.size,
        }
    }

    /// From one time to a later one: what part is kept, and the variance that is added.
    fn step(&self, from_s: f64, to_s: f64) -> (f64, f64) {
        match self.law {
            Law::Wave => {
                let jumps = self.trend_at(to_s) - self.trend_at(from_s);
                (1.0, jumps * self.size * self.size)
            }
            Law::Continuous => step(&self.correlated(), to_s - from_s),
        }
    }
}

/// A candidate error model of the gyros. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Root of the noise density of a gyro, rad/sqrt(s).
    pub gyro_noise: f64,
    /// Root of the noise density of an accelerometer, m/s/sqrt(s).
    pub accel_noise: f64,
    /// Noise of one GNSS velocity component, m/s.
    pub gnss_sigma_mps: f64,
    /// Noise of it with a memory, on top.
    pub gnss_memory: Correlated,
    /// Random part of the gyro biases.
    pub dynamics: Dynamics,
    /// What is believed of the rest.
    pub class: Class,
}

impl Candidate {
    fn biases(&self) -> [(Range<usize>, Dynamics); 2] {
        [
            (RANDOM..ACCEL_RANDOM, self.dynamics),
            (ACCEL_RANDOM..MEMORY, self.class.accel_dynamics),
        ]
    }

    /// One sigma of the parameters before a drive.
    fn prior(&self, record: &Record) -> Parameters {
        let mut sigma = Parameters::zeros();
        for (first, of_three) in [
            (CONSTANT, BIAS_SIGMA),
            (TREND, trend_sigma(record, &self.dynamics)),
            (ACCEL, self.class.accel_bias_mps2),
            (ACCEL_SCALE, self.class.accel_scale),
            (GYRO_SCALE, self.class.gyro_scale),
            (LEVER_ARM, LEVER_ARM_SIGMA),
        ] {
            sigma.fixed_rows_mut::<3>(first).fill(of_three);
        }
        sigma[LATENCY] = LATENCY_SIGMA;
        sigma
    }
}

/// What a drive says under a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Logarithm of the restricted likelihood, up to a constant.
    pub log_likelihood: f64,
    /// Constants of the biases, body axes, rad/s, and trends, rad/s per second or per jump.
    biases: Vector6<f64>,
    /// Of their errors.
    covariance: Matrix6<f64>,
    /// What a trend was believed to be before, one sigma.
    trend_sigma: f64,
}

impl Answer {
    /// To a candidate beyond all sense.
    fn none() -> Self {
        Self {
            log_likelihood: f64::NEG_INFINITY,
            biases: Vector6::zeros(),
            covariance: Matrix6::from_diagonal_element(f64::INFINITY),
            trend_sigma: 1.0,
        }
    }

    /// Constants, with trends drawn as a model says instead of unknown.
    pub fn constants_given(&self, trend_mean: f64, trend_sigma: f64) -> [Measured; 3] {
        let (constants, trends) = (self.three(CONSTANT), self.three(TREND));
        let both = self.covariance.fixed_view::<3, 3>(CONSTANT, TREND);
        let drawn = Matrix3::from_diagonal_element(trend_sigma * trend_sigma);
        let by = both * (trends.1 + drawn).try_inverse().unwrap_or_default();
        let value = constants.0 + by * (Vector3::repeat(trend_mean) - trends.0);
        independent(&value, &(constants.1 - by * both.transpose()))
    }

    pub fn shown_constants(&self, trend_mean: f64, trend_sigma: f64) -> Vec<Measured> {
        shown(self.constants_given(trend_mean, trend_sigma), BIAS_SIGMA)
    }

    pub fn shown_trends(&self) -> Vec<Measured> {
        let (value, covariance) = self.three(TREND);
        shown(independent(&value, &covariance), self.trend_sigma)
    }

    pub fn trends(&self) -> [Measured; 3] {
        let (value, covariance) = self.three(TREND);
        [0, 1, 2].map(|axis| Measured {
            value: value[axis],
            variance: covariance[(axis, axis)],
        })
    }

    fn three(&self, first: usize) -> (Vector3<f64>, Matrix3<f64>) {
        (
            self.biases.fixed_rows::<3>(first).into_owned(),
            self.covariance
                .fixed_view::<3, 3>(first, first)
                .into_owned(),
        )
    }

    /// Log-likelihood with constants and trends drawn as a model says, instead of unknown.
    pub fn marginal(&self, constant_sigma: f64, trend_mean: f64, trend_sigma: f64) -> f64 {
        let mut off = self.biases;
        let mut covariance = self.covariance;
        for axis in 0..3 {
            off[TREND + axis] -= trend_mean;
            covariance[(CONSTANT + axis, CONSTANT + axis)] += constant_sigma * constant_sigma;
            covariance[(TREND + axis, TREND + axis)] += trend_sigma * trend_sigma;
        }
        let Some(factor) = covariance.cholesky() else {
            return f64::NEG_INFINITY;
        };
        let root = factor.l_dirty().diagonal().map(libm::log).sum();
        // The density of what was believed before, which is flat.
        let before = 3.0 * libm::log(BIAS_SIGMA * self.trend_sigma);
        self.log_likelihood + before - root - 0.5 * off.dot(&factor.solve(&off))
    }
}

/// Along axes whose errors do not go together: spreads are alike along all.
fn independent(value: &Vector3<f64>, covariance: &Matrix3<f64>) -> [Measured; 3] {
    let axes = covariance.symmetric_eigen();
    let value = axes.eigenvectors.tr_mul(value);
    [0, 1, 2].map(|axis| Measured {
        value: value[axis],
        variance: axes.eigenvalues[axis].max(f64::MIN_POSITIVE),
    })
}

/// What a drive shows: what was believed before is none.
fn shown(all: [Measured; 3], believed: f64) -> Vec<Measured> {
    let shown = |one: &Measured| one.beyond(believed).is_some();
    all.into_iter().filter(shown).collect()
}

pub fn filter(record: &Record, candidate: &Candidate) -> Answer {
    let mut state = State::new(record, candidate);
    for epoch in &record.epochs {
        match candidate.dynamics.jump_in(epoch) {
            Some(part) => {
                let (before, after) = epoch.split(part);
                state.take(&before, None, candidate);
                if let Some(rate) = epoch.rest_rate_radps.as_ref().filter(|_| !epoch.broken) {
                    let mean = candidate.dynamics.mean_over_jump(1.0 - part);
                    let trend = candidate.dynamics.trend_at(state.time_s) + 1.0 - part;
                    state.measure_biases(rate, candidate.gyro_noise, epoch.seconds, (trend, &mean));
                    state.time_s = after.middle_s();
                }
                state.take(&after, None, candidate);
            }
            None => state.take(epoch, epoch.rest_rate_radps.as_ref(), candidate),
        }
    }
    state.answer(record, &candidate.prior(record))
}

/// Not by whole jumps: one more at the very end must not make the model likelier.
fn trend_sigma(record: &Record, dynamics: &Dynamics) -> f64 {
    let unit_s = match dynamics.law {
        Law::Wave => dynamics.time_s,
        Law::Continuous => 1.0,
    };
    BIAS_SIGMA * unit_s / record.duration_s.max(1.0)
}

/// A filter of two stages (Friedland, 1969): the first one knows nothing of the parameters, the
/// second has their effects on it.
struct State {
    time_s: f64,
    start_sigma: [f64; RANDOM],
    covariance: Matrix,
    /// What one of each parameter makes of the state, a row each; the mean without any.
    effects: SMatrix<f64, ROWS, SIZE>,
    /// Sum over the measurements of the products of effects on them, weighed; the last row and
    /// column are those of the measurements themselves.
    information: SMatrix<f64, ROWS, ROWS>,
    log_variances: f64,
}

impl State {
    fn new(record: &Record, candidate: &Candidate) -> Self {
        let [east, north, tilt_east, tilt_north, azimuth] = START_SIGMA;
        let azimuth = azimuth.max(record.azimuth_sigma_rad);
        let start_sigma = [east, north, tilt_east, tilt_north, azimuth];
        let mut covariance = Matrix::zeros();
        for (axis, sigma) in start_sigma.into_iter().enumerate() {
            covariance[(axis, axis)] = sigma * sigma;
        }
        for (axes, dynamics) in candidate.biases() {
            for axis in axes {
                covariance[(axis, axis)] = dynamics.initial_variance();
            }
        }
        let remembered = candidate.gnss_memory.sigma * candidate.gnss_memory.sigma;
        for axis in MEMORY..SIZE {
            covariance[(axis, axis)] = remembered;
        }
        Self {
            time_s: 0.0,
            start_sigma,
            covariance,
            effects: SMatrix::zeros(),
            information: SMatrix::zeros(),
            log_variances: 0.0,
        }
    }

    /// The parameters by what was believed of them and what they explain of the measurements.
    fn answer(&self, record: &Record, prior: &Parameters) -> Answer {
        let spread = SMatrix::from_diagonal(prior);
        let within = (self.information).fixed_view::<PARAMETERS, PARAMETERS>(0, 0);
        let seen = -(self.information).fixed_view::<PARAMETERS, 1>(0, MEAN);
        // In units of what was believed: parameters that cannot be off drop out.
        let scaled = SMatrix::identity() + spread * within * spread;
        let pull: Parameters = spread * seen;
        let Some(factor) = scaled.cholesky() else {
            return Answer::none();
        };
        let log_determinant = 2.0 * factor.l_dirty().diagonal().map(libm::log).sum();
        let mean = spread * factor.solve(&pull);
        let covariance = spread * factor.inverse() * spread;
        let square = self.information[(MEAN, MEAN)] - pull.dot(&factor.solve(&pull));
        let mut biases = mean.fixed_rows::<6>(CONSTANT).into_owned();
        let mut constants = biases.fixed_rows_mut::<3>(CONSTANT);
        constants += record.gyro_reference_radps;
        Answer {
            log_likelihood: -0.5 * (self.log_variances + log_determinant + square),
            biases,
            covariance: covariance
                .fixed_view::<6, 6>(CONSTANT, CONSTANT)
                .into_owned(),
            trend_sigma: prior[TREND],
        }
    }

    /// An epoch, with the biases that gyros read in it.
    fn take(&mut self, epoch: &Epoch, rate: Option<&Vector3<f64>>, candidate: &Candidate) {
        let ([from_s, to_s], mean) = candidate.dynamics.mean_over(epoch);
        self.wander(from_s, candidate);
        match &epoch.difference {
            Some(difference) if !epoch.broken => {
                self.measure_velocity(epoch, difference, candidate);
            }
            _ => self.forget(MEMORY..SIZE, step(&candidate.gnss_memory, epoch.seconds)),
        }
        if epoch.broken {
            self.lose_attitude();
            return;
        }
        let trend = candidate.dynamics.trend_at(epoch.middle_s());
        let noise = candidate.gyro_noise * candidate.gyro_noise;
        if let Some(rate) = rate {
            self.measure_biases(rate, candidate.gyro_noise, epoch.seconds, (trend, &mean));
        }
        self.propagate(epoch, (trend, &mean));
        self.time_s = to_s;
        self.diffuse(epoch, noise * epoch.seconds, candidate.accel_noise);
    }

    /// Noise of the sensors over an epoch: what the tilt has walked, and velocity with it. At rest
    /// the turning of the platform is known, noise and all.
    fn diffuse(&mut self, epoch: &Epoch, walked: f64, accel_noise: f64) {
        for axis in VELOCITY..VELOCITY + 2 {
            self.covariance[(axis, axis)] += accel_noise * accel_noise * epoch.seconds;
        }
        if epoch.rest_rate_radps.is_some() {
            return;
        }
        let by_tilt = [0, 1].map(|axis| force_by_tilt(&epoch.felt.force_mps, axis));
        for axis in 0..3 {
            self.covariance[(TILT + axis, TILT + axis)] += walked;
        }
        for (axis, by) in by_tilt.iter().enumerate() {
            for tilt in 0..3 {
                self.covariance[(VELOCITY + axis, TILT + tilt)] += 0.5 * walked * by[tilt];
                self.covariance[(TILT + tilt, VELOCITY + axis)] += 0.5 * walked * by[tilt];
            }
            for (other, by_other) in by_tilt.iter().enumerate() {
                self.covariance[(VELOCITY + axis, VELOCITY + other)] +=
                    walked / 3.0 * by.dot(by_other);
            }
        }
    }

    fn wander(&mut self, to_s: f64, candidate: &Candidate) {
        for (axes, dynamics) in candidate.biases() {
            self.forget(axes, dynamics.step(self.time_s, to_s));
        }
        self.time_s = to_s;
    }

    /// All but a part of some states, and adds a variance to them.
    fn forget(&mut self, states: Range<usize>, (keep, variance): (f64, f64)) {
        for axis in states {
            if keep < 1.0 {
                self.effects.column_mut(axis).scale_mut(keep);
                self.covariance.row_mut(axis).scale_mut(keep);
                self.covariance.column_mut(axis).scale_mut(keep);
            }
            self.covariance[(axis, axis)] += variance;
        }
    }

    /// After a hole velocity and attitude begin anew; the biases go on.
    fn lose_attitude(&mut self) {
        for (axis, sigma) in self.start_sigma.into_iter().enumerate() {
            self.effects.column_mut(axis).fill(0.0);
            self.covariance.row_mut(axis).fill(0.0);
            self.covariance.column_mut(axis).fill(0.0);
            self.covariance[(axis, axis)] = sigma * sigma;
        }
    }

    /// `dV` at the fixes: that of the start and what the tilt and the accelerometers have made of
    /// it since.
    fn measure_velocity(&mut self, epoch: &Epoch, difference: &Difference, candidate: &Candidate) {
        let fixes = f64::from(difference.fixes);
        let white = candidate.gnss_sigma_mps * candidate.gnss_sigma_mps / fixes;
        let mean = Mean::new(&candidate.gnss_memory, epoch.seconds, difference.fixes);
        for axis in 0..2 {
            let mut row = Vector::zeros();
            row[VELOCITY + axis] = 1.0;
            row[MEMORY + axis] = -mean.kept;
            let felt = &difference.felt;
            for (first, by) in [
                (TILT, force_by_tilt(&felt.force_mps, axis)),
                (ACCEL_RANDOM, felt.attitude_s.row(axis).transpose()),
            ] {
                row.fixed_rows_mut::<3>(first).copy_from(&by);
            }
            let mut direct = Parameters::zeros();
            for (first, gained) in felt.velocity_effects() {
                direct
                    .fixed_rows_mut::<3>(first)
                    .copy_from(&gained.row(axis).transpose());
            }
            let of_arm = difference.attitude_rate_per_s.row(axis).transpose();
            direct.fixed_rows_mut::<3>(LEVER_ARM).copy_from(&of_arm);
            direct[LATENCY] = difference.acceleration_mps2[axis];
            let noise = white + mean.variance;
            let mut seen = self.seen(&row, &direct, difference.velocity_mps[axis], noise);
            self.forget(MEMORY + axis..MEMORY + axis + 1, mean.step);
            seen.gain[MEMORY + axis] = mean.step.0 * seen.gain[MEMORY + axis] - mean.covariance;
            self.weigh(&seen);
        }
    }

    /// Gyros of a vehicle at rest read their biases: the mean over some seconds, with this trend.
    fn measure_biases(
        &mut self,
        rate_radps: &Vector3<f64>,
        gyro_noise: f64,
        seconds: f64,
        (trend, mean): (f64, &Mean),
    ) {
        let noise = gyro_noise * gyro_noise / seconds + mean.variance;
        for axis in 0..3 {
            let (mut row, mut direct) = (Vector::zeros(), Parameters::zeros());
            row[RANDOM + axis] = mean.kept;
            direct[CONSTANT + axis] = 1.0;
            direct[TREND + axis] = trend;
            let mut seen = self.seen(&row, &direct, rate_radps[axis], noise);
            self.forget(RANDOM + axis..RANDOM + axis + 1, mean.step);
            seen.gain[RANDOM + axis] = mean.step.0 * seen.gain[RANDOM + axis] + mean.covariance;
            self.weigh(&seen);
        }
    }

    fn seen(&self, row: &Vector, direct: &Parameters, measured: f64, noise: f64) -> Seen {
        let mut gain = Vector::zeros();
        for (column, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            add(
                &mut gain.data.0[0],
                *factor,
                &self.covariance.data.0[column],
            );
        }
        let variance = row.dot(&gain) + noise;
        let mut foretold = self.effects * row;
        let mut of_parameters = foretold.fixed_rows_mut::<PARAMETERS>(0);
        of_parameters += direct;
        foretold[MEAN] -= measured;
        Seen {
            gain,
            foretold,
            variance,
        }
    }

    fn weigh(&mut self, seen: &Seen) {
        let (gain, foretold, weight) = (&seen.gain, &seen.foretold, 1.0 / seen.variance);
        add_product(&mut self.effects, -weight, foretold, gain);
        add_product(&mut self.covariance, -weight, gain, gain);
        add_product(&mut self.information, weight, foretold, foretold);
        self.log_variances += libm::log(seen.variance);
    }

    /// `dV' = f x Phi + C df`, `Phi' = -w x Phi - C dw`, and the known controls.
    fn propagate(&mut self, epoch: &Epoch, (trend, mean): (f64, &Mean)) {
        // `P F'`, then the same on its transpose: `F P F'`.
        let turned = epoch.felt.turned_by_biases();
        let transition = epoch.transition(&(mean.kept * turned));
        let carried = carried(&transition, &self.covariance).transpose();
        self.covariance = self::carried(&transition, &carried);
        self.effects = self::carried(&transition, &self.effects);
        for (first, gained) in epoch.felt.velocity_effects() {
            let mut effects = self.effects.fixed_view_mut::<3, 2>(first, VELOCITY);
            effects += gained.fixed_rows::<2>(0).transpose();
        }
        if epoch.rest_rate_radps.is_none() {
            self.turn(CONSTANT, &turned);
            self.turn(TREND, &(trend * turned));
            let mut tilts = self.effects.fixed_view_mut::<3, 3>(GYRO_SCALE, TILT);
            tilts -= epoch.felt.scaled_turn_rad.transpose();
            self.wander_meanwhile(&turned, mean);
        }
        // What the gyros read at rest is what turns the platform until it is set back.
        let grown = -epoch.felt.attitude_s * epoch.rest_rate_radps.unwrap_or_default();
        let gained = 0.5 * epoch.felt.force_mps.cross(&grown).xy() + epoch.velocity_control_mps;
        let mut mean = self.effects.row_mut(MEAN);
        for axis in 0..2 {
            mean[VELOCITY + axis] += gained[axis];
        }
        for axis in 0..3 {
            mean[TILT + axis] += epoch.tilt_control_rad[axis];
        }
    }

    /// What biases do in an epoch on top of what they were at its start, and what that turns.
    fn wander_meanwhile(&mut self, turned: &SMatrix<f64, 3, RANDOM>, mean: &Mean) {
        if mean.step == Mean::STILL.step {
            return;
        }
        self.forget(RANDOM..ACCEL_RANDOM, mean.step);
        let mut covariance = self.covariance.fixed_view_mut::<RANDOM, RANDOM>(0, 0);
        covariance += mean.variance * turned.tr_mul(turned);
        let both = mean.covariance * turned;
        let mut covariance = self.covariance.fixed_view_mut::<3, RANDOM>(RANDOM, 0);
        covariance += both;
        let mut covariance = self.covariance.fixed_view_mut::<RANDOM, 3>(0, RANDOM);
        covariance += both.transpose();
    }

    fn turn(&mut self, first: usize, by: &SMatrix<f64, 3, RANDOM>) {
        let mut effects = self.effects.fixed_view_mut::<3, RANDOM>(first, VELOCITY);
        effects += by;
    }
}

/// A measurement, before it is made use of.
struct Seen {
    /// Covariance of the state with it.
    gain: Vector,
    /// What each parameter makes of it, and what it is short of the mean.
    foretold: SVector<f64, ROWS>,
    variance: f64,
}

/// From one time to a later one: what part is kept, and the variance that is added.
fn step(noise: &Correlated, seconds: f64) -> (f64, f64) {
    let keep = libm::exp(-seconds / noise.time_s);
    (keep, noise.sigma * noise.sigma * (1.0 - keep * keep))
}

/// Parts of an epoch whose mean stands for that over all of it: their variance is good to 1 / (4 n^2).
const PARTS: u32 = 6;

/// The mean of a noise with a memory over moments in an epoch, each in the middle of its part, as of
/// fixes that share it: smoother than the noise at any moment, and bound to that at the end.
struct Mean {
    /// Part of the noise at the start that is in it.
    kept: f64,
    /// Variance of the rest of it.
    variance: f64,
    /// Covariance of that with the noise at the end.
    covariance: f64,
    /// The noise itself, from the start to the end.
    step: (f64, f64),
}

impl Mean {
    /// Of what does not move.
    const STILL: Self = Self {
        kept: 1.0,
        variance: 0.0,
        covariance: 0.0,
        step: (1.0, 0.0),
    };

    fn new(noise: &Correlated, seconds: f64, fixes: u32) -> Self {
        let (keep, added) = step(noise, 0.5 * seconds / f64::from(fixes));
        let (mut kept, mut sum_kept) = (1.0, 0.0);
        // Of the noise and of the sum of the fixes, as far as the start does not tell them.
        let (mut noise, mut both, mut sum) = (0.0, 0.0, 0.0);
        for _ in 0..fixes {
            for ends_part in [false, true] {
                kept *= keep;
                noise = keep * keep * noise + added;
                both *= keep;
                if !ends_part {
                    sum_kept += kept;
                    sum += 2.0 * both + noise;
                    both += noise;
                }
            }
        }
        let fixes = f64::from(fixes);
        Self {
            kept: sum_kept / fixes,
            variance: sum / (fixes * fixes),
            covariance: both / fixes,
            step: (kept, noise),
        }
    }
}

impl Felt {
    /// What biases and scales of the accelerometers and scales of the gyros do to the velocity, by axes
    /// of the body.
    fn velocity_effects(&self) -> [(usize, Matrix3<f64>); 3] {
        [
            (ACCEL, self.attitude_s),
            (ACCEL_SCALE, self.scaled_force_mps),
            (GYRO_SCALE, -self.scaled_turn_mps),
        ]
    }

    /// What gyro biases about each axis of the body do to velocity and tilt: half of the tilt that an
    /// epoch adds is felt in it.
    fn turned_by_biases(&self) -> SMatrix<f64, 3, RANDOM> {
        let mut by = SMatrix::zeros();
        for (other, turn) in self.attitude_s.column_iter().enumerate() {
            for axis in 0..2 {
                by[(other, VELOCITY + axis)] =
                    -0.5 * force_by_tilt(&self.force_mps, axis).dot(&turn);
            }
            for axis in 0..3 {
                by[(other, TILT + axis)] = -turn[axis];
            }
        }
        by
    }
}

impl Epoch {
    /// What each state makes of others until the end of the epoch.
    fn transition(&self, by_bias: &SMatrix<f64, 3, RANDOM>) -> Vec<Coupling> {
        let mut all = Vec::with_capacity(COUPLINGS);
        let mut couple = |from: usize, to: usize, by: f64| {
            if by != 0.0 {
                all.push(Coupling { from, to, by });
            }
        };
        let turn = -self.seconds * self.frame_rate_radps.cross_matrix();
        for tilt in 0..3 {
            for axis in 0..2 {
                let by = force_by_tilt(&self.felt.force_mps, axis)[tilt];
                couple(TILT + tilt, VELOCITY + axis, by);
            }
            for axis in 0..3 {
                couple(TILT + tilt, TILT + axis, turn[(axis, tilt)]);
            }
        }
        for other in 0..3 {
            for axis in 0..2 {
                let by = self.felt.attitude_s[(axis, other)];
                couple(ACCEL_RANDOM + other, VELOCITY + axis, by);
            }
            if self.rest_rate_radps.is_none() {
                for to in VELOCITY..RANDOM {
                    couple(RANDOM + other, to, by_bias[(other, to)]);
                }
            }
        }
        all
    }
}

/// What one state makes of another one.
struct Coupling {
    from: usize,
    to: usize,
    by: f64,
}

/// Tilts of velocity and of each other, biases of gyros of both, of accelerometers of velocity.
const COUPLINGS: usize = 3 * 2 + 3 * 3 + 3 * 5 + 3 * 2;

/// Rows of a state at the start of an epoch, at its end.
fn carried<const N: usize>(
    transition: &[Coupling],
    rows: &SMatrix<f64, N, SIZE>,
) -> SMatrix<f64, N, SIZE> {
    let mut out = *rows;
    for Coupling { from, to, by } in transition {
        add(&mut out.data.0[*to], *by, &rows.data.0[*from]);
    }
    out
}

// Plain loops over columns: nalgebra's own take a third more of the time of all.

fn add<const N: usize>(to: &mut [f64; N], by: f64, from: &[f64; N]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += by * from;
    }
}

fn add_product<const N: usize, const M: usize>(
    to: &mut SMatrix<f64, N, M>,
    by: f64,
    rows: &SVector<f64, N>,
    columns: &SVector<f64, M>,
) {
    for (to, column) in to.data.0.iter_mut().zip(&columns.data.0[0]) {
        add(to, by * column, &rows.data.0[0]);
    }
}

/// East (0) or north (1) component of `f x Phi` by Phi.
fn force_by_tilt(force: &Vector3<f64>, axis: usize) -> Vector3<f64> {
    match axis {
        0 => Vector3::new(0.0, -force.z, force.y),
        _ => Vector3::new(force.z, 0.0, -force.x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_dynamics(law: Law, size: f64, time_s: f64, gyro_noise: f64) -> Candidate {
        Candidate {
            gyro_noise,
            accel_noise: 1e-3,
            gnss_sigma_mps: 0.1,
            gnss_memory: Correlated::default(),
            dynamics: Dynamics { law, size, time_s },
            class: Class {
                accel_bias_mps2: 0.01,
                accel_dynamics: Dynamics::of(&BiasModel::constant(0.01), 1.0),
                accel_scale: 0.0,
                gyro_scale: 0.0,
            },
        }
    }

    /// Against the sums over the correlations of the noise at the fixes; rounding only.
    #[test]
    fn the_mean_of_fixes_has_the_moments_of_their_noise() {
        let noise = Correlated {
            sigma: 0.3,
            time_s: 4.0,
        };
        let (seconds, fixes) = (2.0, 7.0);
        let times: Vec<f64> = (0..7)
            .map(|n| (f64::from(n) + 0.5) * seconds / fixes)
            .collect();
        let variance = noise.sigma * noise.sigma;
        let with = |at: f64| {
            let one = |time: &f64| libm::exp(-(time - at).abs() / noise.time_s);
            variance / fixes * times.iter().map(one).sum::<f64>()
        };
        let mean = Mean::new(&noise, seconds, 7);
        let of_mean = times.iter().map(|time| with(*time)).sum::<f64>() / fixes;
        let found = [
            mean.kept * variance,
            mean.kept * mean.kept * variance + mean.variance,
            mean.kept * mean.step.0 * variance + mean.covariance,
            mean.step.0 * mean.step.0 * variance + mean.step.1,
        ];
        for (found, expected) in
            found
                .into_iter()
                .zip([with(0.0), of_mean, with(seconds), variance])
        {
            assert!(
                (found - expected).abs() < 1e-14,
                "{found} instead of {expected}"
            );
        }
    }

    /// Against the density of the readings as one normal vector, means of what is correlated over a
    /// constant and a trend; rounding only. Taken for the values in the middle they differ by 2.7.
    #[test]
    fn readings_at_rest_are_means_of_biases_that_wander() {
        let (size, time_s, seconds, noise) = (3e-5, 5.0, 2.0, 1e-5);
        let readings = [2e-5, -1e-5, 4e-5, 5e-5];
        let epoch = |n: usize| Epoch {
            start_s: seconds * n as f64,
            seconds,
            rest_rate_radps: Some(Vector3::repeat(readings[n])),
            ..Epoch::default()
        };
        let record = Record {
            epochs: (0..4).map(epoch).collect(),
            duration_s: 8.0,
            ..Record::default()
        };
        let candidate = with_dynamics(Law::Continuous, size, time_s, noise);
        let trend_sigma = trend_sigma(&record, &candidate.dynamics);
        let moments = |n: usize| {
            let part = move |k: u32| n as f64 + (f64::from(k) + 0.5) / f64::from(PARTS);
            (0..PARTS).map(move |k| seconds * part(k))
        };
        let expected = SMatrix::<f64, 4, 4>::from_fn(|i, j| {
            let with = |a: f64| moments(j).map(move |b| libm::exp(-(a - b).abs() / time_s));
            let pairs = f64::from(PARTS * PARTS);
            let wander = size * size * moments(i).flat_map(with).sum::<f64>() / pairs;
            let white = if i == j { noise * noise / seconds } else { 0.0 };
            let [a, b] = [i, j].map(|n| trend_sigma * seconds * (n as f64 + 0.5));
            wander + white + BIAS_SIGMA * BIAS_SIGMA + a * b
        });
        let factor = expected.cholesky().unwrap();
        let z = SVector::from(readings);
        let log_determinant = 2.0 * factor.l().diagonal().map(libm::log).sum();
        let expected = -1.5 * (log_determinant + z.dot(&factor.solve(&z)));
        let found = filter(&record, &candidate).log_likelihood;
        assert!(
            (found - expected).abs() < 1e-6,
            "{found} instead of {expected}"
        );
    }

    /// No measurement is lost where a jump falls into an epoch: the likelihood goes on without a step as
    /// a jump moves over the border of two.
    #[test]
    fn a_jump_at_rest_hides_nothing() {
        let still = |n: i32| Epoch {
            start_s: 2.0 * f64::from(n),
            seconds: 2.0,
            rest_rate_radps: Some(Vector3::zeros()),
            ..Epoch::default()
        };
        let record = Record {
            epochs: (0..20).map(still).collect(),
            duration_s: 40.0,
            ..Record::default()
        };
        let with_jump_at = |time_s: f64| {
            let candidate = with_dynamics(Law::Wave, 1e-5, time_s, 1e-5);
            filter(&record, &candidate).log_likelihood
        };
        for border_s in [24.0, 30.0] {
            let step = with_jump_at(border_s + 1e-6) - with_jump_at(border_s - 1e-6);
            assert!(step.abs() < 1e-4, "{border_s} s: {step}");
        }
    }
}

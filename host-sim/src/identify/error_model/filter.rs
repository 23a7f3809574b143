//! The likelihood of a drive under an error model of its gyros: a Kalman filter over
//! thesis equation (1) with the biases of (3) or (4).
//!
//! Constants and trends of the biases have a diffuse prior, so that the likelihood is the restricted
//! one (REML): it does not depend on their spread and does not bias the other variances.

use std::ops::Range;

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use super::interval::Measured;
use super::record::{Difference, Epoch, Integrals, Record};
use crate::sim::ErrorModel;
use crate::sim::errors::{BiasModel, Law};
use crate::sim::receiver::Correlated;

/// States: velocity error, tilt, random part of the biases of gyros and accelerometers.
const VELOCITY: usize = 0;
const TILT: usize = 2;
const RANDOM: usize = 5;
const ACCEL_RANDOM: usize = 8;
/// Coloured noise of GNSS velocity.
const COLOURED: usize = 11;
const SIZE: usize = 13;

/// Parameters, constant over a drive: constants and trends of the gyro biases, errors of accelerometer
/// biases, scales, lever arm and latency, less the navigator's estimates of them. What gyros level in
/// the mount read of turns about its vertical is in the accelerometer errors: turns do not separate them.
const CONSTANT: usize = 0;
const TREND: usize = 3;
const ACCEL: usize = 6;
const ACCEL_SCALE: usize = 9;
const GYRO_SCALE: usize = 12;
const LEVER_ARM: usize = 15;
const LATENCY: usize = 18;
const PARAMETERS: usize = 19;
/// Rows of the sensitivity: one for each parameter, the last is the state estimate itself.
const ROWS: usize = PARAMETERS + 1;
const MEAN: usize = PARAMETERS;

type Vector = SVector<f64, SIZE>;
type Matrix = SMatrix<f64, SIZE, SIZE>;
type Parameters = SVector<f64, PARAMETERS>;

/// Initial sigma of velocity and tilt, m/s and rad; of the azimuth at least.
const START_SIGMA: [f64; RANDOM] = [1.0, 1.0, 0.01, 0.01, 0.05];
/// Prior sigma of the parameters: rad/s for a constant and for a trend over a whole drive (100 deg/h:
/// diffuse, beside the information in a drive, and so are those in m and s).
const BIAS_SIGMA: f64 = 5e-4;
const LEVER_ARM_SIGMA: f64 = 1.0;
const LATENCY_SIGMA: f64 = 0.1;

/// Prior sigmas of the errors of a class of sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Class {
    pub accel_bias_mps2: f64,
    /// Random part of the accelerometer biases, m/s^2.
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

/// Stochastic process of the random part of a bias. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Jumps at whole multiples of an interval since the start of the log, or exponentially
    /// correlated.
    pub law: Law,
    /// Sigma of a jump, or standard deviation, rad/s of gyros.
    pub size: f64,
    /// Interval, or correlation time, s.
    pub time_s: f64,
}

impl Dynamics {
    /// Of a model in units of `unit` SI units.
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

    /// As the exponentially correlated noise that it is in (4).
    fn correlated(&self) -> Correlated {
        Correlated {
            sigma: self.size,
            time_s: self.time_s,
        }
    }

    /// Factor of the trend of a bias: jumps so far, or time.
    fn trend_at(&self, time_s: f64) -> f64 {
        match self.law {
            Law::Wave => (time_s / self.time_s).floor(),
            Law::Continuous => time_s,
        }
    }

    /// Part of an epoch before a jump; none without one.
    fn jump_in(&self, epoch: &Epoch) -> Option<f64> {
        if self.law == Law::Continuous {
            return None;
        }
        let jump_s = self.time_s * self.trend_at(epoch.start_s + epoch.seconds);
        let part = (jump_s - epoch.start_s) / epoch.seconds;
        (part > 0.0).then_some(part)
    }

    /// Mean of the random part over an epoch, and its limits: a jump process is taken in the middle.
    fn mean_over(&self, epoch: &Epoch) -> ([f64; 2], Mean) {
        match self.law {
            Law::Wave => ([epoch.middle_s(); 2], Mean::STILL),
            Law::Continuous => {
                let mean = Mean::new(&self.correlated(), epoch.seconds, PARTS);
                ([epoch.start_s, epoch.start_s + epoch.seconds], mean)
            }
        }
    }

    /// The same over an epoch of which `part` lies after a jump.
    fn mean_over_jump(&self, part: f64) -> Mean {
        let jump = self.size * self.size;
        Mean {
            factor: 1.0,
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

    /// Transition factor and process variance from one time to a later one.
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
    /// Coloured noise in addition.
    pub gnss_coloured: Correlated,
    /// Random part of the gyro biases.
    pub dynamics: Dynamics,
    /// Priors of the rest.
    pub class: Class,
}

impl Candidate {
    fn biases(&self) -> [(Range<usize>, Dynamics); 2] {
        [
            (RANDOM..ACCEL_RANDOM, self.dynamics),
            (ACCEL_RANDOM..COLOURED, self.class.accel_dynamics),
        ]
    }

    /// Prior sigma of the parameters.
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

/// Likelihood and gyro biases of a drive under a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posterior {
    /// Logarithm of the restricted likelihood, up to a constant.
    pub log_likelihood: f64,
    /// Constants of the biases, body axes, rad/s, and trends, rad/s per second or per jump.
    biases: Vector6<f64>,
    /// Of the errors of `biases`.
    covariance: Matrix6<f64>,
    /// Prior sigma of a trend.
    trend_sigma: f64,
}

impl Posterior {
    /// Under a candidate whose variances overflow.
    fn none() -> Self {
        Self {
            log_likelihood: f64::NEG_INFINITY,
            biases: Vector6::zeros(),
            covariance: Matrix6::from_diagonal_element(f64::INFINITY),
            trend_sigma: 1.0,
        }
    }

    /// Constants, with trends of the model's distribution instead of the diffuse prior.
    pub fn constants_given(&self, trend_mean: f64, trend_sigma: f64) -> [Measured; 3] {
        let (constants, trends) = (self.three(CONSTANT), self.three(TREND));
        let both = self.covariance.fixed_view::<3, 3>(CONSTANT, TREND);
        let drawn = Matrix3::from_diagonal_element(trend_sigma * trend_sigma);
        let by = both * (trends.1 + drawn).try_inverse().unwrap_or_default();
        let value = constants.0 + by * (Vector3::repeat(trend_mean) - trends.0);
        independent(&value, &(constants.1 - by * both.transpose()))
    }

    pub fn observed_constants(&self, trend_mean: f64, trend_sigma: f64) -> Vec<Measured> {
        without_prior(self.constants_given(trend_mean, trend_sigma), BIAS_SIGMA)
    }

    pub fn observed_trends(&self) -> Vec<Measured> {
        let (value, covariance) = self.three(TREND);
        without_prior(independent(&value, &covariance), self.trend_sigma)
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

    /// Log-likelihood with constants and trends of the model's distribution instead of the diffuse prior.
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
        // Density of the diffuse prior.
        let before = 3.0 * libm::log(BIAS_SIGMA * self.trend_sigma);
        self.log_likelihood + before - root - 0.5 * off.dot(&factor.solve(&off))
    }
}

/// Along the principal axes of the covariance, uncorrelated: spreads are alike along all axes.
fn independent(value: &Vector3<f64>, covariance: &Matrix3<f64>) -> [Measured; 3] {
    let axes = covariance.symmetric_eigen();
    let value = axes.eigenvectors.tr_mul(value);
    [0, 1, 2].map(|axis| Measured {
        value: value[axis],
        variance: axes.eigenvalues[axis].max(f64::MIN_POSITIVE),
    })
}

/// Those that are observed, not the prior alone.
fn without_prior(all: [Measured; 3], prior: f64) -> Vec<Measured> {
    let without_prior = |one: &Measured| one.without_prior(prior).is_some();
    all.into_iter().filter(without_prior).collect()
}

pub fn filter(record: &Record, candidate: &Candidate) -> Posterior {
    let mut state = TwoStageFilter::new(record, candidate);
    for epoch in &record.epochs {
        match candidate.dynamics.jump_in(epoch) {
            Some(part) => {
                let (before, after) = epoch.split(part);
                state.process_epoch(&before, None, candidate);
                if let Some(rate) = epoch.rest_rate_radps.as_ref().filter(|_| !epoch.has_gap) {
                    let mean = candidate.dynamics.mean_over_jump(1.0 - part);
                    let trend = candidate.dynamics.trend_at(state.time_s) + 1.0 - part;
                    state.measure_biases(rate, candidate.gyro_noise, epoch.seconds, (trend, &mean));
                    state.time_s = after.middle_s();
                }
                state.process_epoch(&after, None, candidate);
            }
            None => state.process_epoch(epoch, epoch.rest_rate_radps.as_ref(), candidate),
        }
    }
    state.posterior(record, &candidate.prior(record))
}

/// Prior of the trend; not by whole jumps, as one more at the very end must not raise the likelihood.
fn trend_sigma(record: &Record, dynamics: &Dynamics) -> f64 {
    let unit_s = match dynamics.law {
        Law::Wave => dynamics.time_s,
        Law::Continuous => 1.0,
    };
    BIAS_SIGMA * unit_s / record.duration_s.max(1.0)
}

/// Separate-bias estimation (Friedland, 1969): a filter that takes the parameters as zero, and its
/// sensitivity to them.
struct TwoStageFilter {
    time_s: f64,
    start_sigma: [f64; RANDOM],
    covariance: Matrix,
    /// Partials of the state by each parameter, a row each; the last row is the state estimate.
    sensitivity: SMatrix<f64, ROWS, SIZE>,
    /// Information matrix of the parameters; the last row and column are of the innovations, with
    /// opposite sign.
    information: SMatrix<f64, ROWS, ROWS>,
    /// Sum over the innovations of the logarithms of their variances.
    log_variances: f64,
}

impl TwoStageFilter {
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
        let coloured = candidate.gnss_coloured.sigma * candidate.gnss_coloured.sigma;
        for axis in COLOURED..SIZE {
            covariance[(axis, axis)] = coloured;
        }
        Self {
            time_s: 0.0,
            start_sigma,
            covariance,
            sensitivity: SMatrix::zeros(),
            information: SMatrix::zeros(),
            log_variances: 0.0,
        }
    }

    /// Estimates of the parameters from their prior and the information in the measurements.
    fn posterior(&self, record: &Record, prior: &Parameters) -> Posterior {
        let spread = SMatrix::from_diagonal(prior);
        let within = (self.information).fixed_view::<PARAMETERS, PARAMETERS>(0, 0);
        let seen = -(self.information).fixed_view::<PARAMETERS, 1>(0, MEAN);
        // In units of the prior sigma: parameters with a zero prior drop out.
        let scaled = SMatrix::identity() + spread * within * spread;
        let pull: Parameters = spread * seen;
        let Some(factor) = scaled.cholesky() else {
            return Posterior::none();
        };
        let log_determinant = 2.0 * factor.l_dirty().diagonal().map(libm::log).sum();
        let mean = spread * factor.solve(&pull);
        let covariance = spread * factor.inverse() * spread;
        let square = self.information[(MEAN, MEAN)] - pull.dot(&factor.solve(&pull));
        let mut biases = mean.fixed_rows::<6>(CONSTANT).into_owned();
        let mut constants = biases.fixed_rows_mut::<3>(CONSTANT);
        constants += record.gyro_reference_radps;
        Posterior {
            log_likelihood: -0.5 * (self.log_variances + log_determinant + square),
            biases,
            covariance: covariance
                .fixed_view::<6, 6>(CONSTANT, CONSTANT)
                .into_owned(),
            trend_sigma: prior[TREND],
        }
    }

    /// Measurement updates and propagation over an epoch; `rate` is the gyro reading at rest.
    fn process_epoch(&mut self, epoch: &Epoch, rate: Option<&Vector3<f64>>, candidate: &Candidate) {
        let ([from_s, to_s], mean) = candidate.dynamics.mean_over(epoch);
        self.propagate_biases(from_s, candidate);
        match &epoch.difference {
            Some(difference) if !epoch.has_gap => {
                self.measure_velocity(epoch, difference, candidate);
            }
            _ => self.gauss_markov(
                COLOURED..SIZE,
                step(&candidate.gnss_coloured, epoch.seconds),
            ),
        }
        if epoch.has_gap {
            self.reset_attitude();
            return;
        }
        let trend = candidate.dynamics.trend_at(epoch.middle_s());
        let noise = candidate.gyro_noise * candidate.gyro_noise;
        if let Some(rate) = rate {
            self.measure_biases(rate, candidate.gyro_noise, epoch.seconds, (trend, &mean));
        }
        self.propagate(epoch, (trend, &mean));
        self.time_s = to_s;
        self.add_process_noise(epoch, noise * epoch.seconds, candidate.accel_noise);
    }

    /// Process noise over an epoch: random walk of the tilt, and of the velocity by it. At rest the
    /// rotation of the platform is known, its noise included.
    fn add_process_noise(&mut self, epoch: &Epoch, walked: f64, accel_noise: f64) {
        for axis in VELOCITY..VELOCITY + 2 {
            self.covariance[(axis, axis)] += accel_noise * accel_noise * epoch.seconds;
        }
        if epoch.rest_rate_radps.is_some() {
            return;
        }
        let by_tilt = [0, 1].map(|axis| force_by_tilt(&epoch.integrals.force_mps, axis));
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

    fn propagate_biases(&mut self, to_s: f64, candidate: &Candidate) {
        for (axes, dynamics) in candidate.biases() {
            self.gauss_markov(axes, dynamics.step(self.time_s, to_s));
        }
        self.time_s = to_s;
    }

    /// Applies a transition factor and a process variance to some states.
    fn gauss_markov(&mut self, states: Range<usize>, (keep, variance): (f64, f64)) {
        for axis in states {
            if keep < 1.0 {
                self.sensitivity.column_mut(axis).scale_mut(keep);
                self.covariance.row_mut(axis).scale_mut(keep);
                self.covariance.column_mut(axis).scale_mut(keep);
            }
            self.covariance[(axis, axis)] += variance;
        }
    }

    /// After a gap velocity and attitude are reset to their initial sigmas; the biases continue.
    fn reset_attitude(&mut self) {
        for (axis, sigma) in self.start_sigma.into_iter().enumerate() {
            self.sensitivity.column_mut(axis).fill(0.0);
            self.covariance.row_mut(axis).fill(0.0);
            self.covariance.column_mut(axis).fill(0.0);
            self.covariance[(axis, axis)] = sigma * sigma;
        }
    }

    /// Update with `dV` at the fixes: that at the start of the epoch and its growth by tilt and
    /// accelerometer errors since.
    fn measure_velocity(&mut self, epoch: &Epoch, difference: &Difference, candidate: &Candidate) {
        let fixes = f64::from(difference.fixes);
        let white = candidate.gnss_sigma_mps * candidate.gnss_sigma_mps / fixes;
        let mean = Mean::new(&candidate.gnss_coloured, epoch.seconds, difference.fixes);
        for axis in 0..2 {
            let mut row = Vector::zeros();
            row[VELOCITY + axis] = 1.0;
            row[COLOURED + axis] = -mean.factor;
            let integrals = &difference.integrals;
            for (first, by) in [
                (TILT, force_by_tilt(&integrals.force_mps, axis)),
                (ACCEL_RANDOM, integrals.attitude_s.row(axis).transpose()),
            ] {
                row.fixed_rows_mut::<3>(first).copy_from(&by);
            }
            let mut direct = Parameters::zeros();
            for (first, gained) in integrals.velocity_partials() {
                direct
                    .fixed_rows_mut::<3>(first)
                    .copy_from(&gained.row(axis).transpose());
            }
            let of_arm = difference.attitude_rate_per_s.row(axis).transpose();
            direct.fixed_rows_mut::<3>(LEVER_ARM).copy_from(&of_arm);
            direct[LATENCY] = difference.acceleration_mps2[axis];
            let noise = white + mean.variance;
            let mut seen = self.innovation(&row, &direct, difference.velocity_mps[axis], noise);
            self.gauss_markov(COLOURED + axis..COLOURED + axis + 1, mean.step);
            seen.pht[COLOURED + axis] = mean.step.0 * seen.pht[COLOURED + axis] - mean.covariance;
            self.update(&seen);
        }
    }

    /// Update with the gyro reading at rest, which is the bias: a mean over some seconds.
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
            row[RANDOM + axis] = mean.factor;
            direct[CONSTANT + axis] = 1.0;
            direct[TREND + axis] = trend;
            let mut seen = self.innovation(&row, &direct, rate_radps[axis], noise);
            self.gauss_markov(RANDOM + axis..RANDOM + axis + 1, mean.step);
            seen.pht[RANDOM + axis] = mean.step.0 * seen.pht[RANDOM + axis] + mean.covariance;
            self.update(&seen);
        }
    }

    fn innovation(
        &self,
        row: &Vector,
        direct: &Parameters,
        measured: f64,
        noise: f64,
    ) -> Innovation {
        let mut pht = Vector::zeros();
        for (column, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            add(&mut pht.data.0[0], *factor, &self.covariance.data.0[column]);
        }
        let variance = row.dot(&pht) + noise;
        let mut partials = self.sensitivity * row;
        let mut of_parameters = partials.fixed_rows_mut::<PARAMETERS>(0);
        of_parameters += direct;
        partials[MEAN] -= measured;
        Innovation {
            pht,
            partials,
            variance,
        }
    }

    fn update(&mut self, seen: &Innovation) {
        let (pht, partials, weight) = (&seen.pht, &seen.partials, 1.0 / seen.variance);
        add_product(&mut self.sensitivity, -weight, partials, pht);
        add_product(&mut self.covariance, -weight, pht, pht);
        add_product(&mut self.information, weight, partials, partials);
        self.log_variances += libm::log(seen.variance);
    }

    /// `dV' = f x Phi + C df`, `Phi' = -w x Phi - C dw`, and the known controls.
    fn propagate(&mut self, epoch: &Epoch, (trend, mean): (f64, &Mean)) {
        // `P F'`, then the same on its transpose: `F P F'`.
        let by_bias = epoch.integrals.bias_effect();
        let transition = epoch.transition(&(mean.factor * by_bias));
        let propagated = propagated(&transition, &self.covariance).transpose();
        self.covariance = self::propagated(&transition, &propagated);
        self.sensitivity = self::propagated(&transition, &self.sensitivity);
        for (first, gained) in epoch.integrals.velocity_partials() {
            let mut sensitivity = self.sensitivity.fixed_view_mut::<3, 2>(first, VELOCITY);
            sensitivity += gained.fixed_rows::<2>(0).transpose();
        }
        if epoch.rest_rate_radps.is_none() {
            self.add_sensitivity(CONSTANT, &by_bias);
            self.add_sensitivity(TREND, &(trend * by_bias));
            let mut tilts = self.sensitivity.fixed_view_mut::<3, 3>(GYRO_SCALE, TILT);
            tilts -= epoch.integrals.scaled_turn_rad.transpose();
            self.add_drift_within_epoch(&by_bias, mean);
        }
        // At rest the rate read by the gyros rotates the platform until the control sets it back.
        let grown = -epoch.integrals.attitude_s * epoch.rest_rate_radps.unwrap_or_default();
        let gained =
            0.5 * epoch.integrals.force_mps.cross(&grown).xy() + epoch.velocity_control_mps;
        let mut mean = self.sensitivity.row_mut(MEAN);
        for axis in 0..2 {
            mean[VELOCITY + axis] += gained[axis];
        }
        for axis in 0..3 {
            mean[TILT + axis] += epoch.tilt_control_rad[axis];
        }
    }

    /// Random change of the biases within an epoch, and the tilt due to it.
    fn add_drift_within_epoch(&mut self, by_bias: &SMatrix<f64, 3, RANDOM>, mean: &Mean) {
        if mean.step == Mean::STILL.step {
            return;
        }
        self.gauss_markov(RANDOM..ACCEL_RANDOM, mean.step);
        let mut covariance = self.covariance.fixed_view_mut::<RANDOM, RANDOM>(0, 0);
        covariance += mean.variance * by_bias.tr_mul(by_bias);
        let both = mean.covariance * by_bias;
        let mut covariance = self.covariance.fixed_view_mut::<3, RANDOM>(RANDOM, 0);
        covariance += both;
        let mut covariance = self.covariance.fixed_view_mut::<RANDOM, 3>(0, RANDOM);
        covariance += both.transpose();
    }

    fn add_sensitivity(&mut self, first: usize, by: &SMatrix<f64, 3, RANDOM>) {
        let mut sensitivity = self
            .sensitivity
            .fixed_view_mut::<3, RANDOM>(first, VELOCITY);
        sensitivity += by;
    }
}

/// An innovation before the update with it.
struct Innovation {
    /// Covariance of the state with it, `P H'`.
    pht: Vector,
    /// Its partials by each parameter; the last is predicted minus measured.
    partials: SVector<f64, ROWS>,
    variance: f64,
}

/// Transition factor and process variance over some seconds.
fn step(noise: &Correlated, seconds: f64) -> (f64, f64) {
    let keep = libm::exp(-seconds / noise.time_s);
    (keep, noise.sigma * noise.sigma * (1.0 - keep * keep))
}

/// Points whose mean approximates that over an epoch: its variance is good to 1 / (4 n^2).
const PARTS: u32 = 6;

/// Mean of a coloured noise over points in an epoch, each in the middle of its part, such as the
/// fixes: of less variance than the noise itself, and correlated with it at the end.
struct Mean {
    /// Factor of the noise at the start in it.
    factor: f64,
    /// Variance of the remainder.
    variance: f64,
    /// Covariance of the remainder with the noise at the end.
    covariance: f64,
    /// Transition factor and process variance of the noise itself over the epoch.
    step: (f64, f64),
}

impl Mean {
    /// Of a constant.
    const STILL: Self = Self {
        factor: 1.0,
        variance: 0.0,
        covariance: 0.0,
        step: (1.0, 0.0),
    };

    fn new(noise: &Correlated, seconds: f64, fixes: u32) -> Self {
        let (keep, added) = step(noise, 0.5 * seconds / f64::from(fixes));
        let (mut factor, mut sum_factor) = (1.0, 0.0);
        // Variances of noise and sum of the fixes, and their covariance, given the noise at the start.
        let (mut noise, mut both, mut sum) = (0.0, 0.0, 0.0);
        for _ in 0..fixes {
            for ends_part in [false, true] {
                factor *= keep;
                noise = keep * keep * noise + added;
                both *= keep;
                if !ends_part {
                    sum_factor += factor;
                    sum += 2.0 * both + noise;
                    both += noise;
                }
            }
        }
        let fixes = f64::from(fixes);
        Self {
            factor: sum_factor / fixes,
            variance: sum / (fixes * fixes),
            covariance: both / fixes,
            step: (factor, noise),
        }
    }
}

impl Integrals {
    /// Partials of the velocity by biases and scales of the accelerometers and scales of the gyros, by
    /// axes of the body.
    fn velocity_partials(&self) -> [(usize, Matrix3<f64>); 3] {
        [
            (ACCEL, self.attitude_s),
            (ACCEL_SCALE, self.scaled_force_mps),
            (GYRO_SCALE, -self.scaled_turn_mps),
        ]
    }

    /// Partials of velocity and tilt by the gyro bias about each axis of the body: half of the tilt
    /// added in an epoch acts in it.
    fn bias_effect(&self) -> SMatrix<f64, 3, RANDOM> {
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
    /// Off-diagonal elements of the transition matrix over the epoch.
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
                let by = force_by_tilt(&self.integrals.force_mps, axis)[tilt];
                couple(TILT + tilt, VELOCITY + axis, by);
            }
            for axis in 0..3 {
                couple(TILT + tilt, TILT + axis, turn[(axis, tilt)]);
            }
        }
        for other in 0..3 {
            for axis in 0..2 {
                let by = self.integrals.attitude_s[(axis, other)];
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

/// An off-diagonal element of the transition matrix.
struct Coupling {
    from: usize,
    to: usize,
    by: f64,
}

/// Tilts into velocity and each other, gyro biases into both, accelerometer biases into velocity.
const COUPLINGS: usize = 3 * 2 + 3 * 3 + 3 * 5 + 3 * 2;

/// Rows of state vectors, propagated from the start of an epoch to its end.
fn propagated<const N: usize>(
    transition: &[Coupling],
    rows: &SMatrix<f64, N, SIZE>,
) -> SMatrix<f64, N, SIZE> {
    let mut out = *rows;
    for Coupling { from, to, by } in transition {
        add(&mut out.data.0[*to], *by, &rows.data.0[*from]);
    }
    out
}

// Plain loops over columns: with nalgebra's own the whole takes a third longer.

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

/// Partials of the east (0) or north (1) component of `f x Phi` by Phi.
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
            gnss_coloured: Correlated::default(),
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
            mean.factor * variance,
            mean.factor * mean.factor * variance + mean.variance,
            mean.factor * mean.step.0 * variance + mean.covariance,
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

    /// Against the density of the readings as one normal vector, means of a correlated noise over a
    /// constant and a trend; rounding only. With the values in the middle for the means it is off by 2.7.
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

    /// No measurement is lost where a jump falls into an epoch: the likelihood is continuous as a jump
    /// moves across the border of two epochs.
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

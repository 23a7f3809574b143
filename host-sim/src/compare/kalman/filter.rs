//! Time update over intervals; measurement updates by fixes and at rest.

use ins_core::config::HeadingSource;
use ins_core::increments::Interval;
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::rest::{RestBlock, RestDetector, Verdict};
use ins_core::{Estimates, GnssFix, Navigator, Solution, Time};
use nalgebra::Vector3;

use super::model::{Measurement, PastState, StepIntegrals, zero_rate};
use super::noise::{Noise, total};
use super::{Kind, Layout, Nominal, StateMatrix, States, index, propagated, sigmas, times};

/// Initial sigma of the velocity, which is from an old fix, m/s, and age of that fix's position, s.
const START_VELOCITY_MPS: f64 = 1.0;
const START_FIX_AGE_S: f64 = 0.5;
/// Longest time step of the covariance, s; a fix ends it earlier.
const COVARIANCE_STEP_S: f64 = 0.1;
/// Time constant of the low-pass acceleration that carries the INS back to the time of a fix, s: short
/// beside a manoeuvre, long beside the vibration of an engine.
const ACCEL_S: f64 = 0.03;
/// Sigmas of an innovation beyond which it is weighted down (Huber), and beyond which it is rejected.
const ROBUST_SIGMAS: f64 = 3.0;
const GATE_SIGMAS: f64 = 6.0;
/// Time and number of fixes for which one kind of measurement was rejected, after which the filter counts
/// as diverged: longer than receivers take to recover from a bridge or multipath, short beside the minutes
/// in which an INS drifts away.
const DIVERGED_S: f64 = 5.0;
const DIVERGED_FIXES: u32 = 5;
/// Sigmas of tilt and azimuth of a diverged filter, rad: those of an alignment in motion, and of a heading
/// found from it.
const DIVERGED_TILT_RAD: f64 = 0.1;
const DIVERGED_AZIMUTH_RAD: f64 = 1.0;
/// Speed above which a fix shows motion, m/s, and sigmas of its noise added to it: as in the core.
const MOTION_MPS: f64 = 0.2;
const MOTION_SIGMAS: f64 = 4.0;
/// Age of the last fix up to which it distinguishes rest from steady motion, s: as in the core.
const HOLD_S: f64 = 1.5;
/// Gate of the zero-rate update, sigmas: beyond, the vehicle turns slowly.
const REST_SIGMAS: f64 = 4.0;

/// Error-state filter: an INS and the covariance of its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Stamp of the last interval's end.
    pub time: Time,
    /// INS and sensor parameters, corrected by all estimated errors.
    pub nominal: Nominal,
    /// Covariance of the remaining errors, as of the last covariance step.
    pub covariance: StateMatrix,
    pub layout: Layout,
    noise: Noise,
    since: Time,
    /// Sigma of each error beyond which divergence does not inflate it.
    sigma_limits: States,
    /// Zero: at every inertial sample, as in most firmware.
    pub(super) covariance_step_s: f64,
    integrals: StepIntegrals,
    transition: StateMatrix,
    accel_mps2: Vector3<f64>,
    rate_radps: Vector3<f64>,
    rejected: [Option<Rejections>; 4],
    rest: RestDetector,
    last_fix: Time,
}

/// Consecutive fixes of which one kind was rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rejections {
    count: u32,
    since: Time,
}

/// Result of a measurement update, as the smoother needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// Transition of the errors since the last correction.
    pub transition: StateMatrix,
    pub predicted: StateMatrix,
    pub corrected: StateMatrix,
    pub errors: States,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    pub time: Time,
    pub ins: Mechanization,
    /// Sigma of its roll and pitch, rad, if known.
    pub tilt_sigma_rad: Option<f64>,
    pub heading_sigma_rad: f64,
    /// Gyro biases found by the alignment, rad/s.
    pub gyro_bias_radps: Vector3<f64>,
    pub gyro_bias_sigma_radps: [f64; 3],
}

impl Start {
    /// At the end of the core's alignment; `None` before. The sigma of a given heading is the user's.
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

    fn covariance(&self, noise: &Noise, layout: &Layout) -> StateMatrix {
        let (sensors, gnss) = (&noise.sensors, &noise.gnss);
        let moved = Vector3::repeat(START_FIX_AGE_S * self.ins.velocity_enu_mps.norm());
        let [level, up] = [&gnss.position_m, &gnss.height_m].map(total);
        let levelled = noise.levelling_error_rad();
        let tilt = self.tilt_sigma_rad.unwrap_or_default().max(levelled);
        let gyro = self.gyro_bias_sigma_radps;
        let gyro = gyro.map(|sigma| sigma.min(sensors.gyro_bias_radps));
        let mut sigma = States::zeros(layout.size);
        let mut set = |at: usize, values: Vector3<f64>| {
            sigma.fixed_rows_mut::<3>(at).copy_from(&values);
        };
        let place = 2.0 * Vector3::new(level, level, up) + moved;
        let angles = Vector3::new(tilt, tilt, self.heading_sigma_rad);
        set(index::POSITION, place);
        set(index::VELOCITY, Vector3::repeat(START_VELOCITY_MPS));
        set(index::ATTITUDE, angles);
        set(index::ACCEL, Vector3::repeat(sensors.accel_bias_mps2));
        set(index::GYRO, gyro.into());
        for (at, spread) in [
            (layout.lever_arm, gnss.lever_arm_sigma_m),
            (layout.accel_scale, sensors.accel_scale),
            (layout.gyro_scale, sensors.gyro_scale),
        ] {
            if let Some(at) = at {
                set(at, Vector3::repeat(spread));
            }
        }
        sigma[index::LATENCY] = gnss.latency_sigma_s;
        if let Some(at) = layout.clock_drift {
            sigma[at] = gnss.clock_drift_sigma;
        }
        for (kind, state) in layout.coloured_states() {
            sigma[state] = noise.of_kind(kind).correlated;
        }
        StateMatrix::from_diagonal(&sigma.component_mul(&sigma))
    }
}

impl Filter {
    pub fn new(start: &Start, noise: &Noise) -> Self {
        let layout = noise.layout();
        let covariance = start.covariance(noise, &layout);
        Self {
            time: start.time,
            nominal: Nominal::new(start.ins, start.gyro_bias_radps, noise),
            sigma_limits: sigma_limits(&covariance),
            covariance,
            layout,
            noise: *noise,
            since: start.time,
            covariance_step_s: COVARIANCE_STEP_S,
            integrals: StepIntegrals::default(),
            transition: StateMatrix::identity(layout.size, layout.size),
            accel_mps2: Vector3::zeros(),
            rate_radps: Vector3::zeros(),
            rejected: [None; 4],
            rest: RestDetector::default(),
            last_fix: start.time,
        }
    }

    /// Keeps the estimates of sensors, receiver and antenna from before a gap, with their covariance.
    pub(super) fn keep_sensors_of(&mut self, before_gap: &Self) {
        self.since = before_gap.since;
        self.nominal = Nominal {
            ins: self.nominal.ins,
            coloured: self.nominal.coloured,
            ..before_gap.nominal
        };
        let coloured = self.layout.coloured_states().map(|(_, state)| state);
        let coloured: Vec<usize> = coloured.collect();
        let kept: Vec<usize> = (index::ACCEL..self.layout.size)
            .filter(|state| !coloured.contains(state))
            .collect();
        for (&row, &column) in kept
            .iter()
            .flat_map(|row| kept.iter().map(move |column| (row, column)))
        {
            self.covariance[(row, column)] = before_gap.covariance[(row, column)];
        }
    }

    pub fn sigmas(&self) -> States {
        sigmas(&self.covariance)
    }

    pub(super) fn run_s(&self) -> f64 {
        self.time.seconds_since(self.since)
    }

    pub fn solution(&self) -> Solution {
        self.nominal.solution(self.time)
    }

    pub fn estimates(&self) -> Estimates {
        self.nominal
            .estimates(&self.covariance, self.run_s(), &self.layout, &self.noise)
    }

    /// Time update over the interval that ends at `time`; at rest, a zero-rate update.
    pub fn predict(&mut self, time: Time, raw: &Interval) -> Option<Correction> {
        let interval = self.nominal.compensated(raw);
        let before = self.nominal.ins.velocity_enu_mps;
        let step = self.nominal.ins.step(&interval, &Controls::default());
        let accel = (self.nominal.ins.velocity_enu_mps - before) / interval.seconds;
        let gain = (interval.seconds / ACCEL_S).min(1.0);
        self.accel_mps2 += gain * (accel - self.accel_mps2);
        let earth_rate = self.nominal.ins.local_earth().earth_rate();
        self.rate_radps = interval.angle_rad / interval.seconds - step.attitude.tr_mul(&earth_rate);
        self.integrals.add(&interval, &step);
        self.time = time;
        if self.integrals.seconds >= self.covariance_step_s {
            self.step_covariance();
        }
        match self.rest.on_interval(raw) {
            Some(Verdict::Rest(block)) if time.seconds_since(self.last_fix) <= HOLD_S => {
                self.correct_at_rest(&block)
            }
            _ => None,
        }
    }

    fn step_covariance(&mut self) {
        let seconds = self.integrals.seconds;
        if seconds <= 0.0 {
            return;
        }
        let transition = (self.integrals).transition(&self.nominal.ins, &self.layout, &self.noise);
        // Half of the process noise before and half after: exact to second order.
        let half = 0.5 * seconds * self.noise.process_noise(&self.layout, &self.nominal.ins);
        self.covariance += &half;
        self.covariance = propagated(&transition, &self.covariance) + half;
        for (kind, state) in self.layout.coloured_states() {
            let sigma = self.noise.of_kind(kind).correlated;
            let driving = sigma * sigma * (1.0 - self.noise.correlation(kind, 2.0 * seconds));
            self.covariance[(state, state)] += driving;
        }
        make_symmetric(&mut self.covariance);
        self.nominal.propagate(seconds, &self.noise);
        self.transition = times(&transition, &self.transition);
        self.integrals = StepIntegrals::default();
    }

    /// Measurement update with a fix whose time, less latency, has just passed.
    pub fn correct(&mut self, fix: &GnssFix) -> Correction {
        self.step_covariance();
        let mut update = Update::new(&self.covariance);
        let nominal = self.nominal;
        let past = PastState {
            nominal: &nominal,
            age_s: self
                .time
                .seconds_since(fix.time.plus_seconds(-nominal.latency_s)),
            accel_mps2: self.accel_mps2,
            rate_radps: self.rate_radps,
        };
        for kind in Kind::ALL {
            if let Some(measurement) = past.measurement(kind, fix, &self.noise, &self.layout) {
                self.update_gated(kind, &measurement, &mut update);
            }
        }
        self.last_fix = self.time;
        if self.shows_motion(fix) {
            self.rest.on_motion();
        }
        self.finish(update)
    }

    fn update_gated(&mut self, kind: Kind, measurement: &Measurement, update: &mut Update) {
        let rejected = &mut self.rejected[kind as usize];
        let mut mahalanobis = update.mahalanobis(measurement);
        let is_long = |run: &Rejections| {
            run.count >= DIVERGED_FIXES && self.time.seconds_since(run.since) >= DIVERGED_S
        };
        let diverged = rejected.as_ref().is_some_and(is_long) && mahalanobis > GATE_SIGMAS;
        if diverged {
            update.inflate(kind, mahalanobis / ROBUST_SIGMAS, &self.sigma_limits);
            mahalanobis = update.mahalanobis(measurement);
        }
        if mahalanobis > GATE_SIGMAS && !diverged {
            let since = self.time;
            rejected.get_or_insert(Rejections { count: 0, since }).count += 1;
            return;
        }
        *rejected = None;
        update.apply(measurement, (mahalanobis / ROBUST_SIGMAS).max(1.0));
    }

    fn correct_at_rest(&mut self, block: &RestBlock) -> Option<Correction> {
        self.step_covariance();
        if !self.noise.uses_zero_rate {
            return None;
        }
        let (rate, seconds) = (&block.rate_radps, block.seconds);
        let measurement = zero_rate(&self.nominal, rate, seconds, &self.noise, &self.layout);
        let mut update = Update::new(&self.covariance);
        if update.mahalanobis(&measurement) > REST_SIGMAS {
            return None;
        }
        update.apply(&measurement, 1.0);
        Some(self.finish(update))
    }

    fn finish(&mut self, update: Update) -> Correction {
        self.nominal = self.nominal.corrected_by(&update.errors, &self.layout);
        self.covariance = update.covariance;
        let identity = StateMatrix::identity(self.layout.size, self.layout.size);
        Correction {
            transition: core::mem::replace(&mut self.transition, identity),
            predicted: update.predicted,
            corrected: self.covariance.clone(),
            errors: update.errors,
        }
    }

    fn shows_motion(&self, fix: &GnssFix) -> bool {
        fix.speed_mps() > MOTION_MPS + MOTION_SIGMAS * total(&self.noise.gnss.velocity_mps)
    }
}

/// Initial sigmas; no limit for position and velocity, and at least those of divergence for the attitude.
fn sigma_limits(start: &StateMatrix) -> States {
    let mut limits = sigmas(start);
    for state in index::POSITION..index::ATTITUDE {
        limits[state] = f64::INFINITY;
    }
    for state in index::ATTITUDE..index::ATTITUDE + 2 {
        limits[state] = limits[state].max(DIVERGED_TILT_RAD);
    }
    let azimuth = index::ATTITUDE + 2;
    limits[azimuth] = limits[azimuth].max(DIVERGED_AZIMUTH_RAD);
    limits
}

/// Sequential measurement update, kind by kind.
struct Update {
    predicted: StateMatrix,
    errors: States,
    covariance: StateMatrix,
}

impl Update {
    fn new(predicted: &StateMatrix) -> Self {
        Self {
            predicted: predicted.clone(),
            errors: States::zeros(predicted.nrows()),
            covariance: predicted.clone(),
        }
    }

    fn innovation(&self, measurement: &Measurement) -> States {
        &measurement.difference - &measurement.jacobian * &self.errors
    }

    /// Cross-covariance of errors and innovation, `P H^T`, and covariance of the innovation, `S`.
    fn variances(&self, measurement: &Measurement) -> [StateMatrix; 2] {
        let mut cross = &self.covariance * measurement.jacobian.transpose();
        let mut variance = &measurement.jacobian * &cross;
        if let Some(shared) = &measurement.noise_correlation {
            let by_noise = &measurement.jacobian * shared;
            variance += &by_noise + by_noise.transpose();
            cross += shared;
        }
        variance += StateMatrix::from_diagonal(&measurement.variance);
        [cross, variance]
    }

    /// Mahalanobis distance of the innovation: the root of its NIS.
    fn mahalanobis(&self, measurement: &Measurement) -> f64 {
        let [_, variance] = self.variances(measurement);
        let innovation = self.innovation(measurement);
        // A singular `S`, without noise and uncertainty, rejects everything.
        variance.cholesky().map_or(f64::INFINITY, |root| {
            innovation.dot(&root.solve(&innovation)).sqrt()
        })
    }

    /// Updates with the innovation variance multiplied by `variance_factor`.
    ///
    /// `P + K S K^T - K (P H^T)^T - (P H^T) K^T`: Joseph's form for noise correlated with the errors.
    fn apply(&mut self, measurement: &Measurement, variance_factor: f64) {
        let [cross, variance] = self.variances(measurement);
        let variance = variance * variance_factor;
        let Some(root) = variance.clone().cholesky() else {
            return;
        };
        let gain = root.solve(&cross.transpose()).transpose();
        self.errors += &gain * self.innovation(measurement);
        let both = &gain * cross.transpose();
        self.covariance += &gain * (variance * gain.transpose()) - &both - both.transpose();
        make_symmetric(&mut self.covariance);
    }

    /// Inflates, after divergence, the sigmas of the errors that a kind measures, and of those that drive
    /// them, by a factor, but none beyond its limit.
    fn inflate(&mut self, kind: Kind, factor: f64, sigma_limits: &States) {
        let sigma = sigmas(&self.covariance);
        let driving = if kind.is_velocity() {
            index::ATTITUDE..index::LATENCY
        } else {
            0..0
        };
        for state in kind.states().chain(driving) {
            let factor = factor.min(sigma_limits[state] / sigma[state]).max(1.0);
            self.covariance.row_mut(state).scale_mut(factor);
            self.covariance.column_mut(state).scale_mut(factor);
        }
    }
}

fn make_symmetric(matrix: &mut StateMatrix) {
    *matrix = 0.5 * (&*matrix + matrix.transpose());
}

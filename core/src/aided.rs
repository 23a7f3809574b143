//! The aided INS: mechanization under the damping controls, compared with GNSS at the moments of
//! the fixes, with the estimators on top and their results taken out of the readings.

use nalgebra::{Vector2, Vector3};

use crate::alignment::rest::{self, RestBlock, RestDetector, Verdict as RestVerdict};
use crate::alignment::{Aligned, compensation};
use crate::attitude::matrix;
use crate::config::{Config, Feedback};
use crate::damping::{self, DampingSignals, Differences};
use crate::estimate::Estimates;
use crate::estimators::literal::Comparison;
use crate::estimators::observer::Difference;
use crate::estimators::parameters::{Parameters, index};
use crate::estimators::{Estimator, Verdict};
use crate::history::{History, Missing, Moment, Past};
use crate::increments::Interval;
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::mechanization::{Controls, Mechanization, Step};
use crate::outcome::GnssOutcome;
use crate::ring::Ring;
use crate::samples::GnssFix;
use crate::solution::{Phase, Solution};
use crate::time::Time;

/// Fixes that may wait for their moment.
const PENDING: usize = 4;
/// Longest time that controls are held without a new fix, s.
const HOLD_S: f64 = 1.5;
/// Interval at which an INS without fixes is corrected, s.
const COAST_S: f64 = 0.5;
/// Least time between two fixes that are used, s.
const LEAST_INTERVAL_S: f64 = 0.01;
/// Interval at which the parameters are solved for, s.
const SOLVE_S: f64 = 1.0;
/// Largest spread of an azimuth error that is taken out whatever its size, rad, and sigmas that
/// a larger one must have.
const AZIMUTH_KNOWN_RAD: f64 = 0.035;
const AZIMUTH_SIGMAS: f64 = 3.0;
/// A parameter is taken out once its spread is below this part of what was believed before.
const BIAS_KNOWN: f64 = 0.5;
const LATENCY_KNOWN: f64 = 0.2;
/// Largest latency that the ring can serve, s.
const LATENCY_LIMIT_S: f64 = 0.4;
/// Fixes refused in a row after which the INS, not GNSS, is taken to be wrong.
const LOST_FIXES: u8 = 10;
/// Distance from the INS beyond which a position is not believed, m.
const POSITION_GATE_M: f64 = 100.0;

/// Errors taken out of readings and stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Compensation {
    gyro_radps: Vector3<f64>,
    accel_mps2: Vector3<f64>,
    latency_s: f64,
}

/// The aided INS.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AidedIns {
    mechanization: Mechanization,
    now: Moment,
    history: History,
    estimator: Estimator,
    compensation: Compensation,
    controls: Controls,
    controls_until: Time,
    pending: Ring<GnssFix, PENDING>,
    /// Moment of the last fix that was compared.
    last_compared: Time,
    refused: u8,
    positions_refused: u8,
    rest: RestDetector,
    last_solve: Time,
    work_left: bool,
    since: Time,
    /// Azimuth taken out since the start, rad.
    azimuth_removed_rad: f64,
    manoeuvre: Manoeuvre,
    /// Stamp and velocity difference of the last fix that was compared, ENU, m/s.
    compared: (Time, Vector3<f64>),
}

impl AidedIns {
    /// Starts where alignment ended, with what it knows of the sensors and of the azimuth.
    #[expect(
        clippy::inline_always,
        reason = "made where it stays: otherwise 2 kB are copied over the stack"
    )]
    #[inline(always)]
    pub fn new(time: Time, aligned: &Aligned, known: &Parameters, config: &Config) -> Self {
        let gyro_radps = compensation(known, config);
        Self {
            mechanization: aligned.ins,
            now: Moment::start(time),
            history: History::default(),
            estimator: Estimator::new(time, aligned.tilt_sigma_rad, known, config),
            compensation: Compensation {
                gyro_radps,
                ..Compensation::default()
            },
            controls: Controls::default(),
            controls_until: time,
            pending: Ring::default(),
            last_compared: time,
            refused: 0,
            positions_refused: 0,
            rest: RestDetector::default(),
            last_solve: time,
            work_left: false,
            since: time,
            azimuth_removed_rad: 0.0,
            manoeuvre: Manoeuvre::default(),
            compared: (time, Vector3::zeros()),
        }
    }

    /// Spread of its roll and pitch, rad.
    pub fn tilt_sigma_rad(&self) -> Option<f64> {
        self.estimator.tilt_sigma_rad()
    }

    /// The damped INS.
    pub fn mechanization(&self) -> &Mechanization {
        &self.mechanization
    }

    /// What has been found of the sensors.
    pub fn known(&self) -> &Parameters {
        self.estimator.parameters()
    }

    /// The manoeuvre going on.
    pub fn manoeuvre(&self) -> Manoeuvre {
        self.manoeuvre
    }

    /// The last comparison with GNSS and what acts on the INS.
    pub fn signals(&self) -> DampingSignals {
        let (time, difference_enu_mps) = self.compared;
        DampingSignals {
            time,
            difference_enu_mps,
            accel_enu_mps2: self.controls.accel_mps2,
            rate_enu_radps: self.controls.rate_radps,
        }
    }

    /// The damped INS, with closed feedback less the errors that the estimators still see in it.
    pub fn solution(&self, config: &Config) -> Solution {
        let mut ins = self.mechanization;
        if config.feedback == Feedback::Closed {
            let error = self.estimator.error_at(&self.now);
            ins.velocity_enu_mps -= error.velocity_mps;
            ins.turn_platform(&-error.tilt_rad);
        }
        Solution {
            time: self.now.time,
            position: ins.position,
            velocity_enu_mps: ins.velocity_enu_mps,
            attitude: ins.attitude,
        }
    }

    /// Errors of the sensors.
    pub fn estimates(&self, config: &Config) -> Estimates {
        let mut parameters = *self.known();
        let azimuth = self.azimuth_error_rad();
        parameters.set(index::AZIMUTH, azimuth, parameters.sigma(index::AZIMUTH));
        let mut estimates = Estimates::from_parameters(&parameters, config, Phase::Navigating);
        if let Estimator::Exact(observer) = &self.estimator {
            let run_s = self.now.time.seconds_since(self.since);
            let latency = &mut estimates.gnss_latency_s;
            (latency.value, latency.sigma) = observer.latency_before(0.5 * run_s);
        }
        estimates
    }

    /// Azimuth error that is still in the damped INS, rad.
    pub fn azimuth_left_rad(&self) -> f64 {
        self.estimator.error_at(&self.now).tilt_rad.z
    }

    /// What the azimuth error would be now if the starting heading had been kept and the gyros
    /// compensated from the start: left over, less what controls and compensations have turned,
    /// plus what the found errors of the gyros did.
    fn azimuth_error_rad(&self) -> f64 {
        let parameters = self.known();
        let drift = self.now.attitude_s * parameters.vector(index::GYRO);
        let scale = self.now.turn_rad * parameters.value(index::GYRO_TURN + 2);
        self.azimuth_left_rad() - self.now.control_tilt_rad.z + drift.z + scale
    }

    /// Inertial samples were missing for `seconds`, and were filled in.
    pub fn on_hole(&mut self, seconds: f64) {
        if let Estimator::Exact(observer) = &mut self.estimator {
            observer.on_hole(seconds);
        }
    }

    /// Advances over the interval that ends at `time`.
    #[inline(never)]
    pub fn on_interval(&mut self, time: Time, raw: &Interval, config: &Config) {
        let coasts = time > self.controls_until;
        if coasts {
            self.coast(config);
        }
        let Compensation {
            gyro_radps,
            accel_mps2,
            ..
        } = self.compensation;
        let interval = raw.without_bias(&gyro_radps, &accel_mps2);
        let step = self.mechanization.step(&interval, &self.controls);
        self.total(time, &interval, &step);
        // Only GNSS tells rest from steady motion.
        match self.rest.on_interval(raw) {
            Some(RestVerdict::Rest(block)) if !coasts => self.measure_rest(&block, config),
            _ => {}
        }
    }

    /// What is left to do after an interval: at most one fix or one piece of the estimators' work
    /// a call, to keep the longest call short, unless samples are rare.
    #[inline(never)]
    pub fn follow_up(&mut self, config: &Config) {
        let due = self.work_left;
        let remembers = self.history.wants(self.now.time);
        if remembers {
            self.remember();
        }
        let took = self.take_waiting(true, config);
        if due && (remembers || !took) {
            self.work_left = remembers;
            self.work(config);
        }
    }

    #[inline(never)]
    fn remember(&mut self) {
        self.history
            .push(self.now, self.mechanization.velocity_enu_mps);
        self.work_left = true;
    }

    /// Without GNSS the loops are open: what the observer sees in the INS is taken out at once,
    /// again and again, for the position to follow it. The observer stays where a late fix still
    /// finds it, and takes short steps: over long ones it is not exact.
    #[inline(never)]
    fn coast(&mut self, config: &Config) {
        self.controls = Controls::default();
        let Some((horizon, velocity_mps)) = self.history.oldest() else {
            return;
        };
        let since_s = horizon.time.seconds_since(self.last_compared);
        if config.feedback == Feedback::Open || since_s < COAST_S {
            return;
        }
        let frame_rate = self.frame_rate(&velocity_mps);
        let Estimator::Exact(observer) = &mut self.estimator else {
            return;
        };
        observer.propagate(&horizon, &frame_rate, config);
        self.last_compared = horizon.time;
        let error = observer.error_at(&self.now);
        self.mechanization.velocity_enu_mps -= error.velocity_mps;
        self.mechanization.turn_platform(&-error.tilt_rad);
        self.now.control_velocity_mps -= error.velocity_mps;
        self.now.control_tilt_rad -= error.tilt_rad;
        self.azimuth_removed_rad += error.tilt_rad.z;
    }

    /// Rate at which the navigation frame turns, rad/s.
    fn frame_rate(&self, velocity_mps: &Vector3<f64>) -> Vector3<f64> {
        let earth = self.mechanization.local_earth();
        earth.earth_rate() + earth.transport_rate(velocity_mps)
    }

    /// Adds a step to the totals of the present moment.
    fn total(&mut self, time: Time, interval: &Interval, step: &Step) {
        let (dt, controls) = (interval.seconds, &self.controls);
        let tilt = dt * (controls.rate_radps + step.attitude * self.compensation.gyro_radps);
        let push = dt * (controls.accel_mps2 - step.attitude * self.compensation.accel_mps2);
        let now = &mut self.now;
        now.time = time;
        now.force_mps += step.force_enu_mps;
        now.attitude_s += step.attitude * dt;
        now.turn_rad += interval.angle_rad.z;
        now.control_velocity_mps += step
            .force_enu_mps
            .cross(&(now.control_tilt_rad + 0.5 * tilt))
            + push;
        now.control_tilt_rad += tilt;
        self.azimuth_removed_rad -= dt * controls.rate_radps.z;
    }

    /// A vehicle at rest turns with the Earth: its gyros read their biases.
    #[inline(never)]
    fn measure_rest(&mut self, block: &RestBlock, config: &Config) {
        let Estimator::Exact(observer) = &mut self.estimator else {
            return;
        };
        let earth_rate = self.mechanization.local_earth().earth_rate();
        let bias = block.rate_radps - matrix(&self.mechanization.attitude).tr_mul(&earth_rate);
        let variance = rest::gyro_variance(&config.sensors, block.seconds);
        // Quiet sensors may also be those of a slow turn: of a vehicle that is pushed, or afloat.
        let known = observer.parameters();
        let agrees =
            |(axis, bias): (usize, &f64)| known.agrees(index::GYRO + axis, *bias, variance);
        if !bias.iter().enumerate().all(agrees) {
            return;
        }
        for (axis, bias) in bias.iter().enumerate() {
            observer.measure(index::GYRO + axis, *bias, variance);
        }
    }

    /// Takes a fix: at once if its moment has passed, else later.
    pub fn on_fix(&mut self, fix: &GnssFix, config: &Config) -> GnssOutcome {
        let at_once = match self.pending.oldest() {
            None => self.compare(fix, true, config),
            Some(_) => None,
        };
        let outcome = at_once.unwrap_or_else(|| self.queue(fix, config));
        let taken = matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued);
        if taken && fix.is_moving(config) {
            self.rest.on_motion();
        }
        outcome
    }

    /// Lets a fix wait; one that has waited longest makes room.
    fn queue(&mut self, fix: &GnssFix, config: &Config) -> GnssOutcome {
        let room = self.pending.push(*fix).is_ok()
            || (self.take_waiting(false, config) && self.pending.push(*fix).is_ok());
        if room {
            GnssOutcome::Queued
        } else {
            GnssOutcome::TooFarAhead
        }
    }

    /// Takes the oldest fix that waits, if its moment has passed.
    fn take_waiting(&mut self, wait: bool, config: &Config) -> bool {
        let Some(fix) = self.pending.oldest().copied() else {
            return false;
        };
        let took = self.compare(&fix, wait, config).is_some();
        if took {
            self.pending.pop();
        }
        took
    }

    /// Compares a fix with the INS of its own moment; `None` while that lies ahead.
    fn compare(&mut self, fix: &GnssFix, wait: bool, config: &Config) -> Option<GnssOutcome> {
        let outcome = self.process(fix, wait, config);
        if outcome == Some(GnssOutcome::Outlier) {
            self.refuse(fix, config);
        } else if self.positions_refused >= LOST_FIXES {
            self.move_to(fix);
        }
        outcome
    }

    /// What the estimators do besides taking fixes, a piece at a time.
    fn work(&mut self, config: &Config) {
        if self.now.time.seconds_since(self.last_solve) >= SOLVE_S {
            self.last_solve = self.now.time;
            self.solve(config);
        } else if let Estimator::Exact(observer) = &mut self.estimator {
            observer.spread_next();
        }
    }

    /// The comparison itself; its temporaries must not lie on the stack of every sample.
    #[inline(never)]
    fn process(&mut self, fix: &GnssFix, wait: bool, config: &Config) -> Option<GnssOutcome> {
        let moment = fix.time.plus_seconds(-self.compensation.latency_s);
        let past = match self.history.at(moment, wait) {
            Ok(past) => past,
            Err(Missing::Future) => return None,
            Err(Missing::TooOld) => return Some(GnssOutcome::TooOld),
        };
        let interval_s = moment.seconds_since(self.last_compared);
        if interval_s < LEAST_INTERVAL_S {
            return Some(GnssOutcome::TimeNotIncreasing);
        }
        let mut differences = Differences {
            position_m: self.position_difference(&past, fix),
            ..Differences::default()
        };
        if fix.velocity_en_mps.is_some() {
            let velocity_mps = past.velocity_mps - fix.velocity_enu_mps();
            self.manoeuvre = Manoeuvre::of(&past);
            let verdict = self.observe(&past, fix, velocity_mps, config);
            if verdict == Verdict::Outlier {
                self.last_compared = moment;
                return Some(GnssOutcome::Outlier);
            }
            self.refused = 0;
            let lever_arm = match config.feedback {
                Feedback::Closed => self.known().lever_arm(),
                Feedback::Open => Vector2::zeros(),
            };
            let antenna = past.attitude_rate.fixed_columns::<2>(0) * lever_arm;
            let at_antenna = velocity_mps + antenna;
            differences.velocity_en_mps = Some(at_antenna.xy());
            differences.velocity_up_mps = (verdict == Verdict::Used).then_some(at_antenna.z);
        }
        self.damp(fix, &differences, interval_s, config);
        self.last_compared = moment;
        Some(GnssOutcome::Accepted)
    }

    fn observe(
        &mut self,
        past: &Past,
        fix: &GnssFix,
        velocity_mps: Vector3<f64>,
        config: &Config,
    ) -> Verdict {
        let has_up = fix.velocity_up_mps.is_some();
        let latency_applied_s = self.compensation.latency_s;
        let frame_rate = self.frame_rate(&past.velocity_mps);
        match &mut self.estimator {
            Estimator::Exact(observer) => {
                let difference = Difference {
                    velocity_mps,
                    has_up,
                    stated_sigma_mps: fix.sigma.velocity_mps,
                    latency_applied_s,
                };
                observer.take(past, &frame_rate, &difference, config)
            }
            Estimator::Literal(literal) => literal.take(&Comparison {
                past,
                manoeuvre: self.manoeuvre,
                difference_mps: velocity_mps,
                has_up,
                accel_up_mps2: self.controls.accel_mps2.z,
                azimuth_removed_rad: self.azimuth_removed_rad,
                latency_applied_s,
                accel_compensation_mps2: self.compensation.accel_mps2,
                bandwidth_radps: config.damping.horizontal.bandwidth_radps,
            }),
        }
    }

    /// INS minus GNSS, m; none for a position too far off to be true.
    fn position_difference(&mut self, past: &Past, fix: &GnssFix) -> Option<Vector3<f64>> {
        let gnss = fix.geodetic_or(self.mechanization.position.height_m)?;
        let since_s = self.now.time.seconds_since(past.moment.time);
        let moved = 0.5 * since_s * (past.velocity_mps + self.mechanization.velocity_enu_mps);
        let ins = &self.mechanization;
        let difference = ins.local_earth().enu_between(&gnss, &ins.position) - moved;
        if difference.norm_squared() < POSITION_GATE_M * POSITION_GATE_M {
            self.positions_refused = 0;
            return Some(difference);
        }
        self.positions_refused = self.positions_refused.saturating_add(1);
        None
    }

    /// Many positions in a row say where the INS really is.
    #[inline(never)]
    fn move_to(&mut self, fix: &GnssFix) {
        let Mechanization {
            position,
            velocity_enu_mps,
            attitude,
            ..
        } = self.mechanization;
        let position = fix.geodetic_or(position.height_m).unwrap_or(position);
        self.mechanization = Mechanization::new(position, velocity_enu_mps, attitude);
        self.positions_refused = 0;
    }

    /// Sets the controls that hold until the next fix.
    fn damp(&mut self, fix: &GnssFix, differences: &Differences, interval_s: f64, config: &Config) {
        let parameters = self.known();
        let azimuth = parameters.value(index::AZIMUTH);
        let sigma = parameters.sigma(index::AZIMUTH);
        let significant = sigma < AZIMUTH_KNOWN_RAD || math::abs(azimuth) > AZIMUTH_SIGMAS * sigma;
        let differences = Differences {
            azimuth_rad: (config.feedback == Feedback::Closed && significant).then_some(azimuth),
            ..*differences
        };
        let interval_s = math::min(interval_s, HOLD_S);
        self.controls = damping::controls(&differences, interval_s, &config.damping);
        self.controls_until = self.now.time.plus_seconds(HOLD_S);
        let level = differences.velocity_en_mps.unwrap_or_default();
        let up = differences.velocity_up_mps.unwrap_or_default();
        self.compared = (fix.time, level.push(up));
    }

    /// One bad fix is GNSS's fault; many in a row are the INS's, which then starts again from one.
    #[inline(never)]
    fn refuse(&mut self, fix: &GnssFix, config: &Config) {
        self.refused = self.refused.saturating_add(1);
        if self.refused < LOST_FIXES {
            return;
        }
        let Mechanization {
            position, attitude, ..
        } = self.mechanization;
        let position = fix.geodetic_or(position.height_m).unwrap_or(position);
        self.mechanization = Mechanization::new(position, fix.velocity_enu_mps(), attitude);
        self.now = Moment::start(self.now.time);
        self.history.forget();
        match &mut self.estimator {
            Estimator::Exact(observer) => observer.restart(self.now.time, config),
            Estimator::Literal(literal) => literal.restart(),
        }
        self.pending = Ring::default();
        self.controls = Controls::default();
        self.since = self.now.time;
        self.last_compared = self.now.time;
        self.refused = 0;
    }

    /// Solves for the parameters and takes out those that are known.
    ///
    /// Its temporaries must not lie on the stack of every sample.
    #[inline(never)]
    fn solve(&mut self, config: &Config) {
        match &mut self.estimator {
            Estimator::Exact(observer) => observer.solve(config),
            Estimator::Literal(literal) => literal.solve(),
        }
        if config.feedback == Feedback::Open {
            return;
        }
        let (parameters, prior) = (self.estimator.parameters(), config.prior());
        let known = |i: usize, part: f64| parameters.sigma(i) < part * prior.sigma(i);
        // (9) reads gyro biases from controls that a compensation would empty.
        if let Estimator::Exact(_) = self.estimator {
            let gyros = &mut self.compensation.gyro_radps;
            for (axis, gyro) in gyros.iter_mut().enumerate() {
                if known(index::GYRO + axis, BIAS_KNOWN) {
                    *gyro = parameters.value(index::GYRO + axis);
                }
            }
        }
        for (axis, accel) in self.compensation.accel_mps2.iter_mut().enumerate() {
            if known(index::ACCEL + axis, BIAS_KNOWN) {
                *accel = parameters.value(index::ACCEL + axis);
            }
        }
        if known(index::LATENCY, LATENCY_KNOWN) {
            let latency_s = parameters.value(index::LATENCY);
            self.compensation.latency_s =
                math::max(math::min(latency_s, LATENCY_LIMIT_S), -LATENCY_LIMIT_S);
        }
    }
}

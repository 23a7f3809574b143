//! The aided INS: mechanization under the damping controls, compared with GNSS at the moments of
//! the fixes, with the estimators on top and their results taken out of the readings.

use nalgebra::Vector3;

use crate::alignment::rest::{self, RestBlock, RestDetector, Verdict as RestVerdict};
use crate::alignment::{Aligned, compensation};
use crate::attitude::matrix;
use crate::config::{Config, Feedback, Form};
use crate::damping::{self, DampingSignals, Differences};
use crate::earth::Geodetic;
use crate::estimate::Estimates;
use crate::estimators::literal::{Comparison, Literal};
use crate::estimators::observer::{Difference, Observer, Verdict};
use crate::estimators::parameters::{Parameters, index};
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
/// Interval at which the normal equations are solved, s.
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
/// Range over which the equations are linear enough: azimuth, rad, and latency, s; a parameter
/// is well known below this part of it.
const AZIMUTH_LINEAR_RAD: f64 = 0.02;
const LATENCY_LINEAR_S: f64 = 0.02;
const WELL_KNOWN: f64 = 0.3;
/// Growth of the spreads when the equations are replaced by their solution.
const RELINEARIZED: f64 = 3.0;

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
    observer: Observer,
    literal: Literal,
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
    since: Time,
    /// Azimuth taken out since the start, rad.
    azimuth_removed_rad: f64,
    azimuth_settled: bool,
    /// By how much data, not drift, have moved the latency since the equations were linearized.
    latency_corrected_s: f64,
    manoeuvre: Manoeuvre,
    signals: DampingSignals,
}

impl AidedIns {
    /// Starts where alignment ended.
    pub fn new(time: Time, aligned: &Aligned, config: &Config) -> Self {
        let mechanization = start_at(&aligned.fix, Geodetic::default(), aligned.attitude);
        let now = Moment::start(time, mechanization.velocity_enu_mps);
        let mut known = aligned.known;
        known.set(index::AZIMUTH, 0.0, aligned.heading_sigma_rad);
        let gyro_radps = compensation(&known, config);
        let mut ins = Self {
            mechanization,
            now,
            history: History::default(),
            observer: Observer::new(now, config, &known, config.start_tilt_sigma()),
            literal: Literal::new(config.sensors.accel_bias_mps2),
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
            since: time,
            azimuth_removed_rad: 0.0,
            azimuth_settled: false,
            latency_corrected_s: 0.0,
            manoeuvre: Manoeuvre::default(),
            signals: DampingSignals::default(),
        };
        ins.history.push(now);
        ins
    }

    /// The damped INS.
    pub fn mechanization(&self) -> &Mechanization {
        &self.mechanization
    }

    /// What has been found of the sensors.
    pub fn known(&self) -> &Parameters {
        &self.observer.parameters
    }

    /// The manoeuvre going on.
    pub fn manoeuvre(&self) -> Manoeuvre {
        self.manoeuvre
    }

    /// What the last fix did.
    pub fn signals(&self) -> DampingSignals {
        self.signals
    }

    /// The damped INS, with closed feedback less the errors that the observer still sees in it.
    pub fn solution(&self, config: &Config) -> Solution {
        let mut ins = self.mechanization;
        if config.feedback == Feedback::Closed && config.form == Form::Exact {
            let error = self.observer.error_at(&self.now);
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
        let mut parameters = self.parameters(config);
        let azimuth = self.azimuth_error_rad(config);
        parameters.set(index::AZIMUTH, azimuth, parameters.sigma(index::AZIMUTH));
        let mut estimates = Estimates::from_parameters(&parameters, config, Phase::Navigating);
        let run_s = self.now.time.seconds_since(self.since);
        let latency = self.observer.latency_before(0.5 * run_s);
        if let (Some((value, sigma)), Form::Exact) = (latency, config.form) {
            estimates.gnss_latency_s.value = value;
            estimates.gnss_latency_s.sigma = sigma;
        }
        estimates
    }

    /// What the chosen form has found; azimuth and latency are those of the last fix.
    fn parameters(&self, config: &Config) -> Parameters {
        match config.form {
            Form::Exact => self.observer.parameters,
            Form::Literal => self
                .literal
                .parameters(&config.prior(), self.azimuth_removed_rad),
        }
    }

    /// Azimuth error that is still in the damped INS, rad.
    pub fn azimuth_left_rad(&self, config: &Config) -> f64 {
        match config.form {
            Form::Exact => self.observer.error_at(&self.now).tilt_rad.z,
            Form::Literal => self.parameters(config).value(index::AZIMUTH),
        }
    }

    /// What the azimuth error would be now if the starting heading had been kept and the gyros
    /// compensated from the start: left over, less what controls and compensations have turned,
    /// plus what the found errors of the gyros did.
    fn azimuth_error_rad(&self, config: &Config) -> f64 {
        let parameters = self.parameters(config);
        let drift = self.now.attitude_s * parameters.vector(index::GYRO);
        let scale = self.now.turn_rad * parameters.value(index::GYRO_TURN + 2);
        self.azimuth_left_rad(config) - self.now.control_tilt_rad.z + drift.z + scale
    }

    /// Inertial samples were missing for `seconds`, and were filled in.
    pub fn on_hole(&mut self, seconds: f64) {
        self.observer.on_hole(seconds);
    }

    /// Advances over the interval that ends at `time`.
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
        if self.history.wants(time) {
            self.history.push(self.now);
            self.process_pending(config);
        }
    }

    /// Without GNSS the loops are open: what the observer sees in the INS is taken out at once,
    /// again and again, for the position to follow it. The observer stays where a late fix still
    /// finds it, and takes short steps: over long ones it is not exact.
    fn coast(&mut self, config: &Config) {
        self.controls = Controls::default();
        let corrects = config.feedback == Feedback::Closed && config.form == Form::Exact;
        let Some(horizon) = self.history.oldest().copied().filter(|_| corrects) else {
            return;
        };
        if horizon.time.seconds_since(self.last_compared) < COAST_S {
            return;
        }
        let frame_rate = self.frame_rate(&horizon.velocity_mps);
        self.observer.propagate(&horizon, &frame_rate, config);
        self.last_compared = horizon.time;
        let error = self.observer.error_at(&self.now);
        self.mechanization.velocity_enu_mps -= error.velocity_mps;
        self.mechanization.turn_platform(&-error.tilt_rad);
        self.now.velocity_mps = self.mechanization.velocity_enu_mps;
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
        now.velocity_mps = self.mechanization.velocity_enu_mps;
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
    fn measure_rest(&mut self, block: &RestBlock, config: &Config) {
        let earth_rate = self.mechanization.local_earth().earth_rate();
        let bias = block.rate_radps - matrix(&self.mechanization.attitude).tr_mul(&earth_rate);
        let variance = rest::gyro_variance(&config.sensors, block.seconds);
        for (axis, bias) in bias.iter().enumerate() {
            self.observer.measure(index::GYRO + axis, *bias, variance);
        }
    }

    /// Takes a fix: at once if its moment has passed, else later.
    pub fn on_fix(&mut self, fix: &GnssFix, config: &Config) -> GnssOutcome {
        let at_once = if self.pending.oldest().is_none() {
            self.process(fix, config)
        } else {
            None
        };
        let outcome = match at_once {
            Some(outcome) => outcome,
            None if self.pending.push(*fix).is_ok() => GnssOutcome::Queued,
            None => GnssOutcome::TooFarAhead,
        };
        let taken = matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued);
        if taken && fix.is_moving(config) {
            self.rest.on_motion();
        }
        outcome
    }

    fn process_pending(&mut self, config: &Config) {
        while let Some(fix) = self.pending.oldest().copied() {
            if self.process(&fix, config).is_none() {
                // With a negative latency some fix may always wait: the equations must not.
                break;
            }
            self.pending.pop();
        }
        // Not in the call that took a fix, to keep the longest call short.
        if self.now.time.seconds_since(self.last_solve) >= SOLVE_S {
            self.last_solve = self.now.time;
            self.solve(config);
        }
    }

    /// Compares a fix with the INS of its own moment; `None` while that lies ahead.
    fn process(&mut self, fix: &GnssFix, config: &Config) -> Option<GnssOutcome> {
        let moment = fix.time.plus_seconds(-self.compensation.latency_s);
        let past = match self.history.at(moment) {
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
            let velocity_mps = past.moment.velocity_mps - fix.velocity_enu_mps();
            let verdict = self.observe(&past, fix, velocity_mps, config);
            if verdict == Verdict::Outlier {
                self.last_compared = moment;
                self.refuse(fix, config);
                return Some(GnssOutcome::Outlier);
            }
            self.refused = 0;
            let antenna = past.attitude_rate.fixed_columns::<2>(0) * self.known().lever_arm();
            let at_antenna = velocity_mps + antenna;
            differences.velocity_en_mps = Some(at_antenna.xy());
            differences.velocity_up_mps = (verdict == Verdict::Used).then_some(at_antenna.z);
            self.manoeuvre = Manoeuvre::of(&past);
            if config.form == Form::Literal {
                self.take_literally(&past, &at_antenna, config);
            }
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
        let difference = Difference {
            velocity_mps,
            has_up: fix.velocity_up_mps.is_some(),
            latency_applied_s: self.compensation.latency_s,
        };
        let frame_rate = self.frame_rate(&past.moment.velocity_mps);
        self.observer.take(past, &frame_rate, &difference, config)
    }

    fn take_literally(&mut self, past: &Past, difference: &Vector3<f64>, config: &Config) {
        self.literal.take(&Comparison {
            past,
            manoeuvre: self.manoeuvre,
            difference_mps: difference.xy(),
            accel_up_mps2: self.controls.accel_mps2.z,
            azimuth_removed_rad: self.azimuth_removed_rad,
            latency_applied_s: self.compensation.latency_s,
            accel_compensation_mps2: self.compensation.accel_mps2,
            bandwidth_radps: config.damping.horizontal.bandwidth_radps,
        });
    }

    /// INS minus GNSS, m; none for a position too far off to be true, unless many in a row say
    /// so, which moves the INS there.
    fn position_difference(&mut self, past: &Past, fix: &GnssFix) -> Option<Vector3<f64>> {
        let gnss = fix.position?;
        let since_s = self.now.time.seconds_since(past.moment.time);
        let moved = 0.5 * since_s * (past.moment.velocity_mps + self.now.velocity_mps);
        let difference = self.mechanization.position.enu_from(&gnss) - moved;
        if difference.norm() < POSITION_GATE_M {
            self.positions_refused = 0;
            return Some(difference);
        }
        self.positions_refused = self.positions_refused.saturating_add(1);
        if self.positions_refused >= LOST_FIXES {
            let Mechanization {
                velocity_enu_mps,
                attitude,
                ..
            } = self.mechanization;
            self.mechanization = Mechanization::new(gnss, velocity_enu_mps, attitude);
            self.positions_refused = 0;
        }
        None
    }

    /// Sets the controls that hold until the next fix.
    fn damp(&mut self, fix: &GnssFix, differences: &Differences, interval_s: f64, config: &Config) {
        let parameters = self.parameters(config);
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
        self.signals = DampingSignals::of(fix.time, &differences, &self.controls);
    }

    /// One bad fix is GNSS's fault; many in a row are the INS's, which then starts again from one.
    fn refuse(&mut self, fix: &GnssFix, config: &Config) {
        self.refused = self.refused.saturating_add(1);
        if self.refused < LOST_FIXES {
            return;
        }
        let Mechanization {
            position, attitude, ..
        } = self.mechanization;
        self.mechanization = start_at(fix, position, attitude);
        self.now = Moment::start(self.now.time, self.mechanization.velocity_enu_mps);
        self.history = History::default();
        self.history.push(self.now);
        self.observer.restart(self.now, config.start_tilt_sigma());
        self.pending = Ring::default();
        self.controls = Controls::default();
        self.since = self.now.time;
        self.last_compared = self.now.time;
        self.refused = 0;
    }

    /// Solves for the parameters and takes out those that are known.
    fn solve(&mut self, config: &Config) {
        let latency_s = self.known().value(index::LATENCY);
        self.observer.solve();
        if config.feedback == Feedback::Open {
            return;
        }
        self.latency_corrected_s += self.known().value(index::LATENCY) - latency_s;
        let (parameters, prior) = (self.parameters(config), config.prior());
        let known = |i: usize, part: f64| parameters.sigma(i) < part * prior.sigma(i);
        // (9) reads gyro biases from controls that a compensation would empty.
        if config.form == Form::Exact {
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
        self.relinearize(&prior);
    }

    /// Equations gathered about values that turned out far off are replaced by their solution:
    /// once for the azimuth of a new start, and whenever a well-known latency has moved.
    fn relinearize(&mut self, prior: &Parameters) {
        let known = self.known();
        let latency = math::abs(self.latency_corrected_s) > LATENCY_LINEAR_S
            && known.sigma(index::LATENCY) < WELL_KNOWN * LATENCY_LINEAR_S;
        let azimuth = !self.azimuth_settled
            && known.sigma(index::AZIMUTH) < WELL_KNOWN * AZIMUTH_LINEAR_RAD
            && math::abs(known.value(index::AZIMUTH)) < WELL_KNOWN * AZIMUTH_LINEAR_RAD;
        self.azimuth_settled |= azimuth;
        if latency || (azimuth && math::abs(self.azimuth_removed_rad) > AZIMUTH_LINEAR_RAD) {
            let sigma = self.known().sigma.zip_map(&prior.sigma, |now, before| {
                math::min(RELINEARIZED * now, before)
            });
            self.observer.relinearize(&sigma);
            self.latency_corrected_s = 0.0;
        }
    }
}

/// An INS that moves as a fix says; at `position` if the fix has none.
fn start_at(
    fix: &GnssFix,
    position: Geodetic,
    attitude: nalgebra::UnitQuaternion<f64>,
) -> Mechanization {
    Mechanization::new(
        fix.position.unwrap_or(position),
        fix.velocity_enu_mps(),
        attitude,
    )
}

//! The aided INS: mechanization under the damping controls, compared with GNSS at the times of the fixes,
//! estimators, and compensation of the sensors by them.

mod barometer;
mod comparison;
mod compensation;
mod estimator;
mod fixes;
mod latency_search;
mod vertical_sign;

use nalgebra::Vector3;

pub use self::barometer::Barometer;
use self::barometer::ClimbDifference;
use self::comparison::Comparison;
use self::compensation::Compensation;
use self::estimator::Estimator;
use self::latency_search::LatencySearch;
use self::vertical_sign::{ClimbSample, VerticalSign};
use crate::alignment::levelling::UNSEEN_RADPS;
use crate::alignment::rest::{self, RestBlock, RestDetector, Verdict as RestVerdict};
use crate::alignment::{Aligned, AttitudeSource, MOVING_MPS};
use crate::attitude::{matrix, up};
use crate::config::{Config, Feedback};
use crate::damping::DampingSignals;
use crate::earth::{GRAVITY_EQUATOR_MPS2, wrap_pi};
use crate::error_model::InsError;
use crate::estimate::Estimates;
use crate::health::Counts;
use crate::history::{History, Missing, SPACING_S, Span, Vibration};
use crate::increments::Interval;
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::mechanization::{Controls, Mechanization, Step};
use crate::observer::{AZIMUTH_JUMP, DataGap, Disturbance, Observer};
use crate::outcome::GnssOutcome;
use crate::parameters::{Parameters, index};
use crate::ring::Ring;
use crate::samples::{GnssFix, Heading};
use crate::solution::{Phase, Solution, SolutionSigma};
use crate::time::Time;

/// Length of the queue of fixes.
const PENDING: usize = 10;
/// Longest time that controls are held without a new fix, s.
const HOLD_S: f64 = 1.5;
/// A longer gap may have fixes of its own, s.
const LONG_GAP_S: f64 = 0.3;
/// Time after a measured heading for which it determines the up gyro's bias, and rest, perhaps a slow turn,
/// does not, s.
const HEADING_MEMORY_S: f64 = 30.0;
/// Interval at which an INS without aiding is corrected, s.
const COAST_S: f64 = 0.5;
/// Sample time per step of work, s: at ten fixes a second two thirds of these are busy.
const WORK_STEP_S: f64 = 0.0101;
/// Interval at which the parameters are solved for, s.
const SOLVE_S: f64 = 1.0;

/// Rotation of the platform about the vertical, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct AzimuthTotals {
    /// Controls and compensations, rad.
    controls_rad: f64,
    /// By a unit of each gyro bias, s.
    gyros_s: Vector3<f64>,
    /// By a unit of each gyro's scale error, rad: in all turns, and in those about the vertical.
    scales_rad: Vector3<f64>,
    vertical_rad: Vector3<f64>,
    /// All rotations, and those about the vertical, rad: a unit of each misalignment of the gyros takes the
    /// first beyond the others.
    angle_rad: Vector3<f64>,
    turn_rad: f64,
}

impl AzimuthTotals {
    /// Appends a span, over which up hardly turns in the body.
    #[must_use]
    fn plus(mut self, span: &Span) -> Self {
        let up_s = span.attitude_s.row(2).transpose();
        // A span of no length has turned nothing.
        let up = up_s / math::max(span.seconds, 1e-9);
        self.controls_rad += span.control_tilt_rad.z;
        self.gyros_s += up_s;
        self.scales_rad += up.component_mul(&span.angle_rad);
        self.vertical_rad += up * span.turn_rad;
        self.angle_rad += span.angle_rad;
        self.turn_rad += span.turn_rad;
        self
    }
}

/// Fixes over which unresolved coning is averaged: they see vibration at all phases.
const CONING_MEMORY: f64 = 128.0;

/// Next work of the estimators, beside updates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Due {
    Nothing,
    /// A sigma.
    Spread,
    /// The steps that end with a solution.
    Horizon,
    Level,
    AzimuthWalk,
    BiasWalk,
    Solve,
    Compensate,
}

/// The aided INS.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AidedIns<const N: usize> {
    mechanization: Mechanization,
    now: Time,
    /// Since the newest entry of the ring, and from the estimators' horizon to there.
    current: Span,
    vibration: Vibration,
    /// Integral of the velocity since then, ENU, m.
    moved_m: Vector3<f64>,
    before_current: Span,
    history: History<N>,
    latency_search: LatencySearch,
    estimator: Estimator,
    compensation: Compensation,
    controls: Controls,
    /// End of the controls, and of level ones.
    controls_until: Time,
    level_until: Time,
    pending: Ring<GnssFix, PENDING>,
    comparison: Option<Comparison>,
    /// By the barometer, for the next fixes without vertical measurement.
    climb: Option<ClimbDifference>,
    /// Times of the newest fix, of the last position and of the last height.
    newest: Time,
    last_position: Time,
    last_height: Time,
    /// Time of the last measured heading.
    last_heading: Time,
    /// Time of the last vertical measurement, or assumed one.
    last_vertical: Time,
    /// Time of the last correction without aiding.
    last_coast: Time,
    rest: RestDetector,
    vertical_sign: VerticalSign,
    /// Last climb of the sign test by accelerometers.
    last_climb: Option<ClimbSample>,
    last_solve: Time,
    due: Due,
    /// Whether the ring may have reached the time of a queued fix.
    fixes_due: bool,
    since: Time,
    /// Azimuth taken out since the start, rad: for (7) to (11).
    #[cfg(feature = "literal")]
    azimuth_removed_rad: f64,
    /// From the start to the newest entry of the ring.
    azimuth_totals: AzimuthTotals,
    /// The present one.
    pub manoeuvre: Manoeuvre,
    /// Stamp and velocity difference of the last comparison, ENU, m/s.
    last_comparison: (Time, Vector3<f64>),
    /// Coning that sampling may not resolve, mean of many looks, rad/s.
    unresolved_coning_radps: Vector3<f64>,
    /// What disturbs the INS where the estimators have not come, and from when on.
    disturbed: Option<(Time, Disturbance)>,
    /// A gap that the estimators have not passed.
    gap: Option<DataGap>,
    /// The INS has diverged, and must be aligned anew.
    pub diverged: bool,
    /// Its parameters are wrong as well.
    pub parameters_invalid: bool,
}

impl<const N: usize> AidedIns<N> {
    /// Starts from an alignment; the prior of parameters and azimuth comes by [`Self::set_prior`].
    #[expect(
        clippy::inline_always,
        reason = "made where it stays: otherwise 2 kB are copied over the stack"
    )]
    #[inline(always)]
    pub fn new(time: Time, aligned: &Aligned, config: &Config) -> Self {
        Self {
            mechanization: aligned.ins,
            now: time,
            current: Span::default(),
            vibration: Vibration::default(),
            moved_m: Vector3::zeros(),
            before_current: Span::default(),
            history: History::default(),
            latency_search: LatencySearch::EMPTY,
            estimator: Estimator::new(
                time,
                aligned.tilt_sigma_rad,
                [
                    vertical_sign::sign_variance(aligned.ins.velocity_enu_mps.z)
                        + aligned.climb_variance,
                    aligned.position_variance,
                ],
                aligned.level_force_mps2(),
                config,
            ),
            compensation: Compensation::default(),
            controls: Controls::default(),
            controls_until: time,
            level_until: time.plus_seconds(HOLD_S),
            pending: Ring::default(),
            comparison: None,
            climb: None,
            newest: time,
            last_position: time,
            last_height: time,
            last_heading: time.plus_seconds(-HEADING_MEMORY_S),
            last_vertical: time,
            last_coast: time,
            rest: RestDetector::default(),
            vertical_sign: VerticalSign::default(),
            last_climb: None,
            last_solve: time,
            due: Due::Nothing,
            fixes_due: false,
            since: time,
            #[cfg(feature = "literal")]
            azimuth_removed_rad: 0.0,
            azimuth_totals: AzimuthTotals::default(),
            manoeuvre: Manoeuvre::default(),
            last_comparison: (time, Vector3::zeros()),
            unresolved_coning_radps: Vector3::zeros(),
            disturbed: None,
            gap: None,
            diverged: false,
            parameters_invalid: false,
        }
    }

    /// Sets the prior: apart from [`Self::new`], to be written in place and not copied over the stack.
    pub fn set_prior(&mut self, known: &Parameters, source: AttitudeSource, config: &Config) {
        // Gyro biases as aligned; for the rest see [`Self::compensate`].
        if config.feedback == Feedback::Closed {
            self.compensation.gyro_radps = known.vector(index::GYRO);
        }
        if let Some(observer) = self.estimator.exact_mut() {
            observer.set_prior(known, config);
            let body = matrix(&self.mechanization.attitude);
            if source != AttitudeSource::Motion {
                observer.correlate_level(&body);
            }
            if source == AttitudeSource::Gyrocompass {
                let earth_rate = self.mechanization.local_earth().earth_rate();
                observer.correlate_gyrocompass(&body, earth_rate.y);
            }
        }
    }

    /// Sums since the estimators' horizon.
    fn since_horizon(&self) -> Span {
        self.before_current.then(&self.current)
    }

    /// Error of the INS now, as estimated and not yet corrected.
    fn error(&self) -> InsError {
        self.estimator
            .predicted_error(&self.since_horizon(), &self.compensation.accel_mps2)
    }

    /// The exact form of the estimators, if chosen.
    pub fn observer(&self) -> Option<&Observer> {
        self.estimator.exact()
    }

    /// Sigmas of position, velocity and attitude, ENU.
    pub fn sigma(&self, config: &Config) -> Option<SolutionSigma> {
        let since = self.since_horizon();
        let sigma = self.estimator.exact()?.sigma(&since, config);
        Some(self.to_come().fold(sigma, |sigma, by| by.widen(&sigma)))
    }

    /// What disturbs the INS between the estimators' horizon and now.
    fn to_come(&self) -> impl Iterator<Item = &Disturbance> {
        let gap = self.gap.iter().map(|gap| &gap.disturbance);
        gap.chain(self.disturbed.iter().map(|(_, by)| by))
    }

    /// Time of the last level aiding, if the controls have ended.
    pub fn coasting_since(&self) -> Option<Time> {
        (self.now > self.level_until).then(|| self.level_until.plus_seconds(-HOLD_S))
    }

    /// Whether a measured heading was accepted of late: within the detection time of a jump.
    pub fn is_heading_aided(&self) -> bool {
        self.now.seconds_since(self.last_heading) < AZIMUTH_JUMP.least_time_s
    }

    /// A measured interval, compensated.
    pub fn compensated(&self, raw: &Interval) -> Interval {
        let out = &self.compensation;
        raw.without_bias(&out.gyro_radps, &out.accel_mps2)
    }

    pub fn level_force_mps2(&self) -> Vector3<f64> {
        self.estimator.level_force_mps2()
    }

    pub fn mechanization(&self) -> &Mechanization {
        &self.mechanization
    }

    /// Parameters as estimated.
    pub fn known(&self) -> &Parameters {
        self.estimator.parameters()
    }

    /// Last comparison with GNSS, and controls.
    pub fn signals(&self) -> DampingSignals {
        let (time, difference_enu_mps) = self.last_comparison;
        DampingSignals {
            time,
            difference_enu_mps,
            accel_enu_mps2: self.controls.accel_mps2,
            rate_enu_radps: self.controls.rate_radps,
        }
    }

    /// The damped INS, with closed feedback corrected by the estimated error.
    pub fn solution(&self, config: &Config) -> Solution {
        let mut ins = self.mechanization;
        if config.feedback == Feedback::Closed {
            subtract_error(&mut ins, &self.error());
        }
        Solution {
            time: self.now,
            position: ins.position,
            velocity_enu_mps: ins.velocity_enu_mps,
            attitude: ins.attitude,
        }
    }

    /// The parameters as told to others: a swinging arm is measured with the scale of the gyros, and as the
    /// receiver smooths it; what gyros seem to drift may be coning.
    pub fn stated(&self, config: &Config) -> Parameters {
        let mut parameters = *self.known();
        let Some(observer) = self.estimator.exact() else {
            return parameters;
        };
        let scale = config.sensors.gyro_scale;
        let off = scale * scale + config.sensors.cross_axis_variance();
        for (which, skewed) in (index::LEVER_ARM..).zip(observer.skewed_arm.variances()) {
            let (arm_m, sigma) = (parameters.value(which), parameters.sigma(which));
            let grown = math::sqrt(sigma * sigma + off * arm_m * arm_m + f64::from(skewed));
            // But no more than its prior, and never less than its own sigma.
            let most = math::max(sigma, config.gnss.lever_arm_sigma_m);
            parameters.set(which, arm_m, math::min(grown, most));
        }
        for (which, coning) in (index::GYRO..).zip(&self.unresolved_coning_radps) {
            parameters.widen(which, coning * coning);
        }
        parameters
    }

    /// Takes a look at the coning, with a fix: sampling may leave so much of it.
    #[inline(never)]
    pub fn on_coning(&mut self, most_radps: &Vector3<f64>) {
        self.unresolved_coning_radps += (most_radps - self.unresolved_coning_radps) / CONING_MEMORY;
    }

    pub fn estimates(&self, config: &Config) -> Estimates {
        let mut parameters = self.stated(config);
        let azimuth = self.azimuth_error_rad();
        parameters.set(index::AZIMUTH, azimuth, parameters.sigma(index::AZIMUTH));
        let mut estimates = Estimates::from_parameters(&parameters, config, Phase::Navigating);
        if let Some(observer) = self.estimator.exact() {
            let run_s = self.now.seconds_since(self.since);
            let latency = &mut estimates.gnss_latency_s;
            (latency.value, latency.sigma) = observer.latency_before(0.5 * run_s);
            estimates.level_force_mps2 = *observer.level_force_mps2();
            let unseen = observer.unobservable_accel(config);
            for (accel, unseen) in estimates.accel_bias_mps2.iter_mut().zip(&unseen) {
                accel.sigma = math::sqrt(accel.sigma * accel.sigma + unseen);
            }
        }
        estimates
    }

    pub fn azimuth_left_rad(&self) -> f64 {
        self.error().tilt_rad.z
    }

    /// Azimuth error that the INS would have now with its starting heading and gyros compensated from the
    /// start: what is left, less the rotation by controls and compensations, plus the drift by the gyro
    /// errors found.
    fn azimuth_error_rad(&self) -> f64 {
        let parameters = self.known();
        let turned = self.azimuth_totals.plus(&self.current);
        let drift = turned.gyros_s.dot(&parameters.vector(index::GYRO));
        let mount_up = self.estimator.level_force_mps2() / GRAVITY_EQUATOR_MPS2;
        let vertical = &turned.vertical_rad;
        let beyond = turned.scales_rad - mount_up.component_mul(vertical);
        let level_turn_rad = turned.angle_rad - mount_up * turned.turn_rad;
        let scale = parameters.value(index::TURN_SCALE) * mount_up.dot(vertical)
            + parameters.vector(index::GYRO_SCALE).dot(&beyond)
            + (parameters.vector(index::GYRO_MISALIGNMENT)).dot(&level_turn_rad);
        self.azimuth_left_rad() - turned.controls_rad + drift + scale
    }

    /// Inertial samples were missing for `seconds` and interpolated, between readings that differ by rad/s
    /// and m/s^2 in body axes. Of the part in which stamps had gone back, no way is interpolated.
    #[inline(never)]
    pub fn on_gap(&mut self, seconds: f64, set_back_s: f64, ends_differ: &[Vector3<f64>; 2]) {
        let up = up(&self.mechanization.attitude);
        let missed_m = self.mechanization.velocity_enu_mps.norm() * set_back_s;
        let gap = DataGap::after(self.now, seconds, missed_m, ends_differ, &up);
        let before = if seconds > LONG_GAP_S {
            self.gap.replace(gap)
        } else {
            Some(gap)
        };
        if let Some(gap) = before {
            self.disturb(&gap.disturbance);
        }
    }

    /// The next interval has noise beyond that of the sensors: variances of the angle and of the velocity
    /// gained, per body axis.
    pub fn on_noise(&mut self, variances: &[Vector3<f64>; 2]) {
        self.disturb(&Disturbance::by_noise(
            variances,
            &up(&self.mechanization.attitude),
        ));
    }

    /// The covariance grows when the horizon comes to the first of the intervals that disturb: earlier fixes
    /// are not affected.
    fn disturb(&mut self, by: &Disturbance) {
        self.disturbed = Some(match &self.disturbed {
            Some((since, before)) => (*since, before.plus(by)),
            None => (self.now, *by),
        });
    }

    /// Advances over the interval that ends at `time`.
    #[inline(never)]
    pub fn on_interval(&mut self, time: Time, raw: &Interval, config: &Config) {
        if time > self.controls_until {
            self.coast(config);
        }
        self.integrate(time, raw);
    }

    #[inline(never)]
    fn integrate(&mut self, time: Time, raw: &Interval) {
        let interval = self.compensated(raw);
        let step = self.mechanization.step(&interval, &self.controls);
        self.accumulate(time, &interval, &step);
    }

    /// Work after an interval, a step at a time to keep the longest call short: more steps where samples
    /// are rare.
    #[inline(never)]
    pub fn follow_up(&mut self, raw: &Interval, counts: &mut Counts, config: &Config) {
        let mut left_s = raw.seconds;
        // Only GNSS tells rest from steady motion.
        if let Some(RestVerdict::Rest(block)) = self.rest.on_interval(raw)
            && self.now <= self.level_until
        {
            self.zero_rate_update(&block, config);
            left_s -= WORK_STEP_S;
        }
        if self.history.is_due(self.now, raw.seconds) {
            self.make_room(config);
            self.store_present();
            left_s -= WORK_STEP_S;
        }
        while left_s > 0.0 {
            self.work(counts, config);
            left_s -= WORK_STEP_S;
        }
    }

    /// One step of work: of a comparison, else a queued fix, else of the estimators.
    fn work(&mut self, counts: &mut Counts, config: &Config) {
        if self.compare(counts, config) {
            return;
        }
        if self.fixes_due {
            self.fixes_due = self.take_pending(true, counts, config);
            if self.fixes_due {
                return;
            }
        }
        if self.due == Due::Nothing {
            self.search_latency(config);
            return;
        }
        let next = match self.due {
            Due::Nothing | Due::Spread | Due::Compensate => Due::Nothing,
            Due::Horizon => Due::Level,
            Due::Level => Due::AzimuthWalk,
            Due::AzimuthWalk => Due::BiasWalk,
            Due::BiasWalk => Due::Solve,
            Due::Solve => Due::Compensate,
        };
        let heading_aided = self.is_heading_aided();
        match (self.due, self.estimator.exact_mut()) {
            (Due::Solve, _) => self.solve(),
            (Due::Compensate, _) => self.compensate(config),
            (_, None) | (Due::Nothing, _) => {}
            (Due::Spread, Some(observer)) => observer.update_next_sigma(config),
            (Due::Horizon, Some(observer)) => observer.refer_to_horizon(),
            (Due::Level, Some(observer)) => observer.update_mount_level(),
            (Due::AzimuthWalk, Some(observer)) => observer.add_azimuth_walk(heading_aided, config),
            (Due::BiasWalk, Some(observer)) => observer.add_bias_walk(config),
        }
        self.due = next;
    }

    fn search_latency(&mut self, config: &Config) {
        if self.latency_search.is_busy()
            && let Some(observer) = self.estimator.exact_mut()
        {
            let believed_s = observer.parameters().value(index::LATENCY);
            if let Some(found) = self.latency_search.work(&self.history, believed_s) {
                observer.relocate(found.latency_s, &found.arm_m, config);
                self.latency_search.restart();
            }
        }
    }

    /// The estimators must use what the ring is about to drop.
    fn make_room(&mut self, config: &Config) {
        if let Some(dropped) = self.history.next_dropped()
            && dropped > self.estimator.horizon()
        {
            self.advance(dropped, config);
        }
    }

    /// Appends the present to the ring.
    #[inline(never)]
    fn store_present(&mut self) {
        self.before_current.extend(&self.current);
        self.history.push(
            self.now,
            &(self.moved_m / self.current.seconds),
            &self.current,
            &self.vibration,
        );
        self.azimuth_totals = self.azimuth_totals.plus(&self.current);
        self.moved_m = Vector3::zeros();
        self.current = Span::default();
        self.vibration = Vibration::default();
        self.fixes_due = true;
        if let Some(comparison) = &mut self.comparison {
            comparison.close(self.now);
        }
        if self.due == Due::Nothing {
            self.due = Due::Spread;
        }
        if self.now.seconds_since(self.last_solve) >= SOLVE_S {
            self.last_solve = self.now;
            self.due = Due::Horizon;
        }
    }

    /// Propagates the estimators to an entry of the ring, or a step toward it.
    #[inline(never)]
    fn advance(&mut self, to: Time, config: &Config) {
        let frame_rate = self.frame_rate();
        self.estimator.advance(
            &self.history,
            to,
            &frame_rate,
            &self.compensation.accel_mps2,
            config,
        );
        let horizon = self.estimator.horizon();
        let passed = self.gap.take_if(|gap| gap.end <= horizon);
        let passed = passed.map(|gap| gap.disturbance);
        let reached = self.disturbed.take_if(|(since, _)| *since <= horizon);
        let reached = reached.map(|(_, by)| by);
        if let Some(observer) = self.estimator.exact_mut() {
            for by in passed.iter().chain(&reached) {
                observer.on_disturbance(by);
            }
        }
        self.update_since_horizon(horizon);
    }

    #[inline(never)]
    fn update_since_horizon(&mut self, horizon: Time) {
        let since = self.history.next_span(horizon, self.now, f64::MAX);
        self.before_current = since.map_or_else(Span::default, |(since, _)| since);
    }

    /// Without aiding there are no controls: the estimated error is corrected again and again instead, for
    /// the position to follow the estimate.
    fn coast(&mut self, config: &Config) {
        self.controls = Controls::default();
        if config.feedback == Feedback::Open || self.now.seconds_since(self.last_coast) < COAST_S {
            return;
        }
        self.correct_ins();
    }

    /// Corrects the INS by its estimated error.
    #[inline(never)]
    fn correct_ins(&mut self) {
        self.last_coast = self.now;
        if self.estimator.exact().is_none() {
            return;
        }
        let error = self.error();
        subtract_error(&mut self.mechanization, &error);
        let current = &mut self.current;
        current.control_position_m -= error.position_m;
        current.control_velocity_mps -= error.velocity_mps;
        // Levelling and turning, as one rotation.
        let up = Vector3::new(0.0, 0.0, error.tilt_rad.z);
        current.control_tilt_rad -= error.tilt_rad - 0.5 * error.tilt_rad.cross(&up);
        current.way_m -= error.position_m;
        #[cfg(feature = "literal")]
        {
            self.azimuth_removed_rad += error.tilt_rad.z;
        }
    }

    fn frame_rate(&self) -> Vector3<f64> {
        let earth = self.mechanization.local_earth();
        earth.earth_rate() + earth.transport_rate(&self.mechanization.velocity_enu_mps)
    }

    /// Adds a mechanization step to the sums since the newest entry of the ring.
    #[inline(never)]
    fn accumulate(&mut self, time: Time, interval: &Interval, step: &Step) {
        let (dt, controls) = (interval.seconds, &self.controls);
        let tilt = dt * (controls.rate_radps + step.attitude * self.compensation.gyro_radps);
        let push = dt * (controls.accel_mps2 - step.attitude * self.compensation.accel_mps2);
        let force = &step.force_enu_mps;
        let turn_rad = step.attitude.row(2).tr_dot(&interval.angle_rad);
        let bent = force.cross(&tilt);
        let one = Span {
            seconds: dt,
            force_mps: *force,
            force_position_m: 0.5 * dt * force,
            attitude_s: step.attitude * dt,
            angle_rad: interval.angle_rad,
            turn_rad,
            control_tilt_rad: tilt,
            control_velocity_mps: push + 0.5 * bent,
            control_position_m: dt * (controls.velocity_mps + 0.5 * push + bent / 6.0),
            way_m: step.way_m,
        };
        self.current.extend(&one);
        self.vibration.add(force, &interval.angle_rad, dt);
        // The position loop moves it without a velocity.
        self.moved_m += step.way_m - dt * controls.velocity_mps;
        self.now = time;
        #[cfg(feature = "literal")]
        {
            self.azimuth_removed_rad -= dt * self.controls.rate_radps.z;
        }
    }

    /// Zero-rate update: at rest gyros read Earth rate and their biases.
    #[inline(never)]
    fn zero_rate_update(&mut self, block: &RestBlock, config: &Config) {
        // Without GNSS velocity by the INS.
        if self.is_moving() {
            return;
        }
        let Some(observer) = self.estimator.exact_mut() else {
            return;
        };
        let earth_rate = self.mechanization.local_earth().earth_rate();
        let attitude = matrix(&self.mechanization.attitude);
        let bias = block.rate_radps - attitude.tr_mul(&earth_rate);
        let noise = rest::gyro_variance(&config.sensors, block.seconds);
        let mut variance = Vector3::repeat(noise);
        if self.now.seconds_since(self.last_heading) < HEADING_MEMORY_S {
            let up = attitude.row(2).transpose();
            variance += up.component_mul(&up) * (UNSEEN_RADPS * UNSEEN_RADPS);
        }
        // Earth rate turned by an azimuth error.
        let known = observer.parameters();
        let turned = attitude.row(0).transpose() * (earth_rate.y * known.sigma(index::AZIMUTH));
        variance += turned.component_mul(&turned);
        // Quiet sensors may also be in a slow turn: of a vehicle that is pushed, or afloat.
        let agrees = |(axis, (bias, variance)): (usize, (&f64, &f64))| {
            known.agrees(index::GYRO + axis, *bias, *variance)
        };
        if !bias.iter().zip(&variance).enumerate().all(agrees) {
            return;
        }
        observer.update_directly(index::GYRO, &bias, &variance);
    }

    /// Whether the INS moves.
    pub fn is_moving(&self) -> bool {
        let level_mps = self.mechanization.velocity_enu_mps.xy();
        level_mps.norm_squared() > MOVING_MPS * MOVING_MPS
    }

    #[inline(never)]
    pub fn on_heading(&mut self, measured: &Heading) -> GnssOutcome {
        let ago_s = self.now.seconds_since(measured.time);
        if self.gap.is_some_and(|gap| gap.holds(measured.time)) {
            return GnssOutcome::NoInertialData;
        }
        let (own_rad, turned_rad) = match self.history.at(measured.time, false) {
            Ok(past) => (
                math::atan2(past.attitude.m12, past.attitude.m22),
                self.turned_since(measured.time),
            ),
            // Within a spacing of the newest entry the rate is taken for constant.
            Err(Missing::Future) if math::abs(ago_s) <= SPACING_S => {
                let turn_radps = self.current.turn_rad / math::max(self.current.seconds, 1e-9);
                (self.mechanization.heading_rad() + turn_radps * ago_s, 0.0)
            }
            Err(Missing::Future) if ago_s < 0.0 => return GnssOutcome::TooFarAhead,
            Err(_) => return GnssOutcome::TooOld,
        };
        // A platform turned by `Phi_UP` sees north further to the left by as much.
        let azimuth = wrap_pi(own_rad - measured.heading_rad);
        let believed = self.azimuth_left_rad() - turned_rad;
        let taken = self.estimator.exact_mut().is_some_and(|observer| {
            observer.update_azimuth(azimuth - believed, measured.sigma_rad)
        });
        if taken {
            self.last_heading = self.now;
            GnssOutcome::Accepted
        } else {
            GnssOutcome::Outlier
        }
    }

    /// Rotation of the platform by the loops since a time in the ring, rad.
    fn turned_since(&self, time: Time) -> f64 {
        let span = self.history.next_span(time, self.now, f64::INFINITY);
        let since = span
            .map_or(Span::default(), |(span, _)| span)
            .then(&self.current);
        let compensated = since.attitude_s * self.compensation.gyro_radps;
        since.control_tilt_rad.z - compensated.z
    }

    /// Solves for the parameters. Its temporaries must not lie on the stack of every sample.
    #[inline(never)]
    fn solve(&mut self) {
        match &mut self.estimator {
            Estimator::Exact(observer) => observer.solve(),
            #[cfg(feature = "literal")]
            Estimator::Literal(literal) => literal.solve(),
        }
    }

    /// Compensates the sensors by what has become known, if credible.
    #[inline(never)]
    pub fn compensate(&mut self, config: &Config) {
        if let Some(observer) = self.estimator.exact()
            && !observer.is_credible(config)
        {
            self.diverged = true;
            self.parameters_invalid = true;
        }
        self.compensation
            .update(self.estimator.parameters(), config);
    }
}

/// Corrects an INS by an error: the platform is levelled, then turned.
fn subtract_error(ins: &mut Mechanization, error: &InsError) {
    ins.velocity_enu_mps -= error.velocity_mps;
    let up = Vector3::new(0.0, 0.0, error.tilt_rad.z);
    ins.turn_platform(&(up - error.tilt_rad));
    ins.turn_platform(&-up);
    let earth = ins.local_earth();
    ins.move_by(&earth, &-error.position_m);
}

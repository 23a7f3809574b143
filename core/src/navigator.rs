//! The whole navigator: samples and fixes in, solution and estimates out.
//!
//! Data flows one way: sample, increments, mechanization under the damping controls, ring of past
//! moments; fix, comparison with its own moment, damping controls, estimators, compensation.

use heapless::Deque;
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};

use crate::alignment::heading_from_motion::{Fit, MotionSums};
use crate::alignment::levelling::{self, RestMean};
use crate::alignment::rest::{RestBlock, RestDetector, Verdict as RestVerdict};
use crate::attitude::matrix;
use crate::config::{Config, Feedback, Form, HeadingSource};
use crate::damping::{self, Differences};
use crate::earth::{Geodetic, LocalEarth};
use crate::estimate::Estimates;
use crate::estimators::literal::{Comparison, Literal};
use crate::estimators::observer::{Difference, Observer, Verdict};
use crate::estimators::parameters::{Parameters, index};
use crate::history::{History, Missing, Moment, Past};
use crate::increments::{Increments, Interval};
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::mechanization::{Controls, Mechanization};
use crate::outcome::{GnssOutcome, ImuOutcome};
use crate::samples::{GnssFix, ImuOutput, ImuSample};
use crate::solution::{Phase, Solution};
use crate::time::Time;

/// Fixes that may wait for their moment.
const PENDING: usize = 4;
/// Furthest a fix may lie ahead of the inertial samples, s.
const AHEAD_S: f64 = 1.0;
/// Longest time that controls are held without a new fix, s.
const HOLD_S: f64 = 1.5;
/// Interval at which the normal equations are solved, s.
const SOLVE_S: f64 = 1.0;
/// Speed above which GNSS says that the vehicle moves, m/s, before sigmas of its noise.
const MOTION_MPS: f64 = 0.2;
/// Rest wanted for levelling, and for gyrocompassing, s.
const LEVEL_S: f64 = 8.0;
const GYROCOMPASS_S: f64 = 60.0;
/// Longest wait for rest, s; shorter when GNSS shows motion.
const WAIT_S: f64 = 20.0;
const WAIT_MOVING_S: f64 = 3.0;
/// Largest spread of a heading that is good enough to navigate on, rad.
const HEADING_SIGMA_RAD: f64 = 0.3;
/// Largest spread of an azimuth error that is taken out, rad.
const AZIMUTH_KNOWN_RAD: f64 = 0.035;
/// Longest window for the heading from motion, s.
const WINDOW_S: f64 = 40.0;
/// Rate of a vehicle standing with people in it, rad/s in the mean of a second.
const SWAY_RADPS: f64 = 3e-4;
/// Fixes refused in a row after which the INS, not GNSS, is taken to be wrong.
const LOST_FIXES: u8 = 10;

/// Range over which the equations are linear enough: azimuth, rad, and latency, s.
const AZIMUTH_LINEAR_RAD: f64 = 0.02;
const LATENCY_LINEAR_S: f64 = 0.02;

/// What the last accepted fix did to the INS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DampingSignals {
    /// Stamp of the fix.
    pub time: Time,
    /// Velocity of the INS minus that of the fix, ENU, m/s.
    pub difference_enu_mps: Vector3<f64>,
    /// f^C: correction into the velocity block, ENU, m/s^2.
    pub accel_enu_mps2: Vector3<f64>,
    /// omega^C: correction into the attitude block, ENU, rad/s.
    pub rate_enu_radps: Vector3<f64>,
}

/// The configuration cannot be used; the message says which value and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigError(pub &'static str);

/// Errors taken out of readings and stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Compensation {
    gyro_radps: Vector3<f64>,
    accel_mps2: Vector3<f64>,
    latency_s: f64,
}

/// Everything about finding the first attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Alignment {
    rest: RestMean,
    /// Mean of the last seconds, at rest or not, for a start in motion.
    coarse_force_mps2: Vector3<f64>,
    motion: MotionSums,
    window_start: Time,
}

/// The state: all that changes. Clone it to take a snapshot.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct State {
    phase: Phase,
    /// Last inertial stamp and the reading there; none before the first sample.
    increments: Option<(Time, Increments)>,
    start: Time,
    /// Stamp of a sample after too long a hole, waiting for a second to confirm it.
    after_gap: Option<Time>,
    mechanization: Mechanization,
    now: Moment,
    history: History,
    observer: Observer,
    literal: Literal,
    controls: Controls,
    controls_until: Time,
    compensation: Compensation,
    pending: Deque<GnssFix, PENDING>,
    last_fix: Option<GnssFix>,
    last_used: Time,
    refused: u8,
    rest: RestDetector,
    alignment: Alignment,
    last_solve: Time,
    navigating_since: Time,
    /// Azimuth taken out since the start, rad.
    azimuth_removed_rad: f64,
    azimuth_settled: bool,
    /// By how much data, not drift, have moved the latency since the equations were linearized.
    latency_corrected_s: f64,
    manoeuvre: Manoeuvre,
    signals: DampingSignals,
}

/// Strapdown INS damped by GNSS velocity, with running estimators of its sensors' errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Navigator {
    config: Config,
    state: State,
}

impl Navigator {
    /// A navigator that knows nothing yet.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.check().map_err(ConfigError)?;
        let start = Moment::start(Time::default(), Vector3::zeros());
        let state = State {
            phase: Phase::Levelling,
            increments: None,
            start: Time::default(),
            after_gap: None,
            mechanization: Mechanization::new(
                Geodetic::default(),
                Vector3::zeros(),
                UnitQuaternion::identity(),
            ),
            now: start,
            history: History::default(),
            observer: Observer::new(start, &config, &config.prior(), 0.0),
            literal: Literal::new(config.sensors.accel_bias_mps2),
            controls: Controls::default(),
            controls_until: Time::default(),
            compensation: Compensation::default(),
            pending: Deque::new(),
            last_fix: None,
            last_used: Time::default(),
            refused: 0,
            rest: RestDetector::default(),
            alignment: Alignment::default(),
            last_solve: Time::default(),
            navigating_since: Time::default(),
            azimuth_removed_rad: 0.0,
            azimuth_settled: false,
            latency_corrected_s: 0.0,
            manoeuvre: Manoeuvre::default(),
            signals: DampingSignals::default(),
        };
        Ok(Self { config, state })
    }

    /// Takes one inertial sample, in order of time.
    pub fn on_imu(&mut self, sample: &ImuSample) -> ImuOutcome {
        self.state.on_imu(sample, &self.config)
    }

    /// Takes one GNSS fix, in order of time.
    pub fn on_gnss(&mut self, fix: &GnssFix) -> GnssOutcome {
        self.state.on_gnss(fix, &self.config)
    }

    /// The configuration it runs with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// How far the alignment has come.
    pub fn phase(&self) -> Phase {
        self.state.phase
    }

    /// Position, velocity and attitude at the last inertial sample, once navigating.
    ///
    /// With closed feedback the errors that the estimators still see in the damped INS are taken
    /// out here; with open feedback it is the damped INS itself.
    pub fn solution(&self) -> Option<Solution> {
        let s = &self.state;
        (s.phase == Phase::Navigating).then(|| {
            let mut ins = s.mechanization;
            if self.config.feedback == Feedback::Closed && self.config.form == Form::Exact {
                let error = s.observer.error_at(&s.now);
                ins.velocity_enu_mps -= error.velocity_mps;
                ins.turn_platform(&-error.tilt_rad);
            }
            Solution {
                time: s.now.time,
                position: ins.position,
                velocity_enu_mps: ins.velocity_enu_mps,
                attitude: ins.attitude,
            }
        })
    }

    /// The damped INS as it stands, before the errors still in it are taken out; its azimuth is
    /// off by [`Self::azimuth_left_rad`].
    pub fn mechanization(&self) -> &Mechanization {
        &self.state.mechanization
    }

    /// Errors of the sensors as known now.
    pub fn estimates(&self) -> Estimates {
        self.state.estimates(&self.config)
    }

    /// Azimuth error that is still in the damped INS, rad.
    pub fn azimuth_left_rad(&self) -> f64 {
        self.state.azimuth_left_rad(&self.config)
    }

    /// The manoeuvre going on.
    pub fn manoeuvre(&self) -> Manoeuvre {
        self.state.manoeuvre
    }

    /// The damping signals of the last fix.
    pub fn damping_signals(&self) -> DampingSignals {
        self.state.signals
    }
}

impl State {
    /// What the chosen form has found; azimuth and latency are those of the last fix.
    fn parameters(&self, config: &Config) -> Parameters {
        match config.form {
            Form::Exact => self.observer.parameters,
            Form::Literal => self
                .literal
                .parameters(&config.prior(), self.azimuth_removed_rad),
        }
    }

    fn azimuth_left_rad(&self, config: &Config) -> f64 {
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

    fn estimates(&self, config: &Config) -> Estimates {
        let mut parameters = self.parameters(config);
        let azimuth = self.azimuth_error_rad(config);
        parameters.set(index::AZIMUTH, azimuth, parameters.sigma(index::AZIMUTH));
        let mut estimates = Estimates::from_parameters(&parameters, config, self.phase);
        let run_s = self.now.time.seconds_since(self.navigating_since);
        let latency = self.observer.latency_before(0.5 * run_s);
        if let (Some((value, sigma)), Form::Exact) = (latency, config.form) {
            estimates.gnss_latency_s.value = value;
            estimates.gnss_latency_s.sigma = sigma;
        }
        estimates
    }

    fn on_imu(&mut self, sample: &ImuSample, config: &Config) -> ImuOutcome {
        if !(math::all_finite(&sample.gyro) && math::all_finite(&sample.accel)) {
            return ImuOutcome::NotFinite;
        }
        let Some((last, mut increments)) = self.increments else {
            if out_of_range(sample, 1.0, config) {
                return ImuOutcome::OutOfRange;
            }
            self.increments = Some((sample.time, Increments::new(config.imu_output, sample)));
            self.start = sample.time;
            return ImuOutcome::Accepted;
        };
        let seconds = sample.time.seconds_since(last);
        if seconds <= 0.0 {
            return ImuOutcome::TimeNotIncreasing;
        }
        if out_of_range(sample, seconds, config) {
            return ImuOutcome::OutOfRange;
        }
        if seconds > config.max_gap_s {
            return self.on_gap(sample, increments, config);
        }
        let bridged = increments.has_hole(seconds);
        let interval = increments.interval(sample, seconds);
        self.increments = Some((sample.time, increments));
        self.after_gap = None;
        if bridged {
            self.observer.on_hole(seconds);
        }
        self.advance(sample.time, &interval, config);
        if bridged {
            ImuOutcome::Bridged
        } else {
            ImuOutcome::Accepted
        }
    }

    /// A hole too long to bridge: one stray stamp must not stop the clock, two in step restart.
    fn on_gap(
        &mut self,
        sample: &ImuSample,
        mut increments: Increments,
        config: &Config,
    ) -> ImuOutcome {
        let confirmed = self.after_gap.is_some_and(|first| {
            let seconds = sample.time.seconds_since(first);
            seconds > 0.0 && seconds <= config.max_gap_s
        });
        if !confirmed {
            self.after_gap = Some(sample.time);
            return ImuOutcome::Gap;
        }
        self.after_gap = None;
        increments.restart(sample);
        self.increments = Some((sample.time, increments));
        self.restart_after_gap(sample.time);
        ImuOutcome::Gap
    }

    /// Roll and pitch are kept as a start, heading has to be found again; what was learnt of the
    /// sensors stays.
    fn restart_after_gap(&mut self, time: Time) {
        self.start = time;
        self.history.clear();
        self.pending.clear();
        self.controls = Controls::default();
        self.rest = RestDetector::default();
        if self.phase != Phase::Levelling {
            self.find_heading(time);
        }
    }

    fn advance(&mut self, time: Time, interval: &Interval, config: &Config) {
        let verdict = self.rest.on_interval(interval);
        match self.phase {
            Phase::Levelling => self.level(time, interval, verdict, config),
            Phase::FindingHeading => {
                let compensated = self.compensated(interval);
                self.mechanization.step(&compensated, &Controls::default());
                self.now.time = time;
                self.rest_while_finding(verdict, config);
            }
            Phase::Navigating => self.navigate(time, interval, verdict, config),
        }
    }

    fn compensated(&self, interval: &Interval) -> Interval {
        interval.without_bias(&self.compensation.gyro_radps, &self.compensation.accel_mps2)
    }

    // --- alignment ---

    fn level(
        &mut self,
        time: Time,
        interval: &Interval,
        verdict: Option<RestVerdict>,
        config: &Config,
    ) {
        let part = math::min(interval.seconds / 2.0, 1.0);
        let force = interval.force_mps / interval.seconds;
        let alignment = &mut self.alignment;
        if alignment.coarse_force_mps2 == Vector3::zeros() {
            alignment.coarse_force_mps2 = force;
        }
        alignment.coarse_force_mps2 += part * (force - alignment.coarse_force_mps2);
        self.now.time = time;
        let Some(verdict) = verdict else { return };
        if let RestVerdict::Rest(block) = verdict {
            self.alignment.rest.add(&block);
        }
        let Some((position, fix)) = self.last_position() else {
            return;
        };
        let rest_s = self.alignment.rest.seconds;
        let moving = verdict == RestVerdict::Motion;
        let wanted = if gyrocompass_possible(config, &position) {
            GYROCOMPASS_S
        } else {
            LEVEL_S
        };
        let waited = time.seconds_since(self.start);
        if rest_s >= wanted || (moving && rest_s >= 2.0) {
            self.level_from_rest(time, &position, config);
        } else if waited > WAIT_S || (waited > WAIT_MOVING_S && moving && speed(&fix) > 1.0) {
            let attitude = levelling::level(&self.alignment.coarse_force_mps2, 0.0);
            self.start_from_level(time, &position, attitude, None, config);
        }
    }

    fn last_position(&self) -> Option<(Geodetic, GnssFix)> {
        let fix = self.last_fix?;
        Some((fix.position?, fix))
    }

    fn level_from_rest(&mut self, time: Time, position: &Geodetic, config: &Config) {
        let rest = self.alignment.rest;
        let attitude = levelling::level(&rest.force_mps2, 0.0);
        let earth = LocalEarth::at(position.latitude_rad, position.height_m);
        self.learn_gyro_rest(&rest, &matrix(&attitude), &earth, config);
        let sigma = levelling::gyrocompass_sigma(&config.sensors, &earth, rest.seconds);
        let heading =
            (config.heading == HeadingSource::Auto && sigma < HEADING_SIGMA_RAD).then(|| {
                (
                    levelling::gyrocompass(&matrix(&attitude), &rest.rate_radps),
                    sigma,
                )
            });
        self.start_from_level(time, position, attitude, heading, config);
    }

    /// What gyros read at rest beyond the Earth rate is bias; the level Earth rate is unknown
    /// until heading is.
    fn learn_gyro_rest(
        &mut self,
        rest: &RestMean,
        attitude: &Matrix3<f64>,
        earth: &LocalEarth,
        config: &Config,
    ) {
        let up = attitude.tr_mul(&Vector3::new(0.0, 0.0, earth.earth_rate().z));
        let bias = rest.rate_radps - up;
        let level = earth.earth_rate().y;
        let noise = config.sensors.gyro_noise * config.sensors.gyro_noise;
        let variance = (noise + SWAY_RADPS * SWAY_RADPS) / rest.seconds + level * level;
        for axis in 0..3 {
            self.observer
                .measure(index::GYRO + axis, component(&bias, axis), variance);
        }
        self.observer.solve();
        if config.feedback == Feedback::Closed {
            self.compensation.gyro_radps = self.observer.parameters.vector(index::GYRO);
        }
    }

    fn start_from_level(
        &mut self,
        time: Time,
        position: &Geodetic,
        level: UnitQuaternion<f64>,
        compass: Option<(f64, f64)>,
        config: &Config,
    ) {
        let heading = match config.heading {
            HeadingSource::Given(heading) => Some((heading, HEADING_SIGMA_RAD)),
            _ => compass,
        };
        self.mechanization = Mechanization::new(*position, Vector3::zeros(), level);
        let Some((heading, sigma)) = heading else {
            self.find_heading(time);
            return;
        };
        self.mechanization.turn_heading(heading);
        self.start_navigating(time, sigma, config);
    }

    fn find_heading(&mut self, time: Time) {
        self.phase = Phase::FindingHeading;
        self.alignment.motion = MotionSums::default();
        self.alignment.window_start = time;
        self.mechanization.velocity_enu_mps = Vector3::zeros();
    }

    /// At rest the tilt of the wandering INS is taken out again and again.
    fn rest_while_finding(&mut self, verdict: Option<RestVerdict>, config: &Config) {
        let Some(RestVerdict::Rest(block)) = verdict else {
            return;
        };
        let earth = self.mechanization.local_earth();
        let mut rest = RestMean::default();
        rest.add(&block);
        self.learn_gyro_rest(&rest, &matrix(&self.mechanization.attitude), &earth, config);
        let force = block.force_mps2 - self.compensation.accel_mps2;
        self.mechanization.attitude = levelling::level(&force, self.mechanization.heading_rad());
        self.find_heading(self.now.time);
    }

    fn find_heading_with(&mut self, fix: &GnssFix, config: &Config) {
        let (Some(velocity), Some(position)) = (fix.velocity_en_mps, fix.position) else {
            return;
        };
        let seconds = self.now.time.seconds_since(self.alignment.window_start);
        let ins = self.mechanization.velocity_enu_mps.xy();
        self.alignment.motion.add(seconds, &ins, &velocity);
        if let Some(fit) = self.alignment.motion.fit() {
            self.mechanization.position = position;
            self.take_heading(&fit, config);
        } else if seconds > WINDOW_S {
            let slope = self.alignment.motion.ins_slope();
            let steady = self.alignment.motion.gnss_spread() < MOTION_MPS;
            if let (Some(slope), true) = (slope, steady) {
                self.mechanization
                    .turn_platform(&-tilt_of_slope(&slope, config));
            }
            self.find_heading(self.now.time);
        }
    }

    fn take_heading(&mut self, fit: &Fit, config: &Config) {
        self.mechanization.turn_heading(-fit.rotation_rad);
        self.mechanization
            .turn_platform(&-tilt_of_slope(&fit.slope_mps2, config));
        self.start_navigating(self.now.time, 3.0 * fit.sigma_rad + 0.05, config);
    }

    fn start_navigating(&mut self, time: Time, heading_sigma_rad: f64, config: &Config) {
        if let Some(fix) = self.last_fix {
            self.mechanization.velocity_enu_mps = velocity_enu(&fix);
            if let Some(position) = fix.position {
                self.mechanization = Mechanization::new(
                    position,
                    self.mechanization.velocity_enu_mps,
                    self.mechanization.attitude,
                );
            }
        }
        self.phase = Phase::Navigating;
        self.now = Moment::start(time, self.mechanization.velocity_enu_mps);
        self.history.clear();
        self.history.push(self.now);
        self.observer.restart(self.now, config.start_tilt_sigma());
        self.observer.set_azimuth(0.0, heading_sigma_rad);
        self.azimuth_removed_rad = 0.0;
        self.azimuth_settled = false;
        self.last_used = time;
        self.last_solve = time;
        self.navigating_since = time;
        self.refused = 0;
    }

    // --- navigation ---

    fn navigate(
        &mut self,
        time: Time,
        raw: &Interval,
        verdict: Option<RestVerdict>,
        config: &Config,
    ) {
        if time > self.controls_until {
            self.controls = Controls::default();
        }
        let interval = self.compensated(raw);
        let step = self.mechanization.step(&interval, &self.controls);
        let dt = interval.seconds;
        let now = &mut self.now;
        now.time = time;
        now.velocity_mps = self.mechanization.velocity_enu_mps;
        now.force_mps += step.force_enu_mps;
        now.attitude_s += step.attitude * dt;
        now.turn_rad += interval.angle_rad.z;
        let tilt = dt * (self.controls.rate_radps + step.attitude * self.compensation.gyro_radps);
        now.control_velocity_mps += step
            .force_enu_mps
            .cross(&(now.control_tilt_rad + 0.5 * tilt))
            + dt * (self.controls.accel_mps2 - step.attitude * self.compensation.accel_mps2);
        now.control_tilt_rad += tilt;
        self.azimuth_removed_rad -= dt * self.controls.rate_radps.z;
        if let Some(RestVerdict::Rest(block)) = verdict {
            self.measure_rest(&block, config);
        }
        if self.history.wants(time) {
            self.history.push(self.now);
            self.process_pending(config);
        }
    }

    /// A vehicle at rest turns with the Earth: its gyros read their biases.
    fn measure_rest(&mut self, block: &RestBlock, config: &Config) {
        let earth = self.mechanization.local_earth();
        let attitude = matrix(&self.mechanization.attitude);
        let bias = block.rate_radps - attitude.tr_mul(&earth.earth_rate());
        let noise = config.sensors.gyro_noise * config.sensors.gyro_noise;
        let variance = (noise + SWAY_RADPS * SWAY_RADPS) / block.seconds;
        for axis in 0..3 {
            self.observer
                .measure(index::GYRO + axis, component(&bias, axis), variance);
        }
    }

    fn on_gnss(&mut self, fix: &GnssFix, config: &Config) -> GnssOutcome {
        if let Err(outcome) = check_fix(fix) {
            return outcome;
        }
        let Some((now, _)) = self.increments else {
            return GnssOutcome::NoInertialData;
        };
        if self.last_fix.is_some_and(|last| fix.time <= last.time) {
            return GnssOutcome::TimeNotIncreasing;
        }
        if fix.time.seconds_since(now) > AHEAD_S {
            return GnssOutcome::TooFarAhead;
        }
        if now.seconds_since(fix.time) > AHEAD_S {
            return GnssOutcome::TooOld;
        }
        if self.phase == Phase::Navigating {
            return self.navigate_with(fix, config);
        }
        self.last_fix = Some(*fix);
        if is_moving(fix, config) {
            self.rest.on_motion();
        }
        if self.phase == Phase::FindingHeading {
            self.find_heading_with(fix, config);
        }
        GnssOutcome::Accepted
    }

    fn navigate_with(&mut self, fix: &GnssFix, config: &Config) -> GnssOutcome {
        let outcome = if self.pending.is_empty() {
            self.process(fix, config)
        } else {
            None
        };
        let outcome = match outcome {
            Some(outcome) => outcome,
            None if self.pending.push_back(*fix).is_ok() => GnssOutcome::Queued,
            None => GnssOutcome::TooFarAhead,
        };
        if matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued) {
            self.last_fix = Some(*fix);
            if is_moving(fix, config) {
                self.rest.on_motion();
            }
        }
        outcome
    }

    fn process_pending(&mut self, config: &Config) {
        while let Some(fix) = self.pending.front().copied() {
            if self.process(&fix, config).is_none() {
                return;
            }
            self.pending.pop_front();
        }
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
        let interval_s = moment.seconds_since(self.last_used);
        if interval_s < 0.01 {
            return Some(GnssOutcome::TimeNotIncreasing);
        }
        let antenna = self.antenna_velocity(&past);
        let mut differences = Differences {
            position_m: fix.position.map(|p| self.position_difference(&past, &p)),
            ..Differences::default()
        };
        let velocity_mps = past.moment.velocity_mps - velocity_enu(fix);
        if fix.velocity_en_mps.is_some() {
            let difference = Difference {
                velocity_mps,
                has_up: fix.velocity_up_mps.is_some(),
                latency_applied_s: self.compensation.latency_s,
            };
            let earth = self.mechanization.local_earth();
            let frame_rate = earth.earth_rate() + earth.transport_rate(&past.moment.velocity_mps);
            if self.observer.take(&past, &frame_rate, &difference, config) == Verdict::Outlier {
                return Some(self.refuse(fix, config));
            }
            self.refused = 0;
            let m = velocity_mps + antenna;
            differences.velocity_en_mps = Some(m.xy());
            differences.velocity_up_mps = fix.velocity_up_mps.map(|_| m.z);
            self.manoeuvre = Manoeuvre::of(&past);
            if config.form == Form::Literal {
                self.literal.take(&Comparison {
                    past: &past,
                    manoeuvre: self.manoeuvre,
                    difference_mps: m.xy(),
                    accel_up_mps2: self.controls.accel_mps2.z,
                    azimuth_removed_rad: self.azimuth_removed_rad,
                    latency_applied_s: self.compensation.latency_s,
                    accel_compensation_mps2: self.compensation.accel_mps2,
                    bandwidth_radps: config.damping.horizontal.bandwidth_radps,
                });
            }
        }
        self.damp(fix, &differences, interval_s, config);
        self.last_used = moment;
        Some(GnssOutcome::Accepted)
    }

    /// What the antenna moves faster than the sensors, m/s, as far as the lever arm is known.
    fn antenna_velocity(&self, past: &Past) -> Vector3<f64> {
        past.attitude_rate.fixed_columns::<2>(0) * self.observer.parameters.lever_arm()
    }

    /// INS minus GNSS, m.
    fn position_difference(&self, past: &Past, gnss: &Geodetic) -> Vector3<f64> {
        let since_s = self.now.time.seconds_since(past.moment.time);
        let moved = 0.5 * since_s * (past.moment.velocity_mps + self.now.velocity_mps);
        self.mechanization.position.enu_from(gnss) - moved
    }

    fn damp(&mut self, fix: &GnssFix, differences: &Differences, interval_s: f64, config: &Config) {
        let mut differences = *differences;
        let parameters = self.parameters(config);
        let (azimuth, sigma) = (
            parameters.value(index::AZIMUTH),
            parameters.sigma(index::AZIMUTH),
        );
        let significant = sigma < AZIMUTH_KNOWN_RAD || math::abs(azimuth) > 3.0 * sigma;
        if config.feedback == Feedback::Closed && significant {
            differences.azimuth_rad = Some(azimuth);
        }
        let interval_s = math::min(interval_s, HOLD_S);
        self.controls = damping::controls(&differences, interval_s, &config.damping);
        self.controls_until = self.now.time.plus_seconds(HOLD_S);
        let dv = differences.velocity_en_mps.unwrap_or_default();
        self.signals = DampingSignals {
            time: fix.time,
            difference_enu_mps: Vector3::new(
                dv.x,
                dv.y,
                differences.velocity_up_mps.unwrap_or_default(),
            ),
            accel_enu_mps2: self.controls.accel_mps2,
            rate_enu_radps: self.controls.rate_radps,
        };
    }

    /// One bad fix is GNSS's fault; many in a row are the INS's.
    fn refuse(&mut self, fix: &GnssFix, config: &Config) -> GnssOutcome {
        self.refused = self.refused.saturating_add(1);
        if self.refused >= LOST_FIXES {
            self.last_fix = Some(*fix);
            let sigma = self.observer.parameters.sigma(index::AZIMUTH);
            self.start_navigating(self.now.time, sigma, config);
        }
        GnssOutcome::Outlier
    }

    fn solve(&mut self, config: &Config) {
        let latency_before_s = self.observer.parameters.value(index::LATENCY);
        self.observer.solve();
        if config.feedback == Feedback::Open {
            return;
        }
        self.latency_corrected_s +=
            self.observer.parameters.value(index::LATENCY) - latency_before_s;
        let parameters = self.parameters(config);
        let prior = config.prior();
        let known = |i: usize, part: f64| parameters.sigma(i) < part * prior.sigma(i);
        for axis in 0..3 {
            // (9) reads gyro biases from controls that a compensation would empty.
            let readable = config.form == Form::Exact;
            if readable && known(index::GYRO + axis, 0.5) {
                set(
                    &mut self.compensation.gyro_radps,
                    axis,
                    parameters.value(index::GYRO + axis),
                );
            }
            if known(index::ACCEL + axis, 0.5) {
                set(
                    &mut self.compensation.accel_mps2,
                    axis,
                    parameters.value(index::ACCEL + axis),
                );
            }
        }
        if known(index::LATENCY, 0.2) {
            let latency = parameters.value(index::LATENCY);
            self.compensation.latency_s = math::max(math::min(latency, 0.4), -0.4);
        }
        self.relinearize(&prior);
    }

    /// Equations gathered about values that turned out far off are replaced by their solution:
    /// once for the azimuth of a new start, and whenever a well-known latency has moved.
    fn relinearize(&mut self, prior: &Parameters) {
        let parameters = &self.observer.parameters;
        let latency = math::abs(self.latency_corrected_s) > LATENCY_LINEAR_S
            && parameters.sigma(index::LATENCY) < 0.3 * LATENCY_LINEAR_S;
        let azimuth = !self.azimuth_settled
            && parameters.sigma(index::AZIMUTH) < 0.3 * AZIMUTH_LINEAR_RAD
            && math::abs(parameters.value(index::AZIMUTH)) < 0.3 * AZIMUTH_LINEAR_RAD;
        if azimuth {
            self.azimuth_settled = true;
        }
        if latency || (azimuth && math::abs(self.azimuth_removed_rad) > AZIMUTH_LINEAR_RAD) {
            let sigma = self
                .observer
                .parameters
                .sigma
                .zip_map(&prior.sigma, |now, before| math::min(3.0 * now, before));
            self.observer.relinearize(&sigma);
            self.latency_corrected_s = 0.0;
        }
    }
}

fn component(v: &Vector3<f64>, axis: usize) -> f64 {
    v.get(axis).copied().unwrap_or(0.0)
}

fn set(v: &mut Vector3<f64>, axis: usize, value: f64) {
    if let Some(component) = v.get_mut(axis) {
        *component = value;
    }
}

fn out_of_range(sample: &ImuSample, seconds: f64, config: &Config) -> bool {
    let scale = match config.imu_output {
        ImuOutput::Rates => 1.0,
        ImuOutput::Increments => seconds,
    };
    sample.gyro.amax() > scale * config.sensors.gyro_range_radps
        || sample.accel.amax() > scale * config.sensors.accel_range_mps2
}

fn gyrocompass_possible(config: &Config, position: &Geodetic) -> bool {
    let earth = LocalEarth::at(position.latitude_rad, position.height_m);
    config.heading == HeadingSource::Auto
        && levelling::gyrocompass_sigma(&config.sensors, &earth, GYROCOMPASS_S) < HEADING_SIGMA_RAD
}

/// Level tilt that makes the INS velocity run away at a slope: `dV_E' = -g Phi_N`.
fn tilt_of_slope(slope: &Vector2<f64>, _config: &Config) -> Vector3<f64> {
    let g = crate::earth::GRAVITY_EQUATOR_MPS2;
    Vector3::new(slope.y / g, -slope.x / g, 0.0)
}

fn velocity_enu(fix: &GnssFix) -> Vector3<f64> {
    let level = fix.velocity_en_mps.unwrap_or_default();
    Vector3::new(level.x, level.y, fix.velocity_up_mps.unwrap_or_default())
}

fn speed(fix: &GnssFix) -> f64 {
    fix.velocity_en_mps.unwrap_or_default().norm()
}

fn is_moving(fix: &GnssFix, config: &Config) -> bool {
    speed(fix) > MOTION_MPS + 4.0 * config.gnss.velocity_sigma_mps
}

/// Whether a fix can be of this Earth.
fn check_fix(fix: &GnssFix) -> Result<(), GnssOutcome> {
    let velocity = velocity_enu(fix);
    let position = fix.position.unwrap_or_default();
    let place = Vector3::new(
        position.latitude_rad,
        position.longitude_rad,
        position.height_m,
    );
    let sigma = fix.velocity_sigma_mps.unwrap_or_default();
    if !(math::all_finite(&velocity) && math::all_finite(&place) && sigma.is_finite()) {
        return Err(GnssOutcome::NotFinite);
    }
    if fix.position.is_none() && fix.velocity_en_mps.is_none() {
        return Err(GnssOutcome::Empty);
    }
    let possible = math::abs(place.x) <= core::f64::consts::FRAC_PI_2
        && math::abs(place.y) <= core::f64::consts::TAU
        && place.z > -12_000.0
        && place.z < 100_000.0
        && velocity.norm() < 3_000.0;
    if possible {
        Ok(())
    } else {
        Err(GnssOutcome::OutOfRange)
    }
}

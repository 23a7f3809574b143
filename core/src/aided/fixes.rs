//! Path of a fix: it waits for the INS to reach its time, is averaged with others close to it, and is
//! compared with the INS of that time, a step per call.

use nalgebra::Vector3;

use super::barometer::Climb;
use super::comparison::{Comparison, Component, Step};
use super::estimator::Estimator;
use super::vertical_sign::ClimbSample;
use super::{AidedIns, HOLD_S};
use crate::config::{Config, Feedback, Noise};
use crate::damping::{self, Differences};
use crate::error_model::InsError;
use crate::health::Counts;
use crate::history::{Missing, PastState};
#[cfg(feature = "literal")]
use crate::literal;
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::measurement::Kind;
use crate::observer::RESET_MPS;
use crate::outcome::GnssOutcome;
use crate::parameters::index;
use crate::samples::GnssFix;
use crate::time::Time;

/// Least time between two fixes, s; with the latency estimate their times move.
const LEAST_INTERVAL_S: f64 = 0.01;
/// Least time between positions that are used beside velocities, s, unless configured as white: their noise
/// changes more slowly.
const POSITION_INTERVAL_S: f64 = 0.45;
/// Time after which rare heights do not hold the vertical any more, s.
const UNAIDED_S: f64 = 1.0;
/// Correlation time of a climb, s: what is assumed of it counts once in so long.
const CLIMB_MEMORY_S: f64 = 10.0;
/// Interval of the sign test by the accelerometers, s: within the ring, and long against changes of slope.
const SIGN_INTERVAL_S: f64 = 0.9;
/// Sigma below which any azimuth error is taken out, rad, and sigmas that it must have otherwise.
const AZIMUTH_KNOWN_RAD: f64 = 0.035;
const AZIMUTH_SIGMAS: f64 = 3.0;
/// Errors of the INS that are corrected at once, m and m/s: the loops are linear, and slow.
const JUMP_M: f64 = 100.0;
const JUMP_MPS: f64 = 3.0;

impl<const N: usize> AidedIns<N> {
    /// Takes a fix, or queues it.
    pub fn on_fix(&mut self, fix: &GnssFix, counts: &mut Counts, config: &Config) -> GnssOutcome {
        let at_once = match self.pending.oldest() {
            None => self.gather(fix, true, config),
            Some(_) => None,
        };
        let outcome = at_once.unwrap_or_else(|| self.queue(fix, counts, config));
        if outcome == GnssOutcome::Queued && fix.is_moving(config.gnss.velocity_mps.white) {
            self.latency_search.on_fix(fix, &self.history, config);
            self.rest.on_motion();
        }
        outcome
    }

    /// Queues a fix; in a full queue the oldest makes room if the ring has reached its time, and the
    /// comparison going on is finished for it. Else nothing is changed.
    #[inline(never)]
    fn queue(&mut self, fix: &GnssFix, counts: &mut Counts, config: &Config) -> GnssOutcome {
        if self.pending.push(*fix).is_ok() {
            return GnssOutcome::Queued;
        }
        let come = self.pending.oldest().is_some_and(|oldest| {
            let moment = oldest.time.plus_seconds(-self.compensation.latency_s);
            self.history.covers(moment)
        });
        if !come {
            return GnssOutcome::TooFarAhead;
        }
        // A comparison that cannot take it must be closed first.
        while !self.take_pending(false, counts, config) && self.compare(counts, config) {}
        match self.pending.push(*fix) {
            Ok(()) => GnssOutcome::Queued,
            Err(_) => GnssOutcome::TooFarAhead,
        }
    }

    /// Stamp of the newest fix without an outcome, and how many have none.
    pub fn undecided(&self) -> Option<(Time, u8)> {
        let compared = self.comparison.as_ref();
        (self.pending.iter()).fold(compared.map(|own| (own.stamp, own.fixes)), |before, fix| {
            let fixes = before.map_or(0, |(_, fixes)| fixes);
            Some((fix.time, fixes.saturating_add(1)))
        })
    }

    /// Takes the oldest queued fix, if the ring has reached its time.
    pub(super) fn take_pending(
        &mut self,
        wait: bool,
        counts: &mut Counts,
        config: &Config,
    ) -> bool {
        let Some(fix) = self.pending.oldest().copied() else {
            return false;
        };
        let outcome = self.gather(&fix, wait, config);
        if let Some(outcome) = outcome {
            self.pending.pop();
            counts.fix(fix.time, outcome);
        }
        outcome.is_some()
    }

    /// Compares a fix with the INS of its time; `None` while that is ahead, or another comparison is going
    /// on.
    #[inline(never)]
    fn gather(&mut self, fix: &GnssFix, wait: bool, config: &Config) -> Option<GnssOutcome> {
        let moment = fix.time.plus_seconds(-self.compensation.latency_s);
        let mut found = self.history.at(moment, wait);
        // In place: it is large.
        let past = match &mut found {
            Ok(past) => past,
            Err(Missing::Future) => return None,
            Err(Missing::TooOld) => return Some(GnssOutcome::TooOld),
        };
        if moment.seconds_since(self.newest) < LEAST_INTERVAL_S || moment < self.estimator.horizon()
        {
            return Some(GnssOutcome::TimeNotIncreasing);
        }
        if self.gap.is_some_and(|gap| gap.holds(moment)) {
            return Some(GnssOutcome::NoInertialData);
        }
        if let Some(comparison) = &mut self.comparison
            && !comparison.accepts(fix, moment)
        {
            if comparison.step == Step::Gather {
                comparison.step = Step::Advance;
            }
            return None;
        }
        if let Some(observer) = self.estimator.exact() {
            let memory_s = observer.smoothing_time_s();
            // No longer than the latency: a smoothing receiver is late by as much.
            let memory_s = math::min(memory_s, self.compensation.latency_s);
            self.history.smooth(past, memory_s);
        }
        if !self.vertical_sign.is_known() {
            self.test_climb_sign(past, fix, config);
        }
        let climb_variance = self.check_climb(fix, config);
        self.add_comparison(past, fix, climb_variance);
        self.newest = moment;
        if let Some(comparison) = &mut self.comparison {
            comparison.close(self.now);
        }
        Some(GnssOutcome::Queued)
    }

    /// Variance to be added to the vertical velocity of a fix, if it can be used; once its sign is found to
    /// be wrong, what was learnt of it is discarded.
    #[inline(never)]
    fn check_climb(&mut self, fix: &GnssFix, config: &Config) -> Option<f64> {
        let was_wrong = self.vertical_sign.is_wrong();
        let variance = self.vertical_sign.take(fix, config);
        if self.vertical_sign.is_wrong()
            && !was_wrong
            && let Some(observer) = self.estimator.exact_mut()
        {
            observer.forget_vertical(config);
        }
        variance
    }

    /// Tests the sign of a vertical velocity by the accelerometers.
    #[inline(never)]
    fn test_climb_sign(&mut self, past: &PastState, fix: &GnssFix, config: &Config) {
        let (Some(up_mps), Some(observer)) = (fix.velocity_up_mps, self.estimator.exact()) else {
            return;
        };
        let now = ClimbSample::of(past, up_mps);
        let seconds = |last: &ClimbSample| now.time.seconds_since(last.time);
        if self
            .last_climb
            .is_some_and(|last| seconds(&last) < SIGN_INTERVAL_S)
        {
            return;
        }
        let last = self.last_climb.replace(now);
        let Some(last) = last.filter(|last| seconds(last) < 2.0 * SIGN_INTERVAL_S) else {
            return;
        };
        let ins_change_mps =
            now.ins_mps - last.ins_mps - self.control_climb_mps(last.time, now.time);
        let p = observer.parameters();
        let swing = now.swing - last.swing;
        let later_mps = p.sigma(index::LATENCY) * (now.accel_mps2 - last.accel_mps2);
        let motion_variance = swing
            .component_mul(&p.sigmas(index::LEVER_ARM))
            .norm_squared()
            + (p.sigmas(index::ACCEL) * seconds(&last)).norm_squared()
            + later_mps * later_mps;
        let noise = config.gnss.velocity_up_mps.white;
        let change_mps = up_mps - last.up_mps;
        self.vertical_sign.test_accel(
            change_mps,
            ins_change_mps,
            2.0 * noise * noise,
            motion_variance,
        );
    }

    /// Vertical velocity by the loops between two times, m/s, without the compensation, which corrects the
    /// sensors.
    fn control_climb_mps(&self, from: Time, to: Time) -> f64 {
        let span = self.history.next_span(from, to, f64::INFINITY);
        span.map_or(0.0, |(since, _)| {
            let compensated = since.attitude_s * self.compensation.accel_mps2;
            since.control_velocity_mps.z + compensated.z
        })
    }

    /// Adds a fix and the INS of its time to the comparison.
    #[inline(never)]
    fn add_comparison(&mut self, past: &PastState, fix: &GnssFix, climb_variance: Option<f64>) {
        let next = Comparison {
            step: Step::Gather,
            past: *past,
            fixes: 1,
            stamp: fix.time,
            newest: past.time,
            before: self.newest,
            arrived: self.now,
            latency_applied_s: self.compensation.latency_s,
            velocity_mps: past.velocity_mps - fix.velocity_enu_mps(),
            position_m: self.position_difference(past, fix),
            velocity: Component::of(fix.velocity_en_mps.is_some(), fix.sigma.velocity_mps),
            climb: Component::of(climb_variance.is_some(), fix.sigma.velocity_up_mps),
            climb_variance: climb_variance.unwrap_or_default(),
            climb_assumed: false,
            position: Component::of(fix.position.is_some(), fix.sigma.position_m),
            height: Component::of(fix.height_m.is_some(), fix.sigma.height_m),
            position_s: past.time.seconds_since(self.last_position),
            height_s: past.time.seconds_since(self.last_height),
        };
        match &mut self.comparison {
            Some(comparison) => comparison.add(&next),
            None => self.comparison = Some(next),
        }
    }

    /// INS minus GNSS, m; zero where the fix has none.
    fn position_difference(&self, past: &PastState, fix: &GnssFix) -> Vector3<f64> {
        let ins = &self.mechanization;
        let own = ins.position;
        let way_m = past.way_since_m + self.current.way_m;
        ins.local_earth().enu_between(&fix.position_or(&own), &own) - way_m
    }

    /// Takes a climb of the barometer: with the next fixes, or alone where there are none.
    pub fn on_climb(&mut self, climb: &Climb) {
        let (Ok(past), Some(_)) = (self.history.at(climb.time, false), self.estimator.exact())
        else {
            return;
        };
        self.climb = Some(climb.difference(&past));
        let alone = self.comparison.is_none() && self.pending.oldest().is_none();
        let after = climb.time > self.newest && climb.time >= self.estimator.horizon();
        if alone && after && self.now > self.controls_until {
            let nothing = GnssFix {
                time: climb.time,
                ..GnssFix::default()
            };
            self.add_comparison(&past, &nothing, None);
            self.newest = climb.time;
            if let Some(comparison) = &mut self.comparison {
                comparison.fixes = 0;
                comparison.step = Step::Advance;
            }
        }
    }

    /// Next step of the comparison; whether there was one.
    #[inline(never)]
    pub(super) fn compare(&mut self, counts: &mut Counts, config: &Config) -> bool {
        let Some(comparison) = &self.comparison else {
            return false;
        };
        match comparison.step {
            Step::Gather => return false,
            Step::Advance => self.advance_to_comparison(config),
            Step::Take(kind) => self.update_estimator(kind, config),
            Step::Damp => {
                if self.finish_comparison(counts, config) {
                    self.correct_ins();
                }
            }
        }
        true
    }

    /// Propagates the estimators toward the time of the comparison; once there, selects what of it is used.
    fn advance_to_comparison(&mut self, config: &Config) {
        let from = self.estimator.horizon();
        if let Some(moment) = self.comparison.as_ref().map(|own| own.past.time)
            && moment > from
        {
            self.advance(moment, config);
            if self.estimator.horizon() > from {
                return;
            }
        }
        let Some(comparison) = &mut self.comparison else {
            return;
        };
        let white = |noise: &Noise| noise.correlated <= 0.0;
        let velocities = (self.estimator.exact()).is_some_and(|own| own.aided_by(Kind::Velocity));
        let at_once = !(comparison.velocity.has || velocities)
            || white(&config.gnss.position_m) && white(&config.gnss.height_m);
        comparison.position.has &= at_once || comparison.position_s >= POSITION_INTERVAL_S;
        comparison.height.has &= at_once || comparison.height_s >= POSITION_INTERVAL_S;
        if comparison.position.has {
            self.last_position = comparison.newest;
        }
        if comparison.height.has {
            self.last_height = comparison.newest;
        }
        self.manoeuvre = Manoeuvre::of(&comparison.past);
        if !(comparison.climb.has || comparison.height.has) && self.estimator.exact().is_some() {
            self.assume_climb(config);
        }
        if let Some(comparison) = &mut self.comparison {
            if comparison.climb.has || comparison.height.has {
                self.last_vertical = comparison.newest;
            }
            comparison.next_step(None);
        }
    }

    /// Vertical velocity for fixes without any: of the barometer, or else after some time zero.
    #[inline(never)]
    fn assume_climb(&mut self, config: &Config) {
        let Some(comparison) = &self.comparison else {
            return;
        };
        let past = &comparison.past;
        let since_s = comparison.newest.seconds_since(self.last_vertical);
        if since_s < UNAIDED_S {
            return;
        }
        let come = self.climb.take_if(|climb| climb.time <= past.time);
        let assumed = match come.filter(|climb| climb.is_valid_at(past.time)) {
            Some(climb) => {
                let pushed_mps = self.control_climb_mps(climb.time, past.time);
                (climb.mps + pushed_mps, climb.variance)
            }
            None if since_s > CLIMB_MEMORY_S => (
                past.velocity_mps.z,
                config.climb_sigma_mps * config.climb_sigma_mps,
            ),
            None => return,
        };
        if let Some(comparison) = &mut self.comparison {
            comparison.assume_climb(assumed.0, assumed.1);
        }
    }

    /// Updates the estimators with one kind of measurement.
    #[inline(never)]
    fn update_estimator(&mut self, kind: Kind, config: &Config) {
        let Some(comparison) = &mut self.comparison else {
            return;
        };
        let difference = comparison.difference(kind);
        comparison.component(kind).used = match &mut self.estimator {
            Estimator::Exact(observer) => {
                observer.update(&comparison.past, kind, &difference, config)
            }
            #[cfg(feature = "literal")]
            Estimator::Literal(literal) => {
                let now = literal::Comparison {
                    past: &comparison.past,
                    manoeuvre: self.manoeuvre,
                    difference_mps: comparison.velocity_mps,
                    accel_up_mps2: self.controls.accel_mps2.z,
                    azimuth_removed_rad: self.azimuth_removed_rad,
                    latency_applied_s: comparison.latency_applied_s,
                    accel_compensation_mps2: self.compensation.accel_mps2,
                    bandwidth_radps: config.damping.horizontal.bandwidth_radps,
                };
                literal.take(kind, &now, config)
            }
        };
        comparison.next_step(Some(kind));
    }

    /// Sets the controls by what was used, and the outcome of the fixes; whether the INS error is beyond
    /// the loops.
    #[inline(never)]
    fn finish_comparison(&mut self, counts: &mut Counts, config: &Config) -> bool {
        let Some(comparison) = self.comparison.take() else {
            return false;
        };
        let mut differences = self.differences(&comparison, config);
        // Also, and above all, where no fix is accepted any more.
        if let Some(observer) = self.estimator.exact_mut() {
            observer.check_divergence(config);
            self.diverged |= observer.needs_realignment();
            if observer.last_reset() == Some(observer.horizon()) && is_misaligned(&comparison) {
                self.diverged = true;
                self.parameters_invalid = true;
            }
        }
        let outcome = if comparison.is_used() {
            GnssOutcome::Accepted
        } else {
            GnssOutcome::Outlier
        };
        counts.fixes(comparison.stamp, comparison.fixes, outcome);
        if differences == Differences::default() {
            return false;
        }
        let far = |error: &InsError| {
            error.velocity_mps.norm() > JUMP_MPS || error.position_m.xy().norm() > JUMP_M
        };
        let jumps = config.feedback == Feedback::Closed && far(&self.error());
        if jumps {
            differences = Differences::default();
        }
        self.set_controls(&comparison, &differences, config);
        jumps
    }

    /// Differences for the loops, at the sensors and not at the antenna. Without velocities they are those
    /// of the observer. Sparse positions act for one fix interval only, and proportionally stronger.
    fn differences(&self, taken: &Comparison, config: &Config) -> Differences {
        let past = &taken.past;
        let arm = match config.feedback {
            Feedback::Closed => self.known().lever_arm(),
            Feedback::Open => config.gnss.lever_arm_m.into(),
        };
        let mut differences = Differences::default();
        let held =
            |since_s: f64| math::min(since_s, HOLD_S) / math::min(taken.interval_s(), HOLD_S);
        let (level_held, up_held) = (held(taken.position_s), held(taken.height_s));
        let velocity_mps = taken.velocity_mps + past.attitude_rate * arm;
        let position_m = taken.position_m + past.attitude * arm;
        let estimated = self.estimator.exact().map(|observer| *observer.error());
        let by_position =
            |used: bool, has_velocity: bool| estimated.filter(|_| used && !has_velocity);
        if taken.velocity.used {
            differences.velocity_en_mps = Some(velocity_mps.xy());
        } else if let Some(error) = by_position(taken.position.used, taken.velocity.has) {
            differences.velocity_en_mps = Some(error.velocity_mps.xy() * level_held);
        }
        if taken.climb_assumed {
            differences.velocity_up_mps = estimated.map(|error| error.velocity_mps.z);
        } else if taken.climb.used {
            differences.velocity_up_mps = Some(velocity_mps.z);
        } else if let Some(error) = by_position(taken.height.used, taken.climb.has) {
            differences.velocity_up_mps = Some(error.velocity_mps.z * up_held);
        }
        if taken.position.used {
            differences.position_en_m = Some(position_m.xy() * level_held);
        }
        if taken.height.used {
            differences.height_m = Some(position_m.z * up_held);
        }
        differences
    }

    /// Sets the controls that hold until the next fix.
    fn set_controls(&mut self, taken: &Comparison, differences: &Differences, config: &Config) {
        let parameters = self.known();
        let azimuth = parameters.value(index::AZIMUTH);
        let sigma = parameters.sigma(index::AZIMUTH);
        let significant = sigma < AZIMUTH_KNOWN_RAD || math::abs(azimuth) > AZIMUTH_SIGMAS * sigma;
        let differences = Differences {
            azimuth_rad: (config.feedback == Feedback::Closed && significant).then_some(azimuth),
            ..*differences
        };
        // From the time of the fix until the controls have acted.
        let lag_s = math::min(taken.interval_s(), HOLD_S) + self.now.seconds_since(taken.past.time);
        self.controls = damping::controls(&differences, lag_s, &config.damping);
        self.controls_until = self.now.plus_seconds(HOLD_S);
        if differences.velocity_en_mps.is_some() || differences.position_en_m.is_some() {
            self.level_until = self.controls_until;
        }
        let level = differences.velocity_en_mps.unwrap_or_default();
        let up = differences.velocity_up_mps.unwrap_or_default();
        self.last_comparison = (taken.stamp, level.push(up));
    }
}

/// Whether the velocity error is larger than the vehicle's speed: then the linear model fails, and the
/// parameters are wrong, too.
fn is_misaligned(compared: &Comparison) -> bool {
    let off_mps = compared.velocity_mps.xy();
    let speed_mps = (compared.past.velocity_mps.xy() - off_mps).norm();
    compared.velocity.has && off_mps.norm() > math::max(speed_mps, RESET_MPS)
}

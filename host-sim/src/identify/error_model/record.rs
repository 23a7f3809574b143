//! A drive reduced to the data from which its error model is identified.
//!
//! The navigator's solution is the reference. Between two epochs a strapdown runs free from it, and
//! at an epoch it is reset to the reference: a known control. The velocity differences that remain
//! are linear in the errors of the reference and in the gyro biases, thesis equation (1).

use ins_core::earth::LocalEarth;
use ins_core::increments::{Increments, Interval};
use ins_core::mechanization::{Controls, Mechanization, Step};
use ins_core::rest::{RestBlock, RestDetector, Verdict};
use ins_core::{Estimate, Estimates, GnssFix, ImuSample, Phase, Solution, Time};
use nalgebra::{Matrix3, Vector2, Vector3};

use super::interval::Measured;
use crate::identify::free_inertial::known;
use crate::identify::run::{Identification, Settling};
use crate::log::{Log, median};

/// Sigmas by which the receiver's smoothing must differ from zero to be applied.
const SMOOTHS_SIGMAS: f64 = 3.0;
/// Length of an epoch, s. Tilt shows in velocity over some 10 s, so nothing is lost.
const EPOCH_S: f64 = 2.0;
/// Longest epoch that still counts as whole, s.
const LONGEST_EPOCH_S: f64 = 1.5 * EPOCH_S;
/// Most epochs, three hours, for which the likelihood is computed many hundred times: the last ones.
const MOST_EPOCHS: usize = 5400;
/// A fix faster than this is not rest, m/s.
const MOVING_MPS: f64 = 0.6;
/// A vehicle in motion at the last fix, this long ago and more, s, is taken to be so still: on a smooth
/// road only GNSS tells it from rest.
const STALE_FIX_S: f64 = 2.0;
/// Blocks at both ends of a rest that are left out: the vehicle still rocks, and GNSS speed is late.
const MARGIN_BLOCKS: usize = 2;
/// Time from the first solution until a core that never knows its azimuth has settled, s.
const SETTLE_S: f64 = 60.0;
/// Velocity differences above this many times their median are left out.
const OUTLIER: f64 = 8.0;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Epoch {
    /// Start, since the first sample of the log, s.
    pub start_s: f64,
    pub seconds: f64,
    pub integrals: Integrals,
    /// Rotation of ENU against inertial space, rad/s.
    pub frame_rate_radps: Vector3<f64>,
    /// Reset of the velocity at the end, m/s.
    pub velocity_control_mps: Vector2<f64>,
    /// Reset of the platform at the end, rad; its rotation over the whole epoch if at rest.
    pub tilt_control_rad: Vector3<f64>,
    /// Gyro reading less the reference bias and the rotation of the Earth, rad/s, if at rest.
    pub rest_rate_radps: Option<Vector3<f64>>,
    /// Against GNSS; none without a credible fix.
    pub difference: Option<Difference>,
    /// Inertial samples are missing in it.
    pub has_gap: bool,
}

impl Epoch {
    pub fn middle_s(&self) -> f64 {
        self.start_s + 0.5 * self.seconds
    }

    /// Splits the epoch at `part` of it; the fixes go to the first, the controls to the second.
    pub fn split(&self, part: f64) -> (Self, Self) {
        let of = |part: f64| Self {
            seconds: part * self.seconds,
            integrals: self.integrals.scaled(part),
            ..self.clone()
        };
        let before = Self {
            velocity_control_mps: Vector2::zeros(),
            tilt_control_rad: Vector3::zeros(),
            ..of(part)
        };
        let after = Self {
            start_s: self.start_s + before.seconds,
            difference: None,
            ..of(1.0 - part)
        };
        (before, after)
    }
}

/// Integrals of the readings since the start of an epoch; columns are axes of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integrals {
    /// Integral of specific force, ENU, m/s.
    pub force_mps: Vector3<f64>,
    /// Integral of `C_B^L`, s.
    pub attitude_s: Matrix3<f64>,
    /// ENU velocity from the specific force of each axis beyond that of the level attitude, m/s.
    pub scaled_force_mps: Matrix3<f64>,
    /// ENU rotation about each axis, rad.
    pub scaled_turn_rad: Matrix3<f64>,
    /// ENU velocity from a tilt of the platform by that, m/s.
    pub scaled_turn_mps: Matrix3<f64>,
}

impl Integrals {
    /// With `part` of another one added.
    #[must_use]
    fn plus(&self, part: f64, more: &Self) -> Self {
        Self {
            force_mps: self.force_mps + part * more.force_mps,
            attitude_s: self.attitude_s + part * more.attitude_s,
            scaled_force_mps: self.scaled_force_mps + part * more.scaled_force_mps,
            scaled_turn_rad: self.scaled_turn_rad + part * more.scaled_turn_rad,
            scaled_turn_mps: self.scaled_turn_mps + part * more.scaled_turn_mps,
        }
    }

    fn scaled(&self, by: f64) -> Self {
        Self::default().plus(by, self)
    }
}

/// Mean over the fixes of an epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Difference {
    /// Velocity of the strapdown less that of GNSS, east and north, m/s.
    pub velocity_mps: Vector2<f64>,
    /// Integrals until then.
    pub integrals: Integrals,
    /// Acceleration, east and north: partials by the latency, m/s^2.
    pub acceleration_mps2: Vector2<f64>,
    /// `dC/dt`, partials by the lever arm, 1/s.
    pub attitude_rate_per_s: Matrix3<f64>,
    pub fixes: u32,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// In order of time, from when the azimuth is known, or else from when the core has settled.
    pub epochs: Vec<Epoch>,
    /// Sigma of the azimuth then, rad.
    pub azimuth_sigma_rad: f64,
    /// Stretches of rest, block by block, whole log.
    pub rest: Vec<Vec<RestBlock>>,
    /// Gyro biases already taken out of the epochs, body right-forward-up, rad/s.
    pub gyro_reference_radps: Vector3<f64>,
    pub accel_bias_mps2: [Estimate; 3],
    /// Scale errors of gyros and accelerometers, as far as observable.
    pub gyro_scale: Vec<Measured>,
    pub accel_scale: Vec<Measured>,
    pub latency_s: Estimate,
    /// Shift applied to the stamps of the fixes before, taken for a difference of clocks.
    pub clock_offset_s: f64,
    pub duration_s: f64,
    pub fix_rate_hz: f64,
}

impl Record {
    /// Reduces a log; no epochs if it never navigated for long.
    pub fn new(log: &Log, found: &Identification) -> Self {
        let rest = rest(log);
        let estimates = &found.end.estimates;
        let sensors = &found.config.sensors;
        let [turns, tilts] = [
            std::slice::from_ref(&estimates.turn_scale),
            &estimates.gyro_scale,
        ];
        let reducer = Reducer::new(log, found, &rest);
        Self {
            epochs: reducer.epochs(intervals(log)),
            azimuth_sigma_rad: reducer.azimuth_sigma_rad,
            rest: rest.into_iter().map(|span| span.blocks).collect(),
            gyro_reference_radps: values(&estimates.gyro_bias_radps),
            accel_bias_mps2: estimates.accel_bias_mps2,
            gyro_scale: without_prior(turns.iter().chain(tilts), sensors.gyro_scale),
            accel_scale: without_prior(&estimates.accel_scale, sensors.accel_scale),
            latency_s: Estimate {
                value: estimates.gnss_latency_s.value + log.meta.latency_offset_s(),
                ..estimates.gnss_latency_s
            },
            clock_offset_s: log.meta.clock_offset_s(),
            duration_s: log.duration_s(),
            fix_rate_hz: log.fix_rate_hz(),
        }
    }
}

fn values(estimates: &[Estimate; 3]) -> Vector3<f64> {
    Vector3::from(estimates.map(|estimate| estimate.value))
}

/// Observable estimates, their prior taken out.
fn without_prior<'a>(all: impl IntoIterator<Item = &'a Estimate>, prior: f64) -> Vec<Measured> {
    let measured = all.into_iter().filter_map(Measured::of);
    measured.filter_map(|m| m.without_prior(prior)).collect()
}

/// An interval between samples and the stamp of its end.
struct Timed {
    end: Time,
    interval: Interval,
    gap: bool,
}

fn intervals(log: &Log) -> impl Iterator<Item = Timed> {
    let mut increments = None;
    log.imu.pairs().map(move |[last, sample]| {
        let increments = increments.get_or_insert_with(|| Increments::new(log.meta.imu, &last));
        let seconds = sample.time.seconds_since(last.time);
        let gap = increments.has_gap(seconds);
        let interval = increments.interval(&sample, seconds);
        Timed {
            end: sample.time,
            interval,
            gap,
        }
    })
}

struct RestSpan {
    start: Time,
    end: Time,
    blocks: Vec<RestBlock>,
}

impl RestSpan {
    /// Without its margins; none if nothing is left.
    fn inner(&self) -> Option<Self> {
        let count = self.blocks.len().checked_sub(2 * MARGIN_BLOCKS)?;
        let seconds = |blocks: &[RestBlock]| blocks.iter().map(|block| block.seconds).sum::<f64>();
        let (before, rest) = self.blocks.split_at(MARGIN_BLOCKS);
        let (blocks, after) = rest.split_at(count);
        (count > 1).then(|| Self {
            start: self.start.plus_seconds(seconds(before)),
            end: self.end.plus_seconds(-seconds(after)),
            blocks: blocks.to_vec(),
        })
    }
}

fn rest(log: &Log) -> Vec<RestSpan> {
    let mut detector = RestDetector::default();
    let mut fixes = log.gnss.iter().peekable();
    let mut last: Option<&GnssFix> = None;
    let mut spans: Vec<RestSpan> = Vec::new();
    for Timed { end, interval, .. } in intervals(log) {
        while let Some(fix) = fixes.next_if(|fix| fix.time <= end) {
            last = Some(fix);
            if fix.speed_mps() > MOVING_MPS {
                detector.on_motion();
            }
        }
        let moved = last.filter(|fix| fix.speed_mps() > MOVING_MPS);
        if moved.is_some_and(|fix| end.seconds_since(fix.time) > STALE_FIX_S) {
            detector.on_motion();
        }
        // The verdict is on the block before the one that ends here, of about the same length.
        if let Some(Verdict::Rest(block)) = detector.on_interval(&interval) {
            let (start, end) = (
                end.plus_seconds(-2.0 * block.seconds),
                end.plus_seconds(-block.seconds),
            );
            match spans.last_mut() {
                Some(span) if start.seconds_since(span.end).abs() < 0.5 * block.seconds => {
                    span.end = end;
                    span.blocks.push(block);
                }
                _ => spans.push(RestSpan {
                    start,
                    end,
                    blocks: vec![block],
                }),
            }
        }
    }
    spans.iter().filter_map(RestSpan::inner).collect()
}

/// Readings of the stretches of rest, sample by sample: gyros, rad/s, and accelerometers, m/s^2.
pub fn readings_at_rest(log: &Log) -> Vec<Vec<[Vector3<f64>; 2]>> {
    let stretch = |span: &RestSpan| {
        let inside = |[_, sample]: &[ImuSample; 2]| (span.start..=span.end).contains(&sample.time);
        let reading = |[last, sample]: [ImuSample; 2]| {
            let seconds = (log.meta.imu).per_rate(sample.time.seconds_since(last.time));
            [sample.gyro / seconds, sample.accel / seconds]
        };
        log.imu.pairs().filter(inside).map(reading).collect()
    };
    rest(log).iter().map(stretch).collect()
}

/// Compensates readings for the biases that the navigator has estimated. Scales and misalignments
/// stay in: it estimates them by the vehicle's turns, a model has them by the axes of the body.
struct Correction {
    estimates: Estimates,
    end: Time,
}

impl Correction {
    fn of(&self, interval: &Interval) -> Interval {
        let [gyro, accel] = [
            &self.estimates.gyro_bias_radps,
            &self.estimates.accel_bias_mps2,
        ]
        .map(values);
        interval.without_bias(&gyro, &accel)
    }

    /// Specific force beyond that of the level attitude, whose scale errors are in the biases.
    fn beyond_level_mps(&self, interval: &Interval) -> Vector3<f64> {
        interval.force_mps - self.estimates.level_force_mps2 * interval.seconds
    }

    /// Time of validity of a fix.
    fn valid_at(&self, fix: &GnssFix) -> Time {
        let drifted = self.estimates.clock_drift.value * self.end.seconds_since(fix.time);
        fix.time
            .plus_seconds(drifted - self.estimates.gnss_latency_now_s.value)
    }

    /// Velocity of the antenna against the sensors, `dC/dt l`.
    fn antenna_mps(&self, attitude: &Matrix3<f64>, interval: &Interval) -> Vector3<f64> {
        let arm = values(&self.estimates.lever_arm_m);
        attitude * (interval.angle_rad / interval.seconds).cross(&arm)
    }
}

/// Velocities of the reference, and as smoothed by the receiver: the lag of its filter in a manoeuvre
/// is no noise.
struct Smoothed {
    reference: Vec<(Time, Vector2<f64>)>,
    /// By time of validity.
    smoothed: Vec<(Time, Vector2<f64>)>,
}

impl Smoothed {
    /// By a filter of first order whose time constant has the estimated variance; `None` where that does
    /// not differ from zero. A long one is known well and still not to a third of its prior sigma.
    fn new(solutions: &[Solution], estimates: &Estimates) -> Option<Self> {
        let variance = &estimates.gnss_smoothing_s2;
        if variance.value <= SMOOTHS_SIGMAS * variance.sigma {
            return None;
        }
        let memory_s = variance.value.sqrt();
        let level = |solution: &Solution| (solution.time, solution.velocity_enu_mps.xy());
        let reference: Vec<_> = solutions.iter().map(level).collect();
        let mut lag = Vector2::zeros();
        let smoothed = reference.windows(2).map(|pair| {
            let [(from, before), (to, now)] = [pair[0], pair[1]];
            let seconds = to.seconds_since(from);
            // Steady-state lag under a constant acceleration.
            let last = (now - before) * (memory_s / seconds);
            lag = last + (lag - last) * libm::exp(-seconds / memory_s);
            (to.plus_seconds(-memory_s), now - lag)
        });
        let smoothed = smoothed.collect();
        Some(Self {
            reference,
            smoothed,
        })
    }

    /// Smoothed minus reference velocity at a time, m/s; `None` beyond the reference.
    fn lag_error(&self, moment: Time) -> Option<Vector2<f64>> {
        Some(at(&self.smoothed, moment)? - at(&self.reference, moment)?)
    }
}

fn at(track: &[(Time, Vector2<f64>)], moment: Time) -> Option<Vector2<f64>> {
    let after = track.partition_point(|(time, _)| *time <= moment);
    let (from, before) = track.get(after.checked_sub(1)?)?;
    let (to, next) = track.get(after)?;
    let part = moment.seconds_since(*from) / to.seconds_since(*from);
    Some(before.lerp(next, part))
}

struct Reducer<'a> {
    first: Time,
    correction: Correction,
    references: &'a [Solution],
    azimuth_sigma_rad: f64,
    fixes: Vec<(Time, Vector2<f64>)>,
    rest: &'a [RestSpan],
}

impl<'a> Reducer<'a> {
    fn new(log: &Log, found: &'a Identification, rest: &'a [RestSpan]) -> Self {
        let correction = Correction {
            estimates: found.end.estimates,
            end: found.end.time,
        };
        let smoothed = Smoothed::new(&found.solutions, &correction.estimates);
        let fix = |fix: &GnssFix| {
            let moment = correction.valid_at(fix);
            let lag_mps = smoothed
                .as_ref()
                .and_then(|smoothed| smoothed.lag_error(moment));
            Some((moment, fix.velocity_en_mps? - lag_mps.unwrap_or_default()))
        };
        let fixes = log.gnss.iter().filter_map(fix).collect();
        let mut settling = Settling::default();
        for row in &found.history {
            settling.at(row.time, row.phase == Phase::Navigating, SETTLE_S, || {
                known(&row.estimates.azimuth_error_rad)
            });
        }
        let begins = settling.azimuth_known.or(settling.settled);
        let row = found.history.iter().find(|row| Some(row.time) == begins);
        let references = begins.map_or(&[][..], |time| {
            let from = (found.solutions).partition_point(|solution| solution.time < time);
            &found.solutions[from..]
        });
        Self {
            first: log.start(),
            rest,
            correction,
            references,
            azimuth_sigma_rad: row.map_or(0.0, |row| row.estimates.azimuth_error_rad.sigma),
            fixes,
        }
    }

    fn epochs(&self, intervals: impl Iterator<Item = Timed>) -> Vec<Epoch> {
        let mut references = self.references.iter().peekable();
        let mut fixes = self.fixes.iter().peekable();
        let mut epochs = Vec::new();
        let mut open: Option<OpenEpoch> = None;
        for timed in intervals {
            if let Some(open) = &mut open {
                open.step(&timed, &self.correction, &mut fixes);
            }
            while references.next_if(|next| next.time < timed.end).is_some() {}
            let Some(reference) = references.next_if(|next| next.time == timed.end) else {
                continue;
            };
            let due = open.as_ref().is_none_or(OpenEpoch::is_over);
            if due {
                epochs.extend(open.take().map(|open| open.end(reference, self)));
                open = Some(OpenEpoch::new(reference));
            }
        }
        epochs.drain(..epochs.len().saturating_sub(MOST_EPOCHS));
        drop_outliers(&mut epochs);
        epochs
    }

    fn at_rest(&self, start: Time, end: Time) -> bool {
        let after = self.rest.partition_point(|span| span.start <= start);
        after > 0 && self.rest[after - 1].end >= end
    }
}

/// An epoch that is being integrated.
struct OpenEpoch {
    start: Solution,
    ins: Mechanization,
    earth: LocalEarth,
    angle_rad: Vector3<f64>,
    epoch: Epoch,
    sum: Difference,
}

impl OpenEpoch {
    fn new(reference: &Solution) -> Self {
        let ins = Mechanization::new(
            reference.position,
            reference.velocity_enu_mps,
            reference.attitude,
        );
        Self {
            start: *reference,
            ins,
            earth: ins.local_earth(),
            angle_rad: Vector3::zeros(),
            epoch: Epoch::default(),
            sum: Difference::default(),
        }
    }

    /// Whether the next reference ends it; references come ten times a second.
    fn is_over(&self) -> bool {
        self.epoch.seconds > EPOCH_S - 0.05
    }

    fn step<'f>(
        &mut self,
        timed: &Timed,
        correction: &Correction,
        fixes: &mut std::iter::Peekable<impl Iterator<Item = &'f (Time, Vector2<f64>)>>,
    ) {
        let interval = correction.of(&timed.interval);
        let before = self.ins.velocity_enu_mps;
        let step = self.ins.step(&interval, &Controls::default());
        let antenna = correction.antenna_mps(&step.attitude, &interval);
        let integrals = self.integrate(&step, &interval, correction);
        while let Some((moment, velocity)) = fixes.next_if(|fix| fix.0 <= timed.end) {
            let part = 1.0 - timed.end.seconds_since(*moment) / interval.seconds;
            if part < 0.0 {
                continue; // It shows a time before this epoch.
            }
            let ins = before + part * (self.ins.velocity_enu_mps - before) + antenna;
            self.sum.velocity_mps += ins.xy() - velocity;
            self.sum.integrals =
                (self.sum.integrals.plus(1.0, &self.epoch.integrals)).plus(part, &integrals);
            self.sum.fixes += 1;
        }
        self.angle_rad += interval.rotation_rad();
        let epoch = &mut self.epoch;
        epoch.integrals = epoch.integrals.plus(1.0, &integrals);
        epoch.seconds += interval.seconds;
        epoch.has_gap |= timed.gap;
    }

    fn integrate(&self, step: &Step, interval: &Interval, correction: &Correction) -> Integrals {
        let beyond_level = correction.beyond_level_mps(interval);
        let scaled_turn_rad = step.attitude * Matrix3::from_diagonal(&interval.angle_rad);
        let turned = self.epoch.integrals.scaled_turn_rad + 0.5 * scaled_turn_rad;
        Integrals {
            force_mps: step.force_enu_mps,
            attitude_s: interval.seconds * step.attitude,
            scaled_force_mps: step.attitude * Matrix3::from_diagonal(&beyond_level),
            scaled_turn_rad,
            scaled_turn_mps: step.force_enu_mps.cross_matrix() * turned,
        }
    }

    fn end(self, reference: &Solution, reducer: &Reducer) -> Epoch {
        let (seconds, fixes) = (self.epoch.seconds, f64::from(self.sum.fixes));
        let frame_rate =
            self.earth.earth_rate() + self.earth.transport_rate(&self.start.velocity_enu_mps);
        let at_rest = reducer.at_rest(self.start.time, reference.time);
        let before = if at_rest {
            self.start.attitude
        } else {
            self.ins.attitude
        };
        // `C' = (I - [Phi x]) C`: turning the platform by Phi is a rotation by -Phi.
        let turned = -(reference.attitude * before.inverse()).scaled_axis();
        let rest_rate = self.angle_rad / seconds
            - self.epoch.integrals.attitude_s.tr_mul(&frame_rate) / seconds;
        let velocity_control = reference.velocity_enu_mps - self.ins.velocity_enu_mps;
        let gained = self.ins.velocity_enu_mps - self.start.velocity_enu_mps;
        let [from, to] = [&self.start.attitude, &self.ins.attitude]
            .map(|attitude| attitude.to_rotation_matrix().into_inner());
        let turning = to - from;
        Epoch {
            start_s: self.start.time.seconds_since(reducer.first),
            frame_rate_radps: frame_rate,
            velocity_control_mps: velocity_control.xy(),
            tilt_control_rad: turned,
            rest_rate_radps: at_rest.then_some(rest_rate),
            difference: (fixes > 0.0).then(|| Difference {
                velocity_mps: self.sum.velocity_mps / fixes,
                integrals: self.sum.integrals.scaled(1.0 / fixes),
                acceleration_mps2: gained.xy() / seconds,
                attitude_rate_per_s: turning / seconds,
                fixes: self.sum.fixes,
            }),
            has_gap: self.epoch.has_gap || seconds > LONGEST_EPOCH_S,
            ..self.epoch
        }
    }
}

/// Removes differences beyond any receiver noise.
fn drop_outliers(epochs: &mut [Epoch]) {
    let size = |epoch: &Epoch| epoch.difference.as_ref().map(|d| d.velocity_mps.norm());
    let median = median(epochs.iter().filter_map(size));
    for epoch in epochs {
        if size(epoch).is_some_and(|size| size > OUTLIER * median) {
            epoch.difference = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use indicatif::ProgressBar;
    use ins_core::Observability;

    use super::*;
    use crate::identify::configure;
    use crate::identify::run::identify;
    use crate::log::{BodyAxes, Grade};
    use crate::sim::{DriveConfig, simulate};
    use crate::statistics::rms;

    /// The lag of half a second of smoothing in the manoeuvres of this car doubles the differences; its time
    /// constant is estimated to a tenth, which leaves some.
    #[test]
    fn what_a_receiver_smooths_away_is_no_noise() {
        let mut config = DriveConfig::new(12, Grade::Mems, 15.0);
        config.recording.errors.gnss.velocity_sigma_mps = 0.05;
        let difference_mps = |config: &DriveConfig| {
            let log = simulate(config).into_log(BodyAxes::Rfu, ins_core::ImuOutput::Rates);
            let found = identify(
                &log,
                configure::config(&log, Grade::Mems),
                &ProgressBar::hidden(),
            );
            let record = Record::new(&log, &found.unwrap());
            let differences = record
                .epochs
                .iter()
                .filter_map(|epoch| epoch.difference.as_ref());
            rms(differences.map(|difference| difference.velocity_mps.norm()))
        };
        let plain_mps = difference_mps(&config);
        config.recording.errors.gnss.habits.smoothing_s = 0.5;
        let smoothed_mps = difference_mps(&config);
        assert!(smoothed_mps < 1.5 * plain_mps, "{smoothed_mps} {plain_mps}");
    }

    #[test]
    fn a_drive_whose_azimuth_is_never_known_tells_of_its_noise_once_settled() {
        let drive = simulate(&DriveConfig::new(1, Grade::Mems, 5.0));
        let log = drive.into_log(BodyAxes::Rfu, ins_core::ImuOutput::Rates);
        let config = configure::config(&log, Grade::Mems);
        let mut found = identify(&log, config, &ProgressBar::hidden()).unwrap();
        let headed = Record::new(&log, &found);
        for row in &mut found.history {
            let azimuth = &mut row.estimates.azimuth_error_rad;
            azimuth.observability = Observability::NeedsAcceleration;
            azimuth.sigma = 0.3;
        }
        let settled = Record::new(&log, &found);
        let start_s = found.solutions[0].time.seconds_since(log.start());
        assert!((settled.epochs[0].start_s - start_s - SETTLE_S).abs() < EPOCH_S);
        assert!(headed.epochs[0].start_s < settled.epochs[0].start_s);
        assert!(headed.azimuth_sigma_rad < 0.035);
        assert!((settled.azimuth_sigma_rad - 0.3).abs() < 1e-12);
    }
}

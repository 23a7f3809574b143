//! Time offset between GNSS and inertial sensors, from the accelerations and turns that both measured.

use ins_core::GnssFix;
use ins_core::earth::Geodetic;
use nalgebra::{UnitQuaternion, Vector2, Vector3};

use super::error::{Findings, LogError};
use super::rates::Rates;
use super::series::{Curve, intervals, signed_angle};
use super::{GRAVITY_MPS2, Log};
use crate::statistics::Line;

/// Range of the search for offsets, in steps of half the shortest manoeuvre, then in fine steps.
const MAX_OFFSET_S: f64 = 300.0;
const STEP_S: f64 = 0.5;
const FINE_STEPS: i32 = 10;
const FINE_STEP_S: f64 = 0.05;
/// Range where the files do not overlap in time: their starts may be far apart.
const MAX_DISJOINT_OFFSET_S: f64 = 1800.0;
/// Duration of a manoeuvre: offsets closer than this are one answer.
const MANOEUVRE_S: f64 = 3.0;
/// Decisive evidence: so many times that of any other answer, as correlation of successive intervals
/// inflates evidence, and so much more of it.
const EVIDENCE_RATIO: f64 = 1.5;
const EVIDENCE_MARGIN: f64 = 20.0;
/// Evidence per interval that one motion has: unrelated motions get up to 0.4.
const EVIDENCE_PER_INTERVAL: f64 = 0.6;
/// Windows of intervals, each compared with its own rotation: short enough for the drift of gyros.
const WINDOW_S: f64 = 20.0;
const MIN_INTERVALS: usize = 8;
/// With so many, of the most motion, more add nothing.
const MAX_WINDOWS: usize = 200;
const ONE_SCALE: &str = "both files on one time scale";

/// Motion by GNSS over an interval of about a second.
struct GnssInterval {
    from_s: f64,
    to_s: f64,
    /// Turn rate of the course, counter-clockwise; none at low speed.
    turn_radps: Option<f64>,
    horizontal_mps2: Vector2<f64>,
    up_mps2: Option<f64>,
}

/// Moves the fixes onto the clock of the inertial samples where motion shows another. Returns whether both
/// files show one motion.
pub(super) fn set_clock(
    log: &mut Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<bool, LogError> {
    let separation_s = separation(log);
    let comparison = MotionComparison::new(log, rates);
    let candidates = comparison.candidates(log, separation_s);
    let best = comparison.refined(most_evident(candidates.iter()));
    let distinct = |other: &&TimeOffset| (other.offset_s - best.offset_s).abs() > MANOEUVRE_S;
    let other = comparison.refined(most_evident(candidates.iter().filter(distinct)));
    let at_zero = comparison.refined(comparison.at(0.0));
    if !best.is_decisive_over(&other) {
        let explained = [&best, &other].map(|offset| comparison.is_explained_by(offset));
        if explained == [true, true] {
            let ambiguity = ambiguous(&best, &other, findings);
            // Repeated motion is no evidence of an offset if offset zero explains it as well.
            let at_zero_is_as_good =
                comparison.is_explained_by(&at_zero) && !best.is_decisive_over(&at_zero);
            if separation_s.is_some() || !at_zero_is_as_good {
                return Err(ambiguity);
            }
            let cause = "manoeuvres that repeat; taken to be on one time scale already".into();
            findings.warn(LogError { cause, ..ambiguity });
        } else if separation_s.is_some() {
            return Err(different_origin(log, findings));
        }
        return Ok(explained[0]);
    }
    // A small offset is latency, which the navigator estimates.
    if separation_s.is_none() && best.evidence < at_zero.evidence + EVIDENCE_MARGIN {
        return Ok(true);
    }
    for fix in &mut log.gnss {
        fix.time = fix.time.plus_seconds(-best.offset_s);
    }
    log.meta.gnss_clock_offset_s += best.offset_s;
    let latency = log.meta.clock_offset_s() == 0.0;
    findings.warn(shifted(&best, separation_s.is_some(), latency, findings));
    Ok(true)
}

fn shifted(best: &TimeOffset, disjoint: bool, latency: bool, findings: &Findings) -> LogError {
    let side = if best.offset_s > 0.0 { "late" } else { "early" };
    let found = format!(
        "fixes {:.2} s {side} by the motion both saw",
        best.offset_s.abs()
    );
    let cause = format!(
        "{}; moved by {:.2} s, which counts as {}",
        if disjoint {
            "the two files count from different origins (UTC, GPS week, boot)"
        } else {
            leap_seconds(best.offset_s)
                .unwrap_or("the two files were stamped by clocks that differ")
        },
        -best.offset_s,
        if latency {
            "latency"
        } else {
            "a difference of clocks"
        }
    );
    findings.gnss("t_s", ONE_SCALE, found, cause)
}

/// Whether an offset is that of GPS time to UTC since 2006 plus a latency.
fn leap_seconds(offset_s: f64) -> Option<&'static str> {
    let cause = "leap seconds: one file counts UTC, the other GPS time (18 s ahead since 2017)";
    (13.5..=19.5).contains(&offset_s.abs()).then_some(cause)
}

fn ambiguous(best: &TimeOffset, other: &TimeOffset, findings: &Findings) -> LogError {
    let found = format!(
        "fixes {:+.1} s off or {:+.1} s off, as likely",
        best.offset_s, other.offset_s
    );
    let cause = "clocks that differ, and manoeuvres that repeat: bring both to one scale";
    findings.gnss("t_s", ONE_SCALE, found, cause)
}

/// Time from the first sample to the first fix, s, if fixes and samples do not overlap.
fn separation(log: &Log) -> Option<f64> {
    let (first, last) = fix_span(log);
    (first > log.duration_s() || last < 0.0).then_some(first)
}

/// Times of first and last fix, s from the first sample.
fn fix_span(log: &Log) -> (f64, f64) {
    let first = log.start();
    let since = |fix: &GnssFix| fix.time.seconds_since(first);
    (since(&log.gnss[0]), since(&log.gnss[log.gnss.len() - 1]))
}

fn different_origin(log: &Log, findings: &Findings) -> LogError {
    let (first, last) = fix_span(log);
    if log.gnss.len() == 1 {
        let found = format!("one fix alone, {first:.3} s from the first sample");
        let cause = "the receiver lost its fix, or its logger stopped: one fix shows no motion";
        return findings.gnss("", "fixes all along the inertial samples", found, cause);
    }
    let expected = format!(
        "GNSS fixes within the time of the inertial samples, 0 to {:.3} s",
        log.duration_s()
    );
    let found = format!("fixes from {first:.3} to {last:.3} s, counted from the first sample");
    let cause = leap_seconds(first).unwrap_or(
        "the two files count from different origins (UTC, GPS week, boot), and by how much is not \
         clear from the motion that both show",
    );
    let cause = format!("{cause}: bring both to one scale");
    findings.gnss("t_s", expected, found, cause)
}

/// A time offset of the fixes, positive where their stamps are late.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TimeOffset {
    pub(super) offset_s: f64,
    /// Log-likelihood ratio of one motion, at this offset, to unrelated motions.
    pub(super) evidence: f64,
}

impl TimeOffset {
    pub(super) fn is_decisive_over(&self, other: &Self) -> bool {
        self.evidence > EVIDENCE_RATIO * other.evidence.max(0.0) + EVIDENCE_MARGIN
    }
}

fn most_evident<'a>(offsets: impl Iterator<Item = &'a TimeOffset>) -> TimeOffset {
    offsets
        .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
        .copied()
        .unwrap_or_default()
}

/// Motions by inertial sensors and by GNSS, compared at time offsets.
pub(super) struct MotionComparison {
    /// Integral of the sensed acceleration: two horizontal components, up.
    imu_mps: [Curve; 3],
    turned_rad: Curve,
    windows: Vec<Vec<GnssInterval>>,
    intervals: usize,
}

impl MotionComparison {
    pub(super) fn new(log: &Log, rates: &Rates) -> Self {
        let windows = windows(gnss_intervals(log));
        Self {
            imu_mps: levelled_velocity(rates),
            turned_rad: rates.angles_about_vertical(),
            intervals: windows.iter().map(Vec::len).sum(),
            windows,
        }
    }

    /// Replaces the inertial samples, for the same fixes.
    pub(super) fn set_rates(&mut self, rates: &Rates) {
        (self.imu_mps, self.turned_rad) = (levelled_velocity(rates), rates.angles_about_vertical());
    }

    /// All offsets of the search, with zero among them where the files overlap in time.
    fn candidates(&self, log: &Log, separation_s: Option<f64>) -> Vec<TimeOffset> {
        let (first, last) = fix_span(log);
        let max_offset_s = match separation_s {
            Some(_) => (last - first)
                .max(log.duration_s())
                .clamp(MAX_OFFSET_S, MAX_DISJOINT_OFFSET_S),
            None => MAX_OFFSET_S,
        };
        #[allow(clippy::cast_possible_truncation)] // Some thousands.
        let steps = (max_offset_s / STEP_S) as i32;
        (-steps..=steps)
            .map(|step| self.at(separation_s.unwrap_or(0.0) + f64::from(step) * STEP_S))
            .collect()
    }

    pub(super) fn refined(&self, coarse: TimeOffset) -> TimeOffset {
        (-FINE_STEPS..=FINE_STEPS)
            .map(|step| self.at(coarse.offset_s + f64::from(step) * FINE_STEP_S))
            .fold(coarse, |a, b| if b.evidence > a.evidence { b } else { a })
    }

    pub(super) fn is_explained_by(&self, offset: &TimeOffset) -> bool {
        offset.evidence > EVIDENCE_MARGIN.max(EVIDENCE_PER_INTERVAL * self.intervals as f64)
    }

    pub(super) fn at(&self, offset_s: f64) -> TimeOffset {
        let covered = |time_s: f64| self.turned_rad.covers(time_s - offset_s);
        let inside = |gnss: &&GnssInterval| covered(gnss.from_s) && covered(gnss.to_s);
        let windows: Vec<Vec<&GnssInterval>> = self
            .windows
            .iter()
            .map(|window| window.iter().filter(inside).collect())
            .filter(|window: &Vec<&GnssInterval>| window.len() >= MIN_INTERVALS)
            .collect();
        // With less than a third of the intervals any offset could fit by chance.
        if windows.iter().map(Vec::len).sum::<usize>() * 3 < self.intervals {
            return TimeOffset {
                offset_s,
                evidence: 0.0,
            };
        }
        let mean = |curve: &Curve, gnss: &GnssInterval| {
            let change = curve.at(gnss.to_s - offset_s) - curve.at(gnss.from_s - offset_s);
            change / (gnss.to_s - gnss.from_s)
        };
        let accelerations: f64 = windows
            .iter()
            .map(|window| {
                let imu =
                    [0, 1, 2].map(|axis| detrended(window, |gnss| mean(&self.imu_mps[axis], gnss)));
                horizontal_evidence(window, &imu) + vertical_evidence(window, &imu[2])
            })
            .sum();
        let turns = (windows.iter().flatten())
            .filter_map(|gnss| Some((gnss.turn_radps?, mean(&self.turned_rad, gnss))));
        let evidence = accelerations + turn_evidence(&turns.collect::<Vec<_>>());
        TimeOffset { offset_s, evidence }
    }
}

/// Values over a window less their linear trend, which is of tilt and its drift.
fn detrended(window: &[&GnssInterval], value: impl Fn(&GnssInterval) -> f64) -> Vec<f64> {
    let pair = |gnss: &&GnssInterval| (gnss.from_s, value(gnss));
    let pairs: Vec<(f64, f64)> = window.iter().map(pair).collect();
    let line = Line::through(&pairs);
    pairs
        .iter()
        .map(|(time_s, value)| value - line.at(*time_s))
        .collect()
}

/// Evidence of horizontal accelerations, whose axes differ by an unknown angle.
fn horizontal_evidence(window: &[&GnssInterval], imu: &[Vec<f64>; 3]) -> f64 {
    let [x, y] = [0, 1].map(|axis| detrended(window, |gnss| gnss.horizontal_mps2[axis]));
    let (mut imu_square, mut gnss_square, mut dot, mut cross) = (0.0, 0.0, 0.0, 0.0);
    for index in 0..window.len() {
        let imu = Vector2::new(imu[0][index], imu[1][index]);
        let gnss = Vector2::new(x[index], y[index]);
        imu_square += imu.norm_squared();
        gnss_square += gnss.norm_squared();
        dot += imu.dot(&gnss);
        cross += imu.perp(&gnss);
    }
    let r_squared = (dot * dot + cross * cross) / (imu_square * gnss_square);
    // Expected by chance, for the two parameters angle and scale.
    (window.len() - 2) as f64 * log_variance_ratio(r_squared) - 1.0
}

fn vertical_evidence(window: &[&GnssInterval], imu: &[f64]) -> f64 {
    if window.iter().any(|gnss| gnss.up_mps2.is_none()) {
        return 0.0;
    }
    let gnss = detrended(window, |gnss| gnss.up_mps2.unwrap_or_default());
    let fit = Line::from_origin(imu.iter().copied().zip(gnss));
    let r_squared = fit.correlation.max(0.0).powi(2);
    0.5 * (window.len() - 2) as f64 * log_variance_ratio(r_squared) - 0.25
}

/// Evidence of turn rates, by one straight line for all: heading may follow course or not.
fn turn_evidence(pairs: &[(f64, f64)]) -> f64 {
    if pairs.len() < 10 {
        return 0.0;
    }
    0.5 * pairs.len() as f64 * log_variance_ratio(Line::through(pairs).correlation.powi(2))
}

/// Logarithm of the ratio of variance to residual variance, by the squared correlation.
fn log_variance_ratio(r_squared: f64) -> f64 {
    // Bounded for noiseless simulated data; not finite at rest.
    if r_squared.is_finite() {
        -(1.0 - r_squared).max(1e-3).ln()
    } else {
        0.0
    }
}

/// Integral of specific force less gravity, in a level frame with slowly drifting azimuth.
///
/// Attitude is by the gyros, levelled by gravity with a time constant of 20 s, which also estimates drift.
fn levelled_velocity(rates: &Rates) -> [Curve; 3] {
    const TILT_PER_S: f64 = 0.05;
    const DRIFT_PER_S2: f64 = 0.001;
    let up = Vector3::z();
    let mut attitude =
        UnitQuaternion::rotation_between(&rates.median.force_mps2, &up).unwrap_or_default();
    let (mut drift, mut integral) = (Vector3::zeros(), Vector3::zeros());
    let mut curves: [Curve; 3] = Default::default();
    for rate in rates.iter() {
        // After a gap the integral is wrong, but only in the window with the gap.
        let seconds = rate.interval_s.min(0.5);
        integral += (attitude * rate.accel_mps2 - GRAVITY_MPS2 * up) * seconds;
        for (axis, curve) in curves.iter_mut().enumerate() {
            curve.push(rate.time_s, integral[axis]);
        }
        let Some(vertical) = rate.accel_mps2.try_normalize(0.0) else {
            continue;
        };
        let tilt = vertical.cross(&attitude.inverse_transform_vector(&up));
        drift += DRIFT_PER_S2 * seconds * tilt;
        let turn = (rate.gyro_radps + TILT_PER_S * tilt + drift) * seconds;
        attitude *= UnitQuaternion::from_scaled_axis(turn);
    }
    curves
}

/// Windows without gaps, of many those with the most motion.
fn windows(intervals: Vec<GnssInterval>) -> Vec<Vec<GnssInterval>> {
    let mut windows: Vec<Vec<GnssInterval>> = Vec::new();
    for interval in intervals {
        match windows.last_mut() {
            Some(window)
                if interval.from_s - window[window.len() - 1].to_s < 0.5
                    && interval.to_s - window[0].from_s < WINDOW_S =>
            {
                window.push(interval);
            }
            _ => windows.push(vec![interval]),
        }
    }
    windows.retain(|window| window.len() >= MIN_INTERVALS);
    let motion = |window: &Vec<GnssInterval>| -> f64 {
        window
            .iter()
            .map(|gnss| gnss.horizontal_mps2.norm_squared())
            .sum()
    };
    windows.sort_by(|a, b| motion(b).total_cmp(&motion(a)));
    windows.truncate(MAX_WINDOWS);
    windows
}

/// Time and GNSS velocity, horizontal and up.
type Velocity = (f64, (Vector2<f64>, Option<f64>));

fn gnss_intervals(log: &Log) -> Vec<GnssInterval> {
    let of_ends = |[from, to]: [Velocity; 2]| {
        let seconds = to.0 - from.0;
        let ((before, up_before), (after, up_after)) = (from.1, to.1);
        let moving = before.norm().min(after.norm()) > 2.0;
        GnssInterval {
            from_s: from.0,
            to_s: to.0,
            turn_radps: moving.then(|| signed_angle(before, after) / seconds),
            horizontal_mps2: (after - before) / seconds,
            up_mps2: up_before.zip(up_after).map(|(a, b)| (b - a) / seconds),
        }
    };
    let velocities = intervals(velocities(log).into_iter());
    velocities.into_iter().map(of_ends).collect()
}

/// By the receiver, or else from its positions.
fn velocities(log: &Log) -> Vec<Velocity> {
    let first = log.start();
    let since = |fix: &GnssFix| fix.time.seconds_since(first);
    let fixes = || log.gnss.iter();
    let measured: Vec<Velocity> = fixes()
        .filter_map(|fix| Some((since(fix), (fix.velocity_en_mps?, fix.velocity_up_mps))))
        .collect();
    if 2 * measured.len() > log.gnss.len() {
        return measured;
    }
    let positions = fixes().filter_map(|fix| Some((since(fix), (fix, fix.geodetic_or(0.0)?))));
    let velocity = |[(from_s, (from, start)), (to_s, (to, end))]: [(f64, (&GnssFix, _)); 2]| {
        let mean = Geodetic::enu_from(&end, &start) / (to_s - from_s);
        let heights = from.height_m.zip(to.height_m);
        (0.5 * (from_s + to_s), (mean.xy(), heights.map(|_| mean.z)))
    };
    intervals(positions).into_iter().map(velocity).collect()
}

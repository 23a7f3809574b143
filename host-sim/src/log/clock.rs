//! The two clocks of a log, compared by the motion that both saw: accelerations and turns.

use ins_core::GnssFix;
use ins_core::earth::Geodetic;
use nalgebra::{UnitQuaternion, Vector2, Vector3};

use super::error::{Findings, LogError};
use super::rates::Rates;
use super::typical::{Curve, intervals, turned};
use super::{GRAVITY_MPS2, Log};
use crate::statistics::Line;

/// Shifts that are looked for, in steps of half the shortest manoeuvre, and finer ones from there.
const LARGEST_S: f64 = 300.0;
const STEP_S: f64 = 0.5;
const FINE_STEPS: i32 = 10;
const FINE_STEP_S: f64 = 0.05;
/// Where the files have no time in common, both may have begun long apart.
const LARGEST_APART_S: f64 = 1800.0;
/// A manoeuvre, to which no other is another answer.
const MANOEUVRE_S: f64 = 3.0;
/// Evidence that decides: so many times that of any other answer, which successive intervals that
/// are alike feign, and so much more of it.
const TIMES: f64 = 1.5;
const DECISIVE: f64 = 20.0;
/// Evidence of each interval that chance never has: unrelated motion gets up to 0.4.
const EXPLAINED: f64 = 0.6;
/// Intervals that are compared under a rotation of their own: short enough for gyros that drift.
const WINDOW_S: f64 = 20.0;
const LEAST_INTERVALS: usize = 8;
/// As many windows, those with the most motion, tell what a day's tell.
const MOST_WINDOWS: usize = 200;
const ONE_SCALE: &str = "both files on one time scale";

/// What GNSS saw over a second or so.
struct Seen {
    from_s: f64,
    to_s: f64,
    /// Turned counter-clockwise, rad/s; none at a walk.
    turn_radps: Option<f64>,
    level_mps2: Vector2<f64>,
    up_mps2: Option<f64>,
}

/// Moves the fixes onto the clock of the inertial samples where motion shows that it is another.
/// Whether both files show one motion.
pub(super) fn set_clock(
    log: &mut Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<bool, LogError> {
    let apart_s = apart(log);
    let clocks = Clocks::new(log, rates);
    let candidates = clocks.candidates(log, apart_s);
    let best = clocks.finer(likeliest(candidates.iter()));
    let far = |other: &&Shift| (other.s - best.s).abs() > MANOEUVRE_S;
    let rival = clocks.finer(likeliest(candidates.iter().filter(far)));
    let as_it_is = clocks.finer(clocks.at(0.0));
    if !best.decides_over(&rival) {
        let explained = [&best, &rival].map(|shift| clocks.explained_by(shift));
        if explained == [true, true] {
            let answers = two_answers(&best, &rival, findings);
            // What repeats so tells of no shift, if none explains what was seen, too.
            let is_one = clocks.explained_by(&as_it_is) && !best.decides_over(&as_it_is);
            if apart_s.is_some() || !is_one {
                return Err(answers);
            }
            let cause = "manoeuvres that repeat; taken to be on one time scale already".into();
            findings.warn(LogError { cause, ..answers });
        } else if apart_s.is_some() {
            return Err(other_origin(log, findings));
        }
        return Ok(explained[0]);
    }
    // What is left is latency, which the navigator finds.
    if apart_s.is_none() && best.evidence < as_it_is.evidence + DECISIVE {
        return Ok(true);
    }
    for fix in &mut log.gnss {
        fix.time = fix.time.plus_seconds(-best.s);
    }
    log.meta.gnss_clock_offset_s += best.s;
    let latency = log.meta.clock_offset_s() == 0.0;
    findings.warn(moved(&best, apart_s.is_some(), latency, findings));
    Ok(true)
}

fn moved(best: &Shift, apart: bool, latency: bool, findings: &Findings) -> LogError {
    let side = if best.s > 0.0 { "late" } else { "early" };
    let found = format!("fixes {:.2} s {side} by the motion both saw", best.s.abs());
    let cause = format!(
        "{}; moved by {:.2} s, which counts as {}",
        if apart {
            "the two files count from different origins (UTC, GPS week, boot)"
        } else {
            leap_seconds(best.s).unwrap_or("the two files were stamped by clocks that differ")
        },
        -best.s,
        if latency {
            "latency"
        } else {
            "a difference of clocks"
        }
    );
    findings.gnss("t_s", ONE_SCALE, found, cause)
}

/// Whether a shift is what GPS time has been ahead of UTC since 2006, and a latency.
fn leap_seconds(shift_s: f64) -> Option<&'static str> {
    let cause = "leap seconds: one file counts UTC, the other GPS time (18 s ahead since 2017)";
    (13.5..=19.5).contains(&shift_s.abs()).then_some(cause)
}

fn two_answers(best: &Shift, other: &Shift, findings: &Findings) -> LogError {
    let found = format!(
        "fixes {:+.1} s off or {:+.1} s off, as likely",
        best.s, other.s
    );
    let cause = "clocks that differ, and manoeuvres that repeat: bring both to one scale";
    findings.gnss("t_s", ONE_SCALE, found, cause)
}

/// How far the fixes are from the samples, if none is among them: from start to start, s.
fn apart(log: &Log) -> Option<f64> {
    let (first, last) = reach(log);
    (first > log.duration_s() || last < 0.0).then_some(first)
}

/// First and last fix, s from the first sample.
fn reach(log: &Log) -> (f64, f64) {
    let first = log.start();
    let since = |fix: &GnssFix| fix.time.seconds_since(first);
    (since(&log.gnss[0]), since(&log.gnss[log.gnss.len() - 1]))
}

fn other_origin(log: &Log, findings: &Findings) -> LogError {
    let (first, last) = reach(log);
    if log.gnss.len() == 1 {
        let found = format!("one fix alone, {first:.3} s from the first sample");
        let cause = "the receiver lost its fix, or its logger stopped: one fix tells no motion";
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

/// A shift of the fixes, how much later their stamps are.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shift {
    pub(super) s: f64,
    /// Logarithm of how much likelier than unrelated motions it makes what was seen.
    pub(super) evidence: f64,
}

impl Shift {
    pub(super) fn decides_over(&self, other: &Self) -> bool {
        self.evidence > TIMES * other.evidence.max(0.0) + DECISIVE
    }
}

fn likeliest<'a>(shifts: impl Iterator<Item = &'a Shift>) -> Shift {
    shifts
        .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
        .copied()
        .unwrap_or_default()
}

/// What the two clocks are compared by.
pub(super) struct Clocks {
    /// Integrals of the acceleration by the sensors: two level components, up.
    felt: [Curve; 3],
    angle: Curve,
    windows: Vec<Vec<Seen>>,
    intervals: usize,
}

impl Clocks {
    pub(super) fn new(log: &Log, rates: &Rates) -> Self {
        let windows = windows(seen(log));
        Self {
            felt: levelled(rates),
            angle: rates.vertical_angles(),
            intervals: windows.iter().map(Vec::len).sum(),
            windows,
        }
    }

    /// The same fixes beside other samples.
    pub(super) fn read_anew(&mut self, rates: &Rates) {
        (self.felt, self.angle) = (levelled(rates), rates.vertical_angles());
    }

    /// All shifts that are looked for, zero among them where the files have a time in common.
    fn candidates(&self, log: &Log, apart_s: Option<f64>) -> Vec<Shift> {
        let (first, last) = reach(log);
        let largest_s = match apart_s {
            Some(_) => (last - first)
                .max(log.duration_s())
                .clamp(LARGEST_S, LARGEST_APART_S),
            None => LARGEST_S,
        };
        #[allow(clippy::cast_possible_truncation)] // Some thousands.
        let steps = (largest_s / STEP_S) as i32;
        (-steps..=steps)
            .map(|step| self.at(apart_s.unwrap_or(0.0) + f64::from(step) * STEP_S))
            .collect()
    }

    pub(super) fn finer(&self, coarse: Shift) -> Shift {
        (-FINE_STEPS..=FINE_STEPS)
            .map(|step| self.at(coarse.s + f64::from(step) * FINE_STEP_S))
            .fold(coarse, |a, b| if b.evidence > a.evidence { b } else { a })
    }

    pub(super) fn explained_by(&self, shift: &Shift) -> bool {
        shift.evidence > DECISIVE.max(EXPLAINED * self.intervals as f64)
    }

    pub(super) fn at(&self, s: f64) -> Shift {
        let inside =
            |seen: &&Seen| self.angle.reaches(seen.from_s - s) && self.angle.reaches(seen.to_s - s);
        let windows: Vec<Vec<&Seen>> = self
            .windows
            .iter()
            .map(|window| window.iter().filter(inside).collect())
            .filter(|window: &Vec<&Seen>| window.len() >= LEAST_INTERVALS)
            .collect();
        // With less than a third of them left any shift could look good.
        if windows.iter().map(Vec::len).sum::<usize>() * 3 < self.intervals {
            return Shift { s, evidence: 0.0 };
        }
        let mean = |curve: &Curve, seen: &Seen| {
            let change = curve.at(seen.to_s - s) - curve.at(seen.from_s - s);
            change / (seen.to_s - seen.from_s)
        };
        let forces: f64 = windows
            .iter()
            .map(|window| {
                let felt =
                    [0, 1, 2].map(|axis| detrended(window, |seen| mean(&self.felt[axis], seen)));
                level_evidence(window, &felt) + up_evidence(window, &felt[2])
            })
            .sum();
        let turns = (windows.iter().flatten())
            .filter_map(|seen| Some((seen.turn_radps?, mean(&self.angle, seen))));
        let evidence = forces + turn_evidence(&turns.collect::<Vec<_>>());
        Shift { s, evidence }
    }
}

/// Values of the intervals of a window less their straight line: a tilt and its drift.
fn detrended(window: &[&Seen], value: impl Fn(&Seen) -> f64) -> Vec<f64> {
    let pair = |seen: &&Seen| (seen.from_s, value(seen));
    let pairs: Vec<(f64, f64)> = window.iter().map(pair).collect();
    let line = Line::through(&pairs);
    pairs.iter().map(|(s, value)| value - line.at(*s)).collect()
}

/// Of level accelerations, one turned against the other by an unknown angle.
fn level_evidence(window: &[&Seen], felt: &[Vec<f64>; 3]) -> f64 {
    let [x, y] = [0, 1].map(|axis| detrended(window, |seen| seen.level_mps2[axis]));
    let (mut ff, mut ss, mut along, mut across) = (0.0, 0.0, 0.0, 0.0);
    for index in 0..window.len() {
        let felt = Vector2::new(felt[0][index], felt[1][index]);
        let seen = Vector2::new(x[index], y[index]);
        ff += felt.norm_squared();
        ss += seen.norm_squared();
        along += felt.dot(&seen);
        across += felt.perp(&seen);
    }
    let square = (along * along + across * across) / (ff * ss);
    // The angle and the scale are worth one, by chance.
    (window.len() - 2) as f64 * explained(square) - 1.0
}

fn up_evidence(window: &[&Seen], felt: &[f64]) -> f64 {
    if window.iter().any(|seen| seen.up_mps2.is_none()) {
        return 0.0;
    }
    let seen = detrended(window, |seen| seen.up_mps2.unwrap_or_default());
    let fit = Line::from_origin(felt.iter().copied().zip(seen));
    let square = fit.correlation.max(0.0).powi(2);
    0.5 * (window.len() - 2) as f64 * explained(square) - 0.25
}

/// Of turns about the vertical, which the nose follows or does not: one straight line for all.
fn turn_evidence(pairs: &[(f64, f64)]) -> f64 {
    if pairs.len() < 10 {
        return 0.0;
    }
    0.5 * pairs.len() as f64 * explained(Line::through(pairs).correlation.powi(2))
}

/// Logarithm of how much smaller a spread becomes by a correlation, of which the square is given.
fn explained(square: f64) -> f64 {
    // Perfect simulated data explain themselves to the last digit; at rest nothing is explained.
    if square.is_finite() {
        -(1.0 - square).max(1e-3).ln()
    } else {
        0.0
    }
}

/// Time and integrals of specific force less gravity, in a frame that stays level and turns slowly.
///
/// Gyros carry the attitude through manoeuvres; gravity, over a third of a minute, their drift.
fn levelled(rates: &Rates) -> [Curve; 3] {
    const TILT_PER_S: f64 = 0.05;
    const DRIFT_PER_S2: f64 = 0.001;
    let up = Vector3::z();
    let mut attitude =
        UnitQuaternion::rotation_between(&rates.typical.force_mps2, &up).unwrap_or_default();
    let (mut drift, mut integral) = (Vector3::zeros(), Vector3::zeros());
    let mut curves: [Curve; 3] = Default::default();
    for rate in rates.iter() {
        // Beyond a hole everything begins anew, within the window that it spoils.
        let seconds = rate.interval_s.min(0.5);
        integral += (attitude * rate.accel_mps2 - GRAVITY_MPS2 * up) * seconds;
        for (axis, curve) in curves.iter_mut().enumerate() {
            curve.push(rate.time_s, integral[axis]);
        }
        let Some(felt) = rate.accel_mps2.try_normalize(0.0) else {
            continue;
        };
        let tilt = felt.cross(&attitude.inverse_transform_vector(&up));
        drift += DRIFT_PER_S2 * seconds * tilt;
        let turn = (rate.gyro_radps + TILT_PER_S * tilt + drift) * seconds;
        attitude *= UnitQuaternion::from_scaled_axis(turn);
    }
    curves
}

/// Stretches without holes, if there are many those with the most motion.
fn windows(seen: Vec<Seen>) -> Vec<Vec<Seen>> {
    let mut windows: Vec<Vec<Seen>> = Vec::new();
    for interval in seen {
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
    windows.retain(|window| window.len() >= LEAST_INTERVALS);
    let motion = |window: &Vec<Seen>| -> f64 {
        window
            .iter()
            .map(|seen| seen.level_mps2.norm_squared())
            .sum()
    };
    windows.sort_by(|a, b| motion(b).total_cmp(&motion(a)));
    windows.truncate(MOST_WINDOWS);
    windows
}

/// A velocity by GNSS, level and up, at a time.
type Velocity = (f64, (Vector2<f64>, Option<f64>));

fn seen(log: &Log) -> Vec<Seen> {
    let seen = |[from, to]: [Velocity; 2]| {
        let seconds = to.0 - from.0;
        let ((before, up_before), (after, up_after)) = (from.1, to.1);
        let moving = before.norm().min(after.norm()) > 2.0;
        Seen {
            from_s: from.0,
            to_s: to.0,
            turn_radps: moving.then(|| turned(before, after) / seconds),
            level_mps2: (after - before) / seconds,
            up_mps2: up_before.zip(up_after).map(|(a, b)| (b - a) / seconds),
        }
    };
    let velocities = intervals(velocities(log).into_iter());
    velocities.into_iter().map(seen).collect()
}

/// As the receiver measures them, or else from its positions.
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
    let places = fixes().filter_map(|fix| Some((since(fix), (fix, fix.geodetic_or(0.0)?))));
    let velocity = |[(from_s, (from, start)), (to_s, (to, end))]: [(f64, (&GnssFix, _)); 2]| {
        let moved = Geodetic::enu_from(&end, &start) / (to_s - from_s);
        let heights = from.height_m.zip(to.height_m);
        (
            0.5 * (from_s + to_s),
            (moved.xy(), heights.map(|_| moved.z)),
        )
    };
    intervals(places).into_iter().map(velocity).collect()
}

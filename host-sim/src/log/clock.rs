//! The two clocks of a log, compared by what both saw: turns, and accelerations.

use nalgebra::Vector2;

use super::Log;
use super::check::Rate;
use super::error::LogError;
use super::read::Files;
use super::turns::{Curve, vertical_angles};

/// Shifts that are looked for: two minutes each way, in steps of half the shortest manoeuvre, and
/// finer ones from there.
const STEPS: i32 = 240;
const STEP_S: f64 = 0.5;
const FINE_STEPS: i32 = 10;
const FINE_STEP_S: f64 = 0.05;
/// Below this it is latency, which the navigator finds.
const LATENCY_S: f64 = 1.2;
/// Evidence that decides: e^20 against one, which allows for successive intervals being alike.
const DECISIVE: f64 = 20.0;
/// Least evidence of an interval: a correlation of a half, which no chance likeness of two slow
/// curves has; of a quarter where the clocks agree anyhow.
const EXPLAINED: f64 = 0.14;
const TOGETHER: f64 = 0.03;
const GRAVITY_MPS2: f64 = 9.81;

/// What GNSS saw over a second or so.
struct Seen {
    from_s: f64,
    to_s: f64,
    /// Turned counter-clockwise, rad/s; none at a walk.
    turn_radps: Option<f64>,
    /// Excess of specific force over gravity that the change of velocity makes, m/s^2.
    excess_mps2: f64,
}

/// Moves the fixes onto the clock of the inertial samples where motion shows that it is another.
/// Whether both files show one motion.
pub(super) fn set_clock(
    log: &mut Log,
    rates: &[Rate],
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<bool, LogError> {
    let apart_s = apart(log);
    let clocks = Clocks {
        angle: Curve::new(&vertical_angles(rates)),
        force: Curve::new(&excess(rates)),
        seen: seen(log),
        centre_s: apart_s.unwrap_or(0.0),
    };
    let together = clocks.enough(&clocks.at(0.0), TOGETHER);
    let Some(best) = clocks.best() else {
        return apart_s.map_or(Ok(together), |_| Err(other_origin(log, files)));
    };
    let other = clocks.rival(&best);
    let zero = Shift::default();
    if apart_s.is_none() && (best.s.abs() < LATENCY_S || clocks.over(&best, &zero) < DECISIVE) {
        return Ok(together);
    }
    if let Some(other) = other {
        return Err(two_answers(&best, &other, files));
    }
    for fix in &mut log.gnss {
        fix.time = fix.time.plus_seconds(-best.s);
    }
    let found = format!("fixes {:.2} s {}", best.s.abs(), later(best.s));
    let cause = format!(
        "{}; moved by {:.2} s, to which the latency found here is to be added",
        if apart_s.is_some() {
            "the two files count from different origins (UTC, GPS week, boot)"
        } else {
            cause(best.s)
        },
        -best.s
    );
    let expected = "both files on one time scale";
    warnings.push(LogError::file(&files.gnss, expected, found, cause).in_column("t_s"));
    Ok(true)
}

fn later(shift_s: f64) -> &'static str {
    if shift_s > 0.0 {
        "late by the motion both saw"
    } else {
        "early by the motion both saw"
    }
}

fn cause(shift_s: f64) -> &'static str {
    // What GPS time has been ahead of UTC since 2006, and a latency.
    if (13.5..=19.5).contains(&shift_s.abs()) {
        "leap seconds: one file counts UTC, the other GPS time (18 s ahead since 2017)"
    } else {
        "the two files were stamped by clocks that differ"
    }
}

fn two_answers(best: &Shift, other: &Shift, files: &Files) -> LogError {
    let found = format!(
        "fixes {:+.1} s off or {:+.1} s off, as likely",
        best.s, other.s
    );
    let cause = "clocks that differ, and manoeuvres that repeat: bring both to one scale";
    LogError::file(&files.gnss, "both files on one time scale", found, cause).in_column("t_s")
}

/// How far the fixes are from the samples, if none is among them: from start to start, s.
fn apart(log: &Log) -> Option<f64> {
    let origin = log.imu[0].time;
    let first = log.gnss[0].time.seconds_since(origin);
    let last = log.gnss[log.gnss.len() - 1].time.seconds_since(origin);
    (first > log.duration_s() || last < 0.0).then_some(first)
}

fn other_origin(log: &Log, files: &Files) -> LogError {
    let origin = log.imu[0].time;
    let first = log.gnss[0].time.seconds_since(origin);
    let last = log.gnss[log.gnss.len() - 1].time.seconds_since(origin);
    let expected = format!(
        "GNSS fixes within the time of the inertial samples, 0 to {:.3} s",
        log.duration_s()
    );
    let found = format!("fixes from {first:.3} to {last:.3} s, counted from the first sample");
    let cause = match cause(first) {
        leap if leap.starts_with("leap") => {
            "leap seconds: one file counts UTC, the other GPS time (18 s ahead since 2017): bring \
             both to one scale"
        }
        _ => {
            "the two files count from different origins (UTC, GPS week, boot), and there is too \
             little motion to find by how much: bring both to one scale"
        }
    };
    LogError::file(&files.gnss, expected, found, cause).in_column("t_s")
}

/// A shift of the fixes, how much later their stamps are.
#[derive(Clone, Copy, Debug, Default)]
struct Shift {
    s: f64,
    evidence: f64,
}

struct Clocks {
    angle: Curve,
    force: Curve,
    seen: Vec<Seen>,
    centre_s: f64,
}

impl Clocks {
    /// The likeliest shift.
    fn best(&self) -> Option<Shift> {
        let coarse = (-STEPS..=STEPS)
            .map(|step| self.at(self.centre_s + f64::from(step) * STEP_S))
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
        Some(self.finer(coarse)).filter(|best| self.enough(best, EXPLAINED))
    }

    /// Whether the evidence is decisive, and each interval on average has a share in it.
    fn enough(&self, shift: &Shift, each: f64) -> bool {
        shift.evidence > DECISIVE.max(each * self.seen.len() as f64)
    }

    fn finer(&self, coarse: Shift) -> Shift {
        (-FINE_STEPS..=FINE_STEPS)
            .map(|step| self.at(coarse.s + f64::from(step) * FINE_STEP_S))
            .fold(coarse, |a, b| if b.evidence > a.evidence { b } else { a })
    }

    /// Another shift that is not decisively less likely.
    fn rival(&self, best: &Shift) -> Option<Shift> {
        (-STEPS..=STEPS)
            .map(|step| self.at(self.centre_s + f64::from(step) * STEP_S))
            .filter(|other| (other.s - best.s).abs() > 3.0)
            .filter(|other| other.evidence > 0.5 * best.evidence)
            .map(|other| self.finer(other))
            .filter(|other| self.over(best, other) < DECISIVE)
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
    }

    fn at(&self, s: f64) -> Shift {
        let evidence = self.evidence(&[s])[0];
        Shift { s, evidence }
    }

    /// How much likelier one shift is than another, over what both explain.
    fn over(&self, one: &Shift, other: &Shift) -> f64 {
        let both = self.evidence(&[one.s, other.s]);
        both[0] - both[1]
    }

    /// Logarithms of likelihood of shifts, each over the intervals within the samples by all.
    fn evidence(&self, shifts_s: &[f64]) -> Vec<f64> {
        let inside = |seen: &&Seen| {
            shifts_s
                .iter()
                .all(|s| self.angle.reaches(seen.from_s - s) && self.angle.reaches(seen.to_s - s))
        };
        let common: Vec<&Seen> = self.seen.iter().filter(inside).collect();
        // With less than a third of them left any shift could look good.
        if common.len() < 30 || common.len() * 3 < self.seen.len() {
            return vec![0.0; shifts_s.len()];
        }
        shifts_s
            .iter()
            .map(|s| {
                let mean = |curve: &Curve, seen: &Seen| {
                    let change = curve.at(seen.to_s - s) - curve.at(seen.from_s - s);
                    change / (seen.to_s - seen.from_s)
                };
                let turns = common
                    .iter()
                    .filter_map(|seen| Some((seen.turn_radps?, mean(&self.angle, seen))));
                let forces = common
                    .iter()
                    .map(|seen| (seen.excess_mps2, mean(&self.force, seen)));
                explained(turns) + explained(forces)
            })
            .collect()
    }
}

/// Logarithm of the likelihood that a straight line explains one by the other, against chance.
fn explained(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (mut n, mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (a, b) in pairs {
        n += 1.0;
        x += a;
        y += b;
        xx += a * a;
        xy += a * b;
        yy += b * b;
    }
    let (xx, xy, yy) = (xx - x * x / n, xy - x * y / n, yy - y * y / n);
    let square = xy * xy / (xx * yy);
    if n < 10.0 || !square.is_finite() {
        return 0.0;
    }
    // Perfect simulated data explain themselves to the last digit.
    -0.5 * n * (1.0 - square).max(1e-4).ln()
}

/// Integral of the specific force's excess over gravity.
fn excess(rates: &[Rate]) -> Vec<(f64, f64)> {
    let mut integral = 0.0;
    rates
        .iter()
        .map(|rate| {
            let force = rate.accel_mps2.norm_squared() / (2.0 * GRAVITY_MPS2);
            integral += (force - 0.5 * GRAVITY_MPS2) * rate.interval_s;
            (rate.time_s, integral)
        })
        .collect()
}

fn seen(log: &Log) -> Vec<Seen> {
    let origin = log.imu[0].time;
    let mut fixes = log.gnss.iter().filter_map(|fix| {
        let velocity = fix.velocity_en_mps?;
        Some((
            fix.time.seconds_since(origin),
            velocity,
            fix.velocity_up_mps,
        ))
    });
    let Some(mut start) = fixes.next() else {
        return Vec::new();
    };
    let mut seen = Vec::new();
    for next in fixes {
        let interval_s = next.0 - start.0;
        if interval_s < 0.95 {
            continue;
        }
        if interval_s < 3.0 {
            let up = start
                .2
                .zip(next.2)
                .map_or(0.0, |(a, b)| (b - a) / interval_s);
            let level = (next.1 - start.1) / interval_s;
            let moving = start.1.norm().min(next.1.norm()) > 2.0;
            seen.push(Seen {
                from_s: start.0,
                to_s: next.0,
                turn_radps: moving.then(|| turned(start.1, next.1) / interval_s),
                excess_mps2: level.norm_squared() / (2.0 * GRAVITY_MPS2) + up,
            });
        }
        start = next;
    }
    seen
}

/// Angle from one vector to the next, counter-clockwise.
pub(super) fn turned(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    from.perp(&to).atan2(from.dot(&to))
}

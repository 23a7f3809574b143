//! Wander of the positions of a receiver against the integral of its own velocities.

use ins_core::GnssFix;
use nalgebra::Vector2;
use serde::Serialize;

use crate::page::table::{Table, heads};
use crate::statistics::{Line, median, rms_of_any};

/// Time lags, s.
const OVER_S: [f64; 3] = [1.0, 60.0, 300.0];
/// Longest gap between fixes, in median intervals, over which velocities are integrated.
const MAX_INTERVALS: f64 = 5.0;
/// Fewest pairs of fixes for a result.
const MIN_PAIRS: usize = 30;
/// Correlation of changes of residual and velocity above which the delay is observable.
const MIN_CORRELATION: f64 = 0.1;

/// Positions less the integral of the velocities, with their relative delay removed: position wander, including
/// the integrated velocity error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wander {
    /// Delay of positions against velocities, s, if observable.
    pub delay_s: Option<f64>,
    /// Root of half the mean square change over 1, 60 and 300 s, per axis, m (structure function; Tatarskii
    /// 1961): the standard deviation, if uncorrelated by then.
    pub level_m: [Option<f64>; 3],
    pub height_m: [Option<f64>; 3],
}

const TITLE: &str = "WANDER of a receiver's positions about the way of its velocities, with what those err by: \
    per axis,\nroot of half the mean square of its change over some seconds, m; and by how much positions are \
    later than\nvelocities, which is taken out.";

/// The wander of the receivers of logs.
pub fn table(logs: &[(String, Wander)]) -> Table {
    let mut header = heads("log | position delay, ms");
    for axis in ["level", "height"] {
        header.extend(OVER_S.map(|over_s| format!("{axis}, {over_s:.0} s")));
    }
    let cell = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let row = |(log, wander): &(String, Wander)| {
        let later_ms = wander.delay_s.map(|delay_s| 1e3 * delay_s);
        let metres = wander.level_m.into_iter().chain(wander.height_m);
        let mut row = vec![log.clone(), cell(later_ms, 0)];
        row.extend(metres.map(|metres| cell(metres, 2)));
        row
    };
    Table::of(TITLE, header, logs.iter().map(row))
}

/// A fix.
#[derive(Clone, Copy, Debug)]
struct Point {
    time_s: f64,
    /// Number of the segment without a gap.
    segment: usize,
    velocity_mps: Vector2<f64>,
    /// Position less the integral of the velocities, since the start of the segment.
    residual_m: Vector2<f64>,
}

impl Wander {
    pub fn of(fixes: &[GnssFix]) -> Option<Self> {
        let level = points(
            fixes,
            |fix| fix.velocity_en_mps,
            |fix, last| {
                let [fix, last] = [fix.geodetic_or(0.0)?, last.geodetic_or(0.0)?];
                Some(fix.enu_from(&last).xy())
            },
        );
        let up = |mps| Vector2::new(mps, 0.0);
        let height = points(
            fixes,
            |fix| fix.velocity_up_mps.map(up),
            |fix, last| Some(up(fix.height_m? - last.height_m?)),
        );
        let velocity_and_residual = pairs(&level, OVER_S[0]).flat_map(|[from, to]| {
            let (gained, change) = (
                to.velocity_mps - from.velocity_mps,
                to.residual_m - from.residual_m,
            );
            [(gained.x, change.x), (gained.y, change.y)]
        });
        let line = Line::from_origin(velocity_and_residual);
        let delay_s = (line.correlation.abs() > MIN_CORRELATION).then_some(-line.slope);
        let delay_or_zero_s = delay_s.unwrap_or(0.0);
        let wander = Self {
            delay_s,
            level_m: OVER_S.map(|over_s| changes(&level, over_s, delay_or_zero_s, 2.0)),
            height_m: OVER_S.map(|over_s| changes(&height, over_s, delay_or_zero_s, 1.0)),
        };
        wander.level_m[0].map(|_| wander)
    }
}

/// Fixes with a velocity and a displacement from the fix before, without the first of each segment.
fn points(
    fixes: &[GnssFix],
    velocity: impl Fn(&GnssFix) -> Option<Vector2<f64>>,
    moved_m: impl Fn(&GnssFix, &GnssFix) -> Option<Vector2<f64>>,
) -> Vec<Point> {
    let interval_s = |pair: &[GnssFix]| pair[1].time.seconds_since(pair[0].time);
    let longest_s = MAX_INTERVALS * median(fixes.windows(2).map(interval_s));
    let point_after = |last: Option<Point>, index: usize, pair: &[GnssFix]| {
        let seconds = interval_s(pair);
        let moved_m = moved_m(&pair[1], &pair[0])?;
        let (from, to) = (velocity(&pair[0])?, velocity(&pair[1])?);
        let before_m = last.map_or_else(Vector2::zeros, |last| last.residual_m);
        (0.0..longest_s).contains(&seconds).then(|| Point {
            time_s: pair[1].time.seconds_since(fixes[0].time),
            segment: last.map_or(index, |last| last.segment),
            velocity_mps: to,
            residual_m: before_m + moved_m - (from + to) * (0.5 * seconds),
        })
    };
    let mut last = None;
    let pairs = fixes.windows(2).enumerate();
    let point = |(index, pair)| {
        last = point_after(last, index, pair);
        last
    };
    pairs.filter_map(point).collect()
}

/// Pairs of each fix and the first one later by the lag, in the same segment.
fn pairs(points: &[Point], over_s: f64) -> impl Iterator<Item = [&Point; 2]> {
    let mut later = 0;
    points.iter().filter_map(move |from| {
        // Tolerance of rounding, as of stamps in tenths of a second.
        let is_earlier = |to: &Point| to.time_s - from.time_s < over_s - 1e-6;
        while points.get(later).is_some_and(is_earlier) {
            later += 1;
        }
        let to = points.get(later)?;
        (to.segment == from.segment).then_some([from, to])
    })
}

fn changes(points: &[Point], over_s: f64, delay_s: f64, axes: f64) -> Option<f64> {
    let change = |[from, to]: [&Point; 2]| {
        let gained_mps = to.velocity_mps - from.velocity_mps;
        (to.residual_m - from.residual_m + delay_s * gained_mps).norm() / (2.0 * axes).sqrt()
    };
    let changes: Vec<f64> = pairs(points, over_s).map(change).collect();
    rms_of_any(changes.iter().copied()).filter(|_| changes.len() >= MIN_PAIRS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Grade;
    use crate::sim::SimulatedDrive;
    use crate::sim::drive::{DriveConfig, simulate};
    use crate::sim::receiver::Correlated;

    /// An hour of driving with position wander of 100 s correlation time, and smoothed velocities.
    fn drive(wander_m: f64, smoothing_s: f64) -> SimulatedDrive {
        let mut drive = DriveConfig::new(3, Grade::Mems, 60.0);
        let gnss = &mut drive.recording.errors.gnss;
        gnss.velocity_sigma_mps = 0.01;
        gnss.horizontal_sigma_m = 0.05;
        gnss.vertical_sigma_m = 0.05;
        let wander = |sigma| Correlated {
            sigma,
            time_s: 100.0,
        };
        gnss.habits.horizontal = wander(wander_m);
        gnss.habits.vertical = wander(1.5 * wander_m);
        gnss.habits.smoothing_s = smoothing_s;
        gnss.habits.smooths_position = false;
        simulate(&drive)
    }

    #[test]
    fn simulated_wander_is_measured() {
        let seen = Wander::of(&drive(1.2, 0.0).gnss).unwrap();
        for (heights, seen) in [(1.0, seen.level_m), (1.5, seen.height_m)] {
            for (over_s, seen) in OVER_S.into_iter().zip(seen) {
                let correlation = libm::exp(-over_s / 100.0);
                let wander = heights * 1.2 * (1.0 - correlation).sqrt();
                let expected = libm::hypot(wander, 0.05);
                // An hour has about twenty independent changes over 300 s: their mean square is good to a third.
                let ratio = seen.unwrap() / expected;
                assert!((0.75..1.3).contains(&ratio), "{over_s} s: {ratio:.2}");
            }
        }
    }

    #[test]
    fn delay_is_not_taken_for_wander() {
        let drive = drive(0.0, 0.5);
        let seen = Wander::of(&drive.gnss).unwrap();
        let earlier_s = -seen.delay_s.unwrap();
        assert!(
            (earlier_s - drive.errors.gnss_lag_s).abs() < 0.02,
            "{seen:?}"
        );
        // White noise, and the integrated velocity noise of 0.01 m/s over five minutes.
        assert!(seen.level_m.iter().flatten().all(|m| *m < 0.25), "{seen:?}");
    }

    #[test]
    fn a_segment_ends_where_fixes_are_missing() {
        let mut fixes = drive(0.0, 0.0).gnss;
        for fix in fixes.iter_mut().skip(100).step_by(100) {
            fix.velocity_en_mps = None;
        }
        let seen = Wander::of(&fixes).unwrap();
        assert!(seen.level_m[0].is_some() && seen.level_m[2].is_none());
        assert_eq!(Wander::of(&fixes[..2]), None);
    }
}

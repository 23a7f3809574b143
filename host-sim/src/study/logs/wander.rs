//! How far the positions of a receiver wander from the way that its own velocities make.

use ins_core::GnssFix;
use nalgebra::Vector2;
use serde::Serialize;

use crate::page::table::{Table, heads};
use crate::statistics::{Line, median, rms_of_any};

/// Times over which it is looked at, s.
const OVER_S: [f64; 3] = [1.0, 60.0, 300.0];
/// Usual times between fixes that a way is followed over: more have passed unseen.
const FOLLOWED: f64 = 5.0;
/// Fewer pairs of fixes say nothing.
const LEAST_PAIRS: usize = 30;
/// Correlation of changes of position with those of speed above which these show a delay.
const SHOWN: f64 = 0.1;

/// Positions less the integral of the velocities, and less what is only late: what a position wanders by, with
/// what velocities err by. None where a log has too little of both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wander {
    /// By how much positions are later than velocities, s, where changes of speed show it.
    pub delay_s: Option<f64>,
    /// Standard deviation per axis that would change as much in 1, 60 and 300 s, were it forgotten by then, m:
    /// half the mean square is that of a change (structure function; Tatarskii 1961).
    pub level_m: [Option<f64>; 3],
    pub height_m: [Option<f64>; 3],
}

const TITLE: &str = "WANDER of a receiver's positions about the way of its velocities, with what those err by: \
    per axis,\nroot of half the mean square of its change over some seconds, m; and by how much positions are \
    later than\nvelocities, which is taken out.";

/// What the receivers of logs do.
pub fn table(logs: &[(String, Wander)]) -> Table {
    let mut header = heads("log | position delay, ms");
    for what in ["level", "height"] {
        header.extend(OVER_S.map(|over_s| format!("{what}, {over_s:.0} s")));
    }
    let known = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let row = |(log, wander): &(String, Wander)| {
        let later_ms = wander.delay_s.map(|delay_s| 1e3 * delay_s);
        let metres = wander.level_m.into_iter().chain(wander.height_m);
        let mut row = vec![log.clone(), known(later_ms, 0)];
        row.extend(metres.map(|metres| known(metres, 2)));
        row
    };
    Table::of(TITLE, header, logs.iter().map(row))
}

/// A fix.
#[derive(Clone, Copy, Debug)]
struct Point {
    time_s: f64,
    /// Which way without a break it is on.
    way: usize,
    velocity_mps: Vector2<f64>,
    /// Its position less the way so far.
    off_m: Vector2<f64>,
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
        let late = pairs(&level, OVER_S[0]).flat_map(|[from, to]| {
            let (gained, off) = (to.velocity_mps - from.velocity_mps, to.off_m - from.off_m);
            [(gained.x, off.x), (gained.y, off.y)]
        });
        let line = Line::from_origin(late);
        let delay_s = (line.correlation.abs() > SHOWN).then_some(-line.slope);
        let late_s = delay_s.unwrap_or(0.0);
        let wander = Self {
            delay_s,
            level_m: OVER_S.map(|over_s| changes(&level, over_s, late_s, 2.0)),
            height_m: OVER_S.map(|over_s| changes(&height, over_s, late_s, 1.0)),
        };
        wander.level_m[0].map(|_| wander)
    }
}

/// Fixes that have a velocity, and how far they are from the one before, but for the first of each way.
fn points(
    fixes: &[GnssFix],
    velocity: impl Fn(&GnssFix) -> Option<Vector2<f64>>,
    moved_m: impl Fn(&GnssFix, &GnssFix) -> Option<Vector2<f64>>,
) -> Vec<Point> {
    let after_s = |pair: &[GnssFix]| pair[1].time.seconds_since(pair[0].time);
    let longest_s = FOLLOWED * median(fixes.windows(2).map(after_s));
    let after = |last: Option<Point>, index: usize, pair: &[GnssFix]| {
        let seconds = after_s(pair);
        let moved_m = moved_m(&pair[1], &pair[0])?;
        let (from, to) = (velocity(&pair[0])?, velocity(&pair[1])?);
        let before_m = last.map_or_else(Vector2::zeros, |last| last.off_m);
        (0.0..longest_s).contains(&seconds).then(|| Point {
            time_s: pair[1].time.seconds_since(fixes[0].time),
            way: last.map_or(index, |last| last.way),
            velocity_mps: to,
            off_m: before_m + moved_m - (from + to) * (0.5 * seconds),
        })
    };
    let mut last = None;
    let pairs = fixes.windows(2).enumerate();
    let point = |(index, pair)| {
        last = after(last, index, pair);
        last
    };
    pairs.filter_map(point).collect()
}

/// Each fix with the first of the same way that comes so much later.
fn pairs(points: &[Point], over_s: f64) -> impl Iterator<Item = [&Point; 2]> {
    let mut later = 0;
    points.iter().filter_map(move |from| {
        // Stamps of a tenth of a second are none in binary.
        let is_early = |to: &Point| to.time_s - from.time_s < over_s - 1e-6;
        while points.get(later).is_some_and(is_early) {
            later += 1;
        }
        let to = points.get(later)?;
        (to.way == from.way).then_some([from, to])
    })
}

fn changes(points: &[Point], over_s: f64, late_s: f64, axes: f64) -> Option<f64> {
    let change = |[from, to]: [&Point; 2]| {
        let gained_mps = to.velocity_mps - from.velocity_mps;
        (to.off_m - from.off_m + late_s * gained_mps).norm() / (2.0 * axes).sqrt()
    };
    let changes: Vec<f64> = pairs(points, over_s).map(change).collect();
    rms_of_any(changes.iter().copied()).filter(|_| changes.len() >= LEAST_PAIRS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Grade;
    use crate::sim::SimulatedDrive;
    use crate::sim::drive::{DriveConfig, simulate};
    use crate::sim::receiver::Correlated;

    /// An hour's drive whose positions wander, by so much in 100 s, and whose velocities are smoothed.
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
    fn what_a_receiver_was_given_is_seen() {
        let seen = Wander::of(&drive(1.2, 0.0).gnss).unwrap();
        for (heights, seen) in [(1.0, seen.level_m), (1.5, seen.height_m)] {
            for (over_s, seen) in OVER_S.into_iter().zip(seen) {
                let left = libm::exp(-over_s / 100.0);
                let wander = heights * 1.2 * (1.0 - left).sqrt();
                let expected = libm::hypot(wander, 0.05);
                // An hour has some twenty of the longest changes: their mean square is good to a third.
                let ratio = seen.unwrap() / expected;
                assert!((0.75..1.3).contains(&ratio), "{over_s} s: {ratio:.2}");
            }
        }
    }

    #[test]
    fn what_is_late_is_not_taken_for_wander() {
        let drive = drive(0.0, 0.5);
        let seen = Wander::of(&drive.gnss).unwrap();
        let earlier_s = -seen.delay_s.unwrap();
        assert!(
            (earlier_s - drive.errors.gnss_lag_s).abs() < 0.02,
            "{seen:?}"
        );
        // The white part, and what the velocities' noise of 0.01 m/s comes to in five minutes.
        assert!(seen.level_m.iter().flatten().all(|m| *m < 0.25), "{seen:?}");
    }

    #[test]
    fn a_way_ends_where_fixes_are_missing() {
        let mut fixes = drive(0.0, 0.0).gnss;
        for fix in fixes.iter_mut().skip(100).step_by(100) {
            fix.velocity_en_mps = None;
        }
        let seen = Wander::of(&fixes).unwrap();
        assert!(seen.level_m[0].is_some() && seen.level_m[2].is_none());
        assert_eq!(Wander::of(&fixes[..2]), None);
    }
}

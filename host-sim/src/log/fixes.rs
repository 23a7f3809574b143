//! Known defects of fixes by loggers and receivers, and their repair.

use std::ops::RangeInclusive;

use ins_core::GnssFix;
use ins_core::earth::LatLon;
use nalgebra::Vector2;

use super::Log;
use super::error::{Findings, LogError};
use super::series::median;
use crate::statistics::Line;

/// Least speed of certain motion, m/s: ten times a receiver's noise.
const MOVING_MPS: f64 = 1.0;
/// Distance travelled with one position that shows it is stuck, m: the coarsest resolution is 1e-5 deg.
const STUCK_DISTANCE_M: f64 = 2.0;

/// Heights at which there are vehicles and aircraft, m: from the shores of the Dead Sea.
const HEIGHTS_M: RangeInclusive<f64> = -500.0..=30_000.0;

/// Longest time without fixes at the end that needs no warning, s: a car in its garage.
const EARLY_END_S: f64 = 60.0;

const NO_FIX: &str = "the receiver never had a fix";

/// Leaves out values that are no measurements, and corrects the sign of vertical velocity.
pub(super) fn repair_fixes(log: &mut Log, findings: &mut Findings) -> Result<(), LogError> {
    let mut repair = Repair {
        fixes: &mut log.gnss,
        findings,
    };
    repair.rows_without_fix()?;
    repair.impossible_heights();
    repair.repeated_fixes();
    repair.stuck_positions();
    repair.repeated_velocities();
    repair.unmeasured_climb();
    repair.climb_sign_and_unit();
    repair.differenced_velocity();
    repair.large_sigmas();
    repair.missing_parts()
}

/// A receiver's file that breaks off: what is compared and estimated then stands on a part of the recording.
/// The fixes must be on the clock of the samples.
pub(super) fn warn_of_early_end(log: &Log, findings: &mut Findings) {
    let (Some(fix), Some(sample)) = (log.gnss.last(), log.imu.last()) else {
        return;
    };
    let after_s = sample.time.seconds_since(fix.time);
    if after_s > EARLY_END_S && after_s > 0.1 * log.duration_s() {
        let found = format!("the last one {after_s:.0} s before the last sample");
        let cause = "the file of the receiver breaks off, or it had no signals any more: from there on \
                     nothing corrects the INS";
        findings.warn(findings.gnss("t_s", "fixes until the samples end", found, cause));
    }
}

struct Repair<'a, 'b> {
    fixes: &'a mut Vec<GnssFix>,
    findings: &'a mut Findings<'b>,
}

impl Repair<'_, '_> {
    fn warn(&mut self, column: &str, expected: &str, found: String, cause: &str) {
        let defect = self.findings.gnss(column, expected, found, cause);
        self.findings.warn(defect);
    }

    fn count(&self, which: impl Fn(&GnssFix) -> bool) -> usize {
        self.fixes.iter().filter(|fix| which(fix)).count()
    }

    /// Number of pairs of successive fixes.
    fn count_pairs(&self, which: impl Fn(&GnssFix, &GnssFix) -> bool) -> usize {
        let pairs = self.fixes.windows(2);
        pairs.filter(|pair| which(&pair[0], &pair[1])).count()
    }

    /// Zero latitude and longitude mean no fix, unless all fixes have them.
    fn rows_without_fix(&mut self) -> Result<(), LogError> {
        let is_null = |fix: &GnssFix| fix.position == Some(LatLon::default());
        let count = self.count(|fix| is_null(fix));
        let still = |fix: &GnssFix| fix.velocity_en_mps.is_none_or(|v| v == Vector2::zeros());
        if count > 1 && self.fixes.iter().all(|fix| is_null(fix) && still(fix)) {
            let found = "zeros in every row";
            let columns = "lat_deg, lon_deg, ve, vn";
            return Err(self.findings.gnss(columns, "a fix", found, NO_FIX));
        }
        if count == 0 || count == self.count(|fix| fix.position.is_some()) {
            return Ok(());
        }
        for fix in self.fixes.iter_mut().filter(|fix| is_null(fix)) {
            // Without a fix velocity and height are invalid, too.
            *fix = GnssFix {
                time: fix.time,
                ..GnssFix::default()
            };
        }
        self.drop_empty();
        let found = format!("latitude and longitude 0 in {count} rows");
        let cause = "rows of zeros where the receiver had no fix; left out";
        self.warn("lat_deg, lon_deg", "positions of the drive", found, cause);
        Ok(())
    }

    /// Heights where nothing drives or flies: what loggers write for none, as -9999, 32767 or 99999.
    fn impossible_heights(&mut self) {
        let impossible = |fix: &GnssFix| fix.height_m.filter(|h| !HEIGHTS_M.contains(h));
        let Some(first_m) = self.fixes.iter().find_map(impossible) else {
            return;
        };
        let (count, all) = (
            self.count(|fix| impossible(fix).is_some()),
            self.count(|fix| fix.height_m.is_some()),
        );
        for fix in self
            .fixes
            .iter_mut()
            .filter(|fix| impossible(fix).is_some())
        {
            fix.height_m = None;
        }
        self.drop_empty();
        let found = format!("{count} of {all} beyond, the first {first_m}");
        let cause =
            "a placeholder where there was no fix, as -9999, a bad fix, or another unit; left out";
        self.warn("h_m", "heights from -500 to 30000 m", found, cause);
    }

    fn drop_empty(&mut self) {
        self.fixes.retain(|fix| {
            fix.position.is_some()
                || fix.height_m.is_some()
                || fix.velocity_en_mps.is_some()
                || fix.velocity_up_mps.is_some()
        });
    }

    /// The same fix under several stamps: a logger faster than its receiver.
    fn repeated_fixes(&mut self) {
        let same = |a: &GnssFix, b: &GnssFix| {
            a.position.is_some() && GnssFix { time: a.time, ..*b } == *a && moves(a)
        };
        if self.count_pairs(same) == 0 {
            return;
        }
        // At rest new fixes may equal the last, but arrive at no higher rate; the next may be a little late.
        let changed = (self.fixes.windows(2)).filter(|w| moves(&w[0]) && !same(&w[0], &w[1]));
        let changes: Vec<f64> = changed.map(|w| w[1].time.as_seconds()).collect();
        let period_s = median(changes.windows(2).map(|w| w[1] - w[0]));
        let before = self.fixes.len();
        let mut last: Option<GnssFix> = None;
        self.fixes.retain(|fix| {
            let stale = last.is_some_and(|last| {
                let since_s = fix.time.seconds_since(last.time);
                let time = fix.time;
                GnssFix { time, ..last } == *fix && (moves(fix) || since_s < 1.5 * period_s)
            });
            if !stale {
                last = Some(*fix);
            }
            !stale
        });
        let found = format!(
            "{} of {before} like the one before",
            before - self.fixes.len()
        );
        let cause = "each fix written several times, or a receiver that was stuck; only the first \
                     is used";
        let expected = "a new fix in every row";
        self.warn("lat_deg, lon_deg, ve, vn", expected, found, cause);
    }

    /// Positions that do not change while velocity is not zero.
    fn stuck_positions(&mut self) {
        let mut stuck = Vec::new();
        let mut run: Vec<usize> = Vec::new();
        let mut travelled = Vector2::zeros();
        for index in 1..self.fixes.len() {
            let (last, fix) = (self.fixes[index - 1], self.fixes[index]);
            let interval_s = fix.time.seconds_since(last.time);
            let velocity = fix.velocity_en_mps.unwrap_or_default();
            if fix.position.is_none() || fix.position != last.position || interval_s > 3.0 {
                if travelled.norm() > STUCK_DISTANCE_M {
                    stuck.append(&mut run);
                }
                run.clear();
                travelled = Vector2::zeros();
                continue;
            }
            run.push(index);
            travelled += interval_s * velocity;
        }
        if travelled.norm() > STUCK_DISTANCE_M {
            stuck.append(&mut run);
        }
        if stuck.is_empty() {
            return;
        }
        for &index in &stuck {
            self.fixes[index].position = None;
            self.fixes[index].height_m = None;
        }
        self.drop_empty();
        let found = format!("{} repeated ones in motion", stuck.len());
        let cause = "positions come less often than velocities, or stopped coming; the repeated \
                     ones are left out";
        let expected = "positions that follow the motion";
        self.warn("lat_deg, lon_deg", expected, found, cause);
    }

    /// Velocities at a lower rate than positions.
    fn repeated_velocities(&mut self) {
        let same = |a: &GnssFix, b: &GnssFix| {
            a.velocity_en_mps == b.velocity_en_mps && a.position != b.position && moves(a)
        };
        let (moving, repeated) = (self.count_pairs(|a, _| moves(a)), self.count_pairs(same));
        // Written twice half of all are repeated; a coarse resolution alone does not reach this.
        if moving < 20 || (repeated as f64) < 0.4 * moving as f64 {
            return;
        }
        let mut last = self.fixes[0].velocity_en_mps;
        for fix in self.fixes.iter_mut().skip(1) {
            if fix.velocity_en_mps == last && moves(fix) {
                fix.velocity_en_mps = None;
                fix.velocity_up_mps = None;
            } else {
                last = fix.velocity_en_mps;
            }
        }
        let found = format!("the one before in {repeated} of {moving} rows");
        let cause = "velocities come less often than positions; the repeated ones are left out";
        self.warn("ve, vn", "a new velocity in every row", found, cause);
    }

    /// Vertical velocity that is not measured, but zero.
    fn unmeasured_climb(&mut self) {
        let climbs = self.count(|fix| fix.velocity_up_mps.is_some());
        let zeros = self.count(|fix| fix.velocity_up_mps == Some(0.0));
        let heights: Vec<f64> = self.fixes.iter().filter_map(|f| f.height_m).collect();
        let range = heights.iter().copied().fold(f64::MIN, f64::max)
            - heights.iter().copied().fold(f64::MAX, f64::min);
        // A range of three times the height noise of a single-frequency receiver.
        if climbs < 20 || heights.len() < 20 || range < 10.0 || zeros < climbs {
            return;
        }
        for fix in self.fixes.iter_mut() {
            fix.velocity_up_mps = None;
        }
        let found = format!("zero in every row, while h_m goes over {range:.0} m");
        let cause = "written for a receiver that measures none; left out";
        self.warn("vu", "vertical velocity, up positive", found, cause);
    }

    /// Vertical velocity with down positive, or in another unit.
    fn climb_sign_and_unit(&mut self) {
        let Some(fit) = self.climb_against_heights() else {
            return;
        };
        let (slope, correlation) = (fit.slope, fit.correlation);
        let found = format!(
            "heights that change by {slope:.2} times its integral (correlation {correlation:.2})"
        );
        let expected = "vertical velocity, up positive, in m/s";
        if correlation < -0.7 {
            for fix in self.fixes.iter_mut() {
                fix.velocity_up_mps = fix.velocity_up_mps.map(|up| -up);
            }
            self.warn("vu", expected, found, "positive down: its sign is changed");
        } else if correlation > 0.8 && !(0.67..1.5).contains(&slope) {
            let cause = "another unit, or heights of another source";
            self.warn("vu", expected, found, cause);
        }
    }

    /// Fit of height steps over integrals of vertical velocity; none without climbs.
    fn climb_against_heights(&self) -> Option<Line> {
        const STEP_S: f64 = 5.0;
        let mut steps = Vec::new();
        let mut start = self.fixes.first()?;
        let mut integral_m = 0.0;
        for pair in self.fixes.windows(2) {
            let interval_s = pair[1].time.seconds_since(pair[0].time);
            let up = pair[0].velocity_up_mps.zip(pair[1].velocity_up_mps);
            let (Some((a, b)), Some(from), Some(to), true) =
                (up, start.height_m, pair[1].height_m, interval_s < 3.0)
            else {
                (start, integral_m) = (&pair[1], 0.0);
                continue;
            };
            integral_m += 0.5 * (a + b) * interval_s;
            if pair[1].time.seconds_since(start.time) >= STEP_S {
                steps.push((integral_m, to - from));
                (start, integral_m) = (&pair[1], 0.0);
            }
        }
        // A minute of climbs by more than 1.5 m, above the noise of heights.
        let climbing = steps.iter().filter(|s| s.0.abs() > 1.5).count();
        (climbing >= 12).then(|| Line::from_origin(steps.into_iter()))
    }

    /// Velocity that is a difference of positions: late by half of their interval, and with their noise.
    fn differenced_velocity(&mut self) {
        let difference = |span: usize, of: fn(Vector2<f64>, Vector2<f64>) -> Vector2<f64>| {
            let pairs = self.fixes.windows(span + 1).filter_map(|window| {
                let (first, last) = (&window[0], &window[span]);
                let moved = last.geodetic_or(0.0)?.enu_from(&first.geodetic_or(0.0)?);
                let mean = moved.xy() / last.time.seconds_since(first.time);
                Some((mean - of(first.velocity_en_mps?, last.velocity_en_mps?)).norm())
            });
            let differences: Vec<f64> = pairs.collect();
            (!differences.is_empty()).then(|| median(differences.into_iter()))
        };
        // Independent velocities differ from those by positions by the noise of both, which decreases with
        // the span, whichever end they are of.
        let differenced = (1..=10).filter_map(|span| {
            let central = difference(span, |before, after| 0.5 * (before + after))?;
            let backward = difference(span, |_, after| after)?;
            (central > 0.02 && backward < 0.1 * central).then_some(backward)
        });
        let enough = self.fixes.len() >= 50;
        let Some(backward) = differenced.min_by(f64::total_cmp).filter(|_| enough) else {
            return;
        };
        let found = format!("the difference of two positions, to {backward:.4} m/s");
        let cause = "computed, not measured: it is late by half of their interval and has the \
                     noise of positions; latency found here is that of such velocities";
        let expected = "velocity as the receiver measures it";
        self.warn("ve, vn", expected, found, cause);
    }

    /// Sigmas too large for a receiver with a fix.
    fn large_sigmas(&mut self) {
        type Part = fn(&GnssFix) -> Option<f64>;
        let parts: [(&str, &str, f64, Part); 4] = [
            ("sd_n, sd_e", "m", 100.0, |fix| fix.sigma.position_m),
            ("sd_u", "m", 100.0, |fix| fix.sigma.height_m),
            ("sd_v", "m/s", 10.0, |fix| fix.sigma.velocity_mps),
            ("sd_vu", "m/s", 10.0, |fix| fix.sigma.velocity_up_mps),
        ];
        for (column, unit, max, part) in parts {
            let median_sigma = median(self.fixes.iter().filter_map(part));
            if median_sigma > max {
                let expected = format!("spreads in {unit}, mostly below {max}");
                let found = format!("a median of {median_sigma:.0} {unit}");
                let cause = format!("m{unit} for {unit}? Fixes are weighted by it");
                self.warn(column, &expected, found, &cause);
            }
        }
    }

    fn missing_parts(&mut self) -> Result<(), LogError> {
        if self.fixes.is_empty() {
            return Err(self.findings.gnss("", "a fix", "none", NO_FIX));
        }
        if self.count(|fix| fix.position.is_some()) == 0 {
            let cause = "gravity and Earth rate depend on latitude, and alignment needs both: write \
                         the position, to a kilometre, into the first row";
            let (columns, expected) = ("lat_deg, lon_deg", "one position at least");
            return Err(self.findings.gnss(columns, expected, "none", cause));
        }
        if self.count(|fix| fix.velocity_en_mps.is_some()) == 0 {
            let cause = "the receiver writes none: estimates are by positions alone, later and less \
                         accurate";
            self.warn("ve, vn", "velocities", "none".to_owned(), cause);
        }
        Ok(())
    }
}

fn moves(fix: &GnssFix) -> bool {
    fix.velocity_en_mps.is_some_and(|v| v.norm() > MOVING_MPS)
}

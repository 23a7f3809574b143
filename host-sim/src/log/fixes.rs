//! Fixes that a logger or a receiver made worse than they are, mended where that is certain.

use ins_core::GnssFix;
use ins_core::earth::LatLon;
use nalgebra::Vector2;

use super::Log;
use super::error::{Findings, LogError};
use super::typical::median;
use crate::statistics::Line;

/// Speed above which a vehicle moves beyond doubt, m/s: ten times a receiver's noise.
const MOVING_MPS: f64 = 1.0;
/// Way that no receiver can go without another position, m: the coarsest ones write 1e-5 deg.
const UNSEEN_M: f64 = 2.0;

const NEVER: &str = "the receiver never had a fix";

/// Leaves out what is no measurement, turns what is upside down.
pub(super) fn mend_fixes(log: &mut Log, findings: &mut Findings) -> Result<(), LogError> {
    let mut mend = Mend {
        fixes: &mut log.gnss,
        findings,
    };
    mend.rows_without_fix()?;
    mend.repeated_fixes();
    mend.stuck_positions();
    mend.repeated_velocities();
    mend.empty_climb();
    mend.climb_of_the_wrong_sign();
    mend.differenced_velocity();
    mend.wide_spreads();
    mend.what_is_missing()
}

struct Mend<'a, 'b> {
    fixes: &'a mut Vec<GnssFix>,
    findings: &'a mut Findings<'b>,
}

impl Mend<'_, '_> {
    fn warn(&mut self, column: &str, expected: &str, found: String, cause: &str) {
        let defect = self.findings.gnss(column, expected, found, cause);
        self.findings.warn(defect);
    }

    fn count(&self, which: impl Fn(&GnssFix) -> bool) -> usize {
        self.fixes.iter().filter(|fix| which(fix)).count()
    }

    /// Of fixes and the next.
    fn count_pairs(&self, which: impl Fn(&GnssFix, &GnssFix) -> bool) -> usize {
        let pairs = self.fixes.windows(2);
        pairs.filter(|pair| which(&pair[0], &pair[1])).count()
    }

    /// Zero latitude and longitude stand for no fix, unless the whole drive is there.
    fn rows_without_fix(&mut self) -> Result<(), LogError> {
        let none = |fix: &GnssFix| fix.position == Some(LatLon::default());
        let count = self.count(|fix| none(fix));
        let still = |fix: &GnssFix| fix.velocity_en_mps.is_none_or(|v| v == Vector2::zeros());
        if count > 1 && self.fixes.iter().all(|fix| none(fix) && still(fix)) {
            let found = "zeros in every row";
            let columns = "lat_deg, lon_deg, ve, vn";
            return Err(self.findings.gnss(columns, "a fix", found, NEVER));
        }
        if count == 0 || count == self.count(|fix| fix.position.is_some()) {
            return Ok(());
        }
        for fix in self.fixes.iter_mut().filter(|fix| none(fix)) {
            // Velocity and height of a receiver without a position are none either.
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
        // At rest fixes may well be equal, but come no faster.
        let news = (self.fixes.windows(2)).filter(|w| moves(&w[0]) && !same(&w[0], &w[1]));
        let changes: Vec<f64> = news.map(|w| w[1].time.as_seconds()).collect();
        let period_s = median(changes.windows(2).map(|w| w[1] - w[0]));
        let before = self.fixes.len();
        let mut last: Option<GnssFix> = None;
        self.fixes.retain(|fix| {
            let stale = last.is_some_and(|last| {
                let since_s = fix.time.seconds_since(last.time);
                let time = fix.time;
                GnssFix { time, ..last } == *fix && (moves(fix) || since_s < 0.9 * period_s)
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

    /// Positions that stand still while velocity does not.
    fn stuck_positions(&mut self) {
        let mut stuck = Vec::new();
        let mut run: Vec<usize> = Vec::new();
        let mut unseen = Vector2::zeros();
        for index in 1..self.fixes.len() {
            let (last, fix) = (self.fixes[index - 1], self.fixes[index]);
            let interval_s = fix.time.seconds_since(last.time);
            let velocity = fix.velocity_en_mps.unwrap_or_default();
            if fix.position.is_none() || fix.position != last.position || interval_s > 3.0 {
                if unseen.norm() > UNSEEN_M {
                    stuck.append(&mut run);
                }
                run.clear();
                unseen = Vector2::zeros();
                continue;
            }
            run.push(index);
            unseen += interval_s * velocity;
        }
        if unseen.norm() > UNSEEN_M {
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

    /// Velocities that come less often than positions.
    fn repeated_velocities(&mut self) {
        let same = |a: &GnssFix, b: &GnssFix| {
            a.velocity_en_mps == b.velocity_en_mps && a.position != b.position && moves(a)
        };
        let (moving, repeated) = (self.count_pairs(|a, _| moves(a)), self.count_pairs(same));
        // Written twice they are half of all; a coarse unit alone never gets there.
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

    /// Vertical velocity that is never measured.
    fn empty_climb(&mut self) {
        let climbs = self.count(|fix| fix.velocity_up_mps.is_some());
        let zeros = self.count(|fix| fix.velocity_up_mps == Some(0.0));
        let heights: Vec<f64> = self.fixes.iter().filter_map(|f| f.height_m).collect();
        let range = heights.iter().copied().fold(f64::MIN, f64::max)
            - heights.iter().copied().fold(f64::MAX, f64::min);
        // Three times the noise of a plain receiver's heights.
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

    /// Vertical velocity counted downwards, or in another unit.
    fn climb_of_the_wrong_sign(&mut self) {
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
            self.warn("vu", expected, found, "it counts down; its sign is turned");
        } else if correlation > 0.8 && !(0.67..1.5).contains(&slope) {
            let cause = "another unit, or heights of another source";
            self.warn("vu", expected, found, cause);
        }
    }

    /// Height steps over integrals of vertical velocity; none where nothing climbs.
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
        // A minute of climbs of 1.5 m and more: what heights show beyond their noise.
        let climbing = steps.iter().filter(|s| s.0.abs() > 1.5).count();
        (climbing >= 12).then(|| Line::from_origin(steps.into_iter()))
    }

    /// Velocity that is the difference of positions: late by half of what lies between, with their
    /// noise.
    fn differenced_velocity(&mut self) {
        let against = |apart: usize, of: fn(Vector2<f64>, Vector2<f64>) -> Vector2<f64>| {
            let pairs = self.fixes.windows(apart + 1).filter_map(|window| {
                let (first, last) = (&window[0], &window[apart]);
                let moved = last.geodetic_or(0.0)?.enu_from(&first.geodetic_or(0.0)?);
                let mean = moved.xy() / last.time.seconds_since(first.time);
                Some((mean - of(first.velocity_en_mps?, last.velocity_en_mps?)).norm())
            });
            let off: Vec<f64> = pairs.collect();
            (!off.is_empty()).then(|| median(off.into_iter()))
        };
        // Independent velocities differ from those of positions by the noise of both, the less the further
        // these are apart, whichever end they are of.
        let differenced = (1..=10).filter_map(|apart| {
            let central = against(apart, |before, after| 0.5 * (before + after))?;
            let backward = against(apart, |_, after| after)?;
            (central > 0.02 && backward < 0.1 * central).then_some(backward)
        });
        let many = self.fixes.len() >= 50;
        let Some(backward) = differenced.min_by(f64::total_cmp).filter(|_| many) else {
            return;
        };
        let found = format!("the difference of two positions, to {backward:.4} m/s");
        let cause = "computed, not measured: it comes late by half of what lies between and has the \
                     noise of positions; latency found here is that of such velocities";
        let expected = "velocity as the receiver measures it";
        self.warn("ve, vn", expected, found, cause);
    }

    /// Spreads that no receiver with a fix has.
    fn wide_spreads(&mut self) {
        type Part = fn(&GnssFix) -> Option<f64>;
        let parts: [(&str, &str, f64, Part); 4] = [
            ("sd_n, sd_e", "m", 100.0, |fix| fix.sigma.position_m),
            ("sd_u", "m", 100.0, |fix| fix.sigma.height_m),
            ("sd_v", "m/s", 10.0, |fix| fix.sigma.velocity_mps),
            ("sd_vu", "m/s", 10.0, |fix| fix.sigma.velocity_up_mps),
        ];
        for (column, unit, most, part) in parts {
            let typical = median(self.fixes.iter().filter_map(part));
            if typical > most {
                let expected = format!("spreads in {unit}, mostly below {most}");
                let found = format!("a median of {typical:.0} {unit}");
                let cause = format!("m{unit} for {unit}? Fixes weigh by it");
                self.warn(column, &expected, found, &cause);
            }
        }
    }

    fn what_is_missing(&mut self) -> Result<(), LogError> {
        if self.fixes.is_empty() {
            return Err(self.findings.gnss("", "a fix", "none", NEVER));
        }
        if self.count(|fix| fix.position.is_some()) == 0 {
            let cause = "gravity and the Earth's rate hang on the latitude, and without nothing can \
                         begin: write the place, to a kilometre, into the first row";
            let (columns, expected) = ("lat_deg, lon_deg", "one position at least");
            return Err(self.findings.gnss(columns, expected, "none", cause));
        }
        if self.count(|fix| fix.velocity_en_mps.is_some()) == 0 {
            let cause = "the receiver writes none: what positions alone show is found, later and \
                         less exactly";
            self.warn("ve, vn", "velocities", "none".to_owned(), cause);
        }
        Ok(())
    }
}

fn moves(fix: &GnssFix) -> bool {
    fix.velocity_en_mps.is_some_and(|v| v.norm() > MOVING_MPS)
}

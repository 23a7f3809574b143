//! Why a quantity does not reach its target.

use super::quantities::{Goal, Kind};
use super::{
    DrivenUnit, GoalStatus, LOOKAHEAD, Manoeuvre, Search, Trial, Unreached, aligning, falls,
    navigators, seconds,
};
use crate::log::GRAVITY_MPS2;
use crate::page::digits;

/// A manoeuvre that the site does not allow is mentioned if it brings a sigma below this part of that
/// by the allowed ones.
const MENTION_RATIO: f64 = 0.8;
/// An effect as large as this part of a sigma is taken as its floor.
const PART_OF_FLOOR: f64 = 0.5;

impl Search<'_> {
    pub(super) fn unreached(&self, end: &[DrivenUnit]) -> Vec<Unreached> {
        let last = self.reached(end);
        if last.iter().all(GoalStatus::is_met) {
            return Vec::new();
        }
        let longest_s = f64::INFINITY;
        let own = self.tried(end, &self.target.site.manoeuvres, LOOKAHEAD[1], longest_s);
        let forbidden: Vec<Manoeuvre> = Manoeuvre::all()
            .filter(|manoeuvre| !self.target.site.manoeuvres.contains(manoeuvre))
            .collect();
        let other = self.tried(end, &forbidden, LOOKAHEAD[1], longest_s);
        let each = last.into_iter().enumerate();
        each.filter(|(_, reached)| !reached.is_met())
            .map(|(which, last)| {
                let why = self.why(which, &last, end, &own, &other);
                Unreached { last, why }
            })
            .collect()
    }

    fn why<'t>(
        &self,
        which: usize,
        last: &GoalStatus,
        end: &[DrivenUnit],
        own: &'t [Trial],
        other: &'t [Trial],
    ) -> String {
        let after =
            |drives: &[DrivenUnit]| self.target.goals[which].reached(navigators(drives), self.axes);
        let least = |tried: &'t [Trial]| {
            let each = tried.iter().map(|one| (one, after(&one.drives).sigma));
            each.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        if aligning(end) {
            let shown = other.iter().filter(|tried| !aligning(&tried.drives));
            let soonest =
                |a: &&Trial, b: &&Trial| seconds(&a.drives).total_cmp(&seconds(&b.drives));
            return match shown.min_by(soonest) {
                Some(shows) => format!(
                    "the site does not allow what shows it: level and heading are found in {:.1} min \
                     of {}",
                    (seconds(&shows.drives) - seconds(end)) / 60.0,
                    shows.manoeuvre.name()
                ),
                None => "level and heading are not found: it needs a start or a braking, or gyros \
                         that feel the Earth's rate"
                    .to_owned(),
            };
        }
        let own_least = least(own).map_or(last.sigma, |(_, sigma)| sigma);
        if let Some((shows, sigma)) = least(other)
            && sigma < MENTION_RATIO * own_least
        {
            return format!(
                "the site does not allow what shows it: {:.1} min of {} would bring it to {} {}",
                (seconds(&shows.drives) - seconds(end)) / 60.0,
                shows.manoeuvre.name(),
                digits(sigma, sigma),
                last.unit
            );
        }
        let falling = |tried: &&Trial| falls(last, &after(&tried.drives), end, &tried.drives);
        if let Some(tried) = own.iter().find(falling) {
            let manoeuvre = tried.manoeuvre.name();
            if last.sigma <= last.target {
                return format!(
                    "it still falls as noise does, and {manoeuvre} would show it in the end"
                );
            }
            let known_s = end.first().map_or(0.0, DrivenUnit::total_seconds);
            let needed_s = (last.sigma / last.target).powi(2) * known_s;
            return format!(
                "it still falls as noise does; {manoeuvre} alone would take some {:.0} min more, if that \
                 went on",
                ((needed_s - known_s) / 60.0).ceil()
            );
        }
        Self::floor(&self.target.goals[which], last, end)
    }

    /// Reason of a sigma that no longer falls.
    fn floor(goal: &Goal, last: &GoalStatus, end: &[DrivenUnit]) -> String {
        let Some(first) = end.first() else {
            return String::new();
        };
        let sensors = &first.navigator.config().sensors;
        let up = first.navigator.estimates().level_force_mps2 / GRAVITY_MPS2;
        // Sine and cosine of the tilt of the axis that is nearest to the vertical.
        let (upright, tilted) = (up.amax(), (1.0 - up.amax() * up.amax()).max(0.0).sqrt());
        let by_scale = GRAVITY_MPS2 * sensors.gyro_scale * upright * tilted;
        let by_axes = GRAVITY_MPS2 * sensors.misalignment_rad;
        let sigma_mps2 = last.sigma * goal.quantity.si();
        let walks = "its bias wanders, and what is left is what it does meanwhile";
        let text = match goal.quantity.kind {
            Kind::AccelBias if by_axes > PART_OF_FLOOR * sigma_mps2 => {
                "at one attitude of the mount a bias and a misalignment are one number: turn the \
                 unit over on a bench, or configure no misalignment if a compensation is all that \
                 it is for"
            }
            Kind::AccelBias if by_scale > PART_OF_FLOOR * sigma_mps2 => {
                "the unit is tilted, and at one tilt a bias and what the scale errors of the gyros \
                 tip in turns are one number: mount it level, or calibrate the gyros"
            }
            Kind::AccelBias if sensors.accel_bias_walk > 0.0 => walks,
            Kind::GyroBias if sensors.gyro_bias_walk > 0.0 => walks,
            Kind::Azimuth => "between manoeuvres it hangs on the noise of the gyros",
            Kind::AccelScale => {
                "no manoeuvre of a car makes the axis feel much more or less than at the level \
                 attitude, where a scale error is one number with the bias: turn the unit over on a \
                 bench"
            }
            Kind::GyroScale => {
                "no manoeuvre of a car tips the unit: turn it by hand about the axis"
            }
            Kind::LeverArm => "the vehicle leans too little to show it: measure it",
            _ => "no manoeuvre of this site moves it",
        };
        text.to_owned()
    }
}

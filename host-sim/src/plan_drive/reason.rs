//! Why a quantity does not come to its target.

use super::{AHEAD, Bench, Manoeuvre, Reached, Search, Unreached, falls};
use ins_core::Phase;

use super::quantities::{Goal, Kind};

/// A manoeuvre that the site does not allow is worth a word if it brings a sigma below this part of
/// what the site's own do.
const WORTH: f64 = 0.8;

impl Search<'_> {
    pub(super) fn unreached(&self, end: &Bench) -> Vec<Unreached> {
        let last = self.reached(end);
        if last.iter().all(Reached::is_met) {
            return Vec::new();
        }
        let own = self.tried(end, &self.site.manoeuvres, AHEAD[1]);
        let forbidden: Vec<Manoeuvre> = Manoeuvre::ALL
            .into_iter()
            .filter(|manoeuvre| !self.site.manoeuvres.contains(manoeuvre))
            .collect();
        let other = self.tried(end, &forbidden, AHEAD[1]);
        let each = last.into_iter().enumerate();
        each.filter(|(_, reached)| !reached.is_met())
            .map(|(which, last)| {
                let why = self.why(which, &last, end, &own, &other);
                Unreached { last, why }
            })
            .collect()
    }

    fn why(
        &self,
        which: usize,
        last: &Reached,
        end: &Bench,
        own: &[(Manoeuvre, Bench)],
        other: &[(Manoeuvre, Bench)],
    ) -> String {
        let after =
            |bench: &Bench| self.goals[which].reached(&bench.navigator.estimates(), self.axes);
        let least = |tried: &[(Manoeuvre, Bench)]| {
            let each = tried
                .iter()
                .map(|(manoeuvre, bench)| (*manoeuvre, after(bench)));
            each.min_by(|(_, a), (_, b)| a.sigma.total_cmp(&b.sigma))
        };
        if end.navigator.phase() != Phase::Navigating {
            return crate::report::unaligned(end.navigator.phase()).to_owned();
        }
        let own_least = least(own).map_or(last.sigma, |(_, reached)| reached.sigma);
        if let Some((manoeuvre, reached)) = least(other)
            && reached.sigma < WORTH * own_least
        {
            return format!(
                "the site does not allow what shows it: {} would bring it to {} {} at once",
                manoeuvre.name(),
                crate::report::digits(reached.sigma, reached.sigma),
                reached.unit
            );
        }
        if own
            .iter()
            .any(|(_, bench)| falls(last, &after(bench), end, bench))
        {
            let times = (last.sigma / last.target).powi(2);
            return format!(
                "it still falls as noise does: some {:.0} min instead of {:.0}, if that goes on",
                times * end.seconds() / 60.0,
                end.seconds() / 60.0
            );
        }
        self.floor(&self.goals[which], end)
    }

    /// What a sigma comes to that falls no more.
    fn floor(&self, goal: &Goal, end: &Bench) -> String {
        let sensors = &end.navigator.config().sensors;
        let walks = "its bias wanders: what is left is what it does meanwhile";
        let text = match goal.quantity.kind {
            Kind::AccelBias if sensors.misalignment_rad > 0.0 => {
                return format!(
                    "at one attitude of the mount a bias and a misalignment of {:.1} mrad are one \
                     number: turn the unit over on a bench",
                    1e3 * sensors.misalignment_rad
                );
            }
            Kind::AccelBias if sensors.accel_bias_walk > 0.0 => walks,
            Kind::GyroBias if sensors.gyro_bias_walk > 0.0 => walks,
            Kind::AccelScale => {
                "it acts on what the axis feels beyond the level attitude of the mount, and no \
                 manoeuvre of a car makes that large: at one attitude it is one number with the bias"
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

//! How honest the core is over kinds of vehicles, mounts, units and receivers: each kind is
//! simulated over seeds, and every estimate held against its truth and its own sigma.

mod kinds;
pub mod output;
mod quantities;
mod run;
mod statistics;
mod told;
mod truth;
mod world;

pub use kinds::Kind;
pub use quantities::{QUANTITIES, Quantity};
pub use run::{Check, Run, Trial, Tried};
pub use statistics::{Beside, KalmanLost, Results, Row, Totals};
pub use world::{Vehicle, World};

use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::log::Grade;
use crate::page::progress::counted;

/// Every kind: those to develop on, then those that judge.
pub fn all() -> impl Iterator<Item = &'static Kind> {
    kinds::develop::KINDS.iter().chain(kinds::judge::KINDS)
}

#[derive(Clone, Debug)]
pub struct Study {
    /// Kinds, each with every class of sensors it is for.
    pub kinds: Vec<&'static Kind>,
    /// Classes that are left out.
    pub only: Option<Grade>,
    /// Seed of the first run; the others follow.
    pub first_seed: u64,
    pub seeds: u64,
    pub trial: Trial,
}

impl Study {
    /// Runs everything, several at a time; what comes out does not depend on how many.
    pub fn results(&self, progress: &ProgressBar) -> Vec<Results> {
        let cases: Vec<(&'static Kind, Grade)> = self
            .kinds
            .iter()
            .flat_map(|kind| kind.classes.iter().map(|class| (*kind, *class)))
            .filter(|(_, class)| self.only.is_none_or(|only| only == *class))
            .collect();
        let seeds = self.first_seed..self.first_seed.saturating_add(self.seeds);
        progress.set_length(cases.len() as u64 * self.seeds);
        // Seeds of one case are far apart in the work list, so that long cases spread over threads.
        let on_seed = |seed| {
            let one = |(kind, class): &(&Kind, Grade)| self.trial.run(kind, *class, seed);
            cases.par_iter().map(counted(progress, one)).collect()
        };
        let tried: Vec<Vec<Tried>> = seeds.into_par_iter().map(on_seed).collect();
        cases
            .iter()
            .enumerate()
            .map(|(case, (kind, class))| {
                let runs: Vec<&Tried> = tried.iter().map(|of_seed| &of_seed[case]).collect();
                Results::new(kind, *class, &runs)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(named: &[&str], class: Grade, first_seed: u64, seeds: u64) -> Study {
        Study {
            kinds: all().filter(|kind| named.contains(&kind.name)).collect(),
            only: Some(class),
            first_seed,
            seeds,
            trial: Trial::default(),
        }
    }

    /// One kind with one class of sensors.
    fn of_kind(kind: &str, class: Grade, first_seed: u64, seeds: u64) -> Results {
        let study = study(&[kind], class, first_seed, seeds);
        study.results(&ProgressBar::hidden()).remove(0)
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let study = study(&["ten_wrong", "many_samples"], Grade::Mems, 3, 2);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let results = || study.results(&ProgressBar::hidden());
            pool.build().unwrap().install(results)
        };
        let results = on(1);
        assert_eq!(results.len(), 2);
        // As text: not every number need be one.
        assert_eq!(format!("{results:?}"), format!("{:?}", on(3)));
    }

    /// What waves do to an antenna on a mast says more of the latency than what they do to the unit.
    /// Without that, the lever arm came out beyond 4.5 sigmas in half of these.
    #[test]
    fn a_swinging_antenna_shows_the_latency() {
        for row in of_kind("boat_in_short_waves", Grade::Hg1700, 500, 6).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// A search that takes the latency from the unit's own motion alone, or supposes inertial stamps to be
    /// most of a second late, sees such an antenna swing the wrong way round in two of these.
    #[test]
    fn a_mast_in_waves_shows_no_wrong_latency() {
        for row in of_kind("mast", Grade::Mems, 140, 15).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// Up a mast at anchor the antenna moves and the unit does not, which "no rotation and no arm"
    /// explains. Searches that were led so never found a heading, in all of these.
    #[test]
    fn a_mast_at_anchor_does_not_mislead_the_search_for_the_heading() {
        let boat = of_kind("masthead", Grade::Mems, 500, 6);
        assert!(boat.never < 1e-9, "{} never aligned", boat.never);
    }

    #[test]
    fn under_white_noise_core_and_filter_err_alike() {
        for receiver_known in [false, true] {
            let study = Study {
                trial: Trial {
                    with_kalman: true,
                    receiver_known,
                },
                ..study(&["plain"], Grade::Hg1700, 0, 16)
            };
            let results = study.results(&ProgressBar::hidden());
            let plain = &results[0];
            assert_eq!(plain.kalman_lost.map(KalmanLost::runs), Some(0));
            assert_eq!(plain.near_kalman().1, plain.rows.len());
            // Both are near the best there is, on the same noise: what is left is the chance of sixteen
            // runs, a fifth of a ratio; of eight it was up to a third. Positions are so if
            // the core is told the same: else it takes part of their noise for correlated, which
            // here is white. So is the vertical velocity, which hangs on the height.
            let of_positions = ["level position", "height", "vertical velocity"];
            for (row, over) in plain.over_kalman() {
                let name = row.quantity.name;
                let own = row.kalman.unwrap().rms_ratio.unwrap();
                assert!(
                    (0.5..1.8).contains(&own),
                    "{name}: filter {own:.2} of its sigma"
                );
                if receiver_known || !of_positions.contains(&name) {
                    assert!((0.7..1.4).contains(&over), "{name}: {over:.2}");
                }
            }
        }
    }

    #[test]
    fn what_misaligned_gyros_add_in_every_banked_turn_is_found() {
        let off = ratio("misaligned_in_flight", Grade::Mems, 0, 6, "gyro z");
        // Six errors of one sigma come to 1.5 in one of thirty sets; taken for biases these come to 2.3.
        assert!(off < 1.5, "{off}");
    }

    /// Over its sigma, RMS.
    fn ratio(kind: &str, class: Grade, first_seed: u64, seeds: u64, quantity: &str) -> f64 {
        let results = of_kind(kind, class, first_seed, seeds);
        let mut rows = results.rows.iter();
        let row = rows.find(|row| row.quantity.name == quantity).unwrap();
        row.rms_ratio.unwrap()
    }

    /// A receiver that smooths shows a lateral velocity in every turn. Counted once a fix, it came to
    /// 2.4 sigmas of the forward accelerometer here; six errors of one sigma come to 1.5 in one of
    /// thirty sets, and what is taken for smoothing is too little by some.
    #[test]
    fn what_smoothing_leaves_is_not_taken_for_a_bias() {
        let off = ratio(
            "smoothed_velocity",
            Grade::Hg1700,
            600,
            6,
            "accelerometer y",
        );
        assert!(off < 1.8, "{off}");
    }

    /// The vertical accelerometer of this unit warms up. Taken for noise of velocities, that made the
    /// height wrong by 36 m and 7 sigmas, with 3 m of the receiver.
    #[test]
    fn an_accelerometer_that_warms_up_is_not_taken_for_noise() {
        let off = ratio("warming", Grade::Hg1700, 3055, 1, "height");
        assert!(off < 3.0, "{off}");
    }

    #[test]
    fn kinds_have_names_of_their_own_and_half_of_them_judge() {
        let names: std::collections::BTreeSet<&str> = all().map(|kind| kind.name).collect();
        assert_eq!(names.len(), all().count());
        assert!(names.len() >= 40);
        let judges = all().filter(|kind| kind.judge).count();
        assert!((judges as f64 / names.len() as f64 - 0.5).abs() < 0.03);
    }
}

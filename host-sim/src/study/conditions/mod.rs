//! Consistency of the core over kinds of vehicles, mounts, units and receivers: each kind is simulated
//! over seeds, and every estimate compared with its truth and its own sigma.

mod apriori;
mod kinds;
pub mod output;
mod quantities;
mod run;
mod scenario;
mod statistics;
mod truth;

pub use kinds::Kind;
pub use quantities::{QUANTITIES, Quantity};
pub use run::{Check, Run, Trial, TrialRuns};
pub use scenario::{Scenario, Vehicle};
pub use statistics::{KalmanComparison, KalmanLost, Results, Row, Totals};

use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::log::Grade;
use crate::page::progress::counted;

/// All kinds: those for development, then the judges.
pub fn all() -> impl Iterator<Item = &'static Kind> {
    kinds::develop::KINDS.iter().chain(kinds::judge::KINDS)
}

#[derive(Clone, Debug)]
pub struct Study {
    /// Kinds, each with every class of sensors it is for.
    pub kinds: Vec<&'static Kind>,
    /// The only class, if given.
    pub only: Option<Grade>,
    /// Seed of the first run; the others follow.
    pub first_seed: u64,
    pub seeds: u64,
    pub trial: Trial,
}

impl Study {
    /// Runs everything in parallel; the results do not depend on the number of threads.
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
        let of_seeds: Vec<Vec<TrialRuns>> = seeds.into_par_iter().map(on_seed).collect();
        cases
            .iter()
            .enumerate()
            .map(|(case, (kind, class))| {
                let runs: Vec<&TrialRuns> = of_seeds.iter().map(|of_seed| &of_seed[case]).collect();
                Results::new(kind, *class, &runs)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use ins_core::ImuOutput;

    use super::*;
    use crate::sim::motion::{Envelope, Harmonic};
    use crate::sim::receiver::Up;
    use crate::sim::vehicles::Begin;

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

    /// A kind of its own, with its class of sensors.
    fn of_new_kind(kind: &'static Kind, seeds: u64) -> Results {
        let study = Study {
            kinds: vec![kind],
            ..study(&[], kind.classes[0], 0, seeds)
        };
        study.results(&ProgressBar::hidden()).remove(0)
    }

    fn row<'a>(results: &'a Results, quantity: &str) -> &'a Row {
        let mut rows = results.rows.iter();
        rows.find(|row| row.quantity.name == quantity).unwrap()
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let study = study(&["ten_wrong", "many_samples"], Grade::Mems, 3, 2);
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let results = || study.results(&ProgressBar::hidden());
            pool.build().unwrap().install(results)
        };
        let results = with_threads(1);
        assert_eq!(results.len(), 2);
        // As text: some numbers may be NaN.
        assert_eq!(format!("{results:?}"), format!("{:?}", with_threads(3)));
    }

    /// The motion of an antenna on a mast in waves makes the latency more observable than that of the unit.
    /// Without it, the lever arm was off by more than 4.5 sigmas in half of these.
    #[test]
    fn a_swinging_antenna_makes_the_latency_observable() {
        for row in of_kind("boat_in_short_waves", Grade::Hg1700, 500, 6).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// A search that takes the latency from the motion of the unit alone, or allows inertial stamps to be
    /// most of a second late, finds the antenna swinging in the opposite phase in two of these.
    #[test]
    fn a_mast_in_waves_gives_no_wrong_latency() {
        for row in of_kind("mast", Grade::Mems, 140, 15).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// On a mast at anchor the antenna moves and the unit does not, which fits "no rotation and no lever arm".
    /// Searches misled by that never found a heading, in all of these.
    #[test]
    fn a_mast_at_anchor_does_not_mislead_the_search_for_the_heading() {
        let boat = of_kind("masthead", Grade::Mems, 500, 6);
        assert!(boat.never < 1e-9, "{} never aligned", boat.never);
    }

    /// If a receiver smooths its velocity alone, over 0.6 s, positions are that much earlier. Treating them as
    /// smoothed too, and comparing them with the INS error at the time of the velocity, caused errors of 6.3 m in
    /// the forward arm and 0.30 s in the latency (RMS of these seeds). 1.7 m and 0.08 s remain.
    #[test]
    fn smoothing_of_the_velocity_alone_is_not_taken_for_a_lever_arm() {
        static PLANE: Kind = Kind {
            name: "plane_with_smoothed_velocity",
            what: "",
            classes: &[Grade::Mems],
            judge: false,
            minutes: 15.0,
            modify: |s| {
                s.fixed_wing([20.0, 45.0], Begin::InFlight, 10.0);
                s.noise([0.05, 0.0, 1.0], [0.5, 1.0, 60.0]);
                s.habits().smoothing_s = 0.6;
                s.habits().smooths_position = false;
            },
        };
        let plane = of_new_kind(&PLANE, 6);
        for (name, limit) in [("lever arm y", 3.0), ("latency", 150.0)] {
            let error = row(&plane, name).rms_error;
            assert!(error < limit, "{name} {error}");
        }
    }

    /// A quadrotor tilts to accelerate: smoothing is found too short, with an upward arm in its place. Without
    /// the variance by the smoothing that is 2.8 sigmas, with it 0.7; eight runs vary by a fourth.
    #[test]
    fn the_sigma_of_an_upward_arm_allows_for_a_long_smoothing() {
        static QUADROTOR: Kind = Kind {
            name: "quadrotor_with_long_smoothing",
            what: "",
            classes: &[Grade::Mems],
            judge: false,
            minutes: 12.0,
            modify: |s| {
                s.vehicle = Vehicle::Quadrotor {
                    ground_s: Some(20.0),
                };
                s.receiver(5.0, [0.03, 0.0, 1.0], [0.5, 1.5, 60.0]);
                s.habits().smoothing_s = 0.6;
            },
        };
        let quadrotor = of_new_kind(&QUADROTOR, 8);
        let ratio = row(&quadrotor, "lever arm z").rms_ratio.unwrap();
        assert!(ratio < 1.5, "{ratio}");
    }

    /// Untold that gyros answer to specific force, the core is wrong and sure four times in these, of latency
    /// and lever arm.
    #[test]
    fn gyros_that_answer_to_specific_force_mislead_nothing() {
        for row in of_kind("g_sensitive_motorcycle", Grade::Mems, 0, 8).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// An antenna on a pole that swings with every step. Without the search for the latency it is half a step off in
    /// three of these eight, and the lever arm with it.
    #[test]
    fn the_latency_of_a_surveyor_is_not_half_a_step_off() {
        for row in of_kind("surveyor", Grade::Mems, 108, 8).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// Samples at 100 Hz resolve hardly any coning by an engine at 47 Hz. Unstated, it is 2.9 sigmas of the gyro here.
    #[test]
    fn coning_that_sampling_does_not_resolve_is_stated() {
        let off = ratio("mower", Grade::Hg1700, 0, 6, "gyro x");
        assert!(off < 1.5, "{off}");
    }

    /// Two jets over humps, whose jolts exceed 16 g. Clipped readings taken at their word make the vertical velocity
    /// wrong by 10.4 and 5.5 sigmas.
    #[test]
    fn clipped_accelerometers_are_not_taken_at_their_word() {
        for row in of_kind("jet", Grade::Mems, 18, 2).rows {
            assert_eq!(row.wrong_and_sure, 0, "{}", row.quantity.name);
        }
    }

    /// Stamps 2 ms off, and readings that vibrate by 5 m/s^2: a car's vertical velocity from heights. Without
    /// the noise of that it is 5.0 sigmas off, with it 1.0; eight runs vary by a fourth.
    #[test]
    fn stamps_that_jitter_make_vibrating_rates_noisy() {
        static SHAKEN: Kind = Kind {
            name: "jittered_rates_of_an_engine",
            what: "",
            classes: &[Grade::Hg1700],
            judge: false,
            minutes: 10.0,
            modify: |s| {
                s.errors.imu.output = ImuOutput::Rates;
                s.errors.imu.stamp_jitter_s = 0.002;
                let engine = Harmonic {
                    hz: 21.7,
                    velocity_mps: [0.024, 0.014, 0.035],
                    rotation_rad: [0.0; 3],
                };
                s.vibration.push((Envelope::Always, vec![engine]));
                s.habits().up = Up::Missing;
            },
        };
        let shaken = of_new_kind(&SHAKEN, 8);
        let ratio = row(&shaken, "vertical velocity").rms_ratio.unwrap();
        assert!(ratio < 1.5, "{ratio}");
    }

    #[test]
    fn under_white_noise_core_and_filter_have_similar_errors() {
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
            // Both are near optimal on the same noise: ratios of sixteen runs vary by a fifth, of eight by up
            // to a third. That holds for positions only if the core has the same noise model: else it takes
            // part of their white noise for correlated. So with the vertical velocity, which depends on the
            // height.
            let affected = ["level position", "height", "vertical velocity"];
            for (row, over) in plain.over_kalman() {
                let name = row.quantity.name;
                let own = row.kalman.unwrap().rms_ratio.unwrap();
                assert!(
                    (0.5..1.8).contains(&own),
                    "{name}: filter {own:.2} of its sigma"
                );
                if receiver_known || !affected.contains(&name) {
                    assert!((0.7..1.4).contains(&over), "{name}: {over:.2}");
                }
            }
        }
    }

    #[test]
    fn misalignment_of_gyros_in_banked_turns_is_estimated() {
        let off = ratio("misaligned_in_flight", Grade::Mems, 0, 6, "gyro z");
        // The RMS of six errors of one sigma exceeds 1.5 in one of thirty sets; taken for biases it was 2.3.
        assert!(off < 1.5, "{off}");
    }

    /// RMS of error over sigma.
    fn ratio(kind: &str, class: Grade, first_seed: u64, seeds: u64, quantity: &str) -> f64 {
        let results = of_kind(kind, class, first_seed, seeds);
        row(&results, quantity).rms_ratio.unwrap()
    }

    /// A receiver that smooths gives a false lateral velocity in every turn. Taken as white noise of each fix,
    /// it made the forward accelerometer 2.4 sigmas off here; the RMS of six errors of one sigma exceeds 1.5
    /// in one of thirty sets, and the smoothing is somewhat underestimated.
    #[test]
    fn smoothing_of_the_receiver_is_not_taken_for_a_bias() {
        let off = ratio(
            "smoothed_velocity",
            Grade::Hg1700,
            600,
            6,
            "accelerometer y",
        );
        assert!(off < 1.8, "{off}");
    }

    /// The bias of the vertical accelerometer drifts as this unit warms up. Taken for noise of velocities, that
    /// made the height wrong by 36 m and 7 sigmas, with a receiver good to 3 m.
    #[test]
    fn an_accelerometer_that_warms_up_is_not_taken_for_noise() {
        let off = ratio("warming", Grade::Hg1700, 3055, 1, "height");
        assert!(off < 3.0, "{off}");
    }

    #[test]
    fn names_of_kinds_are_unique_and_half_of_them_are_judges() {
        let names: std::collections::BTreeSet<&str> = all().map(|kind| kind.name).collect();
        assert_eq!(names.len(), all().count());
        assert!(names.len() >= 40);
        let judges = all().filter(|kind| kind.judge).count();
        assert!((judges as f64 / names.len() as f64 - 0.5).abs() < 0.03);
    }
}

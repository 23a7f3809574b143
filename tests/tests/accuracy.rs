//! What the running estimators reach on a few seeded drives: enough to see a broken one at once.

use host_sim::identify::run::{Identification, identify};
use host_sim::log::{Grade, Log};
use host_sim::sim::noise::Random;
use host_sim::study::accuracy::{Check, QUANTITIES, Run, Study};
use host_sim::study::conditions::{self, Trial};
use indicatif::ProgressBar;
use ins_core::config::HeadingSource;
use ins_core::{Config, Observability};
use ins_tests::drives::drive;
use nalgebra::Vector2;

fn runs(grade: Grade, runs: u64, minutes: f64, tune: &(dyn Fn(&mut Config) + Sync)) -> Vec<Run> {
    let study = Study {
        minutes,
        ..Study::new(grade, runs)
    };
    study.drive(&|_| {}, tune, &ProgressBar::hidden()).unwrap()
}

/// Checks are ten seconds apart.
fn at_minute(run: &Run, minute: usize) -> &[Check; 8] {
    run.history[6 * minute - 1].as_ref().expect("it navigates")
}

/// Squares of the errors in stated sigmas, summed over the runs, for each quantity.
fn chi_squares(runs: &[Run], minute: usize) -> [f64; 8] {
    let mut sums = [0.0; 8];
    for run in runs {
        for (sum, check) in sums.iter_mut().zip(at_minute(run, minute)) {
            *sum += (check.error / check.sigma).powi(2);
        }
    }
    sums
}

fn rms(runs: &[Run], minute: usize, which: usize) -> f64 {
    let sum: f64 = runs
        .iter()
        .map(|run| at_minute(run, minute)[which].error.powi(2))
        .sum();
    (sum / runs.len() as f64).sqrt()
}

/// `all` are the bounds of the chi-square distribution of all errors together, of probability
/// 0.1 % below and above; `each` the upper one of a single quantity, 0.02 %, for there are eight.
fn assert_honest(runs: &[Run], minute: usize, all: [f64; 2], each: f64) {
    assert!(runs.iter().all(|run| run.converged));
    let sums = chi_squares(runs, minute);
    for (sum, quantity) in sums.iter().zip(QUANTITIES) {
        println!("{}: {sum:.1} of {}", quantity.name, runs.len());
        assert!(*sum < each, "{}: {sum}", quantity.name);
    }
    let sum: f64 = sums.iter().sum();
    assert!((all[0]..all[1]).contains(&sum), "{sum}");
}

/// 8 runs: 64 degrees of freedom in all, 8 in each quantity.
const EIGHT: ([f64; 2], f64) = ([34.0, 105.0], 30.0);
/// 4 runs: 32 and 4.
const FOUR: ([f64; 2], f64) = ([11.5, 63.0], 22.0);

#[test]
fn ring_laser_drives_are_honest_and_do_not_get_worse() {
    let runs = runs(Grade::Hg1700, 8, 40.0, &|_| {});
    assert_honest(&runs, 20, EIGHT.0, EIGHT.1);
    assert_honest(&runs, 40, EIGHT.0, EIGHT.1);
    let ratios: Vec<f64> = (0..8)
        .map(|which| rms(&runs, 40, which) / rms(&runs, 20, which))
        .collect();
    // An RMS of eight errors is known to a quarter: the ratio of two, half dependent, to 0.3.
    assert!(ratios.iter().all(|ratio| *ratio < 1.5), "{ratios:?}");
    // A constant known by white noise: 0.7. The azimuth walks with its gyro.
    let mean = ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / 8.0;
    assert!(mean.exp() < 0.9, "{ratios:?}");
    // Twice what is promised of 100 drives: 0.03 deg, 0.04 mg, 0.2 and 0.25 deg/h, 1 ms.
    let limits = [0.06, 0.08, 0.08, 0.01, 0.4, 0.4, 0.5, 2.0];
    for (which, limit) in limits.iter().enumerate() {
        let rms = rms(&runs, 40, which);
        println!(
            "{}: {rms:.4} {}",
            QUANTITIES[which].name, QUANTITIES[which].unit
        );
        assert!(rms < *limit, "{}: {rms}", QUANTITIES[which].name);
    }
}

#[test]
fn an_unknown_heading_is_found_from_motion() {
    let unknown = &|config: &mut Config| config.heading = HeadingSource::Motion;
    let runs = runs(Grade::Hg1700, 4, 20.0, unknown);
    assert_honest(&runs, 20, FOUR.0, FOUR.1);
}

/// Biases of 1080 deg/h that wander by 40, scale errors of 1.5 %, no heading given.
#[test]
fn consumer_sensors_converge_from_any_heading() {
    let runs = runs(Grade::Mems, 4, 20.0, &|_| {});
    assert_honest(&runs, 20, FOUR.0, FOUR.1);
    // Over many drives 0.16 deg and 8, 8 and 14 deg/h; four tell an RMS to 1.7 times.
    assert!(rms(&runs, 20, 4) < 14.0 && rms(&runs, 20, 5) < 14.0 && rms(&runs, 20, 6) < 24.0);
    assert!(rms(&runs, 20, 0) < 0.3);
}

/// A receiver that knows when it is noisy, though not by how much: what it says is used.
#[test]
fn fixes_that_are_said_to_be_noisy_count_for_less() {
    // Two fixes of three have 0.5 m/s of noise instead of 0.1; three times as much is stated.
    const STATED: [f64; 3] = [0.3, 1.5, 1.5];
    let (config, mut log) = drive(Grade::Hg1700, 15.0);
    let mut noise = Random::stream(3, "noisy fixes");
    for (fix, sigma) in log.gnss.iter_mut().zip(STATED.into_iter().cycle()) {
        if sigma > STATED[0]
            && let Some(velocity) = &mut fix.velocity_en_mps
        {
            *velocity += 0.49 * Vector2::new(noise.normal(), noise.normal());
        }
        fix.sigma.velocity_mps = Some(sigma);
    }
    let stated = identify(&log, config, &ProgressBar::hidden()).unwrap();
    for fix in &mut log.gnss {
        fix.sigma.velocity_mps = None;
    }
    let silent = identify(&log, config, &ProgressBar::hidden()).unwrap();
    let latency = |found: &Identification| found.end.estimates.gnss_latency_s;
    let (known, guessed) = (latency(&stated), latency(&silent));
    println!("{known:?} {guessed:?}");
    // Weights by variance against equal ones: sqrt((1 + 2 / 25) (1 + 2 * 25)) / 3 = 2.5 times
    // less; that wild innovations count for less anyway takes some of it.
    assert!(known.sigma < 0.6 * guessed.sigma, "{known:?} {guessed:?}");
}

/// Each fix with the velocity of four fixes ago, 0.4 s late, and a position that is not.
#[test]
fn positions_that_are_not_as_late_as_velocities_are_told_apart() {
    const LATE_S: f64 = 0.4;
    let (config, mut log) = drive(Grade::Hg1700, 15.0);
    let delays = |log: &Log| {
        let found = identify(log, config, &ProgressBar::hidden()).unwrap();
        let estimates = found.end.estimates;
        (estimates.gnss_latency_s, estimates.gnss_position_delay_s)
    };
    let (latency, delay) = delays(&log);
    let own = log.gnss.clone();
    for (fix, before) in log.gnss.iter_mut().skip(4).zip(own) {
        assert!((fix.time.seconds_since(before.time) - LATE_S).abs() < 1e-5);
        fix.velocity_en_mps = before.velocity_en_mps;
        fix.velocity_up_mps = before.velocity_up_mps;
    }
    let (late, early) = delays(&log);
    println!("{latency:?} {delay:?}, {late:?} {early:?}");
    for (found, off_s) in [
        (delay, delay.value),
        (early, early.value + LATE_S),
        (late, late.value - latency.value - LATE_S),
    ] {
        assert!(found.observability == Observability::Observable);
        // What 0.05 m/s and 1.5 m show at 15 m/s in a quarter of an hour is good to some milliseconds.
        assert!(found.sigma < 0.01, "{found:?}");
        assert!(off_s.abs() < 3.5 * found.sigma, "{found:?}: {off_s}");
    }
}

/// Latency and lever arm at the end of a run of a kind, in sigmas, where they are observable.
fn antenna_sigmas(kind: &str, class: Grade, seed: u64) -> Vec<f64> {
    sigmas_off(kind, class, seed, |name, check| {
        check.observable && (name == "latency" || name.starts_with("lever arm"))
    })
}

/// By how many sigmas some quantities are off at the end of a run of a kind.
fn sigmas_off(
    kind: &str,
    class: Grade,
    seed: u64,
    some: impl Fn(&str, &conditions::Check) -> bool,
) -> Vec<f64> {
    let kind = conditions::all().find(|known| known.name == kind);
    let run = Trial::default()
        .run(kind.expect("a kind"), class, seed)
        .core;
    let named =
        |check: &&conditions::Check| some(conditions::QUANTITIES[check.quantity].name, check);
    let checks = run.checks.iter().filter(named);
    checks
        .filter_map(|check| Some(check.error / check.sigma?))
        .collect()
}

/// Velocities made of positions that wander lean the platform with these: it went to and fro with what was
/// held against it, and showed an upward arm, 3 sigmas off in the mean of any dozen runs.
#[test]
fn a_platform_that_leans_shows_no_arm() {
    let arm = |seed| {
        sigmas_off("differences", Grade::Mems, seed, |name, _| {
            name == "lever arm z"
        })
    };
    let sigmas: Vec<f64> = (0..12).flat_map(arm).collect();
    let mean = sigmas.iter().sum::<f64>() / sigmas.len() as f64;
    println!("{mean} sigmas: {sigmas:.1?}");
    // Of twelve it is good to three tenths; three of these, and what the leaning leaves.
    assert!(sigmas.len() == 12 && mean.abs() < 1.5, "{mean}");
}

/// A platform that GNSS holds leans as that errs, and felt gravity then goes with the next error: taken for
/// the vehicle's motion, it draws the latency of one that hardly moves to one side, by two sigmas.
#[test]
fn correlated_noise_draws_no_latency_to_one_side() {
    let latency = |seed| antenna_sigmas("furrows", Grade::Hg1700, seed).pop();
    let sigmas: Vec<f64> = (0..16).filter_map(latency).collect();
    let mean = sigmas.iter().sum::<f64>() / sigmas.len() as f64;
    println!("{mean} sigmas: {sigmas:?}");
    assert!(sigmas.len() > 12);
    // The mean of sixteen is good to a quarter, and what the noise of the tilt itself draws is a half.
    assert!(mean.abs() < 1.25, "{mean}");
}

/// On a mast metres high the arm swings faster than noise, to where the vehicle points and not the INS: taken
/// for the same, latency and arm made up for the azimuth in every fourth run, by 4 to 9 sigmas.
#[test]
fn an_antenna_that_swings_does_not_hide_the_azimuth() {
    let off = |seed: &u64| {
        let sigmas = antenna_sigmas("mast", Grade::Mems, *seed);
        println!("{seed}: {sigmas:.1?}");
        sigmas.iter().any(|sigmas| sigmas.abs() > 3.5)
    };
    // One in twenty finds a wave's half period instead of the latency.
    assert!((0..24).filter(off).count() <= 2);
}

/// Nothing of these scenarios, every number of which is drawn, is called wrong and sure.
fn assert_not_misled(scenarios: &[(Grade, u64)]) {
    for (class, seed) in scenarios {
        let sigmas = sigmas_off("anything", *class, *seed, |_, check| check.observable);
        println!("{seed}: {sigmas:.1?}");
        assert!(sigmas.iter().all(|sigmas| sigmas.abs() < 4.5), "{sigmas:?}");
    }
}

/// Of boats at anchor heights do not tell which way a vertical velocity counts, accelerometers do: without them
/// latency and arms were 9 to 49 sigmas off on each of these four.
#[test]
fn a_vertical_velocity_that_counts_down_does_not_mislead_a_boat() {
    assert_not_misled(&[
        (Grade::Hg1700, 1),
        (Grade::Hg1700, 187),
        (Grade::Hg1700, 227),
        (Grade::Mems, 123),
    ]);
}

/// The sign of a slow climb that is not known yet is that of all fixes, and none of their noise: taken for noise,
/// ten climbs with the wrong one made height, vertical velocity or arm of these three 5 to 6 sigmas off.
#[test]
fn a_sign_that_is_not_known_is_that_of_all_fixes() {
    assert_not_misled(&[
        (Grade::Hg1700, 5),
        (Grade::Hg1700, 1094),
        (Grade::Mems, 287),
    ]);
}

/// A receiver that smooths over half a second or a whole one, where most do over a tenth, is learnt of in steps:
/// what was learnt before each of them had left an arm of these two 5 to 9 sigmas off.
#[test]
fn a_receiver_that_smooths_for_long_leaves_no_arm() {
    assert_not_misled(&[(Grade::Mems, 63), (Grade::Mems, 160)]);
}

/// An arm upward swings a quadrotor's antenna as a smoothing of its darts would, and a tangent to what is smoothed
/// away of them is twice too steep: arms of these four took its place, by 6 to 12 sigmas.
#[test]
fn a_receiver_that_smooths_what_swings_leaves_no_arm() {
    assert_not_misled(&[
        (Grade::Mems, 202),
        (Grade::Mems, 318),
        (Grade::Mems, 332),
        (Grade::Mems, 404),
    ]);
}

//! Fixes with missing components.

use std::sync::LazyLock;

use host_sim::identify::run::in_order_of_time;
use host_sim::log::Grade;
use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use host_sim::study::accuracy::config_of;
use ins_core::config::HeadingSource;
use ins_core::earth::wrap_pi;
use ins_core::{Config, GnssFix, Navigator};

const MINUTES: f64 = 20.0;

static DRIVE: LazyLock<SimulatedDrive> = LazyLock::new(|| {
    let mut drive = DriveConfig::new(4, Grade::Hg1700, MINUTES);
    drive.recording.truth_every = 1;
    simulate(&drive)
});

/// RMS errors over the last quarter; east velocity and heading also relative to their sigmas.
struct Errors {
    position_m: f64,
    height_m: f64,
    velocity_mps: f64,
    heading_rad: f64,
    in_sigmas: [f64; 2],
}

/// Fixes reduced by `reduce` after `complete_s`, complete ones before.
fn navigate(complete_s: f64, reduce: impl Fn(&GnssFix) -> GnssFix) -> Errors {
    let drive = &*DRIVE;
    let config = Config {
        heading: HeadingSource::Given(drive.truth[0].euler().heading_rad + 0.05),
        ..config_of(Grade::Hg1700)
    };
    let mut navigator: Navigator = Navigator::new(config).unwrap();
    let reduced = |fix: &GnssFix| {
        let is_complete = fix.time.as_seconds() < complete_s;
        if is_complete { *fix } else { reduce(fix) }
    };
    let fixes: Vec<GnssFix> = drive.gnss.iter().map(reduced).collect();
    // The truth begins at the start of the first increment.
    let mut truths = drive.truth[1..].iter();
    let mut sums = [0.0; 6];
    let mut count = 0.0;
    for event in in_order_of_time(&drive.imu, &fixes) {
        let Some(sample) = event.give_to(&mut navigator) else {
            continue;
        };
        let truth = truths.next().expect("one for each sample");
        assert_eq!(sample.time, truth.time);
        let late = sample.time.as_seconds() > 45.0 * MINUTES;
        if !late || sample.time.as_micros() % 1_000_000 != 0 {
            continue;
        }
        let solution = navigator.solution().expect("navigating");
        let sigma = navigator.sigma().expect("exact");
        let position = solution.position.enu_from(&truth.position);
        let velocity = solution.velocity_enu_mps - truth.velocity_enu_mps;
        let heading = wrap_pi(solution.euler().heading_rad - truth.euler().heading_rad);
        let squares = [
            position.xy().norm_squared(),
            position.z * position.z,
            velocity.norm_squared(),
            heading * heading,
            velocity.x * velocity.x / (sigma.velocity_mps.x * sigma.velocity_mps.x),
            heading * heading / (sigma.attitude_rad.z * sigma.attitude_rad.z),
        ];
        count += 1.0;
        for (sum, square) in sums.iter_mut().zip(squares) {
            *sum += square;
        }
    }
    let [
        position_m,
        height_m,
        velocity_mps,
        heading_rad,
        velocity,
        heading,
    ] = sums.map(|sum| f64::sqrt(sum / count));
    println!(
        "{position_m} m, {height_m} m, {velocity_mps} m/s, {heading_rad} rad, {velocity} {heading}"
    );
    Errors {
        position_m,
        height_m,
        velocity_mps,
        heading_rad,
        in_sigmas: [velocity, heading],
    }
}

/// A single drive with errors correlated over minutes: an RMS of two sigmas is possible.
fn assert_within_sigmas(errors: &Errors) {
    assert!(
        errors.in_sigmas.iter().all(|error| *error < 2.5),
        "{:?}",
        errors.in_sigmas
    );
}

#[test]
fn all_parts() {
    let errors = navigate(0.0, |fix| *fix);
    assert!(errors.position_m < 1.0 && errors.height_m < 1.5);
    assert!(errors.velocity_mps < 0.05 && errors.heading_rad < 2e-3);
    assert_within_sigmas(&errors);
}

#[test]
fn position_and_height_without_velocity() {
    let errors = navigate(0.0, |fix| GnssFix {
        velocity_en_mps: None,
        velocity_up_mps: None,
        ..*fix
    });
    assert!(errors.position_m < 1.5 && errors.height_m < 3.0);
    assert!(errors.velocity_mps < 0.2 && errors.heading_rad < 5e-3);
    assert_within_sigmas(&errors);
}

#[test]
fn position_alone() {
    let errors = navigate(0.0, |fix| GnssFix {
        velocity_en_mps: None,
        velocity_up_mps: None,
        height_m: None,
        ..*fix
    });
    assert!(errors.position_m < 1.5 && errors.heading_rad < 5e-3);
}

#[test]
fn no_height_and_no_vertical_velocity() {
    let errors = navigate(0.0, |fix| GnssFix {
        velocity_up_mps: None,
        height_m: None,
        ..*fix
    });
    assert!(errors.position_m < 1.0 && errors.heading_rad < 2e-3);
    // The car climbs at some dm/s; without an assumption errors would be tens of m/s.
    assert!(errors.velocity_mps < 1.0);
}

#[test]
fn height_without_vertical_velocity() {
    let errors = navigate(0.0, |fix| GnssFix {
        velocity_up_mps: None,
        ..*fix
    });
    assert!(errors.position_m < 1.0 && errors.height_m < 1.5);
    assert!(errors.velocity_mps < 0.1 && errors.heading_rad < 2e-3);
    assert_within_sigmas(&errors);
}

#[test]
fn velocity_alone() {
    // The position has to be known once.
    let errors = navigate(180.0, |fix| GnssFix {
        position: None,
        height_m: None,
        ..*fix
    });
    assert!(errors.velocity_mps < 0.05 && errors.heading_rad < 2e-3);
    assert_within_sigmas(&errors);
}

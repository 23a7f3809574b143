//! Barometer aiding of the vertical channel without GNSS.

use std::sync::LazyLock;

use host_sim::identify::configure;
use host_sim::identify::run::{Event, in_order_of_time};
use host_sim::log::{Grade, import};
use host_sim::sim::barometer::BarometerModel;
use host_sim::sim::car::{Car, RouteBounds};
use host_sim::sim::{DriveConfig, SimulatedDrive, record};
use host_sim::study::accuracy::config_of;
use ins_core::{BaroHeight, GnssOutcome, Navigator, Phase, Time};
use ins_tests::drives::recording;

const END_S: f64 = 600.0;
const OUTAGE_S: std::ops::Range<f64> = 360.0..540.0;

/// A quarter of the grades of a mountain road, sensors that want three minutes of fixes.
static DRIVE: LazyLock<SimulatedDrive> = LazyLock::new(|| {
    let mut config = DriveConfig::new(5, Grade::Mems, END_S / 60.0).recording;
    config.errors.barometer = Some(BarometerModel::ON_BOARD);
    let route = RouteBounds {
        steep: 2.0,
        ..RouteBounds::ROAD
    };
    record(Car::on_route(config.seed, END_S, &route), &config)
});

/// Runs the drive with late fixes, none in the outage, and heights modified by `read`; `each` gets the navigator, the
/// true height, and the outcome of a barometer height.
fn drive(
    late_s: f64,
    read: impl Fn(&BaroHeight) -> Option<BaroHeight>,
    mut each: impl FnMut(&Navigator, Time, f64, Option<GnssOutcome>),
) -> Navigator {
    let mut navigator = Navigator::new(config_of(Grade::Mems)).unwrap();
    let mut fixes = DRIVE.gnss.iter().peekable();
    let mut heights = DRIVE.baro.iter().zip(&DRIVE.truth).peekable();
    for sample in &DRIVE.imu {
        let arrived = sample.time.plus_seconds(-late_s);
        while let Some(fix) = fixes.next_if(|fix| fix.time < arrived) {
            if !OUTAGE_S.contains(&fix.time.as_seconds()) {
                let _ = navigator.on_gnss(fix);
            }
        }
        let _ = navigator.on_imu(sample);
        while let Some((height, truth)) = heights.next_if(|(height, _)| height.time <= sample.time)
        {
            let outcome = read(height).map(|height| navigator.on_baro(&height));
            each(&navigator, sample.time, truth.position.height_m, outcome);
        }
    }
    navigator
}

/// Error and sigma of the height at the end of the outage, m.
fn after_outage(read: impl Fn(&BaroHeight) -> Option<BaroHeight>) -> (f64, f64) {
    let mut last = (f64::NAN, f64::NAN);
    drive(0.0, read, |navigator, time, true_m, _| {
        if OUTAGE_S.contains(&time.as_seconds()) {
            let (solution, sigma) = (navigator.solution().unwrap(), navigator.sigma().unwrap());
            last = (solution.position.height_m - true_m, sigma.position_m.z);
        }
    });
    last
}

#[test]
fn barometer_bounds_the_height_error_in_an_outage() {
    let (error_m, sigma_m) = after_outage(|_| None);
    assert!(error_m.abs() < 3.0 * sigma_m, "{error_m} of {sigma_m}");
    let (aided_m, aided_sigma_m) = after_outage(|height| Some(*height));
    println!("unaided {error_m} of {sigma_m}, aided {aided_m} of {aided_sigma_m}");
    // With a barometer offset of 60 m and more.
    assert!(
        aided_m.abs() < 3.0 * aided_sigma_m,
        "{aided_m} of {aided_sigma_m}"
    );
    assert!(
        aided_sigma_m < 10.0 && aided_sigma_m < 0.3 * sigma_m,
        "{aided_sigma_m} of {sigma_m}"
    );
}

#[test]
fn a_stuck_barometer_is_not_used() {
    let stuck = |height: &BaroHeight| {
        Some(BaroHeight {
            height_m: 432.1,
            ..*height
        })
    };
    let mut outcomes = Vec::new();
    drive(0.0, stuck, |_, _, _, outcome| outcomes.extend(outcome));
    let repeated = |outcome: &&GnssOutcome| **outcome == GnssOutcome::Repeated;
    let part = outcomes.iter().filter(repeated).count() as f64 / outcomes.len() as f64;
    // A repetition is detected every two to three seconds.
    assert!(part > 0.2, "{part}");
    assert_eq!(after_outage(stuck), after_outage(|_| None));
}

/// Barometric climbs refer to a second in the past.
#[test]
fn late_fixes_are_accepted_beside_a_barometer() {
    let mut resumed_s = None;
    let navigator = drive(
        0.9,
        |height| Some(*height),
        |navigator, time, _, _| {
            let fix = navigator.health().last_fix;
            let fresh = fix.is_some_and(|fix| {
                fix.time.as_seconds() > OUTAGE_S.end && fix.outcome == GnssOutcome::Accepted
            });
            if fresh && resumed_s.is_none() {
                resumed_s = Some(time.as_seconds() - OUTAGE_S.end);
            }
        },
    );
    // Late by 0.9 s, and compared with the next but one, a third of a second later.
    assert!(
        resumed_s.is_some_and(|resumed_s| resumed_s < 2.0),
        "{resumed_s:?}"
    );
    // A barometric climb is not counted as a fix.
    let fixes = DRIVE
        .gnss
        .iter()
        .filter(|fix| !OUTAGE_S.contains(&fix.time.as_seconds()));
    assert!(navigator.health().fixes.accepted as usize <= fixes.count());
}

#[test]
fn invalid_heights_are_rejected() {
    let time = |seconds| Time::from_seconds(seconds).unwrap();
    let good = BaroHeight {
        time: time(END_S),
        height_m: 150.0,
        sigma_m: 0.2,
    };
    let mut fresh = Navigator::new(config_of(Grade::Mems)).unwrap();
    assert_eq!(fresh.on_baro(&good), GnssOutcome::NoInertialData);
    let before = drive(0.0, |_| None, |_, _, _, _| ());
    assert_eq!(before.phase(), Phase::Navigating);
    let cases = [
        (
            BaroHeight {
                height_m: f64::NAN,
                ..good
            },
            GnssOutcome::NotFinite,
        ),
        (
            BaroHeight {
                sigma_m: f64::INFINITY,
                ..good
            },
            GnssOutcome::NotFinite,
        ),
        (
            BaroHeight {
                sigma_m: 0.0,
                ..good
            },
            GnssOutcome::OutOfRange,
        ),
        (
            BaroHeight {
                height_m: 2e5,
                ..good
            },
            GnssOutcome::OutOfRange,
        ),
        (
            BaroHeight {
                time: time(END_S - 5.0),
                ..good
            },
            GnssOutcome::TooOld,
        ),
        (
            BaroHeight {
                time: time(END_S + 5.0),
                ..good
            },
            GnssOutcome::TooFarAhead,
        ),
    ];
    for (height, outcome) in cases {
        let mut navigator = before.clone();
        assert_eq!(navigator.on_baro(&height), outcome, "{height:?}");
        assert!(navigator == before, "{height:?}");
    }
    let mut navigator = before.clone();
    assert_eq!(navigator.on_baro(&good), GnssOutcome::Accepted);
    assert_eq!(navigator.on_baro(&good), GnssOutcome::TimeNotIncreasing);
}

/// A quadrotor's barometer with a resolution of a centimetre, and outages of two minutes from every 20 s on.
#[test]
fn a_recorded_barometer_bounds_the_height_error() {
    let Some(path) = recording("arducopter_3.1_joey1.bin") else {
        return;
    };
    let (log, _) = import::open(&path).unwrap();
    assert!(log.baro.len() > 3000, "{}", log.baro.len());
    let config = configure::config(&log, Grade::Mems);
    // Error and sigma at the end, for each start; the reference is the receiver, accurate to some metres.
    let after = |heights: &[BaroHeight], start_s: f64| {
        let out = log.start().plus_seconds(start_s);
        let end = out.plus_seconds(120.0);
        let mut navigator: Navigator = Navigator::new(config).unwrap();
        let mut heights = heights.iter().peekable();
        for event in in_order_of_time(log.imu.iter(), &log.gnss) {
            if event.time() > end {
                break;
            }
            if !matches!(event, Event::Gnss(fix) if fix.time > out) {
                event.give_to(&mut navigator);
            }
            while let Some(height) = heights.next_if(|height| height.time <= event.time()) {
                let _ = navigator.on_baro(height);
            }
        }
        let near = log
            .gnss
            .iter()
            .filter(|fix| fix.time.seconds_since(end).abs() < 1.0);
        let true_m: Vec<f64> = near.filter_map(|fix| fix.height_m).collect();
        let true_m = true_m.iter().sum::<f64>() / true_m.len() as f64;
        let (solution, sigma) = (navigator.solution().unwrap(), navigator.sigma().unwrap());
        (solution.position.height_m - true_m, sigma.position_m.z)
    };
    let rms = |errors: &[(f64, f64)]| {
        let square = errors.iter().map(|(error, _)| error * error).sum::<f64>();
        (square / errors.len() as f64).sqrt()
    };
    let starts = [60.0, 80.0, 100.0, 120.0, 140.0, 160.0, 180.0, 200.0];
    let unaided = starts.map(|start_s| after(&[], start_s));
    let aided = starts.map(|start_s| after(&log.baro, start_s));
    println!(
        "unaided {:.1} m, aided {:.1} m: {aided:.1?}",
        rms(&unaided),
        rms(&aided)
    );
    assert!(rms(&unaided) > 50.0, "{unaided:?}");
    assert!(rms(&aided) < 10.0, "{aided:?}");
    // Two sigmas are exceeded by one in twenty, and errors of the receiver add.
    assert!(
        aided.iter().all(|(error, sigma)| error.abs() < 2.5 * sigma),
        "{aided:?}"
    );
}

//! Invalid input between valid samples: no panic and no lasting effect.

use std::sync::LazyLock;

use host_sim::identify::run;
use host_sim::log::Grade;
use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use host_sim::study::accuracy::config_of;
use ins_core::config::HeadingSource;
use ins_core::earth::{Geodetic, LatLon};
use ins_core::{
    Config, Estimate, Estimates, FixSigma, GnssFix, GnssOutcome, ImuOutcome, ImuOutput, ImuSample,
    Navigator, Observability, Phase, Solution, Time,
};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    Imu(ImuSample),
    Gnss(GnssFix),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    Imu(ImuOutcome),
    Gnss(GnssOutcome),
}

impl Answer {
    /// Whether the documentation guarantees an unchanged state.
    fn guarantees_no_change(self) -> bool {
        !matches!(
            self,
            Self::Imu(
                ImuOutcome::Accepted
                    | ImuOutcome::Bridged
                    | ImuOutcome::Gap
                    | ImuOutcome::TimeNotIncreasing
            ) | Self::Gnss(GnssOutcome::Accepted | GnssOutcome::Queued | GnssOutcome::Outlier)
        )
    }
}

fn handle(navigator: &mut Navigator, event: &Event) -> Answer {
    match event {
        Event::Imu(sample) => Answer::Imu(navigator.on_imu(sample)),
        Event::Gnss(fix) => Answer::Gnss(navigator.on_gnss(fix)),
    }
}

/// Five minutes of a car, one of them at rest.
static DRIVE: LazyLock<SimulatedDrive> = LazyLock::new(|| {
    let mut config = DriveConfig::new(3, Grade::Hg1700, 5.0);
    config.initial_rest_s = Some([20.0, 20.0]);
    // Any reading within the range of the sensors is accepted as a rate, but few as an increment.
    config.recording.errors.imu.output = ImuOutput::Rates;
    config.recording.truth_every = 1;
    simulate(&config)
});
/// In order of time stamps.
static EVENTS: LazyLock<Vec<Event>> = LazyLock::new(|| {
    let events = run::in_order_of_time(&DRIVE.imu, &DRIVE.gnss);
    let owned = |event| match event {
        run::Event::Imu(sample) => Event::Imu(sample),
        run::Event::Gnss(fix) => Event::Gnss(*fix),
    };
    events.map(owned).collect()
});

fn config() -> Config {
    let mut config = config_of(Grade::Hg1700);
    config.imu_output = ImuOutput::Rates;
    config.heading = HeadingSource::Given(DRIVE.truth[0].euler().heading_rad + 0.05);
    config
}

fn navigator() -> Navigator {
    Navigator::new(config()).unwrap()
}

fn all(e: &Estimates) -> Vec<Estimate> {
    let mut list = vec![
        e.azimuth_error_rad,
        e.gnss_latency_s,
        e.gnss_latency_now_s,
        e.clock_drift,
    ];
    list.extend(e.accel_bias_mps2);
    list.extend(e.gyro_bias_radps);
    list.extend(e.accel_scale);
    list.push(e.turn_scale);
    list.extend(e.gyro_scale);
    list.extend(e.gyro_misalignment_rad);
    list.extend(e.lever_arm_m);
    list
}

fn given(estimate: Estimate) -> bool {
    estimate.observability == Observability::Given
}

/// All numbers are finite; a state with a NaN is not equal to itself.
#[allow(clippy::eq_op)]
fn assert_valid(navigator: &Navigator) {
    assert!(navigator == navigator, "a NaN in the state");
    for estimate in all(&navigator.estimates()) {
        assert!(estimate.value.is_finite(), "{estimate:?}");
        assert!(
            estimate.sigma.is_finite() && (estimate.sigma > 0.0 || given(estimate)),
            "{estimate:?}"
        );
    }
    let Some(solution) = navigator.solution() else {
        return;
    };
    let Geodetic {
        latitude_rad,
        longitude_rad,
        height_m,
    } = solution.position;
    assert!(
        latitude_rad.abs() <= core::f64::consts::FRAC_PI_2,
        "{solution:?}"
    );
    assert!(
        longitude_rad.abs() <= 3.15 && height_m.is_finite(),
        "{solution:?}"
    );
    assert!(solution.velocity_enu_mps.iter().all(|v| v.is_finite()));
    assert!(
        (solution.attitude.norm() - 1.0).abs() < 1e-9,
        "{solution:?}"
    );
}

fn truth_at(time: Time) -> &'static Solution {
    let after = DRIVE.truth.partition_point(|truth| truth.time <= time);
    &DRIVE.truth[after - 1]
}

/// Errors in position, velocity and heading.
fn errors(navigator: &Navigator) -> Option<[f64; 3]> {
    let solution = navigator.solution()?;
    let truth = truth_at(solution.time);
    Some([
        solution.position.enu_from(&truth.position).norm(),
        (solution.velocity_enu_mps - truth.velocity_enu_mps).norm(),
        ins_core::earth::wrap_pi(solution.euler().heading_rad - truth.euler().heading_rad).abs(),
    ])
}

/// Credible numbers, or numbers of any kind.
fn number(any_number: bool, credible: f64) -> BoxedStrategy<f64> {
    if !any_number {
        return (-credible..credible).boxed();
    }
    prop_oneof![
        4 => any::<u64>().prop_map(f64::from_bits),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(f64::MAX),
        1 => Just(-f64::MIN_POSITIVE),
        1 => Just(f64::from_bits(1)),
        1 => Just(-0.0),
        6 => -credible..credible,
    ]
    .boxed()
}

fn three(any_number: bool, credible: f64) -> impl Strategy<Value = Vector3<f64>> {
    let number = || number(any_number, credible);
    [number(), number(), number()].prop_map(Vector3::from)
}

/// Any time stamp, or microseconds relative to the current time.
#[derive(Clone, Copy, Debug)]
enum Stamp {
    Any(i64),
    About(i64),
}

fn stamp() -> impl Strategy<Value = Stamp> {
    prop_oneof![
        1 => any::<i64>().prop_map(Stamp::Any),
        1 => prop_oneof![Just(i64::MAX), Just(i64::MIN), Just(0)].prop_map(Stamp::Any),
        2 => (-2_000_000_i64..2_000_000).prop_map(Stamp::About),
        2 => (-12_000_i64..12_000).prop_map(Stamp::About),
    ]
}

fn invalid_input() -> impl Strategy<Value = (Stamp, Event)> {
    (
        stamp(),
        any::<bool>()
            .prop_flat_map(|any_number| prop_oneof![bad_sample(any_number), bad_fix(any_number)]),
    )
}

/// Larger ones are in `large_rates_across_gaps_have_no_lasting_effect`.
const CREDIBLE_RADPS: f64 = 1.0;

/// The time stamp is set later.
fn bad_sample(any_number: bool) -> impl Strategy<Value = Event> {
    (three(any_number, CREDIBLE_RADPS), three(any_number, 300.0)).prop_map(|(gyro, accel)| {
        Event::Imu(ImuSample {
            time: Time::default(),
            gyro,
            accel,
        })
    })
}

/// The time stamp is set later.
fn bad_fix(any_number: bool) -> impl Strategy<Value = Event> {
    let number = |credible| number(any_number, credible);
    let position = (number(1.5), number(3.1)).prop_map(|(lat, lon)| LatLon {
        latitude_rad: lat,
        longitude_rad: lon,
    });
    let velocity = (number(100.0), number(100.0)).prop_map(|(e, n)| Vector2::new(e, n));
    (
        prop::option::of(position),
        prop::option::of(number(9e3)),
        prop::option::of(velocity),
        prop::option::of(number(100.0)),
        prop::option::of(number(1.0)),
    )
        .prop_map(|(position, height_m, velocity_en_mps, up, sigma)| {
            Event::Gnss(GnssFix {
                time: Time::default(),
                position,
                height_m,
                velocity_en_mps,
                velocity_up_mps: up,
                sigma: FixSigma {
                    velocity_mps: sigma,
                    velocity_up_mps: sigma,
                    position_m: sigma,
                    height_m: sigma,
                },
            })
        })
}

fn stamped(stamp: Stamp, event: &Event, now: Time) -> Event {
    let time = match stamp {
        Stamp::Any(micros) => Time::from_micros(micros),
        Stamp::About(micros) => Time::from_micros(now.as_micros().saturating_add(micros)),
    };
    match *event {
        Event::Imu(sample) => Event::Imu(ImuSample { time, ..sample }),
        Event::Gnss(fix) => Event::Gnss(GnssFix { time, ..fix }),
    }
}

fn time_of(event: &Event) -> Time {
    match event {
        Event::Imu(sample) => sample.time,
        Event::Gnss(fix) => fix.time,
    }
}

/// Runs the drive with invalid input inserted at fractions of it, in 1/10 000; returns and checks the answers to
/// that input.
fn run_with(navigator: &mut Navigator, invalid_input: &[(usize, Stamp, Event)]) -> Vec<Answer> {
    let mut insertions: Vec<(usize, Stamp, Event)> = invalid_input
        .iter()
        .map(|(part, stamp, event)| (part * EVENTS.len() / 10_000, *stamp, *event))
        .collect();
    insertions.sort_by_key(|(insertion, ..)| *insertion);
    let mut waiting = insertions.iter().peekable();
    let mut answers = Vec::new();
    for (k, event) in EVENTS.iter().enumerate() {
        while let Some((_, stamp, bad)) = waiting.next_if(|(insertion, ..)| *insertion <= k) {
            let bad = stamped(*stamp, bad, time_of(event));
            let before = navigator.clone();
            let answer = handle(navigator, &bad);
            if answer.guarantees_no_change() {
                assert!(*navigator == before, "{answer:?} changed the state");
            }
            let is_time_jump = matches!(
                answer,
                Answer::Imu(ImuOutcome::Gap | ImuOutcome::TimeNotIncreasing)
            );
            if is_time_jump && navigator.phase() == before.phase() {
                assert_eq!(navigator.solution(), before.solution());
                assert_eq!(navigator.estimates(), before.estimates());
            }
            assert_valid(navigator);
            answers.push(answer);
        }
        let _ = handle(navigator, event);
    }
    assert_valid(navigator);
    answers
}

static CLEAN: LazyLock<Navigator> = LazyLock::new(|| {
    let mut navigator = navigator();
    run_with(&mut navigator, &[]);
    navigator
});

#[test]
fn accuracy_without_invalid_input() {
    let [position, velocity, heading] = errors(&CLEAN).unwrap();
    println!("{position} m, {velocity} m/s, {heading} rad");
    assert!(position < 3.0 && velocity < 0.2 && heading < 0.01);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Rejected input leaves the state unchanged.
    #[test]
    fn invalid_input_leaves_a_valid_state(
        bad in prop::collection::vec((0..7_000_usize, invalid_input()), 1..40),
    ) {
        let bad: Vec<_> = bad.into_iter().map(|(part, (stamp, event))| (part, stamp, event)).collect();
        let mut navigator = navigator();
        // The first time stamp sets the clock, which has its own test.
        let answers = run_with(&mut navigator, &bad);
        if answers.iter().all(|answer| answer.guarantees_no_change()) {
            prop_assert!(navigator == *CLEAN, "rejected input changed the state");
        }
        prop_assert_eq!(navigator.phase(), Phase::Navigating);
        // Ninety seconds of good data later.
        let [_, velocity, heading] = errors(&navigator).unwrap();
        let affects_ins = |answer: &Answer| matches!(answer, Answer::Imu(ImuOutcome::Accepted | ImuOutcome::Bridged));
        // Credible readings are used: 17 rad/s rotate the INS by a radian in a gap of three samples. Wrong GNSS
        // velocities have no effect after ninety seconds of good fixes; for positions see below.
        if !answers.iter().any(affects_ins) {
            prop_assert!(velocity < 0.3 && heading < 0.05, "{velocity} m/s, {heading} rad after {answers:?}");
        }
    }
}

/// Runs the drive with `bad` inserted at `at_s`; answers, and the navigator `later_s` after that.
fn after(bad: &[Event], at_s: f64, later_s: f64) -> (Vec<Answer>, Navigator) {
    let mut navigator = navigator();
    let mut answers = Vec::new();
    for event in EVENTS.iter() {
        let since_s = time_of(event).as_seconds() - at_s;
        if since_s >= 0.0 && answers.is_empty() {
            answers.extend(bad.iter().map(|bad| handle(&mut navigator, bad)));
        }
        if since_s >= later_s {
            break;
        }
        let _ = handle(&mut navigator, event);
        assert_valid(&navigator);
    }
    (answers, navigator)
}

/// Well before the end, in motion.
const INSERTED_S: f64 = 100.0;

/// A good fix halfway between two of the drive, which are accepted too.
fn good_fix() -> GnssFix {
    let after = DRIVE
        .gnss
        .partition_point(|fix| fix.time.as_seconds() < INSERTED_S);
    let fix = DRIVE.gnss[after];
    GnssFix {
        time: fix.time.plus_seconds(-0.05),
        ..fix
    }
}

/// As without invalid input: errors are below 0.4 m, 0.1 m/s and 0.01 rad at any time of the drive.
fn assert_near_truth(navigator: &Navigator) {
    let [position, velocity, heading] = errors(navigator).unwrap();
    assert!(
        position < 1.0 && velocity < 0.2 && heading < 0.02,
        "{position} m, {velocity} m/s, {heading} rad"
    );
}

/// As from a receiver without a fix.
#[test]
fn one_fix_at_zero_coordinates_has_no_lasting_effect() {
    let with_velocity = good_fix().at(&Geodetic::default());
    let alone = GnssFix {
        velocity_en_mps: None,
        velocity_up_mps: None,
        ..with_velocity
    };
    for fix in [alone, with_velocity] {
        let (_, navigator) = after(&[Event::Gnss(fix)], INSERTED_S, 5.0);
        assert_near_truth(&navigator);
    }
}

#[test]
fn one_wrong_vertical_velocity_has_no_lasting_effect() {
    let fix = GnssFix {
        velocity_up_mps: Some(2_900.0),
        ..good_fix()
    };
    let (_, navigator) = after(&[Event::Gnss(fix)], INSERTED_S, 5.0);
    assert_near_truth(&navigator);
}

#[test]
fn one_wrong_horizontal_velocity_is_rejected() {
    let good = good_fix();
    let fix = GnssFix {
        velocity_en_mps: good.velocity_en_mps.map(|v| v + Vector2::new(60.0, -40.0)),
        // Valid components would be accepted.
        position: None,
        height_m: None,
        velocity_up_mps: None,
        ..good
    };
    let (answers, navigator) = after(&[Event::Gnss(fix)], INSERTED_S, 1.0);
    // Latency is known by then, so the fix is compared before the next one.
    assert!(
        matches!(
            answers[0],
            // Only the velocity is rejected.
            Answer::Gnss(GnssOutcome::Outlier | GnssOutcome::Queued | GnssOutcome::Accepted)
        ),
        "{answers:?}"
    );
    assert_near_truth(&navigator);
}

#[test]
fn fixes_ahead_of_time_are_limited_by_the_queue() {
    let ahead: Vec<Event> = (0..20)
        .map(|k| {
            let good = good_fix();
            // Identical velocities would be rejected as repeated.
            let noise = Vector2::new(1e-3, 0.0) * f64::from(k);
            Event::Gnss(GnssFix {
                time: good.time.plus_seconds(0.3 + 0.03 * f64::from(k)),
                velocity_en_mps: good.velocity_en_mps.map(|v| v + noise),
                ..good
            })
        })
        .collect();
    let (answers, navigator) = after(&ahead, INSERTED_S, 10.0);
    let queued = Answer::Gnss(GnssOutcome::Queued);
    let full = Answer::Gnss(GnssOutcome::TooFarAhead);
    // A second of fixes at 10 Hz.
    assert_eq!(answers[..10], [queued; 10]);
    assert!(
        answers[10..].iter().all(|answer| *answer == full),
        "{answers:?}"
    );
    assert_near_truth(&navigator);
}

/// A stuck receiver repeats the last fix, a coasting one the last velocity. At rest many receivers repeat zero,
/// which is valid.
#[test]
fn repeated_fixes_in_motion_are_rejected() {
    let repeated = |fix: GnssFix| {
        let at = |seconds: f64| GnssFix {
            time: fix.time.plus_seconds(seconds),
            ..fix
        };
        let coasted = GnssFix {
            position: at(0.04).position.map(|insertion| LatLon {
                latitude_rad: insertion.latitude_rad + 1e-6,
                ..insertion
            }),
            ..at(0.04)
        };
        [fix, at(0.02), coasted].map(Event::Gnss)
    };
    let (answers, navigator) = after(&repeated(good_fix()), INSERTED_S, 5.0);
    let rejected = Answer::Gnss(GnssOutcome::Repeated);
    assert_ne!(answers[0], rejected);
    assert_eq!(answers[1..], [rejected; 2]);
    // The next fix of the drive equals `good_fix`, so it is a repetition too.
    assert_eq!(navigator.health().fixes.repeated, 3);
    assert_near_truth(&navigator);

    let stationary = GnssFix {
        velocity_en_mps: Some(Vector2::zeros()),
        ..good_fix()
    };
    let (answers, _) = after(&repeated(stationary), INSERTED_S, 1.0);
    assert!(!answers.contains(&rejected), "{answers:?}");
}

/// A reading within the range, 20 g upwards for one sample.
#[test]
fn one_shock_has_no_lasting_effect() {
    let shock = Event::Imu(ImuSample {
        time: Time::default().plus_seconds(INSERTED_S - 0.005),
        gyro: Vector3::zeros(),
        accel: Vector3::new(0.0, 0.0, 200.0),
    });
    let (answers, navigator) = after(&[shock], INSERTED_S, 20.0);
    assert_eq!(answers, [Answer::Imu(ImuOutcome::Accepted)]);
    assert_near_truth(&navigator);
}

/// A reading within the range at the end of a gap: bridging with it would cause radians of heading error.
#[test]
fn a_gap_is_not_bridged_with_an_implausible_reading() {
    let wrong = Event::Imu(ImuSample {
        time: Time::default().plus_seconds(INSERTED_S + 0.4),
        gyro: Vector3::new(5.0, -3.0, 17.0),
        accel: Vector3::new(0.0, 0.0, 9.8),
    });
    let (answers, navigator) = after(&[wrong], INSERTED_S, f64::INFINITY);
    assert_eq!(answers, [Answer::Imu(ImuOutcome::Gap)]);
    assert_accurate_at_end(&navigator);
}

/// The drive with all time stamps from [`INSERTED_S`] on shifted.
fn with_clock_shifted(by_s: f64) -> Navigator {
    let mut navigator = navigator();
    for event in EVENTS.iter() {
        let time = time_of(event);
        let shifted = if time.as_seconds() < INSERTED_S {
            time
        } else {
            time.plus_seconds(by_s)
        };
        let _ = handle(
            &mut navigator,
            &stamped(Stamp::Any(shifted.as_micros()), event, shifted),
        );
    }
    assert_valid(&navigator);
    navigator
}

fn assert_accurate_at_end(navigator: &Navigator) {
    let truth = DRIVE.truth.last().unwrap();
    let solution = navigator.solution().expect("navigating");
    let velocity = (solution.velocity_enu_mps - truth.velocity_enu_mps).norm();
    let position = solution.position.enu_from(&truth.position).norm();
    let attitude = solution.attitude.angle_to(&truth.attitude);
    // Position noise is correlated over a minute, so a few fixes after a restart are less accurate.
    let sigma = navigator.sigma().expect("exact").position_m.norm();
    assert!(
        position < 3.0 * sigma && velocity < 0.2 && attitude < 0.02,
        "{position} m of {sigma}, {velocity} m/s, {attitude} rad"
    );
}

#[test]
fn a_clock_set_forward_is_handled() {
    for by_s in [0.7, 3.0, 3_600.0, 1e9] {
        assert_accurate_at_end(&with_clock_shifted(by_s));
    }
}

#[test]
fn a_clock_set_back_is_handled() {
    for by_s in [-3.0, -3_600.0, -1e9] {
        assert_accurate_at_end(&with_clock_shifted(by_s));
    }
}

fn at(seconds: f64) -> Time {
    Time::default().plus_seconds(seconds)
}

/// A reading at rest with a time stamp outside the drive.
fn stray_sample(time: Time) -> Event {
    Event::Imu(ImuSample {
        time,
        gyro: Vector3::zeros(),
        accel: Vector3::new(0.0, 0.0, 9.8),
    })
}

#[test]
fn a_wrong_first_time_stamp_does_not_block() {
    for micros in [i64::MAX, 3_600_000_000] {
        let mut navigator = navigator();
        let _ = handle(&mut navigator, &stray_sample(Time::from_micros(micros)));
        run_with(&mut navigator, &[]);
        assert_accurate_at_end(&navigator);
    }
}

#[test]
fn two_consistent_wrong_time_stamps_do_not_block() {
    let bad = [1_000.0, 1_000.01].map(|ahead_s| stray_sample(at(INSERTED_S + ahead_s)));
    let (_, navigator) = after(&bad, INSERTED_S, f64::INFINITY);
    assert_accurate_at_end(&navigator);
}

#[test]
fn one_wrong_time_stamp_does_not_block() {
    for ahead_s in [0.7, 1_000.0, 9e12] {
        let (answers, navigator) =
            after(&[stray_sample(at(INSERTED_S + ahead_s))], INSERTED_S, 1.0);
        assert_eq!(answers, [Answer::Imu(ImuOutcome::Gap)]);
        assert_near_truth(&navigator);
    }
}

#[test]
fn a_long_gap_causes_a_restart_that_keeps_estimates() {
    let mut navigator = navigator();
    let mut before_gap = None;
    for event in EVENTS.iter() {
        let time_s = time_of(event).as_seconds();
        if (150.0..158.0).contains(&time_s) {
            let known = before_gap.get_or_insert_with(|| navigator.estimates());
            assert_eq!(known.gyro_bias_radps, navigator.estimates().gyro_bias_radps);
            continue;
        }
        let _ = handle(&mut navigator, event);
        if (158.1..158.2).contains(&time_s) {
            assert_eq!(navigator.phase(), Phase::FindingHeading);
            // The stopgap solution until realignment.
            assert!(navigator.solution().is_some());
            assert!(navigator.sigma().unwrap().attitude_rad.z > 0.5);
            let now = navigator.estimates().gyro_bias_radps;
            let pairs = before_gap
                .iter()
                .flat_map(|known| known.gyro_bias_radps.iter().zip(&now));
            for (before, after) in pairs {
                assert!((before.value - after.value).abs() < 1e-15);
            }
        }
    }
    assert!(before_gap.is_some());
    assert_accurate_at_end(&navigator);
}

#[test]
fn a_clone_continues_bit_for_bit() {
    let half = EVENTS.len() / 2;
    let mut navigator = navigator();
    for event in &EVENTS[..half] {
        let _ = handle(&mut navigator, event);
    }
    let mut snapshot = navigator.clone();
    for event in &EVENTS[half..] {
        assert_eq!(handle(&mut navigator, event), handle(&mut snapshot, event));
    }
    assert!(navigator == snapshot);
    assert!(navigator == *CLEAN);
}

/// Readings within the range that would rotate by radians if gaps were bridged with them, beyond the validity of
/// small-angle series.
#[test]
fn large_rates_across_gaps_have_no_lasting_effect() {
    for output in [ImuOutput::Rates, ImuOutput::Increments] {
        let mut navigator = Navigator::new(Config {
            imu_output: output,
            ..config()
        })
        .unwrap();
        let unit = |rate: Vector3<f64>| match output {
            ImuOutput::Rates => rate,
            ImuOutput::Increments => 0.01 * rate,
        };
        let at_rest = |time: Time| ImuSample {
            time,
            gyro: unit(Vector3::zeros()),
            accel: unit(Vector3::new(0.0, 0.0, 9.8)),
        };
        let start = *DRIVE.gnss.first().unwrap();
        let mut time = start.time;
        let mut run_at_rest = |navigator: &mut Navigator, seconds: f64| {
            let end = time.plus_seconds(seconds);
            while time < end {
                time = time.plus_seconds(0.01);
                let _ = navigator.on_imu(&at_rest(time));
                if time.as_micros() % 100_000 == 0 {
                    let _ = navigator.on_gnss(&GnssFix {
                        time,
                        velocity_en_mps: Some(Vector2::zeros()),
                        ..start
                    });
                }
            }
            time
        };
        let now = run_at_rest(&mut navigator, 30.0);
        assert_eq!(navigator.phase(), Phase::Navigating);
        for k in [1.0, 2.0] {
            let wrong = ImuSample {
                time: now.plus_seconds(0.45 * k),
                gyro: unit(Vector3::repeat(17.9)),
                accel: unit(Vector3::repeat(360.0)),
            };
            assert_eq!(navigator.on_imu(&wrong), ImuOutcome::Gap);
        }
        assert_valid(&navigator);
        run_at_rest(&mut navigator, 60.0);
        assert_valid(&navigator);
    }
}

//! Interface for ports: health, body motion, headings, stored calibration, restored state.

use std::sync::LazyLock;

use host_sim::identify::run::in_order_of_time;
use host_sim::log::Grade;
use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use host_sim::study::accuracy::config_of;
use ins_core::config::HeadingSource;
use ins_core::earth::wrap_pi;
use ins_core::{
    Calibration, Config, ConfigError, GnssFix, GnssOutcome, Heading, ImuOutcome, ImuOutput,
    ImuSample, Navigator, Observability, Phase, Solution,
};
use nalgebra::Vector3;

const MINUTES: f64 = 12.0;

static DRIVE: LazyLock<SimulatedDrive> = LazyLock::new(|| {
    let mut drive = DriveConfig::new(3, Grade::Mems, MINUTES);
    drive.recording.truth_every = 1;
    simulate(&drive)
});

fn navigator() -> Navigator {
    Navigator::new(config_of(Grade::Mems)).unwrap()
}

/// Runs a part of a drive; `each` is called after every sample.
fn run(
    navigator: &mut Navigator,
    drive: &SimulatedDrive,
    span_s: std::ops::Range<f64>,
    mut each: impl FnMut(&mut Navigator, usize, &ImuSample),
) {
    let before = |sample: &ImuSample| sample.time.as_seconds() < span_s.start;
    let mut samples = drive.imu.partition_point(before)..;
    for event in in_order_of_time(&drive.imu, &drive.gnss) {
        if span_s.contains(&event.time().as_seconds())
            && let Some(sample) = event.give_to(navigator)
            && let Some(count) = samples.next()
        {
            each(navigator, count, &sample);
        }
    }
}

fn heading_error_rad(navigator: &Navigator, drive: &SimulatedDrive, count: usize) -> f64 {
    let heading_rad = navigator.solution().unwrap().euler().heading_rad;
    // The truth begins at the start of the first increment.
    wrap_pi(heading_rad - drive.truth[count + 1].euler().heading_rad)
}

#[test]
fn a_restored_navigator_continues_bit_for_bit() {
    let drive = &*DRIVE;
    // In levelling, heading search and navigation; the last estimates fewest parameters.
    for (stop_s, config) in [
        (5.0, config_of(Grade::Mems)),
        (14.0, config_of(Grade::Mems)),
        (300.0, config_of(Grade::Mems)),
        (300.0, Config::hg1700()),
    ] {
        let mut navigator = Navigator::new(config).unwrap();
        run(&mut navigator, drive, 0.0..stop_s, |_, _, _| {});
        let bytes = postcard::to_stdvec(&navigator).unwrap();
        let mut restored: Navigator = postcard::from_bytes(&bytes).unwrap();
        // A format without infinities, and not exact to the last bit.
        let text = serde_json::to_string(&navigator).unwrap();
        let read = serde_json::from_str::<Navigator>(&text);
        assert!(read.is_ok(), "{stop_s}: {:?}", read.err());
        assert!(restored == navigator && restored.health() == navigator.health());
        for navigator in [&mut navigator, &mut restored] {
            run(navigator, drive, stop_s..stop_s + 60.0, |_, _, _| {});
        }
        assert!(restored == navigator, "{stop_s}");
        assert_eq!(restored.solution(), navigator.solution());
    }
}

#[test]
fn restoring_checks_the_configuration() {
    let navigator: Navigator = Navigator::new(Config::mems()).unwrap();
    let mut tree = serde_json::to_value(&navigator).unwrap();
    *tree.pointer_mut("/config/max_gap_s").unwrap() = (-1.0).into();
    let error = serde_json::from_value::<Navigator>(tree).unwrap_err();
    assert!(error.to_string().contains("max_gap_s"), "{error}");
}

#[test]
fn each_fix_gets_one_outcome() {
    let drive = &*DRIVE;
    let mut navigator = navigator();
    let mut settled = Vec::new();
    run(&mut navigator, drive, 0.0..200.0, |navigator, _, _| {
        settled.extend(navigator.health().last_fix);
    });
    let health = navigator.health();
    assert_eq!(health.phase, Phase::Navigating);
    settled.dedup();
    let fixes = drive
        .gnss
        .iter()
        .filter(|fix| fix.time.as_seconds() < 200.0);
    let reported: usize = settled.iter().map(|report| usize::from(report.fixes)).sum();
    let waiting = fixes.count() - reported;
    assert!(waiting < 10, "{waiting} fixes without an outcome");
    assert!(settled.windows(2).all(|pair| pair[0].time < pair[1].time));
    let counts = health.fixes;
    // A latency that becomes known makes the moments of fixes that wait pass sooner.
    let rejected =
        counts.no_inertial_data + counts.outlier + counts.too_old + counts.time_not_increasing;
    assert_eq!(
        (counts.accepted + rejected) as usize,
        reported,
        "{counts:?}"
    );
    let samples = drive
        .imu
        .iter()
        .filter(|s| s.time.as_seconds() < 200.0)
        .count();
    assert_eq!(health.samples.accepted as usize, samples);
    let level = health.level_nis.unwrap();
    assert!((0.1..4.0).contains(&level), "{level}");
}

#[test]
fn health_reports_outages_and_rejected_fixes() {
    let drive = &*DRIVE;
    let mut navigator = navigator();
    run(&mut navigator, drive, 0.0..120.0, |_, _, _| {});
    assert_eq!(navigator.health().coasting_since, None);
    let last = drive
        .imu
        .iter()
        .find(|s| s.time.as_seconds() >= 120.0)
        .unwrap();
    let far = GnssFix {
        time: last.time,
        velocity_en_mps: Some([500.0, 0.0].into()),
        ..GnssFix::default()
    };
    let _ = navigator.on_gnss(&far);
    for sample in drive.imu.iter().filter(|s| s.time >= last.time).take(1000) {
        assert_eq!(navigator.on_imu(sample), ImuOutcome::Accepted);
    }
    let health = navigator.health();
    let since = health.coasting_since.expect("no fix for ten seconds");
    // The last fix is from 0.1 s before, and is compared within 0.3 s, as derived in core/tests/damping.rs.
    let after_s = since.seconds_since(last.time);
    assert!((-0.1..0.3).contains(&after_s), "{after_s}");
    let report = health.last_fix.unwrap();
    assert_eq!(
        (report.time, report.outcome),
        (far.time, GnssOutcome::Outlier)
    );
    assert_eq!(health.fixes.outlier, 1);
}

#[test]
fn body_rates_are_corrected_by_the_bias() {
    let drive = &*DRIVE;
    let mut navigator = navigator();
    run(&mut navigator, drive, 0.0..600.0, |_, _, _| {});
    let bias = Vector3::from(drive.errors.gyro_bias_radps);
    let mut removed_bias = Vector3::zeros();
    run(
        &mut navigator,
        drive,
        600.0..660.0,
        |navigator, _, sample| {
            let motion = navigator.body_motion().unwrap();
            assert_eq!(motion.time, sample.time);
            removed_bias += (sample.gyro - motion.rate_radps) / 6000.0;
        },
    );
    assert!(
        (removed_bias - bias).norm() < 0.02 * bias.norm(),
        "{removed_bias} {bias}"
    );
}

/// After 12 s at rest, before GNSS determines heading: the given heading has an error of 0.3 rad.
fn navigator_with_heading_error(drive: &SimulatedDrive) -> Navigator {
    let config = Config {
        heading: HeadingSource::Given(drive.truth[0].euler().heading_rad + 0.3),
        ..config_of(Grade::Mems)
    };
    let mut navigator = Navigator::new(config).unwrap();
    run(&mut navigator, drive, 0.0..12.0, |_, _, _| {});
    assert_eq!(navigator.phase(), Phase::Navigating);
    navigator
}

/// A correct heading with a sigma of 1 deg is accepted; one with an error of many sigmas is rejected.
#[test]
fn a_measured_heading_is_weighted_by_its_sigma() {
    let drive = &*DRIVE;
    let mut navigator = navigator_with_heading_error(drive);
    let (count, sample) = drive
        .imu
        .iter()
        .enumerate()
        .find(|(_, s)| s.time.as_seconds() >= 11.95)
        .unwrap();
    let truth_rad = drive.truth[count + 1].euler().heading_rad;
    let measured = |heading_rad| Heading {
        time: sample.time,
        heading_rad,
        sigma_rad: 1_f64.to_radians(),
    };
    assert!(heading_error_rad(&navigator, drive, count).abs() > 0.25);
    assert_eq!(
        navigator.on_heading(&measured(truth_rad + 0.01)),
        GnssOutcome::Accepted
    );
    run(&mut navigator, drive, 12.0..16.0, |_, _, _| {});
    let before = |s: &ImuSample| s.time.as_seconds() < 16.0;
    let at = drive.imu.iter().rposition(before).unwrap();
    let error = heading_error_rad(&navigator, drive, at);
    let sigma = navigator.sigma().unwrap().attitude_rad.z;
    assert!((error - 0.01).abs() < 0.005, "{error}");
    assert!((0.015..0.02).contains(&sigma), "{sigma}");
    let last = drive.imu[at];
    let wrong = Heading {
        time: last.time,
        ..measured(truth_rad + 0.5)
    };
    let before = navigator.clone();
    assert_eq!(navigator.on_heading(&wrong), GnssOutcome::Outlier);
    let (old, ahead) = (wrong.time.plus_seconds(-5.0), wrong.time.plus_seconds(0.5));
    for (time, rejected) in [
        (old, GnssOutcome::TooOld),
        (ahead, GnssOutcome::TooFarAhead),
    ] {
        assert_eq!(navigator.on_heading(&Heading { time, ..wrong }), rejected);
    }
    assert!(navigator == before, "a refusal left a trace");
}

/// While the platform is corrected by the first of them, later headings still refer to times before.
#[test]
fn a_late_heading_is_compared_with_the_past_azimuth_error() {
    let drive = &*DRIVE;
    let mut navigator = navigator_with_heading_error(drive);
    run(&mut navigator, drive, 12.0..20.0, |navigator, count, _| {
        if count % 10 == 0 {
            // 0.8 s late.
            let past = count - 80;
            let outcome = navigator.on_heading(&Heading {
                time: drive.imu[past].time,
                heading_rad: drive.truth[past + 1].euler().heading_rad,
                sigma_rad: 0.005,
            });
            assert_eq!(outcome, GnssOutcome::Accepted, "{:?}", drive.imu[past].time);
        }
    });
    let before = |s: &ImuSample| s.time.as_seconds() < 20.0;
    let at = drive.imu.iter().rposition(before).unwrap();
    let error = heading_error_rad(&navigator, drive, at);
    assert!(error.abs() < 0.002, "{error}");
}

/// Headings measured during levelling are the initial heading.
#[test]
fn measured_headings_end_alignment() {
    let drive = &*DRIVE;
    let mut navigator = navigator();
    let truth_rad = drive.truth[0].euler().heading_rad;
    run(&mut navigator, drive, 0.0..12.0, |navigator, _, sample| {
        let _ = navigator.on_heading(&Heading {
            time: sample.time,
            heading_rad: truth_rad,
            sigma_rad: 0.02,
        });
    });
    assert_eq!(navigator.phase(), Phase::Navigating);
    assert!(navigator.sigma().unwrap().attitude_rad.z < 0.021);
}

/// A dual-antenna heading that becomes available late, on a stationary vehicle.
#[test]
fn measured_headings_end_the_heading_search() {
    let drive = &*DRIVE;
    let first = drive.imu[0].time;
    let measured = |sample: &ImuSample, heading_rad, sigma_rad| Heading {
        time: sample.time,
        heading_rad,
        sigma_rad,
    };
    let truth_rad = drive.truth[0].euler().heading_rad;
    let moves = |truth: &Solution| truth.velocity_enu_mps.norm() > 0.1;
    let start_s = drive.truth.iter().find(|truth| moves(truth)).unwrap().time;
    let rest_s = start_s.seconds_since(first);
    assert!(rest_s > 25.0, "{rest_s}");
    let mut navigator = navigator();
    run(&mut navigator, drive, 0.0..14.0, |navigator, _, sample| {
        // Until then the stated sigma is too large.
        let unknown = measured(sample, truth_rad + 2.0, 1.5);
        let outcome = navigator.on_heading(&unknown);
        assert_eq!(outcome, GnssOutcome::OutOfRange);
    });
    assert_eq!(navigator.phase(), Phase::FindingHeading);
    run(
        &mut navigator,
        drive,
        14.0..24.5,
        |navigator, count, sample| {
            if count % 20 == 0 {
                let _ = navigator.on_heading(&measured(sample, truth_rad, 0.02));
            }
        },
    );
    assert_eq!(navigator.phase(), Phase::Navigating);
    assert!(navigator.sigma().unwrap().attitude_rad.z < 0.021);
}

/// With fixes at the rate of the samples there is no time for the deferred work of the estimators.
#[test]
fn a_receiver_may_be_as_fast_as_the_sensors() {
    let mut config = DriveConfig::new(3, Grade::Mems, 6.0);
    config.recording.truth_every = 1;
    config.recording.errors.gnss.rate_hz = config.recording.imu_hz;
    let drive = simulate(&config);
    let mut navigator = navigator();
    let mut worst: f64 = 0.0;
    run(&mut navigator, &drive, 0.0..360.0, |navigator, count, _| {
        if let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) {
            let velocity_error =
                solution.velocity_enu_mps - drive.truth[count + 1].velocity_enu_mps;
            worst = worst.max(velocity_error.norm() / sigma.velocity_mps.norm());
        }
    });
    assert_eq!(navigator.phase(), Phase::Navigating);
    assert!(worst < 5.0, "{worst}");
}

/// A second run with the same unit starts with the estimates of the first.
#[test]
fn a_stored_calibration_is_weighted_by_its_sigmas() {
    let drive = &*DRIVE;
    let mut first = navigator();
    run(&mut first, drive, 0.0..700.0, |_, _, _| {});
    let text = serde_json::to_string(&first.calibration()).unwrap();
    let stored: Calibration = serde_json::from_str(&text).unwrap();
    let turned_on = stored.after_turn_on(1e-4, 1e-3);
    let mut warm = Navigator::warm(config_of(Grade::Mems), &turned_on).unwrap();
    let mut cold = navigator();
    for navigator in [&mut warm, &mut cold] {
        run(navigator, drive, 0.0..60.0, |_, _, _| {});
    }
    let sigmas = |navigator: &Navigator| {
        let estimates = navigator.estimates();
        [
            estimates.accel_bias_mps2[0].sigma,
            estimates.accel_bias_mps2[1].sigma,
            estimates.gnss_latency_s.sigma,
        ]
    };
    for (warm, cold) in sigmas(&warm).into_iter().zip(sigmas(&cold)) {
        assert!(warm < 0.6 * cold, "{warm} {cold}");
    }
    let mut broken = stored;
    broken.clock_drift.sigma = -1.0;
    assert!(Navigator::warm(Config::mems(), &broken).is_err());
}

/// A stored long smoothing is not treated as newly learnt: the sigma of the arm is kept.
#[test]
fn a_stored_smoothing_keeps_the_lever_arm_sigma() {
    let drive = &*DRIVE;
    let mut stored = navigator().calibration();
    stored.gnss_smoothing_s2.value = 0.25;
    for is_accurate in stored
        .lever_arm_m
        .iter_mut()
        .chain([&mut stored.gnss_smoothing_s2])
    {
        is_accurate.sigma = 0.01;
    }
    let mut warm = Navigator::warm(config_of(Grade::Mems), &stored).unwrap();
    run(&mut warm, drive, 0.0..120.0, |_, _, _| {});
    assert_eq!(warm.phase(), Phase::Navigating);
    let arm = warm.estimates().lever_arm_m;
    // The sigma only grows by the consistency check; before, it was reset to 3 m.
    assert!(arm.iter().all(|axis| axis.sigma < 0.1), "{arm:?}");
}

/// Sigmas that underflow single precision, and parameters that another configuration gives.
#[test]
fn any_accepted_calibration_gives_finite_results() {
    let drive = &*DRIVE;
    let stored = {
        let mut navigator = navigator();
        run(&mut navigator, drive, 0.0..200.0, |_, _, _| {});
        navigator.calibration()
    };
    for sigma in [1e-50, 1e-20] {
        let mut small = stored;
        small.gyro_bias_radps[2].sigma = sigma;
        small.gnss_latency_s.sigma = sigma;
        let mut warm = Navigator::warm(config_of(Grade::Mems), &small).unwrap();
        run(&mut warm, drive, 0.0..120.0, |navigator, _, _| {
            let solution = navigator.solution();
            assert!(solution.is_none_or(|s| s.attitude.coords.iter().all(|q| q.is_finite())));
        });
        let arm = warm.estimates().lever_arm_m;
        assert!(arm.iter().all(|axis| axis.sigma < 2.0), "{arm:?}");
    }
    let mut config = config_of(Grade::Mems);
    let antenna = [0.5, 1.0, 1.5];
    config.gnss.lever_arm_m = antenna;
    config.gnss.lever_arm_sigma_m = 0.0;
    let with_scales = config;
    config.sensors.accel_scale = 0.0;
    config.sensors.gyro_scale = 0.0;
    config.sensors.cross_axis = 0.0;
    // With and without parameters after the arm.
    for config in [with_scales, config] {
        let warm = Navigator::warm(config, &stored).unwrap();
        let arm = warm.estimates().lever_arm_m;
        for (axis, antenna) in arm.iter().zip(antenna) {
            assert!((axis.value - antenna).abs() < 1e-9, "{arm:?}");
        }
        let given = |estimate: ins_core::Estimate| estimate.observability == Observability::Given;
        assert!(arm.into_iter().all(given));
    }
    // As after a bit error.
    let mut broken = stored;
    broken.gyro_bias_radps[0].value = 1e300;
    let rejected = Navigator::warm(config_of(Grade::Mems), &broken).unwrap_err();
    assert_eq!(rejected, ConfigError::NotFinite("calibration"));
}

/// No restart if the heading search determines the latency less accurately than configured.
#[test]
fn a_configured_latency_is_kept() {
    let mut drive = DriveConfig::new(5, Grade::Mems, 5.0);
    drive.recording.errors.gnss.latency_s = [0.0, 0.0];
    let drive = simulate(&drive);
    let mut config = config_of(Grade::Mems);
    config.heading = HeadingSource::Motion;
    config.gnss.latency_sigma_s = 1e-3;
    let mut navigator = Navigator::new(config).unwrap();
    run(&mut navigator, &drive, 0.0..300.0, |_, _, _| {});
    let health = navigator.health();
    assert_eq!((health.phase, health.restarts), (Phase::Navigating, 0));
    let latency = navigator.estimates().gnss_latency_s;
    // Clock drift adds to it.
    let is_accurate = latency.value.abs() < 0.01 && latency.sigma < 0.005;
    assert!(is_accurate, "{latency:?}");
}

/// As of a barometer.
#[test]
fn separate_heights_do_not_block_positions() {
    let mut navigator = navigator();
    let mut next_s = 0.0;
    run(
        &mut navigator,
        &DRIVE,
        0.0..200.0,
        |navigator, count, sample| {
            if sample.time.as_seconds() >= next_s {
                next_s += 0.2;
                let _ = navigator.on_gnss(&GnssFix {
                    time: sample.time,
                    height_m: Some(DRIVE.truth[count + 1].position.height_m),
                    ..GnssFix::default()
                });
            }
        },
    );
    let sigma = navigator.sigma().unwrap();
    assert!(sigma.position_m.xy().norm() < 5.0, "{sigma:?}");
}

/// Increments at a twentieth of the rate are twenty times as large: they cause one restart only.
#[test]
fn increments_at_a_lower_rate_are_accepted() {
    let mut drive = DriveConfig::new(3, Grade::Mems, 1.0);
    drive.recording.errors.imu.output = ImuOutput::Increments;
    let imu = simulate(&drive).imu;
    let mut config = config_of(Grade::Mems);
    config.imu_output = ImuOutput::Increments;
    let mut navigator = Navigator::new(config).unwrap();
    for sample in &imu[..3000] {
        let _ = navigator.on_imu(sample);
    }
    let mut last = None;
    for samples in imu[3000..].chunks_exact(20) {
        last = Some(navigator.on_imu(&ImuSample {
            time: samples[19].time,
            gyro: samples.iter().map(|sample| sample.gyro).sum(),
            accel: samples.iter().map(|sample| sample.accel).sum(),
        }));
    }
    assert_eq!(last, Some(ImuOutcome::Accepted));
}

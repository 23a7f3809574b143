//! Simulated receivers and drives: each habit has its effect and no other.

use host_sim::log::Grade;
use host_sim::sim::car::Car;
use host_sim::sim::errors::{GnssModel, Outage};
use host_sim::sim::gnss::Gnss;
use host_sim::sim::receiver::{Correlated, Outliers, Stated, Trouble, Up, Wrong};
use host_sim::sim::{DriveConfig, ErrorModel, Motion, SimulatedDrive, simulate};
use ins_core::{GnssFix, Time};
use nalgebra::Vector3;

use super::statistics::{assert_correlation, assert_mean, assert_sigma};

const RATE_HZ: f64 = 10.0;

/// Three minutes in a car with error-free sensors and receiver, apart from the changes.
fn drive_with(change: impl Fn(&mut GnssModel)) -> SimulatedDrive {
    let mut config = DriveConfig::ideal(8, 3.0);
    config.initial_rest_s = None;
    change(&mut config.recording.errors.gnss);
    simulate(&config)
}

fn trouble(start_s: f64, duration_s: f64, wrong: Wrong) -> Trouble {
    Trouble {
        start_s,
        duration_s,
        wrong,
    }
}

#[test]
fn white_and_correlated_parts_add_up() {
    let exact = drive_with(|_| {});
    let noisy = drive_with(|gnss| {
        gnss.velocity_sigma_mps = 0.03;
        // Correlation time much shorter than the fix interval: samples are independent.
        gnss.habits.velocity = Correlated {
            sigma: 0.04,
            time_s: 1e-3,
        };
        gnss.habits.stated = Stated::All;
    });
    let error: Vec<f64> = noisy
        .gnss
        .iter()
        .zip(&exact.gnss)
        .map(|(n, e)| n.velocity_up_mps.unwrap() - e.velocity_up_mps.unwrap())
        .collect();
    assert_sigma(&error, 0.05);
    assert!((noisy.gnss[0].sigma.velocity_mps.unwrap() - 0.05).abs() < 1e-12);
    assert_eq!(noisy.imu, exact.imu);
}

#[test]
fn smoothing_lag_matches_the_reported_lag() {
    let drive = drive_with(|gnss| gnss.habits.smoothing_s = 0.3);
    let lag_s = drive.errors.gnss_lag_s;
    // A sampled low-pass lags T e / (1 - e), a little less than its time constant.
    assert!((0.25..0.3).contains(&lag_s), "{lag_s}");
    let mut car = Car::new(8, 180.0, None);
    let mut worst = [0.0_f64; 2];
    for fix in drive.gnss.iter().skip(50) {
        let stamp_s = fix.time.as_seconds();
        for (worst, back_s) in worst.iter_mut().zip([lag_s, 0.0]) {
            let expected = car.kinematics(stamp_s - back_s).velocity_enu_mps;
            *worst = worst.max((fix.velocity_enu_mps() - expected).norm());
        }
    }
    assert!(worst[0] < 0.5 * worst[1], "{worst:?}");
}

#[test]
fn receivers_hold_positions_and_difference_positions() {
    let exact = drive_with(|_| {});
    let holding = drive_with(|gnss| gnss.habits.holds_below_mps = 8.0);
    let mut held = None;
    let mut count = 0;
    for (exact, fix) in exact.gnss.iter().zip(&holding.gnss) {
        if exact.velocity_enu_mps().norm() >= 8.0 {
            assert_eq!(exact, fix);
            held = None;
        } else {
            assert_eq!(fix.velocity_enu_mps(), Vector3::zeros());
            assert_eq!(fix.position, *held.get_or_insert(exact.position));
            count += 1;
        }
    }
    assert!(count > 100);
    let differences = drive_with(|gnss| gnss.habits.velocity_by_differences = true);
    assert!((differences.errors.gnss_lag_s - 0.5 / RATE_HZ).abs() < 1e-12);
    for pair in differences.gnss.windows(2) {
        let [from, to] = [0, 1].map(|at| pair[at].geodetic_or(0.0).unwrap());
        let error = RATE_HZ * to.enu_from(&from) - pair[1].velocity_enu_mps();
        assert!(error.norm() < 1e-6, "{error}");
    }
}

#[test]
fn receivers_coast_and_float() {
    let wrong = drive_with(|gnss| {
        gnss.horizontal_sigma_m = 0.4;
        gnss.habits.stated = Stated::White;
        gnss.habits.troubles = vec![
            trouble(20.0, 5.0, Wrong::Coasting),
            trouble(60.0, 5.0, Wrong::Float([0.0, 0.3, 0.0])),
        ];
    });
    let (last, coasted) = (&wrong.gnss[199], &wrong.gnss[249]);
    assert_eq!(coasted.velocity_en_mps, last.velocity_en_mps);
    let [from, to] = [last, coasted].map(|fix| fix.geodetic_or(0.0).unwrap());
    let error = to.enu_from(&from) - 5.0 * last.velocity_enu_mps();
    assert!(error.norm() < 0.01, "{error}");
    let stated = |at: usize| wrong.gnss[at].sigma.position_m.unwrap();
    assert!((stated(620) - 0.5).abs() < 1e-12 && (stated(700) - 0.4).abs() < 1e-12);
}

/// With the complete solution, not only the logged parts.
#[test]
fn receivers_coast_with_the_complete_solution() {
    type Change = fn(&mut GnssModel);
    let changes: [Change; 4] = [
        |gnss| gnss.habits.up = Up::Down,
        |gnss| gnss.habits.up = Up::Missing,
        |gnss| gnss.habits.gives_velocity = false,
        |gnss| gnss.habits.gives_position = false,
    ];
    let coasting = |change: Change| {
        drive_with(|gnss| {
            // Noticeable vertical velocities.
            gnss.velocity_sigma_mps = 1.0;
            gnss.habits.troubles = vec![trouble(20.0, 5.0, Wrong::Coasting)];
            change(gnss);
        })
    };
    let complete = coasting(|_| {}).gnss;
    assert!(complete[199].velocity_up_mps.unwrap().abs() > 0.1);
    for change in changes {
        for (fix, complete) in coasting(change).gnss.iter().zip(&complete) {
            assert_eq!(
                fix.position,
                complete.position.filter(|_| fix.position.is_some())
            );
            assert_eq!(fix.height_m, complete.height_m);
            let level = complete.velocity_en_mps;
            let level = level.filter(|_| fix.velocity_en_mps.is_some());
            assert_eq!(fix.velocity_en_mps, level);
        }
    }
}

/// A vehicle that moved during the outage has another position afterwards.
#[test]
fn held_positions_are_released_in_an_outage() {
    let holding = |gnss: &mut GnssModel| gnss.habits.holds_below_mps = 8.0;
    let complete = drive_with(holding).gnss;
    let held = |fix: &&GnssFix| fix.velocity_enu_mps() == Vector3::zeros();
    // From one stop to the next.
    let stops: Vec<&GnssFix> = complete.iter().filter(held).collect();
    let [before, after] = *stops
        .array_windows()
        .find(|[a, b]| a.position != b.position)
        .unwrap();
    let outage = Outage {
        start_s: before.time.as_seconds(),
        duration_s: after.time.seconds_since(before.time),
    };
    let lossy = drive_with(|gnss| {
        holding(gnss);
        gnss.outages = vec![outage];
    });
    assert!(outage.duration_s > 1.0 && lossy.gnss.len() < complete.len());
    assert!(lossy.gnss.iter().all(|fix| complete.contains(fix)));
}

#[test]
fn clock_drift_changes_the_latency() {
    let drive = drive_with(|gnss| gnss.habits.clock_drift = 1e-3);
    let gained_s = drive.errors.gnss_latency_end_s - drive.errors.gnss_latency_s;
    assert!((gained_s - 0.18).abs() < 1e-9);
    let exact = drive_with(|_| {});
    // After 100 s a fix equals the one 0.1 s earlier without drift.
    let find = |drive: &SimulatedDrive, stamp_s: f64| {
        let time = Time::default().plus_seconds(stamp_s);
        *drive.gnss.iter().find(|fix| fix.time == time).unwrap()
    };
    let error = find(&drive, 100.0).velocity_enu_mps() - find(&exact, 99.9).velocity_enu_mps();
    assert!(error.norm() < 1e-6);
}

#[test]
fn lever_arm_is_applied_to_position_and_velocity() {
    let arm_m = [1.5, -2.0, 2.5];
    let drive = drive_with(|gnss| gnss.habits.lever_arm_m = arm_m);
    let mut arm_velocity_mps = 0.0_f64;
    for (fix, truth) in drive.gnss.iter().zip(&drive.truth) {
        assert_eq!(fix.time, truth.time);
        let position = fix.geodetic_or(0.0).unwrap();
        let arm = truth.attitude * Vector3::from(arm_m);
        let error = position.enu_from(&truth.position) - arm;
        // Curvature of the frame, 1e-6 relative.
        assert!(error.norm() < 1e-5, "{error}");
        arm_velocity_mps =
            arm_velocity_mps.max((fix.velocity_enu_mps() - truth.velocity_enu_mps).norm());
    }
    assert!(arm_velocity_mps > 0.5);
    // Between samples velocity is the derivative of the position.
    for pair in drive.gnss.windows(3) {
        let places = [0, 2].map(|at| pair[at].geodetic_or(0.0).unwrap());
        let mean = places[1].enu_from(&places[0]) / (2.0 / RATE_HZ);
        // h^2/6 of the second derivative of a velocity whose acceleration changes by 3 m/s^2 in half a second.
        let error = (mean - pair[1].velocity_enu_mps()).norm();
        assert!(error < 0.05, "{error}");
    }
}

#[test]
fn fixes_have_the_configured_components() {
    let drive = drive_with(|gnss| {
        gnss.habits.gives_height = false;
        gnss.habits.up = Up::Missing;
        gnss.velocity_sigma_mps = 0.1;
        gnss.vertical_sigma_m = 1.0;
        gnss.habits.stated = Stated::White;
    });
    for fix in &drive.gnss {
        assert!(fix.position.is_some() && fix.velocity_en_mps.is_some());
        assert!(fix.height_m.is_none() && fix.velocity_up_mps.is_none());
        assert!(fix.sigma.height_m.is_none() && fix.sigma.velocity_up_mps.is_none());
        assert!(fix.sigma.velocity_mps.is_some());
    }
    let exact = drive_with(|_| {});
    let down = drive_with(|gnss| gnss.habits.up = Up::Down);
    let zero = drive_with(|gnss| gnss.habits.up = Up::Zero);
    for ((exact, down), zero) in exact.gnss.iter().zip(&down.gnss).zip(&zero.gnss) {
        assert_eq!(down.velocity_up_mps, exact.velocity_up_mps.map(|up| -up));
        assert_eq!(zero.velocity_up_mps, Some(0.0));
    }
}

#[test]
fn faults_affect_only_their_intervals() {
    let exact = drive_with(|_| {});
    let offset = Wrong::Off {
        velocity_mps: [3.0, 0.0, 0.0],
        position_m: [0.0, 40.0, 0.0],
    };
    let wrong = drive_with(|gnss| {
        gnss.habits.troubles = vec![
            trouble(20.0, 1.2, Wrong::ZeroVelocity),
            trouble(40.0, 1.0, offset),
            trouble(60.0, 2.0, Wrong::Zeros),
            trouble(80.0, 5.0, Wrong::Stuck),
        ];
    });
    assert_eq!(exact.gnss.len(), wrong.gnss.len());
    let differ = |from_s: f64, to_s: f64| {
        let pairs = exact.gnss.iter().zip(&wrong.gnss);
        pairs
            .filter(|(e, _)| (from_s..to_s).contains(&e.time.as_seconds()))
            .filter(|(e, w)| e != w)
            .count()
    };
    assert_eq!(differ(20.0, 21.2), 12);
    assert_eq!(differ(40.0, 41.0), 10);
    assert_eq!(differ(60.0, 62.0), 20);
    assert_eq!(differ(80.0, 85.0), 50);
    assert_eq!(differ(0.0, 180.0), 92);
    let (good, bad) = (&exact.gnss[405], &wrong.gnss[405]);
    assert!((bad.velocity_enu_mps().x - good.velocity_enu_mps().x - 3.0).abs() < 1e-12);
    let offset = bad.geodetic_or(0.0).unwrap();
    let offset = offset.enu_from(&good.geodetic_or(0.0).unwrap());
    assert!((offset - Vector3::new(1.5, 40.0, 0.0)).norm() < 1e-3);
    let stuck = &wrong.gnss[849];
    assert_eq!(stuck.position, exact.gnss[799].position);
    assert_eq!(stuck.time, exact.gnss[849].time);
    assert_eq!(wrong.gnss[610].velocity_en_mps, Some([0.0; 2].into()));
}

#[test]
fn outliers_have_the_configured_rate() {
    let exact = drive_with(|_| {});
    let with_outliers = drive_with(|gnss| {
        gnss.habits.outliers = Outliers {
            fraction: 0.1,
            velocity_mps: 5.0,
            position_m: 0.0,
        };
    });
    let differs: Vec<f64> = exact
        .gnss
        .iter()
        .zip(&with_outliers.gnss)
        .map(|(e, w)| f64::from(u8::from(e != w)))
        .collect();
    assert_mean(&differs, 0.1, 0.3);
}

#[test]
fn fixes_are_repeated_and_delayed_as_configured() {
    let drive = drive_with(|gnss| {
        gnss.rate_hz = 5.0;
        gnss.habits.logged_times = 4;
        gnss.habits.delay_s = [0.2, 0.7];
    });
    assert_eq!(drive.arrivals.len(), drive.gnss.len());
    for (fixes, arrivals) in drive
        .gnss
        .chunks_exact(4)
        .zip(drive.arrivals.chunks_exact(4))
    {
        for (fix, arrival) in fixes.iter().zip(arrivals) {
            assert_eq!(fix.velocity_en_mps, fixes[0].velocity_en_mps);
            let delay_s = arrival.seconds_since(fix.time);
            assert!((0.2..0.7).contains(&delay_s), "{delay_s}");
        }
        let apart_s = fixes[1].time.seconds_since(fixes[0].time);
        assert!((apart_s - 0.05).abs() < 1e-9);
    }
    assert!(drive.arrivals.is_sorted());
    assert!(drive.gnss.is_sorted_by_key(|fix| fix.time));
    assert_eq!(
        drive_with(|_| {}).arrivals.len(),
        drive_with(|_| {}).gnss.len()
    );
}

#[test]
fn a_seed_determines_everything() {
    let run = |seed| simulate(&DriveConfig::new(seed, Grade::Mems, 3.0));
    assert_eq!(run(5), run(5));
    assert_ne!(run(5).imu, run(6).imu);
}

#[test]
fn recording_has_the_configured_samples() {
    let run = simulate(&DriveConfig::new(1, Grade::Hg1700, 5.0));
    assert_eq!(run.imu.len(), 30_000);
    assert_eq!(run.truth.len(), 3_001);
    // Only fixes of times before the run are missing.
    let first = run.gnss[0].time.as_seconds();
    assert!((0.0..0.1).contains(&(first - run.errors.gnss_latency_s)));
    let fixes = 1.0 + (300.0 - first) * 10.0;
    assert!((run.gnss.len() as f64 - fixes).abs() < 1e-6);
}

#[test]
fn fixes_are_delayed_by_the_latency() {
    for latency_s in [0.1374, -0.0713] {
        let mut config = DriveConfig::ideal(8, 5.0);
        config.recording.errors.gnss.latency_s = [latency_s; 2];
        let run = simulate(&config);
        let mut car = Car::new(8, 300.0, config.initial_rest_s);
        for fix in &run.gnss {
            let velocity = car
                .kinematics(fix.time.as_seconds() - latency_s)
                .velocity_enu_mps;
            let error = fix.velocity_en_mps.unwrap() - velocity.xy();
            // Cubic interpolation between two samples: 3e-9.
            assert!(error.norm() < 1e-8, "{error} at {:?}", fix.time);
            assert!((fix.velocity_up_mps.unwrap() - velocity.z).abs() < 1e-8);
        }
    }
}

#[test]
fn receiver_noise_is_white_with_the_configured_sigma() {
    let noisy = simulate(&DriveConfig::new(8, Grade::Hg1700, 20.0));
    let mut config = DriveConfig::new(8, Grade::Hg1700, 20.0);
    config.recording.errors.gnss.velocity_sigma_mps = 0.0;
    config.recording.errors.gnss.horizontal_sigma_m = 0.0;
    config.recording.errors.gnss.vertical_sigma_m = 0.0;
    let exact = simulate(&config);
    // Other error sources are unchanged.
    assert_eq!(noisy.imu, exact.imu);
    assert_eq!(noisy.errors, exact.errors);
    let differences = |part: fn(&GnssFix) -> f64| -> Vec<f64> {
        noisy
            .gnss
            .iter()
            .zip(&exact.gnss)
            .map(|(n, e)| part(n) - part(e))
            .collect()
    };
    let east = differences(|f| f.velocity_en_mps.unwrap().x);
    let north = differences(|f| f.velocity_en_mps.unwrap().y);
    let up = differences(|f| f.velocity_up_mps.unwrap());
    for x in [&east, &north, &up] {
        assert_mean(x, 0.0, 0.1);
        assert_sigma(x, 0.1);
        assert_correlation(x, &x[1..], 0.0);
    }
    assert_correlation(&east, &north, 0.0);
    assert_correlation(&north, &up, 0.0);
    let height = differences(|f| f.height_m.unwrap());
    assert_sigma(&height, 1.5);
    let [mut east_m, mut north_m] = [Vec::new(), Vec::new()];
    for (n, e) in noisy.gnss.iter().zip(&exact.gnss) {
        let error = n
            .geodetic_or(0.0)
            .unwrap()
            .enu_from(&e.geodetic_or(0.0).unwrap());
        east_m.push(error.x);
        north_m.push(error.y);
    }
    assert_sigma(&east_m, 1.0);
    assert_sigma(&north_m, 1.0);
}

#[test]
fn latencies_are_uniform_in_their_range() {
    let gnss = ErrorModel::hg1700().gnss;
    let all: Vec<f64> = (0..2000)
        .map(|seed| Gnss::new(&gnss, seed).latency_s)
        .collect();
    assert!(all.iter().all(|tau| (0.05..0.3).contains(tau)));
    assert_mean(&all, 0.175, 0.25 / 12.0_f64.sqrt());
}

#[test]
fn outages_and_losses_remove_samples_and_change_none() {
    let complete = simulate(&DriveConfig::new(2, Grade::Mems, 10.0));
    let mut config = DriveConfig::new(2, Grade::Mems, 10.0);
    let errors = &mut config.recording.errors;
    errors.gnss.outages = vec![Outage {
        start_s: 100.0,
        duration_s: 30.0,
    }];
    errors.imu.dropped_fraction = 0.02;
    let lossy = simulate(&config);
    assert_eq!(complete.gnss.len() - lossy.gnss.len(), 300);
    assert!(lossy.gnss.iter().all(|fix| complete.gnss.contains(fix)));
    let lost: Vec<f64> = complete
        .imu
        .iter()
        .map(|s| f64::from(lossy.imu.binary_search_by_key(&s.time, |h| h.time).is_err()))
        .collect();
    assert_mean(&lost, 0.02, (0.02 * 0.98_f64).sqrt());
    for sample in &lossy.imu {
        let at = complete
            .imu
            .binary_search_by_key(&sample.time, |w| w.time)
            .unwrap();
        assert_eq!(sample, &complete.imu[at]);
    }
}

//! The mechanization over an hour of a simulated car with error-free sensors.

use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use ins_core::increments::Increments;
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{ImuOutput, Solution};

const ARC_SECOND_RAD: f64 = core::f64::consts::PI / 180.0 / 3600.0;
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Limits {
    position_m: f64,
    velocity_mps: f64,
    attitude_rad: f64,
}

fn simulate_hour(seed: u64, output: ImuOutput, imu_hz: f64) -> SimulatedDrive {
    let mut config = DriveConfig::ideal(seed, 60.0);
    config.recording.imu_hz = imu_hz;
    config.recording.errors.imu.output = output;
    simulate(&config)
}

/// Largest errors of an unaided INS that starts at the second row of the truth.
fn largest_errors(drive: &SimulatedDrive, output: ImuOutput) -> Limits {
    let start = drive.truth[1];
    let mut ins = Mechanization::new(start.position, start.velocity_enu_mps, start.attitude);
    let first = drive.imu.partition_point(|s| s.time < start.time);
    let mut increments = Increments::new(output, &drive.imu[first]);
    let mut truths = drive.truth[2..].iter().peekable();
    let mut largest = Limits::default();
    for pair in drive.imu[first..].windows(2) {
        let seconds = pair[1].time.seconds_since(pair[0].time);
        let interval = increments.interval(&pair[1], seconds);
        ins.step(&interval, &Controls::default());
        if let Some(truth) = truths.next_if(|truth| truth.time == pair[1].time) {
            let now = errors(&ins, truth);
            largest.position_m = largest.position_m.max(now.position_m);
            largest.velocity_mps = largest.velocity_mps.max(now.velocity_mps);
            largest.attitude_rad = largest.attitude_rad.max(now.attitude_rad);
        }
    }
    assert!(truths.next().is_none(), "unused truth");
    largest
}

fn errors(ins: &Mechanization, truth: &Solution) -> Limits {
    Limits {
        position_m: ins.position.enu_from(&truth.position).norm(),
        velocity_mps: (ins.velocity_enu_mps - truth.velocity_enu_mps).norm(),
        attitude_rad: ins.attitude.angle_to(&truth.attitude),
    }
}

fn assert_within(errors: &Limits, limits: &Limits) {
    println!(
        "{:.3e} m, {:.3e} m/s, {:.3e} arc seconds",
        errors.position_m,
        errors.velocity_mps,
        errors.attitude_rad / ARC_SECOND_RAD
    );
    assert!(errors.position_m < limits.position_m, "{errors:?}");
    assert!(errors.velocity_mps < limits.velocity_mps, "{errors:?}");
    assert!(errors.attitude_rad < limits.attitude_rad, "{errors:?}");
}

#[test]
fn unaided_hour_with_ideal_increments() {
    // A fifth of the documented errors (1 m, 1 mm/s, 1 arc second) would reveal a missing second-order
    // term. Measured: 0.05 m, 0.05 mm/s, 0.002 arc seconds, mostly in the unstable vertical channel, which
    // amplifies initial errors by 300 in an hour.
    let limits = Limits {
        position_m: 0.2,
        velocity_mps: 2e-4,
        attitude_rad: 0.2 * ARC_SECOND_RAD,
    };
    for seed in [1, 2, 3] {
        let drive = simulate_hour(seed, ImuOutput::Increments, 100.0);
        assert_within(&largest_errors(&drive, ImuOutput::Increments), &limits);
    }
}

/// Parabolic interpolation between instantaneous readings has an error of third order.
#[test]
fn unaided_hour_with_ideal_rates() {
    let [slow, fast] = [100.0, 200.0].map(|hz| {
        let drive = simulate_hour(1, ImuOutput::Rates, hz);
        largest_errors(&drive, ImuOutput::Rates)
    });
    // Measured: 0.92 m, 0.64 mm/s, 0.06 arc seconds.
    let limits = Limits {
        position_m: 2.0,
        velocity_mps: 0.0015,
        attitude_rad: 0.2 * ARC_SECOND_RAD,
    };
    assert_within(&slow, &limits);
    // Half the interval, an eighth of the error or less; the trapezoidal rule would give a quarter.
    let ratio = |of: fn(&Limits) -> f64| of(&slow) / of(&fast);
    for ratio in [
        ratio(|e| e.position_m),
        ratio(|e| e.velocity_mps),
        ratio(|e| e.attitude_rad),
    ] {
        assert!((7.0..16.0).contains(&ratio), "{ratio}: {slow:?}, {fast:?}");
    }
}

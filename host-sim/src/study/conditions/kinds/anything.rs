//! A scenario with every number random, for cases that no other kind covers.

use core::f64::consts::PI;

use ins_core::ImuOutput;

use super::vibration;
use crate::log::Grade;
use crate::sim::barometer::BarometerModel;
use crate::sim::car::RouteBounds;
use crate::sim::motion::Envelope;
use crate::sim::receiver::{Stated, Up, Wrong};
use crate::sim::vehicles::Begin;
use crate::study::conditions::Vehicle;
use crate::study::conditions::scenario::Scenario;

/// Random vehicle, unit and receiver.
pub fn anything(scenario: &mut Scenario) {
    scenario.origin.latitude_rad = scenario.random.uniform([-70.0, 75.0]).to_radians();
    vehicle(scenario);
    unit(scenario);
    antenna(scenario);
    receiver(scenario);
    faults(scenario);
}

fn vehicle(s: &mut Scenario) {
    let draw = &mut s.random;
    let engine_hz = draw.log_uniform([12.0, 110.0]);
    let engine_mps2 = draw.log_uniform([0.2, 4.0]);
    let engine_radps = draw.log_uniform([0.01, 0.15]);
    let mut has_engine = draw.chance(0.4);
    let mut envelope = Envelope::Moving(draw.uniform([3.0, 15.0]));
    match draw.whole() % 7 {
        0 => {
            let begins_at_rest = draw.chance(0.7);
            s.vehicle = Vehicle::Car {
                rest_s: begins_at_rest.then_some([5.0, 120.0]),
                lean: draw.uniform([0.5, 2.0]),
            };
        }
        1 => s.vehicle = Vehicle::Motorway,
        2 => {
            let max_mps = draw.log_uniform([2.0, 35.0]);
            let straight_s = draw.log_uniform([6.0, 60.0]);
            let lateral_mps2 = draw.log_uniform([0.4, 4.0]);
            let stops = draw.chance(0.4);
            let balanced = draw.chance(0.3);
            s.vehicle = Vehicle::OnRoute(RouteBounds {
                rest_s: [5.0, 90.0],
                speed_mps: [draw.uniform([0.3, 0.8]) * max_mps, max_mps],
                straight_s: [0.3 * straight_s, 2.0 * straight_s],
                stop_s: stops.then_some([4.0, 30.0]),
                turn_rad: [0.1, draw.uniform([0.8, PI])],
                lateral_mps2: [0.3 * lateral_mps2, lateral_mps2],
                roll_rad_per_mps2: if balanced {
                    RouteBounds::BALANCED
                } else {
                    draw.uniform([-0.01, 0.0])
                },
                steep: draw.log_uniform([0.3, 3.0]),
            });
        }
        3 => {
            let (until_s, period_s) = (draw.uniform([30.0, 300.0]), draw.uniform([60.0, 250.0]));
            let peak_deg_s = draw.uniform([0.1, 0.9]);
            let (wave_s, heave_mps) = (draw.uniform([2.5, 10.0]), draw.log_uniform([0.05, 0.6]));
            let roll_deg = draw.log_uniform([0.5, 10.0]);
            s.boat(until_s, period_s, peak_deg_s);
            s.vibration
                .push(vibration::waves(wave_s, roll_deg, heave_mps));
        }
        4 => {
            let begin = *draw.one_of(&[Begin::OnGround, Begin::InFlight]);
            let max_deg = draw.uniform([20.0, 60.0]);
            let bank_rad = [draw.uniform([0.4, 0.9]) * max_deg, max_deg].map(f64::to_radians);
            s.vehicle = Vehicle::Plane { bank_rad, begin };
        }
        5 if s.class == Grade::Mems => {
            let begins_at_rest = draw.chance(0.7);
            let ground_s = begins_at_rest.then(|| draw.uniform([5.0, 60.0]));
            s.vehicle = Vehicle::Quadrotor { ground_s };
            (has_engine, envelope) = (true, Envelope::Always);
        }
        6 if s.class == Grade::Mems => {
            let rest_s = draw.uniform([3.0, 40.0]);
            let (steps_hz, heave_mps) = (draw.uniform([1.5, 2.5]), draw.uniform([0.1, 0.35]));
            let turn_deg = draw.uniform([1.0, 8.0]);
            s.vehicle = Vehicle::Walker { rest_s };
            s.vibration
                .push(vibration::steps(steps_hz, heave_mps, turn_deg));
            has_engine = false;
        }
        // The plain car, with vibration at rest as well.
        _ => envelope = Envelope::Always,
    }
    if has_engine {
        s.vibration.push(vibration::engine(
            envelope,
            engine_hz,
            engine_mps2,
            engine_radps,
        ));
    }
}

fn unit(s: &mut Scenario) {
    let draw = &mut s.random;
    s.imu_hz = *draw.one_of(&[50.0, 100.0, 100.0, 200.0, 400.0]);
    let tilt_deg = *draw.one_of(&[[0.0, 0.0], [0.0, 10.0], [0.0, 30.0], [0.0, 180.0]]);
    let imu = &mut s.errors.imu;
    imu.output = *draw.one_of(&[ImuOutput::Increments, ImuOutput::Rates]);
    match draw.whole() % 6 {
        0 => imu.stamp_jitter_s = draw.uniform([0.0, 0.3]) / s.imu_hz,
        1 => imu.dropped_fraction = draw.uniform([0.0, 0.04]),
        _ => {}
    }
    let misalignment_rad = if s.class == Grade::Mems && draw.chance(0.3) {
        draw.uniform([0.0, 0.005])
    } else {
        0.0
    };
    for sensors in [&mut s.errors.gyro_deg_h, &mut s.errors.accel_mps2] {
        sensors.noise_times = core::array::from_fn(|_| draw.log_uniform([0.4, 4.0]));
        sensors.misalignment_sigma = misalignment_rad;
    }
    if draw.chance(0.15) {
        let start_s = draw.uniform([0.3, 0.9]) * 60.0 * s.minutes;
        let duration_s = draw.uniform([0.1, 1.5]);
        s.imu_gap(start_s, duration_s);
    }
    s.tilt_mount(tilt_deg);
}

/// A lever arm in half of the runs, as long as the vehicle permits.
fn antenna(s: &mut Scenario) {
    let max_m = match s.vehicle {
        Vehicle::Quadrotor { .. } | Vehicle::Walker { .. } => 0.4,
        Vehicle::Plane { .. } => 1.5,
        Vehicle::Car { .. } | Vehicle::Motorway | Vehicle::OnRoute(_) => 3.0,
        Vehicle::Boat(_) => 5.0,
    };
    if s.random.chance(0.5) {
        let reach_m = [(); 3].map(|()| s.random.log_uniform([0.1 * max_m, max_m]));
        s.antenna_within(reach_m);
    }
}

fn receiver(s: &mut Scenario) {
    let draw = &mut s.random;
    let rate_hz = *draw.one_of(&[1.0, 1.0, 2.0, 4.0, 5.0, 10.0, 20.0]);
    let velocity = [
        draw.log_uniform([0.01, 0.1]),
        draw.sometimes(0.7, [0.01, 0.15]),
        draw.log_uniform([0.5, 10.0]),
    ];
    let white_m = draw.log_uniform([0.02, 1.5]);
    let position = [
        white_m,
        draw.sometimes(0.8, [0.02, 4.0]),
        draw.log_uniform([20.0, 200.0]),
    ];
    let latency_s = if draw.chance(0.2) {
        [-1.0, 1.0]
    } else {
        [-0.1, 0.3]
    };
    let delay_s = draw.sometimes(0.3, [0.05, 1.0]);
    let smoothing_s = draw.sometimes(0.3, [0.1, 1.0]);
    let smooths_position = draw.chance(0.5);
    let gives_velocity = draw.chance(0.85);
    let gives_height = draw.chance(0.9);
    let up = match draw.whole() % 8 {
        0 | 1 => Up::Missing,
        2 if gives_height => Up::Zero,
        3 if gives_height => Up::Down,
        _ => Up::Given,
    };
    let velocity_by_differences = draw.chance(0.1);
    let stated = *draw.one_of(&[
        Stated::Nothing,
        Stated::LevelVelocity,
        Stated::White,
        Stated::All,
    ]);
    let holds_below_mps = draw.sometimes(0.1, [0.2, 0.8]);
    if draw.chance(0.1) {
        s.errors.barometer = Some(BarometerModel::ON_BOARD);
    }
    s.errors.gnss.latency_s = latency_s;
    s.receiver(rate_hz, velocity, position);
    let habits = s.habits();
    habits.delay_s = [0.3 * delay_s, delay_s];
    habits.smoothing_s = smoothing_s;
    habits.smooths_position = smooths_position;
    habits.gives_velocity = gives_velocity;
    habits.gives_height = gives_height;
    habits.up = up;
    habits.stated = stated;
    habits.holds_below_mps = holds_below_mps;
    // Receivers do not differentiate noisy positions.
    if velocity_by_differences {
        habits.velocity_by_differences = true;
        habits.stated = Stated::Nothing;
        s.errors.gnss.horizontal_sigma_m = white_m.min(0.1);
        s.errors.gnss.vertical_sigma_m = white_m.min(0.1);
    }
}

/// Receiver faults in half of the runs.
fn faults(s: &mut Scenario) {
    let gap_s = s.random.uniform([60.0, 200.0]);
    match s.random.whole() % 14 {
        0 => {
            let off_mps = s.random.uniform([1.0, 20.0]);
            let off_m = s.random.uniform([5.0, 100.0]);
            let wrong = Wrong::Off {
                velocity_mps: s.horizontal_vector(off_mps),
                position_m: s.horizontal_vector(off_m),
            };
            s.random_faults(60.0, gap_s, [0.2, 2.0], wrong);
        }
        1 => s.random_faults(60.0, gap_s, [1.0, 30.0], Wrong::Zeros),
        2 => s.random_faults(60.0, gap_s, [2.0, 12.0], Wrong::Stuck),
        3 => s.random_faults(60.0, gap_s, [2.0, 10.0], Wrong::Coasting),
        4 => {
            let times = s.random.log_uniform([1.5, 8.0]);
            s.random_faults(60.0, gap_s, [10.0, 60.0], Wrong::Noisy(times));
        }
        5 => {
            let fraction = s.random.log_uniform([0.005, 0.1]);
            let (off_mps, off_m) = (s.random.uniform([0.5, 5.0]), s.random.uniform([3.0, 50.0]));
            s.outliers(fraction, off_mps, off_m);
        }
        6 => {
            for start_s in s.random_times(150.0, gap_s) {
                let duration_s = s.random.log_uniform([5.0, 150.0]);
                s.outages(&[start_s], duration_s);
            }
        }
        _ => {}
    }
}

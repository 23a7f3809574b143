//! A world of which every number is drawn: cases that nobody has thought of.

use core::f64::consts::PI;

use ins_core::ImuOutput;

use super::shakes;
use crate::log::Grade;
use crate::sim::barometer::BarometerModel;
use crate::sim::car::RouteBounds;
use crate::sim::motion::Envelope;
use crate::sim::receiver::{Stated, Up, Wrong};
use crate::sim::vehicles::Begin;
use crate::study::conditions::Vehicle;
use crate::study::conditions::world::World;

/// Vehicle, unit and receiver, each with some of what such may have.
pub fn anything(world: &mut World) {
    world.origin.latitude_rad = world.random.uniform([-70.0, 75.0]).to_radians();
    vehicle(world);
    unit(world);
    antenna(world);
    receiver(world);
    troubles(world);
}

fn vehicle(w: &mut World) {
    let draw = &mut w.random;
    let engine_hz = draw.log_uniform([12.0, 110.0]);
    let shake_mps2 = draw.log_uniform([0.2, 4.0]);
    let shake_radps = draw.log_uniform([0.01, 0.15]);
    let mut shakes = draw.chance(0.4);
    let mut when = Envelope::Moving(draw.uniform([3.0, 15.0]));
    match draw.whole() % 7 {
        0 => {
            let stands = draw.chance(0.7);
            w.vehicle = Vehicle::Car {
                rest_s: stands.then_some([5.0, 120.0]),
                lean: draw.uniform([0.5, 2.0]),
            };
        }
        1 => w.vehicle = Vehicle::Motorway,
        2 => {
            let fastest_mps = draw.log_uniform([2.0, 35.0]);
            let straight_s = draw.log_uniform([6.0, 60.0]);
            let lateral_mps2 = draw.log_uniform([0.4, 4.0]);
            let stops = draw.chance(0.4);
            let balanced = draw.chance(0.3);
            w.vehicle = Vehicle::OnWay(RouteBounds {
                rest_s: [5.0, 90.0],
                speed_mps: [draw.uniform([0.3, 0.8]) * fastest_mps, fastest_mps],
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
            w.boat(until_s, period_s, peak_deg_s);
            w.shakes.push(shakes::waves(wave_s, roll_deg, heave_mps));
        }
        4 => {
            let begin = *draw.one_of(&[Begin::OnGround, Begin::InFlight]);
            let most_deg = draw.uniform([20.0, 60.0]);
            let bank_rad = [draw.uniform([0.4, 0.9]) * most_deg, most_deg].map(f64::to_radians);
            w.vehicle = Vehicle::Plane { bank_rad, begin };
        }
        5 if w.class == Grade::Mems => {
            let stands = draw.chance(0.7);
            let ground_s = stands.then(|| draw.uniform([5.0, 60.0]));
            w.vehicle = Vehicle::Quadrotor { ground_s };
            (shakes, when) = (true, Envelope::Always);
        }
        6 if w.class == Grade::Mems => {
            let rest_s = draw.uniform([3.0, 40.0]);
            let (steps_hz, heave_mps) = (draw.uniform([1.5, 2.5]), draw.uniform([0.1, 0.35]));
            let turn_deg = draw.uniform([1.0, 8.0]);
            w.vehicle = Vehicle::Walker { rest_s };
            w.shakes.push(shakes::steps(steps_hz, heave_mps, turn_deg));
            shakes = false;
        }
        // The plain car, shaken at rest as well.
        _ => when = Envelope::Always,
    }
    if shakes {
        w.shakes
            .push(shakes::engine(when, engine_hz, shake_mps2, shake_radps));
    }
}

fn unit(w: &mut World) {
    let draw = &mut w.random;
    w.imu_hz = *draw.one_of(&[50.0, 100.0, 100.0, 200.0, 400.0]);
    let tilt_deg = *draw.one_of(&[[0.0, 0.0], [0.0, 10.0], [0.0, 30.0], [0.0, 180.0]]);
    let imu = &mut w.errors.imu;
    imu.output = *draw.one_of(&[ImuOutput::Increments, ImuOutput::Rates]);
    match draw.whole() % 6 {
        0 => imu.stamp_jitter_s = draw.uniform([0.0, 0.3]) / w.imu_hz,
        1 => imu.dropped_fraction = draw.uniform([0.0, 0.04]),
        _ => {}
    }
    let crooked_rad = if w.class == Grade::Mems && draw.chance(0.3) {
        draw.uniform([0.0, 0.005])
    } else {
        0.0
    };
    for sensors in [&mut w.errors.gyro_deg_h, &mut w.errors.accel_mps2] {
        sensors.noise_times = core::array::from_fn(|_| draw.log_uniform([0.4, 4.0]));
        sensors.misalignment_sigma = crooked_rad;
    }
    if draw.chance(0.15) {
        let start_s = draw.uniform([0.3, 0.9]) * 60.0 * w.minutes;
        let duration_s = draw.uniform([0.1, 1.5]);
        w.hole(start_s, duration_s);
    }
    w.tilt_mount(tilt_deg);
}

/// As far away as there is room for one on such a vehicle, in half of the runs.
fn antenna(w: &mut World) {
    let most_m = match w.vehicle {
        Vehicle::Quadrotor { .. } | Vehicle::Walker { .. } => 0.4,
        Vehicle::Plane { .. } => 1.5,
        Vehicle::Car { .. } | Vehicle::Motorway | Vehicle::OnWay(_) => 3.0,
        Vehicle::Boat(_) => 5.0,
    };
    if w.random.chance(0.5) {
        let reach_m = [(); 3].map(|()| w.random.log_uniform([0.1 * most_m, most_m]));
        w.antenna_within(reach_m);
    }
}

fn receiver(w: &mut World) {
    let draw = &mut w.random;
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
    let late_s = if draw.chance(0.2) {
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
    let by_differences = draw.chance(0.1);
    let stated = *draw.one_of(&[
        Stated::Nothing,
        Stated::LevelVelocity,
        Stated::White,
        Stated::All,
    ]);
    let holds_below_mps = draw.sometimes(0.1, [0.2, 0.8]);
    if draw.chance(0.1) {
        w.errors.barometer = Some(BarometerModel::ON_BOARD);
    }
    w.errors.gnss.latency_s = late_s;
    w.receiver(rate_hz, velocity, position);
    let habits = w.habits();
    habits.delay_s = [0.3 * delay_s, delay_s];
    habits.smoothing_s = smoothing_s;
    habits.smooths_position = smooths_position;
    habits.gives_velocity = gives_velocity;
    habits.gives_height = gives_height;
    habits.up = up;
    habits.stated = stated;
    habits.holds_below_mps = holds_below_mps;
    // Of noisier positions none is made.
    if by_differences {
        habits.velocity_by_differences = true;
        habits.stated = Stated::Nothing;
        w.errors.gnss.horizontal_sigma_m = white_m.min(0.1);
        w.errors.gnss.vertical_sigma_m = white_m.min(0.1);
    }
}

/// None in half of the runs.
fn troubles(w: &mut World) {
    let gap_s = w.random.uniform([60.0, 200.0]);
    match w.random.whole() % 14 {
        0 => {
            let off_mps = w.random.uniform([1.0, 20.0]);
            let off_m = w.random.uniform([5.0, 100.0]);
            let wrong = Wrong::Off {
                velocity_mps: w.anywhere(off_mps),
                position_m: w.anywhere(off_m),
            };
            w.troubles(60.0, gap_s, [0.2, 2.0], wrong);
        }
        1 => w.troubles(60.0, gap_s, [1.0, 30.0], Wrong::Zeros),
        2 => w.troubles(60.0, gap_s, [2.0, 12.0], Wrong::Stuck),
        3 => w.troubles(60.0, gap_s, [2.0, 10.0], Wrong::Coasting),
        4 => {
            let times = w.random.log_uniform([1.5, 8.0]);
            w.troubles(60.0, gap_s, [10.0, 60.0], Wrong::Noisy(times));
        }
        5 => {
            let fraction = w.random.log_uniform([0.005, 0.1]);
            let (off_mps, off_m) = (w.random.uniform([0.5, 5.0]), w.random.uniform([3.0, 50.0]));
            w.outliers(fraction, off_mps, off_m);
        }
        6 => {
            for start_s in w.times(150.0, gap_s) {
                let duration_s = w.random.log_uniform([5.0, 150.0]);
                w.outages(&[start_s], duration_s);
            }
        }
        _ => {}
    }
}

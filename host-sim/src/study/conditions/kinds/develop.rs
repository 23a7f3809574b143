//! Kinds for development.

use core::f64::consts::PI;

use ins_core::ImuOutput;

use super::anything::anything;
use super::vibration;
use super::{BOTH, Kind, MEMS, combined, kinds};
use crate::log::Grade;
use crate::sim::barometer::BarometerModel;
use crate::sim::car::RouteBounds;
use crate::sim::errors::BiasModel;
use crate::sim::motion::Envelope;
use crate::sim::receiver::{Correlated, Stated, Up, Wrong};
use crate::sim::vehicles::Begin;
use crate::study::conditions::Vehicle;

kinds! { judge: false,
    "plain", BOTH, 15.0, "car, white noise, nothing wrong" => |s| s.all_white();
    // --- receivers ---
    "coloured_velocity", BOTH, 15.0,
    "velocity noise of 0.05 m/s over 2 s beside 0.01 m/s white, no sigma stated" => |s| {
        s.noise([0.01, 0.05, 2.0], [0.3, 1.0, 60.0]);
        s.habits().stated = Stated::Nothing;
    };
    "smoothed", BOTH, 15.0, "receiver smooths position and velocity over 0.3 s, 5 Hz" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.habits().smoothing_s = 0.3;
    };
    "smoothed_velocity", BOTH, 15.0,
    "velocity smoothed over 0.6 s, position not, 5 Hz, no sigma stated" => |s| {
        s.receiver(5.0, [0.03, 0.0, 1.0], [0.5, 1.5, 60.0]);
        s.habits().smoothing_s = 0.6;
        s.habits().smooths_position = false;
        s.habits().stated = Stated::Nothing;
    };
    "slow_fixes", MEMS, 15.0, "1 Hz, correlated position noise"
        => |s| s.receiver(1.0, [0.05, 0.03, 3.0], [1.0, 2.0, 100.0]);
    "no_vertical_velocity", BOTH, 15.0, "position, height and level velocity alone (NMEA)"
        => |s| s.habits().up = Up::Missing;
    "vertical_velocity_zero", MEMS, 12.0,
    "vertical velocity written as zero, height true, on hills" => |s| s.habits().up = Up::Zero;
    "positions_alone", BOTH, 15.0,
    "no velocity at all, positions good to 1 m beside their wander, 5 Hz" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.habits().gives_velocity = false;
    };
    "no_height", MEMS, 12.0, "position without height, velocity with its vertical part"
        => |s| s.habits().gives_height = false;
    "velocity_alone", BOTH, 12.0,
    "velocity in three axes, positions and heights in the first minute alone"
        => |s| s.faults(&[60.0], s.duration_s(), Wrong::NoPosition);
    "late_stamps", BOTH, 12.0, "latency of 0.6 to 1 s" => |s| s.errors.gnss.latency_s = [0.6, 1.0];
    "late_arrival", BOTH, 12.0,
    "fixes arrive 0.5 to 0.8 s after their stamps, latency 0.05 to 0.3 s"
        => |s| s.habits().delay_s = [0.5, 0.8];
    "clock_drift", MEMS, 15.0, "clocks drift apart by 100 ppm"
        => |s| s.habits().clock_drift = 1e-4 * s.random.sign();
    "rows_of_zeros", MEMS, 12.0,
    "rows of zeros for 15 s, three or four times a run, and at the start" => |s| {
        let mut times = s.random_times(60.0, 120.0);
        times.push(0.0);
        s.faults(&times, 15.0, Wrong::Zeros);
    };
    "logged_four_times", MEMS, 12.0,
    "a fix of 5 Hz logged four times under stamps of its own" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.habits().logged_times = 4;
    };
    "stuck", MEMS, 12.0, "the receiver repeats its last fix for 6 s, every two minutes" => |s| {
        let times = s.random_times(120.0, 100.0);
        s.faults(&times, 6.0, Wrong::Stuck);
    };
    "zero_velocity_bursts", BOTH, 12.0,
    "zero velocity for 1.2 s at any speed, once or twice a minute" => |s| {
        let times = s.random_times(100.0, 40.0);
        s.faults(&times, 1.2, Wrong::ZeroVelocity);
    };
    "ten_wrong", BOTH, 12.0,
    "ten fixes in a row off by 20 m/s and 100 m, 20 Hz, every minute or two" => |s| {
        s.errors.gnss.rate_hz = 20.0;
        for start_s in s.random_times(100.0, 60.0) {
            let velocity_mps = s.horizontal_vector(20.0);
            let position_m = s.horizontal_vector(100.0);
            let wrong = Wrong::Off {
                velocity_mps,
                position_m,
            };
            s.faults(&[start_s], 0.5, wrong);
        }
    };
    "outliers", BOTH, 12.0, "5 % of the fixes off by 2 m/s and 30 m, each by itself"
        => |s| s.outliers(0.05, 2.0, 30.0);
    "wandering_height", BOTH, 15.0,
    "no vertical velocity, height good to 0.3 m and stated so wanders by 8 m over 300 s, 5 Hz"
    => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.habits().up = Up::Missing;
        s.position_noise([0.7, 1.0, 60.0]);
        s.errors.gnss.vertical_sigma_m = 0.3;
        s.habits().vertical = Correlated {
            sigma: 8.0,
            time_s: 300.0,
        };
    };
    "multipath", MEMS, 15.0,
    "position wanders by 6 m over 60 s, velocity by 0.2 m/s over 5 s, white parts stated"
        => |s| s.receiver(5.0, [0.05, 0.2, 5.0], [0.5, 6.0, 60.0]);
    "satellites_change", BOTH, 15.0,
    "each axis of the position jumps by 4 m and height by 6 m, every 30 s or so, 5 Hz, 0.8 m stated"
    => |s| {
        s.receiver(5.0, [0.03, 0.02, 2.0], [0.8, 3.0, 30.0]);
        s.habits().position_jumps = true;
    };
    "differences", BOTH, 15.0,
    "velocity is the difference of positions that wander by 1 m over 60 s, 0.05 m white, 5 Hz"
    => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.position_noise([0.05, 1.0, 60.0]);
        s.habits().velocity_by_differences = true;
        s.habits().stated = Stated::Nothing;
    };
    "static_hold", MEMS, 15.0,
    "queue at 1.5 to 7 m/s, stops of 4 to 40 s; below 0.3 m/s no velocity and one place, 5 Hz"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [1.5, 7.0],
            straight_s: [5.0, 20.0],
            stop_s: Some([4.0, 40.0]),
            turn_rad: [0.03, 0.5],
            lateral_mps2: [0.3, 1.2],
            ..RouteBounds::ROAD
        });
        s.receiver(5.0, [0.05, 0.03, 3.0], [0.5, 1.5, 60.0]);
        s.habits().holds_below_mps = 0.3;
    };
    "outages", BOTH, 15.0, "a minute without fixes, every three or four" => |s| {
        let times = s.random_times(150.0, 150.0);
        s.outages(&times, 60.0);
    };
    "antenna_away", BOTH, 15.0,
    "antenna up to 3 m away and 2 m above or below, body that leans twice as far" => |s| {
        s.antenna_within([1.5, 3.0, 2.0]);
        s.leaning(2.0);
    };
    // --- units and mounts ---
    "tilted_mount", BOTH, 15.0, "unit turned by 5 to 45 deg about any axis"
        => |s| s.tilt_mount([5.0, 45.0]);
    "turned_unseen", BOTH, 15.0,
    "unit slips by 5 to 90 deg about any axis within 0.6 s without inertial samples"
        => |s| s.slip([5.0, 90.0], 0.6, false);
    "misaligned", MEMS, 15.0, "axes of gyros and accelerometers off by 5 mrad"
        => |s| s.misaligned(0.005);
    "g_sensitive", MEMS, 15.0, "gyros answer to specific force by 0.02 deg/s/g, braking and bends"
        => |s| s.errors.imu.gyro_g_sensitivity_deg_h_g = 72.0;
    "noisy_gyros", MEMS, 15.0,
    "gyros x and y five times as noisy as z, accelerometers y and z six times as x" => |s| {
        s.errors.gyro_deg_h.noise_times = [8.0, 8.0, 1.6];
        s.errors.accel_mps2.noise_times = [2.0, 12.0, 12.0];
    };
    "coarse_readings", MEMS, 15.0,
    "gyros read to 0.1 deg/s, accelerometers to 0.03 m/s^2" => |s| {
        s.errors.gyro_deg_h.resolution = 360.0;
        s.errors.accel_mps2.resolution = 0.03;
    };
    "warming", BOTH, 15.0,
    "biases move by some of their run-to-run spread as the unit warms up, within 150 s" => |s| {
        let (gyro_deg_h, accel_mps2) = match s.class {
            Grade::Mems => (300.0, 0.05),
            Grade::Hg1700 => (1.0, 0.005),
        };
        s.errors.gyro_deg_h.warming_sigma = gyro_deg_h;
        s.errors.accel_mps2.warming_sigma = accel_mps2;
    };
    "biased_start", MEMS, 12.0, "gyro biases of 3 deg/s, begins in motion" => |s| {
        s.errors.gyro_deg_h.bias = BiasModel::drifting(10_800.0, 40.0);
        s.vehicle = Vehicle::MOVING_CAR;
    };
    "inertial_hole", BOTH, 12.0,
    "0.6 s without inertial samples, once, somewhere in the middle" => |s| {
        let start_s = s.random.uniform([0.4, 0.7]) * s.duration_s();
        s.imu_gap(start_s, 0.6);
    };
    "jittered_increments", BOTH, 12.0, "increments under stamps off by up to 3 ms" => |s| {
        s.errors.imu.output = ImuOutput::Increments;
        s.errors.imu.stamp_jitter_s = 0.003;
    };
    "few_samples", MEMS, 12.0, "inertial samples at 25 Hz" => |s| s.imu_hz = 25.0;
    // --- vehicles ---
    "velocity_swing", BOTH, 12.0, "velocity swings by 0.05 m/s at 8.7 Hz"
        => |s| s.vibration.push(vibration::velocity_oscillation(8.7, 0.05));
    "truck", BOTH, 15.0,
    "idles at 28 Hz with 1.5 m/s^2 and rocks by 0.2 deg while it stands" => |s| {
        s.vibration.push(vibration::engine(Envelope::Always, 28.0, 1.5, 0.05));
        s.vibration.push(vibration::sway(1.1, 0.2));
    };
    "motorway", BOTH, 18.0,
    "begins in the bend of a ramp, then straight on with a change of lane every minute or two, 5 Hz"
    => |s| {
        s.vehicle = Vehicle::Motorway;
        s.receiver(5.0, [0.05, 0.03, 3.0], [0.5, 1.5, 60.0]);
    };
    "car_park", BOTH, 14.0, "ten minutes at rest, then four of driving" => |s| {
        let rest_s = Some([600.0, 600.0]);
        s.vehicle = Vehicle::Car { rest_s, lean: 1.0 };
    };
    "furrows", BOTH, 20.0,
    "tractor at 2 m/s, to and fro in 40 to 120 s, antenna up to 3 m away, 0.4 m/s^2 at 32 Hz"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [1.6, 2.6],
            straight_s: [40.0, 120.0],
            turn_rad: [PI, PI],
            lateral_mps2: [0.2, 0.5],
            ..RouteBounds::ROAD
        });
        s.noise([0.03, 0.02, 2.0], [0.3, 0.6, 100.0]);
        s.antenna_within([0.5, 1.0, 3.0]);
        s.vibration.push(vibration::engine(Envelope::Always, 31.7, 0.4, 0.0));
    };
    "boat", BOTH, 20.0, "swings at anchor by 0.3 deg/s to and fro in 4 min, then sails" => |s| {
        s.boat(300.0, 240.0, 0.3);
        s.vibration.push(vibration::waves(4.0, 2.0, 0.1));
    };
    "mast", BOTH, 17.0, "antenna up to 5 m up a mast or below, waves of 8 deg and 3.5 s" => |s| {
        s.boat(150.0, 100.0, 0.5);
        s.noise([0.03, 0.03, 1.5], [0.4, 1.0, 80.0]);
        s.antenna_within([0.7, 1.5, 5.0]);
        s.vibration.push(vibration::waves(3.5, 8.0, 0.3));
    };
    "quadrotor", MEMS, 12.0, "small quick manoeuvres, 5 Hz, motors shake the unit" => |s| {
        s.vehicle = Vehicle::Quadrotor {
            ground_s: Some(20.0),
        };
        s.receiver(5.0, [0.05, 0.05, 1.0], [0.5, 1.5, 60.0]);
        s.vibration.push(vibration::engine(Envelope::Always, 87.0, 3.0, 0.1));
    };
    "survey_drone", MEMS, 12.0,
    "quadrotor, positions to 0.02 m, or off by 0.5 m for 30 s every minute or two and stated so"
    => |s| {
        s.vehicle = Vehicle::Quadrotor {
            ground_s: Some(30.0),
        };
        s.noise([0.03, 0.02, 1.0], [0.015, 0.01, 100.0]);
        s.antenna_within([0.1, 0.1, 0.3]);
        s.float_ambiguities(60.0, 0.5, [30.0, 30.0]);
        s.imu_hz = 250.0;
        s.vibration.push(vibration::engine(Envelope::Always, 93.0, 3.0, 0.05));
    };
    "steep_banks", BOTH, 15.0, "fixed wing, banks of 50 to 55 deg, from the ground"
        => |s| s.fixed_wing([50.0, 55.0], Begin::OnGround, 5.0);
    "misaligned_in_flight", MEMS, 15.0,
    "fixed wing, banks of 25 to 40 deg, from the ground, axes off by 5 mrad" => |s| {
        s.fixed_wing([25.0, 40.0], Begin::OnGround, 5.0);
        s.misaligned(0.005);
    };
    "g_sensitive_in_flight", MEMS, 15.0,
    "fixed wing, banks of 25 to 45 deg, from the ground, gyros answer by 0.02 deg/s/g" => |s| {
        s.fixed_wing([25.0, 45.0], Begin::OnGround, 5.0);
        s.errors.imu.gyro_g_sensitivity_deg_h_g = 72.0;
    };
    "pedestrian", MEMS, 15.0, "walks at 0.8 to 1.8 m/s, two steps a second" => |s| {
        s.vehicle = Vehicle::Walker { rest_s: 20.0 };
        s.noise([0.03, 0.03, 2.0], [0.5, 1.5, 60.0]);
        s.vibration.push(vibration::steps(2.0, 0.2, 4.0));
    };
    "surveyor", MEMS, 15.0,
    "walks with the antenna on a pole up to 1.8 m away, positions to 0.01 m, 5 Hz" => |s| {
        s.vehicle = Vehicle::Walker { rest_s: 10.0 };
        s.receiver(5.0, [0.03, 0.02, 1.0], [0.01, 0.01, 60.0]);
        s.antenna_within([0.1, 0.1, 1.8]);
        s.vibration.push(vibration::steps(1.9, 0.15, 3.0));
    };
    "jet", BOTH, 20.0, "120 to 260 m/s, turns of 3 to 12 m/s^2, climbs, from a runway, 5 Hz" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            rest_s: [60.0, 120.0],
            speed_mps: [120.0, 260.0],
            straight_s: [20.0, 90.0],
            turn_rad: [0.3, 2.5],
            lateral_mps2: [3.0, 12.0],
            roll_rad_per_mps2: RouteBounds::BALANCED,
            steep: 3.0,
            ..RouteBounds::ROAD
        });
        s.receiver(5.0, [0.05, 0.03, 2.0], [0.5, 1.5, 60.0]);
        s.antenna_within([1.0, 3.0, 1.0]);
    };
    // --- a barometer beside the receiver ---
    "barometer_in_outages", BOTH, 15.0,
    "fixed wing, twice or thrice 2 min without fixes but with a barometer" => |s| {
        s.fixed_wing([25.0, 40.0], Begin::OnGround, 5.0);
        s.errors.barometer = Some(BarometerModel::ON_BOARD);
        let times = s.random_times(240.0, 200.0);
        s.outages(&times, 120.0);
    };
    "barometer_alone_vertical", BOTH, 15.0,
    "hills, level position and velocity at 1 Hz, nothing vertical but a barometer" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds { steep: 2.0, ..RouteBounds::ROAD });
        s.receiver(1.0, [0.05, 0.03, 3.0], [0.8, 2.0, 60.0]);
        s.habits().gives_height = false;
        s.habits().up = Up::Missing;
        s.errors.barometer = Some(BarometerModel::ON_BOARD);
    };
    // --- combinations ---
    "in_company", BOTH, 15.0, "two of the other kinds at once, drawn anew for each seed"
        => |s| combined(s, KINDS);
    // --- random scenarios ---
    "anything", BOTH, 15.0, "vehicle, unit and receiver with every number drawn anew for each seed"
        => anything;
}

//! Judges: similar kinds with other numbers and in other combinations. Not for development.

use core::f64::consts::PI;

use ins_core::ImuOutput;

use super::anything::anything;
use super::vibration;
use super::{BOTH, Kind, MEMS, combined, kinds};
use crate::sim::barometer::BarometerModel;
use crate::sim::car::RouteBounds;
use crate::sim::errors::BiasModel;
use crate::sim::motion::Envelope;
use crate::sim::receiver::{Stated, Up, Wrong};
use crate::sim::vehicles::Begin;
use crate::study::conditions::Vehicle;

kinds! { judge: true,
    "five_hertz", BOTH, 18.0, "car, white noise at 5 Hz, begins in motion" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.all_white();
        s.velocity_noise([0.05, 0.0, 1.0]);
        s.vehicle = Vehicle::MOVING_CAR;
    };
    // --- receivers ---
    "slow_colour", BOTH, 18.0,
    "velocity noise of 0.08 m/s over 6 s beside 0.02 m/s white, which alone is stated"
        => |s| s.noise([0.02, 0.08, 6.0], [0.5, 2.0, 120.0]);
    "heavily_smoothed", BOTH, 15.0, "receiver smooths over 0.8 s, 4 Hz, no sigma stated" => |s| {
        s.errors.gnss.rate_hz = 4.0;
        s.errors.gnss.latency_s = [-0.1, 0.1];
        s.habits().smoothing_s = 0.8;
        s.habits().stated = Stated::Nothing;
    };
    "fast_fixes", MEMS, 12.0, "25 Hz, noise of 0.04 m/s over 0.5 s beside 0.02 m/s white"
        => |s| s.receiver(25.0, [0.02, 0.04, 0.5], [0.05, 0.5, 30.0]);
    "nmea", MEMS, 18.0,
    "1 Hz, level velocity and position without sigmas, height wanders by 4 m, begins in motion"
    => |s| {
        s.receiver(1.0, [0.05, 0.05, 4.0], [0.8, 2.5, 80.0]);
        s.habits().up = Up::Missing;
        s.habits().stated = Stated::Nothing;
        s.vehicle = Vehicle::MOVING_CAR;
    };
    "vertical_velocity_down", BOTH, 12.0,
    "vertical velocity with the sign of down, heights true, fixed wing that climbs" => |s| {
        s.fixed_wing([25.0, 40.0], Begin::OnGround, 10.0);
        s.habits().up = Up::Down;
    };
    "slow_positions_alone", BOTH, 20.0,
    "no velocity, positions at 1 Hz that wander by 1.5 m over 40 s" => |s| {
        s.errors.gnss.rate_hz = 1.0;
        s.position_noise([0.4, 1.5, 40.0]);
        s.habits().gives_velocity = false;
        s.habits().stated = Stated::All;
    };
    "level_alone", MEMS, 15.0,
    "level position and level velocity, nothing vertical, unit tilted by 10 to 30 deg" => |s| {
        s.habits().gives_height = false;
        s.habits().up = Up::Missing;
        s.tilt_mount([10.0, 30.0]);
    };
    "level_velocity_alone", MEMS, 15.0,
    "level velocity at 5 Hz, positions and heights in the first 20 s alone" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.habits().up = Up::Missing;
        s.faults(&[20.0], s.duration_s(), Wrong::NoPosition);
    };
    "early_stamps", BOTH, 15.0, "latency of -1 to -0.4 s: the inertial stamps are late"
        => |s| s.errors.gnss.latency_s = [-1.0, -0.4];
    "late_both", BOTH, 15.0,
    "latency of 0.7 to 1 s, and arrival 0.2 to 1 s after the stamp" => |s| {
        s.errors.gnss.latency_s = [0.7, 1.0];
        s.habits().delay_s = [0.2, 1.0];
        s.errors.gnss.rate_hz = 5.0;
    };
    "fast_clock_drift", MEMS, 15.0,
    "clocks 0.2 to 0.5 s apart and drifting by 300 ppm, 4 Hz" => |s| {
        s.errors.gnss.rate_hz = 4.0;
        s.errors.gnss.latency_s = [0.2, 0.5];
        s.habits().clock_drift = 3e-4 * s.random.sign();
    };
    "zeros_in_outages", MEMS, 15.0,
    "rows of zeros for 2 to 40 s, six to ten times a run, begins in motion" => |s| {
        s.vehicle = Vehicle::MOVING_CAR;
        s.random_faults(30.0, 60.0, [2.0, 40.0], Wrong::Zeros);
    };
    "logged_twice_and_stuck", MEMS, 15.0,
    "a fix of 4 Hz logged twice, and repeated for 3 to 12 s every two minutes" => |s| {
        s.errors.gnss.rate_hz = 4.0;
        s.habits().logged_times = 2;
        s.random_faults(100.0, 80.0, [3.0, 12.0], Wrong::Stuck);
    };
    "wrong_bursts", BOTH, 15.0,
    "off by 8 m/s or standing for 0.5 to 2 s, 10 Hz, once or twice a minute" => |s| {
        for start_s in s.random_times(90.0, 40.0) {
            let duration_s = s.random.uniform([0.5, 2.0]);
            let wrong = if s.random.chance(0.5) {
                Wrong::ZeroVelocity
            } else {
                Wrong::Off {
                    velocity_mps: s.horizontal_vector(8.0),
                    position_m: [0.0; 3],
                }
            };
            s.faults(&[start_s], duration_s, wrong);
        }
    };
    "many_outliers", BOTH, 15.0, "10 % of the fixes off by 1 m/s and 10 m, 4 Hz" => |s| {
        s.errors.gnss.rate_hz = 4.0;
        s.outliers(0.1, 1.0, 10.0);
    };
    "canyon", MEMS, 18.0,
    "noise eight times as stated for 10 to 60 s at a time, outages of 5 to 20 s, outliers" => |s| {
        s.receiver(4.0, [0.05, 0.05, 3.0], [0.5, 2.0, 60.0]);
        s.random_faults(60.0, 60.0, [10.0, 60.0], Wrong::Noisy(8.0));
        for start_s in s.random_times(90.0, 90.0) {
            let duration_s = s.random.uniform([5.0, 20.0]);
            s.outages(&[start_s], duration_s);
        }
        s.outliers(0.02, 3.0, 50.0);
    };
    "tunnels", BOTH, 20.0,
    "motorway, twice 3 min without fixes after 4 to 10 s of coasted ones, twice the noise for 15 s after"
    => |s| {
        s.vehicle = Vehicle::Motorway;
        s.receiver(5.0, [0.05, 0.03, 3.0], [0.5, 1.5, 60.0]);
        for start_s in s.random_times(270.0, 300.0) {
            let coasting_s = s.random.uniform([4.0, 10.0]);
            s.faults(&[start_s], coasting_s, Wrong::Coasting);
            s.outages(&[start_s + coasting_s], 180.0 - coasting_s);
            s.faults(&[start_s + 180.0], 15.0, Wrong::Noisy(2.0));
        }
    };
    "mountain_road", BOTH, 15.0,
    "hairpins, grades up to 12 %; velocity smoothed over 1 s, position not, 5 Hz, no sigma stated"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [7.0, 16.0],
            straight_s: [3.0, 20.0],
            turn_rad: [0.3, 3.0],
            lateral_mps2: [1.0, 2.5],
            steep: 3.0,
            ..RouteBounds::ROAD
        });
        s.receiver(5.0, [0.05, 0.0, 1.0], [0.8, 2.0, 60.0]);
        s.habits().smoothing_s = 1.0;
        s.habits().smooths_position = false;
        s.habits().stated = Stated::Nothing;
    };
    "far_north", BOTH, 15.0,
    "snowmobile, 78 deg north, velocity the difference of positions that wander by 1.5 m, 1 Hz"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [5.0, 18.0],
            roll_rad_per_mps2: 0.0,
            steep: 2.0,
            ..RouteBounds::ROAD
        });
        s.origin.latitude_rad = 78.2_f64.to_radians();
        s.errors.gnss.rate_hz = 1.0;
        s.position_noise([0.1, 1.5, 40.0]);
        s.habits().velocity_by_differences = true;
        s.habits().stated = Stated::Nothing;
        s.vibration.push(vibration::engine(Envelope::Moving(5.0), 43.3, 2.0, 0.0));
    };
    "long_outages", BOTH, 18.0,
    "two minutes without fixes, twice or thrice, begins in motion" => |s| {
        s.vehicle = Vehicle::MOVING_CAR;
        let times = s.random_times(240.0, 240.0);
        s.outages(&times, 120.0);
    };
    "antenna_on_truck", BOTH, 15.0,
    "antenna up to 3 m away in every axis, 5 Hz, unit tilted by up to 30 deg" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.antenna_within([3.0, 3.0, 3.0]);
        s.tilt_mount([0.0, 30.0]);
        s.velocity_noise([0.03, 0.02, 2.0]);
        s.leaning(1.5);
    };
    // --- units and mounts ---
    "any_mount", BOTH, 18.0, "unit turned by up to 180 deg about any axis"
        => |s| s.tilt_mount([45.0, 180.0]);
    "misaligned_and_tilted", MEMS, 18.0,
    "axes off by 3 mrad, gyro scales by 1 %, unit tilted by 15 to 60 deg" => |s| {
        s.misaligned(0.003);
        s.errors.gyro_deg_h.scale_sigma = 0.01;
        s.tilt_mount([15.0, 60.0]);
    };
    "quiet_sensors", MEMS, 15.0,
    "noise a third of what is usual for the class, drift thrice as fast" => |s| {
        s.errors.gyro_deg_h.noise_times = [0.35, 0.8, 0.5];
        s.errors.accel_mps2.noise_times = [0.4, 0.3, 0.8];
        s.errors.gyro_deg_h.bias = BiasModel::drifting(0.3 * 3600.0, 120.0);
    };
    "noisy_sensors", MEMS, 15.0,
    "gyro y twelve times as noisy as x, accelerometer x fifteen times as z, 5 Hz" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.errors.gyro_deg_h.noise_times = [1.0, 12.0, 5.0];
        s.errors.accel_mps2.noise_times = [15.0, 4.0, 1.0];
    };
    "stepping_biases", MEMS, 15.0, "gyro biases jump by 80 deg/h every three minutes, 5 Hz" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.errors.gyro_deg_h.bias = BiasModel::Wave {
            initial_sigma: 1000.0,
            interval_s: 170.0,
            jump_mean: 0.0,
            jump_sigma: 80.0,
        };
    };
    "five_degrees_a_second", MEMS, 15.0, "gyro biases of 5 deg/s, begins in motion, 2 Hz" => |s| {
        s.errors.gyro_deg_h.bias = BiasModel::drifting(18_000.0, 40.0);
        s.errors.gnss.rate_hz = 2.0;
        s.vehicle = Vehicle::MOVING_CAR;
    };
    "turned_over_unseen", BOTH, 15.0,
    "unit turns over, by 60 to 180 deg about any axis, within 1.5 s without inertial samples"
        => |s| s.slip([60.0, 180.0], 1.5, false);
    "slipping_mount", MEMS, 15.0, "unit slips by 10 to 60 deg about any axis in half a second"
        => |s| s.slip([10.0, 60.0], 0.5, true);
    "inertial_holes", MEMS, 15.0,
    "0.2 to 1.5 s without inertial samples every minute or two, 3 % of the others lost" => |s| {
        s.errors.imu.dropped_fraction = 0.03;
        for start_s in s.random_times(90.0, 60.0) {
            let duration_s = s.random.uniform([0.2, 1.5]);
            s.imu_gap(start_s, duration_s);
        }
    };
    "jittered_rates", BOTH, 12.0, "rates at 50 Hz under stamps off by up to 8 ms" => |s| {
        s.imu_hz = 50.0;
        s.errors.imu.output = ImuOutput::Rates;
        s.errors.imu.stamp_jitter_s = 0.008;
    };
    "many_samples", MEMS, 8.0, "inertial samples at 1 kHz, latency of 0.4 to 0.6 s" => |s| {
        s.imu_hz = 1000.0;
        s.errors.gnss.latency_s = [0.4, 0.6];
    };
    // --- vehicles ---
    "two_swings", BOTH, 15.0,
    "velocity swings by 0.04 m/s at 17.3 Hz and by 0.08 m/s at 4.9 Hz, 5 Hz fixes" => |s| {
        s.errors.gnss.rate_hz = 5.0;
        s.vibration.push(vibration::velocity_oscillation(17.3, 0.04));
        s.vibration.push(vibration::velocity_oscillation(4.9, 0.08));
    };
    "motorcycle", MEMS, 15.0,
    "leans by up to 25 deg, vibration of 8.5 m/s^2 clips at 2 g, gyros read to 0.06 deg/s"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [8.0, 22.0],
            lateral_mps2: [2.0, 4.5],
            roll_rad_per_mps2: RouteBounds::BALANCED,
            ..RouteBounds::ROAD
        });
        s.errors.imu.accel_range_mps2 = 19.6;
        s.errors.gyro_deg_h.resolution = 216.0;
        s.vibration.push(vibration::engine(Envelope::Moving(12.0), 43.3, 8.5, 0.0));
    };
    "tram", BOTH, 18.0,
    "stops, wide curves, 7 to 16 m/s; below 0.5 m/s no velocity and one place, 2 Hz"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            rest_s: [60.0, 120.0],
            speed_mps: [7.0, 16.0],
            straight_s: [12.0, 50.0],
            stop_s: Some([12.0, 30.0]),
            turn_rad: [0.1, 1.2],
            lateral_mps2: [0.3, 0.9],
            roll_rad_per_mps2: -0.003,
            steep: 0.8,
        });
        s.receiver(2.0, [0.04, 0.04, 4.0], [0.6, 2.0, 80.0]);
        s.habits().holds_below_mps = 0.5;
    };
    "field_robot", MEMS, 20.0,
    "1 to 2.5 m/s, turns every 8 to 30 s, 5 Hz, positions to 0.02 m, or off by 0.8 m and stated so"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [1.0, 2.5],
            straight_s: [8.0, 30.0],
            turn_rad: [1.2, PI],
            lateral_mps2: [0.3, 0.8],
            roll_rad_per_mps2: 0.0,
            ..RouteBounds::ROAD
        });
        s.receiver(5.0, [0.02, 0.01, 1.0], [0.012, 0.015, 60.0]);
        s.antenna_within([0.2, 0.4, 1.2]);
        s.float_ambiguities(90.0, 0.8, [20.0, 45.0]);
    };
    "train", BOTH, 25.0, "30 to 85 m/s, wide curves, stations, antenna metres away, 1 Hz" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            rest_s: [60.0, 180.0],
            speed_mps: [30.0, 85.0],
            straight_s: [30.0, 200.0],
            stop_s: Some([40.0, 90.0]),
            turn_rad: [0.02, 0.5],
            lateral_mps2: [0.2, 0.9],
            roll_rad_per_mps2: -0.002,
            steep: 0.3,
        });
        s.receiver(1.0, [0.04, 0.04, 3.0], [0.8, 1.5, 60.0]);
        s.antenna_within([1.0, 5.0, 3.0]);
    };
    "mower", BOTH, 20.0,
    "0.3 to 0.7 m/s, turns around every 10 to 40 s, engine at 47 Hz, positions to 0.012 m" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [0.3, 0.7],
            straight_s: [10.0, 40.0],
            turn_rad: [2.0, 3.1],
            lateral_mps2: [0.1, 0.3],
            roll_rad_per_mps2: 0.0,
            ..RouteBounds::ROAD
        });
        s.receiver(10.0, [0.03, 0.02, 1.0], [0.012, 0.01, 60.0]);
        s.vibration.push(vibration::engine(Envelope::Always, 47.0, 3.0, 0.1));
    };
    "race_car", BOTH, 15.0,
    "20 to 75 m/s, bends of 6 to 16 m/s^2, engine of 8 m/s^2 at 83 Hz that sampling aliases" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [20.0, 75.0],
            straight_s: [3.0, 12.0],
            turn_rad: [0.5, 3.0],
            lateral_mps2: [6.0, 16.0],
            roll_rad_per_mps2: -0.004,
            ..RouteBounds::ROAD
        });
        s.receiver(10.0, [0.05, 0.05, 2.0], [0.5, 1.5, 60.0]);
        s.vibration.push(vibration::engine(Envelope::Always, 83.0, 8.0, 0.1));
        s.antenna_within([0.5, 1.0, 0.5]);
    };
    "delivery_van", BOTH, 25.0,
    "stops for 1 to 4 min every half minute, unit tilted by up to 20 deg, poor fixes at 1 Hz" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [5.0, 14.0],
            straight_s: [8.0, 40.0],
            turn_rad: [0.3, 3.1],
            stop_s: Some([60.0, 240.0]),
            ..RouteBounds::ROAD
        });
        s.receiver(1.0, [0.05, 0.08, 5.0], [1.0, 3.0, 40.0]);
        s.tilt_mount([0.0, 20.0]);
    };
    "rough_truck", MEMS, 15.0,
    "idles at 23 Hz with 4 m/s^2, rocks by 0.5 deg, antenna 2 m away, leans" => |s| {
        s.vibration.push(vibration::engine(Envelope::Always, 23.0, 4.0, 0.15));
        s.vibration.push(vibration::sway(0.7, 0.5));
        s.antenna_within([1.0, 2.0, 2.0]);
        s.vehicle = Vehicle::Car {
            rest_s: Some([60.0, 120.0]),
            lean: 1.5,
        };
    };
    "boat_in_waves", BOTH, 20.0,
    "swings at anchor by 0.5 deg/s in 2.5 min on waves of 5 deg, then sails, 2 Hz" => |s| {
        s.boat(240.0, 150.0, 0.5);
        s.errors.gnss.rate_hz = 2.0;
        s.velocity_noise([0.05, 0.05, 2.0]);
        s.vibration.push(vibration::waves(5.5, 5.0, 0.3));
    };
    "boat_in_short_waves", BOTH, 20.0,
    "20 Hz, antenna up to 3 m away, swings at anchor by 0.8 deg/s, waves of 4 deg and 3 s, 68 deg north"
    => |s| {
        s.boat(90.0, 60.0, 0.8);
        s.receiver(20.0, [0.02, 0.03, 1.0], [0.4, 1.0, 100.0]);
        s.antenna_within([1.0, 2.0, 3.0]);
        s.vibration.push(vibration::waves(3.0, 4.0, 0.3));
        s.origin.latitude_rad = 68.0_f64.to_radians();
        s.origin.height_m = 40.0;
    };
    "masthead", BOTH, 15.0,
    "antenna up to 6 m up a mast, waves of 10 deg and 4 s, sails after two minutes" => |s| {
        s.boat(120.0, 90.0, 0.6);
        s.noise([0.03, 0.04, 1.5], [0.4, 1.0, 80.0]);
        s.antenna_within([0.5, 1.0, 6.0]);
        s.vibration.push(vibration::waves(4.0, 10.0, 0.4));
    };
    "rolling_ship", BOTH, 20.0,
    "1 Hz, antenna up to 4 m ahead and 6 m above, long waves of 6 deg, latency of 0.1 to 0.3 s" => |s| {
        s.boat(150.0, 200.0, 0.4);
        s.errors.gnss.rate_hz = 1.0;
        s.errors.gnss.latency_s = [0.1, 0.3];
        s.velocity_noise([0.05, 0.03, 4.0]);
        s.antenna_within([2.0, 4.0, 6.0]);
        s.vibration.push(vibration::waves(9.0, 6.0, 0.5));
    };
    "coasting_in_town", BOTH, 15.0,
    "car, 5 Hz, each minute or two the receiver coasts for 3 to 8 s, antenna a metre away" => |s| {
        s.receiver(5.0, [0.05, 0.05, 2.0], [0.5, 1.5, 60.0]);
        s.antenna_within([0.5, 1.0, 1.0]);
        s.random_faults(60.0, 60.0, [3.0, 8.0], Wrong::Coasting);
    };
    "quadrotor_in_flight", MEMS, 12.0,
    "begins in flight, 10 Hz, latency of 0.2 to 0.4 s, unit turned by up to 180 deg" => |s| {
        s.vehicle = Vehicle::Quadrotor { ground_s: None };
        s.errors.gnss.latency_s = [0.2, 0.4];
        s.noise([0.05, 0.08, 2.0], [0.5, 1.5, 60.0]);
        s.tilt_mount([0.0, 180.0]);
        s.vibration.push(vibration::engine(Envelope::Always, 61.0, 2.0, 0.2));
    };
    "nothing_vertical_in_flight", BOTH, 15.0,
    "fixed wing, banks of 25 to 45 deg, from the ground, level position and velocity alone" => |s| {
        s.fixed_wing([25.0, 45.0], Begin::OnGround, 5.0);
        s.habits().gives_height = false;
        s.habits().up = Up::Missing;
    };
    "g_sensitive_in_circles", MEMS, 15.0,
    "fixed wing, banks of 35 to 60 deg, begins in flight, gyros answer by 0.03 deg/s/g, 4 Hz" => |s| {
        s.fixed_wing([35.0, 60.0], Begin::InFlight, 4.0);
        s.errors.imu.gyro_g_sensitivity_deg_h_g = 108.0;
    };
    "g_sensitive_motorcycle", MEMS, 15.0,
    "leans as far as it turns, brakes hard, unit at any angle, gyros answer by 0.04 deg/s/g" => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            roll_rad_per_mps2: RouteBounds::BALANCED,
            stop_s: Some([5.0, 20.0]),
            lateral_mps2: [1.5, 5.0],
            ..RouteBounds::ROAD
        });
        s.tilt_mount([0.0, 180.0]);
        s.errors.imu.gyro_g_sensitivity_deg_h_g = 144.0;
    };
    "glider", BOTH, 18.0,
    "begins at rest, circles for 1 to 5 min in banks of 17 to 34 deg, 34 deg south, 4 Hz"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [23.0, 32.0],
            straight_s: [10.0, 60.0],
            turn_rad: [10.0, 45.0],
            lateral_mps2: [3.0, 5.8],
            roll_rad_per_mps2: RouteBounds::BALANCED,
            steep: 2.0,
            ..RouteBounds::ROAD
        });
        s.origin.latitude_rad = -34.0_f64.to_radians();
        s.origin.height_m = 900.0;
        s.receiver(4.0, [0.05, 0.03, 2.0], [0.5, 1.5, 60.0]);
    };
    "steeper_banks", BOTH, 15.0,
    "fixed wing, banks of 35 to 60 deg, begins in flight, antenna 0.5 m away, 4 Hz" => |s| {
        s.fixed_wing([35.0, 60.0], Begin::InFlight, 4.0);
        s.antenna_within([0.5, 0.5, 0.3]);
        s.velocity_noise([0.05, 0.05, 2.0]);
    };
    "misaligned_in_circles", MEMS, 15.0,
    "fixed wing, banks of 35 to 60 deg, begins in flight, axes of gyros off by 3 mrad, 4 Hz"
    => |s| {
        s.fixed_wing([35.0, 60.0], Begin::InFlight, 4.0);
        s.errors.gyro_deg_h.misalignment_sigma = 0.003;
    };
    "pedestrian_in_town", MEMS, 18.0,
    "walks with a unit held at any angle, 1 Hz, velocity wanders by 0.1 m/s" => |s| {
        s.vehicle = Vehicle::Walker { rest_s: 5.0 };
        s.receiver(1.0, [0.05, 0.1, 5.0], [1.0, 4.0, 60.0]);
        s.tilt_mount([20.0, 160.0]);
        s.vibration.push(vibration::steps(1.8, 0.25, 6.0));
    };
    // --- a barometer beside the receiver ---
    "barometer_in_tunnels", BOTH, 20.0,
    "mountain road, 1 to 4 min without fixes every few minutes, barometer in another weather, 2 Hz"
    => |s| {
        s.vehicle = Vehicle::OnRoute(RouteBounds {
            speed_mps: [7.0, 22.0],
            straight_s: [5.0, 40.0],
            turn_rad: [0.2, 2.5],
            steep: 2.5,
            ..RouteBounds::ROAD
        });
        s.receiver(2.0, [0.05, 0.03, 3.0], [0.8, 2.0, 60.0]);
        s.errors.barometer = Some(BarometerModel {
            noise_m: 0.4,
            drift_sigma_mps: 0.03,
            air_sigma: 0.06,
            flow_sigma: 0.05,
            ..BarometerModel::ON_BOARD
        });
        for start_s in s.random_times(200.0, 240.0) {
            let duration_s = s.random.uniform([60.0, 240.0]);
            s.outages(&[start_s], duration_s);
        }
    };
    "barometer_on_a_drone", MEMS, 12.0,
    "quadrotor, nothing vertical but a barometer to 0.5 m, half a minute without fixes every two or three"
    => |s| {
        s.vehicle = Vehicle::Quadrotor {
            ground_s: Some(30.0),
        };
        s.noise([0.05, 0.05, 2.0], [0.5, 1.5, 60.0]);
        s.habits().gives_height = false;
        s.habits().up = Up::Missing;
        s.errors.barometer = Some(BarometerModel {
            noise_m: 0.5,
            flow_sigma: 0.1,
            ..BarometerModel::ON_BOARD
        });
        let times = s.random_times(120.0, 90.0);
        s.outages(&times, 30.0);
    };
    // --- combinations ---
    "in_other_company", BOTH, 15.0, "two of the other kinds at once, drawn anew for each seed"
        => |s| combined(s, KINDS);
    // --- random scenarios ---
    "anything_else", BOTH, 15.0, "vehicle, unit and receiver with every number drawn anew for each seed"
        => anything;
}

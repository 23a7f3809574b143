//! Flights of the simulated Cessna 172.

use std::path::Path;

use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::flight::Flight;
use host_sim::aircraft::plan::{Path2d, Plan};
use host_sim::aircraft::trajectory::euler;
use host_sim::aircraft::wind::Turbulence;
use host_sim::sim::Motion;
use host_sim::sim::ideal;

fn route() -> (Dynamics, Plan) {
    let dynamics = Dynamics::new(&cessna172());
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("plans/route_one_hour.toml");
    let plan = Plan::read(&file, &dynamics).unwrap_or_else(|error| panic!("{error}"));
    (dynamics, plan)
}

#[test]
fn flies_the_route() {
    let (dynamics, plan) = route();
    let mut flight = Flight::new(&dynamics, &plan, 1).unwrap();
    let duration_s = flight
        .duration_s()
        .unwrap_or_else(|error| panic!("{error}"));
    assert!((3400.0..4000.0).contains(&duration_s), "{duration_s}");

    let mut nearest_m = vec![f64::INFINITY; plan.legs.len()];
    let (mut height_error, mut speed_square, mut count_steady, mut sideslip, mut count) =
        (0.0, 0.0, 0.0, 0.0, 0.0);
    let mut steady_since_s = f64::INFINITY;
    let mut target = flight.target;
    let times = (0..).map(|i| 0.1 * f64::from(i));
    for time_s in times.take_while(|time_s| *time_s < duration_s) {
        let _ = flight.kinematics(time_s);
        for (distance_m, leg) in nearest_m.iter_mut().zip(&plan.legs) {
            if let Path2d::To(position) = leg.path {
                let to = ins_core::earth::Geodetic {
                    latitude_rad: position.latitude_rad,
                    longitude_rad: position.longitude_rad,
                    height_m: 0.0,
                };
                *distance_m = flight.position.enu_from(&to).xy().norm().min(*distance_m);
            }
        }
        if flight.target != target {
            target = flight.target;
            steady_since_s = f64::INFINITY;
        }
        let state = flight.node.state;
        let air = state.air_data(&flight.inputs.wind);
        sideslip += air.beta_rad * air.beta_rad;
        count += 1.0;
        let height: f64 = state.height_m - target.height_m;
        let speed = air.airspeed_mps - target.airspeed_mps;
        // Evaluated from a minute after both were first reached.
        if height.abs() < 5.0 && speed.abs() < 2.0 {
            steady_since_s = time_s.min(steady_since_s);
        }
        if time_s > steady_since_s + 60.0 {
            height_error = height.abs().max(height_error);
            speed_square += speed * speed;
            count_steady += 1.0;
        }
    }
    // Fly-by turns: the corner is cut by R (1/cos(angle/2) - 1).
    for (distance_m, leg) in nearest_m.iter().zip(&plan.legs) {
        assert!(
            !distance_m.is_finite() || *distance_m < 900.0,
            "{distance_m} m past {leg:?}"
        );
    }
    let speed_error = f64::sqrt(speed_square / count_steady);
    println!(
        "height {height_error:.1} m, speed {speed_error:.1} m/s, slip {:.2} deg",
        f64::sqrt(sideslip / count).to_degrees()
    );
    // Gusts of 1.5 m/s in three axes; a downdraft of 3 m/s requires full power.
    assert!(height_error < 40.0, "{height_error} m");
    assert!(speed_error < 3.0, "{speed_error} m/s RMS");
    assert!(
        (sideslip / count).sqrt() < 0.02,
        "turns are coordinated: {}",
        (sideslip / count).sqrt()
    );
    let end = euler(&flight.node.state);
    assert!(end.roll_rad.abs() < 0.6);
}

/// Largest errors of position (m), velocity (m/s) and attitude (rad) of an error-free strapdown.
fn strapdown_errors(dynamics: &Dynamics, plan: &Plan, rate_hz: u32, duration_s: u32) -> [f64; 3] {
    let flight = Flight::new(dynamics, plan, 7).unwrap();
    ideal::strapdown_errors(flight, plan.start.position, rate_hz, duration_s)
}

const ARC_SECOND: f64 = std::f64::consts::PI / 180.0 / 3600.0;

#[test]
fn error_free_strapdown_reproduces_an_hour_of_flight() {
    let (dynamics, mut plan) = route();
    plan.turbulence = Turbulence::Light;
    let [position_m, velocity_mps, attitude_rad] = strapdown_errors(&dynamics, &plan, 100, 3400);
    println!(
        "{position_m} m, {velocity_mps} m/s, {} arc seconds",
        attitude_rad / ARC_SECOND
    );
    assert!(position_m < 1.0, "{position_m} m");
    assert!(velocity_mps < 1e-3, "{velocity_mps} m/s");
    assert!(
        attitude_rad < ARC_SECOND,
        "{} arc seconds",
        attitude_rad / ARC_SECOND
    );
}

#[test]
fn strapdown_error_falls_with_the_sampling_rate() {
    let (dynamics, plan) = route();
    // Severe: turbulence is not fully compensated by the two-sample coning and sculling.
    let plan = Plan {
        turbulence: Turbulence::Severe,
        ..plan
    };
    let at = |rate_hz| strapdown_errors(&dynamics, &plan, rate_hz, 300);
    let (slow, usual, fast) = (at(50), at(100), at(200));
    for i in 0..3 {
        assert!(
            usual[i] < 0.5 * slow[i] && fast[i] < 0.5 * usual[i],
            "{slow:?} {usual:?} {fast:?}"
        );
    }
}

#[test]
fn the_seed_determines_the_flight() {
    let (dynamics, plan) = route();
    let run = |seed| {
        let mut flight = Flight::new(&dynamics, &plan, seed).unwrap();
        flight.kinematics(600.0)
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

/// Velocity is the integral of acceleration, attitude that of the rate, also with vibration.
#[test]
fn kinematics_are_consistent() {
    let (dynamics, plan) = route();
    for vibration in [false, true] {
        let plan = Plan {
            vibration,
            ..plan.clone()
        };
        let mut flight = Flight::new(&dynamics, &plan, 3).unwrap();
        let step_s = 1e-6;
        for i in 0..2000 {
            // Irregular times within the integrator's steps.
            let time_s = 30.0 + 0.0373 * f64::from(i);
            if (time_s / 0.02).fract() > 0.99 {
                continue;
            }
            let from = flight.kinematics(time_s);
            let to = flight.kinematics(time_s + step_s);
            let acceleration = (to.velocity_enu_mps - from.velocity_enu_mps) / step_s;
            let mean = 0.5 * (to.acceleration_enu_mps2 + from.acceleration_enu_mps2);
            // Rounding of 50 m/s over a microsecond: 1e-8.
            assert!(
                (acceleration - mean).norm() < 1e-6,
                "{time_s} s, vibration {vibration}: {acceleration} {mean}"
            );
            let measured_rate = (from.attitude.inverse() * to.attitude).scaled_axis() / step_s;
            let rate = 0.5 * (to.angular_rate_lb_b_radps + from.angular_rate_lb_b_radps);
            assert!(
                (measured_rate - rate).norm() < 1e-8,
                "{time_s} s, vibration {vibration}: {measured_rate} {rate}"
            );
        }
    }
}

/// As of a geared propeller: not a multiple of a half.
#[test]
fn vibration_of_any_order_is_smooth() {
    let (mut dynamics, plan) = route();
    let lines = &mut dynamics.parameters.vibration.lines;
    lines.truncate(1);
    lines[0].order = 0.7;
    let plan = Plan {
        vibration: true,
        turbulence: Turbulence::None,
        ..plan
    };
    let mut flight = Flight::new(&dynamics, &plan, 1).unwrap();
    let step_s = 1e-3;
    let mut from = flight.kinematics(0.0);
    for i in 1..2000 {
        let to = flight.kinematics(step_s * f64::from(i));
        let change = to.velocity_enu_mps - from.velocity_enu_mps;
        let mean = 0.5 * (to.acceleration_enu_mps2 + from.acceleration_enu_mps2);
        // h^3/12 of its second derivative, 0.4 m/s^2 at 32 Hz: 1.3e-6. The line has an amplitude of 2e-3.
        let error = (change - step_s * mean).norm();
        assert!(error < 5e-6, "{i}: {error} m/s");
        from = to;
    }
}

/// Lines up to 90 Hz: sampled at 100 Hz they alias, and the strapdown drifts; sampled at 1 kHz they do not.
#[test]
fn vibration_aliases_unless_sampled_fast_enough() {
    let (dynamics, plan) = route();
    let plan = Plan {
        vibration: true,
        turbulence: Turbulence::None,
        ..plan
    };
    let [_, _, aliased] = strapdown_errors(&dynamics, &plan, 100, 60);
    let [_, _, resolved] = strapdown_errors(&dynamics, &plan, 1000, 60);
    assert!(aliased > 0.3 * ARC_SECOND, "{}", aliased / ARC_SECOND);
    assert!(
        resolved < 0.05 * aliased,
        "{} {}",
        aliased / ARC_SECOND,
        resolved / ARC_SECOND
    );
}

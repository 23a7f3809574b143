//! Flight dynamics of the aircraft: integrator, steady flight, modes, stall, power, and the Cessna 172
//! against its specification.

use host_sim::aircraft::aerodynamics::Surfaces;
use host_sim::aircraft::atmosphere::{self, Density};
use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::{Dynamics, Inputs, STEP_S, State};
use host_sim::aircraft::performance::{performance, stall_speed_mps};
use host_sim::aircraft::trajectory::euler;
use host_sim::aircraft::trim::{Condition, Power, Trim, modes};
use nalgebra::Vector3;

const SPEED_MPS: f64 = 52.0;
const HEIGHT_M: f64 = 1000.0;

fn cessna() -> Dynamics {
    Dynamics::new(&cessna172())
}

fn level(dynamics: &Dynamics) -> Trim {
    Condition::level(SPEED_MPS, HEIGHT_M)
        .trim(dynamics)
        .unwrap()
}

/// Open-loop flight: the state after every step.
fn states(
    dynamics: &Dynamics,
    start: &State,
    inputs: impl Fn(f64) -> Inputs,
    step_s: f64,
) -> impl Iterator<Item = State> {
    let (mut state, mut inputs_now) = (*start, inputs(0.0));
    (1..).map(move |i| {
        let next = inputs(f64::from(i) * step_s);
        let density = Density::around(state.height_m);
        let first = dynamics.derivative(&state, &inputs_now, &density);
        state = dynamics.step(&state, &first, &inputs_now, &next, &density, step_s);
        inputs_now = next;
        state
    })
}

/// Oscillating controls in gusty air, linear between knots, so that any step that divides a knot interval
/// has the same inputs.
fn vigorous(trim: &Trim) -> impl Fn(f64) -> Inputs {
    const KNOT_S: f64 = 0.08;
    let base = trim.inputs;
    move |time_s| {
        let knot = (time_s / KNOT_S + 1e-9).floor();
        let part = time_s / KNOT_S - knot;
        let wave = |omega: f64| {
            let at = |k: f64| libm::sin(omega * KNOT_S * k);
            at(knot) + part * (at(knot + 1.0) - at(knot))
        };
        let mut inputs = base;
        inputs.controls.surfaces.elevator_rad += 0.01 * wave(2.0);
        inputs.controls.surfaces.aileron_rad += 0.05 * wave(3.0);
        inputs.controls.surfaces.rudder_rad += 0.05 * wave(4.0);
        inputs.controls.throttle += 0.1 * wave(0.5);
        inputs.wind.gust_mps = Vector3::new(2.0 * wave(5.0), 3.0 * wave(1.0), 2.0 * wave(7.0));
        inputs
    }
}

#[test]
fn step_size_is_small_enough() {
    let dynamics = cessna();
    let trim = level(&dynamics);
    let end = |step_s: f64, steps: usize| {
        let mut states = states(&dynamics, &trim.state, vigorous(&trim), step_s);
        states.nth(steps - 1).unwrap()
    };
    let exact = end(0.001, 20_000);
    let velocity = |state: &State| (state.velocity_enu_mps - exact.velocity_enu_mps).norm();
    let attitude = |state: &State| (state.attitude - exact.attitude).norm();
    let used = end(STEP_S, 1000);
    // After 20 s of vigorous flight the errors of the step are below those of any sensor.
    assert!(velocity(&used) < 2e-6, "{} m/s", velocity(&used));
    assert!(attitude(&used) < 1e-7, "{} rad", attitude(&used));
    // Fourth order (16), and some of the next order. With smaller steps rounding and the linear density
    // dominate.
    let order = attitude(&end(0.08, 250)) / attitude(&end(0.04, 500));
    assert!((10.0..30.0).contains(&order), "{order}");
}

#[test]
fn trimmed_flight_stays_steady() {
    let dynamics = cessna();
    let level = Condition::level(SPEED_MPS, HEIGHT_M);
    let [mut climb, mut descent, mut left, mut right, mut flaps] = [level; 5];
    (climb.airspeed_mps, climb.power) = (40.0, Power::Throttle(1.0));
    descent.power = Power::ClimbRate(-3.0);
    (left.bank_rad, right.bank_rad) = (-0.5, 0.5);
    (flaps.airspeed_mps, flaps.flaps) = (32.0, 1.0);
    for (name, condition) in [
        ("level", level),
        ("climb", climb),
        ("descent", descent),
        ("left turn", left),
        ("right turn", right),
        ("flaps down", flaps),
    ] {
        let trim = condition
            .trim(&dynamics)
            .unwrap_or_else(|| panic!("{name}"));
        let mut states = states(&dynamics, &trim.state, |_| trim.inputs, STEP_S);
        let end = states.nth(249).unwrap();
        let angles = euler(&end);
        let turned = 5.0 * trim.turn_rate_radps;
        assert!(
            (angles.roll_rad - trim.euler.roll_rad).abs() < 1e-3,
            "{name}: roll {}",
            angles.roll_rad
        );
        assert!(
            (angles.pitch_rad - trim.euler.pitch_rad).abs() < 1e-3,
            "{name}: pitch"
        );
        assert!(
            (angles.heading_rad - turned).abs() < 1e-3,
            "{name}: heading {}",
            angles.heading_rad
        );
        // Density changes along a climb, so the trim changes slowly.
        let speed = end.velocity_enu_mps.norm() - trim.state.velocity_enu_mps.norm();
        assert!(speed.abs() < 0.02, "{name}: {speed} m/s");
    }
}

#[test]
fn turn_rate_matches_the_textbook() {
    let dynamics = cessna();
    let bank_rad = 0.5;
    let trim = Condition {
        bank_rad,
        ..Condition::level(SPEED_MPS, HEIGHT_M)
    }
    .trim(&dynamics)
    .unwrap();
    let expected = atmosphere::GRAVITY_MPS2 * libm::tan(bank_rad) / SPEED_MPS;
    // The textbook omits the side force of rudder and yaw rate.
    assert!(
        (trim.turn_rate_radps / expected - 1.0).abs() < 0.02,
        "{}",
        trim.turn_rate_radps / expected
    );
}

#[test]
fn there_is_no_level_flight_below_the_stall() {
    let dynamics = cessna();
    let stall = stall_speed_mps(&dynamics, HEIGHT_M, 0.0);
    assert!(
        Condition::level(0.93 * stall, HEIGHT_M)
            .trim(&dynamics)
            .is_none()
    );
    assert!(
        Condition::level(1.05 * stall, HEIGHT_M)
            .trim(&dynamics)
            .is_some()
    );
}

#[test]
fn the_wing_stalls() {
    let parameters = cessna172();
    let dynamics = cessna();
    let lift = |alpha: f64| {
        dynamics
            .aerodynamics
            .wing(alpha, libm::sin(alpha), libm::cos(alpha), 0.0)
            .0
    };
    let peak = (0..600)
        .map(|i| lift(0.001 * f64::from(i)))
        .fold(0.0, f64::max);
    assert!((peak / parameters.lift.maximum - 1.0).abs() < 1e-6);
    assert!(
        lift(0.35) < 0.8 * peak,
        "lift is lost beyond the stall: {}",
        lift(0.35)
    );
    assert!(
        lift(std::f64::consts::FRAC_PI_4) > 0.6,
        "a plate at 45 degrees still lifts"
    );
    assert!(lift(-0.5) < 0.0);
}

/// Small motions by the full equations against the eigenvalues.
#[test]
fn modes_match_simulated_motion() {
    let dynamics = cessna();
    let trim = level(&dynamics);
    let modes = modes(&dynamics, &trim).unwrap();

    // Phugoid: time between two upward crossings of the pitch angle after the fast modes are gone.
    let mut disturbed = trim.state;
    disturbed.velocity_enu_mps.y += 1.0;
    let half_seconds = states(&dynamics, &disturbed, |_| trim.inputs, STEP_S).skip(499);
    let pitch = |state: State| euler(&state).pitch_rad - trim.euler.pitch_rad;
    let samples: Vec<f64> = half_seconds.step_by(25).take(280).map(pitch).collect();
    let crossings: Vec<f64> = samples
        .windows(2)
        .enumerate()
        .filter(|(_, w)| w[0] < 0.0 && w[1] >= 0.0)
        .map(|(i, w)| 0.5 * (i as f64 - w[0] / (w[1] - w[0])))
        .collect();
    let period_s = crossings[1] - crossings[0];
    // The change of density with height is not in the eigenvalues.
    assert!(
        (period_s / modes.phugoid.period_s - 1.0).abs() < 0.04,
        "{period_s} s, {:?}",
        modes.phugoid
    );

    // Roll: the decay of a roll rate, before sideslip builds up.
    let mut disturbed = trim.state;
    disturbed.rate_radps.y += 0.02;
    let mut states = states(&dynamics, &disturbed, |_| trim.inputs, 0.001);
    let later = states.nth(49).unwrap();
    let time_constant_s = 0.05 / libm::log(disturbed.rate_radps.y / later.rate_radps.y);
    assert!(
        (time_constant_s / modes.roll_time_constant_s - 1.0).abs() < 0.1,
        "{time_constant_s} s, {}",
        modes.roll_time_constant_s
    );
}

/// Textbook approximations (Etkin and Reid, chapter 6), each good to some ten or twenty per cent.
#[test]
fn modes_follow_the_textbook_approximations() {
    let p = cessna172();
    let dynamics = cessna();
    let trim = level(&dynamics);
    let modes = modes(&dynamics, &trim).unwrap();
    let pressure = 0.5 * atmosphere::density(HEIGHT_M) * SPEED_MPS * SPEED_MPS;
    let area = p.geometry.wing_area_m2;
    let lanchester_s =
        std::f64::consts::TAU * SPEED_MPS / (2.0_f64.sqrt() * atmosphere::GRAVITY_MPS2);
    // Lanchester holds the angle of attack; a real aircraft also has pitch damping, which slows it.
    assert!(
        (1.0..1.35).contains(&(modes.phugoid.period_s / lanchester_s)),
        "{lanchester_s}, {:?}",
        modes.phugoid
    );
    let roll_s = -p.mass.roll_inertia_kgm2 * 2.0 * SPEED_MPS
        / (pressure * area * p.geometry.wing_span_m * p.geometry.wing_span_m * p.roll.roll_rate);
    assert!(
        (modes.roll_time_constant_s / roll_s - 1.0).abs() < 0.15,
        "{roll_s}"
    );
    let chord = p.geometry.mean_chord_m;
    let m_alpha = pressure * area * chord * p.pitch.alpha / p.mass.pitch_inertia_kgm2;
    let m_q = pressure * area * chord * chord * p.pitch.pitch_rate
        / (2.0 * SPEED_MPS * p.mass.pitch_inertia_kgm2);
    let z_alpha = pressure * area * p.lift.alpha / (p.mass.mass_kg * SPEED_MPS);
    let short_period = (-m_alpha - m_q * z_alpha).sqrt();
    assert!(
        (modes.short_period.natural_frequency_radps / short_period - 1.0).abs() < 0.1,
        "{short_period}"
    );
    let dutch_roll = (pressure * area * p.geometry.wing_span_m * p.yaw.sideslip
        / p.mass.yaw_inertia_kgm2)
        .sqrt();
    assert!(
        (modes.dutch_roll.natural_frequency_radps / dutch_roll - 1.0).abs() < 0.15,
        "{dutch_roll}"
    );
}

#[test]
fn power_falls_with_height_and_propeller_follows_momentum_theory() {
    let p = cessna172();
    let rated = std::f64::consts::TAU * p.engine.rated_speed_rps;
    let power = |height_m: f64| rated * p.engine.torque_nm(1.0, atmosphere::density(height_m));
    // Lycoming operator's charts: some 75 % of the power at 7500-8000 ft with open throttle.
    assert!(
        (0.72..0.79).contains(&(power(2350.0) / power(0.0))),
        "{}",
        power(2350.0) / power(0.0)
    );
    assert!(
        p.engine.torque_nm(0.0, 1.225) < 0.15 * p.engine.torque_nm(1.0, 1.225),
        "idles"
    );

    let disc_m2 = 0.25 * std::f64::consts::PI * p.propeller.diameter_m * p.propeller.diameter_m;
    for airspeed in [0.0, 20.0, 40.0, 60.0] {
        let engine_rps = 42.0;
        let thrust = p.propeller.thrust(airspeed, engine_rps, 1.225);
        let shaft_w = std::f64::consts::TAU * engine_rps * thrust.torque_nm;
        // Actuator disc: least power for this thrust.
        let induced = -0.5 * airspeed
            + (0.25 * airspeed * airspeed + thrust.thrust_n / (2.0 * 1.225 * disc_m2)).sqrt();
        let least_w = thrust.thrust_n * (airspeed + induced);
        assert!(
            shaft_w > 1.02 * least_w,
            "{airspeed} m/s: {shaft_w} W, least {least_w} W"
        );
    }
    assert!(
        p.propeller.thrust(100.0, 42.0, 1.225).thrust_n < 0.0,
        "a windmilling propeller brakes"
    );
}

#[test]
fn propeller_torque_and_precession_have_the_right_sign() {
    let dynamics = cessna();
    let trim = level(&dynamics);
    // Clockwise seen from behind: the torque rolls the aircraft left, right aileron compensates.
    assert!(trim.inputs.controls.surfaces.aileron_rad > 0.0);
    // Pitching up swings the nose right (spin axis forward, torque up: gyroscopic precession).
    let mut pitching = trim.state;
    pitching.rate_radps.x += 0.1;
    let density = Density::around(HEIGHT_M);
    let yaw = |state: &State| {
        -dynamics
            .derivative(state, &trim.inputs, &density)
            .rate_radps2
            .z
    };
    assert!(yaw(&pitching) > yaw(&trim.state));
}

#[test]
fn control_surfaces_have_the_right_sign() {
    let dynamics = cessna();
    let trim = level(&dynamics);
    let density = Density::around(HEIGHT_M);
    let rates = |inputs: &Inputs| {
        dynamics
            .derivative(&trim.state, inputs, &density)
            .rate_radps2
    };
    let neutral = rates(&trim.inputs);
    let with = |change: fn(&mut Surfaces)| {
        let mut inputs = trim.inputs;
        change(&mut inputs.controls.surfaces);
        rates(&inputs) - neutral
    };
    assert!(
        with(|s| s.elevator_rad += 0.01).x < 0.0,
        "elevator down: nose down"
    );
    assert!(with(|s| s.aileron_rad += 0.01).y > 0.0, "right roll");
    assert!(
        with(|s| s.rudder_rad += 0.01).z > 0.0,
        "rudder left: nose left, about up"
    );
}

#[test]
fn cessna_172_meets_its_specification() {
    let parameters = cessna172();
    let table = performance(&Dynamics::new(&parameters)).expect("it flies");
    let published = parameters.specification.as_ref().expect("it is published");
    // Table 2 of the thesis: its own model was off by 4, 2 and 25 %.
    for (what, ours, theirs) in [
        (
            "maximum level speed",
            table.max_speed_kmh,
            published.max_speed_kmh,
        ),
        (
            "stall speed",
            table.stall_speed_kmh,
            published.stall_speed_kmh,
        ),
        ("climb rate", table.climb_rate_mps, published.climb_rate_mps),
    ] {
        assert!(
            (ours / theirs - 1.0).abs() < 0.02,
            "{what}: {ours}, published {theirs}"
        );
    }
}

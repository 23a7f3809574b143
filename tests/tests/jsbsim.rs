//! Our Cessna 172 against `JSBSim`'s; docs/aircraft.md says what differs.

use host_sim::aircraft::performance::TrimRow;
use ins_tests::jsbsim::{ReferenceRow, SPEEDS_MPS, ours, ours_with_its_numbers, reference};
use ins_tests::python::answer;

/// Name, ours, theirs, tolerance of the ratio.
type Line = (&'static str, f64, f64, f64);

fn check(airspeed_mps: f64, lines: &[Line]) {
    for (name, ours, theirs, tolerance) in lines {
        let ratio = ours / theirs;
        assert!(
            (ratio - 1.0).abs() < *tolerance,
            "{airspeed_mps} m/s, {name}: ours {ours}, JSBSim {theirs}"
        );
    }
}

#[test]
fn trim_and_modes_are_those_of_jsbsim() {
    let Some(reference) = answer("JSBSim", reference()) else {
        return;
    };
    assert_eq!(reference.rows.len(), SPEEDS_MPS.len());
    for (mine, its) in ours().iter().zip(&reference.rows) {
        assert!((its.airspeed_mps - mine.airspeed_mps).abs() < 0.01);
        // Both lift lines were read from the same wing; half a degree is their disagreement.
        assert!(
            (mine.alpha_deg - its.alpha_deg).abs() < 0.5,
            "{} {}",
            mine.alpha_deg,
            its.alpha_deg
        );
        // Drag polar and propeller are modelled differently: 15 and 20 %.
        check(
            mine.airspeed_mps,
            &[
                ("thrust", mine.thrust_n, its.thrust_n, 0.15),
                ("shaft power", mine.shaft_power_kw, its.shaft_power_kw, 0.2),
                ("engine speed", mine.engine_rpm, its.engine_rpm, 0.06),
            ],
        );
        check(mine.airspeed_mps, &modes(mine, its, 0.20, 0.45));
    }
}

/// With the same inertia and pitch stiffness the equations of motion must give the same modes.
#[test]
fn with_the_same_inertia_and_stiffness_the_modes_agree() {
    let Some(reference) = answer("JSBSim", reference()) else {
        return;
    };
    let ours = ours_with_its_numbers(&reference);
    assert_eq!(ours.len(), SPEEDS_MPS.len());
    for (mine, its) in ours.iter().zip(&reference.rows) {
        check(its.airspeed_mps, &modes(mine, its, 0.20, 0.12));
    }
}

/// The slow mode within one tolerance, the fast ones within another.
fn modes(mine: &TrimRow, its: &ReferenceRow, slow: f64, fast: f64) -> Vec<Line> {
    let (a, b) = (mine.modes.expect("all modes exist"), its.modes);
    vec![
        (
            "phugoid period",
            a.phugoid.period_s,
            b.phugoid.period_s,
            slow,
        ),
        (
            "short period",
            a.short_period.natural_frequency_radps,
            b.short_period.natural_frequency_radps,
            fast,
        ),
        (
            "short period damping",
            a.short_period.damping_ratio,
            b.short_period.damping_ratio,
            fast,
        ),
        (
            "Dutch roll",
            a.dutch_roll.natural_frequency_radps,
            b.dutch_roll.natural_frequency_radps,
            fast,
        ),
        (
            "Dutch roll damping",
            a.dutch_roll.damping_ratio,
            b.dutch_roll.damping_ratio,
            fast + 0.1,
        ),
        ("roll", a.roll_time_constant_s, b.roll_time_constant_s, fast),
    ]
}

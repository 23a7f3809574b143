//! Steps at two a second, with and without turns between them.

use super::*;

const LATENCY_S: f64 = 0.1;
const PERIOD_S: f64 = 0.5;

/// Steps while walking; the direction changes where it turns.
fn velocity(time_s: f64, turns: bool) -> Vector2<f32> {
    let step = 0.15 * libm::sin(core::f64::consts::TAU * time_s / PERIOD_S);
    let heading = if turns { libm::sin(0.4 * time_s) } else { 0.0 };
    let speed = 1.3 + step;
    Vector2::new(speed * libm::sin(heading), speed * libm::cos(heading)).map(math::single)
}

/// Minutes of fixes at four a second, taken with a latency; the one that has won.
fn after_minutes(own_s: f64, turns: bool) -> (LatencyRivals, Option<f64>) {
    let mut rivals = LatencyRivals::default();
    let mut won = None;
    for number in 0..1500_u32 {
        let stamp_s = 0.23 * f64::from(number);
        let noise = 0.03 * math::single(libm::sin(f64::from(number * number)));
        let gnss = velocity(stamp_s - LATENCY_S, turns) + Vector2::new(noise, -noise);
        let with = |latency_s: f64, _: &Vector3<f32>| {
            let time_s = stamp_s - latency_s;
            let ahead = velocity(time_s + 0.01, turns) - velocity(time_s - 0.01, turns);
            Some(Residual {
                velocity_mps: velocity(time_s, turns) - gnss,
                accel_mps2: ahead / 0.02,
                swing_mps: Vector2::new(noise, 0.1),
            })
        };
        won = won.or(rivals.take(&Vector3::y(), own_s, with));
    }
    (rivals, won)
}

#[test]
fn turns_show_that_a_latency_is_a_step_off() {
    let (_, won) = after_minutes(LATENCY_S + PERIOD_S, true);
    // Steps are no sines of time any more where they turn: a hundredth of a second.
    assert!(
        won.is_some_and(|won| (won - LATENCY_S).abs() < 0.01),
        "{won:?}"
    );
}

#[test]
fn the_right_latency_is_let_alone() {
    let (rivals, won) = after_minutes(LATENCY_S, true);
    assert_eq!(won, None);
    assert!(rivals.open_s(LATENCY_S, 0.002) <= 0.0);
}

#[test]
fn what_only_repeats_leaves_it_open() {
    let (rivals, won) = after_minutes(LATENCY_S, false);
    assert_eq!(won, None);
    assert!(
        (rivals.open_s(LATENCY_S, 0.002) - PERIOD_S).abs() < 0.6,
        "{rivals:?}"
    );
    assert!(rivals.open_s(LATENCY_S, 0.002) > 0.4);
    // A spread that admits it says so itself.
    assert!(rivals.open_s(LATENCY_S, 0.2) <= 0.0);
}

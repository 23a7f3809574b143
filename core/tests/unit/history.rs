//! Spans and their ring: independent of how they are divided, exact for constant jerk, and limited to
//! the stored interval.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods)] // Reference values.
#![allow(clippy::unwrap_used)]

use core::f64::consts::TAU;

use crate::Time;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::history::{History, Missing, Span, Vibration};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use std::vec::Vec;

const ACCEL: Vector3<f64> = Vector3::new(1.5, -0.7, 0.2);
const JERK: Vector3<f64> = Vector3::new(-3.0, 2.0, 1.0);
const RATE: Vector3<f64> = Vector3::new(0.1, -0.2, 0.4);
const RATE_GROWTH: Vector3<f64> = Vector3::new(0.3, 0.1, -0.5);
/// Rounding in the ring, of numbers of up to ten.
const ROUNDING: f64 = 1e-6;

/// Entries for latency and late arrival of 1.2 s.
const N: usize = 12;

fn time_at(t: f64) -> Time {
    Time::default().plus_seconds(t)
}

fn velocity(t: f64) -> Vector3<f64> {
    t * ACCEL + 0.5 * t * t * JERK
}

fn position(t: f64) -> Vector3<f64> {
    t * t * (0.5 * ACCEL + t / 6.0 * JERK)
}

fn attitude(t: f64) -> Matrix3<f64> {
    Matrix3::identity() + t * Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0))
}

/// A vehicle whose acceleration, rate and attitude change steadily.
fn span(from: f64, to: f64) -> Span {
    let seconds = to - from;
    let middle = 0.5 * (from + to);
    Span {
        seconds,
        force_mps: velocity(to) - velocity(from) + Vector3::z() * (seconds * GRAVITY_EQUATOR_MPS2),
        force_position_m: position(to) - position(from) - velocity(from) * seconds
            + Vector3::z() * (0.5 * seconds * seconds * GRAVITY_EQUATOR_MPS2),
        attitude_s: seconds * attitude(middle),
        angle_rad: seconds * (RATE + middle * RATE_GROWTH),
        way_m: position(to) - position(from),
        ..Span::default()
    }
}

fn filled_ring(times: &[f64]) -> History<N> {
    let mut history = History::default();
    let mut before = -0.1;
    for t in times {
        assert!(history.is_due(time_at(*t), 0.01));
        history.push(
            time_at(*t),
            &((position(*t) - position(before)) / (t - before)),
            &span(before, *t),
            &Vibration::default(),
        );
        before = *t;
    }
    history
}

#[test]
fn interpolation_is_exact_for_constant_jerk() {
    // Unequal steps, as of samples.
    let times = [0.0, 0.12, 0.25, 0.37, 0.5, 0.62];
    let history = filled_ring(&times);
    for t in [0.0, 0.05, 0.133, 0.25, 0.31, 0.449, 0.5, 0.62] {
        let past = history.at(time_at(t), false).unwrap();
        assert!((past.velocity_mps - velocity(t)).norm() < ROUNDING, "{t}");
        // Rounding of means over a tenth of a second is ten times as large, of their differences a hundred
        // times.
        let accel = ACCEL + t * JERK;
        assert!((past.accel_mps2 - accel).norm() < 100.0 * ROUNDING, "{t}");
        assert!(
            (past.attitude - attitude(t)).norm() < 100.0 * ROUNDING,
            "{t}"
        );
        let rate = (RATE + t * RATE_GROWTH).cross_matrix();
        let oscillation = past.attitude_rate - attitude(t) * rate;
        assert!(oscillation.norm() < 100.0 * ROUNDING, "{t}");
        let accel = attitude(t) * (rate * rate + RATE_GROWTH.cross_matrix());
        assert!(
            (past.attitude_accel - accel).norm() < 100.0 * ROUNDING,
            "{t}"
        );
        assert_eq!(past.time, time_at(t));
        // Velocity is interpolated linearly between entries: J h^3 / 12 with h < 0.13 s.
        let tolerance = JERK.norm() * 0.13_f64.powi(3) / 12.0;
        let error = past.way_since_m - (position(0.62) - position(t));
        assert!(error.norm() < tolerance, "{t}: {error}");
    }
}

#[test]
fn times_outside_the_ring_are_reported_missing() {
    let at = |history: &History<N>, t: f64| history.at(time_at(t), false);
    assert_eq!(at(&History::default(), 0.0), Err(Missing::Future));
    // A single entry is the end of a span that began before it.
    assert_eq!(at(&filled_ring(&[0.0]), 0.0), Err(Missing::TooOld));
    assert_eq!(at(&filled_ring(&[0.0, 0.12]), -0.01), Err(Missing::TooOld));
    let times: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.12).collect();
    let history = filled_ring(&times);
    assert_eq!(at(&history, 11.89), Err(Missing::Future));
    // No entry after the last interval yet.
    let waiting = |t: f64| history.at(time_at(t), true);
    assert_eq!(waiting(11.87), Err(Missing::Future));
    assert!(waiting(11.75).is_ok());
    assert!(at(&history, 11.87).is_ok());
    // Eleven intervals are kept: from 88 * 0.12 s on.
    assert!(at(&history, 10.57).is_ok());
    assert_eq!(at(&history, 10.55), Err(Missing::TooOld));
    assert_eq!(history.next_dropped(), Some(time_at(10.56)));
    assert!(!history.is_due(time_at(11.98), 0.01));
    assert!(history.is_due(time_at(11.99), 0.01));
    // At 10 Hz no sample is skipped.
    assert!(history.is_due(time_at(11.98), 0.1));
}

/// Difference of an east velocity from its low-pass mean with time constant `memory_s` and without delay; also
/// checks that of an antenna on a lever arm of unit length.
fn above_low_pass(
    memory_s: f64,
    at: f64,
    east_m: impl Fn(f64) -> f64,
    east_mps: impl Fn(f64) -> f64,
) -> f64 {
    let mut history = History::<24>::default();
    for k in 1..=30 {
        let (from, to) = (0.1 * f64::from(k - 1), 0.1 * f64::from(k));
        let gained = Vector3::new(east_mps(to) - east_mps(from), 0.0, 0.0);
        let mut attitude = Matrix3::identity();
        attitude.m12 = east_m(0.5 * (from + to));
        let span = Span {
            seconds: 0.1,
            force_mps: gained + Vector3::z() * (0.1 * GRAVITY_EQUATOR_MPS2),
            attitude_s: attitude * 0.1,
            ..Span::default()
        };
        history.push(time_at(to), &Vector3::zeros(), &span, &Vibration::default());
    }
    let mut past = history.at(time_at(at), false).unwrap();
    history.smooth(&mut past, memory_s);
    assert!(past.jerk_mps3.yz().norm() < 1000.0 * ROUNDING);
    let deviation = |jerk: f64| -0.5 * memory_s * memory_s * jerk;
    // Interpolation between means reduces an oscillation by some thousandths.
    let on_arm = deviation(f64::from(past.attitude_jerk.m12));
    assert!(
        (on_arm - deviation(past.jerk_mps3.x)).abs() < 0.01,
        "{on_arm}"
    );
    deviation(past.jerk_mps3.x)
}

#[test]
fn smoothed_velocity_matches_a_low_pass() {
    for (memory_s, rate) in [(0.5_f64, 2.0_f64), (0.2, 6.0)] {
        let oscillation = |t: f64| (rate * t).sin();
        let integral = |t: f64| -(rate * t).cos() / rate;
        let phase = rate * memory_s;
        let low_pass = |t: f64| (oscillation(t) - phase * (rate * t).cos()) / (1.0 + phase * phase);
        for t in [2.1, 2.24, 2.37] {
            let deviation = above_low_pass(memory_s, t, integral, oscillation);
            let expected = oscillation(t) - low_pass(t + memory_s);
            // Constant acceleration per interval, decay to second order, and the start of the ring cause some
            // hundredths. The second derivative alone would be off by twice as much.
            assert!(
                (deviation - expected).abs() < 0.04,
                "{t}: {deviation} {expected}"
            );
        }
    }
    // A constant acceleration only causes a delay.
    let late = above_low_pass(0.5, 2.24, |t| 1.5 * t * t, |t| 3.0 * t);
    assert!(late.abs() < ROUNDING);
}

/// All components of a span.
fn numbers(span: &Span) -> Vec<f64> {
    let Span {
        seconds,
        force_mps,
        force_position_m,
        attitude_s,
        angle_rad,
        turn_rad,
        control_tilt_rad,
        control_velocity_mps,
        control_position_m,
        way_m,
    } = span;
    let vectors = [
        force_mps,
        force_position_m,
        angle_rad,
        control_tilt_rad,
        control_velocity_mps,
        control_position_m,
        way_m,
    ];
    let mut list: Vec<f64> = vectors.iter().flat_map(|v| v.iter().copied()).collect();
    list.extend(attitude_s);
    list.extend([*seconds, *turn_rad]);
    list
}

fn assert_same(one: &Span, other: &Span, relative: f64) {
    for (a, b) in numbers(one).iter().zip(numbers(other)) {
        let error = (a - b).abs();
        assert!(error < relative * (1.0 + a.abs()), "{one:?} {other:?}");
    }
}

fn vector(largest: f64) -> impl Strategy<Value = Vector3<f64>> {
    let number = || -largest..largest;
    [number(), number(), number()].prop_map(Vector3::from)
}

/// Any span of a tenth of a second; components need not be consistent.
fn any_span() -> impl Strategy<Value = Span> {
    let forces = (vector(5.0), vector(0.5), vector(0.3), -0.3..0.3);
    let controls = (vector(0.1), vector(0.5), vector(0.1), vector(3.0));
    (
        100_000..130_000,
        forces,
        controls,
        prop::array::uniform3(vector(0.1)),
    )
        .prop_map(
            |(micros, (force, moved, angle, turn), (tilt, velocity, position, way), columns)| {
                Span {
                    seconds: f64::from(micros) * 1e-6,
                    force_mps: force,
                    force_position_m: moved,
                    attitude_s: Matrix3::from_columns(&columns),
                    angle_rad: angle,
                    turn_rad: turn,
                    control_tilt_rad: tilt,
                    control_velocity_mps: velocity,
                    control_position_m: position,
                    way_m: way,
                }
            },
        )
}

fn ring_of(spans: &[Span]) -> (History<N>, Time) {
    let mut history = History::default();
    let mut time = Time::default();
    for span in spans {
        time = time.plus_seconds(span.seconds);
        history.push(time, &Vector3::zeros(), span, &Vibration::default());
    }
    (history, time)
}

/// Concatenation of the pieces between two times, and their ends.
fn total(history: &History<N>, from: Time, to: Time, longest_s: f64) -> (Span, Vec<Time>) {
    let (mut whole, mut ends) = (Span::default(), Vec::new());
    let mut at = from;
    while let Some((piece, end)) = history.next_span(at, to, longest_s) {
        whole = whole.then(&piece);
        ends.push(end);
        at = end;
    }
    (whole, ends)
}

proptest! {
    #[test]
    fn concatenation_is_associative(
        a in any_span(), b in any_span(), c in any_span(),
    ) {
        assert_same(&a.then(&b).then(&c), &a.then(&b.then(&c)), 1e-12);
        assert_same(&a.then(&Span::default()), &a, 1e-15);
        assert_same(&Span::default().then(&a), &a, 1e-15);
    }

    /// For any length of pieces and any times between.
    #[test]
    fn spans_are_independent_of_their_division(
        spans in prop::collection::vec(any_span(), 1..N),
        cuts in prop::collection::vec(0.0_f64..1.0, 0..5),
        longest_s in 0.01_f64..0.5,
    ) {
        let (history, end) = ring_of(&spans);
        let start = Time::default();
        let all = spans.iter().fold(Span::default(), Span::then);
        let (whole, ends) = total(&history, start, end, f64::MAX);
        assert_same(&whole, &all, ROUNDING);
        prop_assert_eq!(ends, [end]);

        let mut times: Vec<Time> = cuts.iter().map(|c| start.plus_seconds(c * all.seconds)).collect();
        times.sort();
        times.push(end);
        let (mut from, mut pieces) = (start, Span::default());
        for to in times {
            let (part, ends) = total(&history, from, to, longest_s);
            prop_assert!(ends.is_sorted());
            prop_assert_eq!(ends.last().copied().unwrap_or(to), to);
            prop_assert!((part.seconds - to.seconds_since(from)).abs() < ROUNDING);
            (from, pieces) = (to, pieces.then(&part));
        }
        assert_same(&pieces, &all, 3.0 * ROUNDING);
    }
}

/// Span of constant tilt rate, force and control, by the definitions.
fn constant_span(
    seconds: f64,
    force: &Vector3<f64>,
    rate: &Vector3<f64>,
    control_mps2: &Vector3<f64>,
) -> Span {
    let (tilt, f) = (rate * seconds, force * seconds);
    let curvature = f.cross(&tilt);
    Span {
        seconds,
        force_mps: f,
        force_position_m: 0.5 * seconds * f,
        control_tilt_rad: tilt,
        control_velocity_mps: control_mps2 * seconds + 0.5 * curvature,
        control_position_m: seconds * (0.5 * control_mps2 * seconds + curvature / 6.0),
        ..Span::default()
    }
}

/// Not only the sum of the parts.
#[test]
fn a_part_of_a_constant_span_is_that_of_the_shorter_time() {
    let (force, rate) = (Vector3::new(1.0, -2.0, 9.8), Vector3::new(0.1, 0.2, -0.1));
    let control_mps2 = Vector3::new(0.3, 0.1, -0.2);
    let (history, _) = ring_of(&[constant_span(0.12, &force, &rate, &control_mps2)]);
    for (from, to) in [(0.0, 0.05), (0.03, 0.07), (0.05, 0.12)] {
        let (part, _) = total(&history, time_at(from), time_at(to), 1.0);
        assert_same(
            &part,
            &constant_span(to - from, &force, &rate, &control_mps2),
            ROUNDING,
        );
    }
}

/// Latency estimated from regular noise-free fixes, s, of a vehicle whose velocity oscillates nearly at the
/// rate of the ring while it accelerates by some m/s^2.
fn apparent_latency_s(hz: f64, fixes_hz: f64, first_s: f64) -> f64 {
    use std::f64::consts::TAU;
    let (slow, fast) = (0.1 * TAU, hz * TAU);
    let velocity = |t: f64| 3.0 * (slow * t).sin() + 0.08 * (fast * t).sin();
    let position = |t: f64| -3.0 / slow * (slow * t).cos() - 0.08 / fast * (fast * t).cos();
    let mut history = History::<4>::default();
    let (mut last, mut fix) = (0.0, first_s);
    let mut shown = [0.0; 2];
    for sample in 1..30_000 {
        let now = 0.01 * f64::from(sample);
        if !history.is_due(time_at(now), 0.01) {
            continue;
        }
        let seconds = now - last;
        let gained = velocity(now) - velocity(last);
        let moved = position(now) - position(last) - velocity(last) * seconds;
        let up = Vector3::z() * GRAVITY_EQUATOR_MPS2;
        let span = Span {
            seconds,
            force_mps: Vector3::x() * gained + up * seconds,
            force_position_m: Vector3::x() * moved + up * (0.5 * seconds * seconds),
            attitude_s: Matrix3::identity() * seconds,
            way_m: Vector3::x() * (position(now) - position(last)),
            ..Span::default()
        };
        let mean = span.way_m / seconds;
        history.push(time_at(now), &mean, &span, &Vibration::default());
        last = now;
        while let Ok(past) = history.at(time_at(fix), true) {
            let accel = past.accel_mps2.x;
            shown[0] += (past.velocity_mps.x - velocity(fix)) * accel;
            shown[1] += accel * accel;
            fix += 1.0 / fixes_hz;
        }
    }
    shown[0] / shown[1]
}

#[test]
fn oscillation_near_the_ring_rate_causes_no_apparent_latency() {
    // RMS over the phase of the fixes. With a ring entry every tenth of a second it is 3 to 7 ms: each fix is
    // then at the same phase between entries.
    for (hz, fixes_hz) in [(4.1, 5.0), (4.9, 10.0), (4.7, 1.0), (6.1, 5.0)] {
        let shown = (0..20).map(|k| apparent_latency_s(hz, fixes_hz, 1.0 + 0.0055 * f64::from(k)));
        let rms_s = (shown.map(|s| s * s).sum::<f64>() / 20.0).sqrt();
        assert!(rms_s < 2e-3, "{hz} Hz, fixes at {fixes_hz} Hz: {rms_s} s");
    }
}

/// A vibration of 0.03 m/s at 13 Hz, without and with a car that brakes.
#[test]
fn a_steady_acceleration_is_no_vibration() {
    let variance = |accel_mps2: f64| {
        let swing_mps = |count: i32| 0.03 * (TAU * 13.0 * 0.01 * f64::from(count)).sin();
        let mut vibration = Vibration::default();
        for count in 1..=11 {
            let gained_mps = accel_mps2 * 0.01 + swing_mps(count) - swing_mps(count - 1);
            vibration.add(&Vector3::new(gained_mps, 0.0, 0.0), &Vector3::zeros(), 0.01);
        }
        vibration.variance()
    };
    let (even, braking) = (variance(0.0), variance(-5.0));
    assert!(even > 1e-4, "{even}");
    // Single precision.
    assert!((braking - even).abs() < 1e-5, "{braking} {even}");
}

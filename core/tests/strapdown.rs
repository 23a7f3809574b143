//! Classical motions with known answers: coning, sculling, Schuler, Foucault, growth of errors.
#![allow(clippy::disallowed_methods, clippy::cast_precision_loss)]

use core::f64::consts::TAU;

use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::{Geodetic, LocalEarth, ROTATION_RATE_RADPS};
use ins_core::increments::{Increments, Interval};
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{ImuOutput, ImuSample, Time};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Gyro and accelerometer: increments of an interval, or rates at its end; x, y, z.
type Reading = (Vector3<f64>, Vector3<f64>);

fn sample((gyro, accel): Reading) -> ImuSample {
    ImuSample {
        time: Time::default(),
        gyro,
        accel,
    }
}

/// Output of [`Increments`] for `count` intervals of `h`.
fn intervals(
    output: ImuOutput,
    h: f64,
    count: u32,
    read: impl Fn(f64, f64) -> Reading,
) -> Vec<Interval> {
    let mut increments = Increments::new(output, &sample(read(-h, 0.0)));
    (0..count)
        .map(|k| {
            let t = f64::from(k) * h;
            increments.interval(&sample(read(t, t + h)), h)
        })
        .collect()
}

/// Residual of a two-sample algorithm for two oscillations of unit amplitude, 90 degrees apart, in one
/// interval of phase `l`: exact `(l - sin l)/2` less the algorithm's `|x_k-1 x x_k|/12`. For small phases
/// `l^5/60`; without the term it would be `l^3/12`.
fn two_sample_residual(l: f64) -> f64 {
    0.5 * (l - l.sin()) - (l.sin() - 0.5 * (2.0 * l).sin()) / 6.0
}

/// Attitude `[cos a/2, 0, sin a/2 cos wt, sin a/2 sin wt]`, body rate
/// `[-2 w sin^2 a/2, -w sin a sin wt, w sin a cos wt]`.
#[derive(Clone, Copy)]
struct ConingMotion {
    angle_rad: f64,
    rate_radps: f64,
}

impl ConingMotion {
    fn attitude(&self, t: f64) -> UnitQuaternion<f64> {
        let (s, c) = (0.5 * self.angle_rad).sin_cos();
        let (sp, cp) = (self.rate_radps * t).sin_cos();
        UnitQuaternion::new_unchecked(Quaternion::new(c, 0.0, s * cp, s * sp))
    }

    fn axial_radps(&self) -> f64 {
        -2.0 * self.rate_radps * (0.5 * self.angle_rad).sin().powi(2)
    }

    fn increment(&self, from: f64, to: f64) -> Reading {
        let side = self.angle_rad.sin();
        let (s0, c0) = (self.rate_radps * from).sin_cos();
        let (s1, c1) = (self.rate_radps * to).sin_cos();
        let axial = self.axial_radps() * (to - from);
        let angle = Vector3::new(axial, side * (c1 - c0), side * (s1 - s0));
        (angle, Vector3::zeros())
    }

    fn rate(&self, at: f64) -> Reading {
        let side = self.rate_radps * self.angle_rad.sin();
        let (s, c) = (self.rate_radps * at).sin_cos();
        let rate = Vector3::new(self.axial_radps(), -side * s, side * c);
        (rate, Vector3::zeros())
    }

    /// Drift about the cone's axis, rad per interval, after whole periods.
    fn drift(&self, intervals: &[Interval], turn: fn(&Interval) -> Vector3<f64>) -> f64 {
        let end: f64 = intervals.iter().map(|i| i.seconds).sum();
        let computed = intervals.iter().fold(self.attitude(0.0), |q, i| {
            q * UnitQuaternion::from_scaled_axis(turn(i))
        });
        let error = (self.attitude(end).inverse() * computed).scaled_axis();
        error.x / intervals.len() as f64
    }
}

#[test]
fn coning_error_equals_the_two_sample_residual() {
    // 5 and 10 Hz, sampled at 100 Hz; 200 s are whole periods.
    for hz in [5.0, 10.0] {
        let coning = ConingMotion {
            angle_rad: 0.01,
            rate_radps: TAU * hz,
        };
        let (h, a2) = (0.01, coning.angle_rad * coning.angle_rad);
        let motion = intervals(ImuOutput::Increments, h, 20_000, |a, b| {
            coning.increment(a, b)
        });
        let phase = coning.rate_radps * h;
        let expected = -a2 * two_sample_residual(phase);
        let drift = coning.drift(&motion, Interval::rotation_rad);
        // Fourth-order terms in the angle: 1e-4 of the second-order ones before compensation.
        let tolerance = 1e-4 * a2 * phase.powi(3);
        assert!(
            (drift - expected).abs() < tolerance,
            "{hz} Hz: {drift} {expected}"
        );
        // Without the term it is 50 and 13 times as much.
        let uncompensated = coning.drift(&motion, |i| i.angle_rad);
        let expected = -0.5 * a2 * (phase - phase.sin());
        assert!(
            (uncompensated - expected).abs() < tolerance,
            "{uncompensated} {expected}"
        );
    }
}

#[test]
fn coning_error_of_rates_equals_the_parabola_residual() {
    let coning = ConingMotion {
        angle_rad: 0.01,
        rate_radps: TAU * 5.0,
    };
    let (h, a2) = (0.01, coning.angle_rad * coning.angle_rad);
    let motion = intervals(ImuOutput::Rates, h, 20_000, |_, b| coning.rate(b));
    // The parabola through three readings, with weights h (-1, 8, 5) / 12, reduces the radius of the
    // cone by their gain at this frequency: area of a polygon of that radius, coning term of the
    // readings, and axial rate.
    let l = coning.rate_radps * h;
    let weights = (8.0 + 4.0 * l.cos()).hypot(6.0 * l.sin()) / 12.0;
    let radius = weights * l / (2.0 * (0.5 * l).sin());
    let expected = a2 * (0.5 * radius * radius * l.sin() + l * l * l.sin() / 12.0 - 0.5 * l);
    let drift = coning.drift(&motion, Interval::rotation_rad);
    assert!(
        (drift - expected).abs() < 1e-4 * a2 * l.powi(3),
        "{drift} {expected}"
    );
    // Without the coning term the error is over thirty times as large.
    let uncompensated = coning.drift(&motion, |i| i.angle_rad);
    assert!(uncompensated / drift > 30.0, "{uncompensated} {drift}");
}

#[test]
fn coning_beyond_the_two_sample_term_is_bounded() {
    let (h, samples) = (0.01, 20_000);
    for (output, hz) in [ImuOutput::Increments, ImuOutput::Rates]
        .into_iter()
        .flat_map(|output| [5.0, 20.0, 30.0, 40.0, 45.0, 49.0].map(|hz| (output, hz)))
    {
        let coning = ConingMotion {
            angle_rad: 3e-4,
            rate_radps: TAU * hz,
        };
        let read = |from: f64, to: f64| match output {
            ImuOutput::Increments => coning.increment(from, to),
            ImuOutput::Rates => coning.rate(to),
        };
        let motion = intervals(output, h, samples, read);
        let drift_radps = coning.drift(&motion, Interval::rotation_rad).abs() / h;
        let mut increments = Increments::new(output, &sample(read(-h, 0.0)));
        let mut sum_radps = 0.0;
        for k in 0..samples {
            let t = f64::from(k) * h;
            increments.interval(&sample(read(t, t + h)), h);
            sum_radps += increments.unresolved_coning_radps().x;
        }
        let bound_radps = sum_radps / f64::from(samples);
        let case = format!("{output:?}, {hz} Hz: {drift_radps} of at most {bound_radps}");
        assert!(drift_radps < bound_radps, "{case}");
        // Exact at half the sampling rate; slow coning hardly counts.
        if hz > 48.0 {
            assert!(bound_radps < 1.1 * drift_radps, "{case}");
        } else if hz < 6.0 {
            assert!(bound_radps < 0.01 * coning.axial_radps().abs(), "{case}");
        }
    }
}

/// Oscillation about x and, in phase, along y: `x = A sin wt`, `f_y = B sin wt`. In the initial
/// axes the mean force along z is `B J1(A)`, along y nothing.
struct ScullingMotion {
    angle_rad: f64,
    force_mps2: f64,
    rate_radps: f64,
}

impl ScullingMotion {
    fn angle(&self, t: f64) -> f64 {
        self.angle_rad * (self.rate_radps * t).sin()
    }

    fn increment(&self, from: f64, to: f64) -> Reading {
        let w = self.rate_radps;
        let gained = self.force_mps2 / w * ((w * from).cos() - (w * to).cos());
        (
            Vector3::new(self.angle(to) - self.angle(from), 0.0, 0.0),
            Vector3::new(0.0, gained, 0.0),
        )
    }
}

#[test]
fn sculling_matches_the_closed_form() {
    let sculling = ScullingMotion {
        angle_rad: 0.02,
        force_mps2: 20.0,
        rate_radps: TAU * 5.0,
    };
    let (h, count) = (0.01, 20_000);
    let motion = intervals(ImuOutput::Increments, h, count, |a, b| {
        sculling.increment(a, b)
    });
    let gained = |velocity: fn(&Interval) -> Vector3<f64>| {
        let (mut sum, mut t) = (Vector3::zeros(), 0.0);
        for interval in &motion {
            let attitude = UnitQuaternion::from_scaled_axis(Vector3::x() * sculling.angle(t));
            sum += attitude * velocity(interval);
            t += h;
        }
        sum / f64::from(count)
    };
    let a = sculling.angle_rad;
    let bessel = a / 2.0 - a.powi(3) / 16.0;
    let truth = Vector3::new(0.0, 0.0, sculling.force_mps2 * bessel * h);
    let phase = sculling.rate_radps * h;
    let scale = a * sculling.force_mps2 / sculling.rate_radps;
    let expected = truth - Vector3::z() * scale * two_sample_residual(phase);
    // Terms of fourth order: the square of the angle, 4e-4, times what the term corrects.
    let tolerance = 4e-4 * scale * phase.powi(3);
    let error = gained(Interval::velocity_mps) - expected;
    assert!(error.norm() < tolerance, "{error} of {tolerance}");
    // Without the sculling term the error is a hundred times that.
    let uncompensated = gained(|i| i.velocity_mps() - i.sculling_mps) - truth;
    assert!(uncompensated.norm() > 100.0 * tolerance, "{uncompensated}");
}

/// Rate and force that change linearly: `p + q t`, `u + v t`.
struct Ramp {
    rate: [Vector3<f64>; 2],
    force: [Vector3<f64>; 2],
}

const RAMP: Ramp = Ramp {
    rate: [Vector3::new(0.3, -0.2, 0.1), Vector3::new(-2.0, 1.0, 3.0)],
    force: [Vector3::new(1.0, 2.0, 9.0), Vector3::new(40.0, -30.0, 20.0)],
};

impl Ramp {
    fn rate(&self, t: f64) -> Reading {
        let at = |[constant, slope]: [Vector3<f64>; 2]| constant + t * slope;
        (at(self.rate), at(self.force))
    }

    fn increment(&self, from: f64, to: f64) -> Reading {
        let (rate, force) = self.rate(0.5 * (from + to));
        ((to - from) * rate, (to - from) * force)
    }

    /// For linear change the terms of second order have closed forms, `h^3/12 p x q` and
    /// `h^3/12 (p x v + u x q)`, with p and u at the interval's start.
    fn assert_exact(&self, interval: &Interval, from: f64, to: f64) {
        let h = to - from;
        let (angle, force) = self.increment(from, to);
        let (p, u) = self.rate(from);
        let ([_, q], [_, v]) = (self.rate, self.force);
        let coning = h.powi(3) / 12.0 * p.cross(&q);
        let sculling = h.powi(3) / 12.0 * (p.cross(&v) + u.cross(&q));
        let near = |got: &Vector3<f64>, expected: &Vector3<f64>| {
            // Rounding.
            let error = (got - expected).norm();
            assert!(error < 1e-15, "{got} is not {expected} in [{from}, {to}]");
        };
        assert!((interval.seconds - h).abs() < 1e-15);
        near(&interval.angle_rad, &angle);
        near(&interval.force_mps, &force);
        near(&interval.coning_rad, &coning);
        near(&interval.sculling_mps, &sculling);
    }
}

#[test]
fn linear_rates_are_exact_at_any_interval_length() {
    for output in [ImuOutput::Rates, ImuOutput::Increments] {
        let read = |from: f64, to: f64| match output {
            ImuOutput::Rates => RAMP.rate(to),
            ImuOutput::Increments => RAMP.increment(from, to),
        };
        let mut increments = Increments::new(output, &sample(read(-0.01, 0.0)));
        let mut from = 0.0;
        for h in [0.01, 0.01, 0.012, 0.007, 0.013, 0.01, 0.009] {
            let to = from + h;
            let interval = increments.interval(&sample(read(from, to)), h);
            RAMP.assert_exact(&interval, from, to);
            from = to;
        }
        // Likewise after a restart.
        increments.restart(&sample(read(0.29, 0.3)));
        let usual = increments.interval(&sample(read(0.3, 0.31)), 0.01);
        RAMP.assert_exact(&usual, 0.3, 0.31);
    }
}

#[test]
fn a_gap_is_interpolated() {
    for output in [ImuOutput::Rates, ImuOutput::Increments] {
        let read = |to: f64| match output {
            ImuOutput::Rates => RAMP.rate(to),
            ImuOutput::Increments => RAMP.increment(to - 0.01, to),
        };
        let mut increments = Increments::new(output, &sample(read(0.0)));
        for k in 1..=3 {
            let _ = increments.interval(&sample(read(0.01 * f64::from(k))), 0.01);
        }
        assert!(!increments.has_gap(0.0149));
        assert!(increments.has_gap(0.04));
        let filled = increments.interval(&sample(read(0.07)), 0.04);
        let (angle, force) = RAMP.increment(0.03, 0.07);
        assert!((filled.angle_rad - angle).norm() < 1e-15, "{output:?}");
        assert!((filled.force_mps - force).norm() < 1e-15, "{output:?}");
        // The bridged increment is not used as the previous reading afterwards.
        let after = increments.interval(&sample(read(0.08)), 0.01);
        RAMP.assert_exact(&after, 0.07, 0.08);
    }
}

#[test]
fn random_losses_are_bridged_and_a_lower_rate_is_learnt() {
    let mut increments = Increments::new(ImuOutput::Increments, &level_sample(0.01));
    let (mut state, mut seconds, mut filled, mut shown) = (1_u32, 0.0, 0.0, 0.0_f64);
    for count in 0..20_000 {
        seconds += 0.01;
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // One of ten.
        if count > 100 && state < u32::MAX / 10 {
            continue;
        }
        shown += seconds;
        filled += increments
            .interval(&level_sample(0.01), seconds)
            .force_mps
            .z;
        seconds = 0.0;
    }
    // Rounding error of the mean acceleration.
    let off_mps2 = (filled - 9.8 * shown) / shown;
    assert!(off_mps2.abs() < 1e-9, "{off_mps2}");
    for _ in 0..30 {
        let _ = increments.interval(&level_sample(0.02), 0.02);
    }
    assert!(!increments.has_gap(0.02));
}

/// Differences of time stamps at 10 ms with a jitter of up to 3.5 ms, which has no pattern that an
/// average over sixteen would show.
fn jittered(count: u32) -> impl Iterator<Item = f64> {
    let late = |k: u32| 0.0035 * (f64::from(k) * 2.4 + f64::from(k * k % 17)).sin();
    (0..count).map(move |k| 0.01 + late(k + 1) - late(k))
}

fn level_sample(seconds: f64) -> ImuSample {
    sample((Vector3::zeros(), Vector3::new(0.0, 0.0, 9.8 * seconds)))
}

#[test]
fn time_stamp_jitter_is_told_from_uneven_sampling() {
    let mut even = Increments::new(ImuOutput::Increments, &level_sample(0.01));
    let mut uneven = even;
    let mut worst = 0.0_f64;
    for (k, seconds) in jittered(3000).enumerate() {
        let interval = even.interval(&level_sample(0.01), seconds);
        if k > 2000 {
            worst = worst.max((interval.seconds - 0.01).abs());
        }
        let as_stamped = uneven.interval(&level_sample(seconds), seconds);
        assert!((as_stamped.seconds - seconds).abs() < 1e-15);
        assert!(uneven.stamped_late_s().abs() < 1e-15);
    }
    // Sixteen stamps average a jitter of up to 3.5 ms, and the loop moves by a sixteenth of it.
    assert!(worst < 0.0004, "{worst}");
}

#[test]
fn intervals_are_positive_for_any_jitter() {
    let mut increments = Increments::new(ImuOutput::Increments, &level_sample(0.01));
    for seconds in jittered(500) {
        let _ = increments.interval(&level_sample(0.01), seconds);
    }
    for k in 0..5000_u32 {
        let jump = f64::from(k * 37 % 101) / 101.0;
        let force = if k % 3 == 0 { 300.0 } else { -300.0 * jump };
        let interval = increments.interval(&level_sample(0.01 * force), 0.0001 + 0.019 * jump);
        assert!(interval.seconds > 0.0, "{k}: {interval:?}");
    }
}

#[test]
fn jitter_neither_hides_nor_simulates_gaps() {
    for output in [ImuOutput::Rates, ImuOutput::Increments] {
        let mut increments = Increments::new(output, &level_sample(0.01));
        for (k, seconds) in jittered(1000).enumerate() {
            assert!(!increments.has_gap(seconds), "{k}");
            // Two missing samples, whatever the jitter; the phase of the sampling is unknown at first.
            assert!(k < 50 || increments.has_gap(seconds + 0.02), "{k}");
            let _ = increments.interval(&level_sample(0.01), seconds);
        }
    }
}

#[test]
fn constant_rotation_and_force_match_the_closed_form() {
    let (angle, force) = (
        Vector3::new(0.06, -0.05, 0.06),
        Vector3::new(0.3, 0.4, -0.2),
    );
    let interval = Interval {
        seconds: 0.01,
        angle_rad: angle,
        force_mps: force,
        ..Interval::default()
    };
    let theta = angle.norm();
    let once = angle.cross(&force);
    let exact = force
        + (1.0 - theta.cos()) / (theta * theta) * once
        + (theta - theta.sin()) / theta.powi(3) * angle.cross(&once);
    // The fourth-order term is omitted: theta^3/24 of the force.
    let error = (interval.velocity_mps() - exact).norm();
    assert!(error < theta.powi(3) / 24.0 * force.norm(), "{error}");
}

const EQUATOR: f64 = 0.0;
const STEP_S: f64 = 1.0;
/// Schuler period, in steps.
const PERIOD: u32 = 5066;

/// A free-running INS at rest, axes east, north, up. Height is held, except in the test of the vertical
/// channel.
struct Stationary {
    ins: Mechanization,
    start: Geodetic,
    interval: Interval,
    hold_height: bool,
}

impl Stationary {
    fn new(latitude_rad: f64) -> Self {
        let start = Geodetic {
            latitude_rad,
            longitude_rad: 1.0,
            height_m: 0.0,
        };
        let earth = LocalEarth::at(latitude_rad, 0.0);
        Self {
            ins: Mechanization::new(start, Vector3::zeros(), UnitQuaternion::identity()),
            start,
            interval: Interval {
                seconds: STEP_S,
                angle_rad: STEP_S * earth.earth_rate(),
                force_mps: STEP_S * earth.gravity_mps2 * Vector3::z(),
                ..Interval::default()
            },
            hold_height: true,
        }
    }

    fn biased(mut self, gyro_radps: [f64; 3], accel_mps2: [f64; 3]) -> Self {
        self.interval = self
            .interval
            .without_bias(&-Vector3::from(gyro_radps), &-Vector3::from(accel_mps2));
        self
    }

    fn step(&mut self) {
        self.ins.step(&self.interval, &Controls::default());
        if self.hold_height {
            self.ins.position.height_m = self.start.height_m;
            self.ins.velocity_enu_mps.z = 0.0;
        }
    }

    fn position_error(&self) -> Vector3<f64> {
        self.ins.position.enu_from(&self.start)
    }
}

/// Schuler frequencies along east and north.
fn schuler(latitude_rad: f64) -> [f64; 2] {
    let earth = LocalEarth::at(latitude_rad, 0.0);
    [earth.east_radius_m, earth.north_radius_m].map(|r| (earth.gravity_mps2 / r).sqrt())
}

/// Compares a quantity with its model, `model(t)`, at every step.
fn assert_follows_model(
    steps: u32,
    mut stationary: Stationary,
    observed: impl Fn(&Stationary) -> f64,
    model: impl Fn(f64) -> f64,
    tolerance: f64,
) {
    let (mut largest, mut worst) = (0.0_f64, 0.0_f64);
    for k in 1..=steps {
        stationary.step();
        let t = f64::from(k) * STEP_S;
        largest = largest.max(model(t).abs());
        worst = worst.max((observed(&stationary) - model(t)).abs());
    }
    assert!(
        worst < tolerance * largest,
        "error {worst} of {largest}, allowed {tolerance}"
    );
}

/// (1)-(2) omit the coupling by Earth rotation. At the equator, where the level axes do not precess, it
/// is `(Omega/ws)^2 = 0.35 %` of a Schuler oscillation, and of errors that grow with time, due to the
/// 24-hour oscillation, `(Omega t)^2/2`: 1.7 % after half a Schuler period.
const COUPLING: f64 = 0.01;
const GROWING_COUPLING: f64 = 0.02;

#[test]
fn accelerometer_biases_cause_schuler_oscillations() {
    let [we, wn] = schuler(EQUATOR);
    let df = 0.01;
    assert_follows_model(
        PERIOD,
        Stationary::new(EQUATOR).biased([0.0; 3], [df, 0.0, 0.0]),
        |s| s.ins.velocity_enu_mps.x,
        |t| df / we * (we * t).sin(),
        COUPLING,
    );
    assert_follows_model(
        PERIOD,
        Stationary::new(EQUATOR).biased([0.0; 3], [0.0, df, 0.0]),
        |s| s.position_error().y,
        |t| df / (wn * wn) * (1.0 - (wn * t).cos()),
        COUPLING,
    );
}

#[test]
fn level_gyro_biases_cause_drift() {
    let earth = LocalEarth::at(EQUATOR, 0.0);
    let [we, wn] = schuler(EQUATOR);
    let dw = 4.848e-6;
    // Phi_N' = -dw_N, dV_E' = -g Phi_N: eastwards; Phi_E' = -dw_E, dV_N' = g Phi_E: southwards.
    assert_follows_model(
        PERIOD / 2,
        Stationary::new(EQUATOR).biased([0.0, dw, 0.0], [0.0; 3]),
        |s| s.position_error().x,
        |t| dw * earth.east_radius_m * (t - (we * t).sin() / we),
        GROWING_COUPLING,
    );
    assert_follows_model(
        PERIOD / 2,
        Stationary::new(EQUATOR).biased([dw, 0.0, 0.0], [0.0; 3]),
        |s| s.ins.velocity_enu_mps.y,
        |t| -dw * earth.north_radius_m * (1.0 - (wn * t).cos()),
        GROWING_COUPLING,
    );
}

#[test]
fn up_gyro_bias_drifts_heading_then_tilts() {
    let earth = LocalEarth::at(EQUATOR, 0.0);
    let [_, wn] = schuler(EQUATOR);
    let dw = 4.848e-6;
    let stationary = || Stationary::new(EQUATOR).biased([0.0, 0.0, dw], [0.0; 3]);
    // Phi_UP' = -dw_UP, and by C' = (I - [Phi x]) C the computed heading grows with Phi_UP.
    assert_follows_model(
        PERIOD / 2,
        stationary(),
        |s| s.ins.heading_rad(),
        |t| -dw * t,
        GROWING_COUPLING,
    );
    // A platform rotated by Phi_UP sees Omega_N as a rate about east: -Omega Phi_UP.
    let tilt_drift = dw * ROTATION_RATE_RADPS;
    assert_follows_model(
        PERIOD / 2,
        stationary(),
        |s| s.ins.velocity_enu_mps.y,
        |t| tilt_drift * earth.north_radius_m * (t - (wn * t).sin() / wn),
        GROWING_COUPLING,
    );
}

#[test]
fn vertical_error_grows_as_a_hyperbolic_cosine() {
    let earth = LocalEarth::at(EQUATOR, 0.0);
    let df = 1e-4;
    // dV_UP' = df + 2g/R dh, with R the mean of both radii, half of whose difference is 0.34 %; with an
    // exponent of 9 in a Schuler period the error is 9 * 0.17 %.
    let mean_radius = 0.5 * (earth.east_radius_m + earth.north_radius_m);
    let k = (2.0 * earth.gravity_mps2 / mean_radius).sqrt();
    let mut stationary = Stationary::new(EQUATOR).biased([0.0; 3], [0.0, 0.0, df]);
    stationary.hold_height = false;
    assert_follows_model(
        PERIOD,
        stationary,
        |s| s.position_error().z,
        |t| df / (k * k) * ((k * t).cosh() - 1.0),
        0.02,
    );
}

#[test]
fn tilt_oscillates_with_the_schuler_period() {
    let [we, _] = schuler(EQUATOR);
    assert!((TAU / we / 60.0 - 84.4).abs() < 0.2, "{we}");
    let phi = 1e-3;
    let mut tilted = Stationary::new(EQUATOR);
    tilted.ins.turn_platform(&Vector3::new(0.0, phi, 0.0));
    assert_follows_model(
        PERIOD,
        tilted,
        |s| s.ins.velocity_enu_mps.x,
        |t| -phi * LocalEarth::at(EQUATOR, 0.0).gravity_mps2 / we * (we * t).sin(),
        COUPLING,
    );
}

#[test]
fn schuler_oscillation_precesses_like_a_foucault_pendulum() {
    for latitude_rad in [1.0_f64, -1.2] {
        let [we, wn] = schuler(latitude_rad);
        let period_s = TAU / (0.5 * (we + wn));
        let mut oscillating = Stationary::new(latitude_rad);
        oscillating.ins.velocity_enu_mps.x = 1.0;
        let mut t = 0.0;
        for period in [1.0, 2.0, 3.0] {
            while t < period * period_s {
                oscillating.step();
                t += STEP_S;
            }
            let v = oscillating.ins.velocity_enu_mps;
            // The local frame turns counter-clockwise by Omega sin(lat).
            let expected = -ROTATION_RATE_RADPS * latitude_rad.sin() * t;
            // Unequal radii rotate the direction by e^2 cos^2(lat)/4 of the phase, 0.01 after three
            // periods; COUPLING adds as much.
            let error = (v.y.atan2(v.x) - expected).abs();
            assert!(error < 0.02, "{error} of {expected}");
            assert!((v.xy().norm() - 1.0).abs() < 0.02, "{v}");
        }
    }
}

#[test]
fn a_stationary_ins_stays_at_rest() {
    // Any latitude and heading.
    for (latitude_rad, heading_rad) in [(0.0, 0.0), (0.9, 2.0), (-1.3, -1.0), (1.55, 0.5)] {
        let mut stationary = Stationary::new(latitude_rad);
        let attitude = from_euler(&Euler {
            heading_rad,
            pitch_rad: 0.2,
            roll_rad: -0.3,
        });
        stationary.ins.attitude = attitude;
        let inverse = attitude.inverse();
        stationary.interval = Interval {
            seconds: 0.1,
            angle_rad: inverse * stationary.interval.angle_rad * 0.1,
            force_mps: inverse * stationary.interval.force_mps * 0.1,
            ..Interval::default()
        };
        stationary.hold_height = false;
        for _ in 0..36_000 {
            stationary.step();
        }
        // Square of the frame rotation in a step, 7e-6 rad, times g: 5e-10 m/s^2 at worst, amplified by
        // the vertical channel as in the test above.
        let error = stationary.position_error().norm();
        assert!(error < 0.02, "{error} m at {latitude_rad}");
        // The platform rotates with the position: 0.02 m / R.
        let turned = stationary.ins.attitude.angle_to(&attitude);
        assert!(turned < 3e-9, "{turned} at {latitude_rad}");
    }
}

#[test]
fn gravity_is_that_at_the_middle_of_a_step() {
    // Near the pole, where vertical velocity causes hardly any Coriolis acceleration.
    let (latitude_rad, rise_mps, dt) = (1.55, 100.0, 10.0);
    let start = Geodetic {
        latitude_rad,
        ..Geodetic::default()
    };
    let up = rise_mps * Vector3::z();
    let mut ins = Mechanization::new(start, up, UnitQuaternion::identity());
    let middle = LocalEarth::at(latitude_rad, 0.5 * rise_mps * dt);
    let interval = Interval {
        seconds: dt,
        angle_rad: dt * middle.earth_rate(),
        force_mps: dt * middle.gravity_mps2 * Vector3::z(),
        ..Interval::default()
    };
    ins.step(&interval, &Controls::default());
    // Gravity at the start would cause 15 mm/s.
    let error = ins.velocity_enu_mps.z - rise_mps;
    assert!(error.abs() < 2e-4, "{error}");
}

//! The damping loops have the poles given by their bandwidth and damping ratio.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used)]

#[cfg(feature = "literal")]
use ins_core::config::Form;
use ins_core::config::{Feedback, HeadingSource, SecondOrder};
use ins_core::earth::{GRAVITY_EQUATOR_MPS2, Geodetic, LocalEarth};
use ins_core::{
    Config, GnssFix, GnssOutcome, ImuOutcome, ImuOutput, ImuSample, Navigator, Phase, Time,
};
use nalgebra::{Matrix2, Vector2, Vector3};

const PLACE: Geodetic = Geodetic {
    latitude_rad: 0.9,
    longitude_rad: 0.5,
    height_m: 120.0,
};
const IMU_S: f64 = 0.01;
/// Ten fixes a second.
const FIX_EVERY: u32 = 10;
/// Largest delay of the controls: averaging of three fixes, 0.2 s; two ring entries after the last one, 0.22 s;
/// work spread over eight samples, 0.08 s; hold until the next three fixes, 0.3 s.
const DELAY_S: f64 = 0.8;
/// Every other average of three fixes corrects height.
const HEIGHT_DELAY_S: f64 = DELAY_S + 0.6;

/// Step of the measured height, downwards. The gate would reject ten metres after minutes of noise-free
/// fixes.
const HEIGHT_STEP_M: f64 = 1.0;

/// A stationary, levelled navigator heading north, with noise-free sensors.
struct Stationary {
    navigator: Navigator,
    count: u32,
    with_up: bool,
    height_m: f64,
}

impl Stationary {
    fn new(config: &Config, with_up: bool) -> Self {
        let config = Config {
            imu_output: ImuOutput::Increments,
            heading: HeadingSource::Given(0.0),
            feedback: Feedback::Open,
            ..*config
        };
        let mut stationary = Self {
            navigator: Navigator::new(config).unwrap(),
            count: 0,
            with_up,
            height_m: PLACE.height_m,
        };
        while stationary.navigator.phase() != Phase::Navigating {
            stationary.step(Vector3::zeros());
        }
        // Initial transients decay.
        for _ in 0..10_000 {
            stationary.step(Vector3::zeros());
        }
        stationary
    }

    /// One sample with a gyro error of `turn_rad`.
    fn step(&mut self, turn_rad: Vector3<f64>) {
        let earth = LocalEarth::at(PLACE.latitude_rad, PLACE.height_m);
        self.count += 1;
        let time = Time::default().plus_seconds(f64::from(self.count) * IMU_S);
        let outcome = self.navigator.on_imu(&ImuSample {
            time,
            gyro: IMU_S * earth.earth_rate() + turn_rad,
            accel: IMU_S * earth.gravity_mps2 * Vector3::z(),
        });
        assert_eq!(outcome, ImuOutcome::Accepted);
        if self.count.is_multiple_of(FIX_EVERY) {
            let fix = GnssFix {
                time,
                velocity_en_mps: Some(Vector2::zeros()),
                velocity_up_mps: self.with_up.then_some(0.0),
                ..GnssFix::default()
            };
            let outcome = self.navigator.on_gnss(&fix.at(&Geodetic {
                height_m: self.height_m,
                ..PLACE
            }));
            assert!(
                matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued),
                "{outcome:?}"
            );
        }
    }
}

/// `exp(a t)`, by squaring a short step.
fn matrix_exponential(a: &Matrix2<f64>, t: f64) -> Matrix2<f64> {
    let short = a * (t / f64::from(1 << 20));
    let mut power = Matrix2::identity() + short + 0.5 * short * short;
    for _ in 0..20 {
        power *= power;
    }
    power
}

/// Compares the response of one component with the first state of `x' = a x`, `x(0) = start`. A delay causes
/// an error of rate times delay.
fn assert_response(
    mut stationary: Stationary,
    observed: impl Fn(&Navigator) -> f64,
    a: &Matrix2<f64>,
    start: &Vector2<f64>,
    (w0, delay_s): (f64, f64),
) {
    let rate = w0.max(-a.trace());
    let from = observed(&stationary.navigator);
    let (mut largest, mut worst, mut last) = (0.0_f64, 0.0_f64, 0.0_f64);
    let times = (1..).map(|k| f64::from(k) * IMU_S);
    for t in times.take_while(|t| *t < 12.0 / w0) {
        stationary.step(Vector3::zeros());
        let model = (matrix_exponential(a, t) * start).x;
        let error = observed(&stationary.navigator) - from - (model - start.x);
        (largest, worst) = (largest.max(model.abs()), worst.max(error.abs()));
        last = error;
    }
    assert!(
        worst < rate * delay_s * largest,
        "{worst} of {largest}, w0 {w0}"
    );
    // The delay reduces the damping.
    let damping = -0.5 * a.trace() - 0.5 * w0 * w0 * delay_s;
    let remaining = (-damping * 12.0 / w0).exp().max(0.01);
    assert!(
        last.abs() < remaining * largest,
        "{last} of {largest} remains, w0 {w0}"
    );
}

fn config_with(horizontal: SecondOrder, vertical: SecondOrder) -> Config {
    let mut config = Config::hg1700();
    config.damping.horizontal = horizontal;
    config.damping.vertical = vertical;
    config
}

const LOOPS: [SecondOrder; 3] = [
    SecondOrder {
        bandwidth_radps: 0.1,
        damping_ratio: 0.7,
    },
    SecondOrder {
        bandwidth_radps: 0.3,
        damping_ratio: 0.4,
    },
    SecondOrder {
        bandwidth_radps: 0.5,
        damping_ratio: 1.2,
    },
];

#[test]
fn tilt_error_decays_with_the_horizontal_poles() {
    for (east, design) in [(true, LOOPS[0]), (false, LOOPS[1]), (true, LOOPS[2])] {
        let mut stationary = Stationary::new(&config_with(design, LOOPS[2]), true);
        // A false gyro increment tilts the platform by `Phi` the other way.
        let phi = 1e-3;
        let axis = if east { Vector3::y() } else { Vector3::x() };
        stationary.step(-phi * axis);
        let (w0, zeta, g) = (
            design.bandwidth_radps,
            design.damping_ratio,
            GRAVITY_EQUATOR_MPS2,
        );
        // States dV and Phi; dV_E' = -g Phi_N, dV_N' = +g Phi_E.
        let sign = if east { -1.0 } else { 1.0 };
        let a = Matrix2::new(-2.0 * zeta * w0, sign * g, -sign * w0 * w0 / g, 0.0);
        let velocity = move |navigator: &Navigator| {
            let v = navigator.mechanization().unwrap().velocity_enu_mps;
            if east { v.x } else { v.y }
        };
        assert_response(
            stationary,
            velocity,
            &a,
            &Vector2::new(0.0, phi),
            (w0, DELAY_S),
        );
    }
}

#[cfg(feature = "literal")]
#[test]
fn height_error_decays_with_the_vertical_poles() {
    for design in LOOPS {
        // The exact form estimates vertical velocity from heights and damps with that.
        let config = Config {
            form: Form::Literal,
            ..config_with(LOOPS[0], design)
        };
        let mut stationary = Stationary::new(&config, false);
        stationary.height_m -= HEIGHT_STEP_M;
        let (w0, zeta) = (design.bandwidth_radps, design.damping_ratio);
        // States dh and dV: dh' = dV - C1 dh, dV' = -C2 dh.
        let a = Matrix2::new(-2.0 * zeta * w0, 1.0, -w0 * w0, 0.0);
        let height = |navigator: &Navigator| navigator.mechanization().unwrap().position.height_m;
        let initial_error = Vector2::new(HEIGHT_STEP_M, 0.0);
        assert_response(stationary, height, &a, &initial_error, (w0, HEIGHT_DELAY_S));
    }
}

#[test]
fn height_error_decays_with_the_position_loop_if_vertical_velocity_is_aided() {
    let design = LOOPS[1];
    let mut stationary = Stationary::new(&config_with(LOOPS[0], design), true);
    stationary.height_m -= HEIGHT_STEP_M;
    let c1 = 2.0 * design.damping_ratio * design.bandwidth_radps;
    let p = Config::hg1700().damping.position_radps;
    // dh' = dV - p dh, dV' = -C1 dV - p^2 dh.
    let a = Matrix2::new(-p, 1.0, -p * p, -c1);
    let height = |navigator: &Navigator| navigator.mechanization().unwrap().position.height_m;
    let initial_error = Vector2::new(HEIGHT_STEP_M, 0.0);
    assert_response(stationary, height, &a, &initial_error, (p, HEIGHT_DELAY_S));
}

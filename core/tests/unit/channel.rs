//! Gains of a channel against a dense Kalman filter of the same five states.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods, clippy::indexing_slicing)]

use crate::channel::{Channel, ChannelStep, Markov, Measured};
use crate::config::Noise;
use nalgebra::{Matrix5, RowVector5, Vector5};
use proptest::prelude::*;

/// A consumer receiver: position noise correlated over a minute, velocity noise over a second.
const VELOCITY: Noise = Noise {
    white: 0.05,
    correlated: 0.1,
    correlation_s: 1.0,
};
const POSITION: Noise = Noise {
    white: 1.0,
    correlated: 3.0,
    correlation_s: 60.0,
};
const TILT: f64 = 0.03 * 0.03;

/// Position, velocity, tilt, noise of velocity, noise of position.
struct Dense {
    p: Matrix5<f64>,
}

impl Dense {
    fn new(start_m2: f64, start_mps2: f64) -> Self {
        let correlated = |noise: &Noise| noise.correlated * noise.correlated;
        let diagonal = Vector5::new(
            start_m2,
            start_mps2,
            TILT,
            correlated(&VELOCITY),
            correlated(&POSITION),
        );
        Self {
            p: Matrix5::from_diagonal(&diagonal),
        }
    }

    fn propagate(&mut self, step: &ChannelStep, gnss_noise: [Markov; 2]) {
        let (dt, f) = (step.seconds, step.force_up_mps);
        let [velocity, position] = gnss_noise;
        let mut transition =
            Matrix5::from_diagonal(&Vector5::new(1.0, 1.0, 1.0, velocity.decay, position.decay));
        transition[(0, 1)] = dt;
        transition[(0, 2)] = step.force_up_position_m;
        transition[(1, 2)] = f;
        // Gravity gradient at the propagated position.
        let mut gravity = Matrix5::identity();
        gravity[(1, 0)] = step.gravity_per_s;
        transition = gravity * transition;
        // White noise enters at each time within the span and is propagated to its end.
        let mut noise = Matrix5::zeros();
        let steps = 1000;
        for k in 0..steps {
            let remaining = (f64::from(k) + 0.5) / f64::from(steps);
            let by_accel = Vector5::new(remaining * dt, 1.0, 0.0, 0.0, 0.0);
            // First order in position: spans are short.
            let by_gyro = Vector5::new(0.0, remaining * f, 1.0, 0.0, 0.0);
            let share = dt / f64::from(steps);
            noise += by_accel * by_accel.transpose() * (step.accel_noise * share);
            noise += by_gyro * by_gyro.transpose() * (step.gyro_noise * share);
        }
        noise[(3, 3)] += velocity.variance;
        noise[(4, 4)] += position.variance;
        self.p = transition * self.p * transition.transpose() + noise;
    }

    fn row(measured: Measured) -> RowVector5<f64> {
        match measured {
            Measured::Velocity => RowVector5::new(0.0, 1.0, 0.0, 1.0, 0.0),
            Measured::Position => RowVector5::new(1.0, 0.0, 0.0, 0.0, 1.0),
        }
    }

    /// Joseph form.
    fn update(&mut self, measured: Measured, white: f64) -> Vector5<f64> {
        let row = Self::row(measured);
        let predicted = (row * self.p * row.transpose()).x;
        let gains = self.p * row.transpose() / (predicted + white);
        let i_minus_kh = Matrix5::identity() - gains * row;
        self.p = i_minus_kh * self.p * i_minus_kh.transpose() + gains * gains.transpose() * white;
        gains
    }
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Propagate(ChannelStep, f64),
    Update(Measured, f64),
    AddVariance(f64, f64, f64),
}

fn step() -> impl Strategy<Value = Step> {
    let step = (
        0.01_f64..0.3,
        (0.0_f64..25.0, -1e-3_f64..1e-3),
        0.4_f64..0.6,
        -8.0_f64..-4.0,
        -10.0_f64..-6.0,
    );
    let white =
        |measured| (-4.0_f64..1.0).prop_map(move |e| Step::Update(measured, 10_f64.powf(e)));
    prop_oneof![
        4 => (step, 0.1_f64..10.0).prop_map(|((seconds, (force, gravity), early, accel, gyro), factor)| {
            let step = ChannelStep {
                seconds,
                force_up_mps: force * seconds,
                force_up_position_m: early * force * seconds * seconds,
                gravity_per_s: gravity * seconds,
                accel_noise: 10_f64.powf(accel),
                gyro_noise: 10_f64.powf(gyro),
            };
            Step::Propagate(step, factor)
        }),
        2 => white(Measured::Velocity),
        2 => white(Measured::Position),
        1 => (0.0_f64..1.0, 0.0_f64..1e-3, 0.0_f64..100.0).prop_map(|(v, t, p)| Step::AddVariance(v, t, p)),
    ]
}

/// Tolerance for rounding, relative to the value and to its initial value.
const ROUNDING: f64 = 1e-9;

proptest! {
    #[test]
    fn channel_matches_a_kalman_filter(steps in prop::collection::vec(step(), 1..300)) {
        let mut channel = Channel::new(TILT, &VELOCITY, &POSITION);
        let mut dense = Dense::new(channel.position(), channel.velocity());
        let start = dense.p;
        for step in steps {
            match step {
                Step::Propagate(step, factor) => {
                    let gnss_noise = [&VELOCITY, &POSITION]
                        .map(|noise| Markov::over(step.seconds, noise, factor));
                    channel.propagate(&step, gnss_noise);
                    dense.propagate(&step, gnss_noise);
                }
                Step::Update(measured, white) => {
                    let gains = channel.update(measured, white);
                    let expected = dense.update(measured, white);
                    for k in 0..5 {
                        let scale = (start[(k, k)] / white).sqrt();
                        let error = (gains[k] - expected[k]).abs();
                        prop_assert!(error < ROUNDING * (scale + expected[k].abs()), "{k}: {error}");
                    }
                }
                Step::AddVariance(velocity, tilt, position) => {
                    channel.add_variance(velocity, tilt);
                    channel.add_position_variance(position);
                    dense.p[(0, 0)] += position;
                    dense.p[(1, 1)] += velocity;
                    dense.p[(2, 2)] += tilt;
                }
            }
            for measured in [Measured::Velocity, Measured::Position] {
                let row = Dense::row(measured);
                let expected = (row * dense.p * row.transpose()).x;
                let error = (channel.predicted_variance(measured) - expected).abs();
                prop_assert!(error < ROUNDING * start.norm(), "{error}");
            }
            let variances = [channel.position(), channel.velocity(), channel.tilt()];
            for (k, variance) in variances.into_iter().enumerate() {
                let expected = dense.p[(k, k)];
                prop_assert!(variance >= 0.0);
                let error = (variance - expected).abs();
                prop_assert!(error < ROUNDING * (expected + start[(k, k)]), "{k}: {variance} {expected}");
            }
        }
    }

    /// For any length of the spans.
    #[test]
    fn correlated_noise_keeps_its_variance(
        seconds in 1e-3_f64..1e3,
        factor in 0.01_f64..100.0,
    ) {
        let noise = Markov::over(seconds, &POSITION, factor);
        prop_assert!((0.0..1.0).contains(&noise.decay));
        let settled = noise.variance / (1.0 - noise.decay * noise.decay);
        let configured = factor * POSITION.correlated * POSITION.correlated;
        prop_assert!((settled / configured - 1.0).abs() < 1e-9);
        // To second order.
        let x = seconds / POSITION.correlation_s;
        if x < 1.0 {
            prop_assert!((noise.decay / (-x).exp() - 1.0).abs() < x.powi(3) / 6.0 + 1e-12);
        }
    }
}

/// Tilt times gravity is a slope of velocity.
#[test]
fn velocity_aiding_estimates_tilt() {
    let step = ChannelStep {
        seconds: 0.1,
        force_up_mps: 0.98,
        force_up_position_m: 0.049,
        gravity_per_s: 0.0,
        accel_noise: 1e-8,
        gyro_noise: 1e-12,
    };
    let mut channel = Channel::new(TILT, &VELOCITY, &POSITION);
    for _ in 0..1000 {
        channel.propagate(
            &step,
            [&VELOCITY, &POSITION].map(|n| Markov::over(0.1, n, 1.0)),
        );
        let _ = channel.update(Measured::Velocity, 0.01);
    }
    // Slope over 100 s from white noise of 0.1 m/s at 10 Hz and correlated noise of 0.1 m/s and 1 s:
    // sqrt(12 (0.01 * 0.1 s + 2 * 0.01 * 1 s) / T^3) / g.
    let expected = (12.0 * 0.021 / 1e6_f64).sqrt() / 9.8;
    let sigma = channel.tilt().sqrt();
    assert!(
        (0.8..1.3).contains(&(sigma / expected)),
        "{sigma} {expected}"
    );
}

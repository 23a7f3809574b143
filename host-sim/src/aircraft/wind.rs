//! Steady wind and Dryden turbulence (MIL-F-8785C; MIL-HDBK-1797 for the rotational gusts).

use nalgebra::Vector3;

use super::dynamics::{STEP_S, Wind};
use crate::sim::noise::Random;

/// Turbulence intensities of MIL-F-8785C.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Turbulence {
    #[default]
    None,
    Light,
    Moderate,
    Severe,
}

impl Turbulence {
    /// Wind 6 m above ground (15, 30, 45 kt), which sets the intensity below 1000 ft, and root mean
    /// square above 2000 ft (5, 10, 20 ft/s at the low end of the chart), m/s.
    fn surface_and_free_mps(self) -> [f64; 2] {
        match self {
            Self::None => [0.0, 0.0],
            Self::Light => [7.72, 1.52],
            Self::Moderate => [15.43, 3.05],
            Self::Severe => [23.15, 6.10],
        }
    }
}

/// Scale lengths and intensities at one height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum {
    /// Longitudinal, lateral, vertical.
    pub length_m: [f64; 3],
    pub sigma_mps: [f64; 3],
}

impl Spectrum {
    /// At a height above the ground.
    pub fn at(turbulence: Turbulence, height_m: f64) -> Self {
        const LOW_M: f64 = 304.8;
        const FREE_M: f64 = 609.6;
        let [surface_mps, free_mps] = turbulence.surface_and_free_mps();
        let low = |height_m: f64| {
            let feet = height_m.clamp(3.0, LOW_M) / 0.3048;
            let shape = 0.177 + 0.000_823 * feet;
            let horizontal_m = 0.3048 * feet / libm::pow(shape, 1.2);
            let vertical_mps = 0.1 * surface_mps;
            let horizontal_mps = vertical_mps / libm::pow(shape, 0.4);
            Self {
                length_m: [horizontal_m, horizontal_m, 0.3048 * feet],
                sigma_mps: [horizontal_mps, horizontal_mps, vertical_mps],
            }
        };
        let free = Self {
            length_m: [533.4; 3],
            sigma_mps: [free_mps; 3],
        };
        let part = ((height_m - LOW_M) / (FREE_M - LOW_M)).clamp(0.0, 1.0);
        let below = low(height_m);
        let mix = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] + part * (b[i] - a[i]));
        Self {
            length_m: mix(below.length_m, free.length_m),
            sigma_mps: mix(below.sigma_mps, free.sigma_mps),
        }
    }
}

/// Lateral or vertical gust, white noise through `(1 + sqrt(3) T s) / (1 + T s)^2`, as two lags in series,
/// discretized exactly: for any step, variance and correlation are those of the continuous filter.
#[derive(Clone, Copy, Debug, Default)]
struct Transverse {
    lags: [f64; 2],
    decay: f64,
    coupling: f64,
    /// Lower Cholesky factor of the noise of one step.
    noise: [f64; 3],
}

impl Transverse {
    fn discretize(&mut self, steps_per_time_constant: f64) {
        let a = 1.0 / steps_per_time_constant;
        let decay = libm::exp(-a);
        let square = decay * decay;
        // Process noise: stationary covariance [[1, 1/2], [1/2, 1/2]] minus its propagation by one step.
        let q11 = 1.0 - square;
        let q12 = 0.5 - square * (a + 0.5);
        let q22 = 0.5 - square * (a * a + a + 0.5);
        let l11 = q11.sqrt();
        let l21 = q12 / l11;
        *self = Self {
            decay,
            coupling: decay * a,
            noise: [l11, l21, (q22 - l21 * l21).max(0.0).sqrt()],
            ..*self
        };
    }

    fn step(&mut self, random: &mut Random) -> f64 {
        let (n1, n2) = (random.normal(), random.normal());
        let [first, second] = self.lags;
        self.lags = [
            self.decay * first + self.noise[0] * n1,
            self.coupling * first + self.decay * second + self.noise[1] * n1 + self.noise[2] * n2,
        ];
        let sqrt3 = 3.0_f64.sqrt();
        (sqrt3 * self.lags[0] + (1.0 - sqrt3) * self.lags[1]) * std::f64::consts::FRAC_1_SQRT_2
    }
}

/// A first-order lag, discretized exactly, unit variance.
#[derive(Clone, Copy, Debug, Default)]
struct Lag {
    value: f64,
    decay: f64,
}

impl Lag {
    fn discretize(&mut self, steps_per_time_constant: f64) {
        self.decay = libm::exp(-1.0 / steps_per_time_constant);
    }

    fn step(&mut self, input: f64) -> f64 {
        self.value = self.decay * self.value + input;
        self.value
    }

    /// Gain of unit white noise for unit output variance.
    fn input_gain(&self) -> f64 {
        (1.0 - self.decay * self.decay).sqrt()
    }
}

/// The moving air along a flight.
#[derive(Clone, Debug)]
pub struct AirMass {
    steady_enu_mps: Vector3<f64>,
    turbulence: Turbulence,
    span_m: f64,
    random: Random,
    steps_to_update: u32,
    spectrum: Spectrum,
    along: Lag,
    across: Transverse,
    upward: Transverse,
    roll: Lag,
    roll_sigma_radps: f64,
    /// Low-pass vertical and lateral gusts; their differences from the gusts are the rotational gusts.
    pitch: Lag,
    yaw: Lag,
    pitch_lag_m: f64,
    yaw_lag_m: f64,
}

/// Steps between updates of the scale lengths by height and airspeed.
const UPDATE_EVERY: u32 = 50;

impl AirMass {
    /// Air for an aircraft of a wing span, in steps of the integrator.
    pub fn new(
        steady_enu_mps: Vector3<f64>,
        turbulence: Turbulence,
        span_m: f64,
        seed: u64,
    ) -> Self {
        let mut air = Self {
            steady_enu_mps,
            turbulence,
            span_m,
            random: Random::stream(seed, "turbulence"),
            steps_to_update: 0,
            spectrum: Spectrum::at(turbulence, 0.0),
            along: Lag::default(),
            across: Transverse::default(),
            upward: Transverse::default(),
            roll: Lag::default(),
            roll_sigma_radps: 0.0,
            pitch: Lag::default(),
            yaw: Lag::default(),
            pitch_lag_m: 4.0 * span_m / std::f64::consts::PI,
            yaw_lag_m: 3.0 * span_m / std::f64::consts::PI,
        };
        // Stationary from the start.
        air.along.value = air.random.normal();
        air.roll.value = air.random.normal();
        for gust in [&mut air.across, &mut air.upward] {
            let (n1, n2) = (air.random.normal(), air.random.normal());
            gust.lags = [n1, 0.5 * (n1 + n2)];
        }
        air
    }

    fn discretize(&mut self, airspeed_mps: f64, height_m: f64) {
        use std::f64::consts::PI;
        self.spectrum = Spectrum::at(self.turbulence, height_m);
        let travelled_m = airspeed_mps * STEP_S;
        let [along_m, across_m, upward_m] = self.spectrum.length_m;
        self.along.discretize(along_m / travelled_m);
        self.across.discretize(across_m / travelled_m);
        self.upward.discretize(upward_m / travelled_m);
        self.roll.discretize(self.pitch_lag_m / travelled_m);
        self.pitch.discretize(self.pitch_lag_m / travelled_m);
        self.yaw.discretize(self.yaw_lag_m / travelled_m);
        // Area under MIL-F-8785C's roll-gust spectrum.
        let span = self.span_m;
        self.roll_sigma_radps = self.spectrum.sigma_mps[2]
            * (0.8 * libm::cbrt(PI / (4.0 * span)) * PI * PI / (8.0 * span)).sqrt()
            / libm::cbrt(upward_m);
    }

    /// The air one step later, for an aircraft at this airspeed and height.
    pub fn step(&mut self, airspeed_mps: f64, height_m: f64) -> Wind {
        if self.turbulence == Turbulence::None {
            return Wind {
                steady_enu_mps: self.steady_enu_mps,
                ..Wind::default()
            };
        }
        if self.steps_to_update == 0 {
            self.discretize(airspeed_mps.max(1.0), height_m);
            self.steps_to_update = UPDATE_EVERY;
        }
        self.steps_to_update -= 1;
        let [along_mps, across_mps, upward_mps] = self.spectrum.sigma_mps;
        let noise = self.along.input_gain() * self.random.normal();
        let along = along_mps * self.along.step(noise);
        let across = across_mps * self.across.step(&mut self.random);
        let upward = upward_mps * self.upward.step(&mut self.random);
        let noise = self.roll.input_gain() * self.random.normal();
        let roll = self.roll_sigma_radps * self.roll.step(noise);
        // An upward gust ahead of the aircraft is a nose-up pitch gust; likewise to the right for yaw.
        let upward_mean = self.pitch.step((1.0 - self.pitch.decay) * upward);
        let across_mean = self.yaw.step((1.0 - self.yaw.decay) * across);
        let pitch = (upward - upward_mean) / self.pitch_lag_m;
        let yaw_right = (across - across_mean) / self.yaw_lag_m;
        Wind {
            steady_enu_mps: self.steady_enu_mps,
            gust_mps: Vector3::new(across, along, upward),
            gust_rate_radps: Vector3::new(pitch, roll, -yaw_right),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AIRSPEED_MPS: f64 = 50.0;

    /// Gusts at 1000 m, moderate.
    fn gusts(seed: u64, count: usize) -> Vec<Wind> {
        let mut air = AirMass::new(Vector3::zeros(), Turbulence::Moderate, 11.0, seed);
        (0..count).map(|_| air.step(AIRSPEED_MPS, 1000.0)).collect()
    }

    /// Averaged periodogram at multiples of the bin width, one-sided, per rad/s.
    fn periodogram(x: &[f64], segment: usize, bins: &[usize]) -> Vec<f64> {
        let count = x.len() / segment;
        bins.iter()
            .map(|&bin| {
                let omega = std::f64::consts::TAU * bin as f64 / segment as f64;
                let power: f64 = x
                    .chunks_exact(segment)
                    .map(|chunk| {
                        let (mut re, mut im) = (0.0, 0.0);
                        for (i, value) in chunk.iter().enumerate() {
                            // Hann window: leakage of the steep spectrum would fill its tail.
                            let phase = std::f64::consts::TAU * i as f64 / segment as f64;
                            let weight = 1.0 - libm::cos(phase);
                            let (s, c) = libm::sincos(omega * i as f64);
                            re += weight * value * c;
                            im += weight * value * s;
                        }
                        re * re + im * im
                    })
                    .sum();
                // Mean square of the window is 3/2.
                power / count as f64 * STEP_S / (std::f64::consts::PI * 1.5 * segment as f64)
            })
            .collect()
    }

    fn variance(x: impl Iterator<Item = f64>) -> f64 {
        let (count, sum) = x.fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v * v));
        sum / count
    }

    #[test]
    fn variances_are_those_of_the_standard() {
        // 20 flights of 2 h: 27 000 scale lengths. The variance of a component scatters by
        // sqrt(2 / 13 000), 1.2 %; bound 5 sigma. Roll gusts are faster, hence closer.
        let all: Vec<Wind> = (0..20).flat_map(|seed| gusts(seed, 360_000)).collect();
        let sigma = Turbulence::Moderate.surface_and_free_mps()[1];
        for (axis, name) in ["lateral", "longitudinal", "vertical"].iter().enumerate() {
            let ratio = variance(all.iter().map(|w| w.gust_mps[axis])) / (sigma * sigma);
            assert!((ratio - 1.0).abs() < 0.06, "{name}: {ratio}");
        }
        let b: f64 = 11.0;
        let pi = std::f64::consts::PI;
        let expected = sigma * sigma * 0.8 * libm::cbrt(pi / (4.0 * b)) * pi * pi
            / (8.0 * b * libm::pow(533.4, 2.0 / 3.0));
        let ratio = variance(all.iter().map(|w| w.gust_rate_radps.y)) / expected;
        assert!((ratio - 1.0).abs() < 0.03, "roll: {ratio}");
    }

    #[test]
    fn spectra_are_those_of_the_standard() {
        let length = 533.4;
        let sigma = Turbulence::Moderate.surface_and_free_mps()[1];
        let segment = 16_384;
        let bins = [3, 10, 30, 100, 300];
        let all: Vec<Wind> = (100..110)
            .flat_map(|seed| gusts(seed, 20 * segment))
            .collect();
        let spectrum = |axis: usize| {
            let x: Vec<f64> = all.iter().map(|w| w.gust_mps[axis]).collect();
            periodogram(&x, segment, &bins)
        };
        let measured = [spectrum(1), spectrum(0), spectrum(2)];
        for (i, &bin) in bins.iter().enumerate() {
            let omega = std::f64::consts::TAU * bin as f64 / (segment as f64 * STEP_S);
            let x = length * omega / AIRSPEED_MPS;
            let front = sigma * sigma * length / (std::f64::consts::PI * AIRSPEED_MPS);
            let along = 2.0 * front / (1.0 + x * x);
            let across = front * (1.0 + 3.0 * x * x) / ((1.0 + x * x) * (1.0 + x * x));
            for (name, value, expected) in [
                ("along", measured[0][i], along),
                ("across", measured[1][i], across),
                ("upward", measured[2][i], across),
            ] {
                // Mean of 200 exponentials: 7 %; bound 4 sigma.
                assert!(
                    (value / expected - 1.0).abs() < 0.28,
                    "{name} at {omega} rad/s: {}",
                    value / expected
                );
            }
        }
    }
}

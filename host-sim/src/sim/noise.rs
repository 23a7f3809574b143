//! Seeded random numbers, and correlated noise.

use rand_core::Rng;
use rand_pcg::Pcg64;

use super::receiver::Correlated;

/// One named sequence of random numbers.
///
/// Each source of randomness has its own, so that a change of one does not affect another. The same bits
/// on every machine: distributions are implemented here, with `libm`.
#[derive(Clone, Debug)]
pub struct Random {
    generator: Pcg64,
    spare_normal: Option<f64>,
}

impl Random {
    /// The sequence `name` of the run `seed`.
    pub fn stream(seed: u64, name: &str) -> Self {
        let name = fnv1a(name.as_bytes());
        // Mixed into the state as well: PCG streams with equal states start with correlated numbers.
        let high = mix(seed ^ name);
        let low = mix(high ^ name.rotate_left(32));
        Self {
            generator: Pcg64::new(u128::from(high) << 64 | u128::from(low), u128::from(name)),
            spare_normal: None,
        }
    }

    pub fn whole(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    pub fn uniform(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the logarithm: as likely between 1 and 2 as between 2 and 4.
    pub fn log_uniform(&mut self, bounds: [f64; 2]) -> f64 {
        libm::exp(self.uniform(bounds.map(libm::log)))
    }

    /// With probability `share` log-uniform, else zero.
    pub fn sometimes(&mut self, share: f64, bounds: [f64; 2]) -> f64 {
        if self.chance(share) {
            self.log_uniform(bounds)
        } else {
            0.0
        }
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// One of at least one, uniformly.
    #[allow(clippy::cast_possible_truncation)]
    pub fn one_of<'a, T>(&mut self, some: &'a [T]) -> &'a T {
        &some[(self.whole() % some.len() as u64) as usize]
    }

    /// Normal with zero mean and unit variance (Box-Muller; the pair is used up in turn).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare_normal.take() {
            return spare;
        }
        // 1 - unit is in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        let (sin, cos) = libm::sincos(core::f64::consts::TAU * self.unit());
        self.spare_normal = Some(radius * sin);
        radius * cos
    }

    pub fn normal3(&mut self) -> [f64; 3] {
        core::array::from_fn(|_| self.normal())
    }
}

pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// `SplitMix64`'s output function: every input bit reaches every output bit.
fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A Gauss-Markov process, stationary from the start, or one of jumps with the same covariance.
#[derive(Clone, Debug)]
pub(super) struct GaussMarkov {
    value: f64,
    transition_factor: f64,
    sigma: f64,
    jumps: bool,
    random: Random,
}

impl GaussMarkov {
    pub(super) fn new(noise: &Correlated, step_s: f64, jumps: bool, mut random: Random) -> Self {
        Self {
            value: noise.sigma * random.normal(),
            transition_factor: libm::exp(-step_s / noise.time_s),
            sigma: noise.sigma,
            jumps,
            random,
        }
    }

    /// The current value; then advances by one step.
    pub(super) fn step(&mut self) -> f64 {
        let now = self.value;
        if self.jumps {
            if !self.random.chance(self.transition_factor) {
                self.value = self.sigma * self.random.normal();
            }
        } else if self.sigma > 0.0 {
            let driving = (1.0 - self.transition_factor * self.transition_factor).sqrt();
            self.value = self.transition_factor * now + self.sigma * driving * self.random.normal();
        }
        now
    }
}

#[cfg(test)]
#[path = "../../tests/statistics.rs"]
pub(super) mod statistics;

#[cfg(test)]
mod tests {
    use super::statistics::{assert_correlation, assert_mean, assert_sigma};
    use super::*;

    const COUNT: usize = 100_000;

    fn normals(seed: u64, name: &str) -> Vec<f64> {
        let mut random = Random::stream(seed, name);
        (0..COUNT).map(|_| random.normal()).collect()
    }

    #[test]
    fn normals_have_the_moments_and_tails_of_a_normal() {
        let x = normals(1, "a");
        assert_mean(&x, 0.0, 1.0);
        assert_sigma(&x, 1.0);
        // Third and fourth powers: means 0 and 3, variances 15 and 105 - 9.
        let cubes: Vec<f64> = x.iter().map(|x| x * x * x).collect();
        let fourths: Vec<f64> = x.iter().map(|x| x * x * x * x).collect();
        assert_mean(&cubes, 0.0, 15.0_f64.sqrt());
        assert_mean(&fourths, 3.0, 96.0_f64.sqrt());
        let beyond: Vec<f64> = x.iter().map(|x| f64::from(x.abs() > 3.0)).collect();
        assert_mean(&beyond, 0.002_699_8, 0.002_699_8_f64.sqrt());
    }

    #[test]
    fn streams_and_seeds_are_independent() {
        let a = normals(1, "a");
        assert_correlation(&a, &a[1..], 0.0);
        assert_correlation(&a, &normals(1, "b"), 0.0);
        assert_correlation(&a, &normals(2, "a"), 0.0);
        // First draws of runs with consecutive seeds, as campaigns use them.
        let first = |name| -> Vec<f64> {
            (0..COUNT as u64)
                .map(|seed| Random::stream(seed, name).normal())
                .collect()
        };
        let (x, y) = (first("bias x"), first("bias y"));
        assert_sigma(&x, 1.0);
        assert_correlation(&x, &x[1..], 0.0);
        assert_correlation(&x, &y, 0.0);
    }

    #[test]
    fn correlated_noise_has_the_covariance_it_says() {
        let noise = Correlated {
            sigma: 0.05,
            time_s: 2.0,
        };
        let runs: Vec<Vec<f64>> = (0..5000)
            .map(|seed| {
                let mut process =
                    GaussMarkov::new(&noise, 0.1, false, Random::stream(seed, "test"));
                (0..100).map(|_| process.step()).collect()
            })
            .collect();
        let at = |step: usize| -> Vec<f64> { runs.iter().map(|run| run[step]).collect() };
        let start = at(0);
        for step in [0, 1, 20, 60, 99] {
            assert_mean(&at(step), 0.0, 0.05);
            assert_sigma(&at(step), 0.05);
            if step > 0 {
                assert_correlation(&start, &at(step), libm::exp(-0.1 * step as f64 / 2.0));
            }
        }
    }

    #[test]
    fn jumps_have_the_spread_and_memory_of_what_wanders() {
        let noise = Correlated {
            sigma: 3.0,
            time_s: 2.0,
        };
        let runs: Vec<[f64; 2]> = (0..5000)
            .map(|seed| {
                let mut process = GaussMarkov::new(&noise, 0.1, true, Random::stream(seed, "test"));
                let start = process.step();
                let later = (1..=10).map(|_| process.step()).last();
                [start, later.unwrap()]
            })
            .collect();
        let at = |which: usize| -> Vec<f64> { runs.iter().map(|run| run[which]).collect() };
        assert_sigma(&at(1), 3.0);
        let kept = at(0)
            .iter()
            .zip(at(1))
            .filter(|(a, b)| (*a - b).abs() < 1e-12)
            .count();
        assert!((kept as f64 / 5000.0 - libm::exp(-0.5)).abs() < 0.03);
    }

    #[test]
    fn the_sequence_is_the_same_everywhere() {
        // A change of these bits changes every simulated figure ever stated.
        let mut random = Random::stream(42, "golden");
        let bits: [u64; 3] = core::array::from_fn(|_| random.normal().to_bits());
        assert_eq!(
            bits,
            [
                0xbffb_9f65_5259_2a0a,
                0x3f89_dc14_2a0b_d1e5,
                0x3fe4_3cb1_fc61_cc66
            ]
        );
    }
}

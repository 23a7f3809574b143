//! Seeded random numbers.

use rand_core::Rng;
use rand_pcg::Pcg64;

/// One named sequence of random numbers.
///
/// Each source of randomness has its own, so that a change of one does not reshuffle another.
/// The same bits on every machine: `libm`, and no library's idea of a distribution.
#[derive(Clone, Debug)]
pub struct Random {
    generator: Pcg64,
    spare_normal: Option<f64>,
}

impl Random {
    /// The sequence `name` of the run `seed`.
    pub fn stream(seed: u64, name: &str) -> Self {
        let name = fnv1a(name);
        // Mixed into the state too: one state on two PCG streams starts alike.
        let high = mix(seed ^ name);
        let low = mix(high ^ name.rotate_left(32));
        Self {
            generator: Pcg64::new(u128::from(high) << 64 | u128::from(low), u128::from(name)),
            spare_normal: None,
        }
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Uniform between two bounds.
    pub fn uniform(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.unit()
    }

    /// True with a probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// -1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
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

    /// Three independent normals.
    pub fn normal3(&mut self) -> [f64; 3] {
        core::array::from_fn(|_| self.normal())
    }
}

fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// `SplitMix64`'s output function: every input bit reaches every output bit.
fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

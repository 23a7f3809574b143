//! Normal deviates for statistical tests.

/// Sums of twelve uniform numbers, sufficient for statistics to a tenth.
pub struct Deviates(pub u64);

impl Deviates {
    pub fn next(&mut self) -> f32 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            sum += f32::from(u16::try_from(self.0 >> 48).unwrap_or(0)) / 65_536.0;
        }
        sum
    }
}

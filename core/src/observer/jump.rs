//! Whether azimuth or latency has jumped: a mount that slips, a turn that a hole or a saturated gyro hides;
//! a clock that was set, a receiver that was switched on again.
//!
//! What a jump adds to the innovations is known, but for its size: the response to a unit of the
//! parameter. The size that explains the innovations of the last time best is held against what is
//! known of it (generalized likelihood ratio of a jump: Willsky and Jones, IEEE TAC 21,
//! 1976). Noise learnt from the innovations would explain them as well: not in this direction. But a level
//! that has been tipped pulls all the time the same way, and leans on what the accelerometers feel, by which
//! a latency shows: of that only what changes counts, as if such a pull were estimated beside it.

use nalgebra::Vector2;

/// Sigmas of a jump, and least part of what is too much in the squares of the innovations that it
/// explains.
const SIGMAS: f64 = 5.0;
const EXPLAINED: f64 = 0.5;

/// How a jump of a parameter is looked for.
#[derive(Debug)]
pub struct JumpTest {
    /// Time over which innovations, and what a unit adds to them, are averaged first, s.
    mean_s: f64,
    /// Time for which they count, s.
    memory_s: f64,
    /// Least time in which it was seen, s: wrong fixes come in bursts, and point anywhere.
    pub least_time_s: f64,
    /// Whether something may pull all the time the same way.
    with_offset: bool,
    /// Whether innovations that are not believed count as well.
    pub uses_rejected: bool,
}

/// An azimuth: some manoeuvres.
pub const AZIMUTH: JumpTest = JumpTest {
    mean_s: 0.0,
    memory_s: 30.0,
    least_time_s: 3.0,
    with_offset: false,
    uses_rejected: true,
};
/// A latency: so does what a hard braking does to sensors.
pub const LATENCY: JumpTest = JumpTest {
    least_time_s: 9.0,
    with_offset: true,
    ..AZIMUTH
};
/// One that was never right: steps show it but for whole ones, and of a walk only bends and stops do, each for a
/// second or two, which are not seen among steps. In so long a time an INS also follows a receiver that is stuck.
pub const INITIAL_LATENCY: JumpTest = JumpTest {
    mean_s: 1.0,
    memory_s: 300.0,
    uses_rejected: false,
    ..LATENCY
};

/// Innovations of the last time against the response to a jump.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Jump {
    /// Of its size: weighted sum of what shows it, and information.
    score: f64,
    information: f64,
    /// Squares of the information in a second, integrated.
    info_squares: f64,
    /// Squares of the innovations, in their variance, less what noise makes of them.
    excess: f64,
    /// Of a pull that stays: information, and of each component what shows it, and what it shares with a jump.
    offset_weight: f64,
    offset: [f64; 2],
    shared: [f64; 2],
    /// Innovation and what a unit would add to it, averaged.
    mean: [f64; 2],
    mean_partial: [f64; 2],
}

impl Jump {
    /// Takes an innovation of this variance per component, `seconds` (positive) after the last, to
    /// which a unit would add `by`. What is averaged tells less, which its smaller square holds.
    #[inline(never)]
    pub fn add(
        &mut self,
        innovation: &Vector2<f64>,
        by: &Vector2<f64>,
        variance: f64,
        seconds: f64,
        test: &JumpTest,
    ) {
        let keep = 1.0 / (1.0 + seconds / test.memory_s);
        let (mut shown, mut information, mut square) = (0.0, 0.0, 0.0);
        self.offset_weight = keep * self.offset_weight + 1.0 / variance;
        let part = seconds / (seconds + test.mean_s);
        let offsets = self.offset.iter_mut().zip(&mut self.shared);
        let means = self.mean.iter_mut().zip(&mut self.mean_partial);
        for (((innovation, by), (mean, mean_partial)), (offset, shared)) in
            innovation.iter().zip(by).zip(means).zip(offsets)
        {
            *mean += part * (innovation - *mean);
            *mean_partial += part * (by - *mean_partial);
            let (innovation, by) = (*mean, *mean_partial);
            *offset = keep * *offset + innovation / variance;
            *shared = keep * *shared + by / variance;
            shown += by * innovation / variance;
            information += by * by / variance;
            square += innovation * innovation / variance - part / (2.0 - part);
        }
        self.score = keep * self.score + shown;
        self.information = keep * self.information + information;
        self.info_squares = keep * self.info_squares + information * information / seconds;
        self.excess = keep * self.excess + square;
    }

    /// The square of its size, if there was one beyond what is known to `variance`; innovations are `inflation`
    /// times less informative than white ones.
    #[inline(never)]
    pub fn detect(&mut self, variance: f64, inflation: f64, test: &JumpTest) -> Option<f64> {
        let expected = inflation + self.information * variance;
        if self.score * self.score < expected * self.information {
            *self = Self::default();
            return None;
        }
        let [mut score, mut information, mut excess] = [self.score, self.information, self.excess];
        if test.with_offset {
            for (offset, shared) in self.offset.iter().zip(&self.shared) {
                score -= shared * offset / self.offset_weight;
                information -= shared * shared / self.offset_weight;
                excess -= offset * offset / self.offset_weight;
            }
        }
        let explained = score * score / information;
        let jumped = explained > SIGMAS * SIGMAS * expected
            && explained > EXPLAINED * excess
            && self.information * self.information > test.least_time_s * self.info_squares;
        jumped.then(|| {
            *self = Self::default();
            4.0 * explained / information
        })
    }
}

#[cfg(test)]
#[path = "../../tests/unit/jump.rs"]
mod tests;

//! Whether azimuth or latency has jumped: a mount that slips, a turn that a hole or a saturated gyro hides;
//! a clock that was set, a receiver that was switched on again.
//!
//! What a jump adds to the innovations is known, but for its size: the response to a unit of the
//! parameter. The size that explains the innovations of the last time best is held against what is
//! known of it (generalized likelihood ratio of a jump: Willsky and Jones, IEEE TAC 21,
//! 1976). Noise learnt from the innovations would explain them as well: not in this direction.

/// Time for which innovations count, s: some manoeuvres.
const MEMORY_S: f64 = 30.0;
/// Sigmas of a jump, and least part of what is too much in the squares of the innovations that it
/// explains.
const SIGMAS: f64 = 5.0;
const EXPLAINED: f64 = 0.5;
/// Least time in which it was seen, s: wrong fixes come in bursts, and point anywhere.
pub const AZIMUTH_SEEN_S: f64 = 3.0;
/// The same of a latency: a burst of wrong fixes looks like one, and so does what a hard braking does to
/// sensors.
pub const LATENCY_SEEN_S: f64 = 9.0;

/// Innovations of the last time against the response to a jump.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Jump {
    /// Of its size: weighted sum of what shows it, and information.
    score: f64,
    information: f64,
    /// Squares of the information in a second, integrated.
    gathered: f64,
    /// Squares of the innovations, in their variance, less what noise makes of them.
    squares: f64,
}

impl Jump {
    /// Takes an innovation of this variance per component, `seconds` (positive) after the last, to
    /// which a unit would add `by`.
    pub fn take<const R: usize>(
        &mut self,
        innovation: &[f64; R],
        by: &[f32; R],
        variance: f64,
        seconds: f64,
    ) {
        let keep = 1.0 / (1.0 + seconds / MEMORY_S);
        let (mut shown, mut information, mut square) = (0.0, 0.0, 0.0);
        for (innovation, by) in innovation.iter().zip(by) {
            let by = f64::from(*by);
            shown += by * innovation / variance;
            information += by * by / variance;
            square += innovation * innovation / variance - 1.0;
        }
        self.score = keep * self.score + shown;
        self.information = keep * self.information + information;
        self.gathered = keep * self.gathered + information * information / seconds;
        self.squares = keep * self.squares + square;
    }

    /// The square of its size, if there was one beyond what is known to `variance`, seen for so long at
    /// least; innovations are `inflation` times less informative than white ones.
    pub fn square(&mut self, variance: f64, inflation: f64, seen_s: f64) -> Option<f64> {
        let information = self.information;
        let explained = self.score * self.score / information;
        let expected = inflation + information * variance;
        if explained < expected {
            *self = Self::default();
            return None;
        }
        let jumped = explained > SIGMAS * SIGMAS * expected
            && explained > EXPLAINED * self.squares
            && information * information > seen_s * self.gathered;
        jumped.then(|| {
            *self = Self::default();
            4.0 * explained / information
        })
    }
}

#[cfg(test)]
#[path = "../../tests/unit/jump.rs"]
mod tests;

//! Whether azimuth or latency has jumped: a mount that slips, a turn that a hole or a saturated gyro hides;
//! a clock that was set, a receiver that was switched on again.
//!
//! What a jump adds to the innovations is known, but for its size: the response to a unit of the
//! parameter. The size that explains the innovations of the last time best is held against what is
//! known of it (generalized likelihood ratio of a jump: Willsky and Jones, IEEE TAC 21,
//! 1976). Noise learnt from the innovations would explain them as well: not in this direction. But a level
//! that has been tipped pulls all the time the same way, and leans on what the accelerometers feel, by which
//! a latency shows: of that only what changes counts, as if such a pull were estimated beside it.

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
    /// Of a pull that stays: information, and of each component what shows it, and what it shares with a jump.
    weight: f64,
    pull: [f64; 2],
    shared: [f64; 2],
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
        self.weight = keep * self.weight + 1.0 / variance;
        let pulls = self.pull.iter_mut().zip(&mut self.shared);
        for ((innovation, by), (pull, shared)) in innovation.iter().zip(by).zip(pulls) {
            let by = f64::from(*by);
            *pull = keep * *pull + innovation / variance;
            *shared = keep * *shared + by / variance;
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
    /// least, beside a pull that stays or not; innovations are `inflation` times less informative than white
    /// ones.
    pub fn square(
        &mut self,
        variance: f64,
        inflation: f64,
        seen_s: f64,
        beside_a_pull: bool,
    ) -> Option<f64> {
        let expected = inflation + self.information * variance;
        if self.score * self.score < expected * self.information {
            *self = Self::default();
            return None;
        }
        let [mut score, mut information, mut squares] =
            [self.score, self.information, self.squares];
        if beside_a_pull {
            for (pull, shared) in self.pull.iter().zip(&self.shared) {
                score -= shared * pull / self.weight;
                information -= shared * shared / self.weight;
                squares -= pull * pull / self.weight;
            }
        }
        let explained = score * score / information;
        let jumped = explained > SIGMAS * SIGMAS * expected
            && explained > EXPLAINED * squares
            && self.information * self.information > seen_s * self.gathered;
        jumped.then(|| {
            *self = Self::default();
            4.0 * explained / information
        })
    }
}

#[cfg(test)]
#[path = "../../tests/unit/jump.rs"]
mod tests;

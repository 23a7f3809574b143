//! Detection of a jump of azimuth or latency: a mount that slips, a turn during a gap or beyond a gyro's
//! range; a clock that was set, a receiver that was restarted.
//!
//! A jump adds its size times the parameter's sensitivity to the innovations. The size with the best fit is
//! tested against the parameter's variance (generalized likelihood ratio: Willsky and Jones, IEEE TAC 21,
//! 1976). Adaptive noise could explain large innovations too, but not along this direction. A wrong level,
//! however, is a constant offset that is correlated with the acceleration by which a latency shows: for
//! latency an offset is estimated beside the jump.

use nalgebra::Vector2;

/// Sigmas of a jump, and least part of the excess of the squared innovations that it explains.
const SIGMAS: f64 = 5.0;
const EXPLAINED: f64 = 0.5;

/// Settings of the test of one parameter.
#[derive(Debug)]
pub struct JumpTest {
    /// Averaging time of innovations and partials before the test, s.
    mean_s: f64,
    /// Memory, s.
    memory_s: f64,
    /// Least effective time of detection, s: outliers come in bursts, in any direction.
    pub least_time_s: f64,
    /// Whether a constant offset is estimated beside the jump.
    with_offset: bool,
    /// Whether rejected innovations count as well.
    pub uses_rejected: bool,
}

/// Azimuth: some manoeuvres.
pub const AZIMUTH: JumpTest = JumpTest {
    mean_s: 0.0,
    memory_s: 30.0,
    least_time_s: 3.0,
    with_offset: false,
    uses_rejected: true,
};
/// Latency, for longer: what hard braking does to sensors looks like one.
pub const LATENCY: JumpTest = JumpTest {
    least_time_s: 9.0,
    with_offset: true,
    ..AZIMUTH
};
/// Latency wrong from the start: walking shows it only modulo a step, but for turns and stops of a second
/// or two, which averaging brings out. Accepted fixes only: in so long a time an INS also follows a
/// receiver that is stuck.
pub const INITIAL_LATENCY: JumpTest = JumpTest {
    mean_s: 1.0,
    memory_s: 300.0,
    uses_rejected: false,
    ..LATENCY
};

/// Sums of the likelihood ratio.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Jump {
    /// Score and information of the size.
    score: f64,
    information: f64,
    /// Integral of the squared information rate.
    info_squares: f64,
    /// Normalized squared innovations beyond their expectation.
    excess: f64,
    /// Of the offset: information, score per component, and cross information with the jump.
    offset_weight: f64,
    offset: [f64; 2],
    shared: [f64; 2],
    /// Averaged innovation and partial.
    mean: [f64; 2],
    mean_partial: [f64; 2],
}

impl Jump {
    /// Adds an innovation of this variance per component, `seconds` (positive) after the last, with its
    /// partial `by`. An average tells less, as its smaller square does.
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

    /// Square of the size if a jump is detected beyond the parameter's `variance`; `inflation` is that of
    /// the innovations' variance by their correlation.
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

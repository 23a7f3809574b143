//! What an algorithm's answers are off by, as whole numbers: they come back from a file as they were.

use ins_core::Solution;
use ins_core::earth::wrap_pi;
use serde::{Deserialize, Serialize};

use super::answers::Answers;
use super::answers::Failure;
use super::budget::Case;
use super::flight::{Flown, World};

/// Moments that are kept of the part with GNSS, and of the part without.
const MOMENTS: usize = 60;

/// A quantity: what it is called, its unit, and how much of it one count is.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    pub name: &'static str,
    pub unit: &'static str,
    pub count: f64,
}

const fn quantity(name: &'static str, unit: &'static str, count: f64) -> Quantity {
    Quantity { name, unit, count }
}

/// In the order of [`Errors`].
pub const QUANTITIES: [Quantity; 6] = [
    quantity("level position", "m", 1e-3),
    quantity("height", "m", 1e-3),
    quantity("level velocity", "m/s", 1e-4),
    quantity("vertical velocity", "m/s", 1e-4),
    quantity("roll and pitch", "deg", 1e-5),
    quantity("heading", "deg", 1e-5),
];
pub const POSITION: usize = 0;
pub const HEADING: usize = 5;

/// Sizes of the errors at one moment, in counts.
pub type Errors = [u64; QUANTITIES.len()];

/// What came of one flight with one algorithm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// At each moment; none without a solution. Empty if it failed.
    pub errors: Vec<Option<Errors>>,
    /// Why there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failure>,
    /// Time that it took, ms.
    pub took_ms: u64,
}

/// A finished flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// With what errors.
    pub case: Case,
    /// Which.
    pub flight: u32,
    /// In the order of the algorithms; empty if it could not be flown.
    pub outcomes: Vec<Outcome>,
    /// Why not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// Some of `count` in a row, evenly, the last one among them.
fn evenly(count: usize) -> impl Iterator<Item = usize> {
    let kept = count.min(MOMENTS);
    (1..=kept).map(move |moment| (moment * count).div_ceil(kept) - 1)
}

/// The moments that are kept: which of [`Flown::asks`], and whether it is without GNSS.
pub fn moments(world: &World) -> Vec<(usize, bool)> {
    // Of a flight: nothing is cut off but the fraction.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let [aided, all] = [world.aided_s(), world.duration_s].map(|seconds| seconds as usize);
    let aided_ones = evenly(aided).map(|at| (at, false));
    let free_ones = evenly(all - aided).map(|at| (aided + at, true));
    aided_ones.chain(free_ones).collect()
}

impl Outcome {
    /// Compares answers with the truth.
    pub fn new(answers: Answers, flown: &Flown, moments: &[(usize, bool)]) -> Self {
        let took_ms = u64::try_from(answers.took.as_millis()).unwrap_or(u64::MAX);
        let (errors, failure) = match answers.solutions {
            Ok(solutions) => {
                let at = |&(ask, _): &(usize, bool)| {
                    let solution = solutions.get(ask)?.as_ref()?;
                    Some(errors(solution, flown.asks().get(ask)?))
                };
                (moments.iter().map(at).collect(), None)
            }
            Err(failure) => (Vec::new(), Some(failure)),
        };
        Self {
            errors,
            failure,
            took_ms,
        }
    }
}

fn errors(solution: &Solution, truth: &Solution) -> Errors {
    let sizes = sizes(solution, truth);
    // Positive; what is beyond all counts stays the greatest.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    core::array::from_fn(|which| (sizes[which].abs() / QUANTITIES[which].count).round() as u64)
}

/// What a solution is off by, in the order and the units of [`QUANTITIES`].
pub fn sizes(solution: &Solution, truth: &Solution) -> [f64; QUANTITIES.len()] {
    let velocity = solution.velocity_enu_mps - truth.velocity_enu_mps;
    // Where the last sample is missing, the solution is that of the one before.
    let since_s = truth.time.seconds_since(solution.time);
    let moved = since_s * solution.velocity_enu_mps;
    let position = solution.position.enu_from(&truth.position) + moved;
    let up = |of: &Solution| of.attitude.inverse() * nalgebra::Vector3::z();
    let turned = wrap_pi(solution.euler().heading_rad - truth.euler().heading_rad);
    [
        position.xy().norm(),
        position.z,
        velocity.xy().norm(),
        velocity.z,
        (up(solution) - up(truth)).norm().to_degrees(),
        turned.to_degrees(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_moment_is_always_kept() {
        for count in [1, 59, 60, 61, 300, 3601] {
            let kept: Vec<usize> = evenly(count).collect();
            assert_eq!(kept.len(), count.min(MOMENTS));
            assert_eq!(kept.last(), Some(&(count - 1)));
            assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        }
        assert_eq!(evenly(0).count(), 0);
    }
}

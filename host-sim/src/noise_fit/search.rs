//! The maximum of a smooth function of some logarithms within bounds.

use rayon::prelude::*;

/// First step to either side, and the last: a factor of two, and a tenth.
const FIRST_STEP: f64 = core::f64::consts::LN_2;
const LAST_STEP: f64 = 0.1;
/// Rounds after which it is good enough.
const ROUNDS: usize = 25;
/// A gain that no longer counts: what chance makes of one parameter.
const LEAST_GAIN: f64 = 0.5;

/// A maximum.
#[derive(Clone, Debug, PartialEq)]
pub struct Maximum {
    /// Where.
    pub at: Vec<f64>,
    /// How high.
    pub value: f64,
    /// One sigma of each number if the function is a log-likelihood, the others held; infinite
    /// where it does not fall off to both sides.
    pub sigma: Vec<f64>,
}

/// Searches from a start, all numbers at once: each goes to the top of the parabola through its
/// neighbours, or a whole step to where it rises; the moves are taken together, or half of each,
/// or the best alone, whichever is highest. Where none is higher the step is halved.
pub fn maximum(
    start: &[f64],
    bounds: &[[f64; 2]],
    function: impl Fn(&[f64]) -> f64 + Sync,
) -> Maximum {
    let within = |mut at: Vec<f64>| {
        for (value, [least, most]) in at.iter_mut().zip(bounds) {
            *value = value.clamp(*least, *most);
        }
        at
    };
    let mut at = within(start.to_vec());
    let mut value = function(&at);
    let mut step = FIRST_STEP;
    let mut sigma = vec![f64::INFINITY; at.len()];
    for _ in 0..ROUNDS {
        let sides = sides(&at, step, &within, &function);
        let moves: Vec<Move> = sides.iter().map(|side| side.top(value, step)).collect();
        sigma = moves.iter().map(|to| to.sigma).collect();
        let by = |part: f64| moves.iter().map(|to| part * to.by).collect::<Vec<f64>>();
        let trials: Vec<Vec<f64>> = [by(1.0), by(0.5), best_alone(&moves)]
            .into_iter()
            .map(|by| within(at.iter().zip(by).map(|(at, by)| at + by).collect()))
            .collect();
        let values: Vec<f64> = trials.par_iter().map(|trial| function(trial)).collect();
        let best = (0..trials.len()).fold(0, |a, b| if values[b] > values[a] { b } else { a });
        let gain = values[best] - value;
        if gain > 0.0 {
            at.clone_from(&trials[best]);
            value = values[best];
        }
        if gain < LEAST_GAIN || moves.iter().all(|to| to.by.abs() < 0.5 * step) {
            step *= 0.5;
        }
        if step < LAST_STEP {
            break;
        }
    }
    Maximum { at, value, sigma }
}

/// The function a step below and above in one number.
struct Sides {
    below: f64,
    above: f64,
}

/// Where one number should go.
struct Move {
    by: f64,
    gain: f64,
    sigma: f64,
}

fn sides(
    at: &[f64],
    step: f64,
    within: &(impl Fn(Vec<f64>) -> Vec<f64> + Sync),
    function: &(impl Fn(&[f64]) -> f64 + Sync),
) -> Vec<Sides> {
    let values: Vec<f64> = (0..2 * at.len())
        .into_par_iter()
        .map(|which| {
            let mut to = at.to_vec();
            to[which / 2] += if which % 2 == 0 { -step } else { step };
            function(&within(to))
        })
        .collect();
    let pairs = values.chunks_exact(2);
    pairs
        .map(|pair| Sides {
            below: pair[0],
            above: pair[1],
        })
        .collect()
}

impl Sides {
    fn top(&self, here: f64, step: f64) -> Move {
        let curvature = (self.above + self.below - 2.0 * here) / (step * step);
        let slope = 0.5 * (self.above - self.below) / step;
        let uphill = if self.above > self.below { step } else { -step };
        let by = if curvature < 0.0 {
            (-slope / curvature).clamp(-step, step)
        } else {
            uphill
        };
        Move {
            by,
            gain: slope * by + 0.5 * curvature * by * by,
            sigma: if curvature < 0.0 {
                (-1.0 / curvature).sqrt()
            } else {
                f64::INFINITY
            },
        }
    }
}

/// Only the number that gains most.
fn best_alone(moves: &[Move]) -> Vec<f64> {
    let best = (0..moves.len()).fold(0, |a, b| if moves[b].gain > moves[a].gain { b } else { a });
    let alone = |(which, to): (usize, &Move)| if which == best { to.by } else { 0.0 };
    moves.iter().enumerate().map(alone).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_top_of_a_slanting_hill_within_bounds() {
        // Two numbers that hang together, and a third whose top lies out of bounds.
        let hill = |x: &[f64]| {
            let (a, b, c) = (x[0] - 1.0, x[1] + 2.0, x[2] - 5.0);
            -50.0 * (a * a + b * b + 1.6 * a * b) - 8.0 * c * c
        };
        let found = maximum(
            &[0.0, 0.0, 0.0],
            &[[-3.0, 3.0], [-3.0, 3.0], [-1.0, 1.5]],
            hill,
        );
        assert!((found.at[0] - 1.0).abs() < 0.02, "{found:?}");
        assert!((found.at[1] + 2.0).abs() < 0.02, "{found:?}");
        assert!((found.at[2] - 1.5).abs() < 1e-12, "{found:?}");
        // The others held: 1 / sqrt(100).
        assert!((found.sigma[0] - 0.1).abs() < 1e-3, "{found:?}");
    }
}

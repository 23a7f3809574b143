//! What many values say together.

/// Root of the mean of squares; not a number of none.
pub fn root_mean(squares: impl Iterator<Item = f64>) -> f64 {
    let add = |(sum, count), square| (sum + square, count + 1.0);
    let (sum, count): (f64, f64) = squares.fold((0.0, 0.0), add);
    (sum / count).sqrt()
}

/// Root mean square; not a number of none.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    root_mean(values.map(|value| value * value))
}

/// Root mean square, if there are any.
pub(crate) fn rms_of_any(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values = values.peekable();
    values.peek()?;
    Some(rms(values))
}

/// Geometric mean, if there are any.
pub(crate) fn geometric_mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let add = |(sum, count), value| (sum + libm::log(value), count + 1.0);
    let (sum, count): (f64, f64) = values.fold((0.0, 0.0), add);
    (count > 0.0).then(|| libm::exp(sum / count))
}

/// The middle one, or the mean of both; not a number of none.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        count => 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]),
    }
}

/// Mean, and variance about it, of a distribution of which some values are known; none of fewer than two.
pub(crate) fn mean_and_variance(values: &[f64]) -> Option<(f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (values.len() > 1).then(|| (mean, squares / (count - 1.0)))
}

/// A count, or a place among some, from a number that is not negative: nothing is cut off but the fraction.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub(crate) fn whole(number: f64) -> usize {
    number as usize
}

/// The straight line through pairs, by least squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) slope: f64,
    /// How well it fits; not a number where nothing varies.
    pub(crate) correlation: f64,
}

impl Line {
    pub(crate) fn through(pairs: &[(f64, f64)]) -> Self {
        let n = pairs.len() as f64;
        let mean = |of: &dyn Fn(f64, f64) -> f64| {
            let sum: f64 = pairs.iter().map(|(x, y)| of(*x, *y)).sum();
            sum / n
        };
        let (x0, y0) = (mean(&|x, _| x), mean(&|_, y| y));
        let xx = mean(&|x, _| (x - x0) * (x - x0));
        let xy = mean(&|x, y| (x - x0) * (y - y0));
        let yy = mean(&|_, y| (y - y0) * (y - y0));
        Self {
            slope: xy / xx,
            correlation: xy / (xx * yy).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_values() {
        let values = || [4.0, 1.0, 8.0].into_iter();
        assert!((rms(values()) - 27.0_f64.sqrt()).abs() < 1e-12);
        let medians = [median(values()), median([1.0, 2.0].into_iter())];
        assert!((medians[0] - 4.0).abs() + (medians[1] - 1.5).abs() < 1e-12);
        let mean = geometric_mean([0.5, 2.0].into_iter());
        assert!((mean.unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_not_known() {
        let none = std::iter::empty::<f64>;
        assert!(rms(none()).is_nan() && median(none()).is_nan());
        assert_eq!((rms_of_any(none()), geometric_mean(none())), (None, None));
    }
}

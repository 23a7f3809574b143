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
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
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

/// A straight line by least squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) slope: f64,
    /// How well it fits; not a number where nothing varies.
    pub(crate) correlation: f64,
    /// A point of it.
    middle: (f64, f64),
}

impl Line {
    pub(crate) fn through(pairs: &[(f64, f64)]) -> Self {
        let n = pairs.len() as f64;
        let sum = pairs
            .iter()
            .fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x, sum.1 + y));
        let middle = (sum.0 / n, sum.1 / n);
        let about = pairs.iter().map(|(x, y)| (x - middle.0, y - middle.1));
        Self {
            middle,
            ..Self::from_origin(about)
        }
    }

    /// Held at the origin.
    pub(crate) fn from_origin(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        let add = |(xx, xy, yy), (x, y)| (xx + x * x, xy + x * y, yy + y * y);
        let (xx, xy, yy): (f64, f64, f64) = pairs.fold((0.0, 0.0, 0.0), add);
        Self {
            slope: xy / xx,
            correlation: xy / (xx * yy).sqrt(),
            middle: (0.0, 0.0),
        }
    }

    pub(crate) fn at(&self, x: f64) -> f64 {
        self.middle.1 + self.slope * (x - self.middle.0)
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

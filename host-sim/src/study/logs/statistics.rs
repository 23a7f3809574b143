//! Differences in units of what they should be, and summaries of many.

use serde::Serialize;

use crate::identify::halves::Difference;
use crate::statistics::rms_of_any;

/// Many differences together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Root mean square, sigmas; honest ones have 1.
    pub rms: Option<f64>,
    /// The same as found and as stated, without allowances.
    pub rms_plain: Option<f64>,
    /// Beyond three sigmas.
    pub beyond_3: usize,
    /// Beyond four.
    pub beyond_4: usize,
}

impl Spread {
    /// Of any number of differences.
    #[allow(clippy::needless_pass_by_value)] // An iterator, gone through twice.
    pub fn of<'a>(differences: impl Iterator<Item = &'a Difference> + Clone) -> Self {
        let beyond = |limit: f64| {
            let wide = |d: &&Difference| d.sigmas.abs() > limit;
            differences.clone().filter(wide).count()
        };
        Self {
            count: differences.clone().count(),
            rms: rms_of_any(differences.clone().map(|d| d.sigmas)),
            rms_plain: rms_of_any(differences.clone().map(|d| d.plain_sigmas)),
            beyond_3: beyond(3.0),
            beyond_4: beyond(4.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_allowance_widens_what_a_difference_may_be() {
        let plain = Difference::new("x", 5.0, [0.6, 0.8], 0.0);
        let allowed = Difference::new("x", 5.0, [0.6, 0.8], libm::sqrt(3.0));
        assert!((plain.sigmas - 5.0).abs() < 1e-12 && (allowed.sigmas - 2.5).abs() < 1e-12);
        let spread = Spread::of([plain, allowed].iter());
        assert_eq!((spread.count, spread.beyond_3, spread.beyond_4), (2, 1, 1));
        assert!((spread.rms_plain.unwrap() - 5.0).abs() < 1e-12);
        assert_eq!(Spread::of([].iter()).rms, None);
    }
}

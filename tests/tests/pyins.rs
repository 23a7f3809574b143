//! Our Kalman filter against that of `python-ins`, on the same log with the same noise parameters.

use ins_tests::pyins::{NAMES, both};
use ins_tests::python::require_in_ci;

/// Both are the same estimator to first order: they differ in the integration of the error equations over a step, and
/// in second-order terms of heading and tilt, some hundredths of their sigmas while the heading is only known to
/// degrees. Measured: 0.07.
const DIFFERENCE_SIGMAS: f64 = 0.1;
/// Ours reduces the weight of an improbable fix: the difference is larger just after one, at 240 s, but not a minute
/// later. Measured: 0.5, in 7 of 120 values.
const LARGEST_DIFFERENCE_SIGMAS: f64 = 0.7;
/// Sigmas do not depend on the drawn noise, only on the equations. Measured: 0.007.
const SIGMA_RATIO: f64 = 0.01;

#[test]
fn estimates_and_sigmas_are_those_of_python_ins() {
    let Some(rows) = require_in_ci("python-ins", both()) else {
        return;
    };
    let (mut deviating, mut count) = (Vec::new(), 0);
    for (mine, its) in rows {
        let difference = mine.minus(&its).component_div(&its.sigma);
        let ratio = mine.sigma.component_div(&its.sigma);
        for (which, name) in NAMES.iter().enumerate() {
            let (difference, ratio) = (difference[which], ratio[which]);
            let row = format!(
                "{} s, {name}: {difference:+.4} sigma difference, sigma ratio {ratio:.4}",
                mine.time_s
            );
            println!("{row}");
            count += 1;
            assert!(difference.abs() < LARGEST_DIFFERENCE_SIGMAS, "{row}");
            if difference.abs() >= DIFFERENCE_SIGMAS || (ratio - 1.0).abs() >= SIGMA_RATIO {
                deviating.push(row);
            }
        }
    }
    assert!(deviating.len() * 15 <= count, "{deviating:#?}");
}

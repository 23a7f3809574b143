//! Our Kalman filter against that of `python-ins`, on the same log and told the same noise.

use ins_tests::pyins::{NAMES, both};
use ins_tests::python::answer;

/// Both are the same estimator to first order: what remains is how each integrates the error
/// equations over a step, and terms of second order in heading and tilt, some hundredths of their
/// own spread while the heading is still known to degrees only. Measured: 0.07.
const APART_SIGMAS: f64 = 0.1;
/// Ours gives an improbable fix less weight; just after one, at 240 s, they are further apart, and
/// a minute later no more. Measured: 0.5, in 7 of 120 values.
const AFTER_ONE_SIGMAS: f64 = 0.7;
/// Spreads do not depend on the noise drawn, only on the equations. Measured: 0.007.
const SIGMA_RATIO: f64 = 0.01;

#[test]
fn estimates_and_sigmas_are_those_of_python_ins() {
    let Some(rows) = answer("python-ins", both()) else {
        return;
    };
    let (mut off, mut count) = (Vec::new(), 0);
    for (mine, its) in rows {
        let apart = mine.minus(&its).component_div(&its.sigma);
        let ratio = mine.sigma.component_div(&its.sigma);
        for (which, name) in NAMES.iter().enumerate() {
            let (apart, ratio) = (apart[which], ratio[which]);
            let row = format!(
                "{} s, {name}: {apart:+.4} sigma apart, sigmas {ratio:.4}",
                mine.time_s
            );
            println!("{row}");
            count += 1;
            assert!(apart.abs() < AFTER_ONE_SIGMAS, "{row}");
            if apart.abs() >= APART_SIGMAS || (ratio - 1.0).abs() >= SIGMA_RATIO {
                off.push(row);
            }
        }
    }
    assert!(off.len() * 15 <= count, "{off:#?}");
}

//! Whether the heights of a barometer are those of the log.

use std::path::Path;

use super::Log;
use super::error::LogError;
use super::order::of_another_time;
use super::typical::{likeliest, within};
use crate::statistics::{Line, rms};

/// Noise of a barometer in a box, where nothing says how large it is, m.
pub(super) const SIGMA_M: f64 = 0.3;
/// Spread of the receiver's heights above which they tell what a barometer counts in, m: some times their
/// noise.
const HILLS_M: f64 = 10.0;
/// Factor by which a barometer may climb more or less than the receiver, which errs, too.
const ALIKE: f64 = 1.5;
/// How well the two must follow each other for that, and in how many fixes at least.
const CORRELATED: f64 = 0.9;
const MANY: usize = 30;

/// Leaves out heights that are not what the rest of the log shows, and says why.
pub(super) fn check(log: &mut Log, path: &Path, warnings: &mut Vec<LogError>) {
    let ends = [log.baro.first(), log.baro.last()].map(|end| end.map(|height| height.time));
    let wrong = of_another_time(path, "a barometer", ends, log).or_else(|| {
        let (slope, unit) = of_another_unit(log)?;
        let expected = "heights that change as those of the receiver do";
        let found = format!("{slope:.3} times as much");
        let cause = format!("{unit}: not used");
        Some(LogError::file(path, expected, found, cause).in_column("h_m"))
    });
    if let Some(wrong) = wrong {
        log.baro.clear();
        warnings.push(wrong);
    }
}

/// How many times as much as the receiver a barometer shows, and what that means; none where it is right,
/// or nobody can tell.
fn of_another_unit(log: &Log) -> Option<(f64, String)> {
    let pairs: Vec<(f64, f64)> = (log.gnss.iter())
        .filter_map(|fix| {
            let next = log.baro.partition_point(|height| height.time < fix.time);
            let beside = log
                .baro
                .get(next)
                .filter(|height| height.time.seconds_since(fix.time) < 1.0)?;
            Some((fix.height_m?, beside.height_m))
        })
        .collect();
    let mean = pairs.iter().map(|(height_m, _)| height_m).sum::<f64>() / pairs.len() as f64;
    let hilly =
        pairs.len() >= MANY && rms(pairs.iter().map(|(height_m, _)| height_m - mean)) > HILLS_M;
    let line = Line::through(&pairs);
    if !hilly || within(line.slope, 1.0, ALIKE) || line.correlation.abs() < CORRELATED {
        return None;
    }
    let metres = |unit: &str| format!("{unit} for metres");
    let pressure =
        |unit: &str| format!("pressure in {unit}: write the height of a standard atmosphere");
    let units = [
        (3.281, metres("feet")),
        (100.0, metres("centimetres")),
        (1000.0, metres("millimetres")),
        (0.001, metres("kilometres")),
    ];
    let fallen = [
        (1.0, "down positive".to_owned()),
        (0.12, pressure("hPa")),
        (12.0, pressure("Pa")),
        (0.012, pressure("kPa")),
    ];
    let known = if line.slope > 0.0 { units } else { fallen };
    let unit = likeliest(known, line.slope.abs(), ALIKE);
    let unknown = || "another unit, or of another drive".to_owned();
    Some((line.slope, unit.unwrap_or_else(unknown)))
}

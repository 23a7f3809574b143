//! Time scale and unit of barometer heights against the rest of the log.

use std::path::Path;

use super::Log;
use super::error::LogError;
use super::order::outside_samples;
use super::series::{nearest_known, within};
use crate::statistics::{Line, rms};

/// Sigma of a barometer in an enclosure, where none is stated, m.
pub(super) const SIGMA_M: f64 = 0.3;
/// Least standard deviation of the receiver's heights that determines the barometer's unit, m: some times
/// their noise.
const MIN_HEIGHT_SIGMA_M: f64 = 10.0;
/// Ratio of the height changes of barometer and receiver, or its inverse, that is no other unit.
const SCALE_TOLERANCE: f64 = 1.5;
/// Least correlation of the two heights, and least number of fixes, to judge the unit.
const MIN_CORRELATION: f64 = 0.9;
const MIN_FIXES: usize = 30;

/// Leaves out heights that contradict the rest of the log, with a warning.
pub(super) fn check(log: &mut Log, path: &Path, warnings: &mut Vec<LogError>) {
    let outside = outside_samples(path, "a barometer", &log.baro, |height| height.time, log);
    let wrong = outside.or_else(|| {
        let (slope, unit) = wrong_unit(log)?;
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

/// Ratio of the height changes of barometer and receiver, and its cause; none where it is right or cannot be
/// judged.
fn wrong_unit(log: &Log) -> Option<(f64, String)> {
    let pairs: Vec<(f64, f64)> = (log.gnss.iter())
        .filter_map(|fix| {
            let next = log.baro.partition_point(|height| height.time < fix.time);
            let baro = log
                .baro
                .get(next)
                .filter(|height| height.time.seconds_since(fix.time) < 1.0)?;
            Some((fix.height_m?, baro.height_m))
        })
        .collect();
    let mean = pairs.iter().map(|(height_m, _)| height_m).sum::<f64>() / pairs.len() as f64;
    let hilly = pairs.len() >= MIN_FIXES
        && rms(pairs.iter().map(|(height_m, _)| height_m - mean)) > MIN_HEIGHT_SIGMA_M;
    let line = Line::through(&pairs);
    if !hilly
        || within(line.slope, 1.0, SCALE_TOLERANCE)
        || line.correlation.abs() < MIN_CORRELATION
    {
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
    let inverted = [
        (1.0, "down positive".to_owned()),
        (0.12, pressure("hPa")),
        (12.0, pressure("Pa")),
        (0.012, pressure("kPa")),
    ];
    let known = if line.slope > 0.0 { units } else { inverted };
    let unit = nearest_known(known, line.slope.abs(), SCALE_TOLERANCE);
    let unknown = || "another unit, or of another drive".to_owned();
    Some((line.slope, unit.unwrap_or_else(unknown)))
}

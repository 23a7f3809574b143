//! Validation on recorded drives: a model identified from some predicts the drift without GNSS on others.
//!
//! The motion of each other drive is simulated with errors of the model, seed by seed, and the core
//! is run over both, the recorded and the simulated. Outages are placed throughout; drift is measured
//! against the same core with GNSS, in both.

use ins_core::{Config, ConfigError, GnssFix, ImuSample, Navigator, Phase, Solution, Time};
use miette::Result;
use rayon::prelude::*;
use serde::Serialize;

use super::output::shown;
use super::replay::Replay;
use super::run::{HEADING, POSITION, QUANTITIES, solution_errors};
use crate::compare::outage::{FIX_AGE_S, SETTLE_S, STRIDE_S};
use crate::identify::analysis::{Analysis, unusable};
use crate::identify::error_model::interval::student;
use crate::identify::free_inertial::known;
use crate::identify::run::{Event, Settling, in_order_of_time};
use crate::log::Log;
use crate::page::table::{Table, cells, heads};
use crate::sim::drive::Recording;
use crate::sim::{ErrorModel, record};
use crate::statistics::{mean_and_variance, rms};

/// Times since the start of the outage, s.
const HORIZONS_S: [f64; 3] = [10.0, 30.0, 60.0];
/// A drive whose first fix is slower than this begins at rest, m/s.
const REST_SPEED_MPS: f64 = 0.5;
/// Quantities that are predicted: horizontal position and velocity, roll and pitch, heading.
const PREDICTED: [usize; 4] = [POSITION, 2, 4, HEADING];
/// Goal of the ratio predicted over observed.
const GOAL: [f64; 2] = [0.8, 1.25];

/// One quantity on one drive after one time.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub log: String,
    pub without_gnss_s: f64,
    pub quantity: &'static str,
    pub unit: &'static str,
    /// Outages on the recorded drive.
    pub outages: usize,
    /// RMS over these.
    pub observed: f64,
    /// RMS over all simulations.
    pub predicted: f64,
    pub ratio: f64,
    /// Interval of it over 95 % of drives for which the model is true.
    pub ratio_95: [f64; 2],
}

/// Errors of one outage at each horizon; none after the end of the log.
type Drift = [Option<[f64; QUANTITIES.len()]>; HORIZONS_S.len()];

/// Predicted and observed drift of a drive; empty if it never navigates, or if no outage fits in it or in its
/// simulations.
pub fn compare_drift(analysis: &Analysis, model: &ErrorModel, seeds: u64) -> Result<Vec<Row>> {
    let (log, name) = (&analysis.log, &analysis.summary.log);
    let config = analysis.found.config;
    let imu = log.imu.all();
    let of_log = |azimuth_known| drifts(&imu, &log.gnss, config, azimuth_known).map_err(unusable);
    let mut observed = of_log(true)?;
    let azimuth_known = !observed.is_empty();
    if !azimuth_known {
        observed = of_log(false)?;
    }
    let mut errors = model.clone();
    errors.gnss.rate_hz = log.fix_rate_hz();
    let imu_hz = log.imu_rate_hz();
    let solutions = &analysis.found.solutions;
    let before_s = rest_before_s(log, solutions);
    let (Some(replay), Some(first)) = (Replay::new(solutions, before_s), solutions.get(1)) else {
        return Ok(Vec::new());
    };
    let simulated: Vec<Vec<Drift>> = (0..seeds)
        .into_par_iter()
        .map(|seed| {
            let recording = Recording {
                seed,
                duration_s: replay.duration_s(),
                imu_hz,
                truth_every: 10,
                origin: first.position,
                errors: errors.clone(),
            };
            let run = record(replay.clone(), &recording);
            drifts(&run.imu, &run.gnss, config, azimuth_known)
        })
        .collect::<Result<_, ConfigError>>()
        .map_err(unusable)?;
    let mut rows = Vec::new();
    for (horizon, &without_gnss_s) in HORIZONS_S.iter().enumerate() {
        for quantity in PREDICTED {
            let values = |drifts: &[Drift]| -> Vec<f64> {
                let at = drifts.iter().filter_map(|drift| drift[horizon]);
                at.map(|errors| errors[quantity].abs()).collect()
            };
            let seen = values(&observed);
            let each: Vec<Vec<f64>> = simulated.iter().map(|drifts| values(drifts)).collect();
            if let Some((predicted, within)) = predicted_drift(&each)
                && !seen.is_empty()
            {
                let observed = rms(seen.iter().copied());
                let ratio = predicted / observed;
                rows.push(Row {
                    log: name.clone(),
                    without_gnss_s,
                    quantity: QUANTITIES[quantity].name,
                    unit: QUANTITIES[quantity].unit,
                    outages: seen.len(),
                    observed,
                    predicted,
                    ratio,
                    ratio_95: within.map(|bound| ratio * libm::exp(bound)),
                });
            }
        }
    }
    Ok(rows)
}

/// Time from the start of a drive that begins at rest to its first solution, s.
fn rest_before_s(log: &Log, solutions: &[Solution]) -> f64 {
    let stood = (log.gnss.first()).is_some_and(|fix| fix.speed_mps() < REST_SPEED_MPS);
    match (log.imu.first(), solutions.first()) {
        (Some(sample), Some(first)) if stood => first.time.seconds_since(sample.time),
        _ => 0.0,
    }
}

/// RMS over simulations, and the 95 % interval of the logarithm of a drive's RMS over it; none of fewer than
/// two with outages.
fn predicted_drift(simulated: &[Vec<f64>]) -> Option<(f64, [f64; 2])> {
    let each: Vec<f64> = (simulated.iter())
        .filter(|values| !values.is_empty())
        .map(|values| rms(values.iter().copied()))
        .collect();
    let predicted = rms(each.iter().copied());
    let logarithms: Vec<f64> = each.iter().map(|one| libm::log(one / predicted)).collect();
    // The mean is below zero, since an RMS is dominated by the large ones.
    let (middle, variance) = mean_and_variance(&logarithms)?;
    let count = logarithms.len() as f64;
    // Prediction interval of one more drive.
    let half = student(count - 1.0) * (variance * (1.0 + 1.0 / count)).sqrt();
    Some((predicted, [middle - half, middle + half]))
}

/// Drift of the core in outages throughout a drive, once it has settled and, unless it never does, knows
/// its azimuth.
fn drifts(
    imu: &[ImuSample],
    gnss: &[GnssFix],
    config: Config,
    azimuth_known: bool,
) -> Result<Vec<Drift>, ConfigError> {
    let mut navigator = Navigator::new(config)?;
    let (mut aided, mut unaided): (Vec<Solution>, Vec<[Option<Solution>; 3]>) = Default::default();
    let (mut settling, mut last_fix, mut next) = (Settling::default(), None, None::<Time>);
    let mut samples = 0;
    for event in in_order_of_time(imu, gnss) {
        if let Event::Gnss(fix) = event {
            last_fix = fix.velocity_en_mps.map(|_| fix.time).or(last_fix);
        }
        let Some(sample) = event.give_to(&mut navigator) else {
            continue;
        };
        samples += 1;
        let navigates = navigator.phase() == Phase::Navigating;
        if navigates {
            aided.extend(navigator.solution());
        }
        let is_azimuth_known = || !azimuth_known || known(&navigator.estimates().azimuth_error_rad);
        let settled = settling.at(sample.time, navigates, SETTLE_S, is_azimuth_known)
            && is_azimuth_known()
            && last_fix.is_some_and(|fix| sample.time.seconds_since(fix) < FIX_AGE_S);
        if settled && next.is_none_or(|next| sample.time >= next) {
            unaided.push(free(navigator.clone(), &imu[samples..], sample.time));
            next = Some(sample.time.plus_seconds(STRIDE_S));
        }
    }
    let against = |free: &Solution| {
        let at = aided.binary_search_by_key(&free.time, |solution| solution.time);
        at.ok().map(|at| solution_errors(free, &aided[at]))
    };
    let drift = |ends: &[Option<Solution>; 3]| ends.map(|end| end.as_ref().and_then(against));
    Ok(unaided.iter().map(drift).collect())
}

/// Solution without GNSS at each horizon.
fn free(mut ins: Navigator, imu: &[ImuSample], start: Time) -> [Option<Solution>; 3] {
    let mut ends = [None; 3];
    let mut reached = 0;
    for sample in imu {
        let _ = ins.on_imu(sample);
        while reached < 3 && sample.time.seconds_since(start) >= HORIZONS_S[reached] {
            ends[reached] = ins.solution();
            reached += 1;
        }
        if reached == 3 {
            break;
        }
    }
    ends
}

/// A row for each drive and time: predicted over observed, and its interval over 95 % of drives.
pub fn overview(rows: &[Row]) -> Table {
    let mut header = cells(["drive", "without GNSS, s", "outages"]);
    header.extend(PREDICTED.map(|quantity| QUANTITIES[quantity].name.to_owned()));
    let of_one = |rows: &[Row]| {
        let mut cells = vec![
            rows[0].log.clone(),
            rows[0].without_gnss_s.to_string(),
            rows[0].outages.to_string(),
        ];
        let ratio = |row: &Row| {
            let [low, high] = row.ratio_95;
            format!("{:.2} ({low:.2} to {high:.2})", row.ratio)
        };
        cells.extend(rows.iter().map(ratio));
        cells
    };
    let all = rows.chunks(PREDICTED.len()).map(of_one);
    Table::of("Predicted over observed drift", header, all)
}

pub(crate) fn readable(rows: &[Row]) -> String {
    let header = heads("| without GNSS, s | | outages | observed | predicted | ratio | 95 %");
    let row = |row: &Row| {
        vec![
            row.log.clone(),
            row.without_gnss_s.to_string(),
            format!("{}, {}", row.quantity, row.unit),
            row.outages.to_string(),
            shown(row.observed),
            shown(row.predicted),
            format!("{:.2}", row.ratio),
            format!("{:.2} to {:.2}", row.ratio_95[0], row.ratio_95[1]),
        ]
    };
    let table = Table::of("", header, rows.iter().map(row));
    format!("{}\n{}\n", table.plain(), verdict(rows))
}

/// How many ratios reach the goal, and how many intervals contain one.
pub fn verdict(rows: &[Row]) -> String {
    let good = |row: &&Row| (GOAL[0]..=GOAL[1]).contains(&row.ratio);
    let honest = |row: &&Row| row.ratio_95[0] <= 1.0 && row.ratio_95[1] >= 1.0;
    format!(
        "{} of {} ratios lie within {} to {}; the 95 % intervals of {} contain 1.",
        rows.iter().filter(good).count(),
        rows.len(),
        GOAL[0],
        GOAL[1],
        rows.iter().filter(honest).count(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drifts that scatter about one have an RMS above it: the interval is about the drifts.
    #[test]
    fn the_range_lies_about_the_drives_and_not_about_their_rms() {
        let drives = [-1.0, 1.0].map(|logarithm| vec![libm::exp(logarithm)]);
        let (predicted, [low, high]) = predicted_drift(&drives).unwrap();
        let ends = [low, high].map(|bound| libm::log(predicted) + bound);
        assert!((predicted - libm::cosh(2.0).sqrt()).abs() < 1e-12);
        assert!((ends[0] + ends[1]).abs() < 1e-12, "{ends:?}");
    }
}

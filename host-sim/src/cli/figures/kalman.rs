//! Compensation beside a Kalman filter: accuracy over many drives, cost, and outages of recorded
//! logs.

use std::path::Path;

use ins_core::Config;
use miette::{Result, miette};

use super::logs;
use crate::compare::cost;
use crate::compare::kalman::Noise;
use crate::compare::outage;
use crate::identify::analysis::log_name;
use crate::identify::configure;
use crate::log::{self, BodyAxes, Log};
use crate::page::brief;
use crate::page::progress::bar;
use crate::page::table::{Table, heads};
use crate::sim::{DriveConfig, Grade, simulate};
use crate::study::accuracy::{Results, Study};

/// How wrong a user is taken to be.
const WRONG: f64 = 3.0;

/// A quantity has converged below so many times the error that a Kalman filter with known noise
/// ends with.
const CONVERGED: f64 = 2.0;

/// RMS errors with noise known and guessed, how soon they are reached, and the time of each in
/// one run.
pub(super) fn part(runs: u64) -> Result<String> {
    let studies = [
        compensation(runs, 1.0)?,
        kalman(runs, 1.0, true)?,
        kalman(runs, 1.0, false)?,
        kalman(runs, 1.0 / WRONG, true)?,
        kalman(runs, WRONG, true)?,
        compensation(runs, 1.0 / WRONG)?,
        compensation(runs, WRONG)?,
    ];
    let table = |head: &str, row: fn(&[Results; 7], usize) -> Vec<String>| {
        let mut header = heads(head);
        header.extend(heads(
            "compensation | Kalman | Kalman, velocity alone | Kalman, noise / 3 \
             | Kalman, noise x 3 | compensation, noise / 3 | compensation, noise x 3 \
             | compensation / Kalman",
        ));
        let rows = (0..studies[0].quantities.len()).map(|which| row(&studies, which));
        Table::of("", header, rows).markdown()
    };
    let [ours, theirs, ..] = &studies;
    Ok(format!(
        "{}\n{} drives of {} min; {} and {} converged.\n\n{}\n{}",
        table("RMS error", errors),
        runs,
        ours.study.minutes,
        ours.converged,
        theirs.converged,
        table("converged after, min", times),
        costs()?
    ))
}

fn errors(studies: &[Results; 7], which: usize) -> Vec<String> {
    let rows = studies.each_ref().map(|study| study.quantities[which]);
    let quantity = rows[0].quantity;
    let mut row = vec![quantity.head()];
    row.extend(rows.map(|row| brief(row.rms_error)));
    row.push(format!("{:.2}", rows[0].rms_error / rows[1].rms_error));
    row
}

/// Until errors are, and stay, as small as those of the best filter, or nearly so.
fn times(studies: &[Results; 7], which: usize) -> Vec<String> {
    let [_, limit, ..] = studies;
    let level = CONVERGED * limit.quantities[which].rms_error;
    let times = studies
        .each_ref()
        .map(|study| study.settled_s(which, level));
    let cell = |value: Option<f64>| value.map_or("never".to_owned(), |value| format!("{value:.1}"));
    let mut row = vec![limit.quantities[which].quantity.title.to_owned()];
    row.extend(times.map(|time| cell(time.map(|seconds| seconds / 60.0))));
    row.push(cell(
        times[0].zip(times[1]).map(|(ours, theirs)| ours / theirs),
    ));
    row
}

fn compensation(runs: u64, factor: f64) -> Result<Results> {
    let study = Study::new(Grade::Hg1700, runs);
    let guess = |config: &mut Config| {
        config.sensors.gyro_noise = config.sensors.gyro_noise.map(|noise| noise * factor);
        config.sensors.accel_noise = config.sensors.accel_noise.map(|noise| noise * factor);
    };
    driven(study, &guess)
}

fn kalman(runs: u64, factor: f64, positions: bool) -> Result<Results> {
    let study = Study {
        kalman_noise: Some(factor),
        kalman_positions: positions,
        ..Study::new(Grade::Hg1700, runs)
    };
    driven(study, &|_| {})
}

fn driven(study: Study, tune: &(dyn Fn(&mut Config) + Sync)) -> Result<Results> {
    let progress = bar().with_message("driving");
    progress.set_length(study.runs);
    let runs = study
        .drive(tune, &|| progress.inc(1))
        .map_err(|error| miette!("the study cannot be run: {}", error))?;
    Ok(Results::new(study, runs))
}

fn costs() -> Result<String> {
    let drive = simulate(&DriveConfig::new(0, Grade::Hg1700, 10.0));
    let log = Log {
        truth: Vec::new(),
        ..drive.into_log(BodyAxes::Rfu, Grade::Hg1700.errors().imu.output)
    };
    let config = configure::config(&log, Grade::Hg1700.class());
    let noise = Noise::of_model(&Grade::Hg1700.errors());
    let costs =
        cost::measure(&log, config, noise).map_err(|error| miette!("cannot be run: {}", error))?;
    let header = heads("sample with its share of fixes | ratio");
    let rows = costs
        .iter()
        .map(|cost| vec![cost.method.to_owned(), format!("{:.1}", cost.ratio)]);
    Ok(Table::of("", header, rows).markdown())
}

/// Drifts of every navigator in every recorded log; `None` if there are no logs, or no peer.
pub(super) fn outages(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    if cfg!(not(feature = "peers")) {
        eprintln!("outages: the table stays as it was (build with --features peers)");
        return Ok(None);
    }
    let mut rows = Vec::new();
    for path in logs::found(root, folder) {
        let (log, _) = log::read(&path)?;
        let config = configure::config(&log, configure::grade(&log, None));
        let test = outage::test(&log, false, config, Noise::of_config(&config))
            .map_err(|error| miette!("cannot be run: {}", error))?;
        let Some(test) = test else { continue };
        let mut row = vec![log_name(&path, &log), test.navigators[0].count.to_string()];
        for drifts in &test.navigators {
            let metres = [drifts.position_rms_m, drifts.position_max_m].map(brief);
            row.push(metres.join(" / "));
            row.push(brief(drifts.velocity_rms_mps));
        }
        rows.push(row);
    }
    let header =
        heads("log | outages | compensation, m | m/s | Kalman, m | m/s | fusion-nav, m | m/s");
    Ok((!rows.is_empty()).then(|| Table::of("", header, rows).markdown()))
}

//! Many seeded drives: errors of both forms and of a Kalman filter.

use std::path::Path;

use host_sim::compare::kalman::Noise;
use host_sim::compare::{Cost, measure_costs};
use host_sim::identify::configure;
use host_sim::log::{BodyAxes, Grade, Log};
use host_sim::page::brief;
use host_sim::page::table::{heads, markdown};
use host_sim::sim::errors::BiasModel;
use host_sim::sim::{DriveConfig, ErrorModel, simulate};
use host_sim::study::accuracy::{Results, Study, picture};
use indicatif::ProgressBar;
use ins_core::Config;
use ins_core::config::Form;
use ins_tests::pages;
use miette::{Result, miette};

/// Assumed factor of errors in the configured noise.
const NOISE_FACTOR: f64 = 3.0;

/// A quantity has converged if its error is below this times the final error of a Kalman filter with known
/// noise.
const CONVERGED: f64 = 2.0;

fn results(study: Study) -> Result<Results> {
    drive_results(study, &|_| {}, &|_| {})
}

/// With modified sensors and configuration.
fn drive_results(
    study: Study,
    modify: &(dyn Fn(&mut ErrorModel) + Sync),
    tune: &(dyn Fn(&mut Config) + Sync),
) -> Result<Results> {
    let runs = study
        .drive(modify, tune, &ProgressBar::new(study.runs))
        .map_err(|error| miette!("the study cannot be run: {}", error))?;
    Ok(Results::new(study, runs))
}

/// Ring-laser class, with the picture of RMS error and sigma over time.
pub fn hg1700(root: &Path, runs: u64) -> Result<String> {
    let results = results(Study::new(Grade::Hg1700, runs))?;
    pages::picture(root, "accuracy.svg", &picture(&results))?;
    Ok(markdown_of(&results))
}

/// Consumer MEMS.
pub fn mems(runs: u64) -> Result<String> {
    results(Study::new(Grade::Mems, runs)).map(|results| markdown_of(&results))
}

fn markdown_of(results: &Results) -> String {
    let study = &results.study;
    let mut table = results.table();
    if !study.has_limits() {
        // Limit and goal are the last columns.
        let rows = table.rows.iter_mut();
        rows.chain([&mut table.header])
            .for_each(|row| row.truncate(5));
    }
    format!(
        "{}\n{} drives of {} min; {} converged. With honest sigmas {:.0} +- {:.0} % of \
         the errors lie within one sigma (95 times out of 100).\n",
        table.markdown(),
        study.runs,
        study.minutes,
        results.converged,
        68,
        results.coverage_spread_percent(),
    )
}

/// Gyros without biases.
fn without_gyro_biases(errors: &mut ErrorModel) {
    errors.gyro_deg_h.bias = BiasModel::constant(0.0);
}

/// Also accelerometers without biases, and no latency.
fn without_biases(errors: &mut ErrorModel) {
    without_gyro_biases(errors);
    errors.accel_mps2.bias = BiasModel::constant(0.0);
    errors.gnss.latency_s = [0.0; 2];
}

/// Also a hundredth of the velocity noise.
fn without_velocity_noise(errors: &mut ErrorModel) {
    without_biases(errors);
    errors.gnss.velocity_sigma_mps *= 0.01;
}

/// RMS errors of both forms over the bandwidth of the horizontal loop.
pub fn forms(runs: u64) -> Result<String> {
    type Modify = fn(&mut ErrorModel);
    let forms: [(&str, Form, Modify, &[f64]); 5] = [
        ("exact", Form::Exact, |_| {}, &[0.15, 0.3, 0.5, 1.0, 1.2]),
        ("literal", Form::Literal, |_| {}, &[0.3, 0.5, 1.0]),
        (
            "literal, gyros without biases",
            Form::Literal,
            without_gyro_biases,
            &[0.5],
        ),
        (
            "... nor accelerometers, nor latency",
            Form::Literal,
            without_biases,
            &[0.5],
        ),
        (
            "... and a hundredth of the velocity noise",
            Form::Literal,
            without_velocity_noise,
            &[0.5],
        ),
    ];
    let mut rows = Vec::new();
    let mut header = heads("form | w0, rad/s | converged");
    for (name, form, modify, bandwidths) in forms {
        for bandwidth in bandwidths {
            let study = Study {
                form: Some(form),
                bandwidth_radps: Some(*bandwidth),
                ..Study::new(Grade::Hg1700, runs)
            };
            let results = drive_results(study, &modify, &|_| {})?;
            let of = format!("{} of {runs}", results.converged);
            let mut row = vec![name.to_owned(), bandwidth.to_string(), of];
            row.extend((results.quantities.iter()).map(|row| brief(row.rms_error)));
            rows.push(row);
            if header.len() < rows[0].len() {
                header.extend(results.quantities.iter().map(|row| row.quantity.head()));
            }
        }
    }
    Ok(markdown(&header, &rows))
}

/// RMS errors with known and wrongly configured noise, convergence times, and computing times.
pub fn kalman(runs: u64) -> Result<String> {
    let studies = [
        compensation(runs, 1.0)?,
        filter(runs, 1.0, true)?,
        filter(runs, 1.0, false)?,
        filter(runs, 1.0 / NOISE_FACTOR, true)?,
        filter(runs, NOISE_FACTOR, true)?,
        compensation(runs, 1.0 / NOISE_FACTOR)?,
        compensation(runs, NOISE_FACTOR)?,
    ];
    let table = |head: &str, row: fn(&[Results; 7], usize) -> Vec<String>| {
        let mut header = heads(head);
        header.extend(heads(
            "compensation | Kalman | Kalman, velocity alone | Kalman, noise / 3 \
             | Kalman, noise x 3 | compensation, noise / 3 | compensation, noise x 3 \
             | compensation / Kalman",
        ));
        let rows: Vec<_> = (0..studies[0].quantities.len())
            .map(|which| row(&studies, which))
            .collect();
        markdown(&header, &rows)
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

/// Convergence times, relative to the final errors of the best filter.
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
    let scale_noise = |config: &mut Config| {
        config.sensors.gyro_noise = config.sensors.gyro_noise.map(|noise| noise * factor);
        config.sensors.accel_noise = config.sensors.accel_noise.map(|noise| noise * factor);
    };
    drive_results(study, &|_| {}, &scale_noise)
}

fn filter(runs: u64, factor: f64, positions: bool) -> Result<Results> {
    let study = Study {
        kalman_noise: Some(factor),
        kalman_positions: positions,
        ..Study::new(Grade::Hg1700, runs)
    };
    results(study)
}

fn costs() -> Result<String> {
    let drive = simulate(&DriveConfig::new(0, Grade::Hg1700, 10.0));
    let log = Log {
        truth: Vec::new(),
        ..drive.into_log(BodyAxes::Rfu, Grade::Hg1700.errors().imu.output)
    };
    let config = configure::config(&log, Grade::Hg1700);
    let noise = Noise::of_model(&Grade::Hg1700.errors());
    let costs =
        measure_costs(&log, config, noise).map_err(|error| miette!("cannot be run: {}", error))?;
    let header = heads("sample with its share of fixes | ratio");
    let row = |cost: &Cost| vec![cost.method.to_owned(), format!("{:.1}", cost.ratio)];
    let rows: Vec<_> = costs.iter().map(row).collect();
    Ok(markdown(&header, &rows))
}

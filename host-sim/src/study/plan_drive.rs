//! The study `plan-drive`: sigmas predicted for a plan against the errors of simulated drives of it.
//!
//! Each drive has its own errors, noise and heading, and a driver who follows the plan to some per cent.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;
use ins_core::{Estimate, Estimates, Solution};
use miette::Result;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use crate::page::brief;
use crate::page::progress::{bar, counted, spinner};
use crate::page::table::{Table, heads, markdown, side_by_side};
use crate::plan_drive::{DrivenUnit, Driver, Goal, Plan, Target, UNITS, navigators, seconds};
use crate::statistics::rms;

/// Goal of the ratio predicted over reached.
const GOAL: [f64; 2] = [0.8, 1.25];

/// Defaults: drives of each plan, and the seed of the first.
const RUNS: u64 = 100;
const FIRST_SEED: u64 = 1;

macro_rules! target {
    ($name:literal) => {
        include_str!(concat!("../../targets/", $name, ".toml"))
    };
}

/// Targets: name, whether it judges, text.
const CASES: [(&str, bool, &str); 6] = [
    ("mems", false, target!("drive_target")),
    ("hg1700", false, target!("hg1700")),
    ("mems, tilted, 4 Hz", true, target!("judge_mems_tilted")),
    ("mems, 1 Hz, street", true, target!("judge_mems_street")),
    ("hg1700, never stops", true, target!("judge_hg1700_moving")),
    (
        "hg1700, antenna away",
        true,
        target!("judge_hg1700_antenna"),
    ),
];

/// Options of `study plan-drive`.
#[derive(Debug, Args)]
pub struct Options {
    /// Targets, as for `plan-drive`; two to develop on and four that judge unless given.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    target: Vec<PathBuf>,
    /// Drives of each plan.
    #[arg(long, default_value_t = RUNS, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    runs: u64,
    /// Seed of the first drive; the others follow. Plans are made with another.
    #[arg(long, default_value_t = FIRST_SEED)]
    first_seed: u64,
}

/// The plan for one target, and the results of its drives.
#[derive(Debug, Serialize)]
pub struct Results {
    target: String,
    judge: bool,
    minutes: f64,
    runs: usize,
    /// Runs that end without a solution: not in the rows.
    without_solution: usize,
    rows: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Row {
    quantity: String,
    unit: &'static str,
    target: f64,
    /// Sigma at the end of the plan.
    predicted: f64,
    /// RMS of the sigmas that the core states in the drives.
    stated: f64,
    /// RMS of the errors.
    reached: f64,
    /// Predicted over reached; none if the plan does not make it observable.
    ratio: Option<f64>,
}

impl Row {
    fn cell(&self) -> String {
        let ratio = self.ratio.map(|ratio| format!("{ratio:.2}"));
        ratio.unwrap_or_else(|| "not shown".to_owned())
    }
}

/// Predicted over reached of the built-in targets, for the documentation.
pub fn page() -> Result<String> {
    let all = compared(&Options {
        target: Vec::new(),
        runs: RUNS,
        first_seed: FIRST_SEED,
    })?;
    let mut header = vec![String::new()];
    header.extend(all.iter().map(|results| {
        let side = if results.judge { "judge: " } else { "" };
        format!("{side}{}", results.target)
    }));
    let column = |results: &Results| {
        let minutes = ("minutes".to_owned(), format!("{:.1}", results.minutes));
        let rows = results.rows.iter();
        let rows = rows.map(|row| (row.quantity.clone(), row.cell()));
        [minutes].into_iter().chain(rows).collect()
    };
    let rows = side_by_side(&all.iter().map(column).collect::<Vec<_>>());
    Ok(format!("{}\n{}", markdown(&header, &rows), verdict(&all)))
}

pub fn compared(options: &Options) -> Result<Vec<Results>> {
    let cases = cases(&options.target)?;
    let progress = bar().with_message("driving");
    progress.set_length(cases.len() as u64 * options.runs);
    let one = |(name, judge, target): &(String, bool, Target)| {
        results(name, *judge, target, options, &progress)
    };
    cases.iter().map(one).collect()
}

fn cases(files: &[PathBuf]) -> Result<Vec<(String, bool, Target)>> {
    if files.is_empty() {
        let case = |(name, judge, text): (&str, bool, &str)| {
            Ok((
                name.to_owned(),
                judge,
                Target::parse(Path::new(name), text)?,
            ))
        };
        return CASES.into_iter().map(case).collect();
    }
    let case = |file: &PathBuf| Ok((file.display().to_string(), true, Target::read(file)?));
    files.iter().map(case).collect()
}

fn results(
    name: &str,
    judge: bool,
    target: &Target,
    options: &Options,
    progress: &ProgressBar,
) -> Result<Results> {
    // With other seeds than those of the drives.
    let plan = target.plan(options.first_seed.wrapping_sub(UNITS), &spinner("planning"))?;
    let seeds = options.first_seed..options.first_seed.saturating_add(options.runs);
    let tried = (seeds.into_par_iter())
        .map(counted(progress, |seed| end_errors(target, &plan, seed)))
        .collect::<Result<Vec<_>>>()?;
    let runs = tried.len();
    let solved: Vec<Vec<[f64; 2]>> = tried.into_iter().flatten().collect();
    let row = |(which, goal): (usize, &Goal)| {
        let rms_of = |part: usize| rms(solved.iter().map(|run| run[which][part]));
        let predicted = goal.reached(navigators(&plan.end), target.unit.body_axes);
        let (reached, stated) = (rms_of(0), rms_of(1));
        Row {
            ratio: predicted.observable.then(|| predicted.sigma / reached),
            quantity: predicted.quantity,
            unit: predicted.unit,
            target: predicted.target,
            predicted: predicted.sigma,
            stated,
            reached,
        }
    };
    Ok(Results {
        target: name.to_owned(),
        judge,
        minutes: seconds(&plan.end) / 60.0,
        runs,
        without_solution: runs - solved.len(),
        rows: target.goals.iter().enumerate().map(row).collect(),
    })
}

/// Error and stated sigma of every goal after a drive of the plan; none without a solution.
fn end_errors(target: &Target, plan: &Plan, seed: u64) -> Result<Option<Vec<[f64; 2]>>> {
    let model = target.error_model()?;
    let config = target.config(&model)?;
    let mut unit = DrivenUnit::switched_on(target, &model, config, seed, Driver::human(seed))?;
    for stage in &plan.stages {
        for _ in 0..stage.times {
            unit.drive(stage.manoeuvre, &target.site);
        }
    }
    let Some(solution) = unit.navigator.solution().filter(|_| !unit.is_aligning()) else {
        return Ok(None);
    };
    let estimates = unit.navigator.estimates();
    let truth = true_values(&unit, target, &estimates, &solution);
    let axes = target.unit.body_axes;
    let error_and_sigma = |goal: &Goal| {
        let known = goal.quantity.known(&estimates, axes);
        [
            known.value - goal.quantity.known(&truth, axes).value,
            known.sigma,
        ]
    };
    Ok(Some(target.goals.iter().map(error_and_sigma).collect()))
}

/// The true values of the estimates: for an accelerometer the apparent bias at the attitude that `found`
/// refers to.
fn true_values(
    unit: &DrivenUnit,
    target: &Target,
    found: &Estimates,
    solution: &Solution,
) -> Estimates {
    let (errors, end) = (unit.errors(), unit.end());
    let up = found.level_force_mps2.normalize();
    let apparent_accel_bias = errors.effective_accel_bias_mps2(&end.position, &up);
    let cross_axis = errors.gyro_matrix - Matrix3::from_diagonal(&errors.gyro_matrix.diagonal());
    let residual_azimuth = (solution.attitude * end.attitude.inverse()).scaled_axis().z;
    let value = |value: f64| Estimate {
        value,
        ..Estimate::default()
    };
    let vector = |v: Vector3<f64>| [value(v.x), value(v.y), value(v.z)];
    Estimates {
        // The error of this estimate is the residual heading error, of either sign.
        azimuth_error_rad: value(found.azimuth_error_rad.value - residual_azimuth),
        accel_bias_mps2: vector(apparent_accel_bias),
        gyro_bias_radps: vector(errors.effective_gyro_bias_radps(&end.position, &up)),
        gnss_latency_s: value(0.5 * (errors.gnss_latency_s + errors.gnss_latency_end_s)),
        lever_arm_m: vector(target.unit.lever_arm_m()),
        accel_scale: vector(errors.accel_matrix.diagonal()),
        turn_scale: value(up.dot(&(errors.gyro_matrix * up))),
        gyro_scale: vector(errors.gyro_matrix.diagonal()),
        gyro_misalignment_rad: vector(cross_axis.tr_mul(&up)),
        ..Estimates::default()
    }
}

pub fn readable(all: &[Results]) -> String {
    let row = |row: &Row| {
        vec![
            row.quantity.clone(),
            row.unit.to_owned(),
            row.target.to_string(),
            brief(row.predicted),
            brief(row.stated),
            brief(row.reached),
            row.cell(),
        ]
    };
    let part = |results: &Results| {
        let side = if results.judge { "judge" } else { "develop" };
        let header = heads("| unit | wanted | predicted | stated | reached | predicted/reached");
        format!(
            "{} ({side}): {:.1} min, {} drives, {} without a solution\n{}\n",
            results.target,
            results.minutes,
            results.runs,
            results.without_solution,
            Table::of("", header, results.rows.iter().map(row)).plain()
        )
    };
    all.iter().map(part).collect::<String>() + &verdict(all)
}

/// How many ratios reach the goal: to the errors, and to the sigmas that the core states.
fn verdict(all: &[Results]) -> String {
    let of_side = |(judge, side): (bool, &str)| {
        let ratios = || {
            let of_side = all.iter().filter(|results| results.judge == judge);
            let rows = of_side.flat_map(|results| &results.rows);
            rows.filter_map(|row| Some((row.ratio?, row.predicted / row.stated)))
        };
        let good = |ratio: f64| (GOAL[0]..=GOAL[1]).contains(&ratio);
        let [least, most] = GOAL;
        format!(
            "{side}: within {least} to {most} are {} of {} ratios to what is reached, {} to what is stated\n",
            ratios().filter(|(reached, _)| good(*reached)).count(),
            ratios().count(),
            ratios().filter(|(_, stated)| good(*stated)).count(),
        )
    };
    let has_side = |side: &(bool, &str)| all.iter().any(|results| results.judge == side.0);
    let sides = [(false, "Development"), (true, "Judges")].into_iter();
    sides.filter(has_side).map(of_side).collect()
}

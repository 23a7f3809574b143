//! The command line.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use ins_core::earth::wrap_pi;
use miette::{IntoDiagnostic, Result, bail, miette};
use serde::Serialize;

use crate::accuracy;
use crate::aircraft;
use crate::configure;
use crate::identify::{Identification, identify};
use crate::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use crate::output::{self, OutputError};
use crate::report;
use crate::sim::{self, DriveConfig};
use crate::summary::Summary;
use crate::tables;
use crate::truth::{self, Truth};

const SUMMARY: &str = "summary.json";

/// Finds the errors of inertial sensors and GNSS from a recorded or simulated drive.
#[derive(Debug, Parser)]
#[command(version)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print the summary as JSON.
    #[arg(long, global = true)]
    json: bool,
    /// Replace what an earlier run wrote.
    #[arg(long, global = true)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate a car drive and write its log.
    Drive(Drive),
    /// Find the sensor errors of a log and write summary, tables and report.
    Identify(Identify),
    /// Fly a plan in a simulated aircraft and write its log.
    Fly(aircraft::cli::Fly),
    /// Print the performance and the natural motions of an aircraft.
    Aircraft(aircraft::cli::Table),
    /// Run many simulated drives and say how good the estimates are.
    Accuracy(accuracy::cli::Accuracy),
    /// Simulate a drive, identify it, and compare with the truth.
    Demo {
        /// Folder for log and report.
        #[arg(long, default_value = "out/demo")]
        out: PathBuf,
        #[command(flatten)]
        drive: DriveOptions,
    },
}

#[derive(Debug, Args)]
struct Drive {
    /// Folder of the log.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    options: DriveOptions,
}

#[derive(Clone, Copy, Debug, Args)]
struct DriveOptions {
    /// Fixes the route and every random number.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = SimulatedGrade::Hg1700)]
    grade: SimulatedGrade,
    /// Length of the drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    minutes: f64,
}

#[derive(Debug, Args)]
struct Identify {
    /// Folder of the log.
    log: PathBuf,
    /// Folder for the results.
    #[arg(long)]
    out: PathBuf,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = GradeChoice::Auto)]
    grade: GradeChoice,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum SimulatedGrade {
    /// Ring lasers of 1 deg/h.
    Hg1700,
    /// Consumer MEMS.
    Mems,
}

impl From<SimulatedGrade> for sim::Grade {
    fn from(grade: SimulatedGrade) -> Self {
        match grade {
            SimulatedGrade::Hg1700 => Self::Hg1700,
            SimulatedGrade::Mems => Self::Mems,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GradeChoice {
    /// What meta.toml says, or else what the gyros show at rest.
    Auto,
    /// Ring lasers of 1 deg/h.
    Hg1700,
    /// Consumer MEMS.
    Mems,
}

pub(crate) fn minutes(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(minutes) if (1.0..=1440.0).contains(&minutes) => Ok(minutes),
        _ => Err("minutes from 1 to 1440".to_owned()),
    }
}

/// Runs a command.
pub fn run(cli: &Cli) -> Result<()> {
    match &cli.command {
        Command::Drive(drive) => {
            let truth = write_drive(&drive.out, drive.options, cli.force)?;
            print_drive(&drive.out, &truth, cli.json)
        }
        Command::Identify(options) => {
            let grade = match options.grade {
                GradeChoice::Auto => None,
                GradeChoice::Hg1700 => Some(Grade::Hg1700),
                GradeChoice::Mems => Some(Grade::Mems),
            };
            let (summary, truth) = identify_log(&options.log, &options.out, grade, cli.force)?;
            print_summary(&summary, truth.as_ref(), &options.out, cli.json)
        }
        Command::Fly(options) => aircraft::cli::fly(options, cli.json, cli.force),
        Command::Aircraft(options) => aircraft::cli::table(options, cli.json, cli.force),
        Command::Accuracy(options) => accuracy::cli::accuracy(options, cli.json, cli.force),
        Command::Demo { out, drive } => demo(out, *drive, cli),
    }
}

fn demo(out: &Path, drive: DriveOptions, cli: &Cli) -> Result<()> {
    let (log, results) = (out.join("log"), out.join("report"));
    // Both before either, so that nothing is simulated in vain.
    output::check_free(&log, truth::FILE, cli.force)?;
    output::check_free(&results, SUMMARY, cli.force)?;
    write_drive(&log, drive, cli.force)?;
    let (summary, truth) = identify_log(&log, &results, None, cli.force)?;
    print_summary(&summary, truth.as_ref(), &results, cli.json)
}

// --- drive ---

fn write_drive(out: &Path, options: DriveOptions, force: bool) -> Result<Truth> {
    output::check_free(out, truth::FILE, force)?;
    let (grade, class) = match options.grade {
        SimulatedGrade::Hg1700 => (sim::Grade::Hg1700, Grade::Hg1700),
        SimulatedGrade::Mems => (sim::Grade::Mems, Grade::Mems),
    };
    let progress = spinner("simulating the drive");
    let config = DriveConfig::new(options.seed, grade, options.minutes);
    let drive = sim::simulate(&config);
    progress.set_message("writing the log");
    let azimuth_error_rad = drive
        .given_heading_rad
        .zip(drive.truth.first())
        .map(|(given, start)| wrap_pi(given - start.euler().heading_rad));
    let truth = Truth::new(&drive.errors, azimuth_error_rad, BodyAxes::Frd);
    let log = Log {
        meta: Meta {
            initial_heading_deg: drive.given_heading_rad.map(f64::to_degrees),
            grade: Some(class),
            document: description(options),
            ..Meta::new(BodyAxes::Frd, config.recording.errors.imu.output)
        },
        imu: drive.imu,
        gnss: drive.gnss,
        truth: drive.truth,
    };
    let errors = truth.to_toml().into_diagnostic()?;
    output::build(out, truth::FILE, force, |folder| -> Result<()> {
        log::write(&log, folder, Compression::Gzip)?;
        let path = folder.join(truth::FILE);
        fs::write(&path, errors).map_err(|e| OutputError::io(&path, e))?;
        Ok(())
    })?;
    progress.finish_and_clear();
    Ok(truth)
}

fn description(options: DriveOptions) -> toml::Table {
    let name = format!("simulated drive, seed {}", options.seed);
    let entries = [
        ("name", toml::Value::from(name)),
        ("real_data", toml::Value::from(false)),
        ("minutes", toml::Value::from(options.minutes)),
    ];
    entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
}

fn print_drive(out: &Path, truth: &Truth, json: bool) -> Result<()> {
    if json {
        println!("{}", serde_json::to_string_pretty(truth).into_diagnostic()?);
    } else {
        println!("Log written to {}", out.display());
    }
    Ok(())
}

// --- identify ---

fn identify_log(
    folder: &Path,
    out: &Path,
    grade: Option<Grade>,
    force: bool,
) -> Result<(Summary, Option<Truth>)> {
    output::check_free(out, SUMMARY, force)?;
    refuse_same(folder, out)?;
    let progress = bar();
    progress.set_message("reading");
    let (log, warnings) = log::read(folder)?;
    for warning in &warnings {
        progress.suspend(|| eprintln!("warning: {warning}\n  {}", warning.cause));
    }
    let truth = Truth::read(folder)?;
    let grade = configure::grade(&log, grade);
    progress.set_message("identifying");
    let found = identify(&log, configure::config(&log, grade), &progress)
        .map_err(|error| miette!("the configuration cannot be used: {}", error.0))?;
    let summary = Summary::new(name(folder, &log), &log, &found, grade, &warnings);
    let results = Results {
        log: &log,
        found: &found,
        summary: &summary,
        truth: truth.as_ref(),
    };
    output::build(out, SUMMARY, force, |folder| results.write(folder))?;
    Ok((summary, truth))
}

/// The log's folder must not become the results' one.
fn refuse_same(log: &Path, out: &Path) -> Result<()> {
    let same = match (log.canonicalize(), out.canonicalize()) {
        (Ok(log), Ok(out)) => log.starts_with(out),
        _ => false,
    };
    if same {
        bail!(
            help = "choose another --out",
            "{} holds the log itself",
            out.display()
        );
    }
    Ok(())
}

fn name(folder: &Path, log: &Log) -> String {
    let folder_name = || {
        folder
            .canonicalize()
            .ok()?
            .file_name()?
            .to_str()
            .map(str::to_owned)
    };
    log.meta
        .name()
        .map(str::to_owned)
        .or_else(folder_name)
        .unwrap_or_else(|| "log".to_owned())
}

struct Results<'a> {
    log: &'a Log,
    found: &'a Identification,
    summary: &'a Summary,
    truth: Option<&'a Truth>,
}

impl Results<'_> {
    fn write(&self, folder: &Path) -> Result<()> {
        let axes = self.log.meta.body_axes;
        tables::write_estimates(create(folder, "estimates.csv")?, self.found, axes)
            .into_diagnostic()?;
        tables::write_solution(create(folder, "solution.csv")?, &self.found.solutions)
            .into_diagnostic()?;
        let page =
            report::html(self.log, self.found, self.summary, self.truth).into_diagnostic()?;
        let path = folder.join("report.html");
        fs::write(&path, page).map_err(|e| OutputError::io(&path, e))?;
        let path = folder.join(SUMMARY);
        fs::write(&path, pretty(self.summary)? + "\n").map_err(|e| OutputError::io(&path, e))?;
        Ok(())
    }
}

fn create(folder: &Path, name: &str) -> Result<BufWriter<File>> {
    let path = folder.join(name);
    let file = File::create(&path).map_err(|e| OutputError::io(&path, e))?;
    Ok(BufWriter::new(file))
}

fn pretty(value: &impl Serialize) -> Result<String> {
    serde_json::to_string_pretty(value).into_diagnostic()
}

// --- what is printed ---

fn print_summary(summary: &Summary, truth: Option<&Truth>, out: &Path, json: bool) -> Result<()> {
    if json {
        println!("{}", pretty(summary)?);
        return Ok(());
    }
    println!("{:<20}{:>24}{:>12}{:>12}", "", "estimate", "truth", "error");
    let truths = truth.map(Truth::columns).unwrap_or_default();
    for ((name, quantity), truth) in summary.quantities.columns().into_iter().zip(truths) {
        let estimate = if quantity.observable() {
            report::with_sigma(&quantity)
        } else {
            "not observable".to_owned()
        };
        let why = if quantity.observable() {
            ""
        } else {
            quantity.observability.why()
        };
        let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.3}"));
        let error = truth
            .filter(|_| quantity.observable())
            .map(|truth| quantity.value - truth);
        println!(
            "{name:<20}{estimate:>24}{:>12}{:>12}  {why}",
            number(truth),
            number(error)
        );
    }
    if let (Some(before), Some(after)) = (
        summary.velocity_error_mps.before,
        summary.velocity_error_mps.after,
    ) {
        println!(
            "\nFree-inertial velocity error over a minute: {before:.3} m/s before, {after:.3} m/s after"
        );
    }
    println!("\nReport: {}", out.join("report.html").display());
    Ok(())
}

pub(crate) fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:<14} {bar:40} {percent:>3} % {eta}");
    let bar = ProgressBar::new(0);
    if let Ok(style) = style {
        bar.set_style(style);
    }
    bar
}

pub(crate) fn spinner(message: &'static str) -> ProgressBar {
    let spinner = ProgressBar::new_spinner().with_message(message);
    spinner.enable_steady_tick(std::time::Duration::from_millis(120));
    spinner
}

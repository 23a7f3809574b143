//! The command line.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use indicatif::{ProgressBar, ProgressStyle};
use ins_core::ImuSample;
use ins_core::earth::wrap_pi;
use miette::{IntoDiagnostic, Result, bail};

use crate::accuracy;
use crate::aircraft;
use crate::analysis::{Analysis, REPORT, SUMMARY};
use crate::campaign;
use crate::compare;
use crate::error_model::allan::AtRest;
use crate::error_model::fit::Kind;
use crate::error_model::{self, Identified, Record};
use crate::figures;
use crate::flights;
use crate::hil;
use crate::import;
use crate::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use crate::output::{self, OutputError};
use crate::plan_drive;
use crate::rehearse;
use crate::report::{self, Sensors};
use crate::reproduce;
use crate::sim::{self, DriveConfig, ErrorModel};
use crate::study;
use crate::table;
use crate::truth::{self, Truth};
use crate::tune;

/// Name of the program.
const NAME: &str = "host-sim";

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
    /// Find the sensor errors of logs and their error model; write summaries, tables and reports.
    Identify(Identify),
    /// Find delay, antenna offset, mount, offsets and noise in a log, as parameters of PX4, ArduPilot and others.
    Tune(tune::cli::Tune),
    /// Make a log of a recording of another program: PX4, ArduPilot, ROS, UBX, NMEA, phones.
    Import(import::cli::Import),
    /// Run a log through firmware on a board, and compare with the host bit for bit.
    Hil(hil::cli::Hil),
    /// Compare compensation with a Kalman filter on a log, in navigation and through outages.
    Compare(compare::cli::Compare),
    /// Identify many simulated units and say how well their error models are found.
    Recovery(error_model::recovery::cli::Recovery),
    /// Fly a plan in a simulated aircraft and write its log.
    Fly(aircraft::cli::Fly),
    /// Print the performance and the natural motions of an aircraft.
    Aircraft(aircraft::cli::Table),
    /// Fly many flights, damped and then free, and report what the estimates are worth.
    Flights(flights::cli::Flights),
    /// Run many simulated drives and say how good the estimates are.
    Accuracy(accuracy::cli::Accuracy),
    /// Identify many units from drives, fly them, and compare with the accuracy foretold.
    Campaign(campaign::cli::Campaign),
    /// Find the drive that shows what is wanted, or what to add to one that was driven.
    PlanDrive(plan_drive::cli::PlanDrive),
    /// Rehearse flights: recorded drives of a unit to the accuracy of any algorithm in the air.
    Rehearse(rehearse::cli::Rehearse),
    /// Add up the shards of a campaign.
    Merge(campaign::cli::Merge),
    /// Regenerate the thesis's figures and tables from simulation, its numbers beside ours.
    Reproduce(reproduce::cli::Reproduce),
    /// Measure the figures of the README and of docs/ anew and write them there.
    Figures(figures::Figures),
    /// Run many and say how good and how honest the results are.
    #[command(subcommand)]
    Study(study::cli::Study),
    /// Simulate a drive, identify it, and compare with the truth.
    Demo {
        /// Folder for log and report.
        #[arg(long, default_value = "out/demo")]
        out: PathBuf,
        #[command(flatten)]
        drive: DriveOptions,
    },
    /// Print completions of the command line for a shell.
    Completions {
        /// bash, zsh, fish and others.
        shell: Shell,
    },
    /// Write the manual pages.
    Man {
        /// Folder for them.
        #[arg(long)]
        out: PathBuf,
    },
}

#[derive(Debug, Args)]
struct Drive {
    /// Folder of the log.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    options: DriveOptions,
    /// Errors of the sensors if not those of their class: ideal, hg1700, mems or an error-model
    /// file.
    #[arg(long, value_name = "MODEL")]
    errors: Option<String>,
}

#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct DriveOptions {
    /// Fixes the route and every random number.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = SimulatedGrade::Hg1700)]
    pub(crate) grade: SimulatedGrade,
    /// Length of the drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    pub(crate) minutes: f64,
}

#[derive(Debug, Args)]
struct Identify {
    /// Folder of a log, or a recording of a known format. Several: drives of one kind of unit, for one error model of all.
    #[arg(required = true)]
    log: Vec<PathBuf>,
    /// Folder for the results.
    #[arg(long)]
    out: PathBuf,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = GradeChoice::Auto)]
    grade: GradeChoice,
    /// How gyro biases move.
    #[arg(long, value_enum, default_value_t = BiasChoice::Auto)]
    bias_model: BiasChoice,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BiasChoice {
    /// The likelier of the two.
    Auto,
    /// Jumps at regular intervals, thesis equation (3).
    Wave,
    /// Constant, trend and correlated noise, thesis equation (4).
    Continuous,
}

impl From<BiasChoice> for Option<Kind> {
    fn from(choice: BiasChoice) -> Self {
        match choice {
            BiasChoice::Auto => None,
            BiasChoice::Wave => Some(Kind::Wave),
            BiasChoice::Continuous => Some(Kind::Continuous),
        }
    }
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
pub(crate) enum GradeChoice {
    /// What meta.toml says, or else what the gyros show at rest.
    Auto,
    /// Ring lasers of 1 deg/h.
    Hg1700,
    /// Consumer MEMS.
    Mems,
}

impl GradeChoice {
    /// The class, if one is chosen.
    pub(crate) fn told(self) -> Option<Grade> {
        match self {
            Self::Auto => None,
            Self::Hg1700 => Some(Grade::Hg1700),
            Self::Mems => Some(Grade::Mems),
        }
    }
}

pub(crate) fn minutes(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(minutes) if (1.0..=1440.0).contains(&minutes) => Ok(minutes),
        _ => Err("minutes from 1 to 1440".to_owned()),
    }
}

impl Cli {
    /// The command line; numbers may be negative.
    pub fn read() -> Self {
        let command = Self::command().mut_subcommands(|c| c.allow_negative_numbers(true));
        Self::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
    }

    /// Whether it runs programs of the user's.
    pub fn runs_programs(&self) -> bool {
        matches!(self.command, Command::Rehearse(_))
    }
}

/// Runs a command.
pub fn run(cli: &Cli) -> Result<()> {
    match &cli.command {
        Command::Drive(drive) => {
            let errors = drive.errors.as_deref().map(aircraft::cli::error_model);
            let truth = write_drive(&drive.out, drive.options, errors.transpose()?, cli.force)?;
            print_drive(&drive.out, &truth, cli.json)
        }
        Command::Identify(options) => {
            let grade = options.grade.told();
            let kind = options.bias_model.into();
            if let [log] = options.log.as_slice() {
                let (analysis, model) = identify_log(log, &options.out, grade, kind, cli.force)?;
                print_analysis(&analysis, Some(&model), &options.out, cli.json)
            } else {
                identify_logs(options, grade, kind, cli)
            }
        }
        Command::Recovery(options) => {
            error_model::recovery::cli::recovery(options, cli.json, cli.force)
        }
        Command::Tune(options) => tune::cli::tune(options, cli.json),
        Command::Import(options) => import::cli::import(options, cli.json, cli.force),
        Command::Hil(options) => hil::cli::hil(options, cli.json, cli.force),
        Command::Compare(options) => compare::cli::compare(options, cli.json, cli.force),
        Command::Fly(options) => aircraft::cli::fly(options, cli.json, cli.force),
        Command::Aircraft(options) => aircraft::cli::table(options, cli.json, cli.force),
        Command::Flights(options) => flights::cli::flights(options, cli.json, cli.force),
        Command::Accuracy(options) => accuracy::cli::accuracy(options, cli.json, cli.force),
        Command::Campaign(options) => campaign::cli::campaign(options, cli.json, cli.force),
        Command::Rehearse(options) => rehearse::cli::rehearse(options, cli.json, cli.force),
        Command::PlanDrive(options) => plan_drive::cli::plan_drive(options, cli.json, cli.force),
        Command::Merge(options) => campaign::cli::merge(options, cli.json),
        Command::Reproduce(options) => reproduce::cli::reproduce(options, cli.json, cli.force),
        Command::Figures(options) => figures::write(options),
        Command::Study(study) => study::cli::study(study, cli.json),
        Command::Demo { out, drive } => demo(out, *drive, cli),
        Command::Completions { shell } => {
            clap_complete::generate(*shell, &mut Cli::command(), NAME, &mut io::stdout());
            Ok(())
        }
        Command::Man { out } => {
            fs::create_dir_all(out).map_err(|e| OutputError::io(out, e))?;
            let pages = clap_mangen::generate_to(Cli::command().name(NAME), out);
            Ok(pages.map_err(|e| OutputError::io(out, e))?)
        }
    }
}

fn demo(out: &Path, drive: DriveOptions, cli: &Cli) -> Result<()> {
    let (log, results) = (out.join("log"), out.join("report"));
    // An earlier demo can be had again at any time.
    let force = true;
    // Both before either, so that nothing is simulated in vain.
    output::check_free(&log, truth::FILE, force)?;
    output::check_free(&results, SUMMARY, force)?;
    write_drive(&log, drive, None, force)?;
    let (analysis, model) = identify_log(&log, &results, None, None, force)?;
    print_analysis(&analysis, Some(&model), &results, cli.json)
}

// --- drive ---

pub(crate) fn write_drive(
    out: &Path,
    options: DriveOptions,
    errors: Option<ErrorModel>,
    force: bool,
) -> Result<Truth> {
    output::check_free(out, truth::FILE, force)?;
    let (grade, class) = match options.grade {
        SimulatedGrade::Hg1700 => (sim::Grade::Hg1700, Grade::Hg1700),
        SimulatedGrade::Mems => (sim::Grade::Mems, Grade::Mems),
    };
    let progress = spinner("simulating the drive");
    let mut config = DriveConfig::new(options.seed, grade, options.minutes);
    if let Some(errors) = errors {
        config.recording.errors = errors;
    }
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
    kind: Option<Kind>,
    force: bool,
) -> Result<(Analysis, Identified)> {
    output::check_free(out, SUMMARY, force)?;
    refuse_same(folder, out)?;
    let progress = bar();
    let analysis = Analysis::of_log(folder, grade, &progress)?;
    let records = [Record::new(&analysis.log, &analysis.found)];
    let model = error_model_of(&records, analysis.summary.grade, kind);
    let at_rest = AtRest::new(&records);
    output::build(out, SUMMARY, force, |folder| {
        let sensors = Sensors {
            model: &model,
            at_rest: &at_rest,
        };
        analysis.write(folder, Some(&sensors))?;
        error_model::write(sensors, folder)
    })?;
    Ok((analysis, model))
}

pub(crate) fn error_model_of(records: &[Record], grade: Grade, kind: Option<Kind>) -> Identified {
    let progress = spinner("fitting the error model");
    let model = Identified::new(records, grade, kind);
    progress.finish_and_clear();
    model
}

/// A folder for each log, and the error model of all beside them.
fn identify_logs(
    options: &Identify,
    grade: Option<Grade>,
    kind: Option<Kind>,
    cli: &Cli,
) -> Result<()> {
    let out = &options.out;
    output::check_free(out, error_model::MODEL, cli.force)?;
    for log in &options.log {
        refuse_same(log, out)?;
    }
    let (mut model, mut summaries) = (None, Vec::new());
    output::build(out, error_model::MODEL, cli.force, |folder| -> Result<()> {
        let (mut records, mut class) = (Vec::new(), grade);
        let mut given: Vec<(&Path, [Option<ImuSample>; 2])> = Vec::new();
        for (number, log) in (1..).zip(&options.log) {
            let progress = bar();
            // One log at a time: only what the error model needs of it is kept.
            let analysis = Analysis::of_log(log, grade, &progress)?;
            let this = analysis.summary.grade;
            if *class.get_or_insert(this) != this {
                bail!(
                    help = "identify them apart, or say --grade",
                    "{}: another class of sensors than the logs before",
                    log.display()
                );
            }
            let ends =
                [analysis.log.imu.first(), analysis.log.imu.last()].map(Option::<&_>::copied);
            if let Some((same, _)) = given.iter().find(|(_, other)| *other == ends) {
                bail!(
                    help = "give each once: what is counted twice looks surer than it is",
                    "{}: the same recording as {}",
                    log.display(),
                    same.display()
                );
            }
            given.push((log, ends));
            let record = Record::new(&analysis.log, &analysis.found);
            let name = analysis.summary.log.replace(['/', '\\'], "-");
            let beside = folder.join(format!("{number}-{name}"));
            fs::create_dir(&beside).map_err(|e| OutputError::io(&beside, e))?;
            let own = [record];
            let sensors = Sensors {
                model: &error_model_of(&own, this, kind),
                at_rest: &AtRest::new(&own),
            };
            analysis.write(&beside, Some(&sensors))?;
            error_model::write(sensors, &beside)?;
            records.extend(own);
            summaries.push(analysis.summary);
        }
        let found = error_model_of(&records, class.unwrap_or(Grade::Mems), kind);
        let sensors = Sensors {
            model: &found,
            at_rest: &AtRest::new(&records),
        };
        error_model::write(sensors, folder)?;
        let page = report::html_of_all(&summaries, &sensors).into_diagnostic()?;
        let path = folder.join(REPORT);
        fs::write(&path, page).map_err(|e| OutputError::io(&path, e))?;
        model = Some(found);
        Ok(())
    })?;
    if cli.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&summaries).into_diagnostic()?
        );
    } else if let Some(model) = model {
        print_model(&model, out);
        println!("Report: {}", out.join(REPORT).display());
    }
    Ok(())
}

/// The log's folder must not become the results' one.
pub(crate) fn refuse_same(log: &Path, out: &Path) -> Result<()> {
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

// --- what is printed ---

fn print_model(model: &Identified, out: &Path) {
    let (header, rows) = model.table();
    print!("{}", table::plain(&header, &rows));
    println!("\nError model: {}", out.join(error_model::MODEL).display());
}

pub(crate) fn print_analysis(
    analysis: &Analysis,
    model: Option<&Identified>,
    out: &Path,
    json: bool,
) -> Result<()> {
    let summary = &analysis.summary;
    if json {
        println!(
            "{}",
            serde_json::to_string_pretty(summary).into_diagnostic()?
        );
        return Ok(());
    }
    println!("{}\n", summary.verdict.lines().join("\n"));
    let (header, rows) = analysis.table();
    print!("{}", table::plain(&header, &rows));
    if let (Some(before), Some(after)) = (
        summary.velocity_error_mps.before,
        summary.velocity_error_mps.after,
    ) {
        println!(
            "\nFree-inertial velocity error over a minute: {before:.3} m/s before, {after:.3} m/s after"
        );
    }
    if let Some(model) = model {
        println!();
        print_model(model, out);
    }
    println!("Report: {}", out.join(REPORT).display());
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

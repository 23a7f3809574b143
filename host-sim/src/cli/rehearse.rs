//! The command `rehearse`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use miette::{Report, Result, bail, miette};
use serde_json::{Map, Value};

use crate::aircraft::input::{Source, read_text};
use crate::aircraft::plan::Plan;
use crate::campaign::ledger::Shard;
use crate::campaign::{ledger, slurm};
use crate::cli::identify::error_model_of;
use crate::cli::options::{
    Class, Output, aircraft, identified, print, print_warnings, refuse_same, report_kept,
    report_line,
};
use crate::identify::analysis::{log_name, unusable};
use crate::identify::error_model::Sensors;
use crate::identify::error_model::allan::AtRest;
use crate::identify::error_model::record::readings_at_rest;
use crate::identify::error_model::{self, Identified};
use crate::log::import;
use crate::page;
use crate::page::output::{read, replace};
use crate::page::progress::bar;
use crate::rehearse::flight::{Apriori, Scenario};
use crate::rehearse::output;
use crate::rehearse::run::{lines, run};
use crate::rehearse::settings::{Drives, Key, Rehearsal, Settings};
use crate::rehearse::subject::{BUILT_IN, Subject};
use crate::rehearse::summary::Summary;
use crate::sim::errors::{ErrorModel, ErrorModelError};
use crate::sim::recorded::RecordedNoise;
use crate::statistics::whole;
use crate::study::options::within;

/// Settings of a rehearsal; marks its folder as ours.
const SETTINGS: &str = "settings.json";
/// Length of the blocks in which recorded noise is resampled, s: slower correlation is lost.
const BLOCK_S: f64 = 2.0;

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder of the results. A rehearsal that was stopped goes on there")))]
pub struct Rehearse {
    /// Recorded drives of the unit: folders of logs, or recordings of a known format.
    #[arg(required = true)]
    drives: Vec<PathBuf>,
    /// Flight plan, TOML.
    #[arg(long)]
    plan: PathBuf,
    /// Aircraft, TOML; the Cessna 172 unless given.
    #[arg(long)]
    aircraft: Option<PathBuf>,
    /// TOML with any keys of an error model that stand in place of what was identified or assumed:
    /// another receiver, a calibrated scale.
    #[arg(long, value_name = "FILE")]
    set: Option<PathBuf>,
    /// Algorithm under test: core, core-literal, core-open, kalman, a board as `hil --port PORT` or
    /// `hil --qemu`, or a program as `COMMAND` or `NAME=COMMAND`, see docs/rehearse.md. Several: one
    /// table. The core unless given.
    #[arg(long, value_name = "ALGORITHM")]
    with: Vec<String>,
    /// Time limit for each answer of a program, s.
    #[arg(long, default_value_t = 5.0, value_parser = positive)]
    time_limit: f64,
    /// Number of flights.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    flights: u32,
    /// Minutes without GNSS at the end of each.
    #[arg(long, default_value_t = 5.0, value_parser = not_negative)]
    minutes_free: f64,
    /// Spread of the error of the heading told at the start, deg, 3 unless given; `none`: it is not told.
    #[arg(long, value_parser = heading)]
    heading_sigma: Option<HeadingSigma>,
    /// Models drawn from what the drives leave open, for the interval of the model; 0: none.
    #[arg(long, default_value_t = 20)]
    models: u32,
    /// Flights for each line of the budget of errors; 0: none.
    #[arg(long, default_value_t = 10)]
    budget: u32,
    /// Fly everything with the noise of this log at rest, too, in place of white.
    #[arg(long, value_name = "LOG")]
    noise_from: Option<PathBuf>,
    /// Fixes every random number.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    class: Class,
    /// Only the K-th of N parts of the flights; without it, what is missing is flown and all added up.
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Fly nothing: write a job array of so many shards for Slurm into the folder.
    #[arg(long, value_name = "JOBS", conflicts_with = "shard",
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    slurm: Option<u32>,
    #[command(flatten)]
    output: Output,
}

/// Degrees, or none.
#[derive(Clone, Copy, Debug)]
struct HeadingSigma(Option<f64>);

const HEADING: HeadingSigma = HeadingSigma(Some(3.0));

fn heading(text: &str) -> Result<HeadingSigma, String> {
    match text {
        "none" => Ok(HeadingSigma(None)),
        _ => within(text, 0.0..=180.0, "expected a number from 0 to 180")
            .map(|deg| HeadingSigma(Some(deg))),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    within(text, 0.0..=1e4, "expected a number from 0 to 10000")
}

fn positive(text: &str) -> Result<f64, String> {
    let number = Some(not_negative(text)?);
    number
        .filter(|number| *number >= 1e-3)
        .ok_or_else(|| "expected at least 0.001".to_owned())
}

/// Flies what is missing and prints the summary.
pub fn rehearse(options: &Rehearse) -> Result<()> {
    let subjects = subjects(&options.with)?;
    let dynamics = aircraft(options.aircraft.as_deref())?;
    let plan = Plan::read(&options.plan, &dynamics)?;
    let set = keys(options.set.as_deref())?;
    if options.heading_sigma.is_some() && set.contains_key("given_heading_sigma_deg") {
        bail!(
            help = "leave one of them out",
            "the heading at the start is told by --heading-sigma and, in --set, by given_heading_sigma_deg"
        );
    }
    for drive in &options.drives {
        refuse_same(drive, &options.output.out)?;
    }
    let grade = options.class.grade;
    let drives = Drives::of(&options.drives, |drive| identified(drive, grade))?;
    let free_s = 60.0 * options.minutes_free;
    let scenario = Scenario::new(dynamics, plan, free_s, drives.imu_hz)
        .map_err(|error| miette!("{}: {error}", options.plan.display()))?;
    if scenario.aided_s() < 60.0 {
        bail!(
            help = "a longer plan (`duration_s` flies its legs again), or less --minutes-free",
            "{}: {:.0} s are flown, of which {free_s:.0} s without GNSS leave less than a minute before",
            options.plan.display(),
            scenario.duration_s
        );
    }
    let found = error_model_of(&drives.records, drives.grade, None);
    let noise = (options.noise_from.as_deref())
        .map(|log| recorded_noise(log, drives.imu_hz))
        .transpose()?;
    let rehearsal = Rehearsal {
        settings: settings(
            options,
            &scenario,
            &drives,
            &found,
            noise.as_ref(),
            set,
            &subjects,
        )?,
        verdicts: drives.verdicts.clone(),
        found,
        noise,
        subjects,
    };
    let apriori = Apriori {
        grade: drives.grade,
        model: rehearsal.settings.model.clone(),
        limit: Duration::from_secs_f64(options.time_limit),
    };
    check_apriori(&rehearsal, &apriori, options.set.as_deref())?;
    let out = &options.output.out;
    prepare_folder(&rehearsal.settings, out, options.output.force)?;
    if let Some(jobs) = options.slurm {
        let script = slurm::write("rehearse", out, jobs, None)?;
        return print(&format!("{}\n", script.display()));
    }
    let sensors = Sensors {
        model: &rehearsal.found,
        at_rest: &AtRest::new(&drives.records),
    };
    error_model::write(sensors, out)?;
    let shard = options.shard.unwrap_or(Shard::ALL);
    let tell_flown = |flown: usize, left: usize| {
        let out = out.display();
        eprintln!("{out}: flights taken from before: {flown}, left to fly: {left}");
    };
    run(
        &rehearsal,
        &scenario,
        &apriori,
        shard,
        out,
        tell_flown,
        &bar(),
    )?;
    if shard != Shard::ALL {
        return print(&format!("{} is done\n", out.join(shard.file()).display()));
    }
    let summary = Summary::new(&rehearsal, &scenario, &lines(out)?);
    output::write(out, &summary)?;
    let text = || output::readable(&summary) + &report_line(out);
    options.output.print.result(&summary, text)?;
    if summary.tested.iter().all(|tested| tested.flights == 0) {
        bail!(
            help = "the table of flights without a result has their causes",
            "no algorithm has flown a flight to its end"
        );
    }
    Ok(())
}

fn subjects(with: &[String]) -> Result<Vec<Subject>> {
    let named = |text: &String| {
        text.parse()
            .map_err(|error: String| miette!("--with `{text}`: {error}"))
    };
    let mut subjects: Vec<Subject> = with.iter().map(named).collect::<Result<_>>()?;
    if subjects.is_empty() {
        let [(_, core), ..] = BUILT_IN;
        subjects.push(core);
    }
    let mut names: Vec<String> = subjects.iter().map(Subject::name).collect();
    names.sort();
    if let Some([name, _]) = (names.array_windows()).find(|[one, next]| one == next) {
        bail!(
            help = "name one of them: --with 'NAME=COMMAND'",
            "two algorithms are called {name}"
        );
    }
    Ok(subjects)
}

/// Keys of an error model that the user sets; they are validated when applied.
pub(super) fn keys(file: Option<&Path>) -> Result<toml::Table> {
    let Some(file) = file else {
        return Ok(toml::Table::new());
    };
    let text = read_text(file, "keys of an error model")?;
    let source = Source { file, text: &text };
    let keys: toml::Table = source.parse("host-sim/errors/wave.toml")?;
    if keys.contains_key("barometer") {
        let message = "no algorithm is given a barometer here: expected keys of the inertial unit \
                       and the receiver";
        let place = source.value("barometer").unwrap_or(0);
        return Err(source.error(place, message.into()).into());
    }
    Ok(keys)
}

/// Reports an error of the model in these keys.
pub(super) fn in_keys(file: Option<&Path>, error: &ErrorModelError) -> Report {
    let Some(file) = file else {
        return miette!("the identified model cannot be flown: {error}");
    };
    match read_text(file, "keys of an error model") {
        Ok(text) => Source { file, text: &text }.in_model(error),
        Err(error) => error.into(),
    }
}

fn settings(
    options: &Rehearse,
    scenario: &Scenario,
    drives: &Drives,
    found: &Identified,
    noise: Option<&RecordedNoise>,
    set: toml::Table,
    subjects: &[Subject],
) -> Result<Settings> {
    let mut model = found.model();
    model.imu.output = drives.output;
    let mut settings = Settings {
        version: env!("CARGO_PKG_VERSION"),
        seed: options.seed,
        drives: drives.verdicts.iter().map(|of| of.log.clone()).collect(),
        flights: options.flights,
        models: options.models,
        budget: options.budget,
        duration_s: scenario.duration_s,
        free_s: scenario.free_s,
        imu_hz: scenario.imu_hz,
        limit_s: options.time_limit,
        with: options.with.clone(),
        programs: (subjects.iter())
            .filter_map(|subject| Some((subject.name(), subject.hash()?)))
            .collect(),
        noise_from: noise.map(RecordedNoise::rms),
        heading_sigma_deg: options.heading_sigma.unwrap_or(HEADING).0,
        set,
        model: model.clone(),
        aircraft: options.aircraft.as_deref().map(read).transpose()?,
        plan: read(&options.plan)?,
    };
    let wrong = |error| in_keys(options.set.as_deref(), &error);
    settings.model = settings.applied(model).map_err(wrong)?;
    let imu_hz = f64::from(scenario.imu_hz);
    (settings.model.check_at(imu_hz)).map_err(wrong)?;
    Ok(settings)
}

/// Refuses a model that a built-in algorithm cannot be configured by, with the key that causes it.
fn check_apriori(rehearsal: &Rehearsal, apriori: &Apriori, set: Option<&Path>) -> Result<()> {
    let check = |model: ErrorModel| {
        let apriori = Apriori {
            model,
            ..apriori.clone()
        };
        (rehearsal.subjects.iter()).try_for_each(|subject| subject.check(&apriori))
    };
    let Err(error) = check(apriori.model.clone()) else {
        return Ok(());
    };
    let found = rehearsal.found.model();
    let refused = |key: &Key| key.alone(&found).is_some_and(|model| check(model).is_err());
    let keys = rehearsal.settings.keys();
    let (Some(file), Some(key)) = (set, keys.iter().find(|key| refused(key))) else {
        return Err(unusable(error));
    };
    let text = read_text(file, "keys of an error model")?;
    let source = Source { file, text: &text };
    let message = format!("`{} = {}`: {}", key.name, key.value, unusable(error));
    let place = source.value(&key.name).unwrap_or(0);
    Err(source.error(place, message).into())
}

/// Noise of the unit at rest in a log.
fn recorded_noise(path: &Path, imu_hz: u32) -> Result<RecordedNoise> {
    let (log, warnings) = import::open(path)?;
    print_warnings(&warnings);
    let (own_hz, wanted_hz) = (log.imu_rate_hz(), f64::from(imu_hz));
    if (own_hz / wanted_hz - 1.0).abs() > 0.02 {
        bail!(
            help = "noise of the same unit at the same rate",
            "{}: {own_hz:.1} samples a second, the drives have {wanted_hz:.1}",
            path.display()
        );
    }
    let rests = readings_at_rest(&log);
    RecordedNoise::new(rests, whole(BLOCK_S * wanted_hz)).ok_or_else(|| {
        miette!(
            help = "leave the unit standing for a minute, engine running, and log that",
            "{}: {} has no rest of {BLOCK_S:.0} s beyond its ends",
            path.display(),
            log_name(path, &log)
        )
    })
}

/// Creates the folder, or checks that it belongs to the same rehearsal.
fn prepare_folder(settings: &Settings, out: &Path, force: bool) -> Result<()> {
    let text = page::json(settings)?;
    let copy = out.join(SETTINGS);
    let before = fs::read_to_string(&copy).unwrap_or_default();
    let differ = differing(&text, &before);
    let other = format!(
        "another rehearsal, with other settings: {}",
        differ.join(", ")
    );
    let same = |_: &Path| Ok(differ.is_empty());
    let kept = ledger::prepare_folder(out, SETTINGS, &text, force, same, &other)?;
    report_kept(out, kept.as_deref());
    // A program that did not exist before is recorded now.
    if text != before {
        replace(&copy, &text)?;
    }
    Ok(())
}

/// Keys of settings with other values in an earlier text. A program that did not exist then has no
/// results.
fn differing(text: &str, before: &str) -> Vec<String> {
    let [now, before] =
        [text, before].map(|text| serde_json::from_str::<Map<_, _>>(text).unwrap_or_default());
    let is_other = |(key, now): &(String, Value)| match (before.get(key), now) {
        (Some(Value::Object(before)), Value::Object(now)) if key == "programs" => {
            (before.iter()).any(|(name, hash)| now.get(name) != Some(hash))
        }
        (before, now) => before != Some(now),
    };
    let other = now.into_iter().filter(is_other);
    other.map(|(key, _)| key).collect()
}

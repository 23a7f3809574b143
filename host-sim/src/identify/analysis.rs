//! A log from its folder to its results.

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use ins_core::{Config, ConfigError, ImuSample};
use miette::{Result, bail, miette};

use crate::identify::run::{Identification, identify};
use crate::identify::summary::Summary;
use crate::identify::true_errors::Truth;
use crate::identify::words::in_words;
use crate::identify::{configure, halves};
use crate::log::import::{self, Choice};
use crate::log::{Grade, Log, LogError};
use crate::page::digits;
use crate::page::table::Table;

/// File name of the summary; marks a folder of results as ours.
pub const SUMMARY: &str = "summary.json";

/// A log, and the configuration to run it with.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    pub log: Log,
    pub config: Config,
    pub(crate) name: String,
    pub(crate) grade: Grade,
    /// Suspicious properties of the log.
    pub(crate) warnings: Vec<LogError>,
    pub(crate) truth: Option<Truth>,
}

impl Input {
    /// Reads a log.
    pub fn read(folder: &Path, grade: Option<Grade>, progress: &ProgressBar) -> Result<Self> {
        Self::read_all(&[folder.to_owned()], Choice::default(), grade, progress)
    }

    /// Reads a log, or several recordings as one.
    pub fn read_all(
        paths: &[PathBuf],
        choice: Choice,
        grade: Option<Grade>,
        progress: &ProgressBar,
    ) -> Result<Self> {
        progress.set_message("reading");
        let (log, warnings) = import::open_all(paths, choice)?;
        let folder = paths.first().map_or(Path::new(""), PathBuf::as_path);
        Ok(Self {
            truth: Truth::read(folder)?,
            ..Self::of(log_name(folder, &log), log, warnings, grade)
        })
    }

    /// A log that has been read, and its warnings.
    pub fn of(name: String, log: Log, warnings: Vec<LogError>, grade: Option<Grade>) -> Self {
        let grade = configure::grade(&log, grade);
        Self {
            config: configure::config(&log, grade),
            name,
            log,
            grade,
            warnings,
            truth: None,
        }
    }

    /// The analysis with the results of a run: halves test and verdict.
    pub fn with(self, found: Identification) -> Result<Analysis> {
        let Self { log, grade, .. } = self;
        let halves =
            halves::test(&log, &found, &|half| configure::config(half, grade)).map_err(unusable)?;
        let told = &self.warnings;
        Ok(Analysis {
            summary: Summary::new(self.name, &log, &found, grade, told, halves.as_deref()),
            log,
            found,
            truth: self.truth,
        })
    }
}

pub(crate) fn unusable(error: ConfigError) -> miette::Report {
    miette!("the configuration cannot be used: {}", error)
}

#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    pub log: Log,
    pub found: Identification,
    pub summary: Summary,
    pub truth: Option<Truth>,
}

impl Analysis {
    /// Reads a log and runs the core over it.
    pub fn of_log(folder: &Path, grade: Option<Grade>, progress: &ProgressBar) -> Result<Self> {
        Self::of_input(Input::read(folder, grade, progress)?, progress)
    }

    pub fn of_input(input: Input, progress: &ProgressBar) -> Result<Self> {
        progress.set_message("identifying");
        let found = identify(&input.log, input.config, progress).map_err(unusable)?;
        input.with(found)
    }

    /// Estimates, beside the truth where it is known.
    pub fn table(&self) -> Table {
        let mut header = vec![String::new(), "estimate".to_owned()];
        if self.truth.is_some() {
            header.extend(["truth".to_owned(), "error".to_owned()]);
        }
        let truths = self.truth.as_ref().map(Truth::columns);
        let columns = self.summary.quantities.columns();
        let row = |(index, (name, quantity)): (usize, (&'static str, _))| {
            let mut cells = vec![name.to_owned(), in_words(&quantity)];
            if let Some(truths) = truths {
                let truth = truths[index];
                let error = truth
                    .filter(|_| quantity.observable())
                    .map(|truth| quantity.value - truth);
                cells.extend(
                    [truth, error]
                        .map(|value| value.map_or(String::new(), |v| digits(quantity.sigma, v))),
                );
            }
            cells
        };
        Table::of("", header, columns.into_iter().enumerate().map(row))
    }
}

/// Recordings, each of which must be given only once.
#[derive(Default)]
pub(crate) struct DistinctLogs(Vec<(PathBuf, [Option<ImuSample>; 2])>);

impl DistinctLogs {
    pub fn take(&mut self, path: &Path, log: &Log) -> Result<()> {
        let ends = [log.imu.first(), log.imu.last()];
        if let Some((same, _)) = self.0.iter().find(|(_, other)| *other == ends) {
            bail!(
                help = "give each once: what is counted twice looks surer than it is",
                "{}: the same recording as {}",
                path.display(),
                same.display()
            );
        }
        self.0.push((path.to_owned(), ends));
        Ok(())
    }
}

/// Name of a log: its own, or that of its folder.
pub fn log_name(folder: &Path, log: &Log) -> String {
    let own = log.meta.name().map(str::to_owned);
    own.unwrap_or_else(|| folder_name(folder))
}

pub(crate) fn folder_name(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = whole.file_name().map(|name| name.to_string_lossy().into());
    name.unwrap_or_else(|| "log".to_owned())
}

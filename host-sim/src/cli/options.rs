//! Options of several commands, and what they do.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;
use miette::{Result, bail};
use serde::Serialize;

use crate::aircraft::cessna172;
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::input::read_aircraft;
use crate::identify::analysis::{Analysis, Input};
use crate::log::{Grade, LogError};
use crate::page::html::REPORT;
use crate::page::progress::bar;
use crate::page::{self, output};

/// Refuses an output folder that contains the log.
pub(super) fn refuse_same(log: &Path, out: &Path) -> Result<()> {
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

/// Prints warnings to standard error.
pub(super) fn print_warnings(warnings: &[LogError]) {
    for warning in warnings {
        eprintln!("warning: {warning}\n  {}", warning.cause);
    }
}

/// Reads a log, and prints its warnings.
pub(super) fn read(folder: &Path, grade: Option<Grade>, progress: &ProgressBar) -> Result<Input> {
    let input = Input::read(folder, grade, progress)?;
    progress.suspend(|| print_warnings(&input.warnings));
    Ok(input)
}

/// Reads and identifies a log.
pub(super) fn identified(folder: &Path, grade: Option<Grade>) -> Result<Analysis> {
    let progress = bar();
    Analysis::of_input(read(folder, grade, &progress)?, &progress)
}

/// The aircraft of a file, or the Cessna 172.
pub(super) fn aircraft(file: Option<&Path>) -> Result<Dynamics> {
    match file {
        Some(file) => Ok(read_aircraft(file)?),
        None => Ok(Dynamics::new(&cessna172())),
    }
}

/// The class of the sensors, which a log may not have.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Class {
    /// Class of the sensors; else what meta.toml says, or what the gyros show at rest.
    #[arg(long, value_enum)]
    pub(super) grade: Option<Grade>,
}

/// How a result is printed.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Print {
    /// Print the summary as JSON.
    #[arg(long)]
    pub(super) json: bool,
}

impl Print {
    /// Prints a result as JSON or as text.
    pub(super) fn result(
        self,
        value: &impl Serialize,
        text: impl FnOnce() -> String,
    ) -> Result<()> {
        print(&if self.json {
            page::json(value)?
        } else {
            text()
        })
    }
}

/// Where results go, and how they are printed.
#[derive(Args, Debug)]
pub(super) struct Output {
    /// Folder for the results.
    #[arg(long)]
    pub(super) out: PathBuf,
    #[command(flatten)]
    pub(super) print: Print,
    /// Replace what an earlier run wrote.
    #[arg(long)]
    pub(super) force: bool,
}

impl Output {
    /// Refuses the folder before any work is done for it.
    pub(super) fn check(&self, mark: &str) -> Result<()> {
        Ok(output::check_free(&self.out, mark, self.force)?)
    }

    pub(super) fn fill<T>(&self, mark: &str, fill: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
        build(&self.out, mark, self.force, fill)
    }
}

/// The same with an optional folder.
#[derive(Args, Debug)]
pub(super) struct Folder {
    /// Folder for the results.
    #[arg(long)]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) print: Print,
    /// Replace what an earlier run wrote.
    #[arg(long, requires = "out")]
    force: bool,
}

impl Folder {
    /// Refuses it before any work is done for it.
    pub(super) fn check(&self, mark: &str) -> Result<()> {
        let check = |folder: &PathBuf| output::check_free(folder, mark, self.force);
        Ok(self.out.as_ref().map_or(Ok(()), check)?)
    }

    /// Fills it, if given, and prints the result.
    pub(super) fn deliver(
        &self,
        mark: &str,
        fill: impl FnOnce(&Path) -> Result<()>,
        value: &impl Serialize,
        text: impl FnOnce() -> String,
    ) -> Result<()> {
        let filled = |folder: &PathBuf| build(folder, mark, self.force, fill);
        self.out.as_ref().map_or(Ok(()), filled)?;
        self.print.result(value, text)
    }
}

/// Fills a folder of results, and reports files that are kept of an earlier one.
pub(super) fn build<T>(
    folder: &Path,
    mark: &str,
    force: bool,
    fill: impl FnOnce(&Path) -> Result<T>,
) -> Result<T> {
    let (filled, kept) = output::build(folder, mark, force, fill)?;
    report_kept(folder, kept.as_deref());
    Ok(filled)
}

pub(super) fn report_kept(folder: &Path, kept: Option<&Path>) {
    if let Some(kept) = kept {
        let [folder, kept] = [folder, kept].map(Path::display);
        eprintln!("{folder}: what was not replaced is kept in {kept}");
    }
}

/// Path of the report in a folder of results.
pub(super) fn report_line(out: &Path) -> String {
    format!("Report: {}\n", out.join(REPORT).display())
}

/// To the standard output, whose reader may stop early, as `head` does.
pub(super) fn print(text: &str) -> Result<()> {
    let mut output = io::stdout();
    match (output.write_all(text.as_bytes())).and_then(|()| output.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            bail!("cannot write to the standard output: {error}")
        }
        _ => Ok(()),
    }
}

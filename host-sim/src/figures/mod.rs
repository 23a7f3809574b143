//! The figures of the README and of docs/: every table and picture measured anew, nothing typed
//! by hand.

mod accuracy;
mod aircraft;
mod demo;
mod identification;
mod kalman;
mod logs;
mod pages;

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use miette::{Result, miette};

use crate::flights;
use crate::output::{self, OutputError};
use crate::reproduce;
use crate::table::cells;
pub(crate) use aircraft::performance;
use pages::Pages;

/// Options of `figures`.
#[derive(Debug, Args)]
pub struct Figures {
    /// Top folder of the repository.
    #[arg(long, default_value = ".")]
    repository: PathBuf,
    /// Only these parts.
    #[arg(long, value_enum, value_delimiter = ',')]
    only: Vec<Part>,
    /// Drives behind the accuracy tables; the comparison of forms takes 100 at most, the flights
    /// are 200 at most.
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    runs: u64,
    /// Folder of recorded logs; `INS_LOGS` or ../shared/data beside the repository unless given.
    #[arg(long)]
    logs: Option<PathBuf>,
    /// Table printed by another program, taken over into a part of a page.
    #[arg(long, value_name = "PART=FILE", value_parser = insertion)]
    insert: Vec<(String, PathBuf)>,
}

/// A part of a page that is generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// The demo drive: table and picture.
    Demo,
    /// Accuracy with ring-laser gyros: table and picture.
    AccuracyHg1700,
    /// Accuracy with consumer MEMS.
    AccuracyMems,
    /// Exact and literal forms over the bandwidth of the loop.
    Forms,
    /// Compensation beside a Kalman filter, over many drives.
    Kalman,
    /// Outages of recorded logs, through the core, the Kalman filter and a peer.
    Outages,
    /// Recorded logs.
    Logs,
    /// Error models found from drives: units behind it are --runs, 200 at most.
    Recovery,
    /// Accuracy of flights foretold from drives.
    Campaign,
    /// Performance of the aircraft.
    Aircraft,
    /// Flights without GNSS; some minutes.
    Flights,
    /// The thesis's figures and tables beside ours.
    Reproduce,
    /// Mechanization on ideal sensors.
    ErrorFree,
    /// The example of the core's documentation.
    Example,
}

fn insertion(text: &str) -> Result<(String, PathBuf), String> {
    let (part, file) = text.split_once('=').ok_or("PART=FILE, say cost=cost.txt")?;
    Ok((part.to_owned(), file.into()))
}

/// Measures the parts that are asked for and rewrites the pages, all at once.
pub fn write(options: &Figures) -> Result<()> {
    let root = &options.repository;
    let mut pages = Pages::read(root)?;
    let parts = match options.only.as_slice() {
        // With tables to take over and nothing else named, nothing is measured.
        [] if !options.insert.is_empty() => &[],
        [] => Part::value_variants(),
        only => only,
    };
    for part in parts {
        let name = part.name();
        // A missing marker must show before the work, not after it.
        pages.check(&name)?;
        eprintln!("measuring: {name}");
        if let Some(text) = part.measure(options)? {
            pages.replace(&name, &text)?;
        }
    }
    for (part, file) in &options.insert {
        let text = fs::read_to_string(file).map_err(|e| miette!("{}: {e}", file.display()))?;
        pages.replace(part, &pages::tables_of(&text, file)?)?;
    }
    pages.write()
}

impl Part {
    fn name(self) -> String {
        self.to_possible_value()
            .map_or(String::new(), |value| value.get_name().to_owned())
    }

    /// The text of the part; `None` leaves it as it is.
    fn measure(self, options: &Figures) -> Result<Option<String>> {
        let root = &options.repository;
        match self {
            Self::Demo => demo::part(root),
            Self::AccuracyHg1700 => accuracy::hg1700(root, options.runs),
            Self::AccuracyMems => accuracy::mems(options.runs),
            Self::Forms => accuracy::forms(options.runs.min(100)),
            Self::Kalman => kalman::part(options.runs.min(100)),
            Self::Outages => return kalman::outages(root, options.logs.as_deref()),
            Self::Logs => return logs::part(root, options.logs.as_deref()),
            Self::Recovery => Ok(identification::recovery(options.runs.clamp(2, 200))),
            Self::Campaign => identification::campaign(root),
            Self::Aircraft => aircraft::performance_table(),
            Self::Flights => flights::cli::page(options.runs.min(200)),
            Self::Reproduce => reproduce::cli::page(),
            Self::ErrorFree => aircraft::error_free(root),
            Self::Example => pages::example(&root.join("core/src/lib.rs")),
        }
        .map(Some)
    }
}

/// Writes a picture into docs/.
fn picture(root: &Path, name: &str, svg: &str) -> Result<(), OutputError> {
    let folder = root.join("docs");
    fs::create_dir_all(&folder).map_err(|e| OutputError::io(&folder, e))?;
    output::replace(&folder.join(name), svg)
}

//! Regenerates the tables and pictures of the README and of docs/:
//! `cargo run --release -p ins-tests --bin figures -- --help`.

mod aircraft;
mod conditions;
mod drives;
mod program;
mod recorded;

use std::fs;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use host_sim::study::reproduce;
use ins_tests::pages::{self, Pages};
use miette::{Result, miette};

/// Measures the figures of the README and of docs/ and writes them there.
#[derive(Debug, Parser)]
struct Figures {
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
    /// Folder of recordings of other programs; ../shared/formats beside the repository unless given.
    #[arg(long)]
    recordings: Option<PathBuf>,
    /// Resume the unfinished campaign of an earlier measurement with the same program.
    #[arg(long)]
    resume: bool,
    /// Table printed by another program, inserted into a part of a page.
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
    /// Every kind of conditions, and the results of the judging kinds for the README; seeds of each
    /// kind are a twentieth of --runs.
    Conditions,
    /// Exact and literal forms over the bandwidth of the loop.
    Forms,
    /// Compensation compared with a Kalman filter, over many drives.
    Kalman,
    /// Outages of recorded logs, through the core, the Kalman filter and a peer.
    Outages,
    /// Recorded logs.
    Logs,
    /// Correlated position noise of recorded receivers.
    Wander,
    /// Recordings of other programs and recorded logs, without manual settings.
    Recordings,
    /// Drift without GNSS of recorded drives, predicted from others of the same unit.
    Proof,
    /// Error models identified from drives: --runs units, 200 at most.
    Recovery,
    /// Accuracy of flights predicted from drives.
    Campaign,
    /// Predicted sigmas of drives, compared with simulated drives.
    PlanDrive,
    /// Performance of the aircraft.
    Aircraft,
    /// Flights without GNSS; some minutes.
    Flights,
    /// The thesis's figures and tables compared with ours.
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

/// Measures the selected parts, then rewrites the pages.
fn main() -> Result<()> {
    let options = Figures::parse();
    let root = &options.repository;
    let mut pages = Pages::read(root)?;
    let mut texts = Vec::new();
    let parts = match options.only.as_slice() {
        // With `--insert` alone nothing is measured.
        [] if !options.insert.is_empty() => &[],
        [] => Part::value_variants(),
        only => only,
    };
    for part in parts {
        let name = part.name();
        // Missing markers are reported before the work.
        pages.check(&name)?;
        eprintln!("measuring: {name}");
        texts.extend(part.measure(&options)?);
    }
    // Read again: pages may have been edited meanwhile.
    pages = Pages::read(root)?;
    for (name, text) in texts {
        pages.replace(&name, &text)?;
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

    /// Texts by the names of their parts; parts that cannot be measured here stay unchanged.
    fn measure(self, options: &Figures) -> Result<Vec<(String, String)>> {
        let (root, logs) = (&options.repository, options.logs.as_deref());
        let text = match self {
            Self::Demo => program::demo(root).map(Some),
            Self::AccuracyHg1700 => drives::hg1700(root, options.runs).map(Some),
            Self::AccuracyMems => drives::mems(options.runs).map(Some),
            Self::Conditions => {
                let results = conditions::results((options.runs / 20).max(1));
                let summary = ("summary".to_owned(), conditions::summary(&results));
                return Ok(vec![summary, (self.name(), conditions::page(&results))]);
            }
            Self::Forms => drives::forms(options.runs.min(100)).map(Some),
            Self::Kalman => drives::kalman(options.runs.min(100)).map(Some),
            Self::Outages => recorded::outages(root, logs),
            Self::Logs => recorded::logs(root, logs),
            Self::Wander => recorded::wander(root, logs),
            Self::Recordings => Ok(recorded::recordings(
                root,
                options.recordings.as_deref(),
                logs,
            )),
            Self::Proof => recorded::proof(root, logs),
            Self::Recovery => program::recovery(options.runs.clamp(2, 200)).map(Some),
            Self::Campaign => program::campaign(root, options.resume).map(Some),
            Self::PlanDrive => host_sim::plan_drive_page().map(Some),
            Self::Aircraft => aircraft::performance_table().map(Some),
            Self::Flights => aircraft::flights(options.runs.min(200)).map(Some),
            Self::Reproduce => reproduce::reproduce(reproduce::Settings::new(1), None)
                .map(|reproduction| Some(reproduction.table().markdown())),
            Self::ErrorFree => aircraft::error_free(root).map(Some),
            Self::Example => pages::example(&root.join("core/src/lib.rs")).map(Some),
        }?;
        Ok(text.map(|text| (self.name(), text)).into_iter().collect())
    }
}

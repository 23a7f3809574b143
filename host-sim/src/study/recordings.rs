//! Recordings of any format, unedited: results, warnings and processing time.

use std::path::Path;
use std::time::Instant;

use indicatif::ProgressBar;
use serde::Serialize;

use crate::identify::analysis::{Analysis, Input};
use crate::log::Grade;
use crate::log::import::{self, Choice};
use crate::page::table::{Table, heads};
use crate::page::{brief, digits};

#[derive(Clone, Debug, Serialize)]
pub struct Recording {
    /// Name of the file or folder, and the number of the inertial sensor.
    pub name: String,
    pub outcome: Outcome,
    /// Reading included, s.
    pub took_s: f64,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    Used(Found),
    /// First sentence of the reason.
    Refused(String),
}

/// Results of a recording that could be used.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    pub minutes: f64,
    pub imu_hz: f64,
    pub gnss_hz: f64,
    /// Latency and its sigma, ms; none if not known.
    pub latency_ms: Option<[f64; 2]>,
    /// How many of latency, azimuth and six biases are observable.
    pub known: usize,
    /// Of the log; those about the result are in `against`.
    pub warnings: Vec<String>,
    pub against: Vec<String>,
}

/// Analyses a recording with each of its inertial sensors, the default one first.
pub fn recordings(path: &Path, grade: Option<Grade>) -> Vec<Recording> {
    // An unreadable file is reported in the first row.
    let others = import::other_imus(path).unwrap_or_default();
    let all = [None].into_iter().chain(others.into_iter().map(Some));
    all.map(|imu| recording(path, imu, grade)).collect()
}

fn recording(path: &Path, imu: Option<usize>, grade: Option<Grade>) -> Recording {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let which = imu.map_or_else(String::new, |imu| format!(", sensor {imu}"));
    let begun = Instant::now();
    let name = format!("{}{which}", name.to_string_lossy());
    let analysis = || {
        let (log, warnings) = import::open_all(&[path.to_owned()], Choice { imu, gnss: None })?;
        let input = Input::of(name.clone(), log, warnings, grade);
        Analysis::of_input(input, &ProgressBar::hidden())
    };
    let outcome = match analysis() {
        Ok(analysis) => Outcome::Used(Found::new(&analysis)),
        Err(error) => {
            let why = error.to_string();
            let folder = path.with_file_name("").display().to_string();
            Outcome::Refused(why.strip_prefix(&folder).unwrap_or(&why).to_owned())
        }
    };
    Recording {
        name,
        outcome,
        took_s: begun.elapsed().as_secs_f64(),
    }
}

impl Found {
    fn new(analysis: &Analysis) -> Self {
        let (log, summary) = (&analysis.log, &analysis.summary);
        let latency = summary.quantities.gnss_latency_ms;
        let quantities = summary.quantities.columns();
        Self {
            minutes: summary.duration_s / 60.0,
            imu_hz: log.imu_rate_hz(),
            gnss_hz: log.fix_rate_hz(),
            latency_ms: latency
                .observable()
                .then_some([latency.value, latency.sigma]),
            known: quantities
                .iter()
                .filter(|(_, found)| found.observable())
                .count(),
            warnings: summary.warnings.clone(),
            against: summary.verdict.against.clone(),
        }
    }
}

pub fn table(recordings: &[Recording]) -> Table {
    let header = heads(
        "recording | min | IMU Hz | GNSS Hz | latency, ms | observable, of 8 | warnings \
         | doubts about the result | s",
    );
    Table::of(
        "Recordings, as they are",
        header,
        recordings.iter().map(row),
    )
}

fn row(recording: &Recording) -> Vec<String> {
    let took = brief(recording.took_s);
    let Recording { name, outcome, .. } = recording;
    match outcome {
        Outcome::Refused(why) => {
            let mut row = vec![name.clone(), format!("refused: {why}")];
            row.resize(8, String::new());
            row.push(took);
            row
        }
        Outcome::Used(found) => vec![
            name.clone(),
            brief(found.minutes),
            brief(found.imu_hz),
            brief(found.gnss_hz),
            found.latency_ms.map_or_else(
                || "not known".to_owned(),
                |[value, sigma]| format!("{} \u{b1} {}", digits(sigma, value), brief(sigma)),
            ),
            found.known.to_string(),
            found.warnings.len().to_string(),
            found.against.len().to_string(),
            took,
        ],
    }
}

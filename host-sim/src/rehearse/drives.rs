//! The recorded drives of a unit, as far as its model needs them.

use std::path::PathBuf;

use ins_core::ImuOutput;
use miette::{Result, bail, miette};

use crate::identify::analysis::Analysis;
use crate::identify::error_model::Record;
use crate::log::{Grade, Log};
use crate::page::progress::bar;

/// What the drives give.
#[derive(Debug)]
pub struct Drives {
    pub names: Vec<String>,
    pub records: Vec<Record>,
    pub grade: Grade,
    pub output: ImuOutput,
    /// Inertial samples per second.
    pub imu_hz: u32,
}

impl Drives {
    /// Reads and identifies them one after the other.
    pub fn read(paths: &[PathBuf], grade: Option<Grade>) -> Result<Self> {
        let (mut names, mut records, mut rates) = (Vec::new(), Vec::new(), Vec::new());
        let mut first: Option<(Grade, ImuOutput)> = None;
        for path in paths {
            let analysis = Analysis::of_log(path, grade, &bar())?;
            let this = (analysis.summary.grade, analysis.log.meta.imu);
            if *first.get_or_insert(this) != this {
                bail!(
                    help = "drives of one unit, logged alike; or say --grade",
                    "{}: another class of sensors, or another kind of samples, than the drives before",
                    path.display()
                );
            }
            rates.push(rate_hz(&analysis.log));
            names.push(analysis.summary.log.clone());
            records.push(Record::new(&analysis.log, &analysis.found));
        }
        rates.sort_by(f64::total_cmp);
        let (grade, output) = first.ok_or_else(|| miette!("no drive is named"))?;
        // Rates are positive, and no sensor has more than thousands of samples a second.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let imu_hz = rates[rates.len() / 2].round().max(1.0) as u32;
        Ok(Self {
            names,
            records,
            grade,
            output,
            imu_hz,
        })
    }
}

/// Inertial samples per second.
pub fn rate_hz(log: &Log) -> f64 {
    let steps = log.imu.len().saturating_sub(1);
    steps as f64 / log.duration_s()
}

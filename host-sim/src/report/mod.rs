//! `report.html` of a log, or of several.

pub(crate) mod charts;
mod results;
mod together;

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;

use miette::{IntoDiagnostic, Result};

use crate::identify::analysis::{Analysis, REPORT, SUMMARY};
use crate::identify::error_model::Sensors;
use crate::identify::summary::Summary;
use crate::identify::tables;
use crate::page::html::Page;
use crate::page::output::OutputError;

/// Writes summary, tables and report into a folder.
pub(crate) fn write(analysis: &Analysis, sensors: Option<&Sensors>, folder: &Path) -> Result<()> {
    tables::write_estimates(
        create(folder, "estimates.csv")?,
        &analysis.found,
        &analysis.log.meta,
    )
    .into_diagnostic()?;
    tables::write_solution(create(folder, "solution.csv")?, &analysis.found.solutions)
        .into_diagnostic()?;
    let page = html(analysis, sensors).into_diagnostic()?;
    let summary = serde_json::to_string_pretty(&analysis.summary).into_diagnostic()?;
    for (name, text) in [(REPORT, page), (SUMMARY, summary + "\n")] {
        let path = folder.join(name);
        fs::write(&path, text).map_err(|e| OutputError::io(&path, e))?;
    }
    Ok(())
}

/// The report of a log.
pub fn html(analysis: &Analysis, sensors: Option<&Sensors>) -> Result<String, minijinja::Error> {
    let summary = &analysis.summary;
    let page = Page {
        title: summary.log.clone(),
        facts: format!(
            "{:.1} min \u{b7} body axes {} \u{b7} sensor class {} \u{b7} {} inertial samples, {} \
             fixes used \u{b7} host-sim {}",
            summary.duration_s / 60.0,
            summary.body_axes,
            summary.grade.name(),
            summary.imu.accepted,
            summary.gnss.accepted,
            summary.version
        ),
        verdicts: results::verdicts(analysis),
        tables: results::tables(analysis, sensors),
        sections: charts::sections(analysis, sensors),
    };
    page.html()
}

/// The report of several logs of one unit.
pub fn html_of_all(logs: &[Summary], sensors: &Sensors) -> Result<String, minijinja::Error> {
    together::page(logs, sensors).html()
}

fn create(folder: &Path, name: &str) -> Result<BufWriter<File>> {
    let path = folder.join(name);
    let file = File::create(&path).map_err(|e| OutputError::io(&path, e))?;
    Ok(BufWriter::new(file))
}

//! `report.html` of a log, or of several.

mod charts;
mod picture;
mod results;
mod together;

pub use picture::picture;

use std::path::Path;

use miette::{IntoDiagnostic, Result};

use crate::identify::analysis::{Analysis, REPORT, SUMMARY};
use crate::identify::error_model::Sensors;
use crate::identify::summary::Summary;
use crate::identify::tables;
use crate::page::html::Page;
use crate::page::{self, output};

/// Writes summary, tables and report into a folder.
pub(crate) fn write(analysis: &Analysis, sensors: Option<&Sensors>, folder: &Path) -> Result<()> {
    let Analysis { found, log, .. } = analysis;
    let to = |name| output::create(folder, name);
    tables::write_estimates(to("estimates.csv")?, found, &log.meta).into_diagnostic()?;
    tables::write_solution(to("solution.csv")?, &found.solutions).into_diagnostic()?;
    let page = html(analysis, sensors).into_diagnostic()?;
    output::write(folder, REPORT, page)?;
    Ok(output::write(
        folder,
        SUMMARY,
        page::json(&analysis.summary)?,
    )?)
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

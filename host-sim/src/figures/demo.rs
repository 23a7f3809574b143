//! The demo drive.

use std::path::Path;

use miette::{IntoDiagnostic, Result};

use crate::analysis::Analysis;
use crate::cli::{DriveOptions, SimulatedGrade, bar, write_drive};
use crate::report;
use crate::table;

/// What `host-sim demo` does and prints, with its picture.
pub(super) fn part(root: &Path) -> Result<String> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let log = folder.path().join("log");
    let options = DriveOptions {
        seed: 1,
        grade: SimulatedGrade::Hg1700,
        minutes: 40.0,
    };
    write_drive(&log, options, None, false)?;
    let analysis = Analysis::of_log(&log, None, &bar())?;
    let Analysis {
        log, found, truth, ..
    } = &analysis;
    let svg = report::estimates_svg(log, found, truth.as_ref());
    super::picture(root, "demo.svg", &svg)?;
    let (header, rows) = analysis.table();
    Ok(table::markdown(&header, &rows))
}

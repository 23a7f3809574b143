//! Monte Carlo flights: free-inertial errors with the estimates that were found with GNSS.
//!
//! Each flight is first damped by GNSS, then free, with its vertical channel damped by a barometer, as in any
//! real INS: alone it is unstable.

pub mod linear;
mod output;
pub mod route;
pub mod run;
pub mod schuler;
pub mod sensors;
pub mod statistics;
pub mod summary;

use core::ops::Range;

use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};

pub use output::{SUMMARY, markdown, readable, write};
pub use run::Settings;

use route::Route;
use run::Run;
use summary::Summary;

/// Flies all seeds, and the long straight flight of the first.
pub fn measure(
    seeds: Range<u64>,
    settings: &Settings,
    progress: &ProgressBar,
) -> Result<(Vec<Run>, Summary)> {
    let route = Route::cessna172()?;
    let first = seeds.start;
    progress.set_length(seeds.end - first);
    let runs = run::all(seeds, &route, settings, progress).into_diagnostic()?;
    let schuler = schuler::schuler(first, &route, &settings.errors).into_diagnostic()?;
    let summary = Summary::new(&runs, &route, settings, schuler);
    Ok((runs, summary))
}

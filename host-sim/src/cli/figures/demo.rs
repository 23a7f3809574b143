//! The demo drive.

use std::path::Path;

use miette::{IntoDiagnostic, Result};

use crate::cli::drive::write_drive;
use crate::cli::options::DriveOptions;
use crate::identify::analysis::Analysis;
use crate::log::Grade;
use crate::page::chart::sampled;
use crate::page::plot::{BLUE, GREY, Mark, RED};
use crate::page::progress::bar;
use crate::page::sheet::{self, Panel, key};
use crate::report::charts::{Converging, converging};

/// What `host-sim demo` does and prints, with its picture.
pub(super) fn part(root: &Path) -> Result<String> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let log = folder.path().join("log");
    let options = DriveOptions {
        seed: 1,
        grade: Grade::Hg1700,
        minutes: 40.0,
    };
    write_drive(&log, options, None, false)?;
    let analysis = Analysis::of_log(&log, None, &bar())?;
    let panels: Vec<Panel> = converging(&analysis).iter().map(panel).collect();
    super::pages::picture(root, "demo.svg", &sheet::svg(&panels))?;
    Ok(analysis.table().markdown())
}

fn panel(estimate: &Converging) -> Panel {
    let points = sampled(&estimate.points, sheet::CELL.0 as usize);
    let end = points.last().map_or(1.0, |point| point.0);
    let band = points
        .iter()
        .map(|&(t, value, sigma)| (t, value - sigma, value + sigma));
    let mut marks = vec![
        Mark::Shade(estimate.shown.clone(), GREY),
        Mark::Band(band.collect(), BLUE),
    ];
    if let Some(truth) = estimate.truth {
        marks.push(Mark::Reference(vec![(0.0, truth), (end, truth)], RED));
    }
    let line = points.iter().map(|&(t, value, _)| (t, value));
    marks.push(Mark::Line(line.collect(), BLUE));
    let labels = ["time, s", estimate.unit];
    let plot = sheet::plot(labels, (0.0, end), estimate.settled_range(), marks);
    Panel {
        title: estimate.title.clone(),
        svg: plot.svg(),
        keys: vec![
            key(BLUE, "estimate, band: one sigma"),
            key(GREY, "grey: manoeuvres that show it"),
            key(RED, "truth"),
        ],
    }
}

//! Convergence of the estimates of a log, as one drawing.

use super::charts::{Charts, EstimateHistory};
use crate::identify::analysis::Analysis;
use crate::page::chart::sampled;
use crate::page::plot::{BLUE, GREY, Mark, RED};
use crate::page::sheet::{self, Panel};

pub fn picture(analysis: &Analysis) -> String {
    let estimates = Charts::new(analysis).estimate_histories();
    let panels: Vec<Panel> = estimates.iter().map(panel).collect();
    sheet::svg(&panels)
}

fn panel(estimate: &EstimateHistory) -> Panel {
    let points = sampled(&estimate.points, sheet::CELL.0 as usize);
    let end = points.last().map_or(1.0, |point| point.0);
    let band = points
        .iter()
        .map(|&(t, value, sigma)| (t, value - sigma, value + sigma));
    let mut marks = vec![
        Mark::Shade(estimate.observable_times.clone(), GREY),
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
            (BLUE, "estimate, band: one sigma"),
            (GREY, "grey: manoeuvres that show it"),
            (RED, "truth"),
        ],
    }
}

//! `report.html` of a log, or of several.

mod charts;
mod picture;
mod results;
pub(crate) mod together;

pub use picture::picture;

use std::path::Path;

use ins_core::{Solution, Time};
use miette::Result;

use crate::identify::analysis::{Analysis, SUMMARY};
use crate::identify::error_model::Sensors;
use crate::identify::quantities::{QUANTITIES, Quantities};
use crate::identify::row::Row;
use crate::log::{Meta, numbers};
use crate::page::html::Page;
use crate::page::{self, output};

/// Columns of the damping signals in `estimates.csv`.
const SIGNALS: &str = "dv_e_mps,dv_n_mps,dv_u_mps,fc_e_mps2,fc_n_mps2,fc_u_mps2,\
    wc_e_radps,wc_n_radps,wc_u_radps";
/// Columns of `solution.csv`, those of a log's `truth.csv`.
const SOLUTION: &str =
    "t_s,lat_deg,lon_deg,h_m,ve_mps,vn_mps,vu_mps,roll_deg,pitch_deg,heading_deg";

/// Writes summary, tables and report into a folder.
pub(crate) fn write(analysis: &Analysis, sensors: Option<&Sensors>, folder: &Path) -> Result<()> {
    let Analysis { found, log, .. } = analysis;
    let of_each = QUANTITIES.map(|(name, ..)| format!("{name},{name}_sigma,{name}_observable"));
    let names = format!("t_s,phase,manoeuvre,{},{SIGNALS}", of_each.join(","));
    let rows = found.history.iter().map(|row| estimates(row, &log.meta));
    output::write(folder, "estimates.csv", page::csv(&names, rows)?)?;
    let rows = found.solutions.iter().map(solution);
    output::write(folder, "solution.csv", page::csv(SOLUTION, rows)?)?;
    page(analysis, sensors).write(folder)?;
    let summary = page::json(&analysis.summary)?;
    Ok(output::write(folder, SUMMARY, summary)?)
}

fn estimates(row: &Row, meta: &Meta) -> Vec<String> {
    let mut cells = vec![
        seconds(row.time),
        format!("{:?}", row.phase),
        format!("{:?}", row.manoeuvre),
    ];
    for (_, quantity) in Quantities::of_log(&row.estimates, meta).columns() {
        cells.extend([quantity.value, quantity.sigma].map(|number| format!("{number:.6}")));
        cells.push(u8::from(quantity.observable()).to_string());
    }
    let s = &row.signals;
    let vectors = [s.difference_enu_mps, s.accel_enu_mps2, s.rate_enu_radps];
    cells.extend((vectors.iter().flatten()).map(|component| format!("{component:.4e}")));
    cells
}

fn solution(solution: &Solution) -> Vec<String> {
    let digits = [9, 9, 3, 4, 4, 4, 4, 4, 4];
    let cells = numbers(solution).into_iter().zip(digits);
    let cells = cells.map(|(number, digits)| format!("{number:.digits$}"));
    [seconds(solution.time)].into_iter().chain(cells).collect()
}

fn seconds(time: Time) -> String {
    format!("{:.6}", time.as_seconds())
}

fn page(analysis: &Analysis, sensors: Option<&Sensors>) -> Page {
    let summary = &analysis.summary;
    Page {
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
        verdicts: [summary.verdict.lines(), summary.warnings.clone()].concat(),
        tables: results::tables(analysis, sensors),
        sections: charts::sections(analysis, sensors),
    }
}

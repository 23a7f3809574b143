//! `estimates.csv` and `solution.csv`.

use std::io::Write;

use ins_core::{Observability, Solution, Time};

use crate::identify::quantities::Quantities;
use crate::identify::row::Row;
use crate::identify::run::Identification;
use crate::log::{Meta, numbers};

/// Writes the estimates and damping signals, once a second.
pub fn write_estimates(to: impl Write, found: &Identification, meta: &Meta) -> csv::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    let mut header = vec!["t_s".to_owned(), "phase".to_owned(), "manoeuvre".to_owned()];
    for (name, _) in Quantities::of_log(&found.end.estimates, meta).columns() {
        header.extend([
            name.to_owned(),
            format!("{name}_sigma"),
            format!("{name}_observable"),
        ]);
    }
    let signals = [
        "dv_e_mps",
        "dv_n_mps",
        "dv_u_mps",
        "fc_e_mps2",
        "fc_n_mps2",
        "fc_u_mps2",
        "wc_e_radps",
        "wc_n_radps",
        "wc_u_radps",
    ];
    header.extend(signals.map(str::to_owned));
    table.write_record(&header)?;
    for row in &found.history {
        table.write_record(estimate_cells(row, meta))?;
    }
    Ok(table.flush()?)
}

fn estimate_cells(row: &Row, meta: &Meta) -> Vec<String> {
    let mut cells = vec![
        seconds(row.time),
        format!("{:?}", row.phase),
        format!("{:?}", row.manoeuvre),
    ];
    for (_, quantity) in Quantities::of_log(&row.estimates, meta).columns() {
        let observable = quantity.observability == Observability::Observable;
        cells.extend([
            format!("{:.6}", quantity.value),
            format!("{:.6}", quantity.sigma),
            u8::from(observable).to_string(),
        ]);
    }
    let s = &row.signals;
    let vectors = [s.difference_enu_mps, s.accel_enu_mps2, s.rate_enu_radps];
    cells.extend(
        vectors
            .iter()
            .flatten()
            .map(|component| format!("{component:.4e}")),
    );
    cells
}

/// Writes the solution ten times a second, in the columns of a log's `truth.csv`.
pub fn write_solution(to: impl Write, solutions: &[Solution]) -> csv::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record([
        "t_s",
        "lat_deg",
        "lon_deg",
        "h_m",
        "ve_mps",
        "vn_mps",
        "vu_mps",
        "roll_deg",
        "pitch_deg",
        "heading_deg",
    ])?;
    for solution in solutions {
        table.write_record(solution_cells(solution))?;
    }
    Ok(table.flush()?)
}

fn solution_cells(solution: &Solution) -> Vec<String> {
    let digits = [9, 9, 3, 4, 4, 4, 4, 4, 4];
    let cells = numbers(solution).into_iter().zip(digits);
    let cells = cells.map(|(number, digits)| format!("{number:.digits$}"));
    [seconds(solution.time)].into_iter().chain(cells).collect()
}

fn seconds(time: Time) -> String {
    format!("{:.6}", time.as_seconds())
}

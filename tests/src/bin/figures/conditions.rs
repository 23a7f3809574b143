//! Consistency of the core: every kind of conditions for docs/, and the results of the judging kinds for each
//! quantity for the README.

use std::ops::Range;

use host_sim::log::Grade;
use host_sim::page::brief;
use host_sim::page::table::{Table, heads, markdown};
use host_sim::study::conditions::output::{overview_table, totals, totals_table, worst_table};
use host_sim::study::conditions::{QUANTITIES, Quantity, Results, Row, Study, Trial, all};
use host_sim::study::flights::statistics::median;
use indicatif::ProgressBar;

/// All kinds with a number of seeds, core and Kalman filter.
pub fn results(seeds: u64) -> Vec<Results> {
    let study = Study {
        kinds: all().collect(),
        only: None,
        first_seed: 0,
        seeds,
        trial: Trial {
            with_kalman: true,
            receiver_known: false,
        },
    };
    study.results(&ProgressBar::new(0).with_message("running"))
}

/// Totals, worst results compared with the Kalman filter, and a row for each kind.
pub fn page(results: &[Results]) -> String {
    let mut tables = vec![totals_table(&totals(results))];
    tables.extend(worst_table(results));
    tables.push(overview_table(results));
    let tables: Vec<String> = tables.iter().map(Table::markdown).collect();
    tables.join("\n")
}

/// Rows of the README: similar quantities are combined.
const SUMMARY: [(&str, Range<usize>); 10] = [
    ("heading", 0..1),
    ("roll and pitch", 1..2),
    ("accelerometers x, y", 2..4),
    ("accelerometer z", 4..5),
    ("gyros", 5..8),
    ("latency", 8..9),
    ("lever arm", 9..12),
    ("position", 12..14),
    ("velocity", 14..16),
    ("position in outages", 16..18),
];

/// A row for some quantities over the judging kinds.
pub fn summary(results: &[Results]) -> String {
    let classes = [Grade::Mems, Grade::Hg1700];
    let mut header = heads("| unit");
    for class in classes {
        let class = class.name();
        header.extend(["error", "error/sigma", "wrong and sure"].map(|h| format!("{class}: {h}")));
    }
    let rows = SUMMARY.map(|(name, range)| {
        let quantities = &QUANTITIES[range];
        let mut row = vec![name.to_owned(), quantities[0].unit.to_owned()];
        for class in classes {
            row.extend(over_kinds(results, class, quantities));
        }
        row
    });
    let seeds = results.first().map_or(0, |results| results.runs);
    format!(
        "{}\nJudges alone, {seeds} seeds of each kind. Error: RMS of a kind, median over kinds (and axes). \
         Wrong and sure: called observable and more than 4.5 sigma off, of what was called \
         observable.\n",
        markdown(&header, &rows)
    )
}

/// Median RMS error of a kind and quantity, RMS of error over sigma of all, and how many were wrong and sure.
fn over_kinds(results: &[Results], class: Grade, quantities: &[Quantity]) -> [String; 3] {
    let rows: Vec<&Row> = results
        .iter()
        .filter(|results| results.judge && results.class == class)
        .flat_map(|results| &results.rows)
        .filter(|row| quantities.contains(&row.quantity) && row.observable > 0.0)
        .collect();
    if rows.is_empty() {
        return ["not observable", "", ""].map(str::to_owned);
    }
    let checks: f64 = rows.iter().map(|row| row.checks as f64).sum();
    let square = |row: &&Row| row.checks as f64 * row.rms_ratio.unwrap_or_default().powi(2);
    let ratio = (rows.iter().map(square).sum::<f64>() / checks).sqrt();
    let sure: f64 = rows.iter().map(|row| row.sure()).sum();
    let wrong: usize = rows.iter().map(|row| row.wrong_and_sure).sum();
    [
        brief(median(rows.iter().map(|row| row.rms_error))),
        format!("{ratio:.2}"),
        format!("{wrong} of {sure:.0}"),
    ]
}

//! The results as tables.

use miette::Result;

use super::statistics::{KalmanComparison, Results, Row, Totals};
use crate::log::Grade;
use crate::page;
use crate::page::table::{Table, heads};

/// Rows of the table of the worst quantities.
const WORST: usize = 10;

/// Overview, totals, the worst quantities against the Kalman filter, then every kind in detail.
pub fn readable(results: &[Results], details: bool) -> String {
    let summary = [overview_table(results), totals_table(&totals(results))];
    let tables = summary.into_iter().chain(worst_table(results));
    let details = results.iter().filter(|_| details).map(kind);
    let parts = tables.map(|table| table.plain()).chain(details);
    parts.collect::<Vec<_>>().join("\n")
}

/// Of development kinds and of judges, together and by class.
pub fn totals(results: &[Results]) -> Vec<Totals> {
    let groups = [(false, "development"), (true, "judges")];
    let classes = [Grade::Mems, Grade::Hg1700];
    let one = |(judge, name): (bool, &str), class: Option<Grade>| {
        let in_group =
            |r: &&Results| r.judge == judge && class.is_none_or(|class| r.class == class);
        let group: Vec<&Results> = results.iter().filter(in_group).collect();
        let name = class.map_or(name.to_owned(), |class| format!("{name}, {}", class.name()));
        Totals::new(&name, &group)
    };
    let each = groups.into_iter().flat_map(|group| {
        let apart = classes.map(|class| one(group, Some(class)));
        std::iter::once(one(group, None)).chain(apart)
    });
    each.flatten().collect()
}

pub fn overview_table(results: &[Results]) -> Table {
    let header = heads(
        "kind | class | use | runs | never | no solution | first, s | honest | wrong and sure \
         | worst error/sigma |  | Kalman lost | near Kalman | worst over Kalman |",
    );
    Table::of("", header, results.iter().map(overview_row)).filled()
}

fn overview_row(result: &Results) -> Vec<String> {
    let worst = result.worst();
    let over = result
        .over_kalman()
        .max_by(|a, b| f64::total_cmp(&a.1, &b.1));
    let lost = result.kalman_lost.map(|lost| lost.runs().to_string());
    let mut cells = names(result).to_vec();
    cells.extend([
        result.runs.to_string(),
        percent(result.never),
        percent(result.without_solution),
        result
            .first_solution_s
            .map_or(String::new(), |s| format!("{s:.0}")),
        fraction(result.honest()),
        result.wrong_and_sure().to_string(),
        worst
            .and_then(|row| row.rms_ratio)
            .map_or(String::new(), two_digits),
        worst.map_or(String::new(), |row| row.quantity.name.to_owned()),
        lost.unwrap_or_default(),
        over.map_or(String::new(), |_| fraction(result.near_kalman())),
        over.map_or(String::new(), |(_, over)| two_digits(over)),
        over.map_or(String::new(), |(row, _)| row.quantity.name.to_owned()),
    ]);
    cells
}

pub fn totals_table(totals: &[Totals]) -> Table {
    let header = heads(
        "| kinds | all honest | quantities | honest | sure | wrong and sure | per 1000 | never \
         | no solution | near Kalman | over Kalman | Kalman lost",
    );
    let row = |total: &Totals| {
        let comparison = |text: String| total.over_kalman.map_or(String::new(), |_| text);
        vec![
            total.name.clone(),
            total.kinds.to_string(),
            total.honest_kinds.to_string(),
            total.quantities.to_string(),
            total.honest_quantities.to_string(),
            page::fixed(0, total.sure),
            total.wrong_and_sure.to_string(),
            format!("{:.1}", 1000.0 * total.wrong_and_sure as f64 / total.sure),
            percent(total.never),
            percent(total.without_solution),
            comparison(fraction((total.near_kalman, total.compared))),
            comparison(total.over_kalman.map_or(String::new(), two_digits)),
            comparison(total.kalman_lost.to_string()),
        ]
    };
    Table::of("", header, totals.iter().map(row)).filled()
}

/// Where the core is worst against the Kalman filter; `None` without one.
pub fn worst_table(results: &[Results]) -> Option<Table> {
    let each = |result| Results::over_kalman(result).map(move |(row, over)| (result, row, over));
    let mut all: Vec<_> = results.iter().flat_map(each).collect();
    all.sort_by(|a, b| f64::total_cmp(&b.2, &a.2));
    all.truncate(WORST);
    let header = heads(
        "worst over Kalman | class | use |  | unit | RMS error | Kalman | its error/sigma \
         | over Kalman | in runs",
    );
    let rows = all.iter().map(|(result, row, _)| {
        let mut cells = names(result).to_vec();
        cells.extend([row.quantity.name, row.quantity.unit].map(str::to_owned));
        if let Some(comparison) = &row.kalman {
            cells.push(number(comparison.core_rms_error));
            cells.extend(comparison_cells(comparison));
        }
        cells
    });
    (!all.is_empty()).then(|| Table::of("", header, rows))
}

fn kind(result: &Results) -> String {
    let header = heads(
        "| unit | RMS error | RMS sigma | error/sigma | within 1 | within 3 | observable \
         | wrong and sure | Kalman | its error/sigma | over Kalman | in runs",
    );
    let table = Table::of("", header, result.rows.iter().map(kind_row)).filled();
    format!(
        "{}, {}: {}\n{}",
        result.kind,
        result.class.name(),
        result.what,
        table.plain()
    )
}

fn kind_row(row: &Row) -> Vec<String> {
    let stated = |value: String| row.rms_sigma.map_or(String::new(), |_| value);
    let mut cells = vec![
        row.quantity.name.to_owned(),
        row.quantity.unit.to_owned(),
        number(row.rms_error),
        row.rms_sigma.map_or(String::new(), number),
        row.rms_ratio.map_or(String::new(), two_digits),
        stated(percent(row.within_one)),
        stated(percent(row.within_three)),
        stated(percent(row.observable)),
        stated(row.wrong_and_sure.to_string()),
    ];
    let comparison = row.kalman.as_ref().map(comparison_cells);
    cells.extend(comparison.unwrap_or_default());
    cells
}

/// RMS error of the Kalman filter, RMS of its error over sigma, ratio of the core to it, and number of runs.
fn comparison_cells(comparison: &KalmanComparison) -> [String; 4] {
    [
        number(comparison.rms_error),
        comparison.rms_ratio.map_or(String::new(), two_digits),
        two_digits(comparison.over),
        comparison.runs.to_string(),
    ]
}

/// First line of [`csv()`].
pub const HEADER: &str = "kind,class,use,quantity,unit,checks,rms_error,rms_sigma,\
                          rms_error_over_sigma,observable,wrong_and_sure,compared_runs,\
                          compared_rms_error,kalman_rms_error,kalman_rms_error_over_sigma,\
                          over_kalman";

/// A row for each kind and quantity.
pub fn csv(results: &[Results]) -> Result<String> {
    let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.6e}"));
    let row = |result: &Results, row: &Row| {
        let comparison = row.kalman.as_ref();
        let mut cells = names(result).to_vec();
        cells.extend([
            row.quantity.name.to_owned(),
            row.quantity.unit.to_owned(),
            row.checks.to_string(),
            number(Some(row.rms_error)),
            number(row.rms_sigma),
            number(row.rms_ratio),
            number(Some(row.observable)),
            row.wrong_and_sure.to_string(),
            comparison.map_or(String::new(), |comparison| comparison.runs.to_string()),
            number(comparison.map(|comparison| comparison.core_rms_error)),
            number(comparison.map(|comparison| comparison.rms_error)),
            number(comparison.and_then(|comparison| comparison.rms_ratio)),
            number(comparison.map(|comparison| comparison.over)),
        ]);
        cells
    };
    let rows = (results.iter()).flat_map(|result| {
        result
            .rows
            .iter()
            .map(move |quantity| row(result, quantity))
    });
    page::csv(HEADER, rows)
}

/// Kind, class and use.
fn names(result: &Results) -> [String; 3] {
    let side = if result.judge { "judge" } else { "develop" };
    [result.kind, result.class.name(), side].map(str::to_owned)
}

fn fraction((of, all): (usize, usize)) -> String {
    format!("{of}/{all}")
}

fn two_digits(ratio: f64) -> String {
    format!("{ratio:.2}")
}

fn percent(fraction: f64) -> String {
    format!("{:.0} %", 100.0 * fraction)
}

/// Three digits.
fn number(value: f64) -> String {
    page::digits(0.1 * value, value)
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn small_errors_are_not_rounded_to_zero() {
        let shown = [426.2, 41.73, 1.674, 0.0166, 4e-5].map(number);
        assert_eq!(shown, ["426", "41.7", "1.67", "0.0166", "0.0000400"]);
    }
}

//! The results as tables for people.

use super::statistics::{Results, Row, Totals};
use crate::page::table::{Table, cells};
use crate::sim::Grade;

/// Overview, totals, then every kind by itself.
pub fn readable(results: &[Results], details: bool) -> String {
    let [overview, totals] =
        [overview_table(results), totals_table(&totals(results))].map(|table| table.plain());
    let mut text = format!("{overview}\n{totals}");
    if details {
        for result in results {
            text.push('\n');
            text.push_str(&kind(result));
        }
    }
    text
}

/// Development and judge kinds, each class apart.
pub fn totals(results: &[Results]) -> Vec<Totals> {
    let groups = [(false, "development"), (true, "judges")];
    let classes = [Grade::Mems, Grade::Hg1700];
    let one = |(judge, name): (bool, &str), class: Option<Grade>| {
        let of = |r: &&Results| r.judge == judge && class.is_none_or(|class| r.class == class);
        let group: Vec<&Results> = results.iter().filter(of).collect();
        let name = class.map_or(name.to_owned(), |class| format!("{name}, {}", short(class)));
        Totals::new(&name, &group)
    };
    let each = groups.into_iter().flat_map(|group| {
        let apart = classes.map(|class| one(group, Some(class)));
        std::iter::once(one(group, None)).chain(apart)
    });
    each.flatten().collect()
}

/// A row for each kind.
pub(crate) fn overview_table(results: &[Results]) -> Table {
    let header = cells([
        "kind",
        "class",
        "use",
        "runs",
        "never",
        "no solution",
        "first, s",
        "honest",
        "wrong and sure",
        "worst error/sigma",
        "",
        "worst over Kalman",
        "",
    ]);
    Table::new("", header, results.iter().map(overview_row).collect())
}

fn overview_row(result: &Results) -> Vec<String> {
    let (honest, all) = result.honest();
    let worst = result.worst();
    let kalman = result.worst_over_kalman();
    let ratio = |value: f64| format!("{value:.2}");
    vec![
        result.kind.to_owned(),
        short(result.class).to_owned(),
        if result.judge { "judge" } else { "develop" }.to_owned(),
        result.runs.to_string(),
        percent(result.never),
        percent(result.without_solution),
        result
            .first_solution_s
            .map_or(String::new(), |s| format!("{s:.0}")),
        format!("{honest}/{all}"),
        result.wrong_and_sure().to_string(),
        worst
            .and_then(|row| row.rms_ratio)
            .map_or(String::new(), ratio),
        worst.map_or(String::new(), |row| row.quantity.name.to_owned()),
        kalman.map_or(String::new(), |(_, over)| ratio(over)),
        kalman.map_or(String::new(), |(row, _)| row.quantity.name.to_owned()),
    ]
}

/// A row for each group.
pub(crate) fn totals_table(totals: &[Totals]) -> Table {
    let header = cells([
        "",
        "kinds",
        "all honest",
        "quantities",
        "honest",
        "sure",
        "wrong and sure",
        "per 1000",
        "never",
        "no solution",
        "over Kalman",
    ]);
    let rows = totals
        .iter()
        .map(|total| {
            vec![
                total.name.clone(),
                total.kinds.to_string(),
                total.honest_kinds.to_string(),
                total.quantities.to_string(),
                total.honest_quantities.to_string(),
                format!("{:.0}", total.sure),
                total.wrong_and_sure.to_string(),
                format!("{:.1}", 1000.0 * total.wrong_and_sure as f64 / total.sure),
                percent(total.never),
                percent(total.without_solution),
                total
                    .over_kalman
                    .map_or(String::new(), |over| format!("{over:.2}")),
            ]
        })
        .collect();
    Table::new("", header, rows)
}

fn kind(result: &Results) -> String {
    let header = cells([
        "",
        "unit",
        "RMS error",
        "RMS sigma",
        "error/sigma",
        "within 1",
        "within 3",
        "observable",
        "wrong and sure",
        "Kalman RMS error",
    ]);
    let table = Table::new("", header, result.rows.iter().map(kind_row).collect());
    format!(
        "{}, {}: {}\n{}",
        result.kind,
        short(result.class),
        result.what,
        table.plain()
    )
}

fn kind_row(row: &Row) -> Vec<String> {
    let stated = |value: String| row.rms_sigma.map_or(String::new(), |_| value);
    vec![
        row.quantity.name.to_owned(),
        row.quantity.unit.to_owned(),
        number(row.rms_error),
        row.rms_sigma.map_or(String::new(), number),
        row.rms_ratio
            .map_or(String::new(), |ratio| format!("{ratio:.2}")),
        stated(percent(row.within_one)),
        stated(percent(row.within_three)),
        stated(percent(row.observable)),
        stated(row.wrong_and_sure.to_string()),
        row.kalman_rms_error.map_or(String::new(), number),
    ]
}

/// Name of a class.
pub(crate) fn short(class: Grade) -> &'static str {
    match class {
        Grade::Ideal => "ideal",
        Grade::Hg1700 => "hg1700",
        Grade::Mems => "mems",
    }
}

fn percent(part: f64) -> String {
    format!("{:.0} %", 100.0 * part)
}

/// Three digits.
fn number(value: f64) -> String {
    let size = value.abs();
    if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.4}")
    }
}

//! Several logs of one unit on one page: do they say the same of it?

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::identify::error_model::Sensors;
use crate::identify::quantities::{QUANTITIES, Quantity};
use crate::identify::summary::Summary;
use crate::identify::words;
use crate::page::chart::{Chart, Figure, Spread};
use crate::page::digits;
use crate::page::html::{Page, Section};
use crate::page::plot::{BLUE, GREY};
use crate::page::table::{Table, heads};

/// Logs that agree differ by more than this once in a hundred times.
const CHANCE: f64 = 0.01;

pub(crate) fn page(logs: &[Summary], sensors: &Sensors) -> Page {
    let shared: Vec<Shared> = shared(logs);
    let names: Vec<&str> = logs.iter().map(|log| log.log.as_str()).collect();
    let named = |summary: &Summary| {
        let warnings = summary.warnings.iter();
        let warnings = warnings.map(|warning| format!("{}: {warning}", summary.log));
        let verdict = summary.verdict.lines_of(&summary.log);
        verdict.into_iter().chain(warnings).collect::<Vec<String>>()
    };
    let differ = (shared.iter())
        .filter(|one| one.agreement() == Agreement::Differ)
        .map(|one| {
            format!(
                "{}: the logs differ by more than their sigmas allow",
                one.name
            )
        });
    let axes = (!alike(logs)).then(|| {
        "The logs have other axes than each other: what lies along an axis is not compared"
            .to_owned()
    });
    let model = "Error model of the sensors from all logs, 95 % interval";
    Page {
        title: format!("{} logs of one unit", logs.len()),
        facts: format!(
            "{:.1} min in all \u{b7} host-sim {} \u{b7} each log has a report of its own beside this \
             page",
            logs.iter().map(|log| log.duration_s).sum::<f64>() / 60.0,
            env!("CARGO_PKG_VERSION")
        ),
        verdicts: (axes.into_iter())
            .chain(differ)
            .chain(logs.iter().flat_map(named))
            .collect(),
        tables: vec![
            side_by_side(logs, &shared),
            listed(logs),
            Table {
                title: model.to_owned(),
                ..sensors.model.table()
            },
        ],
        sections: vec![
            Section {
                title: "Side by side",
                note: "Biases change from switch-on to switch-on: where logs differ, so may the unit.",
                figures: (shared.iter())
                    .filter(|one| one.known().next().is_some())
                    .map(|one| one.figure(&names))
                    .collect(),
            },
            Section {
                title: "Sensors at rest, all logs",
                note: "",
                figures: super::charts::allan_figures(sensors),
            },
        ],
    }
}

/// A quantity of the unit, as each log tells it.
struct Shared {
    name: String,
    unit: &'static str,
    told: Vec<Quantity>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Agreement {
    Agree,
    Differ,
    /// Fewer than two logs show it.
    Unknown,
}

/// Whether all are in the axes of the first.
fn alike(logs: &[Summary]) -> bool {
    logs.windows(2)
        .all(|two| two[0].body_axes == two[1].body_axes)
}

/// What should not change from log to log: not the heading, nor what lies along axes that are not the same.
fn shared(logs: &[Summary]) -> Vec<Shared> {
    let of_all = |index: usize| Shared {
        name: QUANTITIES[index].1.to_owned(),
        unit: QUANTITIES[index].2,
        told: (logs.iter())
            .map(|log| log.quantities.columns()[index].1)
            .collect(),
    };
    let antenna = |axis: usize| {
        // None where the navigator was told instead.
        let told = |log: &Summary| Some(log.lever_arm_m.as_ref()?.each()[axis]);
        Some(Shared {
            name: format!("Antenna {}", ["x", "y", "z"][axis]),
            unit: "m",
            told: logs.iter().map(told).collect::<Option<_>>()?,
        })
    };
    let axes = if alike(logs) { 3 } else { 0 };
    let biases = (1..=2 * axes).map(of_all);
    biases
        .chain((0..axes).filter_map(antenna))
        .chain([of_all(7)])
        .collect()
}

impl Shared {
    fn known(&self) -> impl Iterator<Item = &Quantity> {
        self.told.iter().filter(|quantity| quantity.observable())
    }

    /// Mean weighted by the sigmas, and its own.
    fn mean(&self) -> (f64, f64) {
        let weight = |q: &Quantity| (q.sigma * q.sigma).recip();
        let weights: f64 = self.known().map(weight).sum();
        let sum: f64 = self.known().map(|q| q.value * weight(q)).sum();
        (sum / weights, weights.sqrt().recip())
    }

    fn agreement(&self) -> Agreement {
        let (mean, _) = self.mean();
        let squares = self
            .known()
            .map(|q| ((q.value - mean) / q.sigma).powi(2))
            .sum::<f64>();
        let freedom = self.known().count().saturating_sub(1);
        match ChiSquared::new(freedom as f64) {
            Ok(chi) if chi.sf(squares) < CHANCE => Agreement::Differ,
            Ok(_) => Agreement::Agree,
            Err(_) => Agreement::Unknown,
        }
    }

    fn figure(&self, names: &[&str]) -> Figure {
        let told = self.told.iter().zip(names).enumerate();
        let bars: Vec<(Spread, String)> = told
            .filter(|(_, (quantity, _))| quantity.observable())
            .map(|(index, (quantity, name))| {
                let spread = ((index + 1) as f64, quantity.value, quantity.sigma);
                let text = format!("{name}: {}", words::with_sigma(quantity));
                (spread, text)
            })
            .collect();
        let mut chart = Chart::new(&self.name, "log", self.unit).counted(names.len());
        if self.agreement() == Agreement::Agree {
            let (mean, sigma) = self.mean();
            let ends = [0.5, names.len() as f64 + 0.5];
            chart = chart.band("mean, one sigma", GREY, &ends.map(|x| (x, mean, sigma)));
        }
        chart
            .error_bars("estimate, one sigma", BLUE, &bars)
            .figure()
    }
}

fn listed(logs: &[Summary]) -> Table {
    let row = |(number, log): (usize, &Summary)| {
        let minutes = format!("{:.1}", log.duration_s / 60.0);
        vec![format!("log {number}"), minutes, log.log.clone()]
    };
    Table::of("The logs", heads("| min | name"), (1..).zip(logs).map(row))
}

fn side_by_side(logs: &[Summary], shared: &[Shared]) -> Table {
    let mut header = heads("| unit");
    header.extend((1..=logs.len()).map(|number| format!("log {number}")));
    header.extend(heads("mean | do they agree"));
    let row = |one: &Shared| {
        let mut row = vec![one.name.clone(), one.unit.to_owned()];
        row.extend(one.told.iter().map(words::in_words));
        let (mean, sigma) = one.mean();
        let (mean, agree) = match one.agreement() {
            Agreement::Agree => {
                let mean = format!("{} \u{b1} {}", digits(sigma, mean), digits(sigma, sigma));
                (mean, "yes")
            }
            // Of what differs a mean with a sigma would claim too much.
            Agreement::Differ => (String::new(), "no"),
            Agreement::Unknown => (String::new(), "fewer than two logs show it"),
        };
        row.extend([mean, agree.to_owned()]);
        row
    };
    Table::of("Estimates side by side", header, shared.iter().map(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ins_core::Observability;

    fn told(values: &[f64], observability: Observability) -> Shared {
        let quantity = |value: &f64| Quantity {
            value: *value,
            sigma: 1.0,
            observability,
        };
        Shared {
            name: String::new(),
            unit: "",
            told: values.iter().map(quantity).collect(),
        }
    }

    #[test]
    fn logs_differ_where_chance_does_not_explain_it() {
        let known = |values: &[f64]| told(values, Observability::Observable).agreement();
        assert_eq!(known(&[0.0, 1.0, 2.0]), Agreement::Agree);
        assert_eq!(known(&[0.0, 0.0, 5.0]), Agreement::Differ);
        assert_eq!(known(&[3.0]), Agreement::Unknown);
        let unknown = told(&[0.0, 9.0], Observability::NeedsTurn);
        assert_eq!(unknown.agreement(), Agreement::Unknown);
    }

    #[test]
    fn a_mean_is_drawn_only_of_logs_that_agree() {
        let drawn = |values: &[f64]| {
            let shared = told(values, Observability::Observable);
            let page = serde_json::to_string(&shared.figure(&["a", "b"])).unwrap();
            page.contains("mean, one sigma")
        };
        assert!(drawn(&[0.0, 1.0]));
        assert!(!drawn(&[0.0, 9.0]));
    }
}

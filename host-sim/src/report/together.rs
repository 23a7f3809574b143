//! Several logs of one unit on one page: do their estimates agree?

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::identify::error_model::Sensors;
use crate::identify::quantities::{QUANTITIES, Quantity};
use crate::identify::summary::Summary;
use crate::identify::words;
use crate::page::chart::{Chart, Figure, SigmaPoint};
use crate::page::digits;
use crate::page::html::{Page, Section};
use crate::page::plot::{BLUE, GREY};
use crate::page::table::{Table, heads};

/// Significance level of the test that logs agree.
const SIGNIFICANCE: f64 = 0.01;

pub(crate) fn page(logs: &[Summary], sensors: &Sensors) -> Page {
    let shared: Vec<SharedQuantity> = shared_quantities(logs);
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
    let axes = (!same_axes(logs)).then(|| {
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
            log_list(logs),
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
                    .filter(|one| one.observable().next().is_some())
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

/// A quantity of the unit, as estimated from each log.
struct SharedQuantity {
    name: String,
    unit: &'static str,
    estimates: Vec<Quantity>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Agreement {
    Agree,
    Differ,
    /// Observable in fewer than two logs.
    Unknown,
}

/// Whether all logs have the same axes.
fn same_axes(logs: &[Summary]) -> bool {
    logs.windows(2)
        .all(|two| two[0].body_axes == two[1].body_axes)
}

/// Quantities that should not change from log to log: not the heading, and none along axes that differ.
fn shared_quantities(logs: &[Summary]) -> Vec<SharedQuantity> {
    let of_all = |index: usize| SharedQuantity {
        name: QUANTITIES[index].1.to_owned(),
        unit: QUANTITIES[index].2,
        estimates: (logs.iter())
            .map(|log| log.quantities.columns()[index].1)
            .collect(),
    };
    let antenna = |axis: usize| {
        // `None` if it is configured, not estimated.
        let estimates = |log: &Summary| Some(log.lever_arm_m.as_ref()?.each()[axis]);
        Some(SharedQuantity {
            name: format!("Antenna {}", ["x", "y", "z"][axis]),
            unit: "m",
            estimates: logs.iter().map(estimates).collect::<Option<_>>()?,
        })
    };
    let axes = if same_axes(logs) { 3 } else { 0 };
    let biases = (1..=2 * axes).map(of_all);
    biases
        .chain((0..axes).filter_map(antenna))
        .chain([of_all(7)])
        .collect()
}

impl SharedQuantity {
    fn observable(&self) -> impl Iterator<Item = &Quantity> {
        self.estimates.iter().filter(|q| q.observable())
    }

    /// Weighted mean, and its sigma.
    fn mean(&self) -> (f64, f64) {
        let weight = |q: &Quantity| (q.sigma * q.sigma).recip();
        let weights: f64 = self.observable().map(weight).sum();
        let sum: f64 = self.observable().map(|q| q.value * weight(q)).sum();
        (sum / weights, weights.sqrt().recip())
    }

    fn agreement(&self) -> Agreement {
        let (mean, _) = self.mean();
        let squares = self
            .observable()
            .map(|q| ((q.value - mean) / q.sigma).powi(2))
            .sum::<f64>();
        let degrees_of_freedom = self.observable().count().saturating_sub(1);
        match ChiSquared::new(degrees_of_freedom as f64) {
            Ok(chi) if chi.sf(squares) < SIGNIFICANCE => Agreement::Differ,
            Ok(_) => Agreement::Agree,
            Err(_) => Agreement::Unknown,
        }
    }

    fn figure(&self, names: &[&str]) -> Figure {
        let estimates = self.estimates.iter().zip(names).enumerate();
        let bars: Vec<(SigmaPoint, String)> = estimates
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

fn log_list(logs: &[Summary]) -> Table {
    let row = |(number, log): (usize, &Summary)| {
        let minutes = format!("{:.1}", log.duration_s / 60.0);
        vec![format!("log {number}"), minutes, log.log.clone()]
    };
    Table::of("The logs", heads("| min | name"), (1..).zip(logs).map(row))
}

fn side_by_side(logs: &[Summary], shared: &[SharedQuantity]) -> Table {
    let mut header = heads("| unit");
    header.extend((1..=logs.len()).map(|number| format!("log {number}")));
    header.extend(heads("mean | do they agree"));
    let row = |one: &SharedQuantity| {
        let mut row = vec![one.name.clone(), one.unit.to_owned()];
        row.extend(one.estimates.iter().map(words::in_words));
        let (mean, sigma) = one.mean();
        let (mean, agree) = match one.agreement() {
            Agreement::Agree => {
                let mean = format!("{} \u{b1} {}", digits(sigma, mean), digits(sigma, sigma));
                (mean, "yes")
            }
            // A mean with a sigma would be misleading.
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

    fn shared(values: &[f64], observability: Observability) -> SharedQuantity {
        let quantity = |value: &f64| Quantity {
            value: *value,
            sigma: 1.0,
            observability,
        };
        SharedQuantity {
            name: String::new(),
            unit: "",
            estimates: values.iter().map(quantity).collect(),
        }
    }

    #[test]
    fn logs_differ_where_chance_does_not_explain_it() {
        let agreement = |values: &[f64]| shared(values, Observability::Observable).agreement();
        assert_eq!(agreement(&[0.0, 1.0, 2.0]), Agreement::Agree);
        assert_eq!(agreement(&[0.0, 0.0, 5.0]), Agreement::Differ);
        assert_eq!(agreement(&[3.0]), Agreement::Unknown);
        let unknown = shared(&[0.0, 9.0], Observability::NeedsTurn);
        assert_eq!(unknown.agreement(), Agreement::Unknown);
    }

    #[test]
    fn a_mean_is_drawn_only_of_logs_that_agree() {
        let drawn = |values: &[f64]| {
            let shared = shared(values, Observability::Observable);
            let page = serde_json::to_string(&shared.figure(&["a", "b"])).unwrap();
            page.contains("mean, one sigma")
        };
        assert!(drawn(&[0.0, 1.0]));
        assert!(!drawn(&[0.0, 9.0]));
    }
}

//! Summary of a campaign: accuracy with the true models, and as predicted with the identified ones.
//!
//! Sums of integers, so that they do not depend on the order in which runs were finished.

use std::collections::BTreeMap;

use serde::Serialize;

use super::plan::Plan;
use super::run::{FlightErrors, FlightModel, Line, QUARTERS};
use crate::identify::error_model::interval::{Interval, plain_mean};
use crate::page::table::{Table, heads};
use crate::page::{brief, digits};

/// Goal: largest deviation of predicted over true accuracy from one.
pub const GOAL: f64 = 0.1;

/// Fewest units for an interval of a ratio: of fewer, on logarithms, its factor would be in the thousands.
const FEWEST_UNITS: usize = 5;

/// Name, unit, value of one count in it, and quarter of each figure.
const FIGURES: [(&str, &str, f64, u32); 9] = [
    ("azimuth when GNSS goes", "deg", 1e-3, 0),
    ("position", "km", 1e-5, 1),
    ("position", "km", 1e-5, 2),
    ("position", "km", 1e-5, 3),
    ("position", "km", 1e-5, 4),
    ("velocity", "m/s", 1e-3, 1),
    ("velocity", "m/s", 1e-3, 2),
    ("velocity", "m/s", 1e-3, 3),
    ("velocity", "m/s", 1e-3, 4),
];

#[derive(Clone, Debug)]
pub struct Tally {
    /// By unit, and there by model.
    units: Vec<[Flights; 2]>,
}

/// By number: one that two shards have flown counts once. One that could not be flown has a reason.
type Flights = BTreeMap<u32, Result<FlightErrors, String>>;

impl Tally {
    pub fn new(plan: &Plan) -> Self {
        Self {
            units: vec![Default::default(); plan.units as usize],
        }
    }

    pub fn add(&mut self, line: &Line) {
        if let Line::Flight {
            unit,
            with,
            flight,
            flown,
            why,
        } = line
            && let Some(models) = self.units.get_mut(*unit as usize)
        {
            let flown = flown.ok_or_else(|| why.clone().unwrap_or_default());
            models[usize::from(*with == FlightModel::Identified)].insert(*flight, flown);
        }
    }

    /// Flights of the plan that are missing.
    pub fn missing(&self, plan: &Plan) -> u64 {
        let all = 2 * u64::from(plan.units) * u64::from(plan.flights);
        let there: usize = self.units.iter().flatten().map(Flights::len).sum();
        all.saturating_sub(there as u64)
    }
}

/// RMS of one figure, with the true models and with the identified ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub figure: &'static str,
    pub unit: &'static str,
    /// Since the end of GNSS, min.
    pub minutes: f64,
    pub truth: Interval,
    /// With the identified models: predicted from drives.
    pub predicted: Interval,
    /// Predicted over true, geometric mean over the units; of few units without bounds.
    pub ratio: Interval,
    /// Units that have flown with both models.
    pub units: usize,
    /// Those of them whose ratio is beyond the goal.
    pub units_beyond_goal: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub plan: Plan,
    pub flown: usize,
    pub failed: usize,
    /// Why the first of these failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// None where fewer than two units have flown with both models.
    pub rows: Vec<Row>,
}

impl Summary {
    pub fn new(plan: &Plan, tally: &Tally) -> Self {
        let all = || tally.units.iter().flatten().flat_map(Flights::values);
        let flown = all().flatten().count();
        let rows = (0..FIGURES.len()).filter_map(|which| row(plan, tally, which));
        let mut rows: Vec<Row> = rows.collect();
        // Quarters of a short flight end in the same minute.
        rows.dedup_by_key(|row| (row.figure, row.minutes.to_bits()));
        Self {
            plan: plan.clone(),
            flown,
            failed: all().count() - flown,
            why: all().find_map(|flown| flown.as_ref().err().cloned()),
            rows,
        }
    }

    pub fn table(&self) -> Table {
        let header = heads(
            "RMS error | after, min | true models (95 %) | predicted (95 %) \
             | predicted / true, geometric mean (95 %) | units beyond 10 %",
        );
        let row = |row: &Row| {
            let of = |interval: &Interval| {
                let width = 0.5 * (interval.high - interval.low);
                let [value, low, high] = interval.each().map(|v| digits(width, v));
                format!("{value} ({low} to {high})")
            };
            vec![
                format!("{}, {}", row.figure, row.unit),
                row.minutes.to_string(),
                of(&row.truth),
                of(&row.predicted),
                if row.ratio.high.is_finite() {
                    of(&row.ratio)
                } else {
                    brief(row.ratio.value)
                },
                format!("{} of {}", row.units_beyond_goal, row.units),
            ]
        };
        Table::of("", header, self.rows.iter().map(row))
    }
}

/// None with fewer than two units flown, too few for an interval.
fn row(plan: &Plan, tally: &Tally, which: usize) -> Option<Row> {
    let (figure, unit, scale, quarter) = FIGURES[which];
    let mean_square = |flights: &Flights| {
        let figures = flights.values().flatten().map(|f| f.figures()[which]);
        let sum: u128 = figures.clone().map(|f| u128::from(f).pow(2)).sum();
        let count = figures.count();
        (count > 0).then(|| sum as f64 / count as f64)
    };
    let units: Vec<[f64; 2]> = (tally.units.iter())
        .filter_map(|[truth, found]| Some([mean_square(truth)?, mean_square(found)?]))
        .collect();
    let squares = |model: usize| -> Vec<f64> { units.iter().map(|unit| unit[model]).collect() };
    let [truth, predicted] = [0, 1].map(squares);
    let both = truth.iter().zip(&predicted);
    let ratios: Vec<f64> = both.map(|(t, p)| (p / t).sqrt()).collect();
    let beyond = |ratio: &&f64| (**ratio - 1.0).abs() > GOAL;
    let mean = plain_mean(ratios.iter().map(|ratio| libm::log(*ratio)))?.map(libm::exp);
    let minute = (quarter * plan.minutes_free).div_ceil(QUARTERS);
    Some(Row {
        figure,
        unit,
        minutes: f64::from(minute),
        truth: rms(&truth)?.scaled(scale),
        predicted: rms(&predicted)?.scaled(scale),
        ratio: if ratios.len() < FEWEST_UNITS {
            Interval {
                low: 0.0,
                high: f64::INFINITY,
                ..mean
            }
        } else {
            mean
        },
        units: ratios.len(),
        units_beyond_goal: ratios.iter().filter(beyond).count(),
    })
}

/// Root of the mean over units of mean squares; Student's t over the units.
fn rms(squares: &[f64]) -> Option<Interval> {
    let mean = plain_mean(squares.iter().copied())?;
    Some(mean.map(|square| square.max(0.0).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(minutes_free: u32) -> Plan {
        let text = format!(
            "units = 2\ndrives = 1\ndrive_minutes = 1\nflights = 1\nminutes_aided = 1\n\
             minutes_free = {minutes_free}\n"
        );
        toml::from_str(&text).unwrap()
    }

    /// The one flight of both units with both models.
    fn lines(flown: Option<fn(u64) -> FlightErrors>) -> Vec<Line> {
        let line = |unit: u32, with: FlightModel| Line::Flight {
            unit,
            with,
            flight: 0,
            flown: flown.map(|of_size| of_size(u64::from(unit) + 1)),
            why: flown.is_none().then(|| format!("unit {unit} came down")),
        };
        let models = [FlightModel::True, FlightModel::Identified];
        let units = [0, 1].into_iter();
        units
            .flat_map(|unit| models.map(|with| line(unit, with)))
            .collect()
    }

    fn flown(size: u64) -> FlightErrors {
        FlightErrors {
            position_cm: [size; QUARTERS as usize],
            velocity_mmps: [size; QUARTERS as usize],
            azimuth_mdeg: size,
        }
    }

    fn tally(plan: &Plan, lines: &[Line]) -> Tally {
        let mut tally = Tally::new(plan);
        for line in lines {
            tally.add(line);
        }
        tally
    }

    #[test]
    fn quarters_that_end_in_one_minute_are_one_row() {
        let minutes = |plan: &Plan| -> Vec<f64> {
            let rows = Summary::new(plan, &tally(plan, &lines(Some(flown)))).rows;
            rows.iter().map(|row| row.minutes).collect()
        };
        assert_eq!(minutes(&plan(2)), [0.0, 1.0, 2.0, 1.0, 2.0]);
        assert_eq!(minutes(&plan(8)).len(), FIGURES.len());
    }

    #[test]
    fn a_flight_that_two_shards_have_flown_counts_once() {
        let (plan, lines) = (plan(2), lines(Some(flown)));
        let one_missing = [&lines[..3], &lines[..1]].concat();
        assert_eq!(tally(&plan, &one_missing).missing(&plan), 1);
        let twice = tally(&plan, &[&lines[..], &lines[..]].concat());
        assert_eq!(twice.missing(&plan), 0);
        let once = Summary::new(&plan, &tally(&plan, &lines));
        assert_eq!(Summary::new(&plan, &twice), once);
    }

    #[test]
    fn two_units_of_three_have_a_ratio_and_no_interval() {
        let plan = Plan {
            units: 3,
            ..plan(2)
        };
        let summary = Summary::new(&plan, &tally(&plan, &lines(Some(flown))));
        assert!(summary.rows[0].ratio.high.is_infinite());
        let table = summary.table().plain();
        assert!(
            table.contains("0 of 2") && !table.contains("of 3"),
            "{table}"
        );
        assert_eq!(
            table.lines().nth(2).unwrap().matches('(').count(),
            2,
            "{table}"
        );
    }

    #[test]
    fn a_campaign_without_a_flight_says_why() {
        let plan = plan(2);
        let summary = Summary::new(&plan, &tally(&plan, &lines(None)));
        assert!(summary.rows.is_empty());
        assert_eq!((summary.flown, summary.failed), (0, 4));
        assert_eq!(summary.why.as_deref(), Some("unit 0 came down"));
    }
}

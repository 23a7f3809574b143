//! What a campaign says: the accuracy that the models foretell.
//!
//! Sums of whole numbers, so that the order in which runs were finished leaves no trace and the
//! memory does not grow with them.

use serde::Serialize;

use super::plan::Plan;
use super::run::{Line, QUARTERS, With};
use crate::identify::error_model::interval::{Interval, plain_mean};
use crate::page::digits;
use crate::page::table::{Table, heads};

/// Goal: predicted over true accuracy, off by no more than this.
pub const GOAL: f64 = 0.1;

/// What figures are called, their unit, how many of it one count is, and the quarter they are of.
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

/// Sums over the flights of one unit with one model.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    flown: u64,
    failed: u64,
    squares: [u128; 9],
}

/// Sums as runs come in.
#[derive(Clone, Debug)]
pub struct Tally {
    /// By unit, and there by model.
    units: Vec<[Sums; 2]>,
}

impl Tally {
    pub fn new(plan: &Plan) -> Self {
        Self {
            units: vec![[Sums::default(); 2]; plan.units as usize],
        }
    }

    pub fn add(&mut self, line: &Line) {
        let Line::Flight {
            unit, with, flown, ..
        } = line
        else {
            return;
        };
        let Some(models) = self.units.get_mut(*unit as usize) else {
            return;
        };
        let sums = &mut models[usize::from(*with == With::Identified)];
        let Some(flown) = flown else {
            sums.failed += 1;
            return;
        };
        sums.flown += 1;
        for (sum, value) in sums.squares.iter_mut().zip(flown.figures()) {
            *sum += u128::from(value) * u128::from(value);
        }
    }

    /// Whether a unit has more flights than it should.
    pub fn has_repeats(&self, plan: &Plan) -> bool {
        let all = u64::from(plan.flights);
        (self.units.iter().flatten()).any(|sums| sums.flown + sums.failed > all)
    }

    /// Flights that a plan asks for and that are not there.
    pub fn missing(&self, plan: &Plan) -> u64 {
        let there = |sums: &Sums| sums.flown + sums.failed;
        let all = 2 * u64::from(plan.units) * u64::from(plan.flights);
        all.saturating_sub(self.units.iter().flatten().map(there).sum())
    }
}

/// RMS of one figure, with the true models and with the identified ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub figure: &'static str,
    pub unit: &'static str,
    /// Since GNSS went, min.
    pub minutes: f64,
    pub truth: Interval,
    /// With the identified models: what drives foretell.
    pub predicted: Interval,
    /// Predicted over true, unit by unit.
    pub ratio: Interval,
    /// Units where the two differ by more than the goal.
    pub units_beyond_goal: usize,
}

/// The results of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub plan: Plan,
    /// Flights that gave figures.
    pub flown: u64,
    /// Flights that could not be flown.
    pub failed: u64,
    pub rows: Vec<Row>,
}

impl Summary {
    pub fn new(plan: &Plan, tally: &Tally) -> Self {
        let sum = |count: fn(&Sums) -> u64| tally.units.iter().flatten().map(count).sum();
        Self {
            plan: plan.clone(),
            flown: sum(|sums| sums.flown),
            failed: sum(|sums| sums.failed),
            rows: (0..FIGURES.len())
                .filter_map(|which| row(plan, tally, which))
                .collect(),
        }
    }

    pub fn table(&self) -> Table {
        let header = heads(
            "RMS error | after, min | true models | predicted | predicted / true \
             | units beyond 10 %",
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
                of(&row.ratio),
                format!("{} of {}", row.units_beyond_goal, self.plan.units),
            ]
        };
        Table::of("", header, self.rows.iter().map(row))
    }
}

/// None with fewer than two units flown: nothing to draw an interval from.
fn row(plan: &Plan, tally: &Tally, which: usize) -> Option<Row> {
    let (figure, unit, scale, quarter) = FIGURES[which];
    let squares = |model: usize| -> Vec<f64> {
        (tally.units.iter())
            .filter(|models| models.iter().all(|sums| sums.flown > 0))
            .map(|models| models[model].squares[which] as f64 / models[model].flown as f64)
            .collect()
    };
    let [truth, predicted] = [0, 1].map(squares);
    let both = truth.iter().zip(&predicted);
    let ratios: Vec<f64> = both.map(|(t, p)| (p / t).sqrt()).collect();
    let beyond = |ratio: &&f64| (**ratio - 1.0).abs() > GOAL;
    let minute = (quarter * plan.minutes_free).div_ceil(QUARTERS);
    Some(Row {
        figure,
        unit,
        minutes: f64::from(minute),
        truth: rms(&truth)?.scaled(scale),
        predicted: rms(&predicted)?.scaled(scale),
        ratio: by_logarithm(&ratios)?,
        units_beyond_goal: ratios.iter().filter(beyond).count(),
    })
}

/// Root of the mean over units of mean squares; Student's t over the units.
fn rms(squares: &[f64]) -> Option<Interval> {
    let mean = plain_mean(squares.iter().copied())?;
    Some(mean.map(|square| square.max(0.0).sqrt()))
}

/// Geometric mean.
fn by_logarithm(ratios: &[f64]) -> Option<Interval> {
    let mean = plain_mean(ratios.iter().map(|ratio| libm::log(*ratio)))?;
    Some(mean.map(libm::exp))
}

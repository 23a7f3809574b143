//! Accuracy of each algorithm over the flights, with separate intervals for the scatter of the flights
//! and the uncertainty of the model.

use serde::Serialize;

use super::flight::{Fault, Scenario};
use super::run::{Gnss, HEADING, Line, Outcome, POSITION, QUANTITIES, moments};
use super::settings::{Case, DriveVerdict, Key, Rehearsal, SOURCES};
use crate::identify::error_model::identified::in_file;
use crate::identify::error_model::interval::student;
use crate::identify::error_model::{Assumed, Parameter};
use crate::page::table::Table;
use crate::statistics::{mean_and_variance, rms, rms_of_any, whole};
use crate::study::flights::statistics::Figure;

/// Parts of the time without GNSS at whose ends errors are evaluated.
const OUTAGE_PARTS: [f64; 3] = [0.25, 0.5, 1.0];
/// Percentile of the errors.
const PERCENTILE: f64 = 0.95;

/// Fewest models for an interval: of fewer, on logarithms, its factor would be in the thousands.
pub const FEWEST_MODELS: usize = 5;

/// Errors of one quantity in one part of the flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub quantity: &'static str,
    pub unit: &'static str,
    /// Time without GNSS, s, to a tenth; none: with GNSS, over the second half of that part.
    pub without_gnss_s: Option<f64>,
    /// Flights that have a solution there.
    pub flights: usize,
    /// RMS, its 95 % interval from the scatter of the flights, and median.
    #[serde(flatten)]
    pub figure: Figure,
    pub below_95: f64,
    /// 95 % interval of the RMS from the uncertainty of the model; for the first algorithm only.
    pub model_95: Option<[f64; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    pub time_s: f64,
    pub gnss: Gnss,
    /// In the order of the quantities; none without any solution.
    pub errors: [Option<Spread>; QUANTITIES.len()],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    pub flights: usize,
    pub rms: f64,
    pub median: f64,
    pub below_95: f64,
}

/// Flights that failed with the same fault.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failed {
    pub fault: Fault,
    pub flights: usize,
    /// The first of them, and when in it.
    pub first: u32,
    pub at_s: f64,
    pub cause: String,
}

/// Flights that the aircraft could not fly, whatever the sensors' errors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotFlown {
    pub flights: usize,
    /// The first of them, and why.
    pub first: u32,
    pub cause: String,
}

/// Models drawn from the confidence intervals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Models {
    pub drawn: u32,
    /// Without a solution at the end of any flight.
    pub without: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tested {
    pub with: String,
    /// Whether the sensors' noise was recorded, not white.
    pub recorded_noise: bool,
    /// Flights that it flew to the end.
    pub flights: usize,
    /// Errors, where it had solutions.
    pub rows: Vec<Row>,
    /// Models drawn for it; for the first algorithm only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub models: Option<Models>,
    pub failures: Vec<Failed>,
    #[serde(skip)]
    pub moments: Vec<Moment>,
    /// Mean computing time of a flight, s: not reproducible.
    #[serde(skip)]
    pub took_s: f64,
}

/// Error budget of the first algorithm, one source of errors: RMS.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BudgetLine {
    /// Which; none: all together, over the same flights.
    pub source: Option<&'static str>,
    /// The source alone, in the order of [`BUDGETED`].
    pub alone: [Option<f64>; BUDGETED.len()],
    /// All but it.
    pub without: [Option<f64>; BUDGETED.len()],
}

/// Quantities of the budget, and whether they are those at the end of the part without GNSS.
pub const BUDGETED: [(usize, bool); 4] = [
    (POSITION, false),
    (HEADING, false),
    (POSITION, true),
    (HEADING, true),
];

#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    pub drives: Vec<String>,
    /// Verdicts on them.
    pub verdicts: Vec<DriveVerdict>,
    /// Flights asked for.
    pub flights: u32,
    /// Of these.
    pub not_flown: Option<NotFlown>,
    pub models: u32,
    pub duration_s: f64,
    /// Its last part without GNSS, s.
    pub free_s: f64,
    /// Last time at which errors are evaluated, since the end of GNSS, if it ends.
    #[serde(skip)]
    pub last_s: Option<f64>,
    pub tested: Vec<Tested>,
    /// Error budget of the first algorithm.
    pub budget: Vec<BudgetLine>,
    pub parameters: Vec<Parameter>,
    /// The same as a table.
    #[serde(skip)]
    pub model: Table,
    /// What is not observable in the drives, and was assumed or set.
    pub assumed: Vec<Assumed>,
    /// Keys that the user has set in place of what was identified or assumed.
    pub set: Vec<Key>,
}

/// Times, among those kept, at which errors are evaluated.
#[derive(Clone, Copy, Debug)]
enum Point {
    /// The second half of the part with GNSS.
    Aided,
    /// A time without GNSS.
    Free(usize),
}

struct Flights<'a> {
    lines: &'a [Line],
    moments: Vec<(usize, Gnss)>,
}

impl Flights<'_> {
    /// Outcomes of an algorithm in a case that ended well, flight by flight.
    fn complete(&self, case: Case, subject: usize) -> impl Iterator<Item = (u32, &Outcome)> {
        self.all(case, subject)
            .filter(|(_, outcome)| outcome.failure.is_none())
    }

    fn all(&self, case: Case, subject: usize) -> impl Iterator<Item = (u32, &Outcome)> {
        (self.lines.iter())
            .filter(move |line| line.case == case)
            .filter_map(move |line| Some((line.flight, line.outcomes.get(subject)?)))
    }

    fn value(outcome: &Outcome, moment: usize, quantity: usize) -> Option<f64> {
        let errors = (*outcome.errors.get(moment)?)?;
        Some(errors[quantity] as f64 * QUANTITIES[quantity].count)
    }

    fn at(&self, outcome: &Outcome, point: Point, quantity: usize) -> Option<f64> {
        let aided = self.aided();
        match point {
            Point::Aided => {
                let there = |moment: &usize| self.moments[*moment].1 == Gnss::Aided;
                let value = |moment| Self::value(outcome, moment, quantity);
                let moments = (aided / 2..aided).filter(there);
                let values: Vec<f64> = moments.map(value).collect::<Option<_>>()?;
                rms_of_any(values.into_iter())
            }
            Point::Free(moment) => Self::value(outcome, moment, quantity),
        }
    }

    /// The second half of the part with GNSS, and the ends of parts of that without, each once.
    fn points(&self) -> Vec<Point> {
        let aided = self.aided();
        let free = self.moments.len() - aided;
        let end = |part: &f64| aided + whole((part * free as f64).ceil()) - 1;
        let mut ends: Vec<usize> = OUTAGE_PARTS.iter().filter(|_| free > 0).map(end).collect();
        ends.dedup();
        let ends = ends.into_iter().map(Point::Free);
        [Point::Aided].into_iter().chain(ends).collect()
    }

    /// Time without GNSS there, s, to a tenth.
    fn without_gnss_s(&self, point: Point, scenario: &Scenario) -> Option<f64> {
        let Point::Free(moment) = point else {
            return None;
        };
        let time_s = (self.moments[moment].0 + 1) as f64;
        Some((10.0 * (time_s - scenario.aided_s())).round() / 10.0)
    }

    /// How many of the times are before the end of GNSS.
    fn aided(&self) -> usize {
        let gone = |(_, gnss): &(usize, Gnss)| *gnss == Gnss::Denied;
        self.moments.iter().filter(|moment| !gone(moment)).count()
    }

    fn values(&self, case: Case, subject: usize, point: Point, quantity: usize) -> Vec<(u32, f64)> {
        self.complete(case, subject)
            .filter_map(|(flight, outcome)| Some((flight, self.at(outcome, point, quantity)?)))
            .collect()
    }

    /// RMS in another case over the RMS as found, over the flights that both have.
    fn ratio(&self, case: Case, point: Point, quantity: usize) -> Option<f64> {
        let here = self.values(case, 0, point, quantity);
        let found = self.values(Case::Found, 0, point, quantity);
        let both: Vec<(f64, f64)> = (here.iter())
            .filter_map(|(flight, value)| {
                let as_found = found.iter().find(|(other, _)| other == flight)?;
                Some((*value, as_found.1))
            })
            .collect();
        let sum = |value: fn(&(f64, f64)) -> f64| rms(both.iter().map(value));
        (!both.is_empty()).then(|| sum(|pair| pair.0) / sum(|pair| pair.1))
    }
}

/// RMS, median and percentile; none without values.
fn spread(values: &[f64]) -> Option<Spread> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = |part: f64| {
        let rank = part * last as f64;
        let below = whole(rank);
        let above = sorted[(below + 1).min(last)];
        sorted[below] + (rank - below as f64) * (above - sorted[below])
    };
    Some(Spread {
        flights: values.len(),
        rms: rms(values.iter().copied()),
        median: at(0.5),
        below_95: at(PERCENTILE),
    })
}

/// 95 % interval over models, from the logarithms of their RMS over that of the identified one.
fn model_interval(rms: f64, ratios: &[f64]) -> Option<[f64; 2]> {
    let logarithms: Vec<f64> = (ratios.iter())
        .map(|ratio| libm::log(*ratio))
        .filter(|logarithm| logarithm.is_finite())
        .collect();
    let enough = (logarithms.len() >= FEWEST_MODELS).then_some(&logarithms);
    let (middle, variance) = mean_and_variance(enough?)?;
    let half = student(logarithms.len() as f64 - 1.0) * variance.sqrt();
    Some([middle - half, middle + half].map(|bound| rms * libm::exp(bound)))
}

impl Summary {
    pub fn new(rehearsal: &Rehearsal, scenario: &Scenario, lines: &[Line]) -> Self {
        let settings = &rehearsal.settings;
        let flights = Flights {
            lines,
            moments: moments(scenario, &settings.model.gnss),
        };
        let cases = [
            Some(Case::Found),
            rehearsal.noise.as_ref().map(|_| Case::Recorded),
        ];
        let mut tested = Vec::new();
        for subject in 0..rehearsal.subjects.len() {
            for case in cases.into_iter().flatten() {
                tested.push(Tested::new(&flights, rehearsal, scenario, case, subject));
            }
        }
        Self {
            drives: settings.drives.clone(),
            verdicts: rehearsal.verdicts.clone(),
            flights: settings.flights,
            not_flown: not_flown(lines),
            models: settings.models,
            duration_s: scenario.duration_s,
            free_s: scenario.free_s,
            last_s: (flights.points().last())
                .and_then(|last| flights.without_gnss_s(*last, scenario)),
            tested,
            budget: budget(&flights),
            parameters: rehearsal.found.parameters(),
            model: rehearsal.found.table(),
            assumed: assumed(rehearsal),
            set: settings.keys(),
        }
    }

    /// Flights that have a solution there.
    pub fn solved(&self, tested: &Tested) -> usize {
        let last = tested.row(POSITION, self.last_s);
        last.map_or(0, |row| row.flights)
    }
}

impl Tested {
    fn new(
        flights: &Flights,
        rehearsal: &Rehearsal,
        scenario: &Scenario,
        case: Case,
        subject: usize,
    ) -> Self {
        let points = flights.points();
        let drawn = rehearsal.settings.models;
        let of_models = subject == 0 && case == Case::Found && drawn > 0;
        let row = |(point, quantity): (Point, usize)| {
            let values = flights.values(case, subject, point, quantity);
            let values: Vec<f64> = values.into_iter().map(|(_, value)| value).collect();
            let spread = spread(&values)?;
            let figure = Figure::of(&values);
            let ratios: Vec<f64> = (0..drawn)
                .filter(|_| of_models)
                .filter_map(|draw| flights.ratio(Case::Drawn(draw), point, quantity))
                .collect();
            Some(Row {
                quantity: QUANTITIES[quantity].name,
                unit: QUANTITIES[quantity].unit,
                without_gnss_s: flights.without_gnss_s(point, scenario),
                flights: values.len(),
                model_95: model_interval(figure.rms, &ratios),
                figure,
                below_95: spread.below_95,
            })
        };
        let all = (0..QUANTITIES.len()).flat_map(|q| points.iter().map(move |point| (*point, q)));
        let complete: Vec<(u32, &Outcome)> = flights.complete(case, subject).collect();
        let last = points.last().copied().unwrap_or(Point::Aided);
        let without = |draw: &u32| {
            let values = flights.values(Case::Drawn(*draw), 0, last, POSITION);
            values.is_empty()
        };
        let models = of_models.then(|| Models {
            drawn,
            without: (0..drawn).filter(without).count(),
        });
        let took_ms: u64 = complete.iter().map(|(_, outcome)| outcome.took_ms).sum();
        Self {
            with: rehearsal.subjects[subject].name(),
            recorded_noise: case == Case::Recorded,
            flights: complete.len(),
            rows: all.filter_map(row).collect(),
            models,
            failures: failures(flights.all(case, subject)),
            moments: over_time(flights, &complete),
            took_s: 1e-3 * took_ms as f64 / complete.len() as f64,
        }
    }

    pub fn row(&self, quantity: usize, without_gnss_s: Option<f64>) -> Option<&Row> {
        (self.rows.iter()).find(|row| {
            row.quantity == QUANTITIES[quantity].name && row.without_gnss_s == without_gnss_s
        })
    }
}

fn over_time(flights: &Flights, complete: &[(u32, &Outcome)]) -> Vec<Moment> {
    (flights.moments.iter().enumerate())
        .map(|(moment, &(ask, gnss))| Moment {
            time_s: (ask + 1) as f64,
            gnss,
            errors: core::array::from_fn(|quantity| {
                let values: Vec<f64> = (complete.iter())
                    .filter_map(|(_, outcome)| Flights::value(outcome, moment, quantity))
                    .collect();
                spread(&values)
            }),
        })
        .collect()
}

/// What is not observable in the drives, with the values of the flights.
fn assumed(rehearsal: &Rehearsal) -> Vec<Assumed> {
    let (mut all, keys) = (rehearsal.found.assumed(), rehearsal.settings.keys());
    for part in &mut all {
        if keys.iter().any(|key| key.sets(part.name)) {
            part.value = in_file(&rehearsal.settings.model, part.name);
            part.why = "set by --set";
        }
    }
    all
}

fn not_flown(lines: &[Line]) -> Option<NotFlown> {
    let found = lines.iter().filter(|line| line.case == Case::Found);
    let failed: Vec<(u32, &String)> = found
        .filter_map(|line| Some((line.flight, line.why.as_ref()?)))
        .collect();
    failed.first().map(|&(first, cause)| NotFlown {
        flights: failed.len(),
        first,
        cause: cause.clone(),
    })
}

fn failures<'a>(outcomes: impl Iterator<Item = (u32, &'a Outcome)>) -> Vec<Failed> {
    let mut all: Vec<Failed> = Vec::new();
    for (flight, outcome) in outcomes {
        let Some(failure) = &outcome.failure else {
            continue;
        };
        match all.iter_mut().find(|failed| failed.fault == failure.fault) {
            Some(failed) => failed.flights += 1,
            None => all.push(Failed {
                fault: failure.fault,
                flights: 1,
                first: flight,
                at_s: failure.at_s,
                cause: failure.cause.clone(),
            }),
        }
    }
    all.sort_by_key(|failed| failed.fault);
    all
}

/// Error budget of the first algorithm; all sources together last.
fn budget(flights: &Flights) -> Vec<BudgetLine> {
    let points = flights.points();
    let point = |free: bool| {
        if free {
            points[1..].last()
        } else {
            points.first()
        }
    };
    let of_case = |case: Case, few: &[u32]| {
        BUDGETED.map(|(quantity, free)| {
            let values = flights.values(case, 0, *point(free)?, quantity).into_iter();
            let of_few = values.filter(|(flight, _)| few.contains(flight));
            rms_of_any(of_few.map(|(_, value)| value))
        })
    };
    let mut costs = Vec::new();
    let mut few = Vec::new();
    for (source, (name, _)) in SOURCES.iter().enumerate() {
        let only = flights.all(Case::Only(source), 0);
        let flown: Vec<u32> = only.map(|(flight, _)| flight).collect();
        if flown.is_empty() {
            continue;
        }
        costs.push(BudgetLine {
            source: Some(name),
            alone: of_case(Case::Only(source), &flown),
            without: of_case(Case::Without(source), &flown),
        });
        few = flown;
    }
    if !costs.is_empty() {
        let all = of_case(Case::Found, &few);
        costs.push(BudgetLine {
            source: None,
            alone: all,
            without: [None; BUDGETED.len()],
        });
    }
    costs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_that_cannot_be_flown_is_one_whatever_its_errors() {
        let line = |case, flight, why: Option<&str>| Line {
            case,
            flight,
            outcomes: Vec::new(),
            why: why.map(str::to_owned),
        };
        let ground = Some("hit the ground");
        let lines = [
            line(Case::Found, 0, None),
            line(Case::Found, 1, ground),
            line(Case::Drawn(0), 1, ground),
            line(Case::Only(2), 1, ground),
        ];
        let not = not_flown(&lines).unwrap();
        assert_eq!(
            (not.flights, not.first, not.cause.as_str()),
            (1, 1, "hit the ground")
        );
        assert_eq!(not_flown(&lines[..1]), None);
    }
}

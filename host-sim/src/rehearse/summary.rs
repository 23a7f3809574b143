//! What the flights say of each algorithm: two intervals kept apart, that of the flights and that
//! of the model.

use serde::Serialize;

use super::flight::{Fault, World};
use super::run::{Gnss, HEADING, Line, Outcome, POSITION, QUANTITIES, moments};
use super::settings::{Case, Judged, Key, Rehearsal, SOURCES};
use crate::identify::error_model::identified::in_file;
use crate::identify::error_model::interval::student;
use crate::identify::error_model::{Assumed, Parameter};
use crate::page::table::Table;
use crate::statistics::{mean_and_variance, rms, rms_of_any, whole};
use crate::study::flights::statistics::Figure;

/// Parts of the time without GNSS at whose ends errors are looked at.
const PARTS: [f64; 3] = [0.25, 0.5, 1.0];
/// Part of the errors that lie below the figure so called.
const MOST: f64 = 0.95;

/// Of fewer models there is no interval: on logarithms it would be from nothing to thousands of times.
pub const FEWEST_MODELS: usize = 5;

/// Errors of one quantity in one part of the flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub quantity: &'static str,
    pub unit: &'static str,
    /// Since GNSS went, s, to a tenth; none: with GNSS, over the second half of that part.
    pub without_gnss_s: Option<f64>,
    /// Flights that have a solution there.
    pub flights: usize,
    /// RMS, its 95 % interval from flight to flight, and median.
    #[serde(flatten)]
    pub figure: Figure,
    pub below_95: f64,
    /// 95 % interval of the RMS over models that the drives allow; the first algorithm's alone.
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

/// Flights that failed alike.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failed {
    pub fault: Fault,
    pub flights: usize,
    /// The first of them, and when in it.
    pub first: u32,
    pub at_s: f64,
    pub cause: String,
}

/// Flights that the aircraft could not fly, whatever errors they are flown with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotFlown {
    pub flights: usize,
    /// The first of them, and why.
    pub first: u32,
    pub cause: String,
}

/// Models drawn from what the drives leave open.
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
    /// Models drawn that it flew; the first algorithm's alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub models: Option<Models>,
    pub failures: Vec<Failed>,
    #[serde(skip)]
    pub moments: Vec<Moment>,
    /// Time of a flight, mean, s: no two runs have the same.
    #[serde(skip)]
    pub took_s: f64,
}

/// What one source of errors costs the first algorithm: RMS.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Which; none: all together, over the same flights.
    pub source: Option<&'static str>,
    /// The source alone, in the order of [`BUDGETED`].
    pub alone: [Option<f64>; BUDGETED.len()],
    /// All but it.
    pub without: [Option<f64>; BUDGETED.len()],
}

/// Quantities of the budget, and whether they are looked at when GNSS comes back.
pub const BUDGETED: [(usize, bool); 4] = [
    (POSITION, false),
    (HEADING, false),
    (POSITION, true),
    (HEADING, true),
];

#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    pub drives: Vec<String>,
    /// What speaks against them.
    pub verdicts: Vec<Judged>,
    /// Flights asked for.
    pub flights: u32,
    /// Of these.
    pub not_flown: Option<NotFlown>,
    pub models: u32,
    pub duration_s: f64,
    /// Its last part without GNSS, s.
    pub free_s: f64,
    /// When errors are looked at last: so long after GNSS went, if it does.
    #[serde(skip)]
    pub last_s: Option<f64>,
    pub tested: Vec<Tested>,
    /// Where the errors of the first come from.
    pub budget: Vec<Cost>,
    pub parameters: Vec<Parameter>,
    /// The same for people.
    #[serde(skip)]
    pub model: Table,
    /// What the drives do not show, and what was assumed or set.
    pub assumed: Vec<Assumed>,
    /// What the user has set in place of what was identified or assumed.
    pub set: Vec<Key>,
}

/// Where in the kept moments a figure stands.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// The second half of the part with GNSS.
    Aided,
    /// A moment without.
    Free(usize),
}

struct Flights<'a> {
    lines: &'a [Line],
    moments: Vec<(usize, Gnss)>,
}

impl Flights<'_> {
    /// Outcomes of an algorithm in a case that ended well, flight by flight.
    fn good(&self, case: Case, subject: usize) -> impl Iterator<Item = (u32, &Outcome)> {
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

    fn at(&self, outcome: &Outcome, place: Place, quantity: usize) -> Option<f64> {
        let aided = self.aided();
        match place {
            Place::Aided => {
                let there = |moment: &usize| self.moments[*moment].1 == Gnss::There;
                let value = |moment| Self::value(outcome, moment, quantity);
                let moments = (aided / 2..aided).filter(there);
                let values: Vec<f64> = moments.map(value).collect::<Option<_>>()?;
                rms_of_any(values.into_iter())
            }
            Place::Free(moment) => Self::value(outcome, moment, quantity),
        }
    }

    /// The second half of the part with GNSS, and the moments at the ends of parts of that without, each once.
    fn places(&self) -> Vec<Place> {
        let aided = self.aided();
        let free = self.moments.len() - aided;
        let end = |part: &f64| aided + whole((part * free as f64).ceil()) - 1;
        let mut ends: Vec<usize> = PARTS.iter().filter(|_| free > 0).map(end).collect();
        ends.dedup();
        let ends = ends.into_iter().map(Place::Free);
        [Place::Aided].into_iter().chain(ends).collect()
    }

    /// How long GNSS is gone there, s, to a tenth.
    fn without_gnss_s(&self, place: Place, world: &World) -> Option<f64> {
        let Place::Free(moment) = place else {
            return None;
        };
        let time_s = (self.moments[moment].0 + 1) as f64;
        Some((10.0 * (time_s - world.aided_s())).round() / 10.0)
    }

    /// How many moments are before GNSS is gone.
    fn aided(&self) -> usize {
        let gone = |(_, gnss): &(usize, Gnss)| *gnss == Gnss::Gone;
        self.moments.iter().filter(|moment| !gone(moment)).count()
    }

    fn values(&self, case: Case, subject: usize, place: Place, quantity: usize) -> Vec<(u32, f64)> {
        self.good(case, subject)
            .filter_map(|(flight, outcome)| Some((flight, self.at(outcome, place, quantity)?)))
            .collect()
    }

    /// RMS in another case over the RMS as found, over the flights that both have.
    fn ratio(&self, case: Case, place: Place, quantity: usize) -> Option<f64> {
        let here = self.values(case, 0, place, quantity);
        let found = self.values(Case::Found, 0, place, quantity);
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

/// The values that all but a few stay below, and their middle; of at least one.
fn spread(values: &[f64]) -> Option<Spread> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = |part: f64| {
        let place = part * last as f64;
        let below = whole(place);
        let above = sorted[(below + 1).min(last)];
        sorted[below] + (place - below as f64) * (above - sorted[below])
    };
    Some(Spread {
        flights: values.len(),
        rms: rms(values.iter().copied()),
        median: at(0.5),
        below_95: at(MOST),
    })
}

/// 95 % of the models, by the logarithms of their RMS over that of the one found.
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
    pub fn new(rehearsal: &Rehearsal, world: &World, lines: &[Line]) -> Self {
        let settings = &rehearsal.settings;
        let flights = Flights {
            lines,
            moments: moments(world, &settings.model.gnss),
        };
        let cases = [
            Some(Case::Found),
            rehearsal.noise.as_ref().map(|_| Case::Recorded),
        ];
        let mut tested = Vec::new();
        for subject in 0..rehearsal.subjects.len() {
            for case in cases.into_iter().flatten() {
                tested.push(Tested::new(&flights, rehearsal, world, case, subject));
            }
        }
        Self {
            drives: settings.drives.clone(),
            verdicts: rehearsal.verdicts.clone(),
            flights: settings.flights,
            not_flown: not_flown(lines),
            models: settings.models,
            duration_s: world.duration_s,
            free_s: world.free_s,
            last_s: (flights.places().last()).and_then(|last| flights.without_gnss_s(*last, world)),
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
        world: &World,
        case: Case,
        subject: usize,
    ) -> Self {
        let places = flights.places();
        let drawn = rehearsal.settings.models;
        let of_models = subject == 0 && case == Case::Found && drawn > 0;
        let row = |(place, quantity): (Place, usize)| {
            let values = flights.values(case, subject, place, quantity);
            let values: Vec<f64> = values.into_iter().map(|(_, value)| value).collect();
            let spread = spread(&values)?;
            let figure = Figure::of(&values);
            let ratios: Vec<f64> = (0..drawn)
                .filter(|_| of_models)
                .filter_map(|draw| flights.ratio(Case::Drawn(draw), place, quantity))
                .collect();
            Some(Row {
                quantity: QUANTITIES[quantity].name,
                unit: QUANTITIES[quantity].unit,
                without_gnss_s: flights.without_gnss_s(place, world),
                flights: values.len(),
                model_95: model_interval(figure.rms, &ratios),
                figure,
                below_95: spread.below_95,
            })
        };
        let all = (0..QUANTITIES.len()).flat_map(|q| places.iter().map(move |place| (*place, q)));
        let good: Vec<(u32, &Outcome)> = flights.good(case, subject).collect();
        let last = places.last().copied().unwrap_or(Place::Aided);
        let without = |draw: &u32| {
            let values = flights.values(Case::Drawn(*draw), 0, last, POSITION);
            values.is_empty()
        };
        let models = of_models.then(|| Models {
            drawn,
            without: (0..drawn).filter(without).count(),
        });
        let took_ms: u64 = good.iter().map(|(_, outcome)| outcome.took_ms).sum();
        Self {
            with: rehearsal.subjects[subject].name(),
            recorded_noise: case == Case::Recorded,
            flights: good.len(),
            rows: all.filter_map(row).collect(),
            models,
            failures: failures(flights.all(case, subject)),
            moments: over_time(flights, &good),
            took_s: 1e-3 * took_ms as f64 / good.len() as f64,
        }
    }

    pub fn row(&self, quantity: usize, without_gnss_s: Option<f64>) -> Option<&Row> {
        (self.rows.iter()).find(|row| {
            row.quantity == QUANTITIES[quantity].name && row.without_gnss_s == without_gnss_s
        })
    }
}

fn over_time(flights: &Flights, good: &[(u32, &Outcome)]) -> Vec<Moment> {
    (flights.moments.iter().enumerate())
        .map(|(moment, &(ask, gnss))| Moment {
            time_s: (ask + 1) as f64,
            gnss,
            errors: core::array::from_fn(|quantity| {
                let values: Vec<f64> = (good.iter())
                    .filter_map(|(_, outcome)| Flights::value(outcome, moment, quantity))
                    .collect();
                spread(&values)
            }),
        })
        .collect()
}

/// What does not stand on the drives, with the values that are flown.
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

/// Where the errors of the first algorithm come from; all together last.
fn budget(flights: &Flights) -> Vec<Cost> {
    let places = flights.places();
    let place = |free: bool| {
        if free {
            places[1..].last()
        } else {
            places.first()
        }
    };
    let of_case = |case: Case, few: &[u32]| {
        BUDGETED.map(|(quantity, free)| {
            let values = flights.values(case, 0, *place(free)?, quantity).into_iter();
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
        costs.push(Cost {
            source: Some(name),
            alone: of_case(Case::Only(source), &flown),
            without: of_case(Case::Without(source), &flown),
        });
        few = flown;
    }
    if !costs.is_empty() {
        let all = of_case(Case::Found, &few);
        costs.push(Cost {
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

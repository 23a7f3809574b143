//! Planning of a drive: manoeuvres are added one by one until each quantity is estimated to the
//! wanted sigma, or none of them helps.
//!
//! The gain of a manoeuvre is not derived analytically: the core is run over a simulation of it, and
//! its sigmas are taken. They depend on the geometry, on the noise that it estimates, and on when it
//! finds its heading: so several units are driven in parallel, the first exactly as planned, the
//! others with the scatter of a human driver.

mod driven_unit;
mod manoeuvre;
pub mod output;
mod quantities;
mod reason;
mod target;

pub use driven_unit::DrivenUnit;
pub use manoeuvre::{Driver, Manoeuvre, Site};
pub use quantities::{Goal, GoalStatus};
pub use target::Target;

use indicatif::ProgressBar;
use ins_core::Navigator;
use miette::Result;
use rayon::prelude::*;
use serde::Serialize;

use crate::identify::analysis::{Analysis, unusable};
use crate::identify::run::in_order_of_time;
use crate::log::{BodyAxes, Log};
use crate::sim::ErrorModel;

/// With white noise the logarithm of sigma falls by half of that of time. A sigma that falls by less
/// than this part of it is limited by something else.
const PART_OF_WHITE: f64 = 0.5;
/// Shortest step, as a part of the drive so far: a shorter one changes a sigma by less than its scatter.
/// After a log the first steps are parts of the drive since.
const MIN_STEP: f64 = 0.2;
/// Steps of one manoeuvre that are tried in a row, more only if fewer do not help: five double the
/// drive, which shows any gain that is possible.
const LOOKAHEAD: [u32; 3] = [1, 2, 5];
/// Cost of a unit without a solution, above that of any sigma, in nepers.
const NO_SOLUTION_PENALTY: f64 = 1e3;

/// A manoeuvre of the plan, its repetitions, and the sigmas after it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    pub manoeuvre: Manoeuvre,
    pub times: u32,
    /// Since the drive began, s.
    pub end_s: f64,
    pub reached: Vec<GoalStatus>,
}

/// A quantity that the plan does not bring to its target, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unreached {
    #[serde(flatten)]
    pub last: GoalStatus,
    pub why: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    pub before: Vec<GoalStatus>,
    pub stages: Vec<Stage>,
    pub unreached: Vec<Unreached>,
    /// The units at the end, the first driven exactly.
    #[serde(skip)]
    pub end: Vec<DrivenUnit>,
}

/// Units in parallel. The core takes GNSS noise as coloured in some and as white in others, and their
/// sigmas then differ by a factor of two: with so many the mean is good to some 15 %.
pub const UNITS: u64 = 10;

impl Target {
    /// The drive from the start.
    pub fn plan(&self, seed: u64, progress: &ProgressBar) -> Result<Plan> {
        let model = self.error_model()?;
        let config = self.config(&model)?;
        let start = drives(seed, |seed, driver| {
            DrivenUnit::switched_on(self, &model, config, seed, driver)
        })?;
        let (target, axes) = (self, self.unit.body_axes);
        Ok(Search { target, axes }.plan(start, progress))
    }

    /// The core at the end of a log, configured with `[config]`.
    pub fn navigator_after(&self, analysis: &Analysis) -> Result<Navigator> {
        let config = self.with_config(analysis.found.config)?;
        let mut navigator = Navigator::new(config).map_err(unusable)?;
        for event in in_order_of_time(analysis.log.imu.iter(), &analysis.log.gnss) {
            event.give_to(&mut navigator);
        }
        Ok(navigator)
    }

    /// Plan of a drive in addition to a log, at the end of which the core is.
    pub fn added_to(
        &self,
        log: &Log,
        navigator: &Navigator,
        model: &ErrorModel,
        seed: u64,
        progress: &ProgressBar,
    ) -> Result<Plan> {
        let (duration_s, imu_hz) = (log.duration_s(), log.imu_rate_hz());
        let start = drives(seed, |seed, driver| {
            let so_far = (navigator.clone(), duration_s);
            DrivenUnit::after(so_far, model, imu_hz, seed, driver)
        })?;
        let (target, axes) = (self, log.meta.body_axes);
        Ok(Search { target, axes }.plan(start, progress))
    }
}

/// One unit driven exactly, the others with scatter.
fn drives(seed: u64, drive: impl Fn(u64, Driver) -> Result<DrivenUnit>) -> Result<Vec<DrivenUnit>> {
    let driver = |unit| match unit {
        0 => Driver::exact(),
        _ => Driver::human(seed.wrapping_add(unit)),
    };
    let units = 0..UNITS;
    units
        .map(|unit| drive(seed.wrapping_add(unit), driver(unit)))
        .collect()
}

/// Search for a plan, and the axes of the unit.
#[derive(Clone, Copy, Debug)]
struct Search<'a> {
    target: &'a Target,
    axes: BodyAxes,
}

impl Search<'_> {
    fn plan(&self, start: Vec<DrivenUnit>, progress: &ProgressBar) -> Plan {
        let before = self.reached(&start);
        let mut plan = Plan {
            before,
            stages: Vec::new(),
            unreached: Vec::new(),
            end: start,
        };
        while self.missing(&plan.end) > 0.0 {
            let Some(next) = self.next(&plan.end) else {
                break;
            };
            let again = (plan.stages).pop_if(|last| last.manoeuvre == next.manoeuvre);
            plan.stages.push(Stage {
                manoeuvre: next.manoeuvre,
                times: next.times + again.map_or(0, |last| last.times),
                end_s: seconds(&next.drives),
                reached: self.reached(&next.drives),
            });
            plan.end = next.drives;
            progress.inc(1);
        }
        plan.unreached = self.unreached(&plan.end);
        plan
    }

    /// The next manoeuvre; none if nothing helps.
    fn next(&self, from: &[DrivenUnit]) -> Option<Trial> {
        let site = &self.target.site.manoeuvres;
        let longest_s = 60.0 * self.target.site.longest_minutes;
        if seconds(from) == 0.0 && site.contains(&Manoeuvre::Stand) && aligning(from) {
            // Level and gyros are best found at rest, and a car stands anyway.
            return self.tried(from, &[Manoeuvre::Stand], 1, longest_s).pop();
        }
        LOOKAHEAD
            .into_iter()
            .find_map(|steps| self.best(from, self.tried(from, site, steps, longest_s)))
    }

    fn reached(&self, drives: &[DrivenUnit]) -> Vec<GoalStatus> {
        let of = |goal: &Goal| goal.reached(navigators(drives), self.axes);
        self.target.goals.iter().map(of).collect()
    }

    fn missing(&self, drives: &[DrivenUnit]) -> f64 {
        let missing: f64 = self.reached(drives).iter().map(GoalStatus::missing).sum();
        let unsolved = drives.iter().filter(|drive| drive.is_aligning()).count();
        missing + NO_SOLUTION_PENALTY * unsolved as f64
    }

    /// Each manoeuvre simulated on copies, for some steps, as long as they end by a time; those that do
    /// not fit at all are left out.
    fn tried(
        &self,
        from: &[DrivenUnit],
        manoeuvres: &[Manoeuvre],
        steps: u32,
        longest_s: f64,
    ) -> Vec<Trial> {
        let site = &self.target.site;
        manoeuvres
            .par_iter()
            .filter_map(|manoeuvre| {
                let (first, others) = from.split_first()?;
                // A single manoeuvre may suffice after a log; that nothing more helps only one as
                // long as the log can show.
                let driven_s = match steps {
                    1 => first.seconds(),
                    _ => first.total_seconds(),
                };
                let least_s = f64::from(steps) * MIN_STEP * driven_s;
                let mut times = 0;
                let mut ahead = first.clone();
                let is_less = |ahead: &DrivenUnit, times: u32| {
                    times < steps || ahead.seconds() - first.seconds() < least_s
                };
                while is_less(&ahead, times) && ahead.seconds_after(*manoeuvre, site) <= longest_s {
                    ahead.drive(*manoeuvre, site);
                    times += 1;
                }
                let again = |bench: &DrivenUnit| {
                    let mut bench = bench.clone();
                    (0..times).for_each(|_| bench.drive(*manoeuvre, site));
                    bench
                };
                let mut drives: Vec<DrivenUnit> = others.par_iter().map(again).collect();
                drives.insert(0, ahead);
                let tried = Trial {
                    manoeuvre: *manoeuvre,
                    times,
                    drives,
                };
                (times > 0).then_some(tried)
            })
            .collect()
    }

    /// The one with the highest gain per time; none if no sigma above its target still falls.
    fn best(&self, from: &[DrivenUnit], tried: Vec<Trial>) -> Option<Trial> {
        let (before, reached) = (self.missing(from), self.reached(from));
        let helps = |drives: &[DrivenUnit]| {
            let falls = |(was, is): (&GoalStatus, &GoalStatus)| {
                !was.is_met() && falls(was, is, from, drives)
            };
            aligning(from) || reached.iter().zip(&self.reached(drives)).any(falls)
        };
        let rate = |tried: &Trial| {
            (before - self.missing(&tried.drives)) / (seconds(&tried.drives) - seconds(from))
        };
        tried
            .into_iter()
            .filter(|tried| helps(&tried.drives) && rate(tried) > 0.0)
            .max_by(|one, other| rate(one).total_cmp(&rate(other)))
    }
}

/// A manoeuvre that was tried, its repetitions, and the units after it.
struct Trial {
    manoeuvre: Manoeuvre,
    times: u32,
    drives: Vec<DrivenUnit>,
}

pub fn navigators(drives: &[DrivenUnit]) -> impl Iterator<Item = &Navigator> {
    drives.iter().map(|drive| &drive.navigator)
}

/// How long the first has been driven, s.
pub fn seconds(drives: &[DrivenUnit]) -> f64 {
    drives.first().map_or(0.0, DrivenUnit::seconds)
}

fn aligning(drives: &[DrivenUnit]) -> bool {
    drives.iter().any(DrivenUnit::is_aligning)
}

/// Whether a sigma falls as with white noise, or the quantity becomes observable.
fn falls(was: &GoalStatus, is: &GoalStatus, from: &[DrivenUnit], to: &[DrivenUnit]) -> bool {
    let known_s = |drives: &[DrivenUnit]| drives.first().map_or(0.0, DrivenUnit::total_seconds);
    let white = 0.5 * libm::log(known_s(to) / known_s(from).max(1.0));
    (is.observable && !was.observable) || libm::log(was.sigma / is.sigma) > PART_OF_WHITE * white
}

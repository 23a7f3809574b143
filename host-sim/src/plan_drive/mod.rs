//! Which drive does the user need? Manoeuvres are added one by one until each quantity is known to
//! the sigma that is wanted, or none of them helps.
//!
//! What a manoeuvre brings is not derived anew: the core itself goes over a simulation of it, and
//! says how well it knows everything then. Its sigmas hang on the geometry, on the noise that it
//! finds, and on when it finds its heading: so several units are driven side by side, the first
//! exactly as the plan says, the others as people drive.

mod bench;
mod manoeuvre;
pub mod output;
mod quantities;
mod reason;
mod target;

pub use bench::Bench;
pub use manoeuvre::{Driver, Manoeuvre, Site};
pub use quantities::{Goal, Reached};
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

/// White noise gives in half the logarithm of time. What falls less than this part of that has
/// come to what is not noise.
const OF_WHITE: f64 = 0.5;
/// Part of what has been driven that is added in one step at least: less moves a sigma by less than
/// chance does. After a log the first steps are of what has been driven since.
const STEP: f64 = 0.2;
/// Steps of one manoeuvre that are tried in a row, more only if fewer help nowhere: twice the drive
/// shows whatever ever will.
const AHEAD: [u32; 3] = [1, 2, 5];
/// To have no solution is worse than anything that is not known, in nepers.
const NO_SOLUTION: f64 = 1e3;

/// A manoeuvre of the plan, how often in a row, and what is known after it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    pub manoeuvre: Manoeuvre,
    pub times: u32,
    /// Since the drive began, s.
    pub end_s: f64,
    pub reached: Vec<Reached>,
}

/// A quantity that the plan does not bring to its target, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unreached {
    #[serde(flatten)]
    pub last: Reached,
    pub why: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    pub before: Vec<Reached>,
    pub stages: Vec<Stage>,
    pub unreached: Vec<Unreached>,
    /// As driven, the first exactly.
    #[serde(skip)]
    pub end: Vec<Bench>,
}

/// Units side by side. The core holds GNSS for coloured in some and for white in others, and their
/// sigmas then differ by a factor of two: so many that a mean of both is good to some 15 %.
pub const UNITS: u64 = 10;

impl Target {
    /// The drive from the start.
    pub fn plan(&self, seed: u64, progress: &ProgressBar) -> Result<Plan> {
        let model = self.error_model()?;
        let config = self.config(&model)?;
        let start = drives(seed, |seed, driver| {
            Bench::switched_on(self, &model, config, seed, driver)
        })?;
        let (target, axes) = (self, self.unit.body_axes);
        Ok(Search { target, axes }.plan(start, progress))
    }

    /// The core at the end of a log, with what `[config]` says.
    pub fn navigator_after(&self, analysis: &Analysis) -> Result<Navigator> {
        let config = self.with_config(analysis.found.config)?;
        let mut navigator = Navigator::new(config).map_err(unusable)?;
        for event in in_order_of_time(analysis.log.imu.iter(), &analysis.log.gnss) {
            event.give_to(&mut navigator);
        }
        Ok(navigator)
    }

    /// What a log lacks at whose end the core is, of a unit of that model.
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
            Bench::after(so_far, model, imu_hz, seed, driver)
        })?;
        let (target, axes) = (self, log.meta.body_axes);
        Ok(Search { target, axes }.plan(start, progress))
    }
}

/// One that drives exactly, and others.
fn drives(seed: u64, drive: impl Fn(u64, Driver) -> Result<Bench>) -> Result<Vec<Bench>> {
    let driver = |unit| match unit {
        0 => Driver::exact(),
        _ => Driver::human(seed.wrapping_add(unit)),
    };
    let units = 0..UNITS;
    units
        .map(|unit| drive(seed.wrapping_add(unit), driver(unit)))
        .collect()
}

/// What is searched for, the axes of the unit being these.
#[derive(Clone, Copy, Debug)]
struct Search<'a> {
    target: &'a Target,
    axes: BodyAxes,
}

impl Search<'_> {
    fn plan(&self, start: Vec<Bench>, progress: &ProgressBar) -> Plan {
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

    /// What is driven next; none if nothing helps.
    fn next(&self, from: &[Bench]) -> Option<Tried> {
        let site = &self.target.site.manoeuvres;
        let longest_s = 60.0 * self.target.site.longest_minutes;
        if seconds(from) == 0.0 && site.contains(&Manoeuvre::Stand) && aligning(from) {
            // Level and gyros are best found at rest, and a car stands anyway.
            return self.tried(from, &[Manoeuvre::Stand], 1, longest_s).pop();
        }
        AHEAD
            .into_iter()
            .find_map(|steps| self.best(from, self.tried(from, site, steps, longest_s)))
    }

    fn reached(&self, drives: &[Bench]) -> Vec<Reached> {
        let of = |goal: &Goal| goal.reached(navigators(drives), self.axes);
        self.target.goals.iter().map(of).collect()
    }

    fn missing(&self, drives: &[Bench]) -> f64 {
        let missing: f64 = self.reached(drives).iter().map(Reached::missing).sum();
        let unsolved = drives.iter().filter(|drive| drive.is_aligning()).count();
        missing + NO_SOLUTION * unsolved as f64
    }

    /// Each manoeuvre on copies, so many steps of it, as far as they end by a time; what does not
    /// fit at all is left out.
    fn tried(
        &self,
        from: &[Bench],
        manoeuvres: &[Manoeuvre],
        steps: u32,
        longest_s: f64,
    ) -> Vec<Tried> {
        let site = &self.target.site;
        manoeuvres
            .par_iter()
            .filter_map(|manoeuvre| {
                let (first, others) = from.split_first()?;
                // What a log lacks a single manoeuvre may show; whether nothing more helps only
                // one as long as the log can tell.
                let driven_s = match steps {
                    1 => first.seconds(),
                    _ => first.known_seconds(),
                };
                let least_s = f64::from(steps) * STEP * driven_s;
                let mut times = 0;
                let mut ahead = first.clone();
                let is_less = |ahead: &Bench, times: u32| {
                    times < steps || ahead.seconds() - first.seconds() < least_s
                };
                while is_less(&ahead, times) && ahead.seconds_after(*manoeuvre, site) <= longest_s {
                    ahead.drive(*manoeuvre, site);
                    times += 1;
                }
                let again = |bench: &Bench| {
                    let mut bench = bench.clone();
                    (0..times).for_each(|_| bench.drive(*manoeuvre, site));
                    bench
                };
                let mut drives: Vec<Bench> = others.par_iter().map(again).collect();
                drives.insert(0, ahead);
                let tried = Tried {
                    manoeuvre: *manoeuvre,
                    times,
                    drives,
                };
                (times > 0).then_some(tried)
            })
            .collect()
    }

    /// The one that brings most in its time; none if all that is missing falls no more.
    fn best(&self, from: &[Bench], tried: Vec<Tried>) -> Option<Tried> {
        let (before, reached) = (self.missing(from), self.reached(from));
        let helps = |drives: &[Bench]| {
            let falls =
                |(was, is): (&Reached, &Reached)| !was.is_met() && falls(was, is, from, drives);
            aligning(from) || reached.iter().zip(&self.reached(drives)).any(falls)
        };
        let rate = |tried: &Tried| {
            (before - self.missing(&tried.drives)) / (seconds(&tried.drives) - seconds(from))
        };
        tried
            .into_iter()
            .filter(|tried| helps(&tried.drives) && rate(tried) > 0.0)
            .max_by(|one, other| rate(one).total_cmp(&rate(other)))
    }
}

/// A manoeuvre, how often, and what it has come to.
struct Tried {
    manoeuvre: Manoeuvre,
    times: u32,
    drives: Vec<Bench>,
}

pub fn navigators(drives: &[Bench]) -> impl Iterator<Item = &Navigator> {
    drives.iter().map(|drive| &drive.navigator)
}

/// How long the first has been driven, s.
pub fn seconds(drives: &[Bench]) -> f64 {
    drives.first().map_or(0.0, Bench::seconds)
}

fn aligning(drives: &[Bench]) -> bool {
    drives.iter().any(Bench::is_aligning)
}

/// Whether a sigma falls as what is noise does, or begins to stand on data.
fn falls(was: &Reached, is: &Reached, from: &[Bench], to: &[Bench]) -> bool {
    let known_s = |drives: &[Bench]| drives.first().map_or(0.0, Bench::known_seconds);
    let white = 0.5 * libm::log(known_s(to) / known_s(from).max(1.0));
    (is.observable && !was.observable) || libm::log(was.sigma / is.sigma) > OF_WHITE * white
}

//! Which drive does the user need? Manoeuvres are added one by one until each quantity is known to
//! the sigma that is wanted, or none of them helps.
//!
//! What a manoeuvre brings is not derived anew: the core itself goes over a simulation of it, and
//! says how well it knows everything then. Its sigmas are those of the geometry and of the noise,
//! and hardly depend on how the noise has fallen.

mod bench;
pub mod cli;
mod manoeuvre;
mod output;
mod quantities;
mod reason;
mod target;

pub use bench::Bench;
pub use manoeuvre::Manoeuvre;
pub use quantities::{Goal, Kind, Quantity, Reached};
pub use target::{Site, Target, Unit};

use indicatif::ProgressBar;
use ins_core::Phase;
use rayon::prelude::*;
use serde::Serialize;

use crate::log::BodyAxes;

/// White noise gives in half the logarithm of time. What falls less than this part of that has
/// come to what is not noise.
const OF_WHITE: f64 = 0.5;
/// How often in a row a manoeuvre is tried, the next only if no one helps: in a few minutes
/// anything does that ever will.
const AHEAD: [u32; 4] = [1, 2, 4, 8];
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

/// The drive that is needed.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What is known before.
    pub before: Vec<Reached>,
    pub stages: Vec<Stage>,
    pub unreached: Vec<Unreached>,
    /// As driven.
    pub end: Bench,
}

/// What is searched for, and where.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    pub goals: &'a [Goal],
    pub site: &'a Site,
    pub axes: BodyAxes,
}

impl Search<'_> {
    /// Adds to what has been driven.
    pub fn plan(&self, start: Bench, progress: &ProgressBar) -> Plan {
        let before = self.reached(&start);
        let mut plan = Plan {
            before,
            stages: Vec::new(),
            unreached: Vec::new(),
            end: start,
        };
        let longest_s = 60.0 * self.site.longest_minutes;
        while self.missing(&plan.end) > 0.0 && plan.end.seconds() < longest_s {
            let Some((manoeuvre, times, end)) = self.next(&plan.end) else {
                break;
            };
            let again = plan.stages.pop_if(|last| last.manoeuvre == manoeuvre);
            plan.stages.push(Stage {
                manoeuvre,
                times: times + again.map_or(0, |last| last.times),
                end_s: end.seconds(),
                reached: self.reached(&end),
            });
            plan.end = end;
            progress.inc(1);
        }
        plan.unreached = self.unreached(&plan.end);
        progress.finish_and_clear();
        plan
    }

    /// What is driven next, how often, and what it comes to; none if nothing helps.
    fn next(&self, from: &Bench) -> Option<(Manoeuvre, u32, Bench)> {
        let site = &self.site.manoeuvres;
        if from.seconds() == 0.0 && site.contains(&Manoeuvre::Stand) && from.is_switched_on() {
            // Level and gyros are best found at rest, and a car stands anyway.
            let (stand, bench) = self.tried(from, &[Manoeuvre::Stand], 1).pop()?;
            return Some((stand, 1, bench));
        }
        AHEAD.iter().find_map(|times| {
            let tried = self.tried(from, site, *times);
            let (manoeuvre, end) = self.best(from, tried)?;
            Some((manoeuvre, *times, end))
        })
    }

    /// How every quantity stands.
    pub fn reached(&self, bench: &Bench) -> Vec<Reached> {
        let estimates = bench.navigator.estimates();
        let goals = self.goals.iter();
        goals
            .map(|goal| goal.reached(&estimates, self.axes))
            .collect()
    }

    fn missing(&self, bench: &Bench) -> f64 {
        let unsolved = bench.navigator.phase() != Phase::Navigating;
        let missing: f64 = self.reached(bench).iter().map(Reached::missing).sum();
        missing + if unsolved { NO_SOLUTION } else { 0.0 }
    }

    /// Each manoeuvre so many times on a copy.
    fn tried(&self, from: &Bench, manoeuvres: &[Manoeuvre], times: u32) -> Vec<(Manoeuvre, Bench)> {
        let drive = |manoeuvre: &Manoeuvre| {
            let mut bench = from.clone();
            for _ in 0..times {
                bench.drive(*manoeuvre, self.site, None);
            }
            (*manoeuvre, bench)
        };
        manoeuvres.par_iter().map(drive).collect()
    }

    /// The one that brings most in its time; none if all that is missing falls no more.
    fn best(&self, from: &Bench, tried: Vec<(Manoeuvre, Bench)>) -> Option<(Manoeuvre, Bench)> {
        let aligning = from.navigator.phase() != Phase::Navigating;
        let before = self.missing(from);
        let helps = |bench: &Bench| {
            let falls = |was: &Reached, is: &Reached| !was.is_met() && falls(was, is, from, bench);
            let reached = (self.reached(from), self.reached(bench));
            aligning
                || reached
                    .0
                    .iter()
                    .zip(&reached.1)
                    .any(|(was, is)| falls(was, is))
        };
        let rate =
            |bench: &Bench| (before - self.missing(bench)) / (bench.seconds() - from.seconds());
        tried
            .into_iter()
            .filter(|(_, bench)| helps(bench))
            .max_by(|(_, one), (_, other)| rate(one).total_cmp(&rate(other)))
            .filter(|(_, bench)| aligning || rate(bench) > 0.0)
    }
}

/// Whether a sigma falls as what is noise does, or begins to stand on data.
fn falls(was: &Reached, is: &Reached, from: &Bench, to: &Bench) -> bool {
    let white = 0.5 * libm::log(to.seconds() / from.seconds().max(1.0));
    (is.observable && !was.observable) || libm::log(was.sigma / is.sigma) > OF_WHITE * white
}

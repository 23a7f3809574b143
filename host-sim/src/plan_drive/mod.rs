//! Which drive does the user need? Manoeuvres are added one by one until each quantity is known to
//! the sigma that is wanted, or none of them helps.
//!
//! What a manoeuvre brings is not derived anew: the core itself goes over a simulation of it, and
//! says how well it knows everything then. Its sigmas hang on the geometry, on the noise that it
//! finds, and on when it finds its heading: so several units are driven side by side, the first
//! exactly as the plan says, the others as people drive.

mod bench;
pub mod cli;
mod manoeuvre;
mod output;
mod quantities;
mod reason;
mod target;

pub use bench::Bench;
pub use manoeuvre::{Driver, Manoeuvre};
pub use quantities::{Goal, Kind, Quantity, Reached};
pub use target::{Site, Target, Unit};

use indicatif::ProgressBar;
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
    /// As driven, the first exactly.
    pub end: Vec<Bench>,
}

/// Units side by side. The core holds GNSS for coloured in some and for white in others, and their
/// sigmas then differ by a factor of two: so many that a mean of both is good to some 15 %.
pub const UNITS: u64 = 10;

/// What is searched for, and where.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    pub goals: &'a [Goal],
    pub site: &'a Site,
    pub axes: BodyAxes,
}

impl Search<'_> {
    /// Adds to what has been driven.
    pub fn plan(&self, start: Vec<Bench>, progress: &ProgressBar) -> Plan {
        let before = self.reached(&start);
        let mut plan = Plan {
            before,
            stages: Vec::new(),
            unreached: Vec::new(),
            end: start,
        };
        let longest_s = 60.0 * self.site.longest_minutes;
        while self.missing(&plan.end) > 0.0 && seconds(&plan.end) < longest_s {
            let Some((manoeuvre, times, end)) = self.next(&plan.end) else {
                break;
            };
            let again = plan.stages.pop_if(|last| last.manoeuvre == manoeuvre);
            plan.stages.push(Stage {
                manoeuvre,
                times: times + again.map_or(0, |last| last.times),
                end_s: seconds(&end),
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
    fn next(&self, from: &[Bench]) -> Option<(Manoeuvre, u32, Drives)> {
        let site = &self.site.manoeuvres;
        if seconds(from) == 0.0 && site.contains(&Manoeuvre::Stand) && aligning(from) {
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
    pub fn reached(&self, drives: &[Bench]) -> Vec<Reached> {
        let goals = self.goals.iter();
        goals.map(|goal| goal.reached(drives, self.axes)).collect()
    }

    fn missing(&self, drives: &[Bench]) -> f64 {
        let missing: f64 = self.reached(drives).iter().map(Reached::missing).sum();
        let unsolved = drives.iter().filter(|drive| drive.is_aligning()).count();
        missing + NO_SOLUTION * unsolved as f64
    }

    /// Each manoeuvre so many times on copies.
    fn tried(
        &self,
        from: &[Bench],
        manoeuvres: &[Manoeuvre],
        times: u32,
    ) -> Vec<(Manoeuvre, Drives)> {
        let drive = |manoeuvre: Manoeuvre, bench: &Bench| {
            let mut bench = bench.clone();
            for _ in 0..times {
                bench.drive(manoeuvre, self.site);
            }
            bench
        };
        let all = |manoeuvre: &Manoeuvre| {
            let drives = from.par_iter().map(|bench| drive(*manoeuvre, bench));
            (*manoeuvre, drives.collect())
        };
        manoeuvres.par_iter().map(all).collect()
    }

    /// The one that brings most in its time; none if all that is missing falls no more.
    fn best(&self, from: &[Bench], tried: Vec<(Manoeuvre, Drives)>) -> Option<(Manoeuvre, Drives)> {
        let (before, reached) = (self.missing(from), self.reached(from));
        let helps = |drives: &[Bench]| {
            let falls =
                |(was, is): (&Reached, &Reached)| !was.is_met() && falls(was, is, from, drives);
            aligning(from) || reached.iter().zip(&self.reached(drives)).any(falls)
        };
        let rate =
            |drives: &[Bench]| (before - self.missing(drives)) / (seconds(drives) - seconds(from));
        tried
            .into_iter()
            .filter(|(_, drives)| helps(drives) && rate(drives) > 0.0)
            .max_by(|(_, one), (_, other)| rate(one).total_cmp(&rate(other)))
    }
}

/// Units side by side.
type Drives = Vec<Bench>;

/// How long the first has been driven, s.
pub fn seconds(drives: &[Bench]) -> f64 {
    drives.first().map_or(0.0, Bench::seconds)
}

fn aligning(drives: &[Bench]) -> bool {
    drives.iter().any(Bench::is_aligning)
}

/// Whether a sigma falls as what is noise does, or begins to stand on data.
fn falls(was: &Reached, is: &Reached, from: &[Bench], to: &[Bench]) -> bool {
    let white = 0.5 * libm::log(seconds(to) / seconds(from).max(1.0));
    (is.observable && !was.observable) || libm::log(was.sigma / is.sigma) > OF_WHITE * white
}

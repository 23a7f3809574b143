//! Output of a plan: tables, a page with the route, and text for the driver.

use std::path::Path;

use ins_core::Solution;
use miette::Result;
use serde::Serialize;

use super::{DrivenUnit, GoalStatus, Manoeuvre, Plan, Site, Stage, Unreached, seconds};
use crate::aircraft::pictures::track;
use crate::page::chart::{Chart, MOST_POINTS, Point, sampled};
use crate::page::html::{Page, REPORT, Section};
use crate::page::plot::{GREY, distinct_colour};
use crate::page::table::{Table, cells};
use crate::page::{brief, json, output};

/// File names; the first marks a folder as that of a plan.
pub const PLAN: &str = "plan.json";
const DRIVE: &str = "drive.txt";
const ROUTE: &str = "route.svg";
/// Quantities side by side in a terminal.
const COLUMNS: usize = 8;

/// A plan in words and numbers.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    version: &'static str,
    /// The log that the drive is added to, and the verdict on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    log: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    verdict: Vec<String>,
    reached: bool,
    minutes: f64,
    #[serde(flatten)]
    plan: &'a Plan,
    drive: Vec<String>,
}

impl<'a> Report<'a> {
    pub fn new(plan: &'a Plan, site: &Site, log: Option<(String, Vec<String>)>) -> Self {
        let (log, verdict) = log.unzip();
        let step = |(number, stage): (usize, &Stage)| {
            let again = times(stage, " All of it", " times.");
            format!("{number}. {}{again}", stage.manoeuvre.words(site))
        };
        Self {
            version: env!("CARGO_PKG_VERSION"),
            log,
            verdict: verdict.unwrap_or_default(),
            reached: plan.unreached.is_empty(),
            minutes: seconds(&plan.end) / 60.0,
            plan,
            drive: (1..).zip(&plan.stages).map(step).collect(),
        }
    }

    /// The result: whether the target is reached, and what is not.
    fn outcome(&self) -> Vec<String> {
        let added = if self.log.is_some() { " more" } else { "" };
        let minutes = format!("{:.1} min{added}", self.minutes);
        let first = match (self.reached, self.plan.stages.is_empty()) {
            (true, true) => "Everything is known as wanted: nothing to add.".to_owned(),
            (true, false) => format!("{minutes} of driving reach the target."),
            (false, true) => {
                "Nothing that may be driven brings it nearer to the target:".to_owned()
            }
            (false, false) => format!("{minutes} of driving do not reach the target:"),
        };
        let unreached = self.plan.unreached.iter().map(|Unreached { last, why }| {
            let sigma = if last.observable {
                shown(last)
            } else {
                "not shown".to_owned()
            };
            format!(
                "{}, {}: {sigma} where {} is wanted; {why}.",
                last.quantity, last.unit, last.target
            )
        });
        std::iter::once(first).chain(unreached).collect()
    }

    /// Sigmas after each stage, so many quantities in a table.
    fn tables(&self, columns: usize) -> Vec<Table> {
        let from = self.log.as_ref().map_or("before", |_| "in the log");
        let Plan { before, stages, .. } = self.plan;
        let all: Vec<usize> = (0..before.len()).collect();
        let chunk = |places: &[usize]| {
            let mut header = cells(["one sigma", "min"]);
            let named = |place: &usize| {
                let of = &before[*place];
                format!("{}, {}", of.quantity, of.unit)
            };
            header.extend(places.iter().map(named));
            let wanted = places.iter().map(|place| before[*place].target.to_string());
            let row = |name: String, end_s: f64, reached: &[GoalStatus]| {
                let cells = places.iter().map(|place| shown(&reached[*place]));
                let minutes = format!("{:.1}", end_s / 60.0);
                [name, minutes].into_iter().chain(cells).collect()
            };
            let mut rows = vec![
                cells(["wanted", ""]).into_iter().chain(wanted).collect(),
                row(from.to_owned(), 0.0, before),
            ];
            rows.extend((1..).zip(stages).map(|(number, stage)| {
                let name = stage.manoeuvre.name();
                let name = format!("{number}. {name}{}", times(stage, " \u{d7}", ""));
                row(name, stage.end_s, &stage.reached)
            }));
            Table::of("What is known after each stage", header, rows)
        };
        all.chunks(columns).map(chunk).collect()
    }

    pub fn readable(&self) -> String {
        let mut parts: Vec<String> = self.verdict.iter().cloned().chain(self.outcome()).collect();
        let tables = self.tables(COLUMNS).into_iter();
        parts.extend(tables.map(|table| format!("\n{}", table.plain().trim_end())));
        parts.push("- is not shown yet, * is known as wanted\n".to_owned());
        parts.extend(self.drive.iter().cloned());
        parts.join("\n").trim_end().to_owned() + "\n"
    }

    pub fn write(&self, folder: &Path) -> Result<()> {
        let truth: Vec<&Solution> = driven(self.plan).iter().collect();
        for (name, text) in [
            (DRIVE, self.drive.join("\n") + "\n"),
            (ROUTE, track(&truth)),
            (REPORT, self.page().html()?),
            (PLAN, json(self)?),
        ] {
            output::write(folder, name, text)?;
        }
        Ok(())
    }

    fn page(&self) -> Page {
        let (outcome, steps) = (self.outcome(), cells([""]));
        let drive = self.drive.iter().map(|line| vec![line.clone()]);
        let driven = !self.drive.is_empty();
        let to_drive = driven.then(|| Table::of("What to drive", steps, drive));
        let route = driven.then(|| Section {
            title: "Route and course",
            note: "The route may lie anywhere: what counts are speeds, turns and times.",
            figures: vec![self.route().figure(), self.course().figure()],
        });
        let before =
            (self.log.as_ref()).map_or(String::new(), |log| format!("after {log} \u{b7} "));
        Page {
            title: "A drive that shows what is wanted".to_owned(),
            facts: format!("{before}host-sim {}", self.version),
            verdicts: self.verdict.iter().cloned().chain(outcome).collect(),
            tables: (to_drive.into_iter())
                .chain(self.tables(usize::MAX))
                .collect(),
            sections: route.into_iter().collect(),
        }
    }

    fn route(&self) -> Chart {
        let truth = sampled(driven(self.plan), MOST_POINTS);
        let mut chart = Chart::map("Route", 1.0).note("east and north of the start, m");
        let Some(start) = truth.first().map(|solution| solution.position) else {
            return chart;
        };
        let many = Manoeuvre::all().count();
        for (place, manoeuvre) in Manoeuvre::all().enumerate() {
            let mut points = Vec::new();
            let mut begin_s = 0.0;
            for stage in &self.plan.stages {
                let during = |solution: &&Solution| {
                    (begin_s..=stage.end_s).contains(&solution.time.as_seconds())
                };
                if stage.manoeuvre == manoeuvre {
                    let places = truth
                        .iter()
                        .filter(during)
                        .map(|s| s.position.enu_from(&start));
                    points.extend(places.map(|place| (place.x, place.y)));
                    points.push((f64::NAN, f64::NAN));
                }
                begin_s = stage.end_s;
            }
            chart = chart.line(manoeuvre.name(), distinct_colour(place, many), &points);
        }
        chart
    }

    /// Every sigma over its target.
    fn course(&self) -> Chart {
        let end_s = 60.0 * self.minutes;
        let title = "Sigma over what is wanted";
        let mut chart = Chart::over_time(title, "", end_s);
        let Plan { before, stages, .. } = self.plan;
        let mut ends = vec![(0.0, before)];
        ends.extend(stages.iter().map(|stage| (stage.end_s, &stage.reached)));
        let mut all: Vec<f64> = vec![1.0];
        for place in 0..before.len() {
            let ratio = |reached: &GoalStatus| reached.sigma / reached.target;
            let points: Vec<Point> = ends
                .iter()
                .map(|(s, now)| (*s, ratio(&now[place])))
                .collect();
            let colour = distinct_colour(place, before.len());
            chart = chart.line(&before[place].quantity, colour, &points);
            all.extend(points.iter().map(|point| point.1));
        }
        let wanted = [(0.0, 1.0), (end_s, 1.0)];
        chart
            .tall()
            .reference("wanted", GREY, &wanted)
            .logarithmic_y(all.into_iter())
    }
}

fn times(stage: &Stage, before: &str, after: &str) -> String {
    match stage.times {
        1 => String::new(),
        times => format!("{before} {times}{after}"),
    }
}

fn shown(reached: &GoalStatus) -> String {
    let sigma = brief(reached.sigma);
    match (reached.is_met(), reached.observable) {
        (true, _) => sigma + "*",
        (false, true) => sigma,
        (false, false) => "-".to_owned(),
    }
}

/// True motion of the unit that is driven exactly.
fn driven(plan: &Plan) -> &[Solution] {
    plan.end.first().map_or(&[], DrivenUnit::truth)
}

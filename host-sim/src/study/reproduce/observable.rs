//! Figure 1: when each error is observable.

use super::drive::Drive;
use super::part::{Part, here};
use crate::compare::five_stage::Stage;
use crate::identify::quantities::DEG_H_RADPS;
use crate::page::plot::{BLUE, GREY, Mark, ORANGE, padded};
use crate::page::sheet::{self, Panel};

/// Part of the drive in the drawing, s.
const DRAWN_S: (f64, f64) = (600.0, 900.0);

pub(super) fn figure_1(drive: &Drive) -> Part {
    let mut csv = "quantity,from_s,to_s\n".to_owned();
    let mut numbers = Vec::new();
    for (stage, intervals) in Stage::ALL.into_iter().zip(&drive.stages.intervals) {
        csv.extend(intervals.iter().map(|(from, to)| {
            let (from, to) = (drive.since(*from), drive.since(*to));
            format!("{},{from:.2},{to:.2}\n", stage.title())
        }));
        let seconds = intervals.iter().map(|(from, to)| to.seconds_since(*from));
        let part = 100.0 * seconds.sum::<f64>() / drive.log.duration_s();
        let what = format!("{} observable, % of the drive", stage.title());
        numbers.push(here(what, part));
    }
    Part {
        name: "figure-1",
        title: "Figure 1: intervals in which each error is observable".to_owned(),
        how: "Controls of the attitude block over five minutes of a drive. Grey: straight starts \
              and brakings, which show azimuth and latency, and turns, which show level \
              accelerometers. Gyros and vertical channel show all the time."
            .to_owned(),
        numbers,
        svg: Some(sheet::svg(&[
            panel(drive, "Azimuth and latency", Stage::Azimuth),
            panel(drive, "Level accelerometers", Stage::LevelAccels),
        ])),
        csv,
    }
}

fn panel(drive: &Drive, title: &str, stage: Stage) -> Panel {
    let is_drawn = |time: f64| (DRAWN_S.0..=DRAWN_S.1).contains(&time);
    let line = |axis: usize| -> Vec<(f64, f64)> {
        let points = drive.open.iter().map(|row| {
            let rate = row.signals.rate_enu_radps[axis] / DEG_H_RADPS;
            (drive.since(row.time), rate)
        });
        points.filter(|point| is_drawn(point.0)).collect()
    };
    let intervals = stage.intervals(&drive.open).into_iter();
    let drawn = intervals
        .map(|(from, to)| (drive.since(from), drive.since(to)))
        .filter(|(from, to)| is_drawn(*from) && is_drawn(*to));
    let lines = [line(0), line(1)];
    let y = padded(lines.iter().flatten().map(|point| point.1), 1.0);
    let [east, north] = lines;
    let marks = vec![
        Mark::Shade(drawn.collect(), GREY),
        Mark::Line(east, BLUE),
        Mark::Line(north, ORANGE),
    ];
    Panel {
        title: title.to_owned(),
        svg: sheet::plot(["time, s", "\u{3c9}^C, deg/h"], DRAWN_S, y, marks).svg(),
        keys: vec![
            (BLUE, "east"),
            (ORANGE, "north"),
            (GREY, "grey: manoeuvres that show it"),
        ],
    }
}

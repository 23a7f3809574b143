//! Figure 5: an azimuth error turns speed gained into velocity error across.

use ins_core::Solution;
use nalgebra::Vector3;

use super::drive::Drive;
use super::part::{Part, csv, here};
use super::velocity_plot::{Line, panel};
use crate::compare::five_stage::Stage;
use crate::identify::row::Row;
use crate::page::plot::{GREEN, GREY, RED};
use crate::page::sheet;
use crate::statistics::rms;

/// Gain of speed worth a look, m/s.
const LEAST_GAIN_MPS: f64 = 3.0;

/// One start or braking: since the first sample, and what an INS let go at its beginning has got
/// across by its end, m/s: with the heading as given, as compensated, and as it is.
struct Gain {
    end_s: f64,
    across_mps: [f64; 3],
}

pub(super) fn figure_5(drives: &[Drive]) -> Part {
    let gains: Vec<Vec<Gain>> = drives.iter().map(gains).collect();
    let all = |which: usize| rms(gains.iter().flatten().map(|gain| gain.across_mps[which]));
    let [given, compensated, exact] = [all(0), all(1), all(2)];
    let first = gains.first().map_or(&[][..], Vec::as_slice);
    Part {
        name: "figure-5",
        title: "Figure 5: cross-channel velocity error, azimuth compensated".to_owned(),
        how: format!(
            "{} starts and brakings of {} drives. At the beginning of each the INS is let go; \
             the error of the velocity that it has gained by the end, across the true gain. \
             Azimuth as found by the five stages. With the true attitude the rest stays: it is not \
             the azimuth's.",
            gains.iter().map(Vec::len).sum::<usize>(),
            drives.len()
        ),
        numbers: vec![
            here("heading as given, m/s RMS", given),
            here("azimuth compensated, m/s RMS", compensated),
            here("true attitude, m/s RMS", exact),
            here("times less by compensation", given / compensated),
        ],
        svg: Some(picture(first)),
        csv: csv(
            "time_s,given_mps,compensated_mps,true_attitude_mps",
            first.iter().map(|gain| {
                let [given, compensated, exact] = gain.across_mps;
                vec![gain.end_s, given, compensated, exact]
            }),
        ),
    }
}

fn gains(drive: &Drive) -> Vec<Gain> {
    let row = |history: &[Row], time| {
        let at = history.binary_search_by_key(&time, |row| row.time).ok()?;
        history[at].solution
    };
    let gain = |&(from, to): &_| {
        let (before, after) = (drive.truth(from)?, drive.truth(to)?);
        let gained = (after.velocity_enu_mps - before.velocity_enu_mps).xy();
        if gained.norm() < LEAST_GAIN_MPS {
            return None;
        }
        let along = gained.normalize();
        let across = |start: &Solution, compensated: bool| {
            let known = |time| {
                if compensated {
                    drive.found(time)
                } else {
                    [Vector3::zeros(); 2]
                }
            };
            let begin = (start.velocity_enu_mps - before.velocity_enu_mps).xy();
            let errors = drive.free(&drive.log, start, known, to);
            errors.last().map(|(_, end)| along.perp(&(end - begin)))
        };
        Some(Gain {
            end_s: drive.since(to),
            across_mps: [
                across(&row(&drive.open, from)?, false)?,
                across(&row(&drive.stages.history, from)?, true)?,
                across(before, true)?,
            ],
        })
    };
    let intervals = Stage::Azimuth.intervals(&drive.open);
    intervals.iter().filter_map(gain).collect()
}

fn picture(gains: &[Gain]) -> String {
    let line = |name, colour, which: usize| Line {
        name,
        colour,
        points: gains
            .iter()
            .map(|gain| (gain.end_s, gain.across_mps[which]))
            .collect(),
    };
    let lines = vec![
        line("heading as given", RED, 0),
        line("true attitude", GREY, 2),
        line("azimuth compensated", GREEN, 1),
    ];
    sheet::svg(&[panel("Velocity error across".to_owned(), lines)])
}

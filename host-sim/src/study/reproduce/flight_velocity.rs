//! Figure 9: a simulated flight with the errors that drives have shown.

use miette::Result;
use nalgebra::Vector2;

use super::drive::Drive;
use super::part::{Part, Settings, csv, here};
use super::spans::{flown, free};
use super::velocity_plot::{Line, panel};
use crate::identify::error_model::{Identified, Record};
use crate::identify::quantities::DEG_H_RADPS;
use crate::log;
use crate::page::plot::{BLUE, ORANGE, RED};
use crate::page::sheet;
use crate::statistics::rms;
use crate::study::flights::route::Route;
use crate::study::flights::schuler::oscillation;

/// At one time of the flight, s: horizontal velocities of GNSS and of the INS, and the error of
/// the latter, m/s.
struct Moment {
    time_s: f64,
    gnss: Vector2<f64>,
    ins: Vector2<f64>,
    error: Vector2<f64>,
}

pub(super) fn figure_9(settings: &Settings, drives: &[Drive], route: &Route) -> Result<Part> {
    let records: Vec<Record> = (drives.iter())
        .map(|drive| Record::new(&drive.log, &drive.found))
        .collect();
    let model = Identified::new(&records, log::Grade::Hg1700, None).model();
    let run = flown(settings.seed, settings.flight_minutes, route, &model)?;
    let errors = free(&run);
    let moments: Vec<Moment> = (errors.iter())
        .filter_map(|&(time_s, error)| {
            let time = |at: ins_core::Time| at.as_seconds();
            let fix = run
                .gnss
                .get(run.gnss.partition_point(|fix| time(fix.time) < time_s))?;
            let truth = (run.truth).get(run.truth.partition_point(|t| time(t.time) < time_s))?;
            Some(Moment {
                time_s,
                gnss: fix.velocity_en_mps?,
                ins: truth.velocity_enu_mps.xy() + error,
                error,
            })
        })
        .collect();
    let found = oscillation(&errors);
    let [right, forward, _] = run.errors.gyro_bias_radps.map(|bias| bias / DEG_H_RADPS);
    let error = |axis: usize| rms(errors.iter().map(|(_, error)| error[axis]));
    Ok(Part {
        name: "figure-9",
        title: "Figure 9: a simulated flight, GNSS and a free INS with the errors of the drives"
            .to_owned(),
        how: format!(
            "{} drives give the error model of the sensors; errors drawn from it are laid over the \
             ideal readings of a route flight of {:.0} min: level gyros of {right:.1} and \
             {forward:.1} deg/h at its end. The INS is let go without error at the \
             start, height held by a barometer. Its error oscillates as (1) says: \
             2 pi sqrt(R/g) is 84.4 min. The random walk of the gyros drives the oscillation, so \
             that it is not one sine.",
            drives.len(),
            settings.flight_minutes
        ),
        numbers: vec![
            here("INS velocity error, east, m/s RMS", error(0)),
            here("INS velocity error, north, m/s RMS", error(1)),
            here("period of the sine that fits it, min", found.period_min),
        ],
        svg: Some(picture(&moments)),
        csv: data(&moments),
    })
}

fn picture(moments: &[Moment]) -> String {
    let axis = |title: &str, axis: usize| {
        let line = |name, colour, value: fn(&Moment) -> &Vector2<f64>| Line {
            name,
            colour,
            points: (moments.iter().step_by(10))
                .map(|moment| (moment.time_s, value(moment)[axis]))
                .collect(),
        };
        let lines = vec![
            line("INS, free", ORANGE, |moment| &moment.ins),
            line("GNSS", BLUE, |moment| &moment.gnss),
            line("error of the INS", RED, |moment| &moment.error),
        ];
        panel(title.to_owned(), lines)
    };
    sheet::svg(&[axis("Velocity east", 0), axis("Velocity north", 1)])
}

fn data(moments: &[Moment]) -> String {
    let rows = moments.iter().map(|moment| {
        let vectors = [moment.gnss, moment.ins, moment.error];
        let mut row = vec![moment.time_s];
        row.extend(vectors.iter().flat_map(|v| [v.x, v.y]));
        row
    });
    csv(
        "time_s,gnss_east_mps,gnss_north_mps,ins_east_mps,ins_north_mps,ins_error_east_mps,\
         ins_error_north_mps",
        rows,
    )
}

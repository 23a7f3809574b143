//! Figure 8: velocity errors of a free INS before and after the gyros' errors are taken out.

use ins_core::{Solution, Time};
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::drive::Drive;
use super::part::{Number, Part, csv, here};
use super::velocity_plot::{Line, panel};
use crate::identify::row::Row;
use crate::log::Log;
use crate::page::plot::{GREEN, RED};
use crate::page::sheet;
use crate::statistics::rms;

/// When the running estimates are good enough to let an INS go on them, s.
const RUNNING_FROM_S: f64 = 1200.0;

/// Velocity errors over time.
type Errors = Vec<(Time, Vector2<f64>)>;

/// One drive.
struct Velocities {
    /// Gyros as they are, and less their history: over the whole drive.
    as_read: Errors,
    history: Errors,
    /// Less a constant.
    constant: Errors,
    /// From [`RUNNING_FROM_S`] on: as they are, less the running estimate, and so without the
    /// walk of the angle.
    late_as_read: Errors,
    running: Errors,
    running_without_walk: Errors,
}

pub(super) fn figure_8(drives: &[Drive]) -> Part {
    let all: Vec<Velocities> = drives.par_iter().filter_map(velocities).collect();
    let rms_of = |errors: fn(&Velocities) -> &Errors| {
        rms(all
            .iter()
            .flat_map(|one| errors(one).iter().map(|(_, error)| error.norm())))
    };
    let as_read = rms_of(|v| &v.as_read);
    let history = rms_of(|v| &v.history);
    let late = rms_of(|v| &v.late_as_read);
    let numbers = vec![
        here("gyros as read, m/s RMS", as_read),
        here("gyro histories taken out, m/s RMS", history),
        Number::new("times less", Some(10.0), as_read / history),
        here(
            "times less, one constant per gyro",
            as_read / rms_of(|v| &v.constant),
        ),
        here(
            "times less, running estimates from 20 min on",
            late / rms_of(|v| &v.running),
        ),
        here(
            "times less, the same on gyros without random walk",
            late / rms_of(|v| &v.running_without_walk),
        ),
    ];
    let minutes = drives.first().map_or(0.0, |d| d.log.duration_s() / 60.0);
    let first = drives.first().zip(all.first());
    Part {
        name: "figure-8",
        title: "Figure 8: free-inertial velocity error before and after".to_owned(),
        how: format!(
            "{} drives of {minutes:.0} min. The INS is let go when its alignment ends and runs free \
             to the end, height held by a barometer, accelerometers compensated in all cases: \
             horizontal velocity against the truth, RMS over all that time. A gyro history is that \
             of the run after the five stages, (9) over intervals of 10 s: it holds the walk of the \
             angle as GNSS saw it. A constant (the last running estimate) cannot, nor can the \
             running estimates with which an INS is let go at 20 min: at 0.125 deg/sqrt(h) the walk \
             is most of what they leave. The thesis says an order of magnitude: 10.",
            all.len()
        ),
        numbers,
        svg: first.map(|(drive, velocities)| picture(drive, velocities)),
        csv: first.map_or(String::new(), |(drive, velocities)| data(drive, velocities)),
    }
}

fn velocities(drive: &Drive) -> Option<Velocities> {
    let accels = drive.accels();
    let end = drive.log.imu.last()?.time;
    let constant = running(&drive.found.history, end);
    let since = |row: &&Row, seconds| drive.since(row.time) >= seconds;
    let start = drive.stages.history.iter().find_map(|row| row.solution)?;
    let mut rows = drive.found.history.iter();
    let late = rows.find(|row| since(row, RUNNING_FROM_S));
    let late = late?.solution?;
    let free = |log: &Log, start: &Solution, gyros: &dyn Fn(Time) -> Vector3<f64>| {
        drive.free(log, start, |time| [gyros(time), accels], end)
    };
    let as_read = |_| Vector3::zeros();
    let running = |time| running(&drive.found.history, time);
    Some(Velocities {
        as_read: free(&drive.log, &start, &as_read),
        history: free(&drive.log, &start, &|time| drive.stages.gyros.at(time)),
        constant: free(&drive.log, &start, &|_| constant),
        late_as_read: free(&drive.log, &late, &as_read),
        running: free(&drive.log, &late, &running),
        running_without_walk: free(&drive.without_walk, &late, &running),
    })
}

/// The running estimates as known at a time.
fn running(history: &[Row], time: Time) -> Vector3<f64> {
    let after = history.partition_point(|row| row.time <= time);
    let row = history[..after].last();
    row.map_or(Vector3::zeros(), |row| {
        Vector3::from(row.estimates.gyro_bias_radps.map(|bias| bias.value))
    })
}

/// Points a picture shows, one every ten seconds.
fn thinned<'a>(
    drive: &'a Drive,
    errors: &'a Errors,
) -> impl Iterator<Item = (f64, Vector2<f64>)> + 'a {
    let points = errors.iter().step_by(10);
    points.map(|(time, error)| (drive.since(*time), *error))
}

fn picture(drive: &Drive, velocities: &Velocities) -> String {
    let axis = |title: &str, axis: usize| {
        let line = |name, colour, errors: &Errors| Line {
            name,
            colour,
            points: thinned(drive, errors)
                .map(|(t, error)| (t, error[axis]))
                .collect(),
        };
        let lines = vec![
            line("gyros as read", RED, &velocities.as_read),
            line("gyro histories taken out", GREEN, &velocities.history),
        ];
        panel(title.to_owned(), lines)
    };
    sheet::svg(&[
        axis("Velocity error east", 0),
        axis("Velocity error north", 1),
    ])
}

fn data(drive: &Drive, velocities: &Velocities) -> String {
    let after = thinned(drive, &velocities.history);
    let rows = thinned(drive, &velocities.as_read).zip(after);
    csv(
        "time_s,east_as_read_mps,north_as_read_mps,east_after_mps,north_after_mps",
        rows.map(|((t, before), (_, after))| vec![t, before.x, before.y, after.x, after.y]),
    )
}

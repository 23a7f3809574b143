//! Pictures of a flight and of an aircraft, as SVG.

use std::fs;
use std::path::Path;

use ins_core::earth::Geodetic;
use ins_core::{ImuOutput, ImuSample, Solution};

use super::dynamics::Dynamics;
use super::performance::{climb_rate_mps, trim_row};
use crate::page::output::{self, OutputError};
use crate::page::plot::{BLUE, GREEN, GREY, Mark, ORANGE, Plot, padded};
use crate::sim::SimulatedDrive;

/// Most points of a line: more than it has pixels.
const POINTS: usize = 2000;

type Picture = (&'static str, String);

pub fn write(pictures: &[Picture], folder: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(folder).map_err(|e| OutputError::io(folder, e))?;
    (pictures.iter()).try_for_each(|(name, svg)| output::write(folder, name, svg))
}

/// Profile, track, attitude and sensor signals of a flight.
pub fn of_flight(run: &SimulatedDrive, output: ImuOutput) -> Vec<Picture> {
    let truth: Vec<&Solution> = thinned(&run.truth);
    let over_time = |value: &dyn Fn(&Solution) -> f64| -> Vec<(f64, f64)> {
        truth
            .iter()
            .map(|s| (s.time.as_seconds() / 60.0, value(s)))
            .collect()
    };
    let height = over_time(&|s| s.position.height_m);
    let speed = over_time(&|s| s.velocity_enu_mps.norm());
    let climb = over_time(&|s| s.velocity_enu_mps.z);
    let [roll, pitch, heading] = [
        over_time(&|s| s.euler().roll_rad.to_degrees()),
        over_time(&|s| s.euler().pitch_rad.to_degrees()),
        unwrapped(over_time(&|s| s.euler().heading_rad.to_degrees())),
    ];
    // Rates from increments, by the interval between two stamps.
    let imu = thinned(&run.imu);
    let step_s = match (run.imu.first(), run.imu.get(1)) {
        (Some(a), Some(b)) => output.per_rate(b.time.seconds_since(a.time)),
        _ => 1.0,
    };
    let signal = |value: &dyn Fn(&ImuSample) -> f64| -> Vec<(f64, f64)> {
        imu.iter()
            .map(|s| (s.time.as_seconds() / 60.0, value(s) / step_s))
            .collect()
    };
    let gyro = [0, 1, 2].map(|axis| signal(&|s| s.gyro[axis].to_degrees()));
    let accel = [0, 1, 2].map(|axis| signal(&|s| s.accel[axis]));
    let drawn = |y_label: &str, series: Vec<Line>| lines("time, min", y_label, series);
    let axes = "right (blue), forward (orange), up (green)";
    let speeds = "ground speed (blue), climb (orange), m/s";
    vec![
        ("profile_height.svg", drawn("height, m", vec![height])),
        ("profile_speed.svg", drawn(speeds, vec![speed, climb])),
        ("track.svg", track(&truth)),
        (
            "attitude.svg",
            drawn("roll (blue), pitch (orange), deg", vec![roll, pitch]),
        ),
        ("heading.svg", drawn("heading, deg", vec![heading])),
        ("gyros.svg", drawn(&format!("{axes}, deg/s"), gyro.into())),
        (
            "accelerometers.svg",
            drawn(&format!("{axes}, m/s\u{b2}"), accel.into()),
        ),
    ]
}

/// Performance over the range of speeds at sea level.
pub fn of_aircraft(dynamics: &Dynamics, slowest_mps: f64, fastest_mps: f64) -> Vec<Picture> {
    let speeds: Vec<f64> = (0..=60)
        .map(|i| slowest_mps + (fastest_mps - slowest_mps) * f64::from(i) / 60.0)
        .collect();
    let over_speed = |value: &dyn Fn(f64) -> Option<f64>| -> Vec<(f64, f64)> {
        speeds
            .iter()
            .filter_map(|&speed| Some((3.6 * speed, value(speed)?)))
            .collect()
    };
    let row = |value: fn(&super::performance::TrimRow) -> f64| {
        over_speed(&|speed| trim_row(dynamics, speed, 0.0).map(|row| value(&row)))
    };
    let climb = over_speed(&|speed| climb_rate_mps(dynamics, speed, 0.0));
    let drawn = |y_label: &str, series: Vec<Line>| lines("airspeed, km/h", y_label, series);
    let power = row(|r| r.shaft_power_kw);
    let angles = vec![row(|r| r.alpha_deg), row(|r| r.elevator_deg)];
    let [of_power, of_angles] = [
        "shaft power in level flight, kW",
        "angle of attack (blue), elevator (orange), deg",
    ];
    vec![
        (
            "climb.svg",
            drawn("rate of climb, open throttle, m/s", vec![climb]),
        ),
        ("power.svg", drawn(of_power, vec![power])),
        ("trim.svg", drawn(of_angles, angles)),
    ]
}

type Line = Vec<(f64, f64)>;

/// Up to three lines, in the colours that the label names.
fn lines(x_label: &str, y_label: &str, series: Vec<Line>) -> String {
    let all = || series.iter().flatten();
    let (x, y) = (
        padded(all().map(|p| p.0), 1e-3),
        padded(all().map(|p| p.1), 1e-3),
    );
    Plot {
        size: (900, 300),
        labels: [x_label, y_label],
        x,
        y,
        marks: (series.into_iter().zip([BLUE, ORANGE, GREEN]))
            .map(|(points, colour)| Mark::Line(points, colour))
            .collect(),
    }
    .svg()
}

/// Unwrapped angles, deg.
fn unwrapped(mut line: Line) -> Line {
    for index in 1..line.len() {
        let step = line[index].1 - line[index - 1].1;
        line[index].1 -= 360.0 * (step / 360.0).round();
    }
    line
}

/// Ground track, with equal scales.
pub(crate) fn track(truth: &[&Solution]) -> String {
    let origin = truth.first().map_or(Geodetic::default(), |s| s.position);
    let points: Vec<(f64, f64)> = truth
        .iter()
        .map(|s| s.position.enu_from(&origin))
        .map(|p| (1e-3 * p.x, 1e-3 * p.y))
        .collect();
    let (x, y) = (
        padded(points.iter().map(|p| p.0), 1.0),
        padded(points.iter().map(|p| p.1), 1.0),
    );
    let half = 0.5 * (x.1 - x.0).max(y.1 - y.0);
    let around = |(low, high): (f64, f64)| (0.5 * (low + high) - half, 0.5 * (low + high) + half);
    let start = vec![(-0.02 * half, 0.0), (0.02 * half, 0.0)];
    Plot {
        size: (640, 620),
        labels: ["east of the start, km", "north of the start, km"],
        x: around(x),
        y: around(y),
        marks: vec![Mark::Line(points, BLUE), Mark::Reference(start, GREY)],
    }
    .svg()
}

/// Decimated to at most [`POINTS`].
fn thinned<T>(all: &[T]) -> Vec<&T> {
    all.iter()
        .step_by(all.len().div_ceil(POINTS).max(1))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_goes_on_through_south() {
        let line = |angles: [f64; 5]| angles.map(|angle| (0.0, angle)).to_vec();
        let wrapped = line([170.0, -170.0, -10.0, 170.0, -175.0]);
        let whole = line([170.0, 190.0, 350.0, 530.0, 545.0]);
        assert_eq!(unwrapped(wrapped), whole);
    }
}

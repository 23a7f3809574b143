//! The table as text.

use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2};
use crate::page::table::{Table, heads};
use crate::tune::found::Found;
use crate::tune::mount::Vehicle;
use crate::tune::tuning::Tuning;

/// Verdict, results, and manoeuvres for the missing ones.
pub(super) fn text(t: &Tuning) -> String {
    let rows = rows(t);
    let cells = |(name, found, unit): &Row| {
        let value = match found.missing {
            None => found.with_sigma(),
            Some(_) => "not known".to_owned(),
        };
        vec![name.clone(), value, (*unit).to_owned()]
    };
    let vehicle = match t.mount.vehicle {
        Vehicle::Car => "It moves like a car.",
        Vehicle::Aircraft => "It moves like an aircraft.",
        Vehicle::Other => "It moves neither like a car nor like an aircraft.",
    };
    let mut missing: Vec<(Vec<&str>, &str)> = Vec::new();
    for (name, found, _) in &rows {
        let Some(why) = found.missing else { continue };
        match missing.iter_mut().find(|(_, known)| *known == why) {
            Some((names, _)) => names.push(name),
            None => missing.push((vec![name], why)),
        }
    }
    let missing: Vec<String> = (missing.iter())
        .map(|(names, why)| format!("To know {}: {why}.\n", names.join("; ")))
        .collect();
    format!(
        "{}\n\n{}\nAlong the unit's axes; offsets are to be subtracted from readings. {vehicle}\n{}{}",
        t.verdict.lines().join("\n"),
        Table::of("", heads("| value | unit"), rows.iter().map(cells)).plain(),
        t.clock_note().map_or(String::new(), |note| note + "\n"),
        missing.concat(),
    )
}

/// Name, value and unit.
type Row = (String, Found, &'static str);

fn rows(t: &Tuning) -> Vec<Row> {
    let (deg_h, mg, deg) = (1.0 / DEG_H_RADPS, 1.0 / MG_MPS2, 1_f64.to_degrees());
    let [roll, pitch, heading] = [t.mount.roll_rad, t.mount.pitch_rad, t.mount.heading_rad];
    let row = |name: &str, found: Found, by: f64, unit| (name.to_owned(), found.scaled(by), unit);
    let one = |name: &str, found: Found, by: f64, unit| vec![row(name, found, by, unit)];
    let each = |what: &str, found: &[Found; 3], by: f64, unit| -> Vec<Row> {
        let axes = ["right", "forward", "up"].into_iter().zip(found);
        axes.map(|(axis, found)| row(&format!("{what} {axis}"), *found, by, unit))
            .collect()
    };
    let white = t.gnss_velocity_noise_mps;
    [
        one("GNSS delay", t.gnss_delay_s, 1e3, "ms"),
        one(
            "positions after velocities",
            t.gnss_position_delay_s,
            1e3,
            "ms",
        ),
        each("antenna", &t.lever_arm_m, 1.0, "m"),
        one("mount roll, right down", roll, deg, "deg"),
        one("mount pitch, nose up", pitch, deg, "deg"),
        one("mount heading, clockwise", heading, deg, "deg"),
        each("gyro offset", &t.gyro_bias_radps, deg_h, "deg/h"),
        each("accelerometer offset", &t.accel_bias_mps2, mg, "mg"),
        one("gyro noise", t.gyro_noise, deg_h, "deg/h/sqrt(Hz)"),
        one("accelerometer noise", t.accel_noise, mg, "mg/sqrt(Hz)"),
        one("gyro offset walk", t.gyro_bias_walk, deg_h, "deg/h/sqrt(s)"),
        one(
            "accelerometer offset walk",
            t.accel_bias_walk,
            mg,
            "mg/sqrt(s)",
        ),
        one("GNSS velocity noise", white, 1.0, "m/s"),
    ]
    .concat()
}

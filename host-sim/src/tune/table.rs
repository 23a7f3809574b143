//! For people to read.

use super::found::Found;
use super::mount::Vehicle;
use super::tuning::Tuning;
use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2};
use crate::page::table;

/// Verdict, what was found, and what would show the rest.
pub fn text(t: &Tuning) -> String {
    let rows = rows(t);
    let cells = |(name, found, unit): &(String, Found, &str)| {
        let unknown = || "not known".to_owned();
        let value = found
            .missing
            .map_or_else(|| found.with_sigma(), |_| unknown());
        vec![name.clone(), value, (*unit).to_owned()]
    };
    let cells: Vec<_> = rows.iter().map(cells).collect();
    let vehicle = match t.mount.vehicle {
        Vehicle::Car => "It moves like a car.",
        Vehicle::Aircraft => "It moves like an aircraft.",
        Vehicle::Other => "It moves neither like a car nor like an aircraft.",
    };
    let mut missing: Vec<(Vec<&str>, &str)> = Vec::new();
    for (name, found, _) in &rows {
        if let Some(why) = found.missing {
            match missing.iter_mut().find(|(_, known)| *known == why) {
                Some((names, _)) => names.push(name),
                None => missing.push((vec![name], why)),
            }
        }
    }
    let missing: Vec<String> = (missing.iter())
        .map(|(names, why)| format!("To know {}: {why}.\n", names.join("; ")))
        .collect();
    format!(
        "{}\n\n{}\nAlong the unit's axes; offsets are to be subtracted from readings. {vehicle}\n{}",
        t.verdict.lines().join("\n"),
        table::plain(&table::heads("| value | unit"), &cells),
        missing.concat(),
    )
}

fn rows(t: &Tuning) -> Vec<(String, Found, &'static str)> {
    let (deg_h, mg, deg) = (1.0 / DEG_H_RADPS, 1.0 / MG_MPS2, 1_f64.to_degrees());
    let row = |name: &str, found: Found, by: f64, unit| (name.to_owned(), found.scaled(by), unit);
    let each = |what: &str, found: &[Found; 3], by: f64, unit: &'static str| {
        let axes = ["right", "forward", "up"];
        [0, 1, 2].map(|axis| row(&format!("{what} {}", axes[axis]), found[axis], by, unit))
    };
    let mut rows = vec![row("GNSS delay", t.gnss_delay_s, 1e3, "ms")];
    rows.extend(each("antenna", &t.lever_arm_m, 1.0, "m"));
    rows.push(row("mount roll, right down", t.mount.roll, deg, "deg"));
    rows.push(row("mount pitch, nose up", t.mount.pitch, deg, "deg"));
    rows.push(row("mount heading, clockwise", t.mount.heading, deg, "deg"));
    rows.extend(each("gyro offset", &t.gyro_bias_radps, deg_h, "deg/h"));
    rows.extend(each("accelerometer offset", &t.accel_bias_mps2, mg, "mg"));
    rows.push(row("gyro noise", t.gyro_noise, deg_h, "deg/h/sqrt(Hz)"));
    rows.push(row("accelerometer noise", t.accel_noise, mg, "mg/sqrt(Hz)"));
    rows.push(row(
        "gyro offset walk",
        t.gyro_bias_walk,
        deg_h,
        "deg/h/sqrt(s)",
    ));
    rows.push(row(
        "accelerometer offset walk",
        t.accel_bias_walk,
        mg,
        "mg/sqrt(s)",
    ));
    rows.push(row(
        "GNSS velocity noise",
        t.gnss_velocity_noise_mps,
        1.0,
        "m/s",
    ));
    rows
}

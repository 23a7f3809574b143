//! The command `aircraft`.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::{Result, miette};

use super::options::{self, show};
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::performance::{Performance, performance};
use crate::aircraft::pictures;
use crate::page;
use crate::page::output;

/// Options of `aircraft`.
#[derive(Debug, Args)]
pub struct Aircraft {
    /// Aircraft, TOML; the Cessna 172 unless given.
    #[arg(long)]
    aircraft: Option<PathBuf>,
    /// Folder for pictures and the table.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// File name of the table; marks the folder as ours.
const TABLE: &str = "performance.json";

/// Prints the performance table and the modes of an aircraft.
pub fn aircraft(options: &Aircraft, json: bool, force: bool) -> Result<()> {
    let dynamics = options::aircraft(options.aircraft.as_deref())?;
    let name = &dynamics.parameters.name;
    let table = performance(&dynamics).ok_or_else(|| {
        miette!(
            help = "check mass, lift and power of its file",
            "the {name} cannot fly level at sea level"
        )
    })?;
    if let Some(out) = &options.out {
        let slowest_mps = 1.05 * table.clean_stall_speed_kmh / 3.6;
        let drawn = pictures::of_aircraft(&dynamics, slowest_mps, table.max_speed_kmh / 3.6);
        output::build(out, TABLE, force, |folder| -> Result<()> {
            output::write(folder, TABLE, page::json(&table)?)?;
            pictures::write(&drawn, folder)?;
            Ok(())
        })?;
    }
    show(json, &table, || readable(&dynamics, &table))
}

fn readable(dynamics: &Dynamics, table: &Performance) -> String {
    let published = dynamics.parameters.specification.as_ref();
    let mut text = format!(
        "{}\n\n{:<34}{:>10}{:>15}\n",
        table.name, "", "model", "specification"
    );
    let mut row = |name: &str, value: f64, published: Option<f64>| {
        let published = published.map_or(String::new(), |p| format!("{p:.1}"));
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{name:<34}{value:>10.1}{published:>15}");
    };
    let [speed, stall, climb] = [
        published.map(|p| p.max_speed_kmh),
        published.map(|p| p.stall_speed_kmh),
        published.map(|p| p.climb_rate_mps),
    ];
    row("maximum level speed, km/h", table.max_speed_kmh, speed);
    row(
        "stall speed, flaps down, km/h",
        table.stall_speed_kmh,
        stall,
    );
    row("rate of climb, m/s", table.climb_rate_mps, climb);
    row(
        "stall speed, flaps up, km/h",
        table.clean_stall_speed_kmh,
        None,
    );
    row("speed of best climb, km/h", table.climb_speed_kmh, None);
    row("service ceiling, m", table.service_ceiling_m, None);
    row("ceiling, m", table.ceiling_m, None);
    row(
        "engine at full speed, rpm",
        table.engine_rpm_at_max_speed,
        None,
    );
    row("engine in the climb, rpm", table.engine_rpm_in_climb, None);
    let _ = writeln!(
        text,
        "\nSteady level flight at sea level: trim and natural motions\n\
         \x20    m/s   alpha elevator throttle    power       phugoid  short period    Dutch roll    roll  spiral\n\
         \x20            deg      deg                kW    s, damping    s, damping    s, damping       s       s"
    );
    for row in &table.trims {
        let _ = write!(
            text,
            "{:>8.1}{:>8.2}{:>9.2}{:>9.2}{:>9.1}",
            row.airspeed_mps, row.alpha_deg, row.elevator_deg, row.throttle, row.shaft_power_kw
        );
        if let Some(modes) = &row.modes {
            for mode in [&modes.phugoid, &modes.short_period, &modes.dutch_roll] {
                let _ = write!(text, "{:>8.2} {:>5.2}", mode.period_s, mode.damping_ratio);
            }
            let _ = write!(
                text,
                "{:>8.2}{:>8.0}",
                modes.roll_time_constant_s, modes.spiral_time_constant_s
            );
        }
        text.push('\n');
    }
    text
}

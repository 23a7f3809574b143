//! The command `aircraft`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{Result, miette};

use super::options::{self, Folder};
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::performance::{Performance, performance};
use crate::aircraft::pictures;
use crate::page;
use crate::page::output;

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder for pictures and the table")))]
pub struct Aircraft {
    /// Aircraft, TOML; the Cessna 172 unless given.
    #[arg(long)]
    aircraft: Option<PathBuf>,
    #[command(flatten)]
    folder: Folder,
}

/// File name of the table; marks the folder as ours.
const TABLE: &str = "performance.json";

/// Prints the performance table and the modes of an aircraft.
pub fn aircraft(options: &Aircraft) -> Result<()> {
    options.folder.check(TABLE)?;
    let dynamics = options::aircraft(options.aircraft.as_deref())?;
    let name = &dynamics.parameters.name;
    let table = performance(&dynamics).ok_or_else(|| {
        miette!(
            help = "check mass, lift and power of its file",
            "the {name} cannot fly level at sea level"
        )
    })?;
    let write = |folder: &Path| -> Result<()> {
        let slowest_mps = 1.05 * table.clean_stall_speed_kmh / 3.6;
        let drawn = pictures::of_aircraft(&dynamics, slowest_mps, table.max_speed_kmh / 3.6);
        output::write(folder, TABLE, page::json(&table)?)?;
        Ok(pictures::write(&drawn, folder)?)
    };
    let text = || readable(&dynamics, &table);
    options.folder.deliver(TABLE, write, &table, text)
}

fn readable(dynamics: &Dynamics, table: &Performance) -> String {
    let published = dynamics.parameters.specification.as_ref();
    let mut text = format!(
        "{}\n\n{:<34}{:>10}{:>15}\n",
        table.name, "", "model", "specification"
    );
    let speeds = [
        table.max_speed_kmh,
        table.stall_speed_kmh,
        table.climb_rate_mps,
    ];
    let specified = published.map(|p| [p.max_speed_kmh, p.stall_speed_kmh, p.climb_rate_mps]);
    let names = [
        "maximum level speed, km/h",
        "stall speed, flaps down, km/h",
        "rate of climb, m/s",
    ];
    for (which, (name, value)) in names.into_iter().zip(speeds).enumerate() {
        let specified = specified.map_or(String::new(), |s| format!("{:.1}", s[which]));
        let _ = writeln!(text, "{name:<34}{value:>10.1}{specified:>15}");
    }
    for (name, value) in [
        ("stall speed, flaps up, km/h", table.clean_stall_speed_kmh),
        ("speed of best climb, km/h", table.climb_speed_kmh),
        ("service ceiling, m", table.service_ceiling_m),
        ("ceiling, m", table.ceiling_m),
        ("engine at full speed, rpm", table.engine_rpm_at_max_speed),
        ("engine in the climb, rpm", table.engine_rpm_in_climb),
    ] {
        let _ = writeln!(text, "{name:<34}{value:>10.1}{:>15}", "");
    }
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

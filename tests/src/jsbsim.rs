//! `JSBSim`'s Cessna 172 beside ours: an independent model of the same aircraft.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::modes::Modes;
use host_sim::aircraft::performance::{TrimRow, trim_row};
use serde::Deserialize;

use crate::cargo::{build_folder, repository, succeed};

/// Slow, cruise, fast; true airspeed.
pub const SPEEDS_MPS: [f64; 3] = [40.0, 50.0, 58.0];
/// Where they are compared.
pub const HEIGHT_M: f64 = 1000.0;

/// What `tests/jsbsim/reference.py` prints.
#[derive(Debug, Deserialize)]
pub struct Reference {
    /// Of `JSBSim`.
    pub version: String,
    /// Name of the aircraft there.
    pub model: String,
    /// One for each speed.
    pub rows: Vec<ReferenceRow>,
}

/// Steady level flight of `JSBSim`'s aircraft.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct ReferenceRow {
    pub airspeed_mps: f64,
    pub mass_kg: f64,
    pub alpha_deg: f64,
    pub elevator_deg: f64,
    pub thrust_n: f64,
    pub shaft_power_kw: f64,
    pub engine_rpm: f64,
    pub roll_inertia_kgm2: f64,
    pub pitch_inertia_kgm2: f64,
    pub yaw_inertia_kgm2: f64,
    pub modes: Modes,
}

/// The Python that has `JSBSim`: `$JSBSIM_PYTHON`, or else one made here once with `pip`.
fn python() -> Result<PathBuf, String> {
    // Tests run side by side: one makes it, the others wait.
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    if let Some(python) = std::env::var_os("JSBSIM_PYTHON") {
        return Ok(python.into());
    }
    PYTHON.get_or_init(environment).clone()
}

fn environment() -> Result<PathBuf, String> {
    let folder = build_folder("jsbsim");
    let python = folder.join("bin/python");
    // An interrupted installation must not be taken for a whole one.
    let complete = folder.join("complete");
    if complete.exists() {
        return Ok(python);
    }
    let make = || {
        let venv = ["-m", "venv", "--clear"];
        succeed(Command::new("python3").args(venv).arg(&folder))?;
        let pip = ["-m", "pip", "install", "--quiet", "jsbsim==1.3.3", "numpy"];
        succeed(Command::new(&python).args(pip))?;
        std::fs::write(&complete, "").map_err(|error| format!("{}: {error}", complete.display()))
    };
    make().map_err(|error| {
        format!("JSBSim is missing and could not be installed; run `pip install jsbsim numpy` and name that Python in JSBSIM_PYTHON.\n{error}")
    })?;
    Ok(python)
}

/// What a script of `tests/jsbsim/` prints.
fn script<T: serde::de::DeserializeOwned>(name: &str, arguments: &[f64]) -> Result<T, String> {
    let mut command = Command::new(python()?);
    command
        .arg(repository().join("tests/jsbsim").join(name))
        .args(arguments.iter().map(f64::to_string));
    let output = command
        .output()
        .map_err(|error| format!("{command:?} did not start: {error}"))?;
    if !output.status.success() {
        return Err(format!(
            "{command:?} failed:\n{}",
            String::from_utf8_lossy(&output.stderr)
        ));
    }
    serde_json::from_slice(&output.stdout)
        .map_err(|error| format!("{command:?} printed something else than expected: {error}"))
}

/// Trim and modes of `JSBSim`'s aircraft.
pub fn reference() -> Result<Reference, String> {
    let [slow, cruise, fast] = SPEEDS_MPS;
    script(
        "reference.py",
        &[HEIGHT_M, cessna172().mass.mass_kg, slow, cruise, fast],
    )
}

/// What a 100 Hz step of `JSBSim`'s c172x takes, s.
pub fn jsbsim_step_s() -> Result<f64, String> {
    script("cost.py", &[])
}

/// Our aircraft at the same speeds.
pub fn ours() -> Vec<TrimRow> {
    let dynamics = Dynamics::new(&cessna172());
    SPEEDS_MPS
        .iter()
        .filter_map(|&speed| trim_row(&dynamics, speed, HEIGHT_M))
        .collect()
}

/// Our equations with `JSBSim`'s moments of inertia, pitch stiffness and pitch moment at zero angle
/// of attack: what then remains is not a matter of these parameters.
pub fn ours_with_its_numbers(reference: &Reference) -> Vec<TrimRow> {
    reference.rows.iter().filter_map(with_its_numbers).collect()
}

fn with_its_numbers(row: &ReferenceRow) -> Option<TrimRow> {
    let mut parameters = cessna172();
    parameters.mass.roll_inertia_kgm2 = row.roll_inertia_kgm2;
    parameters.mass.pitch_inertia_kgm2 = row.pitch_inertia_kgm2;
    parameters.mass.yaw_inertia_kgm2 = row.yaw_inertia_kgm2;
    // Cmo and Cmalpha of its file.
    parameters.pitch.zero = 0.1;
    parameters.pitch.alpha = -1.8;
    trim_row(&Dynamics::new(&parameters), row.airspeed_mps, HEIGHT_M)
}

/// The comparison as a Markdown table.
///
/// # Panics
/// If one of our rows lacks a mode.
pub fn table(ours: &[TrimRow], reference: &Reference) -> String {
    let mut text = format!(
        "| {HEIGHT_M:.0} m | {} |\n|---|{}\n",
        SPEEDS_MPS
            .map(|speed| format!(
                "{speed:.0} m/s, ours | {} {}",
                reference.model, reference.version
            ))
            .join(" | "),
        "---|".repeat(2 * SPEEDS_MPS.len()),
    );
    let mut line = |name: &str,
                    digits: usize,
                    mine: &dyn Fn(&TrimRow) -> f64,
                    its: &dyn Fn(&ReferenceRow) -> f64| {
        let cells = ours
            .iter()
            .zip(&reference.rows)
            .map(|(a, b)| format!("{:.digits$} | {:.digits$}", mine(a), its(b)));
        let _ = writeln!(
            text,
            "| {name} | {} |",
            cells.collect::<Vec<_>>().join(" | ")
        );
    };
    let modes = |row: &TrimRow| row.modes.expect("all modes exist at these speeds");
    line("angle of attack, deg", 2, &|r| r.alpha_deg, &|r| {
        r.alpha_deg
    });
    line("elevator, deg", 2, &|r| r.elevator_deg, &|r| r.elevator_deg);
    line("thrust, N", 0, &|r| r.thrust_n, &|r| r.thrust_n);
    line("shaft power, kW", 1, &|r| r.shaft_power_kw, &|r| {
        r.shaft_power_kw
    });
    line("engine, rpm", 0, &|r| r.engine_rpm, &|r| r.engine_rpm);
    line(
        "phugoid period, s",
        1,
        &|r| modes(r).phugoid.period_s,
        &|r| r.modes.phugoid.period_s,
    );
    line(
        "phugoid damping ratio",
        3,
        &|r| modes(r).phugoid.damping_ratio,
        &|r| r.modes.phugoid.damping_ratio,
    );
    line(
        "short period, rad/s",
        2,
        &|r| modes(r).short_period.natural_frequency_radps,
        &|r| r.modes.short_period.natural_frequency_radps,
    );
    line(
        "short period damping ratio",
        2,
        &|r| modes(r).short_period.damping_ratio,
        &|r| r.modes.short_period.damping_ratio,
    );
    line(
        "Dutch roll, rad/s",
        2,
        &|r| modes(r).dutch_roll.natural_frequency_radps,
        &|r| r.modes.dutch_roll.natural_frequency_radps,
    );
    line(
        "Dutch roll damping ratio",
        2,
        &|r| modes(r).dutch_roll.damping_ratio,
        &|r| r.modes.dutch_roll.damping_ratio,
    );
    line(
        "roll time constant, s",
        3,
        &|r| modes(r).roll_time_constant_s,
        &|r| r.modes.roll_time_constant_s,
    );
    line(
        "spiral time constant, s",
        0,
        &|r| modes(r).spiral_time_constant_s,
        &|r| r.modes.spiral_time_constant_s,
    );
    text
}

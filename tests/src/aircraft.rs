//! Modes and cruise of our aircraft compared with published values, and with `JSBSim`'s Cessna 172, an
//! independent model of the same aircraft.

use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::input::read_aircraft;
use host_sim::aircraft::performance::{TrimRow, trim_row};
use host_sim::aircraft::trim::{Modes, Oscillation};
use serde::Deserialize;

use crate::cargo::repository;
use crate::python::Environment;

/// Published values of the Cessna 172: row of the table, index of the speed, value.
///
/// At 99 kt the cruise table of the 172N's handbook has 51 % of 160 hp and 2200 rpm (as
/// github.com/abu-infidel/Python-based-BEMT-visualizer-calculator quotes it). At 110 kt
/// indicated, 58 m/s, a flight trial on a 172S saw a phugoid of 35 to 40 s, controls free; the
/// decay of its plotted airspeed gives the damping (AAIB Bulletin 12/2020, G-CBXJ, as quoted in
/// the reference data of a public flight simulator).
pub const CESSNA_172: [(&str, usize, &str); 4] = [
    ("shaft power, kW", 1, "60.8"),
    ("engine, rpm", 1, "2200"),
    ("phugoid period, s", 2, "35 to 40"),
    ("phugoid damping ratio", 2, "0.13"),
];

/// Cruise of Roskam's Cessna 182: 220.1 ft/s at 5000 ft.
const CESSNA_182_MPS: f64 = 67.09;
const CESSNA_182_M: f64 = 1524.0;

/// Modes of the Cessna 182 by Roskam's coefficients (`host-sim/aircraft/cessna182.toml`).
///
/// Longitudinal ones as public programs built on the book state them; lateral ones are the
/// eigenvalues of the textbook's four lateral equations with these coefficients.
pub const CESSNA_182_MODES: Modes = Modes {
    phugoid: oscillation(0.1712, 0.129, 37.0),
    short_period: oscillation(5.271, 0.844, 2.224),
    dutch_roll: oscillation(3.245, 0.207, 1.979),
    spiral_time_constant_s: 55.8,
    roll_time_constant_s: 0.0769,
};

const fn oscillation(
    natural_frequency_radps: f64,
    damping_ratio: f64,
    period_s: f64,
) -> Oscillation {
    Oscillation {
        natural_frequency_radps,
        damping_ratio,
        period_s,
    }
}

/// The Cessna 182 in our equations.
pub fn cessna_182() -> Result<TrimRow, String> {
    let file = repository().join("host-sim/aircraft/cessna182.toml");
    let dynamics: Dynamics = read_aircraft(&file).map_err(|error| error.to_string())?;
    trim_row(&dynamics, CESSNA_182_MPS, CESSNA_182_M)
        .ok_or_else(|| "the Cessna 182 does not fly its cruise".to_owned())
}

/// A quantity of a mode: name, decimals, value.
pub type ModeRow = (&'static str, usize, fn(&Modes) -> f64);

/// Rows of modes in tables.
pub const MODE_ROWS: [ModeRow; 8] = [
    ("phugoid period, s", 1, |m| m.phugoid.period_s),
    ("phugoid damping ratio", 3, |m| m.phugoid.damping_ratio),
    ("short period, rad/s", 2, |m| {
        m.short_period.natural_frequency_radps
    }),
    ("short period damping ratio", 2, |m| {
        m.short_period.damping_ratio
    }),
    ("Dutch roll, rad/s", 2, |m| {
        m.dutch_roll.natural_frequency_radps
    }),
    ("Dutch roll damping ratio", 2, |m| {
        m.dutch_roll.damping_ratio
    }),
    ("roll time constant, s", 3, |m| m.roll_time_constant_s),
    ("spiral time constant, s", 0, |m| m.spiral_time_constant_s),
];

// --- JSBSim ---

/// Slow, cruise, fast; true airspeed. The latter two are those of the published values
/// ([`CESSNA_172`]). At 40 m/s a kink of `JSBSim`'s lift table would lie at the trim.
pub const SPEEDS_MPS: [f64; 3] = [42.0, 50.9, 58.0];
/// Height of the comparison: 4000 ft.
pub const HEIGHT_M: f64 = 1219.2;

/// Output of `tests/jsbsim/reference.py`.
#[derive(Debug, Deserialize)]
pub struct Reference {
    /// Version of `JSBSim`.
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

static PYTHON: Environment =
    Environment::new("jsbsim", &["jsbsim==1.3.3", "numpy"], "JSBSIM_PYTHON");

/// Trim and modes of `JSBSim`'s aircraft.
pub fn reference() -> Result<Reference, String> {
    let [slow, cruise, fast] = SPEEDS_MPS;
    let arguments = [HEIGHT_M, cessna172().mass.mass_kg, slow, cruise, fast];
    PYTHON.run("reference.py", &arguments.map(|value| value.to_string()))
}

/// Computing time of a 100 Hz step of `JSBSim`'s c172x, s.
pub fn jsbsim_step_s() -> Result<f64, String> {
    PYTHON.run("cost.py", &[""; 0])
}

/// Our aircraft at the same speeds.
pub fn ours() -> Vec<TrimRow> {
    let dynamics = Dynamics::new(&cessna172());
    SPEEDS_MPS
        .iter()
        .filter_map(|&speed| trim_row(&dynamics, speed, HEIGHT_M))
        .collect()
}

/// Our equations with `JSBSim`'s moments of inertia, pitch stiffness and pitch moment at zero angle of attack: the
/// remaining differences are not due to these parameters.
pub fn ours_with_jsbsim_parameters(reference: &Reference) -> Vec<TrimRow> {
    reference
        .rows
        .iter()
        .filter_map(with_jsbsim_parameters)
        .collect()
}

fn with_jsbsim_parameters(row: &ReferenceRow) -> Option<TrimRow> {
    let mut parameters = cessna172();
    parameters.mass.roll_inertia_kgm2 = row.roll_inertia_kgm2;
    parameters.mass.pitch_inertia_kgm2 = row.pitch_inertia_kgm2;
    parameters.mass.yaw_inertia_kgm2 = row.yaw_inertia_kgm2;
    // Cmo and Cmalpha of its file.
    parameters.pitch.zero = 0.1;
    parameters.pitch.alpha = -1.8;
    trim_row(&Dynamics::new(&parameters), row.airspeed_mps, HEIGHT_M)
}

/// The comparison, optionally with published values: column heads and cells.
///
/// # Panics
/// If one of our rows lacks a mode.
pub fn table(
    ours: &[TrimRow],
    reference: &Reference,
    published: bool,
) -> (Vec<String>, Vec<Vec<String>>) {
    let published = |speed: usize| published && CESSNA_172.iter().any(|known| known.1 == speed);
    let mut header = vec![format!("at {HEIGHT_M:.0} m")];
    for (speed, airspeed) in SPEEDS_MPS.iter().enumerate() {
        header.push(format!("{airspeed:.0} m/s, this model"));
        header.push(format!("JSBSim {}", reference.model));
        if published(speed) {
            header.push("published".to_owned());
        }
    }
    let row = |name: &'static str, digits: usize, values: &dyn Fn(usize) -> [f64; 2]| {
        let mut cells = vec![name.to_owned()];
        for speed in 0..SPEEDS_MPS.len() {
            cells.extend(values(speed).map(|value| format!("{value:.digits$}")));
            if published(speed) {
                let known = CESSNA_172
                    .iter()
                    .find(|known| (known.0, known.1) == (name, speed));
                cells.push(known.map_or(String::new(), |known| known.2.to_owned()));
            }
        }
        cells
    };
    let modes = |row: &TrimRow| row.modes.expect("all modes exist at these speeds");
    let trims = TRIM_ROWS.iter().map(|(name, digits, mine, its)| {
        row(name, *digits, &|speed| {
            [mine(&ours[speed]), its(&reference.rows[speed])]
        })
    });
    let modes_rows = MODE_ROWS.iter().map(|(name, digits, value)| {
        row(name, *digits, &|speed| {
            [
                value(&modes(&ours[speed])),
                value(&reference.rows[speed].modes),
            ]
        })
    });
    (header, trims.chain(modes_rows).collect())
}

type TrimValue = (
    &'static str,
    usize,
    fn(&TrimRow) -> f64,
    fn(&ReferenceRow) -> f64,
);

const TRIM_ROWS: [TrimValue; 5] = [
    ("angle of attack, deg", 2, |r| r.alpha_deg, |r| r.alpha_deg),
    ("elevator, deg", 2, |r| r.elevator_deg, |r| r.elevator_deg),
    ("thrust, N", 0, |r| r.thrust_n, |r| r.thrust_n),
    (
        "shaft power, kW",
        1,
        |r| r.shaft_power_kw,
        |r| r.shaft_power_kw,
    ),
    ("engine, rpm", 0, |r| r.engine_rpm, |r| r.engine_rpm),
];

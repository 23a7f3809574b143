//! Natural motions and cruise that others have published.

use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::input::read_aircraft;
use host_sim::aircraft::performance::{TrimRow, trim_row};
use host_sim::aircraft::trim::{Modes, Oscillation};

use crate::cargo::repository;

/// What is published of the Cessna 172: row of the table, which of its speeds, value.
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

/// A quantity of a mode: its name, digits that are worth printing, and how to get it.
pub type ModeRow = (&'static str, usize, fn(&Modes) -> f64);

/// What tables say of modes.
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

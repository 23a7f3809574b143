//! The noise of a log, by likelihood: which noise makes the innovations of the Kalman filter the
//! most likely ones.
//!
//! A few numbers, each a factor on what the class of sensors says, within bounds of what such
//! sensors and receivers are; wild innovations count as under noise with wide tails
//! ([`Filter::log_likelihood`]), so that outliers do not own the result.
//!
//! Not yet to be relied on: near the truth the likelihood is right, but it has cliffs of hundreds
//! to thousands, not explained yet, and the search stalls on them.
//!
//! [`Filter::log_likelihood`]: crate::kalman::Filter::log_likelihood

mod search;

use ins_core::Config;
use ins_core::navigator::ConfigError;
use serde::Serialize;

use crate::kalman::{Noise, PartNoise, Run};
use crate::log::Log;
use search::maximum;

/// A number of the noise model that is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Which, with its unit.
    pub name: &'static str,
    /// Reads it.
    pub get: fn(&Noise) -> f64,
    /// Sets it.
    pub set: fn(&mut Noise, f64),
    /// What it can be.
    pub bounds: Bounds,
}

/// Bounds of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounds {
    /// Anything between, whatever the class.
    Between(f64, f64),
    /// Factors on what the class says.
    Times(f64, f64),
}

impl Bounds {
    fn around(self, class: f64) -> [f64; 2] {
        let (least, most) = match self {
            Self::Between(least, most) => (least, most),
            Self::Times(least, most) => (least * class, most * class),
        };
        [libm::log(least), libm::log(most)]
    }
}

/// Receivers: carrier phase at best, a weak signal in town at worst.
const VELOCITY_MPS: Bounds = Bounds::Between(0.003, 2.0);
/// Fixed ambiguities at best, a canyon at worst.
const POSITION_M: Bounds = Bounds::Between(0.01, 30.0);
/// From one fix of a quick receiver to the smoothing of a slow one.
const VELOCITY_COLOUR_S: Bounds = Bounds::Between(0.2, 30.0);
/// From a filter in the receiver to the passage of a satellite.
const POSITION_COLOUR_S: Bounds = Bounds::Between(1.0, 600.0);
/// Sensors of one class differ by several times, and vibration adds as much again.
const SENSOR: Bounds = Bounds::Times(0.2, 30.0);

macro_rules! parameter {
    ($name:literal, $($field:ident).+, $bounds:expr) => {
        Parameter {
            name: $name,
            get: |noise| noise.$($field).+,
            set: |noise, value| noise.$($field).+ = value,
            bounds: $bounds,
        }
    };
}

/// All of them.
pub const PARAMETERS: [Parameter; 12] = [
    parameter!("velocity white, m/s", velocity.white, VELOCITY_MPS),
    parameter!("velocity colour, m/s", velocity.colour, VELOCITY_MPS),
    parameter!(
        "velocity correlation, s",
        velocity.correlation_s,
        VELOCITY_COLOUR_S
    ),
    parameter!(
        "vertical velocity white, m/s",
        velocity_up.white,
        VELOCITY_MPS
    ),
    parameter!("position white, m", position.white, POSITION_M),
    parameter!("position colour, m", position.colour, POSITION_M),
    parameter!(
        "position correlation, s",
        position.correlation_s,
        POSITION_COLOUR_S
    ),
    parameter!("height white, m", height.white, POSITION_M),
    parameter!("height colour, m", height.colour, POSITION_M),
    Parameter {
        name: "level gyros, rad/sqrt(s)",
        get: |noise| noise.gyro_noise.x,
        set: |noise, value| {
            noise.gyro_noise.x = value;
            noise.gyro_noise.y = value;
        },
        bounds: SENSOR,
    },
    parameter!("up gyro, rad/sqrt(s)", gyro_noise.z, SENSOR),
    Parameter {
        name: "accelerometers, m/s/sqrt(s)",
        get: |noise| noise.accel_noise.x,
        set: |noise, value| noise.accel_noise.fill(value),
        bounds: SENSOR,
    },
];

/// A noise model found.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// As found, the rest as told.
    pub noise: Noise,
    /// Each number.
    pub found: Vec<Found>,
    /// Logarithm of how much likelier the log is than under the noise told.
    pub gain: f64,
}

/// One number found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Found {
    /// Which, with its unit.
    pub name: &'static str,
    /// As told.
    pub told: f64,
    /// As found.
    pub value: f64,
    /// One sigma of its logarithm, the others held; infinite where the log does not tell.
    pub log_sigma: f64,
}

/// Where a coloured part begins that nobody told of: beside the white one, at a time between those
/// that look white and those that look constant.
const COLOUR_PART: f64 = 0.5;
const VELOCITY_START_S: f64 = 2.0;
const POSITION_START_S: f64 = 30.0;

/// Finds some numbers of the noise of a log, beginning with what its class is told. Sigmas that
/// the fixes state are not looked at.
pub fn fit(
    log: &Log,
    config: Config,
    told: Noise,
    parameters: &[Parameter],
) -> Result<Fit, ConfigError> {
    // Whatever cannot be used is found here, once.
    let before = log_likelihood(log, config, told)?;
    let start = with_colour(told);
    let class: Vec<f64> = parameters.iter().map(|p| (p.get)(&start)).collect();
    let values: Vec<f64> = class.iter().map(|value| libm::log(*value)).collect();
    let bounds: Vec<[f64; 2]> = (parameters.iter().zip(&class))
        .map(|(parameter, value)| parameter.bounds.around(*value))
        .collect();
    let noise_at = |values: &[f64]| {
        let mut noise = start;
        for (parameter, value) in parameters.iter().zip(values) {
            (parameter.set)(&mut noise, libm::exp(*value));
        }
        share_colour(noise)
    };
    let best = maximum(&values, &bounds, |values| {
        log_likelihood(log, config, noise_at(values)).unwrap_or(f64::NEG_INFINITY)
    });
    let noise = noise_at(&best.at);
    let found = PARAMETERS
        .iter()
        .zip(&best.sigma)
        .map(|(parameter, sigma)| Found {
            name: parameter.name,
            told: (parameter.get)(&told),
            value: (parameter.get)(&noise),
            log_sigma: *sigma,
        });
    Ok(Fit {
        noise,
        found: found.collect(),
        gain: best.value - before,
    })
}

/// Every part of a fix with a coloured part to begin with, and no sigma of its own.
fn with_colour(told: Noise) -> Noise {
    let begun = |part: PartNoise, correlation_s: f64| PartNoise {
        believes_stated: false,
        colour: if part.colour > 0.0 {
            part.colour
        } else {
            COLOUR_PART * part.white
        },
        correlation_s: if part.colour > 0.0 {
            part.correlation_s
        } else {
            correlation_s
        },
        ..part
    };
    share_colour(Noise {
        velocity: begun(told.velocity, VELOCITY_START_S),
        velocity_up: begun(told.velocity_up, VELOCITY_START_S),
        position: begun(told.position, POSITION_START_S),
        height: begun(told.height, POSITION_START_S),
        ..told
    })
}

/// What one receiver does to its vertical channel as to the others: correlation times, and how much
/// of the velocity noise is coloured.
fn share_colour(mut noise: Noise) -> Noise {
    noise.velocity_up.correlation_s = noise.velocity.correlation_s;
    noise.velocity_up.colour =
        noise.velocity.colour / noise.velocity.white * noise.velocity_up.white;
    noise.height.correlation_s = noise.position.correlation_s;
    noise
}

/// Of a whole log under a noise model.
pub fn log_likelihood(log: &Log, config: Config, noise: Noise) -> Result<f64, ConfigError> {
    let mut run = Run::new(&log.imu, &log.gnss, config, noise)?;
    run.finish();
    Ok(run.log_likelihood())
}

//! Target files: the goals, the unit, and what the site allows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use ins_core::Config;
use ins_core::attitude::{Euler, from_euler};
use miette::{Result, miette};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Deserialize;
use toml::{Spanned, Value};

use super::manoeuvre::Site;
use super::quantities::{Goal, Kind, Quantity};
use crate::aircraft::input::{InputError, Source, error_model, read_text};
use crate::identify::configure::config_of;
use crate::log::{BodyAxes, Grade};
use crate::sim::ErrorModel;
use crate::sim::errors::merge;

const EXAMPLE: &str = "host-sim/targets/drive_target.toml";

#[derive(Clone, Debug)]
pub struct Target {
    pub goals: Vec<Goal>,
    pub unit: Unit,
    pub site: Site,
    /// Keys of an error model, and of the core's configuration, in place of those of the class.
    pub errors: toml::Table,
    pub config: toml::Table,
    file: PathBuf,
    text: String,
}

/// The unit and its mounting in the vehicle.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Unit {
    /// Class of sensors, or a file with an error model.
    pub sensors: String,
    /// Preset of the core, if the sensors are a file.
    pub class: Option<Grade>,
    pub body_axes: BodyAxes,
    /// Attitude of its axes against those of the vehicle.
    pub roll_deg: f64,
    pub pitch_deg: f64,
    pub heading_deg: f64,
    /// Antenna from the unit: to the right, forward and up of it in the vehicle.
    pub antenna_m: [f64; 3],
    pub imu_hz: f64,
}

impl Default for Unit {
    fn default() -> Self {
        Self {
            sensors: "mems".to_owned(),
            class: None,
            body_axes: BodyAxes::Frd,
            roll_deg: 0.0,
            pitch_deg: 0.0,
            heading_deg: 0.0,
            antenna_m: [0.0; 3],
            imu_hz: 100.0,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    target: Spanned<BTreeMap<String, Spanned<Value>>>,
    #[serde(default)]
    unit: Unit,
    #[serde(default)]
    site: Site,
    #[serde(default)]
    errors: toml::Table,
    #[serde(default)]
    config: toml::Table,
}

impl Target {
    pub fn read(file: &Path) -> Result<Self, InputError> {
        Self::parse(file, &read_text(file, "the target of a drive")?)
    }

    /// Checks a text; `file` is for messages.
    pub fn parse(file: &Path, text: &str) -> Result<Self, InputError> {
        let source = Source { file, text };
        let read: File = source.parse(EXAMPLE)?;
        let mut goals = Vec::new();
        let keys: Vec<&str> = Kind::value_variants()
            .iter()
            .map(|kind| kind.key())
            .collect();
        for (kind, key) in Kind::value_variants().iter().zip(&keys) {
            if let Some(value) = read.target.get_ref().get(*key) {
                goals.extend(wanted(&source, *kind, value)?);
            }
        }
        for (key, value) in read.target.get_ref() {
            if !keys.contains(&key.as_str()) {
                let expected = keys.join(", ");
                let message = format!("`{key}` cannot be wanted; expected one of {expected}");
                return Err(source.error(value.span().start, message));
            }
        }
        if goals.is_empty() {
            let nothing = "nothing is wanted; expected a sigma, say `azimuth_deg = 0.1`";
            return Err(source.error(read.target.span().start, nothing.to_owned()));
        }
        check_numbers(&source, &read)?;
        Ok(Self {
            goals,
            unit: read.unit,
            site: read.site,
            errors: read.errors,
            config: read.config,
            file: file.to_owned(),
            text: text.to_owned(),
        })
    }
}

/// One sigma for all axes, or `{ x = ..., y = ... }`.
fn wanted(source: &Source, kind: Kind, value: &Spanned<Value>) -> Result<Vec<Goal>, InputError> {
    let sigma_of = |value: &Value| match value {
        Value::Float(sigma) => Some(*sigma),
        Value::Integer(sigma) => Some(*sigma as f64),
        _ => None,
    };
    let axes: Vec<(usize, Option<f64>)> = match value.get_ref() {
        Value::Table(table) if kind.has_axes() => {
            let axis = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
            let entry = |(name, value): (&String, &Value)| {
                axis(name).map_or((0, None), |axis| (axis, sigma_of(value)))
            };
            table.iter().map(entry).collect()
        }
        value if kind.has_axes() => (0..3).map(|axis| (axis, sigma_of(value))).collect(),
        value => vec![(0, sigma_of(value))],
    };
    let goal = |(axis, sigma): (usize, Option<f64>)| {
        let sigma = sigma.filter(|sigma| *sigma > 0.0 && sigma.is_finite())?;
        let quantity = Quantity { kind, axis };
        Some(Goal { quantity, sigma })
    };
    let goals: Option<Vec<Goal>> = axes.into_iter().map(goal).collect();
    goals.ok_or_else(|| {
        let axes = if kind.has_axes() {
            ", or some of `{ x = 1.0, y = 1.0, z = 1.0 }`"
        } else {
            ""
        };
        let message = format!(
            "`{}`: expected a sigma above zero{axes}; the unit is in the name of the key",
            kind.key()
        );
        source.error(value.span().start, message)
    })
}

fn check_numbers(source: &Source, read: &File) -> Result<(), InputError> {
    let File { unit, site, .. } = read;
    let (slope, minutes) = (site.slope_percent, site.longest_minutes);
    source.all_within(&[
        ("speed_kmh", site.speed_kmh, [10.0, 250.0]),
        ("acceleration_mps2", site.acceleration_mps2, [0.5, 6.0]),
        ("braking_mps2", site.braking_mps2, [0.5, 10.0]),
        ("slope_percent", slope, [0.5, 30.0]),
        ("longest_minutes", minutes, [2.0, 240.0]),
        ("roll_deg", unit.roll_deg, [-180.0, 180.0]),
        ("pitch_deg", unit.pitch_deg, [-90.0, 90.0]),
        ("heading_deg", unit.heading_deg, [-360.0, 360.0]),
        ("imu_hz", unit.imu_hz, [20.0, 1000.0]),
        ("antenna_m", unit.antenna_m[0], [-30.0, 30.0]),
        ("antenna_m", unit.antenna_m[1], [-30.0, 30.0]),
        ("antenna_m", unit.antenna_m[2], [-30.0, 30.0]),
    ])?;
    if site.manoeuvres.is_empty() {
        let message = "no manoeuvre is allowed: expected at least one";
        return Err(source.error(source.key("manoeuvres"), message.to_owned()));
    }
    Ok(())
}

impl Unit {
    /// From its axes to those of the vehicle.
    pub fn mount(&self) -> UnitQuaternion<f64> {
        from_euler(&Euler {
            roll_rad: self.roll_deg.to_radians(),
            pitch_rad: self.pitch_deg.to_radians(),
            heading_rad: self.heading_deg.to_radians(),
        })
    }

    /// The antenna in its axes, right, forward, up.
    pub fn lever_arm_m(&self) -> Vector3<f64> {
        self.mount().inverse() * Vector3::from(self.antenna_m)
    }

    fn grade(&self) -> Option<Grade> {
        (self.class).or_else(|| Grade::from_str(&self.sensors, false).ok())
    }
}

impl Target {
    /// The error model of the unit, antenna and all.
    pub fn error_model(&self) -> Result<ErrorModel> {
        let mut model = error_model(&self.unit.sensors)?;
        model.gnss.habits.lever_arm_m = self.unit.lever_arm_m().into();
        Ok(self.with_errors(&model)?)
    }

    pub fn with_errors(&self, model: &ErrorModel) -> Result<ErrorModel, InputError> {
        (model.with(&self.errors)).map_err(|error| self.refused("[errors", &error.to_string()))
    }

    /// An error in a section: at the key that the message names, or else at the section's head.
    fn refused(&self, section: &str, message: &str) -> InputError {
        let head = self.text.find(section).unwrap_or(0);
        let text = &self.text[head..];
        let named = |line: &&str| {
            let key = line.split_once('=').map(|(key, _)| key.trim());
            key.is_some_and(|key| message.contains(key.rsplit('.').next().unwrap_or(key)))
        };
        let place = text.lines().find(named).and_then(|line| text.find(line));
        let source = Source {
            file: &self.file,
            text: &self.text,
        };
        let message = message.trim_end().replace('\n', " ");
        source.error(head + place.unwrap_or(0), format!("{section}]: {message}"))
    }

    /// Configuration of the core for such a unit: the preset of its class, an unknown lever arm if there
    /// is one, and `[config]`.
    pub fn config(&self, model: &ErrorModel) -> Result<Config> {
        let grade = self.unit.grade().ok_or_else(|| {
            miette!(
                help = "say `class = \"mems\"` or `class = \"hg1700\"` in [unit]",
                "{}: an error model has no class of its own",
                self.unit.sensors
            )
        })?;
        let mut config = config_of(grade, model.imu.output, None);
        if self.unit.lever_arm_m().norm() > 0.0 {
            let_antenna_be_unknown(&mut config);
        }
        self.with_config(config)
    }

    /// A configuration adapted to the goals, and with `[config]`.
    pub fn with_config(&self, mut config: Config) -> Result<Config> {
        if (self.goals.iter()).any(|goal| goal.quantity.kind == Kind::LeverArm) {
            let_antenna_be_unknown(&mut config);
        }
        let refused = |error: &dyn std::fmt::Display| {
            let keys = "keys are those of `Config` in core/src/config.rs";
            self.refused(
                "[config",
                &format!("{}; {keys}", error.to_string().trim_end()),
            )
        };
        let mut table = toml::Table::try_from(config).map_err(|error| refused(&error))?;
        merge(&mut table, &self.config);
        let read: Config = (table.try_into()).map_err(|e: toml::de::Error| refused(&e))?;
        let known = toml::Table::try_from(read).map_err(|error| refused(&error))?;
        match unknown(&self.config, &known) {
            None => Ok(read),
            Some(key) => Err(refused(&format!("`{key}` is not known")).into()),
        }
    }
}

fn let_antenna_be_unknown(config: &mut Config) {
    let unknown = Config::mems().gnss.lever_arm_sigma_m;
    config.gnss.lever_arm_sigma_m = config.gnss.lever_arm_sigma_m.max(unknown);
}

/// The first key that is not among those known, with the tables it is in.
fn unknown(keys: &toml::Table, known: &toml::Table) -> Option<String> {
    keys.iter()
        .find_map(|(key, value)| match (value, known.get(key)) {
            (_, None) => Some(key.clone()),
            (Value::Table(keys), Some(Value::Table(known))) => {
                Some(format!("{key}.{}", unknown(keys, known)?))
            }
            _ => None,
        })
}

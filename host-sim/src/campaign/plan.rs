//! The plan of a campaign.

use std::path::Path;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::aircraft::input::{InputError, Source, read_text};
use crate::log::Grade;
use crate::sim::ErrorModel;
use crate::sim::errors::BiasModel;
use crate::sim::noise::Random;
use ins_core::ImuOutput;

/// Plan of a campaign. All random numbers follow from the seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Fixes every random number.
    #[serde(default)]
    pub seed: u64,
    pub units: u32,
    /// Drives from which each unit is identified.
    pub drives: u32,
    pub drive_minutes: f64,
    /// Flights of a unit with its true model, and as many with the identified one.
    pub flights: u32,
    pub minutes_aided: u32,
    pub minutes_free: u32,
    /// Spread of the logarithm of each noise and sigma from unit to unit.
    #[serde(default)]
    pub unit_spread: f64,
    /// The model that the units are made of: `hg1700`, or the tables of an error model.
    #[serde(default)]
    pub errors: Errors,
}

/// A model by name or in full.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Errors {
    Class(Grade),
    Model(Box<ErrorModel>),
}

/// By hand, since serde's untagged variants would lose the model's own error message.
impl<'de> Deserialize<'de> for Errors {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = toml::Value::deserialize(deserializer)?;
        if value.is_str() {
            value.try_into().map(Self::Class)
        } else {
            value.try_into().map(|model| Self::Model(Box::new(model)))
        }
        .map_err(|error: toml::de::Error| {
            D::Error::custom(error.to_string().trim_end().replace('\n', " "))
        })
    }
}

impl Default for Errors {
    fn default() -> Self {
        Self::Class(Grade::Hg1700)
    }
}

impl Plan {
    pub fn read(file: &Path) -> Result<Self, InputError> {
        Self::parse(file, &read_text(file, "a campaign plan")?)
    }

    fn parse(file: &Path, text: &str) -> Result<Self, InputError> {
        let source = Source { file, text };
        let plan: Self = source.parse("host-sim/campaigns/hg1700.toml")?;
        plan.check_numbers(&source)?;
        plan.check_model().map_err(|message| InputError {
            file: file.to_owned(),
            line: None,
            message,
        })?;
        Ok(plan)
    }

    fn check_numbers(&self, source: &Source) -> Result<(), InputError> {
        const COUNT: [f64; 2] = [1.0, 100_000.0];
        source.all_within(&[
            // The intervals are over units.
            ("units", self.units.into(), [2.0, COUNT[1]]),
            ("drives", self.drives.into(), COUNT),
            ("flights", self.flights.into(), COUNT),
            ("minutes_aided", self.minutes_aided.into(), COUNT),
            ("minutes_free", self.minutes_free.into(), COUNT),
            ("drive_minutes", self.drive_minutes, [1.0, 1440.0]),
            ("unit_spread", self.unit_spread, [0.0, 2.0]),
        ])
    }

    fn check_model(&self) -> Result<(), String> {
        let model = self.model();
        let text = toml::to_string(&model).map_err(|error| error.to_string())?;
        ErrorModel::from_toml(&text).map_err(|error| format!("errors: {error}"))?;
        if model.imu.output != ImuOutput::Increments {
            let key = match self.errors {
                Errors::Class(_) => "errors",
                Errors::Model(_) => "errors.imu.output",
            };
            return Err(format!(
                "`{key}`: expected \"hg1700\", or a model whose imu.output is \"Increments\": \
                 sensors fit for an hour without GNSS"
            ));
        }
        match without_effect_in_flight(&model) {
            None => Ok(()),
            Some(key) => Err(format!(
                "`errors.{key}`: expected none: the drives would have it and the flights would \
                 not, so that neither can be predicted from the other"
            )),
        }
    }

    fn model(&self) -> ErrorModel {
        match &self.errors {
            Errors::Class(grade) => grade.errors(),
            Errors::Model(model) => (**model).clone(),
        }
    }

    pub fn unit(&self, unit: u32) -> ErrorModel {
        let mut model = self.model();
        let scale = |sigma: &mut f64, name: &str| {
            let deviate = self.stream(unit, name).normal();
            *sigma *= libm::exp(self.unit_spread * deviate);
        };
        for (sensor, name) in [
            (&mut model.gyro_deg_h, "gyro"),
            (&mut model.accel_mps2, "accel"),
        ] {
            let of = |part: &str| format!("{name} {part}");
            scale(&mut sensor.white_noise, &of("noise"));
            match &mut sensor.bias {
                BiasModel::Wave {
                    initial_sigma,
                    jump_sigma,
                    ..
                } => {
                    scale(initial_sigma, &of("initial"));
                    scale(jump_sigma, &of("jump"));
                }
                BiasModel::Continuous {
                    initial_sigma,
                    slope_sigma_per_s,
                    correlated_sigma,
                    ..
                } => {
                    scale(initial_sigma, &of("initial"));
                    scale(slope_sigma_per_s, &of("slope"));
                    scale(correlated_sigma, &of("correlated"));
                }
            }
        }
        scale(&mut model.gnss.velocity_sigma_mps, "gnss velocity");
        model
    }

    pub fn drive_seed(&self, unit: u32, drive: u32) -> u64 {
        self.stream(unit, &format!("drive {drive}")).whole()
    }

    /// Seed of a flight of a unit: the same for both models, so that chance touches both alike.
    pub fn flight_seed(&self, unit: u32, flight: u32) -> u64 {
        self.stream(unit, &format!("flight {flight}")).whole()
    }

    fn stream(&self, unit: u32, name: &str) -> Random {
        Random::stream(self.seed, &format!("unit {unit} {name}"))
    }
}

/// First setting that acts on logs, but not on flights, which are simulated without one.
fn without_effect_in_flight(model: &ErrorModel) -> Option<&'static str> {
    let there = [
        ("imu.dropped_fraction", model.imu.dropped_fraction > 0.0),
        ("imu.stamp_jitter_s", model.imu.stamp_jitter_s > 0.0),
        ("imu.holes", !model.imu.holes.is_empty()),
        ("gnss.habits.delay_s", model.gnss.habits.delay_s[1] > 0.0),
        ("barometer", model.barometer.is_some()),
    ];
    let mut there = there.into_iter();
    there.find_map(|(key, is_there)| is_there.then_some(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = include_str!("../../campaigns/hg1700.toml");

    fn parse(text: &str) -> Result<Plan, InputError> {
        Plan::parse(Path::new("plan.toml"), text)
    }

    #[test]
    fn units_differ_and_the_seed_fixes_them() {
        let plan = parse(EXAMPLE).unwrap();
        assert_eq!(plan.unit(3), plan.unit(3));
        assert_ne!(plan.unit(3), plan.unit(4));
        assert_ne!(plan.flight_seed(0, 1), plan.flight_seed(1, 0));
        let alike = Plan {
            unit_spread: 0.0,
            ..plan
        };
        assert_eq!(alike.unit(3), alike.unit(4));
    }

    #[test]
    fn bad_plans_say_what_is_wrong() {
        for (good, bad, message) in [
            (
                "units = ",
                "units = 1 #",
                "line 4: `units = 1`: expected 2 to",
            ),
            ("units = ", "unit = 1 #", "unknown field `unit`"),
            (
                "velocity_sigma_mps",
                "velocity_sigma",
                "unknown field `velocity_sigma`",
            ),
            (
                "output = \"Increments\"",
                "output = \"Rates\"",
                "errors.imu.output",
            ),
            (
                "dropped_fraction = 0.0",
                "dropped_fraction = 0.1",
                "`errors.imu.dropped_fraction`: expected none: the drives would have it",
            ),
            (
                "velocity = {",
                "delay_s = [0.1, 0.2]\nvelocity = {",
                "`errors.gnss.habits.delay_s`: expected none",
            ),
        ] {
            assert!(EXAMPLE.contains(good), "{good}");
            let error = parse(&EXAMPLE.replacen(good, bad, 1)).unwrap_err();
            assert!(error.to_string().contains(message), "{bad}: {error}");
        }
        let (numbers, _) = EXAMPLE.split_once("[errors]").unwrap();
        let error = parse(&format!("{numbers}errors = \"mems\"\n")).unwrap_err();
        assert!(error.to_string().contains("`errors`: expected \"hg1700\""));
    }
}

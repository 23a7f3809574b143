//! The algorithm under test: what is told to it, and those that are at hand.

use std::str::FromStr;
use std::time::Instant;

use ins_core::config::{Feedback, Form};
use ins_core::{Config, ConfigError, Solution};
use nalgebra::Vector3;

use super::answers::{Answers, Told};
use super::board;
use super::flight::Flown;
use super::program::Program;
use crate::compare::kalman::Noise;
use crate::hil::target::Target;
use crate::identify::configure::config_of;
use crate::sim::SimulatedDrive;
use crate::study::subject::{Core, Kalman, Subject as Driven};

/// An algorithm under test.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// The core, told the model; of what that does not say, the preset of the class of sensors.
    Core(Form, Feedback),
    /// The Kalman filter that the core is compared with, told the model.
    Kalman,
    /// Firmware on a board, by its name in tables: the core once more, over the link.
    Board(String, Target),
    /// Anything that speaks the protocol.
    Program(Program),
}

/// Those at hand, by name.
pub const AT_HAND: [(&str, Subject); 4] = [
    ("core", Subject::Core(Form::Exact, Feedback::Closed)),
    (
        "core-literal",
        Subject::Core(Form::Literal, Feedback::Closed),
    ),
    ("core-open", Subject::Core(Form::Exact, Feedback::Open)),
    ("kalman", Subject::Kalman),
];

/// The command whose options say which board.
const BOARD: &str = "hil";

impl FromStr for Subject {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, subject)) = AT_HAND.iter().find(|(name, _)| *name == text) {
            return Ok(subject.clone());
        }
        let program: Program = text.parse()?;
        match program.command.split_first() {
            Some((word, options)) if word == BOARD => {
                Target::of(options).map(|target| Self::Board(program.name, target))
            }
            _ => Ok(Self::Program(program)),
        }
    }
}

impl Subject {
    /// What stands in tables.
    pub fn name(&self) -> String {
        match self {
            Self::Program(Program { name, .. }) | Self::Board(name, _) => name.clone(),
            _ => (AT_HAND.iter())
                .find(|(_, subject)| subject == self)
                .map_or_else(String::new, |(name, _)| (*name).to_owned()),
        }
    }

    /// Flies it.
    pub fn fly(&self, flown: &Flown, told: &Told) -> Result<Answers, ConfigError> {
        let start = Instant::now();
        let config = config(flown, told);
        let solutions = match self {
            Self::Core(form, feedback) => {
                let (form, feedback) = (*form, *feedback);
                let config = Config {
                    form,
                    feedback,
                    ..config
                };
                asked(Core::new(config, &flown.run)?, flown)
            }
            Self::Kalman => {
                let (SimulatedDrive { imu, gnss, .. }, up) = (&flown.run, Vector3::z());
                let noise = Noise::of_model(&told.model);
                asked(Kalman::new(imu, gnss, config, noise, &up)?, flown)
            }
            Self::Board(_, target) => return Ok(board::fly(target, config, flown)),
            Self::Program(program) => return Ok(program.fly(flown, told)),
        };
        Ok(Answers {
            solutions: Ok(solutions),
            took: start.elapsed(),
        })
    }
}

/// The core as it would be configured by the model; what that does not say, by the class.
fn config(flown: &Flown, told: &Told) -> Config {
    let model = &told.model;
    let preset = config_of(told.grade, model.imu.output, flown.run.given_heading_rad);
    let mut config = Noise::of_model(model).tell(preset);
    config.sensors.cross_axis = model.gyro_deg_h.misalignment_sigma;
    config
}

/// What somebody says whenever he is asked.
fn asked(mut subject: impl Driven, flown: &Flown) -> Vec<Option<Solution>> {
    let mut asks = flown.asks().iter().peekable();
    let mut solutions = Vec::with_capacity(asks.len());
    while let Some(time) = subject.step() {
        if asks.next_if(|ask| ask.time <= time).is_some() {
            solutions.push(subject.solution());
        }
    }
    solutions
}

//! The estimators: from what GNSS says of the INS to the errors of the sensors.

pub mod gains;
pub mod innovations;
pub mod ins_error;
pub mod least_squares;
pub mod literal;
pub mod observer;
pub mod parameters;

use nalgebra::Vector3;

use self::ins_error::InsError;
use self::literal::Literal;
use self::observer::Observer;
use self::parameters::Parameters;
use crate::config::{Config, Form};
use crate::history::Moment;
use crate::time::Time;

/// The chosen form of the estimators. Both live in place: there is nowhere else.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(clippy::large_enum_variant)]
pub enum Estimator {
    /// All parameters jointly.
    Exact(Observer),
    /// (7) to (11) of the thesis.
    Literal(Literal),
}

/// What became of a difference between INS and GNSS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Taken in, all of it.
    Used,
    /// Taken in but for the vertical velocity, which is missing or not credible.
    LevelUsed,
    /// Not credible.
    Outlier,
}

impl Estimator {
    /// Starts on a level of some spread, with what is believed of the parameters.
    pub fn new(start: Time, tilt_sigma_rad: f64, known: &Parameters, config: &Config) -> Self {
        // Of two values of a `match`, one would be copied over the stack.
        let mut estimator = Self::Exact(Observer::new(start, tilt_sigma_rad, known, config));
        if config.form == Form::Literal {
            estimator = Self::Literal(Literal::new(config));
        }
        estimator
    }

    /// What is known of the parameters.
    pub fn parameters(&self) -> &Parameters {
        match self {
            Self::Exact(observer) => observer.parameters(),
            Self::Literal(literal) => literal.parameters(),
        }
    }

    /// Spread of roll and pitch of the INS, rad, with all parameters known; the literal form does
    /// not tell.
    pub fn tilt_sigma_rad(&self) -> Option<f64> {
        match self {
            Self::Exact(observer) => Some(observer.tilt_sigma_rad()),
            Self::Literal(_) => None,
        }
    }

    /// The error of the INS at a moment, as far as it is known and not yet taken out.
    pub fn error_at(&self, moment: &Moment) -> InsError {
        match self {
            Self::Exact(observer) => observer.error_at(moment),
            Self::Literal(literal) => InsError {
                velocity_mps: Vector3::zeros(),
                tilt_rad: Vector3::new(0.0, 0.0, literal.azimuth_left_rad(moment)),
            },
        }
    }
}

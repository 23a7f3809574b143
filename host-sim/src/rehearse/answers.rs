//! What an algorithm under test is told, and what it answers.

use std::time::Duration;

use ins_core::Solution;
use serde::{Deserialize, Serialize};

use crate::log::Grade;
use crate::sim::ErrorModel;

/// What every algorithm under test is told of unit and receiver: the identified model, whatever
/// model really flies.
#[derive(Clone, Debug)]
pub struct Told {
    /// What the core is configured by.
    pub grade: Grade,
    /// The model.
    pub model: ErrorModel,
    /// For an answer of a program, s.
    pub limit: Duration,
}

/// What came of one flight: a solution for each time asked, where there is one.
#[derive(Clone, Debug)]
pub struct Answers {
    /// In the order of [`super::flight::Flown::asks`].
    pub solutions: Result<Vec<Option<Solution>>, Failure>,
    /// Time that it took.
    pub took: Duration,
}

/// Why a flight has no answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// Which kind.
    pub fault: Fault,
    /// Time in the flight, s.
    pub at_s: f64,
    /// What was seen, in words.
    pub cause: String,
}

impl Failure {
    pub(super) fn new(fault: Fault, at_s: f64, cause: impl Into<String>) -> Self {
        let cause = cause.into();
        Self { fault, at_s, cause }
    }
}

/// What programs and boards do wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fault {
    /// It cannot be run, or not with this protocol.
    Unusable,
    /// It ended before its time.
    Crashed,
    /// No answer came.
    Hung,
    /// An answer came after the limit.
    Late,
    /// What came is no answer to what was asked.
    Wrong,
    /// Something was lost on the way to a board or back.
    Lost,
}

impl Fault {
    /// In tables.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Unusable => "unusable",
            Self::Crashed => "crashed",
            Self::Hung => "hung",
            Self::Late => "late",
            Self::Wrong => "wrong answer",
            Self::Lost => "lost on the link",
        }
    }
}

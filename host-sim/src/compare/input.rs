//! What all methods get.

use ins_core::Config;

use super::kalman::Noise;
use crate::identify::true_errors::Truth;
use crate::log::{Grade, Log};
use crate::sim;

/// What all methods get.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input<'a> {
    pub(crate) log: &'a Log,
    pub(crate) config: Config,
    pub(crate) noise: Noise,
    pub(crate) truth: Option<&'a Truth>,
}

/// What the filter is told: the truth where it is known, that is for a simulated class of sensors.
pub(crate) fn noise(grade: Grade, config: &Config, simulated: bool) -> Noise {
    if simulated {
        Noise::of_model(&sim::Grade::from(grade).errors())
    } else {
        Noise::of_config(config)
    }
}

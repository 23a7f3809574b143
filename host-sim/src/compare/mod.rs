//! Compensation against Kalman on one log: what they find, how soon, how well, at what cost.

pub(crate) mod cost;
pub mod five_stage;
pub mod kalman;
pub(crate) mod measure;
pub mod outage;
mod output;
pub(crate) mod tracks;

use std::path::Path;

use indicatif::ProgressBar;
use miette::{Result, miette};
use serde::Serialize;

use crate::compare::outage::OutageTest;
use crate::identify::analysis::log_name;
use crate::identify::configure;
use crate::identify::true_errors::Truth;
use crate::log::{BodyAxes, Grade, LogError, import};
pub use cost::{Cost, measure as measure_costs};
pub use measure::{MethodResult, QuantityResult, TrajectoryError};
pub use output::{JSON, plain};
use tracks::{Input, Track, noise};

/// All methods on one log.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Name of the log.
    pub log: String,
    /// Span of its inertial samples.
    pub duration_s: f64,
    /// Axes of the biases.
    pub body_axes: BodyAxes,
    /// Class of sensors that the core was told.
    pub grade: Grade,
    /// Whether the true errors are known.
    pub simulated: bool,
    /// What each method finds.
    pub methods: Vec<MethodResult>,
    /// Time of whole passes over the log, in one run.
    pub costs: Vec<Cost>,
    /// Drift without GNSS; none where no outage fits.
    pub outages: Option<OutageTest>,
    #[serde(skip)]
    tracks: Vec<Track>,
    #[serde(skip)]
    truth: Option<Truth>,
}

impl Comparison {
    /// Reads a log and runs every method over it.
    pub fn of_log(folder: &Path, grade: Option<Grade>, progress: &ProgressBar) -> Result<Self> {
        let (log, warnings) = import::open(folder)?;
        progress.suspend(|| LogError::tell(&warnings));
        let truth = Truth::read(folder)?;
        let grade = configure::grade(&log, grade);
        let config = configure::config(&log, grade);
        let input = Input {
            log: &log,
            config,
            noise: noise(grade, &config, truth.is_some()),
            truth: truth.as_ref(),
        };
        let unusable = |error: ins_core::ConfigError| miette!("cannot be used: {}", error);
        progress.set_message("all methods");
        let tracks = tracks::all(&input).map_err(unusable)?;
        progress.set_message("outages");
        let outages = outage::test(&log, truth.is_some(), config, input.noise).map_err(unusable)?;
        progress.set_message("cost");
        let costs = cost::measure(&log, config, input.noise).map_err(unusable)?;
        progress.finish_and_clear();
        Ok(Self {
            log: log_name(folder, &log),
            duration_s: log.duration_s(),
            body_axes: log.meta.body_axes,
            grade,
            simulated: truth.is_some(),
            methods: measure::results(&input, grade, &tracks),
            costs,
            outages,
            tracks,
            truth,
        })
    }
}

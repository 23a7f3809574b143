//! All tests on one log.

use std::path::Path;

use indicatif::ProgressBar;
use ins_core::ConfigError;
use miette::{Result, miette};
use rayon::prelude::*;
use serde::Serialize;

use super::methods::{self, Agreement, OPTIONAL, Optional};
use super::role::{Role, name_of};
use crate::compare::five_stage;
use crate::compare::kalman::Noise;
use crate::compare::outage::Course;
use crate::compare::tracks::{self, Input};
use crate::identify::configure;
use crate::identify::halves::{self, Difference};
use crate::identify::quantities::Quantity;
use crate::identify::run::{Identification, identify};
use crate::log::{self, Grade, Log};

/// All tests on one log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogStudy {
    /// Name of its folder.
    pub log: String,
    /// What it is for.
    pub role: Role,
    /// Span of its inertial samples.
    pub duration_s: f64,
    /// Class of sensors that the core was told.
    pub grade: Grade,
    /// Second minus first half; none of a log too short to cut.
    pub halves: Option<Vec<Difference>>,
    /// The core minus other methods.
    pub methods: Vec<Agreement>,
    /// Drifts; none where no outage fits.
    pub outages: Option<Outages>,
    /// Velocity error of a free INS; none where no window fits.
    pub free: Option<Free>,
    /// The core with a parameter less.
    pub without: Vec<Without>,
}

/// Position at the end of outages, RMS, m.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outages {
    /// How many.
    pub count: usize,
    /// The core.
    pub core_m: f64,
    /// The Kalman filter.
    pub kalman_m: f64,
    /// fusion-nav, where it is built in.
    pub fusion_nav_m: Option<f64>,
}

/// Horizontal velocity of a free INS over a minute against the aided one, RMS, m/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Free {
    /// Sensors as logged.
    pub before_mps: f64,
    /// Estimates applied.
    pub after_mps: f64,
    /// Whether anything is called observable.
    pub observable: bool,
}

/// The core with one parameter held at zero.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Without {
    /// Which.
    pub parameter: &'static str,
    /// The core minus itself without it.
    pub agreement: Agreement,
    /// The halves without it.
    pub halves: Option<Vec<Difference>>,
    /// Position at the end of the same outages, RMS, m.
    pub outage_m: Option<f64>,
}

impl LogStudy {
    /// Reads a log and runs all tests.
    pub fn of_folder(folder: &Path, grade: Option<Grade>, progress: &ProgressBar) -> Result<Self> {
        let name = name_of(folder);
        let (log, _) = log::read(folder)?;
        let grade = configure::grade(&log, grade);
        progress.set_message(name.clone());
        Self::of_log(name, &log, grade).map_err(|error| miette!("cannot be used: {}", error))
    }

    /// Runs all tests.
    pub fn of_log(name: String, log: &Log, grade: Grade) -> Result<Self, ConfigError> {
        let bench = Bench::new(log, grade)?;
        let (found, kalman) = rayon::join(
            || identify(log, bench.input.config, &ProgressBar::hidden()),
            || tracks::kalman("Kalman", bench.input.noise, &bench.input),
        );
        let (found, kalman) = (found?, kalman?);
        let end = bench.end(&tracks::points(&found.history));
        let (stages, outages) = rayon::join(
            || tracks::five_stage("five stages", five_stage::REPEATED, &bench.input),
            || bench.outages(),
        );
        let others = [kalman, stages?];
        let methods = others.iter().filter_map(|track| {
            let theirs = bench.end(&track.points)?;
            Some(Agreement::new(&track.method, end.as_ref()?, &theirs))
        });
        Ok(Self {
            role: Role::of(&name),
            log: name,
            duration_s: log.duration_s(),
            grade,
            halves: halves::test(log, &found, &|half| configure::config(half, grade))?,
            methods: methods.collect(),
            outages: outages?,
            free: free(&found, end.as_ref()),
            without: bench.without(grade, end.as_ref())?,
        })
    }
}

/// A log with all that its tests need.
struct Bench<'a> {
    input: Input<'a>,
    course: Option<Course<'a>>,
}

impl<'a> Bench<'a> {
    fn new(log: &'a Log, grade: Grade) -> Result<Self, ConfigError> {
        let config = configure::config(log, grade);
        Ok(Self {
            input: Input {
                log,
                config,
                noise: Noise::of_config(&config),
                truth: None,
            },
            course: Course::new(log, false, config)?,
        })
    }

    fn end(&self, points: &[tracks::Point]) -> Option<[Quantity; 8]> {
        methods::end(self.input.log.meta.body_axes, points)
    }

    fn outages(&self) -> Result<Option<Outages>, ConfigError> {
        let Some(course) = &self.course else {
            return Ok(None);
        };
        let Input { config, noise, .. } = self.input;
        let (core, kalman) = rayon::join(|| course.core(config), || course.kalman(config, noise));
        let core = core?;
        #[cfg(feature = "peers")]
        let fusion_nav = Some(course.peer(config, noise)?.position_rms_m);
        #[cfg(not(feature = "peers"))]
        let fusion_nav = None;
        Ok(Some(Outages {
            count: core.count,
            core_m: core.position_rms_m,
            kalman_m: kalman?.position_rms_m,
            fusion_nav_m: fusion_nav,
        }))
    }

    /// The core without each of the parameters that it is configured to find.
    fn without(
        &self,
        grade: Grade,
        end: Option<&[Quantity; 8]>,
    ) -> Result<Vec<Without>, ConfigError> {
        let rows = (OPTIONAL.par_iter())
            .filter(|optional| optional.is_free(&self.input.config))
            .map(|optional| self.without_one(optional, grade, end))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(rows.into_iter().flatten().collect())
    }

    fn without_one(
        &self,
        optional: &Optional,
        grade: Grade,
        end: Option<&[Quantity; 8]>,
    ) -> Result<Option<Without>, ConfigError> {
        let log = self.input.log;
        let config = optional.without(self.input.config);
        let found = identify(log, config, &ProgressBar::hidden())?;
        let (Some(ours), Some(theirs)) = (end, self.end(&tracks::points(&found.history))) else {
            return Ok(None);
        };
        let course = self.course.as_ref();
        let drifts = course.map(|course| course.core(config)).transpose()?;
        Ok(Some(Without {
            parameter: optional.name,
            agreement: Agreement::new(optional.name, ours, &theirs),
            halves: halves::test(log, &found, &|half| {
                optional.without(configure::config(half, grade))
            })?,
            outage_m: drifts.map(|drifts| drifts.position_rms_m),
        }))
    }
}

fn free(found: &Identification, end: Option<&[Quantity; 8]>) -> Option<Free> {
    Some(Free {
        before_mps: found.velocity_error.before?,
        after_mps: found.velocity_error.after?,
        observable: end.is_some_and(|end| end.iter().any(Quantity::observable)),
    })
}

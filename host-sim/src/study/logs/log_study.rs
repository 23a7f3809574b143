//! All tests on one log.

use indicatif::ProgressBar;
use ins_core::{Config, ConfigError};
use rayon::prelude::*;
use serde::Serialize;

use super::altered::{self, Altered};
use super::wander::Wander;
use crate::compare::five_stage;
use crate::compare::kalman::Noise;
use crate::compare::measure::{COMPARED, columns};
use crate::compare::outage::OutagePlan;
use crate::compare::tracks::{self, Input};
use crate::identify::configure;
use crate::identify::halves::{self, Difference};
use crate::identify::quantities::Quantity;
use crate::identify::run::{Identification, identify};
use crate::log::{Grade, Log};

/// Use of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Used while the core is developed.
    Development,
    /// Used to judge the result.
    Judge,
}

/// Folder names of the development logs: about half of those available, some of each kind of vehicle, both
/// recordings of one flight together. All others are judges.
const DEVELOPMENT: [&str; 7] = [
    "instinct_vn310_static",
    "plane_px4",
    "quad_joey1",
    "quad_joey1_imu2",
    "rtklibexplorer_drive_0708",
    "yk_mixed_road_long_drive_nominal_001",
    "yk_urban_short_turn_loop_nominal_001",
];

impl Role {
    /// Both, in the order of the tables.
    pub const ALL: [Self; 2] = [Self::Development, Self::Judge];

    /// Of the log in a folder of this name.
    pub fn of(name: &str) -> Self {
        if DEVELOPMENT.contains(&name) {
            Self::Development
        } else {
            Self::Judge
        }
    }
}

/// Allowances for model errors, which the sigmas do not include: two estimators share the noise of a log, and
/// differ by these. In the order and units of [`COMPARED`]; small compared with what the class is used for.
const ALLOWED: [f64; 8] = [0.3, 0.5, 0.5, 0.5, 10.0, 10.0, 10.0, 3.0];

/// The allowances as text.
pub const ALLOWANCE: &str = "heading 0.3 deg, accelerometers 0.5 mg, gyros 10 deg/h, latency 3 ms";

/// An optional parameter of the core, and the function that sets its prior sigma to zero.
pub type Optional = (&'static str, fn(&mut Config));

pub const OPTIONAL: [Optional; 5] = [
    ("delay of positions", |c| {
        c.gnss.position_delay_sigma_s = 0.0;
    }),
    ("clock drift", |c| c.gnss.clock_drift_sigma = 0.0),
    ("lever arm", |c| c.gnss.lever_arm_sigma_m = 0.0),
    ("accelerometer scales", |c| c.sensors.accel_scale = 0.0),
    ("gyro scale and misalignments", |c| {
        c.sensors.gyro_scale = 0.0;
    }),
];

fn reduced(mut config: Config, set_zero: fn(&mut Config)) -> Config {
    set_zero(&mut config);
    config
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogStudy {
    pub log: String,
    pub role: Role,
    pub duration_s: f64,
    /// Class of sensors that the core is configured with.
    pub grade: Grade,
    /// Second minus first half; none if the log is too short.
    pub halves: Option<Vec<Difference>>,
    /// The core minus other methods.
    pub methods: Vec<Agreement>,
    /// The log altered in known ways; none if it never navigated.
    pub altered: Vec<Altered>,
    /// Drifts; none if no outage fits.
    pub outages: Option<Outages>,
    /// Velocity error of a free INS; none if no window fits.
    pub free: Option<Free>,
    /// The core without each optional parameter.
    pub without: Vec<Without>,
    /// Of the receiver's positions; none with too few fixes.
    pub wander: Option<Wander>,
}

/// Position at the end of outages, RMS, m.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outages {
    pub count: usize,
    pub core_m: f64,
    pub kalman_m: f64,
    /// fusion-nav, if it is built in.
    pub fusion_nav_m: Option<f64>,
}

/// Horizontal velocity of a free INS over a minute against the aided one, RMS, m/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Free {
    /// Sensors as logged.
    pub before_mps: f64,
    /// Estimates applied.
    pub after_mps: f64,
    /// Whether anything is observable.
    pub observable: bool,
}

/// The core with one parameter held at zero.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Without {
    pub parameter: &'static str,
    /// The core minus itself without it.
    pub agreement: Agreement,
    pub halves: Option<Vec<Difference>>,
    /// Position at the end of the same outages, RMS, m.
    pub outage_m: Option<f64>,
}

impl LogStudy {
    pub fn of_log(name: String, log: &Log, grade: Grade) -> Result<Self, ConfigError> {
        let tests = LogTests::new(log, grade)?;
        let (found, kalman) = rayon::join(
            || identify(log, tests.input.config, &ProgressBar::hidden()),
            || tracks::kalman("Kalman", tests.input.noise, &tests.input),
        );
        let (found, kalman) = (found?, kalman?);
        let points = tracks::points(&found.history, &found.end);
        let end = tests.end(&points);
        let altered = points.last().map(|end| altered::test(log, grade, end));
        let (stages, outages) = rayon::join(
            || tracks::five_stage("five stages", five_stage::REPEATED, &tests.input),
            || tests.outages(),
        );
        let others = [kalman, stages?];
        let methods = others.iter().filter_map(|track| {
            let other = tests.end(&track.points)?;
            Some(Agreement::new(&track.method, end.as_ref()?, &other))
        });
        Ok(Self {
            role: Role::of(&name),
            log: name,
            duration_s: log.duration_s(),
            grade,
            halves: halves::test(log, &found, &|half| configure::config(half, grade))?,
            methods: methods.collect(),
            altered: altered.transpose()?.unwrap_or_default(),
            outages: outages?,
            free: free(&found, end.as_ref()),
            without: (end.as_ref()).map_or(Ok(Vec::new()), |end| tests.without(grade, end))?,
            wander: Wander::of(&log.gnss),
        })
    }

    pub fn altered_differences(&self) -> impl Iterator<Item = &Difference> + Clone {
        self.altered.iter().flat_map(|altered| &altered.differences)
    }
}

/// A log with all that its tests need.
struct LogTests<'a> {
    input: Input<'a>,
    outage_plan: Option<OutagePlan<'a>>,
}

impl<'a> LogTests<'a> {
    fn new(log: &'a Log, grade: Grade) -> Result<Self, ConfigError> {
        let config = configure::config(log, grade);
        Ok(Self {
            input: Input {
                log,
                config,
                noise: Noise::of_config(&config),
                truth: None,
            },
            outage_plan: OutagePlan::new(log, false, config)?,
        })
    }

    /// Final estimates of a method; `None` if it never navigated.
    fn end(&self, points: &[tracks::Point]) -> Option<[Quantity; 8]> {
        let axes = self.input.log.meta.body_axes;
        points.last().map(|point| columns(axes, point))
    }

    fn outages(&self) -> Result<Option<Outages>, ConfigError> {
        let Some(plan) = &self.outage_plan else {
            return Ok(None);
        };
        let Input { config, noise, .. } = self.input;
        let navigators = plan.navigators(config, noise)?;
        Ok(navigators.map(|navigators| Outages {
            count: navigators[0].count,
            core_m: navigators[0].position_rms_m,
            kalman_m: navigators[1].position_rms_m,
            fusion_nav_m: navigators.get(2).map(|peer| peer.position_rms_m),
        }))
    }

    /// The core without each of the optional parameters that it estimates.
    fn without(&self, grade: Grade, end: &[Quantity; 8]) -> Result<Vec<Without>, ConfigError> {
        (OPTIONAL.par_iter())
            .filter(|(_, set_zero)| reduced(self.input.config, *set_zero) != self.input.config)
            .filter_map(|optional| self.without_one(*optional, grade, end).transpose())
            .collect()
    }

    fn without_one(
        &self,
        (parameter, set_zero): Optional,
        grade: Grade,
        ours: &[Quantity; 8],
    ) -> Result<Option<Without>, ConfigError> {
        let log = self.input.log;
        let config = reduced(self.input.config, set_zero);
        let found = identify(log, config, &ProgressBar::hidden())?;
        let Some(other) = self.end(&tracks::points(&found.history, &found.end)) else {
            return Ok(None);
        };
        let plan = self.outage_plan.as_ref();
        let drifts = plan.map(|plan| plan.core(config)).transpose()?;
        Ok(Some(Without {
            parameter,
            agreement: Agreement::new(parameter, ours, &other),
            halves: halves::test(log, &found, &|half| {
                reduced(configure::config(half, grade), set_zero)
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

/// The core minus another method at the end of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    pub with: String,
    /// Of quantities that are observable in both.
    pub differences: Vec<Difference>,
}

impl Agreement {
    pub fn new(with: &str, core: &[Quantity; 8], other: &[Quantity; 8]) -> Self {
        let differences = core.iter().zip(other).enumerate();
        let observable = differences
            .filter(|(_, (ours, other))| ours.observable() && other.observable())
            .map(|(which, (ours, other))| {
                let value = ours.value - other.value;
                let value = if which == 0 { wrap_deg(value) } else { value };
                let sigmas = [ours.sigma, other.sigma];
                Difference::new(COMPARED[which].0, value, sigmas, ALLOWED[which])
            });
        Self {
            with: with.to_owned(),
            differences: observable.collect(),
        }
    }
}

fn wrap_deg(angle: f64) -> f64 {
    (angle + 180.0).rem_euclid(360.0) - 180.0
}

//! The core beside other methods on the same log, and beside itself with less to find.

use ins_core::Config;
use serde::Serialize;

use crate::compare::measure::{COMPARED, columns};
use crate::compare::tracks::Point;
use crate::identify::halves::Difference;
use crate::identify::quantities::Quantity;
use crate::log::BodyAxes;

/// Two estimators share the noise of a log: what parts them is what each leaves out, and neither
/// states that. By quantity, in the order and units of [`COMPARED`]; small beside what the class is
/// used for.
const ALLOWED: [f64; 8] = [0.3, 0.5, 0.5, 0.5, 10.0, 10.0, 10.0, 3.0];

/// What the allowances are, for people.
pub const ALLOWANCE: &str = "heading 0.3 deg, accelerometers 0.5 mg, gyros 10 deg/h, latency 3 ms";

/// A parameter that the core can do without.
#[derive(Clone, Copy, Debug)]
pub struct Optional {
    /// Which.
    pub name: &'static str,
    /// Holds it at zero.
    pub hold: fn(&mut Config),
}

const fn optional(name: &'static str, hold: fn(&mut Config)) -> Optional {
    Optional { name, hold }
}

/// All of them: a prior spread of nothing.
pub const OPTIONAL: [Optional; 4] = [
    optional("clock drift", |c| c.gnss.clock_drift_sigma = 0.0),
    optional("lever arm", |c| c.gnss.lever_arm_sigma_m = 0.0),
    optional("accelerometer scales", |c| c.sensors.accel_scale = 0.0),
    optional("gyro scale and misalignments", |c| {
        c.sensors.gyro_scale = 0.0;
    }),
];

impl Optional {
    /// Whether a configuration has it at all.
    pub fn is_free(&self, config: &Config) -> bool {
        self.without(*config) != *config
    }

    /// The configuration without it.
    pub fn without(&self, mut config: Config) -> Config {
        (self.hold)(&mut config);
        config
    }
}

/// The core minus another method at the end of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Which other.
    pub with: String,
    /// Of what both call observable.
    pub differences: Vec<Difference>,
}

impl Agreement {
    /// Of two ends.
    pub fn new(with: &str, core: &[Quantity; 8], other: &[Quantity; 8]) -> Self {
        let differences = core.iter().zip(other).enumerate();
        let observable = differences
            .filter(|(_, (ours, theirs))| ours.observable() && theirs.observable())
            .map(|(which, (ours, theirs))| {
                let apart = ours.value - theirs.value;
                let apart = if which == 0 { wrap_deg(apart) } else { apart };
                let sigmas = [ours.sigma, theirs.sigma];
                Difference::new(COMPARED[which].0, apart, sigmas, ALLOWED[which])
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

/// What a method says at its end; `None` if it never navigated.
pub fn end(axes: BodyAxes, points: &[Point]) -> Option<[Quantity; 8]> {
    points.last().map(|point| columns(axes, point))
}

//! The halves test: estimates of constants from two halves of a log must agree.

use indicatif::ProgressBar;
use ins_core::{Config, ConfigError, Estimate, Estimates, Phase, Time};
use serde::Serialize;

use super::free_inertial::known;
use super::quantities::MG_MPS2;
use super::row::Row;
use super::run::{Identification, record};
use crate::log::Log;

/// Shortest log to be halved, s: either half has to align, and to turn and brake some times.
const LEAST_S: f64 = 300.0;

/// Difference allowed between the halves beyond their stated sigmas.
///
/// The difference of a constant between adjacent stretches of length tau is what the Allan
/// deviation at tau measures. At rest the accelerometers of this class show white noise up to some
/// ten seconds (included in the estimates' own sigmas), and from there on the walk of the bias that
/// the class is configured with: 0.01 to 0.04 mg at 32 s where 9e-5 m/s^2/sqrt(s) makes 0.03 mg.
/// An estimate is of the end of its half; the ends lie half a log apart.
pub const ALLOWANCE: &str = "accelerometers: their bias walk as configured, over half the log \
    (Allan deviation at rest, 32 s: 0.01 to 0.04 mg; that of the walk of mems: 0.03 mg); latency: \
    both halves' carried to the cut by the clock drift that each found, with its sigma; lever arm: \
    none";

/// A difference that should be zero, and its sigma.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    pub name: &'static str,
    pub value: f64,
    /// Root sum square of both stated sigmas.
    pub joint_sigma: f64,
    /// Sigma of the change between them in addition.
    pub allowance: f64,
    /// In joint sigmas, the allowance included.
    pub sigmas: f64,
    /// Without allowance and drift, in joint sigmas as stated.
    pub plain_sigmas: f64,
}

impl Difference {
    pub fn new(name: &'static str, value: f64, sigmas: [f64; 2], allowance: f64) -> Self {
        let joint_sigma = libm::hypot(sigmas[0], sigmas[1]);
        Self {
            name,
            value,
            joint_sigma,
            allowance,
            sigmas: value / libm::hypot(joint_sigma, allowance),
            plain_sigmas: value / joint_sigma,
        }
    }
}

/// Differences second minus first half, where both are observable; `None` for a log too short.
///
/// The estimates of the first half are those half way in the run over the whole log.
pub fn test(
    log: &Log,
    found: &Identification,
    configure: &dyn Fn(&Log) -> Config,
) -> Result<Option<Vec<Difference>>, ConfigError> {
    if log.duration_s() < LEAST_S {
        return Ok(None);
    }
    let second = log.second_half();
    let cut = second.start();
    let config = configure(log);
    let first = if let Some(halfway) = found.halfway.filter(|_| config == found.config) {
        HalfEnd::new(&found.history, &halfway, cut)
    } else {
        let half = log.first_half();
        HalfEnd::of(&half, configure(&half), cut)?
    };
    let second = HalfEnd::of(&second, configure(&second), cut)?;
    let (Some(first), Some(second)) = (first, second) else {
        return Ok(Some(Vec::new()));
    };
    let walk_mps2 = config.sensors.accel_bias_walk * (0.5 * log.duration_s()).sqrt();
    let mut differences = Vec::new();
    differences.extend(latency(&first, &second));
    let [first, second] = [&first.estimates, &second.estimates];
    for axis in 0..3 {
        let (component, _) = log.meta.body_axes.rfu_component(axis);
        differences.extend(constant(
            ["accel_x_mg", "accel_y_mg", "accel_z_mg"][axis],
            [first, second].map(|half| half.accel_bias_mps2[component]),
            MG_MPS2,
            walk_mps2 / MG_MPS2,
        ));
    }
    let arms = first.lever_arm_m.iter().zip(&second.lever_arm_m);
    let names = ["lever_right_m", "lever_forward_m", "lever_up_m"];
    for (name, (first, second)) in names.into_iter().zip(arms) {
        differences.extend(constant(name, [*first, *second], 1.0, 0.0));
    }
    Ok(Some(differences))
}

/// Estimates at the end of a half.
struct HalfEnd {
    estimates: Estimates,
    /// From the middle of its navigation, whose latency is estimated, to the cut, s.
    to_cut_s: f64,
}

impl HalfEnd {
    /// `None` if the half never navigates.
    fn of(half: &Log, config: Config, cut: Time) -> Result<Option<Self>, ConfigError> {
        let (run, end) = record(half, config, &ProgressBar::hidden(), |_, _| {})?;
        Ok(Self::new(&run.history, &end, cut))
    }

    /// `None` if it does not navigate then.
    fn new(history: &[Row], end: &Row, cut: Time) -> Option<Self> {
        let ended = history.partition_point(|row| row.time <= end.time);
        let mut aligned = history[..ended].rsplit(|row| row.phase != Phase::Navigating);
        // The core's estimate begins where it was last aligned.
        let since = aligned.next()?.first()?.time;
        let middle = since.plus_seconds(0.5 * end.time.seconds_since(since));
        (end.phase == Phase::Navigating).then(|| Self {
            estimates: end.estimates,
            to_cut_s: cut.seconds_since(middle),
        })
    }

    /// Latency at the cut and its sigma, s: in the middle of a run it is uncorrelated with the drift.
    fn latency_at_cut(&self) -> (f64, f64) {
        let (latency, drift) = (self.estimates.gnss_latency_s, self.estimates.clock_drift);
        (
            latency.value + self.to_cut_s * drift.value,
            libm::hypot(latency.sigma, self.to_cut_s * drift.sigma),
        )
    }
}

fn latency(first: &HalfEnd, second: &HalfEnd) -> Option<Difference> {
    let latency = [first, second].map(|end| end.estimates.gnss_latency_s);
    let plain = constant("latency_ms", latency, 1e-3, 0.0)?;
    let [(first, first_sigma), (second, second_sigma)] =
        [first, second].map(HalfEnd::latency_at_cut);
    let sigmas = [first_sigma, second_sigma].map(|sigma| sigma / 1e-3);
    let at_cut = Difference::new(plain.name, (second - first) / 1e-3, sigmas, 0.0);
    Some(Difference {
        plain_sigmas: plain.plain_sigmas,
        ..at_cut
    })
}

fn constant(
    name: &'static str,
    halves: [Estimate; 2],
    unit: f64,
    allowance: f64,
) -> Option<Difference> {
    let [first, second] = halves;
    halves.iter().all(known).then(|| {
        let sigmas = [first.sigma / unit, second.sigma / unit];
        Difference::new(name, (second.value - first.value) / unit, sigmas, allowance)
    })
}

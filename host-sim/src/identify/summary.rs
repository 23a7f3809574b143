//! `summary.json`: the results, for programs.

use std::fmt::Debug;

use ins_core::Phase;
use serde::Serialize;

use crate::identify::against_truth::{AgainstTruth, TruthErrors};
use crate::identify::free_inertial::VelocityErrors;
use crate::identify::halves::Difference;
use crate::identify::quantities::{Axes, Quantities, Quantity, in_axes};
use crate::identify::row::{Counts, OutcomeCounts};
use crate::identify::run::Identification;
use crate::identify::verdict::{Verdict, beyond_class};
use crate::identify::{configure, words};
use crate::log::{BodyAxes, Grade, Log, LogError};

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub log: String,
    pub verdict: Verdict,
    pub duration_s: f64,
    /// Axes of the biases.
    pub body_axes: BodyAxes,
    #[serde(flatten)]
    pub quantities: Quantities,
    /// Heading of the solution at the last sample, clockwise from north.
    pub heading_end_deg: Quantity,
    /// Antenna from the inertial sensors, m; none where it is taken as configured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lever_arm_m: Option<Axes>,
    /// Shift of the stamps of the fixes that is taken for a difference of clocks, not latency, s.
    #[serde(skip_serializing_if = "is_zero")]
    pub clock_offset_s: f64,
    /// Growth of the latency: drift of the clock of the samples against that of the fixes.
    pub gnss_latency_drift_ppm: Quantity,
    /// Latency of positions in addition to that of velocities, ms.
    pub gnss_position_delay_ms: Quantity,
    /// Variance in time of the receiver's smoothing, s^2.
    pub gnss_smoothing_s2: Quantity,
    /// Free-inertial check; empty where no window fits.
    pub velocity_error_mps: VelocityErrors,
    /// Errors of the solution, damped and free, where the log has a reference motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against_truth: Option<TruthErrors>,
    pub version: &'static str,
    /// Class of sensors that the navigator was configured for.
    pub grade: Grade,
    pub phase: Phase,
    pub imu: OutcomeCounts,
    pub gnss: OutcomeCounts,
    pub warnings: Vec<String>,
}

impl Summary {
    pub fn new(
        name: String,
        log: &Log,
        found: &Identification,
        grade: Grade,
        warnings: &[LogError],
        halves: Option<&[Difference]>,
    ) -> Self {
        let estimates = &found.end.estimates;
        let quantities = Quantities::of_log(estimates, &log.meta);
        let imu = tally(&found.imu_outcomes, words::is_integrated);
        let gnss = tally(&found.gnss_outcomes(), words::is_used);
        let doubted = warnings.iter().find(|warning| warning.doubt);
        Self {
            log: name,
            verdict: Verdict::new(found, halves)
                .and(beyond_class(&[(
                    "gyros at rest",
                    !configure::fits(log, grade),
                )]))
                .and(doubted.map(|warning| format!("Of the log: {}.", warning.cause))),
            duration_s: log.duration_s(),
            body_axes: log.meta.body_axes,
            quantities,
            heading_end_deg: heading(found, &quantities.azimuth_error_deg),
            lever_arm_m: (found.config.gnss.lever_arm_sigma_m > 0.0)
                .then(|| in_axes(log.meta.body_axes, &estimates.lever_arm_m, 1.0)),
            clock_offset_s: log.meta.clock_offset_s(),
            gnss_latency_drift_ppm: Quantity::of(&estimates.clock_drift, 1e-6),
            gnss_position_delay_ms: Quantity::of(&estimates.gnss_position_delay_s, 1e-3),
            gnss_smoothing_s2: Quantity::of(&estimates.gnss_smoothing_s2, 1.0),
            velocity_error_mps: found.velocity_error.clone(),
            against_truth: found.against_truth.as_ref().map(AgainstTruth::errors),
            version: env!("CARGO_PKG_VERSION"),
            grade,
            phase: found.end.phase,
            imu,
            gnss,
            warnings: warnings.iter().map(LogError::in_a_line).collect(),
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // As serde calls it.
pub(crate) fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// The last heading, with sigma and observability of the azimuth.
fn heading(found: &Identification, azimuth: &Quantity) -> Quantity {
    let heading_rad = found
        .end
        .solution
        .map_or(f64::NAN, |s| s.euler().heading_rad);
    Quantity {
        value: heading_rad.to_degrees().rem_euclid(360.0),
        ..*azimuth
    }
}

fn tally<T: Copy + Debug>(counts: &Counts<T>, accepted: impl Fn(T) -> bool) -> OutcomeCounts {
    let (taken, refused): (Vec<_>, Vec<_>) = counts
        .iter()
        .copied()
        .partition(|(outcome, _)| accepted(*outcome));
    OutcomeCounts {
        accepted: taken.iter().map(|(_, count)| count).sum(),
        rejected: refused
            .iter()
            .map(|(outcome, count)| (format!("{outcome:?}"), *count))
            .collect(),
    }
}

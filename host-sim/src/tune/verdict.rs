//! What the estimates are worth.

use ins_core::Phase;
use serde::Serialize;

use super::{Found, Tuning};
use crate::analysis::Analysis;
use crate::report;
use crate::study::logs::statistics::Difference;
use crate::summary::Answers;

/// Sigmas by which halves of a log may differ.
const HALVES: f64 = 3.0;
/// Times the spread of its class that an offset may have.
const OFFSET: f64 = 4.0;
/// Part of samples or fixes that may be refused.
const REFUSED: f64 = 0.1;

/// What speaks against the estimates.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Nothing does.
    pub trusted: bool,
    /// Why not.
    pub against: Vec<String>,
    /// What else is good to know.
    pub notes: Vec<String>,
    /// What looked suspicious in the log; on the terminal the standard error has it.
    pub log_warnings: Vec<String>,
}

impl Verdict {
    /// From everything but itself.
    pub(super) fn new(t: &Tuning, analysis: &Analysis, halves: Option<&[Difference]>) -> Self {
        let (summary, phase) = (&analysis.summary, analysis.summary.phase);
        let errors = &summary.velocity_error_mps;
        let mut against = Vec::new();
        if phase != Phase::Navigating {
            against.push(report::unaligned(phase).to_owned());
        }
        let both = errors.before.zip(errors.after);
        if let Some((before, after)) = both.filter(|(before, after)| after >= before) {
            against.push(format!(
                "A free INS gains {} m/s in a minute on readings as logged and {} with the \
                 estimates applied: they do not help.",
                report::digits(before, before),
                report::digits(after, after)
            ));
        }
        against.extend(halves.into_iter().flatten().filter_map(half));
        against.extend(class(t));
        let halved = halves.is_some_and(|halves| !halves.is_empty());
        if both.is_none() && !halved && phase == Phase::Navigating {
            against.push(
                "Nothing tests them: no minute of navigation, no two halves to compare. Log more."
                    .to_owned(),
            );
        }
        let mut notes = Vec::new();
        if both.is_none() {
            notes.push("no minute of navigation to try the estimates on".to_owned());
        }
        if !halved {
            notes.push("the log has no two halves that can be compared".to_owned());
        }
        notes.extend(refused("inertial samples", &summary.imu));
        notes.extend(refused("fixes", &summary.gnss));
        Self {
            trusted: against.is_empty(),
            against,
            notes,
            log_warnings: summary.warnings.clone(),
        }
    }

    /// The lines that come first.
    pub fn lines(&self) -> Vec<String> {
        let first = if self.trusted {
            "Verdict: nothing speaks against these estimates."
        } else {
            "Verdict: do NOT trust these estimates as they stand."
        };
        let reasons = self.against.iter().map(|reason| format!("- {reason}"));
        let notes = self.notes.iter().map(|note| format!("- note: {note}"));
        let all = std::iter::once(first.to_owned()).chain(reasons);
        all.chain(notes).collect()
    }
}

fn half(difference: &Difference) -> Option<String> {
    (difference.sigmas.abs() > HALVES).then(|| {
        format!(
            "The halves of the log disagree on {} by {} ({:.1} sigmas).",
            difference.name,
            report::digits(difference.joint_sigma, difference.value),
            difference.sigmas
        )
    })
}

/// What no sensor of the assumed class does.
fn class(t: &Tuning) -> Option<String> {
    let s = &t.config.sensors;
    let far = |found: &[Found], most: f64| {
        let beyond = |f: &Found| f.is_known() && f.value.abs() - 3.0 * f.sigma > most;
        found.iter().any(beyond)
    };
    let most = s.noise_range[1];
    let unfit: Vec<&str> = [
        (
            "gyro offsets",
            far(&t.gyro_bias_radps, OFFSET * s.gyro_bias_radps),
        ),
        (
            "accelerometer offsets",
            far(&t.accel_bias_mps2, OFFSET * s.accel_bias_mps2),
        ),
        (
            "gyro noise",
            far(&[t.gyro_noise], most * s.mean_gyro_noise()),
        ),
        (
            "accelerometer noise",
            far(&[t.accel_noise], most * s.mean_accel_noise()),
        ),
    ]
    .iter()
    .filter_map(|(what, unfit)| unfit.then_some(*what))
    .collect();
    (!unfit.is_empty()).then(|| {
        format!(
            "{} beyond what the assumed class has: strong vibration, wrong --grade or wrong units.",
            unfit.join(" and ")
        )
    })
}

fn refused(what: &str, answers: &Answers) -> Option<String> {
    let rejected: u64 = answers.rejected.values().sum();
    let part = rejected as f64 / (rejected + answers.accepted).max(1) as f64;
    let reasons = answers
        .rejected
        .keys()
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    (part > REFUSED).then(|| format!("{:.0} % of {what} refused: {reasons}", 100.0 * part))
}

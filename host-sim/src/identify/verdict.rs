//! Whether the estimates of a log can be trusted.

use ins_core::{Config, Estimate, Phase};
use serde::Serialize;

use super::words::{self, why_not_navigating};
use crate::identify::free_inertial::known;
use crate::identify::halves::Difference;
use crate::identify::row::{Counts, Row};
use crate::identify::run::Identification;
use crate::page::{brief, digits};

/// Sigmas by which halves of a log may differ.
const HALVES: f64 = 3.0;
/// Times the sigma of its class that an offset may have.
const OFFSET: f64 = 4.0;
/// Part of samples or fixes that may be refused.
const REFUSED: f64 = 0.1;
/// Median of the length of a level vector with a sigma of one on each axis.
const MEDIAN_OF_TWO: f64 = 1.177;

/// Reasons against the estimates, and notes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    pub trusted: bool,
    pub against: Vec<String>,
    pub notes: Vec<String>,
}

impl Verdict {
    /// From a run, and the halves of the log, if it is long enough for them.
    pub(crate) fn new(found: &Identification, halves: Option<&[Difference]>) -> Self {
        let phase = found.end.phase;
        let mut against = Vec::new();
        if phase != Phase::Navigating {
            let navigated = |row: &Row| row.phase == Phase::Navigating;
            let before = found.history.iter().any(navigated);
            against.push(why_not_navigating(phase, before).to_owned());
        }
        let errors = &found.velocity_error;
        let both = errors.before.zip(errors.after);
        if let Some((before, after)) = both.filter(|(before, after)| after >= before) {
            against.push(format!(
                "A free INS is off by {} m/s over a minute (RMS) on readings as logged and by {} \
                 with the estimates applied: they do not help.",
                brief(before),
                brief(after)
            ));
        }
        against.extend(halves.into_iter().flatten().filter_map(half));
        against.extend(offsets(found));
        against.extend(latency(found));
        against.extend(innovations(found));
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
        let (imu, gnss) = (&found.imu_outcomes, found.gnss_outcomes());
        let samples = "inertial samples";
        notes.extend(refused(
            samples,
            imu,
            words::is_integrated,
            words::of_sample,
        ));
        notes.extend(refused("fixes", &gnss, words::is_used, words::of_fix));
        Self {
            trusted: against.is_empty(),
            against,
            notes,
        }
    }

    /// The same, with another reason against the estimates.
    #[must_use]
    pub(crate) fn and(mut self, reason: Option<String>) -> Self {
        self.trusted &= reason.is_none();
        self.against.extend(reason);
        self
    }

    /// The same in words, under the name of the log.
    pub fn lines_of(&self, log: &str) -> Vec<String> {
        let mut lines = self.lines();
        lines[0] = format!("{log}: {}", lines[0]);
        lines
    }

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
            digits(difference.joint_sigma, difference.value),
            difference.sigmas
        )
    })
}

/// The readings or offsets beyond those of the class, if any.
pub(crate) fn beyond_class(unfit: &[(&str, bool)]) -> Option<String> {
    let names = unfit
        .iter()
        .filter_map(|(what, unfit)| unfit.then_some(*what));
    let names: Vec<&str> = names.collect();
    (!names.is_empty()).then(|| {
        format!(
            "{} beyond what the assumed class has: strong vibration, wrong --grade or wrong units.",
            names.join(" and ")
        )
    })
}

fn offsets(found: &Identification) -> Option<String> {
    let (estimates, sensors) = (&found.end.estimates, &found.config.sensors);
    let far = |offsets: &[Estimate], spread: f64| {
        offsets.iter().any(|offset| {
            known(offset) && offset.value.abs() - 3.0 * offset.sigma > OFFSET * spread
        })
    };
    let gyro = far(&estimates.gyro_bias_radps, sensors.gyro_bias_radps);
    let accel = far(&estimates.accel_bias_mps2, sensors.accel_bias_mps2);
    beyond_class(&[("gyro offsets", gyro), ("accelerometer offsets", accel)])
}

/// A latency beyond that of such receivers; smoothing over seconds appears as one as well.
fn latency(found: &Identification) -> Option<String> {
    let latency = &found.end.estimates.gnss_latency_s;
    let most = OFFSET * found.config.gnss.latency_sigma_s;
    (known(latency) && latency.value.abs() - 3.0 * latency.sigma > most).then(|| {
        format!(
            "GNSS is {} s {}, where {} is the most that is expected: stamps of another clock, or \
             velocities averaged over seconds.",
            digits(latency.sigma, latency.value.abs()),
            if latency.value < 0.0 { "early" } else { "late" },
            brief(most)
        )
    })
}

/// Differences of GNSS and INS velocity beyond the noise that GNSS may have.
fn innovations(found: &Identification) -> Option<String> {
    let Config { gnss, .. } = found.config;
    let most = gnss.noise_range[1] * gnss.velocity_mps.white;
    // In the first half of the run errors are not estimated yet.
    let later = &found.history[found.history.len() / 2..];
    let sizes = later.iter().filter(|row| row.phase == Phase::Navigating);
    let sizes = sizes.map(|row| row.signals.difference_enu_mps.xy().norm());
    let sigma = crate::log::median(sizes) / MEDIAN_OF_TWO;
    (sigma > most).then(|| {
        format!(
            "GNSS and the INS differ by {sigma:.2} m/s on an axis, where {most:.2} is the most that is \
             expected: velocities, stamps or axes are not what they are taken for."
        )
    })
}

/// Percentage and reasons of refusals, if they are many.
fn refused<T: Copy>(
    what: &str,
    counts: &Counts<T>,
    taken: fn(T) -> bool,
    why: fn(T) -> &'static str,
) -> Option<String> {
    let all: u64 = counts.iter().map(|(_, count)| count).sum();
    let refused = || counts.iter().filter(|(outcome, _)| !taken(*outcome));
    let part = refused().map(|(_, count)| count).sum::<u64>() as f64 / all.max(1) as f64;
    let reasons: Vec<&str> = refused().map(|(outcome, _)| why(*outcome)).collect();
    let (percent, reasons) = (100.0 * part, reasons.join("; "));
    (part > REFUSED).then(|| format!("{percent:.0} % of {what} refused: {reasons}"))
}

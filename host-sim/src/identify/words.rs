//! Outcomes and estimates in plain words.

use ins_core::{GnssOutcome, ImuOutcome, Phase};

use crate::identify::quantities::Quantity;
use crate::page::digits;

/// Why nothing navigates at the end; `before`: whether it did.
pub(crate) fn why_not_navigating(phase: Phase, before: bool) -> &'static str {
    match phase {
        _ if before => {
            "Level or heading were lost, and not found anew before the end: the samples have a hole, or \
             do not hold the motion that GNSS shows."
        }
        Phase::Levelling => "Never levelled: the log is too short or too restless.",
        _ => {
            "Heading never found: it needs a start or a braking with GNSS velocity, gyros that \
             feel Earth rate, or initial_heading_deg in meta.toml."
        }
    }
}

/// Value and sigma, or why there is none.
pub(crate) fn in_words(q: &Quantity) -> String {
    if q.observable() {
        with_sigma(q)
    } else {
        q.observability.why().to_owned()
    }
}

/// Both to the second digit of the sigma.
pub(crate) fn with_sigma(q: &Quantity) -> String {
    let [value, sigma] = [q.value, q.sigma].map(|v| digits(q.sigma, v));
    format!("{value} \u{b1} {sigma}")
}

/// Whether a fix was used, or will be.
pub(crate) fn is_used(outcome: GnssOutcome) -> bool {
    matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued)
}

pub(crate) fn of_fix(outcome: GnssOutcome) -> &'static str {
    match outcome {
        GnssOutcome::Accepted => "used",
        GnssOutcome::Queued => "used once the inertial samples reach its moment",
        GnssOutcome::NoInertialData => "no inertial sample yet",
        GnssOutcome::NotFinite => "NaN or infinite",
        GnssOutcome::Empty => "neither position nor velocity",
        GnssOutcome::TimeNotIncreasing => "stamp not later than the last one",
        GnssOutcome::Repeated => "velocity of the last fix to the last bit, in motion",
        GnssOutcome::TooOld => "older than what the navigator remembers",
        GnssOutcome::TooFarAhead => "stamp far ahead of the inertial samples",
        GnssOutcome::OutOfRange => "where or as fast as no vehicle is",
        GnssOutcome::Outlier => "too far from the solution to be true",
    }
}

pub(crate) fn of_sample(outcome: ImuOutcome) -> &'static str {
    match outcome {
        ImuOutcome::Accepted => "used",
        ImuOutcome::Bridged => "used, a short hole before it filled",
        ImuOutcome::Gap => "after a hole too long to fill",
        ImuOutcome::NotFinite => "NaN or infinite",
        ImuOutcome::TimeNotIncreasing => "stamp not later than the last one",
        ImuOutcome::OutOfRange => "beyond the sensor's range",
    }
}

pub(crate) fn is_integrated(outcome: ImuOutcome) -> bool {
    matches!(outcome, ImuOutcome::Accepted | ImuOutcome::Bridged)
}

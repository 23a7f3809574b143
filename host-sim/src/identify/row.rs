//! State and estimates of the navigator at one time, as recorded.

use std::collections::BTreeMap;

use ins_core::damping::DampingSignals;
use ins_core::{Estimates, Manoeuvre, Navigator, Phase, Solution, SolutionSigma, Time};
use serde::Serialize;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Stamp of the inertial sample.
    pub time: Time,
    /// Phase of the alignment.
    pub phase: Phase,
    pub manoeuvre: Manoeuvre,
    pub estimates: Estimates,
    /// Damping signals of the last fix.
    pub signals: DampingSignals,
    pub solution: Option<Solution>,
    /// Sigma of the solution, ENU, where it is known.
    pub sigma: Option<SolutionSigma>,
}

impl Row {
    pub(crate) fn of(time: Time, navigator: &Navigator) -> Self {
        Self {
            time,
            phase: navigator.phase(),
            manoeuvre: navigator.manoeuvre(),
            estimates: navigator.estimates(),
            signals: navigator.damping_signals(),
            solution: navigator.solution(),
            sigma: navigator.sigma(),
        }
    }
}

/// Whether an interval has passed, to within half a millisecond of jitter.
pub(crate) fn due(last: Option<Time>, now: Time, interval_s: f64) -> bool {
    last.is_none_or(|last| now.seconds_since(last) > interval_s - 5e-4)
}

/// How often each outcome occurred.
pub type Counts<T> = Vec<(T, u64)>;

pub(crate) fn add<T: PartialEq>(counts: &mut Counts<T>, outcome: T) {
    match counts.iter_mut().find(|(known, _)| *known == outcome) {
        Some((_, count)) => *count += 1,
        None => counts.push((outcome, 1)),
    }
}

/// Samples or fixes that were used, and those rejected, by reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutcomeCounts {
    pub accepted: u64,
    /// Not used, or only to restart from.
    pub rejected: BTreeMap<String, u64>,
}

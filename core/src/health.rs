//! Counts of samples and fixes by outcome, and consistency of the innovations.

use crate::outcome::{GnssOutcome, ImuOutcome};
use crate::solution::Phase;
use crate::time::Time;

/// Final outcome of a fix, also of one that was queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FixReport {
    /// Stamp of the fix.
    pub time: Time,
    /// Number of fixes with this outcome, up to this one: fixes close to each other are compared as one.
    pub fixes: u8,
    /// Never [`GnssOutcome::Queued`].
    pub outcome: GnssOutcome,
}

/// Fixes by final outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct FixCounts {
    /// Used.
    pub accepted: u32,
    /// See [`GnssOutcome::NoInertialData`].
    pub no_inertial_data: u32,
    /// See [`GnssOutcome::NotFinite`].
    pub not_finite: u32,
    /// See [`GnssOutcome::Empty`].
    pub empty: u32,
    /// See [`GnssOutcome::TimeNotIncreasing`].
    pub time_not_increasing: u32,
    /// See [`GnssOutcome::Repeated`].
    pub repeated: u32,
    /// See [`GnssOutcome::TooOld`].
    pub too_old: u32,
    /// See [`GnssOutcome::TooFarAhead`].
    pub too_far_ahead: u32,
    /// See [`GnssOutcome::OutOfRange`].
    pub out_of_range: u32,
    /// See [`GnssOutcome::Outlier`].
    pub outlier: u32,
}

/// Samples by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct SampleCounts {
    /// See [`ImuOutcome::Accepted`].
    pub accepted: u32,
    /// See [`ImuOutcome::Bridged`].
    pub bridged: u32,
    /// See [`ImuOutcome::Gap`].
    pub gap: u32,
    /// See [`ImuOutcome::NotFinite`].
    pub not_finite: u32,
    /// See [`ImuOutcome::TimeNotIncreasing`].
    pub time_not_increasing: u32,
    /// See [`ImuOutcome::OutOfRange`].
    pub out_of_range: u32,
}

/// Counts so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Counts {
    pub(crate) samples: SampleCounts,
    pub(crate) fixes: FixCounts,
    pub(crate) last_fix: Option<FixReport>,
}

impl Counts {
    pub(crate) fn sample(&mut self, outcome: ImuOutcome) {
        let count = match outcome {
            ImuOutcome::Accepted => &mut self.samples.accepted,
            ImuOutcome::Bridged => &mut self.samples.bridged,
            ImuOutcome::Gap => &mut self.samples.gap,
            ImuOutcome::NotFinite => &mut self.samples.not_finite,
            ImuOutcome::TimeNotIncreasing => &mut self.samples.time_not_increasing,
            ImuOutcome::OutOfRange => &mut self.samples.out_of_range,
        };
        *count = count.saturating_add(1);
    }

    /// Counts one fix; a queued one when it is decided.
    pub(crate) fn fix(&mut self, time: Time, outcome: GnssOutcome) {
        self.fixes(time, 1, outcome);
    }

    /// Counts fixes that were compared as one; `time` is that of the newest.
    pub(crate) fn fixes(&mut self, time: Time, fixes: u8, outcome: GnssOutcome) {
        if fixes == 0 {
            return;
        }
        let count = match outcome {
            GnssOutcome::Queued => return,
            GnssOutcome::Accepted => &mut self.fixes.accepted,
            GnssOutcome::NoInertialData => &mut self.fixes.no_inertial_data,
            GnssOutcome::NotFinite => &mut self.fixes.not_finite,
            GnssOutcome::Empty => &mut self.fixes.empty,
            GnssOutcome::TimeNotIncreasing => &mut self.fixes.time_not_increasing,
            GnssOutcome::Repeated => &mut self.fixes.repeated,
            GnssOutcome::TooOld => &mut self.fixes.too_old,
            GnssOutcome::TooFarAhead => &mut self.fixes.too_far_ahead,
            GnssOutcome::OutOfRange => &mut self.fixes.out_of_range,
            GnssOutcome::Outlier => &mut self.fixes.outlier,
        };
        *count = count.saturating_add(fixes.into());
        self.last_fix = Some(FixReport {
            time,
            fixes,
            outcome,
        });
    }
}

/// State of health; cheap to ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Health {
    /// How far the alignment has come.
    pub phase: Phase,
    /// Since when there is no aiding, if so: time of the last comparison with a level velocity or a
    /// position that was used.
    pub coasting_since: Option<Time>,
    /// The last fix with a final outcome. Ask after each call: at 100 samples a second none settles more
    /// than one, those compared as one, or all pending ones when an INS is aligned anew; a call for a
    /// longer interval may settle as many more.
    pub last_fix: Option<FixReport>,
    /// Mean normalized innovation squared of the level axes over ten seconds: about 1, and beyond 9 the INS
    /// is reset. None while aligning, nor in the literal form.
    pub level_nis: Option<f64>,
    /// The same of the vertical.
    pub vertical_nis: Option<f64>,
    /// When INS, vertical, azimuth or latency was last found to be wrong, and its variance increased.
    pub last_reset: Option<Time>,
    /// Number of new alignments after divergence.
    pub restarts: u32,
    /// Fixes by outcome.
    pub fixes: FixCounts,
    /// Samples by outcome.
    pub samples: SampleCounts,
}

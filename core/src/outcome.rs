//! Results of the calls.

/// Outcome of an inertial sample. Unless it is `Accepted` or `Bridged`, the solution is as it was, but for
/// the sample at which integration restarts: [`phase`](crate::Navigator::phase) shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum ImuOutcome {
    /// Integrated.
    Accepted,
    /// Integrated, and a short gap before it was filled with the mean of its two ends.
    Bridged,
    /// The gap before it is too long to bridge, or its two ends disagree too far. The stamp is remembered
    /// and nothing else; once samples in step with it have come for 0.05 s, integration restarts there.
    Gap,
    /// A component is NaN or infinite.
    NotFinite,
    /// The stamp is not later than the last one. Once samples in step with it have come for 1 s,
    /// the clock was set back, and integration restarts there.
    TimeNotIncreasing,
    /// A component is beyond the sensor's range. Where increments come at a lower rate than before, samples
    /// in step with it for 0.05 s show it, and integration restarts there.
    OutOfRange,
}

/// Outcome of a GNSS fix. Unless it is `Accepted` or `Queued`, the solution and the estimates are as they
/// were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum GnssOutcome {
    /// Taken by the alignment; of a queued one, in [`Health`](crate::Health) alone: compared with the INS
    /// of its own time.
    Accepted,
    /// While navigating, if it is not refused at once: compared in the course of the next samples, when
    /// they have reached its time. The final outcome is in [`Health::last_fix`](crate::Health::last_fix).
    Queued,
    /// No inertial sample yet, or a gap of more than 0.3 s around its time.
    NoInertialData,
    /// A component is NaN or infinite.
    NotFinite,
    /// Neither position nor velocity, or zero in all of both, as receivers write for unknown.
    Empty,
    /// The stamp is not later than the last one by 10 ms, or by 15 ms if both have a velocity or neither:
    /// what a receiver has of one moment goes into one fix, and more than 66 a second are not taken.
    TimeNotIncreasing,
    /// While navigating: a moving vehicle has the velocity of the last fix to the last bit, or its position
    /// where fixes have no velocity. The receiver repeats that fix, is stuck, or coasts, and has measured
    /// nothing. Of a barometer: the height of two seconds ago.
    Repeated,
    /// Older than the ring of past states, or dropped from the queue at a new alignment.
    TooOld,
    /// Further ahead of the inertial samples than any latency explains, or the queue of ten is full.
    TooFarAhead,
    /// Latitude, height or speed of no vehicle on Earth; an initial heading, or a sigma, that is of no use.
    OutOfRange,
    /// No part of it passed the gate; of a fix in [`Health`](crate::Health) alone. Fixes that agree with
    /// each other for 15 s show that the INS is wrong.
    Outlier,
}

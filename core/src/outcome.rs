//! The typed answer to every call.

/// What became of an inertial sample. Unless it says `Accepted` or `Bridged`, the solution is as
/// it was, but for the sample at which integration restarts: [`phase`](crate::Navigator::phase) shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum ImuOutcome {
    /// Integrated.
    Accepted,
    /// Integrated, and a short hole before it was filled with the mean of its two ends.
    Bridged,
    /// The hole before it is too long to bridge, or its two ends disagree too far. The stamp is
    /// remembered and nothing else; once samples in step with it have come for 0.05 s, integration
    /// restarts there.
    Gap,
    /// A component is NaN or infinite.
    NotFinite,
    /// The stamp is not later than the last one. Once samples in step with it have come for 1 s,
    /// the clock was set back, and integration restarts there.
    TimeNotIncreasing,
    /// A component is beyond the sensor's range. Where increments come more rarely than before, samples in
    /// step with it for 0.05 s show it, and integration restarts there.
    OutOfRange,
}

/// What became of a GNSS fix. Unless it says `Accepted` or `Queued`, the solution and the
/// estimates are as they were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum GnssOutcome {
    /// Taken by the alignment; of one that was queued, in [`Health`](crate::Health) alone: compared with the
    /// INS of its own moment.
    Accepted,
    /// While navigating, if it is not refused at once: compared in the course of the next samples, when they
    /// have reached its moment. What becomes of it then, [`Health::last_fix`](crate::Health::last_fix) tells.
    Queued,
    /// No inertial sample yet, or a hole of more than 0.3 s around its moment.
    NoInertialData,
    /// A component is NaN or infinite.
    NotFinite,
    /// Neither position nor velocity, or zero in all of both, as receivers write what they do not know.
    Empty,
    /// The stamp is not later than the last one by 10 ms, or by 15 ms if both have a velocity or neither:
    /// what a receiver has of one moment goes into one fix, and more than 66 a second are not taken.
    TimeNotIncreasing,
    /// While navigating: a vehicle that moves has the velocity of the last fix to the last bit, or its position
    /// where fixes have no velocity. The receiver gives that fix again, is stuck, or coasts, and has measured
    /// nothing. Of a barometer: the height of two seconds ago.
    Repeated,
    /// Older than the ring of past states, or waiting when that was given up.
    TooOld,
    /// Further ahead of the inertial samples than any latency explains, or ten others wait already.
    TooFarAhead,
    /// Latitude, height or speed no vehicle on Earth has; a heading that is none to begin with; a sigma that
    /// is none.
    OutOfRange,
    /// Nothing of it was near enough to the INS to be true; of a fix in [`Health`](crate::Health) alone.
    /// Fixes that agree with each other for 15 s show that it is the INS which is wrong.
    Outlier,
}

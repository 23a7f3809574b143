//! The five stages: what each finds, when that shows, and how its run is damped.

use ins_core::config::Feedback;
use ins_core::{Manoeuvre, Phase, Time};

use crate::identify::row::Row;

/// Each finds one thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// (7): azimuth error at the start.
    Azimuth,
    /// (8): right and forward accelerometers.
    LevelAccels,
    /// (9): right and forward gyros.
    LevelGyros,
    /// (10): up accelerometer and gyro.
    Vertical,
    /// (11): latency of GNSS.
    Latency,
}

impl Stage {
    /// All, in order.
    pub const ALL: [Self; 5] = [
        Self::Azimuth,
        Self::LevelAccels,
        Self::LevelGyros,
        Self::Vertical,
        Self::Latency,
    ];

    /// Name for people.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Azimuth => "azimuth",
            Self::LevelAccels => "level accelerometers",
            Self::LevelGyros => "level gyros",
            Self::Vertical => "vertical channel",
            Self::Latency => "GNSS latency",
        }
    }

    /// Whether the quantity shows itself while the vehicle does this.
    fn shows_in(self, manoeuvre: Manoeuvre) -> bool {
        match self {
            Self::Azimuth | Self::Latency => {
                matches!(manoeuvre, Manoeuvre::Accelerating | Manoeuvre::Braking)
            }
            Self::LevelAccels => manoeuvre == Manoeuvre::Turning,
            Self::LevelGyros | Self::Vertical => true,
        }
    }

    /// The intervals of a run in which the quantity was observable.
    pub fn intervals(self, history: &[Row]) -> Vec<(Time, Time)> {
        let mut intervals: Vec<(Time, Time)> = Vec::new();
        for pair in history.windows(2) {
            let (row, until) = (&pair[0], pair[1].time);
            if row.phase != Phase::Navigating || !self.shows_in(row.manoeuvre) {
                continue;
            }
            match intervals.last_mut() {
                Some((_, end)) if *end == row.time => *end = until,
                _ => intervals.push((row.time, until)),
            }
        }
        intervals
    }

    /// Nothing found may act on the run that finds it; except that the azimuth has to be damped
    /// for its loop to show the vertical gyro, and for the heading not to run away from (7).
    pub(super) fn feedback(self) -> Feedback {
        match self {
            Self::Azimuth | Self::Vertical => Feedback::Closed,
            Self::LevelAccels | Self::LevelGyros | Self::Latency => Feedback::Open,
        }
    }
}

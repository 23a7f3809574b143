//! One flight of a campaign.

use serde::{Deserialize, Serialize};

use crate::identify::held_ins::LevelError;
use crate::study::flights::run::Left;

/// One flight: whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flown {
    /// Horizontal position error after each quarter of the free part, cm.
    pub position_cm: [u64; QUARTERS as usize],
    /// Horizontal velocity error then, mm/s.
    pub velocity_mmps: [u64; QUARTERS as usize],
    /// Azimuth error when GNSS went, thousandths of a degree, without its sign.
    pub azimuth_mdeg: u64,
}

impl Flown {
    /// Of what was left when GNSS went and the errors at every minute after that.
    pub fn new(left: &Left, minutes: &[LevelError]) -> Self {
        // Positive, and below the size of the Earth.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = |value: f64| value.abs().round() as u64;
        let at = |quarter: usize| {
            let minute = ((quarter + 1) * minutes.len()).div_ceil(QUARTERS as usize);
            minutes[minute - 1]
        };
        Self {
            position_cm: core::array::from_fn(|q| whole(1e2 * at(q).position_m)),
            velocity_mmps: core::array::from_fn(|q| whole(1e3 * at(q).velocity_mps)),
            azimuth_mdeg: whole(1e3 * left.azimuth_deg),
        }
    }

    /// All figures, in the order of the summary.
    pub(super) fn figures(&self) -> [u64; 9] {
        let ([a, b, c, d], [e, f, g, h]) = (self.position_cm, self.velocity_mmps);
        [self.azimuth_mdeg, a, b, c, d, e, f, g, h]
    }
}

/// Moments of the free part that are looked at, in quarters of it.
pub(super) const QUARTERS: u32 = 4;

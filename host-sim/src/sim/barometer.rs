//! A barometer on a simulated vehicle.

use ins_core::{BaroHeight, Solution};
use serde::{Deserialize, Serialize};

use super::noise::Random;
use crate::log::GRAVITY_MPS2;

/// Errors of barometric height, one sigma.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BarometerModel {
    /// White noise of a reading, m.
    pub noise_m: f64,
    /// Offset by weather and geoid, drawn once a run, m; and drift by weather and sensor warm-up, m/s.
    pub offset_sigma_m: f64,
    pub drift_sigma_mps: f64,
    /// Scale error by air warmer or colder than the standard atmosphere, drawn once a run, 1.
    pub air_sigma: f64,
    /// Part of the dynamic pressure, in still air, that acts on the sensor, drawn once a run, 1.
    pub flow_sigma: f64,
}

impl BarometerModel {
    /// A sensor on a board in a vehicle: 12 K from standard, a meter of drift in a minute or two.
    pub const ON_BOARD: Self = Self {
        noise_m: 0.15,
        offset_sigma_m: 60.0,
        drift_sigma_mps: 0.01,
        air_sigma: 0.04,
        flow_sigma: 0.02,
    };

    /// Readings at the times of the truth.
    pub fn read(&self, truth: &[Solution], seed: u64) -> Vec<BaroHeight> {
        let mut random = Random::stream(seed, "barometer");
        let mut drawn = |sigma: f64| sigma * random.normal();
        let (offset_m, drift_mps) = (drawn(self.offset_sigma_m), drawn(self.drift_sigma_mps));
        let (scale, flow) = (drawn(self.air_sigma), drawn(self.flow_sigma));
        let Some(start) = truth.first() else {
            return Vec::new();
        };
        let read = |truth: &Solution| {
            let climbed_m = truth.position.height_m - start.position.height_m;
            // Dynamic pressure as a head of air, v^2 / 2g.
            let head_m = truth.velocity_enu_mps.norm_squared() / (2.0 * GRAVITY_MPS2);
            let since_s = truth.time.seconds_since(start.time);
            BaroHeight {
                time: truth.time,
                height_m: start.position.height_m
                    + offset_m
                    + climbed_m * (1.0 + scale)
                    + drift_mps * since_s
                    + flow * head_m
                    + drawn(self.noise_m),
                // No sensor is stated to be without noise.
                sigma_m: self.noise_m.max(0.01),
            }
        };
        truth.iter().map(read).collect()
    }
}

//! A barometer on a simulated vehicle.

use ins_core::{BaroHeight, Solution};
use serde::{Deserialize, Serialize};

use super::noise::Random;
use crate::log::GRAVITY_MPS2;

/// One sigma of what lies between the height of a vehicle and that of its barometer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BarometerModel {
    /// White noise of a reading, m.
    pub noise_m: f64,
    /// Weather and geoid, drawn once a run, m; and what weather and a warming sensor add, m/s.
    pub offset_sigma_m: f64,
    pub drift_sigma_mps: f64,
    /// By how much air is warmer or colder than a standard atmosphere, and taller for it, drawn once a
    /// run, 1.
    pub air_sigma: f64,
    /// Part of the dynamic pressure, air at rest, that comes to the sensor, drawn once a run, 1.
    pub flow_sigma: f64,
}

impl BarometerModel {
    /// A sensor on a board in a vehicle: 12 K from standard, a meter in the weather of a minute or two.
    pub const ON_BOARD: Self = Self {
        noise_m: 0.15,
        offset_sigma_m: 60.0,
        drift_sigma_mps: 0.01,
        air_sigma: 0.04,
        flow_sigma: 0.02,
    };

    /// What it reads at every truth.
    pub fn read(&self, truth: &[Solution], seed: u64) -> Vec<BaroHeight> {
        let mut random = Random::stream(seed, "barometer");
        let mut drawn = |sigma: f64| sigma * random.normal();
        let (offset_m, drift_mps) = (drawn(self.offset_sigma_m), drawn(self.drift_sigma_mps));
        let (taller, flow) = (drawn(self.air_sigma), drawn(self.flow_sigma));
        let Some(start) = truth.first() else {
            return Vec::new();
        };
        let read = |truth: &Solution| {
            let risen_m = truth.position.height_m - start.position.height_m;
            // As a head of air, v^2 / 2g.
            let head_m = truth.velocity_enu_mps.norm_squared() / (2.0 * GRAVITY_MPS2);
            let since_s = truth.time.seconds_since(start.time);
            BaroHeight {
                time: truth.time,
                height_m: start.position.height_m
                    + offset_m
                    + risen_m * (1.0 + taller)
                    + drift_mps * since_s
                    + flow * head_m
                    + drawn(self.noise_m),
                // A sensor without noise would be known better than anything is.
                sigma_m: self.noise_m.max(0.01),
            }
        };
        truth.iter().map(read).collect()
    }
}

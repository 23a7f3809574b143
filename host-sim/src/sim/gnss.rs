//! A GNSS receiver with errors, thesis equation (5).

use ins_core::{FixSigma, GnssFix, Time};
use nalgebra::Vector3;

use super::errors::GnssModel;
use super::ideal::{TrueState, between, displaced};
use super::noise::Random;

/// The receiver of one run.
#[derive(Clone, Debug)]
pub struct Gnss {
    model: GnssModel,
    latency_s: f64,
    next: u32,
    velocity_noise: Random,
    position_noise: Random,
}

impl Gnss {
    /// Draws the errors of run `seed`.
    pub fn new(model: &GnssModel, seed: u64) -> Self {
        Self {
            model: model.clone(),
            latency_s: Random::stream(seed, "gnss latency").uniform(model.latency_s),
            next: 0,
            velocity_noise: Random::stream(seed, "gnss velocity"),
            position_noise: Random::stream(seed, "gnss position"),
        }
    }

    /// The latency of this run.
    pub fn latency_s(&self) -> f64 {
        self.latency_s
    }

    /// Adds the fixes that show the motion between two states.
    pub fn observe(&mut self, from: &TrueState, to: &TrueState, fixes: &mut Vec<GnssFix>) {
        loop {
            let stamp_s = f64::from(self.next) / self.model.rate_hz;
            let shown_s = stamp_s - self.latency_s;
            if shown_s >= to.solution.time.as_seconds() {
                return;
            }
            self.next += 1;
            // Drawn whether the fix appears or not: an outage leaves the rest as it was.
            let velocity_noise = Vector3::from(self.velocity_noise.normal3());
            let position_noise = Vector3::from(self.position_noise.normal3());
            if shown_s < from.solution.time.as_seconds() || self.is_out(stamp_s) {
                continue;
            }
            let (position, velocity) = between(from, to, shown_s);
            let GnssModel {
                horizontal_sigma_m,
                vertical_sigma_m,
                velocity_sigma_mps,
                ..
            } = self.model;
            let sigmas = Vector3::new(horizontal_sigma_m, horizontal_sigma_m, vertical_sigma_m);
            let measured = velocity + velocity_sigma_mps * velocity_noise;
            let place = displaced(&position, &sigmas.component_mul(&position_noise));
            let fix = GnssFix {
                time: Time::default().plus_seconds(stamp_s),
                velocity_en_mps: Some(measured.xy()),
                velocity_up_mps: Some(measured.z),
                sigma: FixSigma {
                    velocity_mps: (velocity_sigma_mps > 0.0).then_some(velocity_sigma_mps),
                    ..FixSigma::default()
                },
                ..GnssFix::default()
            };
            fixes.push(fix.at(&place));
        }
    }

    fn is_out(&self, time_s: f64) -> bool {
        self.model
            .outages
            .iter()
            .any(|out| (out.start_s..out.start_s + out.duration_s).contains(&time_s))
    }
}

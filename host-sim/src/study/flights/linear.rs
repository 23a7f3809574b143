//! Linear error equations (1)-(2) of a free INS with damped vertical channel.

use ins_core::Solution;
use ins_core::attitude::matrix;
use ins_core::earth::LocalEarth;
use nalgebra::{Vector2, Vector3};

use super::sensors::STEP_S;
use crate::sim::drive::Step;

/// Which terms the equations have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Terms {
    /// (1)-(2) as printed: a flat frame that does not rotate.
    Printed,
    /// With the rotation of the frame: Earth rate and transport rate.
    RotatingFrame,
}

/// Errors of a free INS, by the equations.
#[derive(Clone, Copy, Debug)]
pub struct LinearModel {
    terms: Terms,
    /// dV; the vertical component is zero.
    pub velocity_mps: Vector3<f64>,
    /// Phi.
    tilt_rad: Vector3<f64>,
    north_m: f64,
    /// With the INS.
    pub agreement: Agreement,
}

impl LinearModel {
    /// With the terms as printed, and with those of the rotating frame.
    pub fn both(ins: &Solution, truth: &Solution) -> [Self; 2] {
        let velocity = ins.velocity_enu_mps - truth.velocity_enu_mps;
        [Terms::Printed, Terms::RotatingFrame].map(|terms| Self {
            terms,
            velocity_mps: Vector3::new(velocity.x, velocity.y, 0.0),
            // `C' = (I - [Phi x]) C`.
            tilt_rad: -(ins.attitude * truth.attitude.inverse()).scaled_axis(),
            north_m: ins.position.enu_from(&truth.position).y,
            agreement: Agreement::default(),
        })
    }

    /// Propagates over a step of the flight that ends at `after`; `gyro_rad` and `accel_mps` are the errors of
    /// the increments that the INS used, body axes.
    pub fn step(
        &mut self,
        step: &Step,
        after: &Solution,
        gyro_rad: &Vector3<f64>,
        accel_mps: &Vector3<f64>,
    ) {
        let before = &step.before.solution;
        let earth = LocalEarth::at(before.position.latitude_rad, before.position.height_m);
        let attitude = matrix(&before.attitude);
        let (gyro_enu, accel_enu) = (attitude * gyro_rad, attitude * accel_mps);
        let radius_m = earth.north_radius_m;
        let (dv, tan) = (
            self.velocity_mps,
            earth.sin_latitude / earth.safe_cos_latitude(),
        );
        let (dv_step, rate) = match self.terms {
            Terms::Printed => {
                let gained = after.velocity_enu_mps - before.velocity_enu_mps;
                let force = Vector3::new(gained.x, gained.y, earth.gravity_mps2 * STEP_S);
                let rate = Vector3::new(-dv.y, dv.x, dv.x * tan) / radius_m;
                (force.cross(&self.tilt_rad), rate)
            }
            Terms::RotatingFrame => {
                let force = attitude * step.ideal.accel;
                let velocity = &before.velocity_enu_mps;
                let earth_rate = earth.earth_rate();
                let frame = earth_rate + earth.transport_rate(velocity);
                // Errors of both rates by the errors of latitude and velocity.
                let north_rad = self.north_m / radius_m;
                let earth_rate_error = north_rad * Vector3::new(0.0, -earth_rate.z, earth_rate.y);
                let convergence = velocity.x / earth.east_radius_m * north_rad * (1.0 + tan * tan);
                let frame_error = earth_rate_error
                    + earth.transport_rate(&dv)
                    + Vector3::new(0.0, 0.0, convergence);
                let coriolis = (earth_rate + frame).cross(&dv)
                    + (earth_rate_error + frame_error).cross(velocity);
                let dv_step = force.cross(&self.tilt_rad) - STEP_S * coriolis;
                (dv_step, frame_error - frame.cross(&self.tilt_rad))
            }
        };
        self.velocity_mps += dv_step + accel_enu;
        self.velocity_mps.z = 0.0;
        // Semi-implicit, with the new velocity: an explicit step would make the oscillation grow.
        self.tilt_rad += STEP_S * rate - gyro_enu;
        self.north_m += STEP_S * self.velocity_mps.y;
    }

    pub fn compare(&mut self, error_mps: &Vector2<f64>) {
        self.agreement.difference += (self.velocity_mps.xy() - error_mps).norm_squared();
        self.agreement.error += error_mps.norm_squared();
    }
}

/// Agreement of a model with an INS: sums over time of squares of velocity errors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Of the model's difference from the INS.
    difference: f64,
    /// Of the INS.
    error: f64,
}

impl Agreement {
    /// RMS difference over RMS error.
    pub fn relative<'a>(all: impl Iterator<Item = &'a Self>) -> f64 {
        let (difference, error) = all.fold((0.0, 0.0), |(difference, error), a| {
            (difference + a.difference, error + a.error)
        });
        f64::sqrt(difference / error)
    }
}

/// RMS horizontal position error of a Schuler-tuned INS after `time_s`, white noise of `density`
/// (rad/sqrt(s)) in its level gyros, (1) at rest.
///
/// `dV'' + w^2 dV = g dw`, `w^2 = g/R`: an impulse of the gyro moves a channel by `R (1 - cos wt)`,
/// so white noise gives it the variance `density^2 R^2 INT (1 - cos wt)^2 dt`. Two channels.
pub fn random_walk_position_m(density: f64, time_s: f64, earth: &LocalEarth) -> f64 {
    let radius_m = earth.north_radius_m;
    let w = f64::sqrt(earth.gravity_mps2 / radius_m);
    let integral_s =
        1.5 * time_s - 2.0 * libm::sin(w * time_s) / w + libm::sin(2.0 * w * time_s) / (4.0 * w);
    f64::sqrt(2.0 * integral_s) * density * radius_m
}

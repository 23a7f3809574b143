//! Strapdown mechanization: attitude, velocity and position from body increments.
//!
//! East-North-Up, wander-free; quaternion attitude. Savage, Strapdown Inertial Navigation
//! Integration Algorithm Design, J. Guidance 21 (1998), parts 1 and 2.

use core::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::attitude::{euler, matrix, renormalized, small_rotation, turned};
use crate::earth::{Geodetic, LatitudeTrig, LocalEarth, wrap_pi};
use crate::increments::Interval;
use crate::math;
use crate::samples::GnssFix;

/// Inputs of the damping loops to the mechanization, ENU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Controls {
    /// V^C, into the position block, m/s.
    pub velocity_mps: Vector3<f64>,
    /// f^C, into the velocity block, m/s^2.
    pub accel_mps2: Vector3<f64>,
    /// omega^C, into the attitude block, rad/s: added to the growth of `Phi` in (1)-(2).
    pub rate_radps: Vector3<f64>,
}

/// Attitude, velocity and position.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mechanization {
    /// Position on the ellipsoid.
    pub position: Geodetic,
    /// Velocity against the Earth, ENU, m/s.
    pub velocity_enu_mps: Vector3<f64>,
    /// Body (right-forward-up) to ENU.
    pub attitude: UnitQuaternion<f64>,
    latitude_trig: LatitudeTrig,
}

/// Increments of one step, ENU, for the estimators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// `C_B^L` at the start of the interval.
    pub attitude: Matrix3<f64>,
    /// Velocity gained from specific force alone, ENU, m/s.
    pub force_enu_mps: Vector3<f64>,
    /// Displacement, controls included, ENU, m.
    pub way_m: Vector3<f64>,
}

impl Mechanization {
    /// Starts at a known state.
    pub fn new(
        position: Geodetic,
        velocity_enu_mps: Vector3<f64>,
        attitude: UnitQuaternion<f64>,
    ) -> Self {
        Self {
            position,
            velocity_enu_mps,
            attitude,
            latitude_trig: LatitudeTrig::at(position.latitude_rad),
        }
    }

    /// The same attitude at the position and velocity of a fix.
    #[must_use]
    pub fn at_fix(&self, fix: &GnssFix) -> Self {
        let own = &self.velocity_enu_mps;
        let level = fix.velocity_en_mps.unwrap_or_else(|| own.xy());
        let velocity = level.push(fix.velocity_up_mps.unwrap_or(own.z));
        Self::new(fix.position_or(&self.position), velocity, self.attitude)
    }

    /// The Earth at the present position.
    pub fn local_earth(&self) -> LocalEarth {
        let (sin, cos) = self.latitude_trig.sin_cos(self.position.latitude_rad);
        LocalEarth::from_sin_cos(sin, cos, self.position.height_m)
    }

    /// Advances over one interval under the given controls.
    pub fn step(&mut self, interval: &Interval, controls: &Controls) -> Step {
        let dt = interval.seconds;
        let earth = self.local_earth();
        let earth_rate = earth.earth_rate();
        let transport_rate = earth.transport_rate(&self.velocity_enu_mps);
        let frame_rate = earth_rate + transport_rate;
        let attitude = matrix(&self.attitude);

        // The frame, and the platform by its controls, turn by half of their step until the middle of the
        // interval.
        let force = attitude * interval.velocity_mps();
        let platform_rate = frame_rate + controls.rate_radps;
        let force_enu_mps = force - 0.5 * dt * platform_rate.cross(&force);
        // Gravity at the middle of the interval, `dg/dh = -2 g / R`: at its start the error would be of
        // first order, and the vertical channel amplifies it.
        let rise_m = 0.5 * dt * self.velocity_enu_mps.z;
        let fall = 1.0 - 2.0 * rise_m / earth.north_radius_m;
        let gravity = Vector3::new(0.0, 0.0, -earth.gravity_mps2 * fall);
        let push = force_enu_mps + dt * (gravity + controls.accel_mps2);
        let coriolis = (frame_rate + earth_rate).cross(&(self.velocity_enu_mps + 0.5 * push));
        let old_velocity = self.velocity_enu_mps;
        self.velocity_enu_mps += push - dt * coriolis;

        let mean_velocity = 0.5 * (old_velocity + self.velocity_enu_mps) + controls.velocity_mps;
        let way_m = dt * mean_velocity;
        self.move_by(&earth, &way_m);

        // `Phi` turns the platform itself: a control turns it with the sign of the frame rate.
        let frame_rate = earth_rate + earth.transport_rate(&mean_velocity);
        let turn = dt * (frame_rate + controls.rate_radps);
        self.attitude = renormalized(
            small_rotation(&-turn)
                * self.attitude.as_ref()
                * small_rotation(&interval.rotation_rad()),
        );
        Step {
            attitude,
            force_enu_mps,
            way_m,
        }
    }

    /// Moves the position by metres east, north and up.
    pub fn move_by(&mut self, earth: &LocalEarth, metres: &Vector3<f64>) {
        let latitude_rad = self.position.latitude_rad + metres.y / earth.north_radius_m;
        self.position.latitude_rad = math::clamp(latitude_rad, [-FRAC_PI_2, FRAC_PI_2]);
        self.position.longitude_rad = wrap_pi(
            self.position.longitude_rad
                + metres.x / (earth.east_radius_m * earth.safe_cos_latitude()),
        );
        self.position.height_m += metres.z;
        self.latitude_trig.follow(self.position.latitude_rad);
    }

    /// Extrapolates at constant velocity.
    #[inline(never)]
    pub(crate) fn extrapolate(&mut self, seconds: f64) {
        self.move_by(&self.local_earth(), &(seconds * self.velocity_enu_mps));
    }

    /// Heading, rad.
    pub fn heading_rad(&self) -> f64 {
        euler(&self.attitude).heading_rad
    }

    /// Adds to the heading an angle of any size, rad.
    pub fn turn_heading(&mut self, by_rad: f64) {
        self.attitude = turned(&self.attitude, by_rad);
    }

    /// Turns the platform by a small `Phi`: afterwards `C' = (I - [Phi x]) C` of before.
    pub fn turn_platform(&mut self, phi_rad: &Vector3<f64>) {
        self.attitude = renormalized(small_rotation(&-phi_rad) * self.attitude.as_ref());
    }
}

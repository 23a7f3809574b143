//! How the errors grow from one covariance step to the next.

use ins_core::earth::{LocalEarth, ROTATION_RATE_RADPS};
use ins_core::increments::Interval;
use ins_core::mechanization::{Mechanization, Step};
use nalgebra::{Matrix3, Vector3};

use super::index::{ACCEL, ATTITUDE, GYRO, LATENCY, POSITION, VELOCITY};
use super::{Layout, Noise, Part, StateMatrix, times};

/// What the INS did since the last covariance step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Span {
    /// Duration, s.
    pub seconds: f64,
    /// Integral of specific force, ENU, m/s.
    force_mps: Vector3<f64>,
    /// Integral of `C_B^L`, s.
    attitude_s: Matrix3<f64>,
    /// Integrals of its columns, each times what that accelerometer and that gyro read.
    force_columns_mps: Matrix3<f64>,
    turn_columns_rad: Matrix3<f64>,
}

impl Span {
    /// Adds a step of the INS.
    pub fn add(&mut self, interval: &Interval, step: &Step) {
        let read = |reading: &Vector3<f64>| step.attitude * Matrix3::from_diagonal(reading);
        self.seconds += interval.seconds;
        self.force_mps += step.force_enu_mps;
        self.attitude_s += step.attitude * interval.seconds;
        self.force_columns_mps += read(&interval.force_mps);
        self.turn_columns_rad += read(&interval.angle_rad);
    }

    /// Transition of the errors over the span, `I + F t + (F t)^2 / 2`; coloured noise fades
    /// exactly.
    pub fn transition(&self, ins: &Mechanization, layout: &Layout, noise: &Noise) -> StateMatrix {
        let growth = self.growth(&ins.local_earth(), &ins.velocity_enu_mps, layout);
        let identity = StateMatrix::identity(layout.size, layout.size);
        let mut transition = identity + 0.5 * times(&growth, &growth) + growth;
        for part in Part::ALL {
            let Some(at) = layout.colour(part) else {
                continue;
            };
            for state in at..at + part.axes().len() {
                transition[(state, state)] = noise.part(part).kept(self.seconds);
            }
        }
        transition
    }

    /// `F t`.
    ///
    /// Equations (1), (2) with all that they leave out, but for the curvature of the Earth in the
    /// position itself and the growth of radii with height, both below 1e-6.
    fn growth(
        &self,
        earth: &LocalEarth,
        velocity_mps: &Vector3<f64>,
        layout: &Layout,
    ) -> StateMatrix {
        let t = self.seconds;
        let (sin, cos) = (earth.sin_latitude, earth.safe_cos_latitude());
        let (north, east) = (earth.north_radius_m, earth.east_radius_m);
        let earth_rate = earth.earth_rate();
        let transport_rate = earth.transport_rate(velocity_mps);
        // Errors of the two rates: by latitude, that is north position, and by velocity.
        let earth_rate_by_north =
            Vector3::new(0.0, -ROTATION_RATE_RADPS * sin, ROTATION_RATE_RADPS * cos) / north;
        let transport_by_north =
            Vector3::new(0.0, 0.0, velocity_mps.x / (east * cos * cos) / north);
        #[rustfmt::skip]
        let transport_by_velocity = Matrix3::new(
            0.0, -1.0 / north, 0.0,
            1.0 / east, 0.0, 0.0,
            sin / cos / east, 0.0, 0.0,
        );
        let coriolis = (2.0 * earth_rate + transport_rate).cross_matrix();
        let velocity_cross = velocity_mps.cross_matrix();

        let mut growth = StateMatrix::zeros(layout.size, layout.size);
        let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
            growth.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        };
        set(POSITION, VELOCITY, t * Matrix3::identity());
        set(
            VELOCITY,
            VELOCITY,
            t * (velocity_cross * transport_by_velocity - coriolis),
        );
        set(VELOCITY, ATTITUDE, self.force_mps.cross_matrix());
        set(VELOCITY, ACCEL, self.attitude_s);
        set(ATTITUDE, VELOCITY, t * transport_by_velocity);
        set(
            ATTITUDE,
            ATTITUDE,
            -t * (earth_rate + transport_rate).cross_matrix(),
        );
        set(ATTITUDE, GYRO, -self.attitude_s);
        if let Some(at) = layout.accel_scale {
            set(VELOCITY, at, self.force_columns_mps);
        }
        if let Some(at) = layout.gyro_scale {
            set(ATTITUDE, at, -self.turn_columns_rad);
        }
        let mut by_north = |row: usize, value: Vector3<f64>| {
            growth
                .fixed_view_mut::<3, 1>(row, POSITION + 1)
                .copy_from(&(t * value));
        };
        by_north(
            VELOCITY,
            velocity_mps.cross(&(2.0 * earth_rate_by_north + transport_by_north)),
        );
        by_north(ATTITUDE, earth_rate_by_north + transport_by_north);
        growth[(VELOCITY + 2, POSITION + 2)] += t * 2.0 * earth.gravity_mps2 / north;
        if let Some(at) = layout.clock_drift {
            growth[(LATENCY, at)] = t;
        }
        growth
    }
}

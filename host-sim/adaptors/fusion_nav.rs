//! fusion-nav as an algorithm under test, configured by default but for the gravity of the place
//! and no position hold, as its documentation tells a vehicle to set.
#![allow(clippy::cast_possible_truncation, reason = "fusion-nav takes f32")]
#![allow(clippy::cast_sign_loss, reason = "stamps are made positive")]

mod lines;

use fusion_nav::Quaternion;
use fusion_nav::prelude::{
    Acceleration, AngularRate, Attitude, Config, Covariance, Eskf, Geodetic, ImuSample,
    LocalOrigin, Position, PositionNoise, Seconds, State as Nav, Timestamp, Velocity,
    VelocityNoise,
};
use lines::{Filter, Start, State, Unit, angles, quaternion};

struct FusionNav(Eskf, LocalOrigin, Unit);

/// Stamps cannot be negative: all are ten seconds later.
fn stamp(t: f64) -> Timestamp {
    Timestamp::from_micros(((t + 10.0) * 1e6).round().max(0.0) as u64)
}

impl Filter for FusionNav {
    fn start(unit: &Unit, start: &Start) -> Option<Self> {
        let [[lat, lon, h], velocity, angles] = start.state;
        let place = Geodetic::from_degrees(lat, lon, h);
        let gravity = place.normal_gravity();
        let mut filter = Eskf::new(Config {
            gravity,
            hold: None,
            ..Config::default()
        })
        .ok()?;
        let [w, x, y, z] = quaternion(angles).map(|q| q as f32);
        let state = Nav {
            attitude: Attitude::from_body_to_ned(Quaternion { w, x, y, z }),
            velocity: Velocity::from_array(velocity.map(|v| v as f32)),
            ..Nav::default()
        };
        let [gyro, accel] = [unit.gyro_bias.max(1e-4), unit.accel_bias]; // no smaller one
        let [level, heading] = [start.level_deg, start.heading_deg].map(f64::to_radians);
        let (place_m, mps) = ([start.position_m; 3], [start.velocity_mps; 3]);
        let sigmas = [place_m, mps, [level, level, heading], [accel; 3], [gyro; 3]].concat();
        let sigmas: Vec<f32> = sigmas.iter().map(|sigma| *sigma as f32).collect();
        let covariance = Covariance::from_sigmas(sigmas.try_into().ok()?);
        let _ = filter
            .initialize_from(state, covariance, stamp(start.t))
            .ok()?;
        Some(Self(filter, LocalOrigin::new(place)?, *unit))
    }

    fn imu(&mut self, t: f64, dt: f64, theta: [f64; 3], dv: [f64; 3]) {
        let rate = AngularRate::from_array(theta.map(|angle| (angle / dt) as f32));
        let force = Acceleration::from_array(dv.map(|speed| (speed / dt) as f32));
        let dt = Seconds::from_secs(dt as f32);
        let _ = (self.0).predict(ImuSample::from_rates(stamp(t), rate, force, dt));
    }

    fn gnss(&mut self, t: f64, position: Option<[f64; 3]>, velocity: Option<[f64; 3]>) {
        let Self(filter, origin, unit) = self;
        let moment = stamp(t - unit.latency);
        if let Some([lat, lon, h]) = position {
            let [level, up] = [unit.position_sigma, unit.height_sigma].map(|sigma| sigma as f32);
            let noise = PositionNoise::horizontal_vertical(level, up);
            let place = origin.to_ned(Geodetic::from_degrees(lat, lon, h));
            let _ = filter.fuse_gnss_position(moment, place, noise, Position::zero());
        }
        if let Some(velocity) = velocity {
            let noise = VelocityNoise::from_speed_accuracy(unit.velocity_sigma as f32);
            let velocity = Velocity::from_array(velocity.map(|v| v as f32));
            let _ = filter.fuse_gnss_velocity(moment, velocity, noise, Position::zero());
        }
    }

    fn solution(&self) -> Option<State> {
        let state = self.0.state();
        let place = self.1.to_geodetic(state.position);
        let [lat, lon] = [place.latitude_rad(), place.longitude_rad()].map(f64::to_degrees);
        let q = state.attitude.body_to_ned();
        let angles = angles([q.w, q.x, q.y, q.z].map(f64::from));
        let velocity = state.velocity.to_array().map(f64::from);
        Some([[lat, lon, place.height()], velocity, angles])
    }
}

pub fn main() -> std::io::Result<()> {
    lines::serve::<FusionNav>()
}

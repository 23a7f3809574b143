//! The published filter fusion-nav, converted to its axes and types.
#![allow(clippy::cast_possible_truncation, reason = "fusion-nav takes f32")]

use std::collections::VecDeque;

use fusion_nav::Quaternion;
use fusion_nav::prelude::{
    Acceleration, AngularRate, Attitude, Config as FilterConfig, Covariance, Eskf,
    Geodetic as Place, ImuSample as Sample, LocalOrigin, Position, PositionNoise, Seconds, State,
    Timestamp, Velocity, VelocityNoise,
};
use ins_core::earth::Geodetic;
use ins_core::increments::Increments;
use ins_core::{Config, ConfigError, GnssFix, ImuOutput, ImuSample, Navigator, Solution, Time};
use nalgebra::{Quaternion as Algebraic, Unit, UnitQuaternion, Vector3};

use super::ins::Ins;
use crate::compare::kalman::filter::Start;
use crate::compare::kalman::{Kind, Noise};

/// Stamps of fusion-nav cannot be negative: this is added, us.
const EPOCH_OFFSET_US: i64 = 1_000_000_000;
/// Its covariance accepts no smaller sigma of a gyro bias, rad/s.
const LEAST_GYRO_SIGMA_RADPS: f32 = 1e-4;

/// Right-forward-up to forward-right-down and east-north-up to north-east-down, and back.
fn to_ned(v: &Vector3<f64>) -> [f32; 3] {
    [v.y as f32, v.x as f32, -v.z as f32]
}

fn from_ned([x, y, z]: [f32; 3]) -> Vector3<f64> {
    Vector3::new(f64::from(y), f64::from(x), -f64::from(z))
}

fn timestamp(time: Time) -> Timestamp {
    Timestamp::from_micros(u64::try_from(time.as_micros() + EPOCH_OFFSET_US).unwrap_or_default())
}

/// The filter in its default configuration, except what its documentation recommends for a car: local
/// gravity, and no position hold. It starts from the core's alignment, with the latency that the core
/// estimates, which it cannot.
#[derive(Clone, Debug)]
pub(super) struct Peer {
    noise: Noise,
    latency_s: f64,
    output: ImuOutput,
    state: Mode,
    last: Option<(Time, Increments)>,
}

#[derive(Clone, Debug)]
enum Mode {
    Aligning(Box<Navigator>),
    Filtering(Box<Filtering>),
}

#[derive(Clone, Debug)]
struct Filtering {
    filter: Eskf,
    origin: LocalOrigin,
    now: Time,
    /// Fixes whose time less latency is still to come.
    pending: VecDeque<GnssFix>,
}

impl Peer {
    pub(super) fn new(config: Config, noise: Noise, latency_s: f64) -> Result<Self, ConfigError> {
        Ok(Self {
            noise,
            latency_s,
            output: config.imu_output,
            state: Mode::Aligning(Box::new(Navigator::new(config)?)),
            last: None,
        })
    }
}

impl Ins for Peer {
    fn on_imu(&mut self, sample: &ImuSample) {
        let output = self.output;
        let (last, increments) = self
            .last
            .get_or_insert_with(|| (sample.time, Increments::new(output, sample)));
        let seconds = sample.time.seconds_since(*last);
        let interval = (seconds > 0.0).then(|| increments.interval(sample, seconds));
        *last = sample.time;
        match &mut self.state {
            Mode::Aligning(navigator) => {
                let _ = navigator.on_imu(sample);
                if let Some(start) = Start::of(navigator, sample.time, &self.noise)
                    && let Some(filtering) = Filtering::new(&start, &self.noise)
                {
                    self.state = Mode::Filtering(Box::new(filtering));
                }
            }
            Mode::Filtering(filtering) => {
                if let Some(interval) = interval {
                    let seconds = interval.seconds;
                    let _ = filtering.filter.predict(Sample::from_rates(
                        timestamp(sample.time),
                        AngularRate::from_array(to_ned(&(interval.rotation_rad() / seconds))),
                        Acceleration::from_array(to_ned(&(interval.force_mps / seconds))),
                        Seconds::from_secs(seconds as f32),
                    ));
                    filtering.now = sample.time;
                    filtering.fuse_due(self.latency_s, &self.noise);
                }
            }
        }
    }

    fn on_gnss(&mut self, fix: &GnssFix) {
        match &mut self.state {
            Mode::Aligning(navigator) => {
                let _ = navigator.on_gnss(fix);
            }
            Mode::Filtering(filtering) => {
                filtering.pending.push_back(*fix);
                filtering.fuse_due(self.latency_s, &self.noise);
            }
        }
    }

    fn solution(&self) -> Option<Solution> {
        let Mode::Filtering(filtering) = &self.state else {
            return None;
        };
        let state = filtering.filter.state();
        let place = filtering.origin.to_geodetic(state.position);
        let q = state.attitude.body_to_ned();
        let [w, x, y, z] = [q.w, q.x, q.y, q.z].map(f64::from);
        Some(Solution {
            time: filtering.now,
            position: Geodetic {
                latitude_rad: place.latitude_rad(),
                longitude_rad: place.longitude_rad(),
                height_m: place.height(),
            },
            velocity_enu_mps: from_ned(state.velocity.to_array()),
            attitude: Unit::new_normalize(Algebraic::new(w, y, x, -z)),
        })
    }
}

impl Filtering {
    fn new(start: &Start, noise: &Noise) -> Option<Self> {
        let position = start.ins.position;
        let place = Place::from_radians(
            position.latitude_rad,
            position.longitude_rad,
            position.height_m,
        );
        let mut filter = Eskf::new(FilterConfig {
            gravity: place.normal_gravity(),
            hold: None,
            ..FilterConfig::default()
        })
        .ok()?;
        let state = State {
            attitude: attitude(&start.ins.attitude),
            velocity: Velocity::from_array(to_ned(&start.ins.velocity_enu_mps)),
            gyro_bias: AngularRate::from_array(to_ned(&start.gyro_bias_radps)),
            ..State::default()
        };
        let heading = start.heading_sigma_rad as f32;
        let accel = noise.sensors.accel_bias_mps2 as f32;
        let [gx, gy, gz] = start
            .gyro_bias_sigma_radps
            .map(|sigma| (sigma as f32).max(LEAST_GYRO_SIGMA_RADPS));
        let sigmas = [
            5.0, 5.0, 5.0, 1.0, 1.0, 1.0, 0.05, 0.05, heading, accel, accel, accel, gy, gx, gz,
        ];
        let _aligned = filter
            .initialize_from(
                state,
                Covariance::from_sigmas(sigmas),
                timestamp(start.time),
            )
            .ok()?;
        Some(Self {
            filter,
            origin: LocalOrigin::new(place)?,
            now: start.time,
            pending: VecDeque::new(),
        })
    }

    fn fuse_due(&mut self, latency_s: f64, noise: &Noise) {
        while let Some(fix) = self.pending.front().copied() {
            let valid = fix.time.plus_seconds(-latency_s);
            if valid > self.now {
                return;
            }
            self.pending.pop_front();
            self.fuse(&fix, timestamp(valid), noise);
        }
    }

    fn fuse(&mut self, fix: &GnssFix, valid: Timestamp, noise: &Noise) {
        if let Some(p) = fix.geodetic_or(0.0) {
            let place = Place::from_radians(p.latitude_rad, p.longitude_rad, p.height_m);
            let level = noise.total_sigma(Kind::Position, fix);
            // Without a height: a sigma that makes it negligible.
            let up = if fix.height_m.is_some() {
                noise.total_sigma(Kind::Height, fix)
            } else {
                1e6
            };
            let _ = self.filter.fuse_gnss_position(
                valid,
                self.origin.to_ned(place),
                PositionNoise::horizontal_vertical(level as f32, up as f32),
                Position::zero(),
            );
        }
        if fix.velocity_en_mps.is_some() {
            let level = noise.total_sigma(Kind::Velocity, fix);
            // Likewise without vertical velocity.
            let up = if fix.velocity_up_mps.is_some() {
                noise.total_sigma(Kind::VelocityUp, fix)
            } else {
                1e3
            };
            let _ = self.filter.fuse_gnss_velocity(
                valid,
                Velocity::from_array(to_ned(&fix.velocity_enu_mps())),
                VelocityNoise::horizontal_vertical(level as f32, up as f32),
                Position::zero(),
            );
        }
    }
}

/// The vector part of the quaternion is converted like any vector.
fn attitude(q: &UnitQuaternion<f64>) -> Attitude {
    Attitude::from_body_to_ned(Quaternion {
        w: q.w as f32,
        x: q.j as f32,
        y: q.i as f32,
        z: -q.k as f32,
    })
}

//! Interface between vehicle and sensor models, kinematics of vehicles that move along their heading, and
//! additions to a motion: mounting of the unit, and vibration.

use core::f64::consts::{FRAC_PI_2, TAU};

use ins_core::attitude::{Euler, from_euler};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::noise::Random;
use super::profile::Point;

/// The motion of a vehicle against its local East-North-Up frame at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    pub velocity_enu_mps: Vector3<f64>,
    /// Time derivatives of the three components of `velocity_enu_mps`.
    pub acceleration_enu_mps2: Vector3<f64>,
    /// Rotation from body (right-forward-up) to ENU.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rate of the body against the ENU frame, in body axes.
    pub angular_rate_lb_b_radps: Vector3<f64>,
}

pub trait Motion {
    /// The motion at `time_s`. Called at times that do not decrease.
    ///
    /// The acceleration must be the derivative of the velocity, and the angular rate that of the attitude:
    /// ideal sensors use the derivatives, the truth the functions.
    fn kinematics(&mut self, time_s: f64) -> Kinematics;
}

impl<M: Motion + ?Sized> Motion for Box<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        (**self).kinematics(time_s)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Path {
    /// ENU, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Its derivative, m/s^2.
    pub acceleration_mps2: Vector3<f64>,
    /// Speed times rate of heading: to the right, m/s^2.
    pub lateral_mps2: f64,
    /// Its derivative, m/s^3.
    pub lateral_rate_mps3: f64,
}

impl Path {
    /// From speed, heading and flight-path angle, with their time derivatives.
    pub(super) fn new(along: &Point, heading: &Point, climb_rad: f64, climb_radps: f64) -> Self {
        let (speed, acceleration) = (along.value, along.slope);
        let (sin_h, cos_h) = libm::sincos(heading.value);
        let (sin_g, cos_g) = libm::sincos(climb_rad);
        let forward = Vector3::new(cos_g * sin_h, cos_g * cos_h, sin_g);
        let forward_rate = Vector3::new(
            cos_g * cos_h * heading.slope - sin_g * sin_h * climb_radps,
            -cos_g * sin_h * heading.slope - sin_g * cos_h * climb_radps,
            cos_g * climb_radps,
        );
        Self {
            velocity_mps: speed * forward,
            acceleration_mps2: acceleration * forward + speed * forward_rate,
            lateral_mps2: speed * heading.slope,
            lateral_rate_mps3: acceleration * heading.slope + speed * heading.curvature,
        }
    }
}

/// The motion of a vehicle from its velocity, roll, pitch and heading and their derivatives.
pub(super) fn kinematics(
    velocity_enu_mps: Vector3<f64>,
    acceleration_enu_mps2: Vector3<f64>,
    angles: &Euler,
    rates: &Euler,
) -> Kinematics {
    Kinematics {
        velocity_enu_mps,
        acceleration_enu_mps2,
        attitude: from_euler(angles),
        angular_rate_lb_b_radps: body_rate(angles, rates),
    }
}

/// Level attitude with a heading: angles, and their rates.
pub(super) fn level(heading: &Point) -> [Euler; 2] {
    [heading.value, heading.slope].map(|heading_rad| Euler {
        heading_rad,
        ..Euler::default()
    })
}

/// Angular rate in body axes from the rates of roll, pitch and heading.
fn body_rate(angles: &Euler, rates: &Euler) -> Vector3<f64> {
    let (sin_p, cos_p) = libm::sincos(angles.pitch_rad);
    let (sin_r, cos_r) = libm::sincos(angles.roll_rad);
    let turn = rates.heading_rad * cos_p;
    Vector3::new(
        cos_r * rates.pitch_rad + sin_r * turn,
        rates.roll_rad - rates.heading_rad * sin_p,
        sin_r * rates.pitch_rad - cos_r * turn,
    )
}

/// A rotation of the unit's mount during a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    pub start_s: f64,
    pub duration_s: f64,
    pub turn_rad: Vector3<f64>,
}

impl Slip {
    /// Rotation at a time, and its rate, body, which is continuous at both ends.
    fn at(&self, time_s: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let fraction = ((time_s - self.start_s) / self.duration_s).clamp(0.0, 1.0);
        let turned = fraction * fraction * (3.0 - 2.0 * fraction);
        let rate = 6.0 * fraction * (1.0 - fraction) / self.duration_s;
        (
            UnitQuaternion::from_scaled_axis(self.turn_rad * turned),
            self.turn_rad * rate,
        )
    }
}

/// The motion of a unit fixed to a vehicle.
#[derive(Clone, Debug)]
pub struct Mounted<M> {
    vehicle: M,
    /// From the axes of the unit to those of the vehicle.
    mount: UnitQuaternion<f64>,
    slip: Option<Slip>,
}

impl<M: Motion> Mounted<M> {
    /// A unit whose axes `mount` rotates into those of the vehicle.
    pub fn new(vehicle: M, mount: UnitQuaternion<f64>) -> Self {
        Self {
            vehicle,
            mount,
            slip: None,
        }
    }

    /// The same, with a mount that slips once.
    #[must_use]
    pub fn slipping(self, slip: Option<Slip>) -> Self {
        Self { slip, ..self }
    }
}

impl<M: Motion> Motion for Mounted<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let vehicle = self.vehicle.kinematics(time_s);
        let still = (UnitQuaternion::identity(), Vector3::zeros());
        let (turned, rate_radps) = self.slip.map_or(still, |slip| slip.at(time_s));
        let mount = self.mount * turned;
        let turning = mount.inverse() * vehicle.angular_rate_lb_b_radps;
        Kinematics {
            attitude: vehicle.attitude * mount,
            angular_rate_lb_b_radps: turning + rate_radps,
            ..vehicle
        }
    }
}

/// One frequency of a vibration or swing, body axes; amplitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonic {
    pub hz: f64,
    pub velocity_mps: [f64; 3],
    pub rotation_rad: [f64; 3],
}

/// Amplitude against speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Envelope {
    Always,
    /// Increasing with speed; half at this speed, m/s.
    Moving(f64),
    /// Decreasing with speed; half at this speed, m/s.
    Standing(f64),
}

#[derive(Clone, Debug)]
pub struct Oscillating<M> {
    motion: M,
    harmonics: Vec<Phased>,
    envelope: Envelope,
}

#[derive(Clone, Copy, Debug)]
struct Phased {
    wave: Harmonic,
    phase_rad: f64,
}

impl<M: Motion> Oscillating<M> {
    /// Adds oscillations to a motion; phases are those of run `seed`.
    pub fn new(motion: M, harmonics: &[Harmonic], envelope: Envelope, seed: u64) -> Self {
        let mut random = Random::stream(seed, "phases");
        let harmonics = harmonics.iter().map(|wave| Phased {
            wave: *wave,
            phase_rad: random.uniform([0.0, TAU]),
        });
        Self {
            motion,
            harmonics: harmonics.collect(),
            envelope,
        }
    }

    /// Factor on the amplitudes, and its rate, 1/s.
    fn amplitude(&self, k: &Kinematics) -> (f64, f64) {
        let fraction = |half_mps: f64| {
            let half2 = half_mps * half_mps;
            let all = k.velocity_enu_mps.norm_squared() + half2;
            let along = k.velocity_enu_mps.dot(&k.acceleration_enu_mps2);
            (1.0 - half2 / all, 2.0 * along * half2 / (all * all))
        };
        match self.envelope {
            Envelope::Always => (1.0, 0.0),
            Envelope::Moving(half_mps) => fraction(half_mps),
            Envelope::Standing(half_mps) => {
                let (moving, rate) = fraction(half_mps);
                (1.0 - moving, -rate)
            }
        }
    }
}

impl<M: Motion> Motion for Oscillating<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let k = self.motion.kinematics(time_s);
        let (fraction, fraction_rate) = self.amplitude(&k);
        let (mut velocity, mut acceleration) = (Vector3::zeros(), Vector3::zeros());
        let (mut rotation, mut rate) = (Vector3::zeros(), Vector3::zeros());
        for Phased { wave, phase_rad } in &self.harmonics {
            let omega = TAU * wave.hz;
            // Axes in quadrature: the unit moves on ellipses, not lines.
            for axis in 0..3 {
                let phase = omega * time_s + phase_rad + FRAC_PI_2 * axis as f64;
                let (sin, cos) = libm::sincos(phase);
                let (v, r) = (wave.velocity_mps[axis], wave.rotation_rad[axis]);
                velocity[axis] += v * fraction * cos;
                acceleration[axis] += v * (fraction_rate * cos - fraction * omega * sin);
                rotation[axis] += r * fraction * sin;
                rate[axis] += r * (fraction_rate * sin + fraction * omega * cos);
            }
        }
        superposed(&k, [velocity, acceleration], [rotation, rate])
    }
}

/// Adds a motion to another: velocity and acceleration, Rodrigues' vector and its rate, all in the body
/// axes of the first.
pub(crate) fn superposed(
    k: &Kinematics,
    [velocity, acceleration]: [Vector3<f64>; 2],
    [rotation, rate]: [Vector3<f64>; 2],
) -> Kinematics {
    let body = &k.angular_rate_lb_b_radps;
    let turned = UnitQuaternion::from_quaternion(Quaternion::from_parts(1.0, 0.5 * rotation));
    // The quaternion (1, r/2) normalised is the rotation by Rodrigues' vector r: its body rate
    // is (r' - r x r' / 2) / (1 + r^2/4).
    let own_rate = (rate - 0.5 * rotation.cross(&rate)) / (1.0 + 0.25 * rotation.norm_squared());
    Kinematics {
        velocity_enu_mps: k.velocity_enu_mps + k.attitude * velocity,
        acceleration_enu_mps2: k.acceleration_enu_mps2
            + k.attitude * (acceleration + body.cross(&velocity)),
        attitude: k.attitude * turned,
        angular_rate_lb_b_radps: turned.inverse() * body + own_rate,
    }
}

//! Shaking of the inertial unit against the airframe by engine and propeller.

use nalgebra::Vector3;

use super::parameters::Parameters;
use crate::sim::Kinematics;
use crate::sim::shaken::swung;

/// The vibration as a small displacement and rotation, each line a sinusoid of the crank angle.
///
/// Amplitudes of displacement are constant: acceleration grows with the square of engine speed.
#[derive(Clone, Debug)]
pub struct Vibration {
    lines: Vec<Line>,
}

#[derive(Clone, Copy, Debug)]
struct Line {
    order: f64,
    displacement_m: Vector3<f64>,
    rotation_rad: Vector3<f64>,
}

/// Crank angle and its change at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crank {
    pub angle_rad: f64,
    pub rate_radps: f64,
    pub rate_radps2: f64,
}

impl Vibration {
    /// The lines of an aircraft's parameters.
    pub fn new(parameters: &Parameters) -> Self {
        let rated_radps = std::f64::consts::TAU * parameters.engine.rated_speed_rps;
        let lines = parameters.vibration.lines.iter().map(|line| {
            let omega = line.order * rated_radps;
            Line {
                order: line.order,
                displacement_m: Vector3::from(line.acceleration_mps2) / (omega * omega),
                rotation_rad: Vector3::from(line.rate_radps) / omega,
            }
        });
        Self {
            lines: lines.collect(),
        }
    }

    /// Motion of the shaken unit.
    pub fn shake(&self, k: &Kinematics, crank: &Crank) -> Kinematics {
        let (mut velocity, mut acceleration) = (Vector3::zeros(), Vector3::zeros());
        let (mut rotation, mut rate) = (Vector3::zeros(), Vector3::zeros());
        for line in &self.lines {
            // A quarter turn between the axes: the unit describes ellipses, not lines.
            for axis in 0..3 {
                let phase =
                    line.order * crank.angle_rad + std::f64::consts::FRAC_PI_2 * axis as f64;
                let (sin, cos) = libm::sincos(phase);
                let omega = line.order * crank.rate_radps;
                let x = line.displacement_m[axis];
                velocity[axis] += x * omega * cos;
                acceleration[axis] +=
                    x * (line.order * crank.rate_radps2 * cos - omega * omega * sin);
                rotation[axis] += line.rotation_rad[axis] * sin;
                rate[axis] += line.rotation_rad[axis] * omega * cos;
            }
        }
        swung(k, [velocity, acceleration], [rotation, rate])
    }
}

//! Body axes a log may be written in.

use std::fmt;

use ins_core::{ImuSample, Time};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Directions of the x, y and z columns of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum BodyAxes {
    /// x forward, y right, z down.
    #[serde(rename = "FRD", alias = "frd")]
    Frd,
    /// x right, y forward, z up.
    #[serde(rename = "RFU", alias = "rfu")]
    Rfu,
    /// x forward, y left, z up.
    #[serde(rename = "FLU", alias = "flu")]
    Flu,
}

impl BodyAxes {
    /// Every one of them.
    pub const ALL: [Self; 3] = [Self::Frd, Self::Rfu, Self::Flu];

    /// A vector in these axes, turned to right-forward-up.
    pub fn to_rfu(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Frd => Vector3::new(v.y, v.x, -v.z),
            Self::Rfu => v,
            Self::Flu => Vector3::new(-v.y, v.x, v.z),
        }
    }

    /// A sample in these axes, turned to right-forward-up.
    pub(super) fn sample(self, time: Time, gyro: Vector3<f64>, accel: Vector3<f64>) -> ImuSample {
        ImuSample {
            time,
            gyro: self.to_rfu(gyro),
            accel: self.to_rfu(accel),
        }
    }

    /// A right-forward-up vector, turned to these axes.
    pub fn from_rfu(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Frd => Vector3::new(v.y, v.x, -v.z),
            Self::Rfu => v,
            Self::Flu => Vector3::new(v.y, -v.x, v.z),
        }
    }

    /// Component of a right-forward-up vector that an axis (0, 1, 2) shows, and its sign there.
    pub fn rfu_component(self, axis: usize) -> (usize, f64) {
        let along = self.to_rfu(Vector3::ith(axis, 1.0));
        (along.iamax(), along.sum())
    }

    /// Which way an axis (0, 1, 2) points on the vehicle.
    pub fn direction(self, axis: usize) -> &'static str {
        match self.rfu_component(axis) {
            (0, 1.0) => "right",
            (0, _) => "left",
            (1, _) => "forward",
            (_, 1.0) => "up",
            _ => "down",
        }
    }
}

impl fmt::Display for BodyAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Frd => "FRD",
            Self::Rfu => "RFU",
            Self::Flu => "FLU",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_points_where_its_letter_says() {
        let rfu = |axes: BodyAxes, axis| axes.to_rfu(Vector3::ith(axis, 1.0));
        assert_eq!(rfu(BodyAxes::Frd, 0), Vector3::new(0.0, 1.0, 0.0));
        assert_eq!(rfu(BodyAxes::Frd, 1), Vector3::new(1.0, 0.0, 0.0));
        assert_eq!(rfu(BodyAxes::Frd, 2), Vector3::new(0.0, 0.0, -1.0));
        assert_eq!(rfu(BodyAxes::Flu, 0), Vector3::new(0.0, 1.0, 0.0));
        assert_eq!(rfu(BodyAxes::Flu, 1), Vector3::new(-1.0, 0.0, 0.0));
        assert_eq!(rfu(BodyAxes::Flu, 2), Vector3::new(0.0, 0.0, 1.0));
        assert_eq!(BodyAxes::Frd.direction(2), "down");
        assert_eq!(BodyAxes::Flu.direction(1), "left");
    }

    #[test]
    fn there_and_back_changes_nothing() {
        let v = Vector3::new(1.0, -2.0, 3.0);
        for axes in BodyAxes::ALL {
            assert_eq!(axes.from_rfu(axes.to_rfu(v)), v);
            assert_eq!(axes.to_rfu(axes.from_rfu(v)), v);
        }
    }
}

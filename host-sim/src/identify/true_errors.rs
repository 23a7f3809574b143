//! The true errors of simulated sensors: `errors.toml` beside a log.

use std::fs;
use std::path::Path;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2};
use crate::log::{BodyAxes, LogError};
use crate::sim::SensorErrors;

pub const FILE: &str = "errors.toml";

/// True errors, in the log's own axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Heading given at the start minus true heading, deg.
    pub azimuth_error_deg: Option<f64>,
    /// As in a level vehicle: scale error of the vertical axis and misalignments to it included, mg.
    pub accel_bias_mg: [f64; 3],
    /// At the end of the run, deg/h.
    pub gyro_bias_deg_h: [f64; 3],
    /// A fix stamped t shows the motion at t minus this, ms; none of a receiver with a lag in addition.
    pub gnss_latency_ms: Option<f64>,
}

#[derive(Serialize, Deserialize)]
struct File {
    truth: Truth,
}

impl Truth {
    /// The errors of a simulated run, for a log in the given axes.
    pub fn new(errors: &SensorErrors, azimuth_error_rad: Option<f64>, axes: BodyAxes) -> Self {
        let gravity_mps2 = Vector3::new(0.0, 0.0, 9.806_65);
        let felt_mps2 = Vector3::from(errors.accel_bias_mps2) + errors.accel_matrix * gravity_mps2;
        let felt_radps =
            Vector3::from(errors.gyro_bias_radps) + errors.g_sensitivity * gravity_mps2;
        let in_axes = |rfu: Vector3<f64>, unit: f64| (axes.from_rfu(rfu) / unit).into();
        Self {
            azimuth_error_deg: azimuth_error_rad.map(f64::to_degrees),
            accel_bias_mg: in_axes(felt_mps2, MG_MPS2),
            gyro_bias_deg_h: in_axes(felt_radps, DEG_H_RADPS),
            // The estimate is of the middle of the run.
            gnss_latency_ms: (errors.gnss_lag_s == 0.0)
                .then_some(500.0 * (errors.gnss_latency_s + errors.gnss_latency_end_s)),
        }
    }

    /// In the order of [`Quantities::columns`](crate::identify::quantities::Quantities::columns).
    pub fn columns(&self) -> [Option<f64>; 8] {
        let ([ax, ay, az], [gx, gy, gz]) = (self.accel_bias_mg, self.gyro_bias_deg_h);
        let [ax, ay, az, gx, gy, gz] = [ax, ay, az, gx, gy, gz].map(Some);
        let (azimuth, latency) = (self.azimuth_error_deg, self.gnss_latency_ms);
        [azimuth, ax, ay, az, gx, gy, gz, latency]
    }

    pub fn to_toml(self) -> Result<String, toml::ser::Error> {
        toml::to_string(&File { truth: self })
    }

    /// Reads it from a log's folder; `None` if there is none.
    pub fn read(folder: &Path) -> Result<Option<Self>, LogError> {
        let path = folder.join(FILE);
        let Ok(text) = fs::read_to_string(&path) else {
            return Ok(None);
        };
        let cause = "written by another version, or by hand: simulate the drive anew";
        let file: File =
            toml::from_str(&text).map_err(|e| LogError::toml(&path, &text, &e, cause))?;
        Ok(Some(file.truth))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

    #[test]
    fn what_leans_into_the_vertical_is_felt_and_a_latency_is_that_of_the_middle() {
        let mut errors = SensorErrors {
            accel_bias_mps2: [0.0; 3],
            gyro_bias_radps: [0.0; 3],
            accel_matrix: Matrix3::zeros(),
            gyro_matrix: Matrix3::zeros(),
            g_sensitivity: Matrix3::zeros(),
            gnss_latency_s: 0.1,
            gnss_latency_end_s: 0.1,
            gnss_lag_s: 0.0,
        };
        errors.accel_matrix.m23 = 1e-3;
        let truth = |errors: &SensorErrors| Truth::new(errors, None, BodyAxes::Rfu);
        assert!((truth(&errors).accel_bias_mg[1] - 1.0).abs() < 1e-9);
        assert_eq!(truth(&errors).gnss_latency_ms, Some(100.0));
        errors.gnss_latency_end_s = 0.3;
        assert_eq!(truth(&errors).gnss_latency_ms, Some(200.0));
        errors.gnss_lag_s = 0.3;
        assert_eq!(truth(&errors).gnss_latency_ms, None);
    }
}

//! Error models: what stands in an error-model file, and the two presets.
//!
//! Equation numbers are those of V. M. Tereshkov's thesis (Bauman MSTU, 2011). A bias is measured
//! minus true.

use ins_core::ImuOutput;
use serde::{Deserialize, Serialize};

/// Everything that lies between the ideal sensors and a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorModel {
    /// Output form, ranges and losses of the inertial unit.
    pub imu: ImuModel,
    /// The three gyros, in deg/h.
    pub gyro_deg_h: SensorModel,
    /// The three accelerometers, in m/s^2.
    pub accel_mps2: SensorModel,
    /// The receiver.
    pub gnss: GnssModel,
    /// Spread of the error of the heading given at the start, deg; absent: none is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given_heading_sigma_deg: Option<f64>,
}

/// What the inertial unit does to all its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuModel {
    /// What a sample holds.
    pub output: ImuOutput,
    /// Gyro readings saturate here, deg/s.
    pub gyro_range_deg_s: f64,
    /// Accelerometer readings saturate here, m/s^2.
    pub accel_range_mps2: f64,
    /// Part of the samples that never arrive, 0 to 1.
    #[serde(default)]
    pub dropped_fraction: f64,
}

/// Three sensors of a kind. The unit U is in the name of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorModel {
    /// The bias.
    pub bias: BiasModel,
    /// White noise, square root of the one-sided density's half (the P of (3), (4)), U/sqrt(Hz):
    /// its integral over t has a standard deviation of this times sqrt(t).
    #[serde(default)]
    pub white_noise: f64,
    /// Run-to-run spread of the scale-factor error, 1.
    #[serde(default)]
    pub scale_sigma: f64,
}

/// How a bias behaves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
pub enum BiasModel {
    /// (3): piecewise constant, jumping by a normal random weight at every interval.
    Wave {
        /// Run-to-run spread at the start, U.
        initial_sigma: f64,
        /// Interval Dt between jumps, s.
        interval_s: f64,
        /// Mean of a jump, U.
        #[serde(default)]
        jump_mean: f64,
        /// Spread of a jump, U.
        jump_sigma: f64,
    },
    /// (4): constant + linear trend + exponentially correlated noise.
    Continuous {
        /// Run-to-run spread of the constant, U.
        initial_sigma: f64,
        /// Run-to-run spread of the trend, U/s.
        #[serde(default)]
        slope_sigma_per_s: f64,
        /// Standard deviation of the correlated part, U.
        #[serde(default)]
        correlated_sigma: f64,
        /// Its correlation time, s.
        #[serde(default = "a_second")]
        correlation_time_s: f64,
    },
}

fn a_second() -> f64 {
    1.0
}

impl BiasModel {
    /// A bias that stays as it was at the start.
    pub fn constant(initial_sigma: f64) -> Self {
        Self::Continuous {
            initial_sigma,
            slope_sigma_per_s: 0.0,
            correlated_sigma: 0.0,
            correlation_time_s: a_second(),
        }
    }
}

/// (5): the receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssModel {
    /// Fixes per second.
    pub rate_hz: f64,
    /// White noise of each velocity component, m/s.
    pub velocity_sigma_mps: f64,
    /// White noise of east and north position, m.
    pub horizontal_sigma_m: f64,
    /// White noise of height, m.
    pub vertical_sigma_m: f64,
    /// Bounds of the latency, drawn once a run: a fix shows the motion of that long before its
    /// stamp. Negative where the inertial stamps are late.
    pub latency_s: [f64; 2],
    /// Times without fixes.
    #[serde(default)]
    pub outages: Vec<Outage>,
}

/// A time without fixes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    /// From the start of the run, s.
    pub start_s: f64,
    /// How long, s.
    pub duration_s: f64,
}

impl ErrorModel {
    /// Ideal sensors and receiver.
    pub fn ideal() -> Self {
        let none = SensorModel {
            bias: BiasModel::constant(0.0),
            white_noise: 0.0,
            scale_sigma: 0.0,
        };
        Self {
            imu: ImuModel {
                output: ImuOutput::Increments,
                gyro_range_deg_s: 1e4,
                accel_range_mps2: 1e4,
                dropped_fraction: 0.0,
            },
            gyro_deg_h: none.clone(),
            accel_mps2: none,
            gnss: GnssModel {
                rate_hz: 10.0,
                velocity_sigma_mps: 0.0,
                horizontal_sigma_m: 0.0,
                vertical_sigma_m: 0.0,
                latency_s: [0.0, 0.0],
                outages: Vec::new(),
            },
            given_heading_sigma_deg: Some(0.0),
        }
    }

    /// Ring-laser class of the HG1700.
    ///
    /// Biases as the thesis quotes the specification, 1 deg/h and 0.01 m/s^2; angular random walk
    /// 0.125 deg/sqrt(h), velocity random walk 0.03 m/s/sqrt(h).
    pub fn hg1700() -> Self {
        Self {
            imu: ImuModel {
                output: ImuOutput::Increments,
                gyro_range_deg_s: 1000.0,
                accel_range_mps2: 370.0,
                dropped_fraction: 0.0,
            },
            gyro_deg_h: SensorModel {
                bias: BiasModel::constant(1.0),
                white_noise: 0.125 * 60.0,
                scale_sigma: 0.0,
            },
            accel_mps2: SensorModel {
                bias: BiasModel::constant(0.01),
                white_noise: 0.03 / 60.0,
                scale_sigma: 0.0,
            },
            gnss: receiver(),
            given_heading_sigma_deg: Some(3.0),
        }
    }

    /// A good consumer MEMS unit, uncalibrated.
    ///
    /// Noise and offsets of the class of ST's LSM6DSO (data sheet DS12140, table 2: 3.8 mdps and
    /// 70 ug per root hertz, 20 mg offset), 0.3 deg/s offset of the gyros. In-run drift is a
    /// correlated part of 10 deg/h and 2 mm/s^2 over 1000 s: some degrees Celsius of warming
    /// after the coarse trend is compensated. Scale errors of a part soldered to a board.
    pub fn mems() -> Self {
        Self {
            imu: ImuModel {
                output: ImuOutput::Rates,
                gyro_range_deg_s: 500.0,
                accel_range_mps2: 39.0,
                dropped_fraction: 0.0,
            },
            gyro_deg_h: SensorModel {
                bias: drifting(0.3 * 3600.0, 10.0),
                white_noise: 0.0038 * 3600.0,
                scale_sigma: 0.005,
            },
            accel_mps2: SensorModel {
                bias: drifting(0.2, 0.002),
                white_noise: 70e-6 * 9.8,
                scale_sigma: 0.015,
            },
            gnss: receiver(),
            given_heading_sigma_deg: None,
        }
    }
}

fn drifting(initial_sigma: f64, correlated_sigma: f64) -> BiasModel {
    BiasModel::Continuous {
        initial_sigma,
        slope_sigma_per_s: 0.0,
        correlated_sigma,
        correlation_time_s: 1000.0,
    }
}

fn receiver() -> GnssModel {
    GnssModel {
        rate_hz: 10.0,
        velocity_sigma_mps: 0.1,
        horizontal_sigma_m: 1.0,
        vertical_sigma_m: 1.5,
        latency_s: [0.05, 0.3],
        outages: Vec::new(),
    }
}

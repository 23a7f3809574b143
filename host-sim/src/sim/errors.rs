//! Error models: the content of an error-model file, and the two presets.
//!
//! Equation numbers are those of V. M. Tereshkov's thesis (Bauman MSTU, 2011). A bias is measured
//! minus true.

use clap::ValueEnum;
use ins_core::ImuOutput;
use serde::{Deserialize, Serialize};

use super::barometer::BarometerModel;
pub use super::checks::ErrorModelError;
use super::checks::check;
use super::receiver::Habits;
use crate::log::GRAVITY_MPS2;

/// All errors between ideal sensors and a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorModel {
    /// Output form, ranges and lost samples of the inertial unit.
    pub imu: ImuModel,
    pub gyro_deg_h: SensorModel,
    pub accel_mps2: SensorModel,
    pub gnss: GnssModel,
    /// Absent: no barometer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub barometer: Option<BarometerModel>,
    /// Sigma of the heading given at the start, deg; absent: none is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given_heading_sigma_deg: Option<f64>,
}

/// Largest stamp jitter as a part of the sampling interval: stamps stay in order.
pub const MAX_JITTER: f64 = 0.49;

/// Errors of all samples of the inertial unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuModel {
    pub output: ImuOutput,
    /// Gyro readings saturate here, deg/s.
    pub gyro_range_deg_s: f64,
    /// Accelerometer readings saturate here, m/s^2.
    pub accel_range_mps2: f64,
    /// Run-to-run sigma of the response of each gyro to specific force along each axis, deg/h/g.
    #[serde(default, skip_serializing_if = "is_default")]
    pub gyro_g_sensitivity_deg_h_g: f64,
    /// Part of the samples that are lost, 0 to 1.
    #[serde(default)]
    pub dropped_fraction: f64,
    /// Largest error of the stamps, s; the sampling itself is regular. At most [`MAX_JITTER`] of the
    /// sampling interval.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stamp_jitter_s: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Outage>,
}

/// Three sensors of a kind. The unit U is in the name of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorModel {
    pub bias: BiasModel,
    /// White noise, root of its spectral density P in (3), (4), U/sqrt(Hz): its integral over t
    /// has a standard deviation of this times sqrt(t).
    #[serde(default)]
    pub white_noise: f64,
    /// Run-to-run sigma of the scale-factor error, 1.
    #[serde(default)]
    pub scale_sigma: f64,
    /// Run-to-run sigma of the sensitivity of each axis to each other, 1. Body axes are defined by the
    /// accelerometers, so their misalignment matrix is symmetric.
    #[serde(default, skip_serializing_if = "is_default")]
    pub misalignment_sigma: f64,
    /// Run-to-run sigma of the change of a bias during warm-up, U.
    #[serde(default, skip_serializing_if = "is_default")]
    pub warming_sigma: f64,
    /// Time constant of that, s.
    #[serde(default = "warm_up_s", skip_serializing_if = "is_warm_up_s")]
    pub warming_s: f64,
    /// Factor on `white_noise` for each axis.
    #[serde(default = "equal_noise", skip_serializing_if = "is_equal_noise")]
    pub noise_times: [f64; 3],
    /// Quantization of the readings, U; zero: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub resolution: f64,
}

/// Which of the thesis's models a bias follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Law {
    /// Jumps at regular intervals, thesis equation (3).
    Wave,
    /// Constant, trend and correlated noise, thesis equation (4).
    Continuous,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
pub enum BiasModel {
    /// (3): piecewise constant, jumping by a normal random weight at every interval.
    Wave {
        /// Run-to-run sigma at the start, U.
        initial_sigma: f64,
        /// Interval Dt between jumps, s.
        interval_s: f64,
        #[serde(default)]
        jump_mean: f64,
        jump_sigma: f64,
    },
    /// (4): constant + linear trend + exponentially correlated noise.
    Continuous {
        /// Run-to-run sigma of the constant, U.
        initial_sigma: f64,
        /// Run-to-run sigma of the trend, U/s.
        #[serde(default)]
        slope_sigma_per_s: f64,
        #[serde(default)]
        correlated_sigma: f64,
        #[serde(default = "default_correlation_s")]
        correlation_time_s: f64,
    },
}

fn default_correlation_s() -> f64 {
    1.0
}

fn warm_up_s() -> f64 {
    150.0
}

// Signature is serde's.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_warm_up_s(time_s: &f64) -> bool {
    is_default(&(time_s - warm_up_s()))
}

fn equal_noise() -> [f64; 3] {
    [1.0; 3]
}

fn is_equal_noise(times: &[f64; 3]) -> bool {
    times.iter().all(|times| is_default(&(times - 1.0)))
}

/// Whether a number is zero.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl BiasModel {
    /// A bias with a Gauss-Markov process of 1000 s correlation time about its initial value.
    pub fn drifting(initial_sigma: f64, correlated_sigma: f64) -> Self {
        Self::Continuous {
            initial_sigma,
            slope_sigma_per_s: 0.0,
            correlated_sigma,
            correlation_time_s: 1000.0,
        }
    }

    /// A constant bias.
    pub fn constant(initial_sigma: f64) -> Self {
        Self::Continuous {
            initial_sigma,
            slope_sigma_per_s: 0.0,
            correlated_sigma: 0.0,
            correlation_time_s: default_correlation_s(),
        }
    }

    pub fn set_initial_sigma(&mut self, sigma: f64) {
        match self {
            Self::Wave { initial_sigma, .. } | Self::Continuous { initial_sigma, .. } => {
                *initial_sigma = sigma;
            }
        }
    }

    /// Sigma at a time after the start, U.
    pub fn sigma_after(&self, time_s: f64) -> f64 {
        match *self {
            Self::Wave {
                initial_sigma,
                interval_s,
                jump_mean,
                jump_sigma,
            } => {
                let jumps = time_s / interval_s;
                let walked = libm::hypot(jump_sigma * jumps.sqrt(), jump_mean * jumps);
                libm::hypot(initial_sigma, walked)
            }
            Self::Continuous {
                initial_sigma,
                slope_sigma_per_s,
                correlated_sigma,
                ..
            } => {
                let moved = libm::hypot(slope_sigma_per_s * time_s, correlated_sigma);
                libm::hypot(initial_sigma, moved)
            }
        }
    }

    /// Run-to-run sigma at the start, U.
    pub fn initial_sigma(&self) -> f64 {
        match self {
            Self::Wave { initial_sigma, .. } | Self::Continuous { initial_sigma, .. } => {
                *initial_sigma
            }
        }
    }
}

/// (5): the receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssModel {
    pub rate_hz: f64,
    /// White noise of each velocity component, m/s.
    pub velocity_sigma_mps: f64,
    /// White noise of east and north position, m.
    pub horizontal_sigma_m: f64,
    pub vertical_sigma_m: f64,
    /// Bounds of the latency, drawn once a run: a fix measures the motion that long before its stamp.
    /// Negative where the inertial stamps are late.
    pub latency_s: [f64; 2],
    #[serde(default)]
    pub outages: Vec<Outage>,
    /// Other behaviour of receivers.
    #[serde(default, skip_serializing_if = "is_default")]
    pub habits: Habits,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    pub start_s: f64,
    pub duration_s: f64,
}

impl GnssModel {
    /// Whether a time is in an outage, or so soon after one that no fix is sure to have arrived.
    pub fn is_out(&self, time_s: f64) -> bool {
        let late_s = self.latency_s[1].max(0.0) + self.habits.delay_s[1] + 1.0 / self.rate_hz;
        self.outages.iter().any(|outage| {
            let back_s = outage.start_s + outage.duration_s + late_s;
            (outage.start_s..back_s).contains(&time_s)
        })
    }

    /// Weight of the last epoch in exponential smoothing.
    pub(super) fn smoothing_factor(&self) -> f64 {
        let time_s = self.habits.smoothing_s;
        if time_s > 0.0 {
            libm::exp(-1.0 / (self.rate_hz * time_s))
        } else {
            0.0
        }
    }

    /// Lag of smoothing behind a constant rate, epochs.
    pub fn smoothing_epochs(&self) -> f64 {
        let factor = self.smoothing_factor();
        factor / (1.0 - factor)
    }
}

impl ErrorModel {
    pub fn from_toml(text: &str) -> Result<Self, ErrorModelError> {
        let model: Self = toml::from_str(text)?;
        check(&model)?;
        Ok(model)
    }

    /// Whether it is valid at a sampling rate.
    pub fn check_at(&self, imu_hz: f64) -> Result<(), ErrorModelError> {
        let jitter_s = self.imu.stamp_jitter_s;
        if jitter_s <= MAX_JITTER / imu_hz {
            return Ok(());
        }
        Err(ErrorModelError::Value {
            key: "imu.stamp_jitter_s".into(),
            value: jitter_s,
            expected: "at most 0.49 of the time between two samples, whose stamps stay in order",
        })
    }

    /// The same with some keys of the file changed. A bias of another model replaces the whole table.
    pub fn with(&self, keys: &toml::Table) -> Result<Self, ErrorModelError> {
        let mut file = toml::Table::try_from(self)?;
        merge(&mut file, keys);
        let model: Self = file.try_into()?;
        check(&model)?;
        Ok(model)
    }

    pub fn ideal() -> Self {
        let none = SensorModel::new(BiasModel::constant(0.0), 0.0);
        Self {
            imu: ImuModel::new(ImuOutput::Increments, 1e4, 1e4),
            gyro_deg_h: none.clone(),
            accel_mps2: none,
            gnss: GnssModel {
                velocity_sigma_mps: 0.0,
                horizontal_sigma_m: 0.0,
                vertical_sigma_m: 0.0,
                latency_s: [0.0, 0.0],
                ..receiver()
            },
            barometer: None,
            given_heading_sigma_deg: Some(0.0),
        }
    }

    /// Ring-laser class of the HG1700.
    ///
    /// Biases as the thesis quotes the specification, 1 deg/h and 0.01 m/s^2; angular random walk
    /// 0.125 deg/sqrt(h), velocity random walk 0.03 m/s/sqrt(h).
    pub fn hg1700() -> Self {
        Self {
            imu: ImuModel::new(ImuOutput::Increments, 1000.0, 370.0),
            gyro_deg_h: SensorModel::new(BiasModel::constant(1.0), 0.125 * 60.0),
            accel_mps2: SensorModel::new(BiasModel::constant(0.01), 0.03 / 60.0),
            gnss: receiver(),
            barometer: None,
            given_heading_sigma_deg: Some(3.0),
        }
    }

    /// A good consumer MEMS unit, uncalibrated.
    ///
    /// Noise of ST's LSM6DSO (data sheet DS12140: 3.8 mdps and, at 16 g full scale, 110 ug per
    /// root hertz). Ours: offsets of 0.3 deg/s and 0.2 m/s^2, in-run drift of 40 deg/h and
    /// 2 mm/s^2 correlated over 1000 s, scale errors of a part soldered to a board.
    pub fn mems() -> Self {
        Self {
            imu: ImuModel::new(ImuOutput::Rates, 500.0, 157.0),
            gyro_deg_h: SensorModel {
                scale_sigma: 0.005,
                ..SensorModel::new(BiasModel::drifting(0.3 * 3600.0, 40.0), 0.0038 * 3600.0)
            },
            accel_mps2: SensorModel {
                scale_sigma: 0.015,
                ..SensorModel::new(BiasModel::drifting(0.2, 0.002), 110e-6 * 9.8)
            },
            gnss: receiver(),
            barometer: None,
            given_heading_sigma_deg: None,
        }
    }
}

/// Merges tables recursively; everything else is replaced.
pub(crate) fn merge(file: &mut toml::Table, keys: &toml::Table) {
    for (key, value) in keys {
        match (file.get_mut(key), value) {
            (Some(toml::Value::Table(old)), toml::Value::Table(new))
                if !new.contains_key("model") =>
            {
                merge(old, new);
            }
            _ => {
                file.insert(key.clone(), value.clone());
            }
        }
    }
}

impl ImuModel {
    /// Response of the gyros to specific force, one sigma, rad/s per m/s^2.
    pub fn gyro_g_sensitivity(&self) -> f64 {
        self.gyro_g_sensitivity_deg_h_g.to_radians() / (3600.0 * GRAVITY_MPS2)
    }

    /// No sample lost, no jitter.
    fn new(output: ImuOutput, gyro_range_deg_s: f64, accel_range_mps2: f64) -> Self {
        Self {
            output,
            gyro_range_deg_s,
            accel_range_mps2,
            gyro_g_sensitivity_deg_h_g: 0.0,
            dropped_fraction: 0.0,
            stamp_jitter_s: 0.0,
            holes: Vec::new(),
        }
    }
}

impl Outage {
    pub fn contains(&self, time_s: f64) -> bool {
        (self.start_s..self.start_s + self.duration_s).contains(&time_s)
    }
}

impl SensorModel {
    /// Three equal sensors without scale errors and misalignments.
    pub(super) fn new(bias: BiasModel, white_noise: f64) -> Self {
        Self {
            bias,
            white_noise,
            scale_sigma: 0.0,
            misalignment_sigma: 0.0,
            warming_sigma: 0.0,
            warming_s: warm_up_s(),
            noise_times: equal_noise(),
            resolution: 0.0,
        }
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
        habits: Habits::default(),
    }
}

//! Everything the user sets. Plain data, checked once, in [`Navigator::new`].
//!
//! [`Navigator::new`]: crate::Navigator::new

use core::f64::consts::TAU;

use nalgebra::SVector;

use crate::math;
use crate::parameters::{COUNT, Parameters, index};
use crate::samples::ImuOutput;

/// Bandwidth and damping ratio of a second-order loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SecondOrder {
    /// Undamped natural frequency w0, rad/s.
    pub bandwidth_radps: f64,
    /// Damping ratio zeta.
    pub damping_ratio: f64,
}

/// The damping loops: how strongly GNSS holds the INS.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DampingConfig {
    /// Horizontal velocity and tilt: K1, K2.
    pub horizontal: SecondOrder,
    /// Height and vertical velocity: C1, C2.
    pub vertical: SecondOrder,
    /// Horizontal position, rad/s, the way C1 holds height.
    pub position_radps: f64,
    /// Azimuth, rad/s: K3, the rate at which a found azimuth error is taken out.
    pub azimuth_radps: f64,
}

/// Errors of the inertial sensors, one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorConfig {
    /// Run-to-run gyro bias, rad/s.
    pub gyro_bias_radps: f64,
    /// Angular random walk of the x, y and z gyro, rad/sqrt(s).
    pub gyro_noise: [f64; 3],
    /// Drift of a gyro bias, rad/s/sqrt(s).
    pub gyro_bias_walk: f64,
    /// Scale-factor error of the gyros, 1.
    pub gyro_scale: f64,
    /// Run-to-run accelerometer bias, m/s^2.
    pub accel_bias_mps2: f64,
    /// Velocity random walk of the x, y and z accelerometer, m/s/sqrt(s).
    pub accel_noise: [f64; 3],
    /// Drift of an accelerometer bias, m/s^2/sqrt(s).
    pub accel_bias_walk: f64,
    /// Scale-factor error of the accelerometers, 1.
    pub accel_scale: f64,
    /// Cross-axis sensitivity of gyros and accelerometers, 1: process noise of manoeuvres, and of the gyros
    /// a parameter.
    pub cross_axis: f64,
    /// Misalignment of the sensor axes, rad, if it matters: in manoeuvres it adds to `cross_axis`. Level
    /// accelerometer biases are then no better known than to g times that: a turn about the vertical cannot
    /// tell them from misaligned gyros. With zero they are what level accelerometers and gyros together
    /// show, which is what a compensation needs.
    pub misalignment_rad: f64,
    /// Response of the gyros to specific force along any axis, rad/s per m/s^2: process noise of manoeuvres.
    pub gyro_g_sensitivity: f64,
    /// Least and greatest ratio of the true `gyro_noise` to the configured one: it is adapted in motion,
    /// all axes together. Ones: not adapted.
    pub noise_range: [f64; 2],
    /// Angular rate on one axis beyond which a reading may be clipped, rad/s: a little less than full scale. A
    /// quarter more may then be lost, which is process noise. Beyond it by a tenth a reading is refused.
    pub gyro_range_radps: f64,
    /// The same of the accelerometers, m/s^2.
    pub accel_range_mps2: f64,
}

impl SensorConfig {
    /// Angular random walk of an axis in any direction, on average, rad/sqrt(s).
    pub fn mean_gyro_noise(&self) -> f64 {
        root_mean_square(&self.gyro_noise)
    }

    /// Velocity random walk of an axis in any direction, on average, m/s/sqrt(s).
    pub fn mean_accel_noise(&self) -> f64 {
        root_mean_square(&self.accel_noise)
    }
}

fn root_mean_square([x, y, z]: &[f64; 3]) -> f64 {
    math::sqrt((x * x + y * y + z * z) / 3.0)
}

/// Noise of a GNSS measurement: a white part, and a correlated one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Noise {
    /// Standard deviation of the white part, from fix to fix.
    pub white: f64,
    /// Standard deviation of the correlated part: first-order Gauss-Markov.
    pub correlated: f64,
    /// Its correlation time, s.
    pub correlation_s: f64,
}

impl Noise {
    /// White noise alone.
    pub const fn white(sigma: f64) -> Self {
        Self {
            white: sigma,
            correlated: 0.0,
            correlation_s: 1.0,
        }
    }

    /// Variance of both parts.
    pub fn variance(&self) -> f64 {
        self.white * self.white + self.correlated * self.correlated
    }
}

/// The GNSS receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GnssConfig {
    /// Noise of the east and of the north velocity, m/s.
    pub velocity_mps: Noise,
    /// Noise of the vertical velocity, m/s.
    pub velocity_up_mps: Noise,
    /// Noise of the position east and north, m. Beside velocities two positions a second are used; all of
    /// them where neither this nor the noise of the height has a correlated part.
    pub position_m: Noise,
    /// Noise of the height, m.
    pub height_m: Noise,
    /// Least and greatest ratio of the true standard deviations to these; and greatest ratio of the
    /// correlation time of heights, where no vertical velocities are given.
    pub noise_range: [f64; 2],
    /// Whether the sigma that a fix states is used as it is, within that range, and only the correlation of
    /// successive innovations is learnt. Else only its changes are used.
    pub trust_stated_sigma: bool,
    /// Sigma of the unknown latency, s.
    pub latency_sigma_s: f64,
    /// Sigma of the delay of positions beyond that of the velocities beside them, s: a receiver that
    /// filters only one of them, or makes velocities of positions, has one. Zero: none.
    pub position_delay_sigma_s: f64,
    /// Sigma of the rate of the inertial clock against GNSS time, s/s; zero where both are stamped by one
    /// clock.
    pub clock_drift_sigma: f64,
    /// Lever arm: antenna right, forward and up of the sensors, m.
    pub lever_arm_m: [f64; 3],
    /// Its sigma per axis, m; zero: known exactly.
    pub lever_arm_sigma_m: f64,
    /// Prior sigma of the receiver's smoothing, s^2: the variance of the delays that one output averages. A
    /// mean over 0.5 s has 0.02.
    pub smoothing_s2: f64,
}

/// Source of the first heading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HeadingSource {
    /// Gyrocompassing at rest if the gyros resolve Earth rate, else from motion.
    #[default]
    Auto,
    /// Known heading at the first sample, rad, to some degrees; turns before the end of levelling are
    /// followed by the gyros.
    Given(f64),
    /// From GNSS velocity in motion, however good the gyros are.
    Motion,
}

/// Form of the compensation estimators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Form {
    /// Every control undone, all parameters jointly.
    #[default]
    Exact,
    /// The thesis's (7) to (11) as printed, each on its own manoeuvres.
    #[cfg(feature = "literal")]
    Literal,
}

/// Use of the estimates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Feedback {
    /// Taken out as they become known: of gyros from the beginning, of accelerometers once their sigma is
    /// half of the prior one, and of the stamps of fixes at once.
    #[default]
    Closed,
    /// Reported only. The INS drifts by its gyro errors; at an azimuth error of a radian it is aligned
    /// anew: with 0.5 deg/s after two minutes.
    Open,
}

/// A configuration that cannot be used: which value, and what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// Must be greater than zero, 1e-15 or so, and less than 1e15.
    NotPositive(&'static str),
    /// Must not be below zero, and be less than 1e15.
    Negative(&'static str),
    /// Must be finite: of a size below 1e15.
    NotFinite(&'static str),
    /// Must be a least factor of one or less, above zero, and a greatest of one or more.
    RangeWithoutOne(&'static str),
    /// Must be an angle in radians: within a turn of zero.
    BeyondATurn(&'static str),
    /// Must be a time in seconds, and at most a minute.
    BeyondAMinute(&'static str),
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (value, must) = match self {
            Self::NotPositive(value) => (value, "must be greater than zero and less than 1e15"),
            Self::Negative(value) => (value, "must not be negative, and be less than 1e15"),
            Self::NotFinite(value) => (value, "must be finite"),
            Self::RangeWithoutOne(value) => (value, "must be a range of factors around one"),
            Self::BeyondATurn(value) => (value, "must be in radians, and within a turn"),
            Self::BeyondAMinute(value) => (value, "must be in seconds, and at most a minute"),
        };
        write!(f, "{value} {must}")
    }
}

impl core::error::Error for ConfigError {}

/// Above any value in SI units; single precision holds its square.
const LARGEST: f64 = 1e15;

fn positive(value: f64, name: &'static str) -> Result<(), ConfigError> {
    let good = value > 1.0 / LARGEST && value < LARGEST;
    good.then_some(()).ok_or(ConfigError::NotPositive(name))
}

fn not_negative(value: f64, name: &'static str) -> Result<(), ConfigError> {
    let good = (0.0..LARGEST).contains(&value);
    good.then_some(()).ok_or(ConfigError::Negative(name))
}

pub(crate) fn finite(value: f64, name: &'static str) -> Result<(), ConfigError> {
    let good = math::abs(value) < LARGEST;
    good.then_some(()).ok_or(ConfigError::NotFinite(name))
}

fn within_a_minute(seconds: f64, name: &'static str) -> Result<(), ConfigError> {
    (seconds <= 60.0)
        .then_some(())
        .ok_or(ConfigError::BeyondAMinute(name))
}

fn within_a_turn(angle_rad: f64, name: &'static str) -> Result<(), ConfigError> {
    let good = math::abs(angle_rad) <= TAU;
    good.then_some(()).ok_or(ConfigError::BeyondATurn(name))
}

fn around_one([least, most]: [f64; 2], name: &'static str) -> Result<(), ConfigError> {
    let good = (1.0 / LARGEST..=1.0).contains(&least) && (1.0..LARGEST).contains(&most);
    good.then_some(()).ok_or(ConfigError::RangeWithoutOne(name))
}

impl Noise {
    fn check(&self, name: &'static str) -> Result<(), ConfigError> {
        positive(self.white, name)?;
        not_negative(self.correlated, name)?;
        positive(self.correlation_s, name)
    }
}

impl DampingConfig {
    fn check(&self) -> Result<(), ConfigError> {
        for (order, name) in [
            (&self.horizontal, "damping.horizontal"),
            (&self.vertical, "damping.vertical"),
        ] {
            positive(order.bandwidth_radps, name)?;
            positive(order.damping_ratio, name)?;
        }
        not_negative(self.position_radps, "damping.position_radps")?;
        not_negative(self.azimuth_radps, "damping.azimuth_radps")
    }
}

impl SensorConfig {
    fn check(&self) -> Result<(), ConfigError> {
        for (gyro, accel) in self.gyro_noise.iter().zip(&self.accel_noise) {
            positive(*gyro, "sensors.gyro_noise")?;
            positive(*accel, "sensors.accel_noise")?;
        }
        positive(self.gyro_bias_radps, "sensors.gyro_bias_radps")?;
        not_negative(self.gyro_bias_walk, "sensors.gyro_bias_walk")?;
        not_negative(self.gyro_scale, "sensors.gyro_scale")?;
        positive(self.accel_bias_mps2, "sensors.accel_bias_mps2")?;
        not_negative(self.accel_bias_walk, "sensors.accel_bias_walk")?;
        not_negative(self.accel_scale, "sensors.accel_scale")?;
        not_negative(self.cross_axis, "sensors.cross_axis")?;
        not_negative(self.misalignment_rad, "sensors.misalignment_rad")?;
        not_negative(self.gyro_g_sensitivity, "sensors.gyro_g_sensitivity")?;
        around_one(self.noise_range, "sensors.noise_range")?;
        positive(self.gyro_range_radps, "sensors.gyro_range_radps")?;
        positive(self.accel_range_mps2, "sensors.accel_range_mps2")
    }

    /// Variance of the total cross-axis sensitivity, 1.
    pub(crate) fn cross_axis_variance(&self) -> f64 {
        self.cross_axis * self.cross_axis + self.misalignment_rad * self.misalignment_rad
    }
}

impl GnssConfig {
    fn check(&self) -> Result<(), ConfigError> {
        self.velocity_mps.check("gnss.velocity_mps")?;
        self.velocity_up_mps.check("gnss.velocity_up_mps")?;
        self.position_m.check("gnss.position_m")?;
        self.height_m.check("gnss.height_m")?;
        around_one(self.noise_range, "gnss.noise_range")?;
        for arm in self.lever_arm_m {
            finite(arm, "gnss.lever_arm_m")?;
        }
        for (sigma_s, name) in [
            (self.latency_sigma_s, "gnss.latency_sigma_s"),
            (self.position_delay_sigma_s, "gnss.position_delay_sigma_s"),
            (math::sqrt(self.smoothing_s2), "gnss.smoothing_s2"),
        ] {
            not_negative(sigma_s, name)?;
            within_a_minute(sigma_s, name)?;
        }
        not_negative(self.clock_drift_sigma, "gnss.clock_drift_sigma")?;
        not_negative(self.lever_arm_sigma_m, "gnss.lever_arm_sigma_m")
    }
}

/// Configuration of a [`Navigator`](crate::Navigator).
///
/// A sigma of zero means that a parameter is known exactly. Of smoothing, delay of positions, clock drift,
/// lever arm, scale errors of accelerometers and of gyros, and misalignments, in this order, those after
/// the last that is not zero are not estimated, and cost nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Content of an inertial sample.
    pub imu_output: ImuOutput,
    /// First heading.
    pub heading: HeadingSource,
    /// Damping loops.
    pub damping: DampingConfig,
    /// Inertial sensors.
    pub sensors: SensorConfig,
    /// GNSS receiver.
    pub gnss: GnssConfig,
    /// Estimator form.
    pub form: Form,
    /// Use of the estimates.
    pub feedback: Feedback,
    /// Longest gap between inertial samples that is bridged, s: at most a minute.
    pub max_gap_s: f64,
    /// Sigma of the vertical velocity over long times, m/s: its only aiding where fixes have neither height
    /// nor vertical velocity, and its prior where no fix has measured the climb of a vehicle in motion.
    pub climb_sigma_mps: f64,
}

impl Config {
    /// Prior of the parameters.
    #[inline(never)]
    pub(crate) fn prior(&self) -> Parameters {
        let mut prior = Parameters {
            sigma: self.prior_sigma(),
            ..Parameters::NONE
        };
        for (axis, arm) in self.gnss.lever_arm_m.iter().enumerate() {
            prior.shift(index::LEVER_ARM + axis, *arm);
        }
        prior
    }

    /// Its sigmas.
    #[inline(never)]
    pub(crate) fn prior_sigma(&self) -> SVector<f32, COUNT> {
        let mut prior = SVector::<f32, COUNT>::zeros();
        let mut needed = false;
        for (first, count, sigma, least) in self.parameter_groups().into_iter().rev() {
            // Those before the last that is not known exactly are estimated with it.
            needed |= sigma > 0.0 || first <= index::ACCEL;
            if needed {
                for own in prior.iter_mut().skip(first).take(count) {
                    *own = math::single(math::max(sigma, least));
                }
            }
        }
        prior
    }

    /// Whether a parameter is given, and not estimated.
    pub(crate) fn is_given(&self, parameter: usize) -> bool {
        let of = |(first, count, sigma, _): &(usize, usize, f64, f64)| {
            (*first..first + count).contains(&parameter) && *sigma <= 0.0
        };
        self.parameter_groups().iter().any(of)
    }

    /// First parameter of each group, their number, sigma, and least sigma if estimated: zero would make
    /// the weights infinite.
    fn parameter_groups(&self) -> [(usize, usize, f64, f64); 11] {
        let s = &self.sensors;
        let g = &self.gnss;
        let misalignment = math::sqrt(s.cross_axis_variance());
        [
            (index::AZIMUTH, 1, 1.0, 1.0),
            (index::LATENCY, 1, g.latency_sigma_s, 1e-6),
            (index::GYRO, 3, s.gyro_bias_radps, 1e-9),
            (index::ACCEL, 3, s.accel_bias_mps2, 1e-6),
            (index::SMOOTHING, 1, g.smoothing_s2, 1e-9),
            (index::POSITION_DELAY, 1, g.position_delay_sigma_s, 1e-6),
            (index::CLOCK_DRIFT, 1, g.clock_drift_sigma, 1e-12),
            (index::LEVER_ARM, 3, g.lever_arm_sigma_m, 1e-4),
            (index::ACCEL_SCALE, 3, s.accel_scale, 1e-7),
            (index::TURN_SCALE, 4, s.gyro_scale, 1e-7),
            (index::GYRO_MISALIGNMENT, 3, misalignment, 1e-7),
        ]
    }

    /// Names the value that cannot be used.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        self.damping.check()?;
        self.sensors.check()?;
        self.gnss.check()?;
        positive(self.max_gap_s, "max_gap_s")?;
        within_a_minute(self.max_gap_s, "max_gap_s")?;
        positive(self.climb_sigma_mps, "climb_sigma_mps")?;
        match self.heading {
            HeadingSource::Given(heading_rad) => within_a_turn(heading_rad, "heading"),
            HeadingSource::Auto | HeadingSource::Motion => Ok(()),
        }
    }

    /// Ring-laser class of the HG1700: 1 deg/h, 0.01 m/s^2, 0.125 deg/sqrt(h); scale factors
    /// calibrated.
    pub fn hg1700() -> Self {
        // The correlated part is learnt: little at first, for more of it shows soon.
        let velocity_mps = Noise {
            white: 0.1,
            correlated: 0.02,
            correlation_s: 3.0,
        };
        // Of positions it shows late, over minutes: with little at first, slow drift would be taken for
        // motion.
        let wandering = |sigma| Noise {
            white: sigma,
            correlated: sigma,
            correlation_s: 60.0,
        };
        let order = SecondOrder {
            bandwidth_radps: 0.5,
            damping_ratio: 0.7,
        };
        Self {
            imu_output: ImuOutput::Rates,
            heading: HeadingSource::Auto,
            damping: DampingConfig {
                horizontal: order,
                vertical: order,
                position_radps: 0.1,
                azimuth_radps: 0.5,
            },
            sensors: SensorConfig {
                gyro_bias_radps: 4.848e-6,
                gyro_noise: [3.636e-5; 3],
                gyro_bias_walk: 0.0,
                gyro_scale: 0.0,
                accel_bias_mps2: 0.01,
                accel_noise: [5e-4; 3],
                accel_bias_walk: 0.0,
                accel_scale: 0.0,
                cross_axis: 0.0,
                misalignment_rad: 0.0,
                gyro_g_sensitivity: 0.0,
                noise_range: [0.1, 10.0],
                gyro_range_radps: 17.0,
                accel_range_mps2: 360.0,
            },
            gnss: GnssConfig {
                velocity_mps,
                velocity_up_mps: velocity_mps,
                position_m: wandering(1.5),
                height_m: wandering(3.0),
                noise_range: [0.1, 10.0],
                trust_stated_sigma: false,
                latency_sigma_s: 0.2,
                position_delay_sigma_s: 0.2,
                clock_drift_sigma: 0.0,
                lever_arm_m: [0.0; 3],
                lever_arm_sigma_m: 0.0,
                smoothing_s2: 0.03,
            },
            form: Form::Exact,
            feedback: Feedback::Closed,
            max_gap_s: 2.0,
            climb_sigma_mps: 5.0,
        }
    }

    /// Consumer MEMS, uncalibrated: gyro biases up to some deg/s, 0.3 m/s^2, 1.5 % scale.
    pub fn mems() -> Self {
        let base = Self::hg1700();
        Self {
            sensors: SensorConfig {
                gyro_bias_radps: 1.75e-2,
                gyro_noise: [1.5e-4; 3],
                gyro_bias_walk: 1e-5,
                gyro_scale: 0.005,
                accel_bias_mps2: 0.3,
                accel_noise: [2e-3; 3],
                accel_bias_walk: 9e-5,
                accel_scale: 0.015,
                cross_axis: 0.005,
                gyro_range_radps: 34.0,
                accel_range_mps2: 155.0,
                ..base.sensors
            },
            gnss: GnssConfig {
                lever_arm_sigma_m: 3.0,
                clock_drift_sigma: 1e-4,
                ..base.gnss
            },
            ..base
        }
    }
}

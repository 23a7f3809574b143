//! All results of a log on its sensors.

use std::collections::BTreeMap;

use ins_core::Config;
use serde::Serialize;

use super::found::Found;
use super::mount::Mount;
use crate::identify::analysis::Analysis;
use crate::identify::error_model::Identified;
use crate::identify::error_model::fit::GyroFit;
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::summary::is_zero;
use crate::identify::verdict::{Verdict, beyond_class};
use crate::log::{BodyAxes, Grade, Log};
use crate::sim::errors::Law;

/// All results. Axes are those of the unit, right, forward, up; units are SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuning {
    pub verdict: Verdict,
    /// Warnings of the log, which go to standard error on the terminal.
    pub warnings: Vec<String>,
    pub log: String,
    /// Sensor and receiver of the recording; empty for a log folder.
    pub source: String,
    /// Span of the inertial samples.
    pub duration_s: f64,
    pub imu_rate_hz: f64,
    /// Class of sensors assumed.
    pub grade: Grade,
    /// Of arrays.
    pub axes: BodyAxes,
    /// A fix with stamp t measures the motion at t minus this.
    pub gnss_delay_s: Found,
    /// Clock offset that was subtracted from the stamps of fixes: not part of the delay.
    #[serde(skip_serializing_if = "is_zero")]
    pub clock_offset_s: f64,
    /// Delay of positions against the velocities of the same fix.
    pub gnss_position_delay_s: Found,
    /// Antenna from the unit.
    pub lever_arm_m: [Found; 3],
    pub mount: Mount,
    /// To be subtracted from readings.
    pub gyro_bias_radps: [Found; 3],
    /// To be subtracted from readings.
    pub accel_bias_mps2: [Found; 3],
    /// White noise, rad/s/sqrt(Hz), as in motion.
    pub gyro_noise: Found,
    /// White noise at rest, m/s^2/sqrt(Hz).
    pub accel_noise: Found,
    /// Random walk of a gyro bias, rad/s^2/sqrt(Hz).
    pub gyro_bias_walk: Found,
    /// Random walk of an accelerometer bias, m/s^3/sqrt(Hz).
    pub accel_bias_walk: Found,
    /// Standard deviation of a Gauss-Markov gyro bias about its mean, rad/s.
    pub gyro_bias_wander: Found,
    /// Its correlation time, s.
    pub gyro_bias_correlation_s: Found,
    /// White noise of a component of GNSS velocity, m/s.
    pub gnss_velocity_noise_mps: Found,
    /// The recording was rotated upright on import: the axes are not those of the sensor.
    pub turned_upright: bool,
    /// Of the autopilot, as set in the recording.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, f64>,
    /// Configuration of this core with the results.
    pub config: Config,
}

const DELAY: &str = "speed up and brake hard a dozen times, or turn at speed";
const LEVER_ARM: &str =
    "turn tightly both ways, at walking pace too; the antenna's height shows when the unit leans";
const AT_ANTENNA: &str =
    "not estimated in this class of sensors, which is taken to be at the antenna: measure it";
const LEVEL_GYRO: &str = "stand still for a minute, or move for ten";
const VERTICAL_GYRO: &str = "stand still for a minute, or turn, start and brake for ten";
const LEVEL_ACCEL: &str = "turn by 90 degrees and more, both ways, a dozen times";
const VERTICAL_ACCEL: &str = "log the vertical velocity or the height of GNSS, for some minutes";
const NOISE: &str = "stand still for half a minute, engines as in use";
const GYRO_WALK: &str =
    "log an hour and more: so far the gyros' noise hides how their offsets move";
const ACCEL_WALK: &str =
    "log some hours at rest for an Allan deviation: in motion GNSS hides how these offsets move";
const VELOCITY: &str = "move for longer, with starts, brakings and turns at speed";

/// Least correlation time of an offset, s: ten epochs of the fit.
const MIN_CORRELATION_S: f64 = 20.0;

impl Tuning {
    /// From a log, the estimates of the core on it, and its error model.
    pub fn new(analysis: &Analysis, model: &Identified) -> Self {
        let (log, found, summary) = (&analysis.log, &analysis.found, &analysis.summary);
        let e = &found.end.estimates;
        let no_lever = if found.config.gnss.lever_arm_sigma_m > 0.0 {
            LEVER_ARM
        } else {
            AT_ANTENNA
        };
        let gyro = model.gyro.as_ref();
        let noise = gyro.map(|gyro| gyro.noise);
        let at_rest = model.gyro_noise_at_rest();
        let noise = noise.or(at_rest.map(|noise| noise.scaled(DEG_H_RADPS)));
        let [walk, wander, correlation] = gyro_bias_dynamics(model);
        let level_and_up = |estimates: &[ins_core::Estimate; 3], level, up| {
            let missing = [level, level, up];
            [0, 1, 2].map(|axis| Found::of(&estimates[axis], missing[axis]))
        };
        let text = |key: &str| log.meta.document.get(key).and_then(toml::Value::as_str);
        let mut tuning = Self {
            verdict: summary.verdict.clone(),
            warnings: summary.warnings.clone(),
            log: summary.log.clone(),
            source: text("source").unwrap_or_default().to_owned(),
            duration_s: summary.duration_s,
            imu_rate_hz: log.imu_rate_hz(),
            grade: summary.grade,
            axes: BodyAxes::Rfu,
            gnss_delay_s: Found::of(&e.gnss_latency_s, DELAY).plus(log.meta.latency_offset_s()),
            clock_offset_s: summary.clock_offset_s,
            gnss_position_delay_s: if log.gnss.iter().any(|fix| fix.velocity_en_mps.is_some()) {
                Found::of(&e.gnss_position_delay_s, DELAY)
            } else {
                // Without velocities the delay is that of the positions.
                Found::known(0.0, 0.0)
            },
            lever_arm_m: e.lever_arm_m.map(|arm| Found::of(&arm, no_lever)),
            mount: Mount::new(&found.history, e),
            gyro_bias_radps: level_and_up(&e.gyro_bias_radps, LEVEL_GYRO, VERTICAL_GYRO),
            accel_bias_mps2: level_and_up(&e.accel_bias_mps2, LEVEL_ACCEL, VERTICAL_ACCEL),
            gyro_noise: Found::within(noise, NOISE),
            accel_noise: Found::within(model.accel_noise(), NOISE),
            gyro_bias_walk: walk,
            accel_bias_walk: Found::unknown(ACCEL_WALK),
            gyro_bias_wander: wander,
            gyro_bias_correlation_s: correlation,
            gnss_velocity_noise_mps: Found::within(gyro.map(|g| g.gnss_sigma_mps), VELOCITY),
            turned_upright: log.meta.document.get("turned_upright")
                == Some(&toml::Value::Boolean(true)),
            parameters: parameters(log),
            config: found.config,
        };
        tuning.verdict = tuning.verdict.clone().and(tuning.noise_beyond_class());
        tuning.config = tuning.configured();
        tuning
    }

    /// Note on the clock offset, if there is one.
    pub(super) fn clock_note(&self) -> Option<String> {
        let offset_s = self.clock_offset_s;
        let note = format!(
            "Clocks differ: {offset_s:.2} s were taken off the stamps of fixes, no part of the delay."
        );
        (offset_s != 0.0).then_some(note)
    }

    fn noise_beyond_class(&self) -> Option<String> {
        let sensors = &self.config.sensors;
        // Ratio to the noise of the class that no sensor of it exceeds.
        let max_ratio = match self.grade {
            Grade::Hg1700 => 2.0,
            Grade::Mems => 8.0,
        };
        let exceeds = |noise: &Found, typical: f64| {
            let least = noise.value - 3.0 * noise.sigma;
            noise.is_known() && least > max_ratio * typical
        };
        let gyro = exceeds(&self.gyro_noise, sensors.mean_gyro_noise());
        let accel = exceeds(&self.accel_noise, sensors.mean_accel_noise());
        beyond_class(&[("gyro noise", gyro), ("accelerometer noise", accel)])
    }

    /// The configuration of the class, with the results in its place: units and axes are the core's
    /// (`ins_core::config`); noise per root second equals a density per root Hz.
    fn configured(&self) -> Config {
        let mut config = self.config;
        let set = |value: &mut f64, found: &Found| {
            if found.is_known() {
                *value = found.value;
            }
        };
        for axis in 0..3 {
            set(&mut config.sensors.gyro_noise[axis], &self.gyro_noise);
            set(&mut config.sensors.accel_noise[axis], &self.accel_noise);
        }
        set(&mut config.sensors.gyro_bias_walk, &self.gyro_bias_walk);
        let white = &mut config.gnss.velocity_mps.white;
        set(white, &self.gnss_velocity_noise_mps);
        if self.lever_arm_m.iter().all(Found::is_known) {
            config.gnss.lever_arm_m = self.lever_arm_m.map(|arm| arm.value);
            let sigmas = self.lever_arm_m.iter().map(|arm| arm.sigma);
            config.gnss.lever_arm_sigma_m = sigmas.fold(0.0, f64::max);
        }
        if self.gnss_delay_s.is_known() {
            config.gnss.latency_sigma_s = LATENCY_SIGMAS * self.gnss_delay_s.sigma;
        }
        config
    }
}

/// Prior sigma of a latency that is subtracted from the stamps, in its sigmas: it changes from start to start.
pub(super) const LATENCY_SIGMAS: f64 = 3.0;

/// Random walk, standard deviation and correlation time of the gyro biases.
///
/// Changes within seconds are noise, not bias. A Gauss-Markov process of sigma `s` and time `T` initially walks
/// at `s sqrt(2 / T)`; jumps of sigma `j` every `T` at `j / sqrt(T)`.
fn gyro_bias_dynamics(model: &Identified) -> [Found; 3] {
    let unknown = Found::unknown(GYRO_WALK);
    let slow = |gyro: &&GyroFit| gyro.has_time_scale() && gyro.time_s.value > MIN_CORRELATION_S;
    let Some(gyro) = model.gyro.as_ref().filter(slow) else {
        return [unknown; 3];
    };
    let [size, time] = [gyro.size, gyro.time_s].map(|i| Found::within(Some(i), GYRO_WALK));
    let relative = libm::hypot(size.sigma / size.value, 0.5 * time.sigma / time.value);
    let walk = size.value / time.value.sqrt();
    let walk = Found::known(walk, walk * relative)
        .unless(size.missing)
        .unless(time.missing);
    match gyro.law {
        Law::Wave => [walk, unknown, unknown],
        Law::Continuous => [walk.scaled(std::f64::consts::SQRT_2), size, time],
    }
}

fn parameters(log: &Log) -> BTreeMap<String, f64> {
    let table = log.meta.document.get("parameters");
    let entries = table.and_then(toml::Value::as_table).into_iter().flatten();
    entries
        .filter_map(|(name, value)| Some((name.clone(), value.as_float()?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use indicatif::ProgressBar;

    use super::*;
    use crate::compare::measure;
    use crate::compare::tracks::{Input as Compared, Track, noise, points};
    use crate::identify::analysis::Input;
    use crate::identify::error_model::Record;
    use crate::sim::{DriveConfig, simulate};

    #[test]
    fn a_log_has_one_latency_in_all_commands() {
        let drive = DriveConfig::new(3, Grade::Hg1700, 6.0);
        let output = drive.recording.errors.imu.output;
        let mut log = simulate(&drive).into_log(BodyAxes::Rfu, output);
        for (offset_s, of_clocks_s) in [(0.75, 0.0), (-18.0, -18.0)] {
            log.meta.gnss_clock_offset_s = offset_s;
            let input = Input::of(String::new(), log.clone(), Vec::new(), None);
            let analysis = Analysis::of_input(input, &ProgressBar::hidden()).unwrap();
            let (grade, found) = (analysis.summary.grade, &analysis.found);
            let model = Identified::new(&[Record::new(&log, found)], grade, None);
            let tuning = Tuning::new(&analysis, &model);
            let input = Compared {
                log: &log,
                config: found.config,
                noise: noise(grade, &found.config, false),
                truth: None,
            };
            let track = Track {
                method: String::new(),
                online: true,
                points: points(&found.history, &found.end),
            };
            let compared = &measure::results(&input, grade, &[track])[0].quantities[7].quantity;
            let identified_ms = analysis.summary.quantities.gnss_latency_ms.value;
            assert!((compared.value - identified_ms).abs() < 1e-6);
            assert!((1e3 * tuning.gnss_delay_s.value - identified_ms).abs() < 1e-6);
            let note = (tuning.clock_offset_s, tuning.clock_note().is_some());
            assert_eq!(note, (of_clocks_s, of_clocks_s != 0.0));
        }
    }
}

//! A-priori data of core and Kalman filter; the filter has the true models of the unit and of the receiver.
//!
//! The filter has no state for misalignments, and no noise for bursts of noise, vibration or stamp jitter:
//! in kinds with these, its own error over sigma is large.

use ins_core::config::{self, HeadingSource};
use ins_core::{Config, GnssFix};
use nalgebra::Vector3;

use super::Scenario;
use crate::compare::kalman::Noise;
use crate::compare::kalman::noise::gnss_config_of_model;
use crate::identify::quantities::DEG_H_RADPS;
use crate::sim::SimulatedDrive;
use crate::sim::errors::GnssModel;
use crate::sim::receiver::{Habits, Up, Wrong};
use crate::study::estimator::config_of;

/// Prior sigma of the height of places on land, for receivers that give none, m.
const ANY_HEIGHT_M: f64 = 500.0;

/// Reading that may be clipped, over the full scale.
const CLIPPED: f64 = 0.98;
/// Prior sigma for an antenna metres away, with a preset that assumes a close one, m.
const ARM_SIGMA_M: f64 = 3.0;
/// Prior sigma of clock drift, with a preset that assumes a common clock, s/s.
const DRIFT_SIGMA: f64 = 1e-4;

/// Configuration by a user of this unit and receiver: the class of the sensors with noise and range of its data
/// sheet, content of the samples, heading if given, misalignment and g-sensitivity, and, if its preset assumes
/// otherwise, that the antenna is metres away and the clocks are separate.
pub fn config(scenario: &Scenario, drive: &SimulatedDrive) -> Config {
    let mut config = config_of(scenario.class);
    let imu = &scenario.errors.imu;
    config.imu_output = imu.output;
    if let Some(heading_rad) = drive.given_heading_rad {
        config.heading = HeadingSource::Given(heading_rad);
    }
    config.sensors.gyro_range_radps = CLIPPED * imu.gyro_range_deg_s.to_radians();
    config.sensors.accel_range_mps2 = CLIPPED * imu.accel_range_mps2;
    config.sensors.misalignment_rad = (scenario.errors.gyro_deg_h.misalignment_sigma)
        .max(scenario.errors.accel_mps2.misalignment_sigma);
    config.sensors.gyro_g_sensitivity = imu.gyro_g_sensitivity();
    if scenario.antenna_m.norm() > 0.0 {
        config.gnss.lever_arm_sigma_m = config.gnss.lever_arm_sigma_m.max(ARM_SIGMA_M);
    }
    if scenario.errors.gnss.habits.clock_drift != 0.0 {
        config.gnss.clock_drift_sigma = config.gnss.clock_drift_sigma.max(DRIFT_SIGMA);
    }
    config
}

/// The true noise; lever arm and clocks as the core is configured, latency within its true bounds if wider.
pub fn noise(scenario: &Scenario, config: &Config) -> Noise {
    let mut noise = Noise::of_model(&scenario.errors);
    let (gyro, accel) = (&scenario.errors.gyro_deg_h, &scenario.errors.accel_mps2);
    // Quantization noise is uniform over the last digit.
    let rounding = |resolution: f64| resolution / (12.0 * scenario.imu_hz).sqrt();
    let rounded = |noise: [f64; 3], resolution: f64| {
        noise.map(|white| libm::hypot(white, rounding(resolution)))
    };
    let sensors = &mut noise.sensors;
    sensors.gyro_noise = rounded(sensors.gyro_noise, gyro.resolution * DEG_H_RADPS);
    sensors.accel_noise = rounded(sensors.accel_noise, accel.resolution);
    let gnss = &mut noise.gnss;
    if !scenario.errors.gnss.habits.gives_height {
        gnss.height_m = config::Noise::white(ANY_HEIGHT_M);
    }
    gnss.latency_sigma_s = gnss.latency_sigma_s.max(config.gnss.latency_sigma_s);
    gnss.clock_drift_sigma = config.gnss.clock_drift_sigma;
    gnss.lever_arm_m = [0.0; 3];
    gnss.lever_arm_sigma_m = config.gnss.lever_arm_sigma_m;
    noise
}

/// Configuration by a user who also has the true noise of the receiver, and knows whether it smooths and
/// whether it delays velocities and positions differently.
pub fn with_receiver_noise(scenario: &Scenario, config: Config) -> Config {
    let mut gnss = gnss_config_of_model(&scenario.errors.gnss, config.gnss);
    let habits = &scenario.errors.gnss.habits;
    let smooths = habits.smoothing_s > 0.0;
    if !smooths {
        gnss.smoothing_s2 = 0.0;
    }
    if !habits.velocity_by_differences && (habits.smooths_position || !smooths) {
        gnss.position_delay_sigma_s = 0.0;
    }
    Config { gnss, ..config }
}

/// The fixes with the known effects of the receiver undone, so that their noise is that of the model:
/// smoothing is inverted; repeated and extrapolated fixes, and velocities that are differences of positions,
/// are left out; the vertical velocity has its true sign, and is missing if it is always zero.
pub fn corrected_fixes(scenario: &Scenario, drive: &SimulatedDrive) -> Vec<GnssFix> {
    let model = &scenario.errors.gnss;
    let mut last: Option<GnssFix> = None;
    let mut fixes = Vec::new();
    for fix in &drive.gnss {
        let repeated = last.map(|last| GnssFix {
            time: fix.time,
            ..last
        });
        if repeated != Some(*fix) && !is_excluded(fix, &model.habits) {
            let unsmoothed = unsmoothed(fix, last.as_ref(), model);
            fixes.extend(unsmoothed.map(|fix| measured_only(fix, &model.habits)));
            last = Some(*fix);
        }
    }
    fixes
}

/// A smoothed value lags by some epochs times its last change; `None` if the epoch before is missing.
fn unsmoothed(fix: &GnssFix, last: Option<&GnssFix>, model: &GnssModel) -> Option<GnssFix> {
    // Repeated rows and differences lag too, but not by smoothing.
    let lag_epochs = model.smoothing_epochs();
    let Some(last) = last.filter(|_| lag_epochs > 0.0) else {
        return Some(*fix);
    };
    if fix.time.seconds_since(last.time) * model.rate_hz > 1.5 {
        return None;
    }
    let ahead = |now: f64, before: f64| now + lag_epochs * (now - before);
    let mut corrected = *fix;
    if let (Some(now), Some(before)) = (&mut corrected.velocity_en_mps, last.velocity_en_mps) {
        *now += lag_epochs * (*now - before);
    }
    corrected.velocity_up_mps =
        (fix.velocity_up_mps.zip(last.velocity_up_mps)).map(|(now, before)| ahead(now, before));
    if !model.habits.smooths_position {
        return Some(corrected);
    }
    if let (Some(now), Some(before)) = (&mut corrected.position, last.position) {
        now.latitude_rad = ahead(now.latitude_rad, before.latitude_rad);
        now.longitude_rad = ahead(now.longitude_rad, before.longitude_rad);
    }
    corrected.height_m = (fix.height_m.zip(last.height_m)).map(|(now, before)| ahead(now, before));
    Some(corrected)
}

/// Whether the receiver is in static hold, coasts through a gap, or states float ambiguities.
fn is_excluded(fix: &GnssFix, habits: &Habits) -> bool {
    let static_hold = habits.holds_below_mps > 0.0
        && fix.velocity_en_mps.is_some()
        && fix.velocity_enu_mps() == Vector3::zeros();
    let mut faults = habits.troubles.iter();
    let excluded = |wrong: Wrong| matches!(wrong, Wrong::Coasting | Wrong::Float(_));
    static_hold || faults.any(|t| excluded(t.wrong) && t.contains(fix.time.as_seconds()))
}

/// Only what is measured independently, up positive.
fn measured_only(fix: GnssFix, habits: &Habits) -> GnssFix {
    let measured = !habits.velocity_by_differences;
    let velocity_up_mps = match habits.up {
        Up::Given | Up::Missing => fix.velocity_up_mps,
        Up::Zero => None,
        Up::Down => fix.velocity_up_mps.map(|up| -up),
    };
    GnssFix {
        velocity_en_mps: fix.velocity_en_mps.filter(|_| measured),
        velocity_up_mps: velocity_up_mps.filter(|_| measured),
        ..fix
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Grade;

    /// Corrected fixes of a receiver with these habits, and the fixes of one without.
    fn corrected_and_plain(change: impl Fn(&mut Scenario)) -> [Vec<GnssFix>; 2] {
        let mut scenario = Scenario::plain(Grade::Hg1700, 5, 3.0, "test");
        scenario.errors.gnss.rate_hz = 4.0;
        let plain = scenario.simulate().gnss;
        change(&mut scenario);
        [corrected_fixes(&scenario, &scenario.simulate()), plain]
    }

    fn assert_same(corrected: &[GnssFix], plain: &[GnssFix]) {
        assert_eq!(corrected.len(), plain.len());
        for (corrected, plain) in corrected.iter().zip(plain) {
            assert_eq!(corrected.time, plain.time);
            let place = |fix: &GnssFix| fix.geodetic_or(0.0).unwrap();
            let off_m = place(corrected).enu_from(&place(plain)).norm();
            // The length of a degree of longitude changes over the lag.
            assert!(off_m < 1e-3, "{off_m} m");
            let off = corrected.velocity_enu_mps() - plain.velocity_enu_mps();
            assert!(off.norm() < 1e-9, "{off}");
        }
    }

    #[test]
    fn smoothing_repetition_and_sign_are_undone() {
        let habits: [fn(&mut Habits); 4] = [
            |habits| habits.smoothing_s = 0.8,
            |habits| {
                habits.smoothing_s = 0.8;
                habits.smooths_position = false;
            },
            |habits| habits.logged_times = 3,
            |habits| habits.up = Up::Down,
        ];
        for change in habits {
            let [corrected, plain] = corrected_and_plain(|scenario| change(scenario.habits()));
            assert!(plain.len() > 700);
            assert_same(&corrected, &plain);
        }
    }

    /// The lag of smoothing does not include repeated rows, nor the half epoch of a difference.
    #[test]
    fn habits_are_undone_together() {
        let [corrected, plain] = corrected_and_plain(|scenario| {
            scenario.habits().smoothing_s = 0.8;
            scenario.habits().logged_times = 3;
            scenario.habits().up = Up::Down;
        });
        assert_same(&corrected, &plain);
        let [corrected, mut plain] = corrected_and_plain(|scenario| {
            scenario.habits().smoothing_s = 0.8;
            scenario.habits().logged_times = 2;
            scenario.habits().velocity_by_differences = true;
        });
        for fix in &mut plain {
            (fix.velocity_en_mps, fix.velocity_up_mps) = (None, None);
        }
        assert_same(&corrected, &plain);
    }

    /// Without velocities static hold cannot be detected.
    #[test]
    fn positions_without_velocity_are_not_excluded() {
        let [corrected, _] = corrected_and_plain(|scenario| {
            scenario.habits().gives_velocity = false;
            scenario.habits().holds_below_mps = 0.3;
        });
        assert!(corrected.len() > 300, "{}", corrected.len());
    }

    #[test]
    fn fixes_that_cannot_be_corrected_are_left_out() {
        let [corrected, plain] = corrected_and_plain(|scenario| {
            scenario.habits().up = Up::Zero;
            scenario.faults(&[60.0], 5.0, Wrong::Stuck);
        });
        assert!(corrected.iter().all(|fix| fix.velocity_up_mps.is_none()));
        assert_eq!(corrected.len(), plain.len() - 20);
        // After a gap the epoch before, which inverts the smoothing, is missing.
        let [corrected, plain] = corrected_and_plain(|scenario| {
            scenario.habits().smoothing_s = 0.8;
            scenario.outages(&[60.0], 5.0);
        });
        assert_eq!(corrected.len(), plain.len() - 21);
    }
}

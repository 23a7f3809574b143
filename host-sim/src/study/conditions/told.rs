//! What core and Kalman filter are told: the filter the truth of the unit and of the receiver.
//!
//! The filter has no state for misalignments, and none of its noises for bursts of noise, for vibration or
//! for stamps off their samples: where a kind has these, its own error over sigma tells.

use ins_core::config::{self, HeadingSource};
use ins_core::{Config, GnssFix};
use nalgebra::Vector3;

use super::World;
use crate::compare::kalman::Noise;
use crate::compare::kalman::noise::gnss_config_of_model;
use crate::identify::quantities::DEG_H_RADPS;
use crate::sim::SimulatedDrive;
use crate::sim::errors::GnssModel;
use crate::sim::receiver::{Habits, Up, Wrong};
use crate::study::subject::config_of;

/// Spread of the height of places on land, where no fix has one, m.
const ANY_HEIGHT_M: f64 = 500.0;

/// An antenna that is metres away: what the user of a unit whose preset takes it for close says.
const ARM_SIGMA_M: f64 = 3.0;
/// Clocks that are not one: the same of their drift, s/s.
const DRIFT_SIGMA: f64 = 1e-4;

/// What a user of this unit and receiver sets: the class of the sensors with the noise of its data
/// sheet, what samples hold, a heading if one is given, how far its axes are off, and for a class
/// that is told of neither that the antenna is some way off and that the clocks are two.
pub fn config(world: &World, drive: &SimulatedDrive) -> Config {
    let mut config = config_of(world.class);
    config.imu_output = world.errors.imu.output;
    if let Some(heading_rad) = drive.given_heading_rad {
        config.heading = HeadingSource::Given(heading_rad);
    }
    config.sensors.misalignment_rad = (world.errors.gyro_deg_h.misalignment_sigma)
        .max(world.errors.accel_mps2.misalignment_sigma);
    if world.antenna_m.norm() > 0.0 {
        config.gnss.lever_arm_sigma_m = config.gnss.lever_arm_sigma_m.max(ARM_SIGMA_M);
    }
    if world.errors.gnss.habits.clock_drift != 0.0 {
        config.gnss.clock_drift_sigma = config.gnss.clock_drift_sigma.max(DRIFT_SIGMA);
    }
    config
}

/// The true noise of all; antenna and clocks as the core is told, or as far off as they are.
pub fn noise(world: &World, config: &Config) -> Noise {
    let mut told = Noise::of_model(&world.errors);
    let (gyro, accel) = (&world.errors.gyro_deg_h, &world.errors.accel_mps2);
    // A reading rounded is one with noise, uniform over the last digit.
    let rounding = |resolution: f64| resolution / (12.0 * world.imu_hz).sqrt();
    let rounded = |noise: [f64; 3], resolution: f64| {
        noise.map(|white| libm::hypot(white, rounding(resolution)))
    };
    let sensors = &mut told.sensors;
    sensors.gyro_noise = rounded(sensors.gyro_noise, gyro.resolution * DEG_H_RADPS);
    sensors.accel_noise = rounded(sensors.accel_noise, accel.resolution);
    let gnss = &mut told.gnss;
    if !world.errors.gnss.habits.gives_height {
        gnss.height_m = config::Noise::white(ANY_HEIGHT_M);
    }
    gnss.latency_sigma_s = gnss.latency_sigma_s.max(config.gnss.latency_sigma_s);
    gnss.clock_drift_sigma = config.gnss.clock_drift_sigma;
    gnss.lever_arm_m = [0.0; 3];
    gnss.lever_arm_sigma_m = config.gnss.lever_arm_sigma_m;
    told
}

/// What the core is told of the receiver by a user who has its true noise, and knows whether it
/// smooths, and delays velocities and positions apart.
pub fn of_receiver(world: &World, config: Config) -> Config {
    let mut gnss = gnss_config_of_model(&world.errors.gnss, config.gnss);
    let habits = &world.errors.gnss.habits;
    let smooths = habits.smoothing_s > 0.0;
    if !smooths {
        gnss.smoothing_s2 = 0.0;
    }
    if !habits.velocity_by_differences && (habits.smooths_position || !smooths) {
        gnss.position_delay_sigma_s = 0.0;
    }
    Config { gnss, ..config }
}

/// The same fixes without what the receiver is known to do to them, so that their noise is that
/// of the model: smoothing undone, a fix that comes again or is made up left out, velocities that
/// only repeat positions too, the vertical velocity with its true sign or, where it is none,
/// missing.
pub fn fixes(world: &World, drive: &SimulatedDrive) -> Vec<GnssFix> {
    let model = &world.errors.gnss;
    let mut last: Option<GnssFix> = None;
    let mut told = Vec::new();
    for fix in &drive.gnss {
        let again = last.map(|last| GnssFix {
            time: fix.time,
            ..last
        });
        if again != Some(*fix) && !is_made_up(fix, &model.habits) {
            let unsmoothed = unsmoothed(fix, last.as_ref(), model);
            told.extend(unsmoothed.map(|fix| own(fix, &model.habits)));
            last = Some(*fix);
        }
    }
    told
}

/// Each smoothed value is some epochs of its last change behind; `None` where the epoch before is
/// missing.
fn unsmoothed(fix: &GnssFix, last: Option<&GnssFix>, model: &GnssModel) -> Option<GnssFix> {
    // Repeated rows and differences lag too, but not by what smoothing has kept.
    let lag_epochs = model.smoothing_epochs();
    let Some(last) = last.filter(|_| lag_epochs > 0.0) else {
        return Some(*fix);
    };
    if fix.time.seconds_since(last.time) * model.rate_hz > 1.5 {
        return None;
    }
    let ahead = |now: f64, before: f64| now + lag_epochs * (now - before);
    let mut told = *fix;
    if let (Some(now), Some(before)) = (&mut told.velocity_en_mps, last.velocity_en_mps) {
        *now += lag_epochs * (*now - before);
    }
    told.velocity_up_mps =
        (fix.velocity_up_mps.zip(last.velocity_up_mps)).map(|(now, before)| ahead(now, before));
    if !model.habits.smooths_position {
        return Some(told);
    }
    if let (Some(now), Some(before)) = (&mut told.position, last.position) {
        now.latitude_rad = ahead(now.latitude_rad, before.latitude_rad);
        now.longitude_rad = ahead(now.longitude_rad, before.longitude_rad);
    }
    told.height_m = (fix.height_m.zip(last.height_m)).map(|(now, before)| ahead(now, before));
    Some(told)
}

/// Whether the receiver holds still, bridges a hole, or says that it has no fixed ambiguities.
fn is_made_up(fix: &GnssFix, habits: &Habits) -> bool {
    let holds = habits.holds_below_mps > 0.0
        && fix.velocity_en_mps.is_some()
        && fix.velocity_enu_mps() == Vector3::zeros();
    let mut troubles = habits.troubles.iter();
    let made_up = |wrong: Wrong| matches!(wrong, Wrong::Coasting | Wrong::Float(_));
    holds || troubles.any(|t| made_up(t.wrong) && t.contains(fix.time.as_seconds()))
}

/// What is measured by itself, up positive.
fn own(fix: GnssFix, habits: &Habits) -> GnssFix {
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

    /// What the filter gets of a receiver with these habits, and what there is of one without.
    fn told_and_plain(change: impl Fn(&mut World)) -> [Vec<GnssFix>; 2] {
        let mut world = World::plain(Grade::Hg1700, 5, 3.0, "test");
        world.errors.gnss.rate_hz = 4.0;
        let plain = world.simulate().gnss;
        change(&mut world);
        [fixes(&world, &world.simulate()), plain]
    }

    fn assert_same(told: &[GnssFix], plain: &[GnssFix]) {
        assert_eq!(told.len(), plain.len());
        for (told, plain) in told.iter().zip(plain) {
            assert_eq!(told.time, plain.time);
            let place = |fix: &GnssFix| fix.geodetic_or(0.0).unwrap();
            let off_m = place(told).enu_from(&place(plain)).norm();
            // Degrees of longitude become shorter on the way of a lag.
            assert!(off_m < 1e-3, "{off_m} m");
            let off = told.velocity_enu_mps() - plain.velocity_enu_mps();
            assert!(off.norm() < 1e-9, "{off}");
        }
    }

    #[test]
    fn smoothing_repeats_and_signs_are_undone() {
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
            let [told, plain] = told_and_plain(|world| change(world.habits()));
            assert!(plain.len() > 700);
            assert_same(&told, &plain);
        }
    }

    /// The repeats of a row are no epochs of smoothing, and neither is the half one of a difference.
    #[test]
    fn habits_are_undone_together() {
        let [told, plain] = told_and_plain(|world| {
            world.habits().smoothing_s = 0.8;
            world.habits().logged_times = 3;
            world.habits().up = Up::Down;
        });
        assert_same(&told, &plain);
        let [told, mut plain] = told_and_plain(|world| {
            world.habits().smoothing_s = 0.8;
            world.habits().logged_times = 2;
            world.habits().velocity_by_differences = true;
        });
        for fix in &mut plain {
            (fix.velocity_en_mps, fix.velocity_up_mps) = (None, None);
        }
        assert_same(&told, &plain);
    }

    /// A receiver without velocities does not say when it holds still.
    #[test]
    fn positions_alone_are_not_taken_for_made_up() {
        let [told, _] = told_and_plain(|world| {
            world.habits().gives_velocity = false;
            world.habits().holds_below_mps = 0.3;
        });
        assert!(told.len() > 300, "{}", told.len());
    }

    #[test]
    fn what_cannot_be_undone_is_left_out() {
        let [told, plain] = told_and_plain(|world| {
            world.habits().up = Up::Zero;
            world.trouble(&[60.0], 5.0, Wrong::Stuck);
        });
        assert!(told.iter().all(|fix| fix.velocity_up_mps.is_none()));
        assert_eq!(told.len(), plain.len() - 20);
        // After a hole the epoch before is not there to undo smoothing by.
        let [told, plain] = told_and_plain(|world| {
            world.habits().smoothing_s = 0.8;
            world.outages(&[60.0], 5.0);
        });
        assert_eq!(told.len(), plain.len() - 21);
    }
}

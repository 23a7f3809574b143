//! Innovations: each fix against the solution at its time of validity, before the fix is used.

use std::collections::VecDeque;

use ins_core::config::Noise;
use ins_core::{GnssFix, Navigator, Phase, Solution, Time};
use nalgebra::Vector3;

use crate::identify::row::Row;

/// Longest extrapolation beyond the last solution, counted from the one before, in intervals.
const MOST_EXTRAPOLATION: f64 = 1.5;
/// Solutions further apart are not interpolated, s.
const HOLE_S: f64 = 0.5;

/// Difference of one component of a fix from the solution, and its sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// GNSS minus solution.
    pub value: f64,
    /// Sigma of the solution and noise of the fix together, as stated or configured.
    pub sigma: f64,
}

/// A fix minus the solution at its time of validity, of the antenna, east-north-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    pub time: Time,
    pub velocity_mps: [Option<Residual>; 3],
    pub position_m: [Option<Residual>; 3],
}

/// Collects innovations while a navigator runs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Innovations {
    pub(crate) found: Vec<Innovation>,
    /// Fixes whose time of validity the inertial samples have not reached.
    queued: VecDeque<GnssFix>,
}

impl Innovations {
    /// Adds a fix that the navigator has not had yet.
    pub(crate) fn queue(&mut self, fix: &GnssFix) {
        self.queued.push_back(*fix);
    }

    /// Forms the innovations of fixes that are valid before `time`, to which the navigator steps next.
    pub(crate) fn form_up_to(
        &mut self,
        time: Time,
        navigator: &Navigator,
        history: &[Row],
        past: &[Solution],
    ) {
        while let Some(fix) = self.queued.front() {
            let Some(row) = history.last().filter(|row| row.phase == Phase::Navigating) else {
                self.queued.pop_front();
                continue;
            };
            let moment = fix
                .time
                .plus_seconds(-row.estimates.gnss_latency_now_s.value);
            if moment > time {
                return;
            }
            let found = navigator
                .solution()
                .and_then(|now| Antenna::at(moment, past, &now, row))
                .map(|antenna| antenna.innovation(fix, row, navigator));
            self.found.extend(found);
            self.queued.pop_front();
        }
    }
}

/// Position and velocity of the antenna by the solution.
struct Antenna {
    position: ins_core::earth::Geodetic,
    /// Of the antenna from there, ENU.
    offset_m: Vector3<f64>,
    velocity_mps: Vector3<f64>,
}

impl Antenna {
    /// Linear between the solutions around a time, or a little beyond the last.
    fn at(moment: Time, past: &[Solution], now: &Solution, row: &Row) -> Option<Self> {
        let next = past.partition_point(|solution| solution.time <= moment);
        // The last one kept may be the present one.
        let earlier = past[..next].iter().rfind(|before| before.time < now.time);
        let (before, after) = (earlier?, past.get(next).unwrap_or(now));
        let seconds = after.time.seconds_since(before.time);
        let part = moment.seconds_since(before.time) / seconds;
        if seconds > HOLE_S || part > MOST_EXTRAPOLATION {
            return None;
        }
        let arm_m = Vector3::from(row.estimates.lever_arm_m.map(|estimate| estimate.value));
        let (arm, arm_after) = (before.attitude * arm_m, after.attitude * arm_m);
        let arm_change = arm_after - arm;
        let way = after.position.enu_from(&before.position);
        let velocity = before.velocity_enu_mps.lerp(&after.velocity_enu_mps, part);
        Some(Self {
            position: before.position,
            // Positions may have more latency than velocities.
            offset_m: part * (way + arm_change) + arm
                - row.estimates.gnss_position_delay_s.value * velocity,
            velocity_mps: velocity + arm_change / seconds,
        })
    }

    fn innovation(&self, fix: &GnssFix, row: &Row, navigator: &Navigator) -> Innovation {
        let own = row.sigma.unwrap_or_default();
        let [velocity_noise, position_noise] = noises(fix, navigator);
        Innovation {
            time: fix.time,
            velocity_mps: residuals(self.velocity_error(fix), &own.velocity_mps, velocity_noise),
            position_m: residuals(self.position_error(fix), &own.position_m, position_noise),
        }
    }

    fn velocity_error(&self, fix: &GnssFix) -> [Option<f64>; 3] {
        let level = fix.velocity_en_mps.map(|v| v - self.velocity_mps.xy());
        let up = fix.velocity_up_mps.map(|up| up - self.velocity_mps.z);
        [level.map(|v| v.x), level.map(|v| v.y), up]
    }

    fn position_error(&self, fix: &GnssFix) -> [Option<f64>; 3] {
        let height_m = self.position.height_m;
        let place = fix.geodetic_or(height_m);
        let level = place.map(|place| place.enu_from(&self.position) - self.offset_m);
        let up = fix.height_m.map(|fix_m| fix_m - height_m - self.offset_m.z);
        [level.map(|way| way.x), level.map(|way| way.y), up]
    }
}

fn residuals(raw: [Option<f64>; 3], own: &Vector3<f64>, noise: [f64; 3]) -> [Option<Residual>; 3] {
    [0, 1, 2].map(|axis| {
        let sigma = own[axis].hypot(noise[axis]);
        raw[axis].map(|value| Residual { value, sigma })
    })
}

/// One sigma of velocity and position of a fix, east-north-up: as the receiver states it or as
/// configured, of velocities with the correlated noise that the navigator has learnt.
fn noises(fix: &GnssFix, navigator: &Navigator) -> [[f64; 3]; 2] {
    let (gnss, stated) = (&navigator.config().gnss, &fix.sigma);
    let sigma = |noise: &Noise, stated: Option<f64>| {
        let scale = stated.map_or(1.0, |stated| stated / noise.white);
        scale * noise.variance().sqrt()
    };
    let learnt = navigator.velocity_noise();
    let level_mps = sigma(&learnt.unwrap_or(gnss.velocity_mps), stated.velocity_mps);
    let level_m = sigma(&gnss.position_m, stated.position_m);
    let up_mps = sigma(&gnss.velocity_up_mps, stated.velocity_up_mps);
    let up_m = sigma(&gnss.height_m, stated.height_m);
    [[level_mps, level_mps, up_mps], [level_m, level_m, up_m]]
}

//! KF-GINS text: rows of seconds of the GPS week with angles and velocities gained, front-right-
//! down; and rows of fixes with their sigmas.

use std::path::Path;

use ins_core::{GnssFix, ImuOutput, ImuSample, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Imu, Receiver, Recording, degrees, level, stated};
use super::text::{Table, cells, number};
use crate::log::{BodyAxes, LogError};

/// Seven numbers between blanks, or thirteen for fixes with velocity, and no header.
pub(super) fn recognised(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let mut rows = text.lines().take(3).map(cells);
    let fits = |row: Vec<&str>| {
        let numbers = row.iter().all(|cell| number(cell).is_finite());
        matches!(row.len(), 7 | 13) && numbers && (0.0..604_800.0).contains(&number(row[0]))
    };
    text.lines().nth(2).is_some() && !text.contains(',') && rows.all(fits)
}

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let table = Table::read(path)?;
    // A place is degrees and metres, a gain of velocity is small.
    let fixes = table.rows.first().is_some_and(|row| row.len() == 13)
        || table
            .rows
            .iter()
            .all(|row| row.get(4..7).is_some_and(|s| s.iter().all(|x| *x > 0.0)));
    if fixes {
        let fixes = table.rows.iter().filter_map(|row| fix(row)).collect();
        let receiver = Receiver::new(path, "KF-GINS", fixes);
        return Ok(Recording::of(Vec::new(), vec![receiver]));
    }
    let samples = table.rows.iter().filter_map(|row| sample(row)).collect();
    let imu = Imu {
        output: ImuOutput::Increments,
        ..Imu::of_rates(path, "KF-GINS", BodyAxes::Frd, samples)
    };
    Ok(Recording::of(vec![imu], Vec::new()))
}

fn sample(row: &[f64]) -> Option<ImuSample> {
    let [time, gx, gy, gz, ax, ay, az] = *row.first_chunk::<7>()?;
    let (gyro, accel) = (Vector3::new(gx, gy, gz), Vector3::new(ax, ay, az));
    Some(BodyAxes::Frd.sample(Time::from_seconds(time)?, gyro, accel))
}

fn fix(row: &[f64]) -> Option<GnssFix> {
    let [time, latitude, longitude, height, north, east, down] = *row.first_chunk::<7>()?;
    let mut fix = GnssFix {
        time: Time::from_seconds(time)?,
        position: degrees((latitude, longitude)),
        height_m: Some(height),
        ..GnssFix::default()
    };
    let mut sigmas = [Some(level((north, east))), Some(down), None, None];
    if let Some([vn, ve, vd, sn, se, sd]) = row.get(7..).and_then(|rest| rest.first_chunk::<6>()) {
        fix.velocity_en_mps = Some(Vector2::new(*ve, *vn));
        fix.velocity_up_mps = Some(-vd);
        [sigmas[2], sigmas[3]] = [Some(level((*sn, *se))), Some(*sd)];
    }
    fix.sigma = stated(sigmas);
    Some(fix)
}

//! RTKLIB solutions (.pos), with an inertial file beside: geodetic or geocentric, by date or week.

use std::path::Path;

use ins_core::earth::{ECCENTRICITY_SQUARED, Geodetic, LocalEarth};
use ins_core::{GnssFix, Time};

use super::recording::{Receiver, Recording, degrees, east_north, level, stated};
use super::text::{content, number};
use crate::log::LogError;

/// The line that names the columns.
pub(super) fn recognised(start: &[u8]) -> bool {
    header(&String::from_utf8_lossy(start)).is_some()
}

fn header(text: &str) -> Option<Vec<&str>> {
    let names = |line: &&str| {
        line.starts_with('%') && (line.contains("latitude(") || line.contains("x-ecef("))
    };
    let line = text.lines().find(names)?;
    Some(line.trim_start_matches('%').split_whitespace().collect())
}

const WEEK_S: f64 = 604_800.0;
/// From 1970 to the first GPS week, s.
const GPS_S: f64 = 315_964_800.0;

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let text = content(path)?;
    let names = header(&text).unwrap_or_default();
    let rows = text.lines().filter(|line| !line.starts_with('%'));
    let fixes = rows.filter_map(|row| fix(&names, row)).collect();
    let receiver = Receiver::new(path, "RTKLIB", fixes);
    Ok(Recording::of(Vec::new(), vec![receiver]))
}

fn fix(names: &[&str], row: &str) -> Option<GnssFix> {
    let cells: Vec<&str> = row
        .split([' ', ',', '\t'])
        .filter(|cell| !cell.is_empty())
        .collect();
    // The first name stands for two cells: date and time, or week and seconds.
    let cell = |name: &str| {
        let index = names.iter().position(|own| own.starts_with(name))?;
        Some(number(cells.get(index + 1)?)).filter(|value| value.is_finite())
    };
    let place = match cell("latitude(").zip(cell("longitude(")) {
        Some(place) => {
            let place = degrees(place)?;
            Geodetic {
                latitude_rad: place.latitude_rad,
                longitude_rad: place.longitude_rad,
                height_m: cell("height(")?,
            }
        }
        None => geodetic([cell("x-ecef(")?, cell("y-ecef(")?, cell("z-ecef(")?]),
    };
    let velocity = cell("ve(").zip(cell("vn("));
    let both = |a: &str, b: &str| cell(a).zip(cell(b)).map(level);
    let fix = GnssFix {
        time: time(cells.first()?, cells.get(1)?)?,
        velocity_en_mps: velocity.map(east_north),
        velocity_up_mps: cell("vu("),
        sigma: stated([
            both("sdn(", "sde("),
            cell("sdu("),
            both("sdvn", "sdve"),
            cell("sdvu"),
        ]),
        ..GnssFix::default()
    };
    Some(fix.at(&place))
}

/// Seconds since 1970 of either form; GPS time stays GPS time.
fn time(first: &str, second: &str) -> Option<Time> {
    let Some((year, rest)) = first.split_once('/') else {
        return Time::from_seconds(GPS_S + WEEK_S * number(first) + number(second));
    };
    let (month, day) = rest.split_once('/')?;
    let date = chrono::NaiveDate::from_ymd_opt(
        year.parse().ok()?,
        month.parse().ok()?,
        day.parse().ok()?,
    )?;
    let midnight_s = date.and_hms_opt(0, 0, 0)?.and_utc().timestamp() as f64;
    let mut of_day = second.split(':').map(number);
    let of_day_s = 3600.0 * of_day.next()? + 60.0 * of_day.next()? + of_day.next()?;
    Time::from_seconds(midnight_s + of_day_s)
}

/// From the Earth's centre; each step shrinks the error by the square of the eccentricity.
fn geodetic([x, y, z]: [f64; 3]) -> Geodetic {
    let level = x.hypot(y);
    let mut latitude_rad = (z / (level * (1.0 - ECCENTRICITY_SQUARED))).atan();
    let mut height_m = 0.0;
    for _ in 0..8 {
        let earth = LocalEarth::at(latitude_rad, 0.0);
        let (sin, cos) = latitude_rad.sin_cos();
        height_m =
            level * cos + z * sin - earth.east_radius_m * (1.0 - ECCENTRICITY_SQUARED * sin * sin);
        let share = earth.east_radius_m / (earth.east_radius_m + height_m);
        latitude_rad = (z / (level * (1.0 - ECCENTRICITY_SQUARED * share))).atan();
    }
    Geodetic {
        latitude_rad,
        longitude_rad: y.atan2(x),
        height_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_from_the_centre_is_that_on_the_ellipsoid() {
        let names: Vec<&str> = "GPST x-ecef(m) y-ecef(m) z-ecef(m)".split(' ').collect();
        let place = Geodetic {
            latitude_rad: 0.8,
            longitude_rad: -2.0,
            height_m: 4000.0,
        };
        let earth = LocalEarth::at(place.latitude_rad, place.height_m);
        let level = earth.east_radius_m * place.latitude_rad.cos();
        let polar = LocalEarth::at(place.latitude_rad, 0.0).east_radius_m
            * (1.0 - ECCENTRICITY_SQUARED)
            + place.height_m;
        let row = format!(
            "2244 36000.5 {} {} {}",
            level * place.longitude_rad.cos(),
            level * place.longitude_rad.sin(),
            polar * place.latitude_rad.sin()
        );
        let fix = fix(&names, &row).unwrap();
        assert_eq!(
            fix.time,
            Time::from_seconds(GPS_S + 2244.0 * WEEK_S + 36_000.5).unwrap()
        );
        let off = fix.geodetic_or(0.0).unwrap().enu_from(&place);
        assert!(off.norm() < 1e-6, "{off}");
    }

    #[test]
    fn a_date_is_seconds_since_1970() {
        let time = time("2023/01/08", "10:00:00.500").unwrap();
        assert_eq!(time, Time::from_seconds(1_673_172_000.5).unwrap());
    }
}

//! Texts of receivers, with an inertial file beside: NMEA 0183, and solutions of RTKLIB (.pos).

use std::path::Path;

use chrono::Timelike;
use ins_core::earth::{ECCENTRICITY_SQUARED, Geodetic, LocalEarth};
use ins_core::{GnssFix, Time};
use nmea::ParseResult;
use nmea::sentences::FixType;
use nmea::sentences::rmc::RmcStatusOfFix;

use super::recording::{Recording, degrees, east_north, level, over_ground, stated};
use super::texts::{content, date_and_time, number};
use crate::log::LogError;

// --- NMEA: GGA, RMC, VTG and GST of any talker ---

/// A sentence in the first bytes.
pub(super) fn is_nmea(_: &Path, start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let sentence = |line: &str| {
        let line = line.trim();
        line.starts_with('$') && line.contains(',') && line.contains('*')
    };
    text.lines().take(5).any(sentence)
}

const KNOT_MPS: f64 = 1852.0 / 3600.0;
const DAY_S: f64 = 86_400.0;

pub(super) fn read_nmea(path: &Path) -> Result<Recording, LogError> {
    let text = content(path)?;
    let mut epochs = Epochs::default();
    for line in text.lines() {
        let sentence = line.find('$').map(|at| nmea::parse_str(line[at..].trim()));
        if let Some(Ok(sentence)) = sentence {
            epochs.take(&sentence);
        }
    }
    let mut recording = Recording::default();
    recording.add_receiver(path, "NMEA", epochs.fixes);
    Ok(recording)
}

/// Sentences of one epoch put together; most have only the time of the day.
#[derive(Default)]
struct Epochs {
    fixes: Vec<GnssFix>,
    /// Midnight before the epoch, s since 1970 if a date is known.
    day_s: f64,
    last_s: Option<f64>,
}

impl Epochs {
    fn take(&mut self, sentence: &ParseResult) {
        match sentence {
            ParseResult::GGA(gga) => {
                let fixed = gga.fix_type.is_some_and(FixType::is_valid);
                let Some(fix) = self.epoch(gga.fix_time).filter(|_| fixed) else {
                    return;
                };
                fix.position = gga.latitude.zip(gga.longitude).and_then(degrees);
                // The sentence splits the height above the ellipsoid in two.
                let height = gga.altitude.map(f64::from);
                let geoid = gga.geoid_separation.map_or(0.0, f64::from);
                fix.height_m = height.map(|height| height + geoid);
            }
            ParseResult::RMC(rmc) => {
                if let Some(date) = rmc.fix_date {
                    let midnight = date.and_hms_opt(0, 0, 0);
                    let day_s = midnight.map_or(0.0, |m| m.and_utc().timestamp() as f64);
                    self.date(day_s);
                }
                let fixed = rmc.status_of_fix != RmcStatusOfFix::Invalid;
                let Some(fix) = self.epoch(rmc.fix_time).filter(|_| fixed) else {
                    return;
                };
                fix.position = fix.position.or(rmc.lat.zip(rmc.lon).and_then(degrees));
                velocity(fix, rmc.speed_over_ground, rmc.true_course);
            }
            ParseResult::VTG(vtg) => {
                if let Some(fix) = self.fixes.last_mut() {
                    velocity(fix, vtg.speed_over_ground, vtg.true_course);
                }
            }
            ParseResult::GST(gst) => {
                if let Some(fix) = self.epoch(gst.time) {
                    let sigmas = [gst.lat_sd, gst.long_sd, gst.alt_sd].map(|s| s.map(f64::from));
                    let [north, east, up] = sigmas.map(|sigma| sigma.filter(|s| *s > 0.0));
                    fix.sigma = stated([north.zip(east).map(level), up, None, None]);
                }
            }
            _ => {}
        }
    }

    /// The first date moves the fixes before it too.
    fn date(&mut self, day_s: f64) {
        if self.day_s < DAY_S {
            for fix in &mut self.fixes {
                fix.time = fix.time.plus_seconds(day_s);
            }
        } else if day_s > self.day_s {
            // The day is new already: its first time must not begin another.
            self.last_s = None;
        }
        self.day_s = day_s;
    }

    /// The fix of a time of day, begun if it is not there.
    fn epoch(&mut self, time: Option<chrono::NaiveTime>) -> Option<&mut GnssFix> {
        let time = time?;
        let nanoseconds = f64::from(time.nanosecond());
        let of_day_s = f64::from(time.num_seconds_from_midnight()) + 1e-9 * nanoseconds;
        let new_day = |last_s: f64| of_day_s < last_s - 0.5 * DAY_S;
        if self.last_s.is_some_and(new_day) {
            self.day_s += DAY_S;
        }
        if self.last_s != Some(of_day_s) {
            self.last_s = Some(of_day_s);
            self.fixes.push(GnssFix {
                time: Time::from_seconds(self.day_s + of_day_s)?,
                ..GnssFix::default()
            });
        }
        self.fixes.last_mut()
    }
}

fn velocity(fix: &mut GnssFix, speed_kn: Option<f32>, course_deg: Option<f32>) {
    let speed_mps = speed_kn.map(|speed| KNOT_MPS * f64::from(speed));
    // At rest there is no course, and none is needed.
    let course_deg = course_deg
        .map(f64::from)
        .or((speed_mps == Some(0.0)).then_some(0.0));
    let measured = speed_mps.zip(course_deg).map(over_ground);
    fix.velocity_en_mps = measured.or(fix.velocity_en_mps);
}

// --- RTKLIB: geodetic or geocentric, by date or week ---

/// The line that names the columns.
pub(super) fn is_rtklib(_: &Path, start: &[u8]) -> bool {
    header(&String::from_utf8_lossy(start)).is_some()
}

fn header(text: &str) -> Option<Vec<&str>> {
    let mut comments = text.lines().filter(|line| line.starts_with('%'));
    let line = comments.find(|line| line.contains("latitude(") || line.contains("x-ecef("))?;
    Some(line.trim_start_matches('%').split_whitespace().collect())
}

const WEEK_S: f64 = 604_800.0;
/// From 1970 to the first GPS week, s.
const GPS_S: f64 = 315_964_800.0;

pub(super) fn read_rtklib(path: &Path) -> Result<Recording, LogError> {
    let text = content(path)?;
    let names = header(&text).unwrap_or_default();
    let rows = text.lines().filter(|line| !line.starts_with('%'));
    let fixes = rows.filter_map(|row| fix(&names, row)).collect();
    let mut recording = Recording::default();
    recording.add_receiver(path, "RTKLIB", fixes);
    Ok(recording)
}

fn fix(names: &[&str], row: &str) -> Option<GnssFix> {
    let cells = row.split([' ', ',', '\t']);
    let cells: Vec<&str> = cells.filter(|cell| !cell.is_empty()).collect();
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
    if first.contains('/') {
        return date_and_time(&format!("{first} {second}"), "%Y/%m/%d %H:%M:%S%.f");
    }
    Time::from_seconds(GPS_S + WEEK_S * number(first) + number(second))
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

//! Text files of GNSS only: NMEA 0183, and solutions of RTKLIB (.pos).

use std::path::Path;

use chrono::Timelike;
use ins_core::earth::{ECCENTRICITY_SQUARED, Geodetic, LocalEarth};
use ins_core::{GnssFix, Time};
use nalgebra::{Matrix3, Vector2, Vector3};
use nmea::ParseResult;
use nmea::sentences::FixType;
use nmea::sentences::rmc::RmcStatusOfFix;

use super::recording::{
    Recording, east_north, fix_sigma, from_course, from_degrees, horizontal_sigma,
};
use super::texts::{content, date_and_time, number};
use crate::log::LogError;
use crate::log::table::Defects;
use crate::statistics::rms;

// --- NMEA: GGA, RMC, VTG and GST of any talker ---

/// A sentence in the first lines.
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
    let (mut epochs, mut damaged) = (Epochs::default(), Defects::default());
    for (number, line) in (1..).zip(text.lines()) {
        match line.find('$').map(|at| nmea::parse_str(line[at..].trim())) {
            Some(Ok(sentence)) => epochs.take(&sentence),
            Some(Err(nmea::Error::ChecksumMismatch { .. })) => {
                let cause = "bytes that were lost or damaged between receiver and file";
                let expected = "a sentence of the checksum it states";
                damaged.add(LogError::file(path, expected, "another", cause).at_line(number));
            }
            Some(Err(_)) if !line.contains('*') => {
                let cause = "cut off between receiver and file";
                let expected = "a sentence with a checksum";
                damaged.add(LogError::file(path, expected, "none", cause).at_line(number));
            }
            _ => {}
        }
    }
    let mut recording = Recording {
        notes: damaged.warning("left out").into_iter().collect(),
        ..Recording::default()
    };
    recording.add_receiver(path, "NMEA", epochs.fixes());
    Ok(recording)
}

/// Sentences merged by epoch; most have only the time of day.
#[derive(Default)]
struct Epochs {
    fixes: Vec<GnssFix>,
    /// Velocities of VTG, which has no time, with the number of preceding fixes.
    vtg: Vec<(usize, Vector2<f64>)>,
    /// Midnight of the epoch, s since 1970 if a date is known.
    day_s: f64,
    last_s: Option<f64>,
    /// The last of the fixes is invalid by its status.
    void: bool,
}

impl Epochs {
    fn take(&mut self, sentence: &ParseResult) {
        match sentence {
            ParseResult::GGA(gga) => {
                let fixed = gga.fix_type.is_some_and(FixType::is_valid);
                let Some(fix) = self.fixed(gga.fix_time, fixed) else {
                    return;
                };
                fix.position = gga.latitude.zip(gga.longitude).and_then(from_degrees);
                // Height above sea level plus geoid separation is height above the ellipsoid.
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
                let Some(fix) = self.fixed(rmc.fix_time, fixed) else {
                    return;
                };
                fix.position = fix.position.or(rmc.lat.zip(rmc.lon).and_then(from_degrees));
                let measured = velocity(rmc.speed_over_ground, rmc.true_course);
                fix.velocity_en_mps = measured.or(fix.velocity_en_mps);
            }
            ParseResult::VTG(vtg) if !self.void => {
                let measured = velocity(vtg.speed_over_ground, vtg.true_course);
                let before = self.fixes.len();
                let vtg = measured.map(|measured| (before, measured));
                self.vtg.extend(vtg);
            }
            ParseResult::GST(gst) => {
                if let Some(fix) = self.epoch(gst.time) {
                    let sigmas = [gst.lat_sd, gst.long_sd, gst.alt_sd].map(|s| s.map(f64::from));
                    let [north, east, up] = sigmas.map(|sigma| sigma.filter(|s| *s > 0.0));
                    fix.sigma = fix_sigma([north.zip(east).map(horizontal_sigma), up, None, None]);
                }
            }
            _ => {}
        }
    }

    /// All fixes, with velocities of VTG where there is none of RMC: each belongs to the preceding fix, or to
    /// the following one where positions show so.
    fn fixes(mut self) -> Vec<GnssFix> {
        let vtg_first = self.vtg_error_mps(1) < self.max_error_ratio() * self.vtg_error_mps(0);
        for (before, measured) in self.vtg {
            let index = (before + usize::from(vtg_first)).checked_sub(1);
            let fix = index.and_then(|index| self.fixes.get_mut(index));
            // Invalid fixes have no position, and get no velocity.
            if let Some(fix) = fix.filter(|fix| !vtg_first || fix.position.is_some()) {
                fix.velocity_en_mps = fix.velocity_en_mps.or(Some(measured));
            }
        }
        self.fixes
    }

    /// Largest ratio of the VTG errors with the following and the preceding fixes for VTG to belong to the
    /// following. A file that ends without a VTG lacks its last or its first: positions must show which.
    fn max_error_ratio(&self) -> f64 {
        match [self.vtg.first(), self.vtg.last()] {
            [Some((0, _)), _] => 1.0,
            [_, Some((before, _))] if *before < self.fixes.len() => 0.5,
            _ => 0.0,
        }
    }

    /// RMS difference of VTG velocities from those by positions, if they belong to the preceding fix (0) or the
    /// following (1); NaN where none has a position on both sides.
    fn vtg_error_mps(&self, after: usize) -> f64 {
        let error = |(before, measured): &(usize, Vector2<f64>)| {
            let index = (before + after).checked_sub(2)?;
            let [from, to] = [self.fixes.get(index)?, self.fixes.get(index + 2)?];
            let displacement_m = to.geodetic_or(0.0)?.enu_from(&from.geodetic_or(0.0)?).xy();
            let error = (displacement_m / to.time.seconds_since(from.time) - measured).norm();
            error.is_finite().then_some(error)
        };
        rms(self.vtg.iter().filter_map(error))
    }

    /// Sets the date; the first one also applies to the fixes before it.
    fn date(&mut self, day_s: f64) {
        if self.day_s < DAY_S {
            for fix in &mut self.fixes {
                fix.time = fix.time.plus_seconds(day_s);
            }
        } else if day_s > self.day_s {
            // The first time of the new day must not start another day.
            self.last_s = None;
        }
        self.day_s = day_s;
    }

    /// The fix at a time of day, if it is valid.
    fn fixed(&mut self, time: Option<chrono::NaiveTime>, fixed: bool) -> Option<&mut GnssFix> {
        let timed = self.epoch(time).is_some();
        self.void |= !fixed;
        self.fixes.last_mut().filter(|_| timed && fixed)
    }

    /// The fix at a time of day, a new one if needed.
    fn epoch(&mut self, time: Option<chrono::NaiveTime>) -> Option<&mut GnssFix> {
        let time = time?;
        let nanoseconds = f64::from(time.nanosecond());
        let time_of_day_s = f64::from(time.num_seconds_from_midnight()) + 1e-9 * nanoseconds;
        let new_day = |last_s: f64| time_of_day_s < last_s - 0.5 * DAY_S;
        if self.last_s.is_some_and(new_day) {
            self.day_s += DAY_S;
        }
        if self.last_s != Some(time_of_day_s) {
            self.last_s = Some(time_of_day_s);
            self.void = false;
            self.fixes.push(GnssFix {
                time: Time::from_seconds(self.day_s + time_of_day_s)?,
                ..GnssFix::default()
            });
        }
        self.fixes.last_mut()
    }
}

fn velocity(speed_kn: Option<f32>, course_deg: Option<f32>) -> Option<Vector2<f64>> {
    let speed_mps = speed_kn.map(|speed| KNOT_MPS * f64::from(speed));
    // At rest there may be no course.
    let course_deg = course_deg
        .map(f64::from)
        .or((speed_mps == Some(0.0)).then_some(0.0));
    speed_mps.zip(course_deg).map(from_course)
}

// --- RTKLIB: geodetic or ECEF, by date or GPS week ---

/// The line that names the columns.
pub(super) fn is_rtklib(_: &Path, start: &[u8]) -> bool {
    header(&String::from_utf8_lossy(start)).is_some()
}

/// A name for each cell of a row.
fn header(text: &str) -> Option<Vec<&str>> {
    let mut comments = text.lines().filter(|line| line.starts_with('%'));
    let line = comments.find(|line| line.contains("latitude(") || line.contains("x-ecef("))?;
    let names = cells(line.trim_start_matches('%')).enumerate();
    let of_each = names.flat_map(|(index, name)| {
        let count = match index {
            // Date and time, or week and seconds.
            0 => 2,
            _ if name.ends_with(SEXAGESIMAL) => 3,
            _ => 1,
        };
        std::iter::repeat_n(name, count)
    });
    Some(of_each.collect())
}

/// End of the names of angles in degrees, minutes and seconds.
const SEXAGESIMAL: &str = "(d'\")";

/// The separator is configurable.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split([' ', ',', ';', '\t'])
        .filter(|cell| !cell.is_empty())
}

const WEEK_S: f64 = 604_800.0;
/// GPS epoch, s since 1970.
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

/// Cells of a row by their names.
struct Row<'a> {
    names: &'a [&'a str],
    cells: Vec<&'a str>,
}

impl Row<'_> {
    fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|own| own.starts_with(name))
    }

    fn number(&self, index: usize) -> Option<f64> {
        Some(number(self.cells.get(index)?)).filter(|value| value.is_finite())
    }

    fn cell(&self, name: &str) -> Option<f64> {
        self.number(self.index(name)?)
    }

    fn vector(&self, names: [&str; 3]) -> Option<Vector3<f64>> {
        let [x, y, z] = names.map(|name| self.cell(name));
        Some(Vector3::new(x?, y?, z?))
    }

    /// Degrees, also from degrees, minutes and seconds.
    fn angle(&self, name: &str) -> Option<f64> {
        let index = self.index(name)?;
        let degrees = self.number(index)?;
        if !self.names[index].ends_with(SEXAGESIMAL) {
            return Some(degrees);
        }
        let (minutes, seconds) = (self.number(index + 1)?, self.number(index + 2)?);
        // -0 deg is negative, too.
        Some(degrees + (minutes / 60.0 + seconds / 3600.0).copysign(degrees))
    }

    /// Covariance in ECEF, which is stated as square roots with sign.
    fn covariance(&self, names: [&str; 6]) -> Option<Matrix3<f64>> {
        let [xx, yy, zz, xy, yz, zx] = names.map(|name| self.cell(name).map(|s| s * s.abs()));
        let (xy, yz, zx) = (xy?, yz?, zx?);
        Some(Matrix3::new(xx?, xy, zx, xy, yy?, yz, zx, yz, zz?))
    }
}

fn fix(names: &[&str], row: &str) -> Option<GnssFix> {
    let cells = cells(row).collect();
    let row = Row { names, cells };
    let fix = if row.index("x-ecef(").is_some() {
        ecef_fix(&row)
    } else {
        geodetic_fix(&row)
    };
    Some(GnssFix {
        time: time(row.cells.first()?, row.cells.get(1)?)?,
        ..fix?
    })
}

fn geodetic_fix(row: &Row) -> Option<GnssFix> {
    let position = from_degrees((row.angle("latitude(")?, row.angle("longitude(")?))?;
    let both = |a: &str, b: &str| row.cell(a).zip(row.cell(b));
    Some(GnssFix {
        position: Some(position),
        height_m: Some(row.cell("height(")?),
        velocity_en_mps: both("ve(", "vn(").map(east_north),
        velocity_up_mps: row.cell("vu("),
        sigma: fix_sigma([
            both("sdn(", "sde(").map(horizontal_sigma),
            row.cell("sdu("),
            both("sdvn", "sdve").map(horizontal_sigma),
            row.cell("sdvu"),
        ]),
        ..GnssFix::default()
    })
}

fn ecef_fix(row: &Row) -> Option<GnssFix> {
    let position = geodetic(row.vector(["x-ecef(", "y-ecef(", "z-ecef("])?);
    let to_enu = to_enu(&position);
    let velocity = row.vector(["vx(", "vy(", "vz("]).map(|v| to_enu * v);
    // Horizontal and up.
    let sigmas = |names| {
        let variances = row
            .covariance(names)
            .map(|c| (to_enu * c * to_enu.transpose()).diagonal());
        variances.map_or([None; 2], |v| {
            [0.5 * (v.x + v.y), v.z].map(|v| Some(v.sqrt()))
        })
    };
    let [horizontal, up] = sigmas(["sdx(", "sdy(", "sdz(", "sdxy(", "sdyz(", "sdzx("]);
    let [velocity_horizontal, velocity_up] =
        sigmas(["sdvx", "sdvy", "sdvz", "sdvxy", "sdvyz", "sdvzx"]);
    let fix = GnssFix {
        velocity_en_mps: velocity.map(|v| v.xy()),
        velocity_up_mps: velocity.map(|v| v.z),
        sigma: fix_sigma([horizontal, up, velocity_horizontal, velocity_up]),
        ..GnssFix::default()
    };
    Some(fix.at(&position))
}

/// From ECEF to east, north, up.
fn to_enu(position: &Geodetic) -> Matrix3<f64> {
    let (sin, cos) = position.latitude_rad.sin_cos();
    let (sin_east, cos_east) = position.longitude_rad.sin_cos();
    Matrix3::new(
        -sin_east,
        cos_east,
        0.0, //
        -sin * cos_east,
        -sin * sin_east,
        cos, //
        cos * cos_east,
        cos * sin_east,
        sin,
    )
}

/// Seconds since 1970 from date or GPS week; GPS time stays GPS time.
fn time(first: &str, second: &str) -> Option<Time> {
    if first.contains('/') {
        return date_and_time(&format!("{first} {second}"), "%Y/%m/%d %H:%M:%S%.f");
    }
    Time::from_seconds(GPS_S + WEEK_S * number(first) + number(second))
}

/// From ECEF; each iteration reduces the error by the square of the eccentricity.
fn geodetic(ecef: Vector3<f64>) -> Geodetic {
    let [x, y, z] = ecef.into();
    let equatorial_m = x.hypot(y);
    let mut latitude_rad = (z / (equatorial_m * (1.0 - ECCENTRICITY_SQUARED))).atan();
    let mut height_m = 0.0;
    for _ in 0..8 {
        let earth = LocalEarth::at(latitude_rad, 0.0);
        let (sin, cos) = latitude_rad.sin_cos();
        height_m = equatorial_m * cos + z * sin
            - earth.east_radius_m * (1.0 - ECCENTRICITY_SQUARED * sin * sin);
        let ratio = earth.east_radius_m / (earth.east_radius_m + height_m);
        latitude_rad = (z / (equatorial_m * (1.0 - ECCENTRICITY_SQUARED * ratio))).atan();
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
    fn ecef_converts_to_geodetic() {
        let names = header("% GPST x-ecef(m) y-ecef(m) z-ecef(m)").unwrap();
        let position = Geodetic {
            latitude_rad: 0.8,
            longitude_rad: -2.0,
            height_m: 4000.0,
        };
        let earth = LocalEarth::at(position.latitude_rad, position.height_m);
        let equatorial_m = earth.east_radius_m * position.latitude_rad.cos();
        let polar = LocalEarth::at(position.latitude_rad, 0.0).east_radius_m
            * (1.0 - ECCENTRICITY_SQUARED)
            + position.height_m;
        let row = format!(
            "2244 36000.5 {} {} {}",
            equatorial_m * position.longitude_rad.cos(),
            equatorial_m * position.longitude_rad.sin(),
            polar * position.latitude_rad.sin()
        );
        let fix = fix(&names, &row).unwrap();
        assert_eq!(
            fix.time,
            Time::from_seconds(GPS_S + 2244.0 * WEEK_S + 36_000.5).unwrap()
        );
        let error = fix.geodetic_or(0.0).unwrap().enu_from(&position);
        assert!(error.norm() < 1e-6, "{error}");
    }

    /// One solution as RTKLIB prints it in both forms.
    #[test]
    fn ecef_and_geodetic_solutions_agree() {
        let read = |names: &str, row: &str| fix(&header(names).unwrap(), row).unwrap();
        let ecef_solution = read(
            "% GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) \
             sdzx(m) age(s) ratio vx(m/s) vy(m/s) vz(m/s) sdvx sdvy sdvz sdvxy sdvyz sdvzx",
            "2023/01/08 10:00:00.000 -481817.9432 5507212.2485 3170368.5142 5 8 2.2007 6.7978 \
             3.4026 0.4304 3.9550 0.3408 0.00 0.0 -0.00394 -0.00927 0.00891 0.12567 0.42372 \
             0.20237 0.04010 0.25072 0.04342",
        );
        let geodetic = read(
            "% GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) \
             sdeu(m) sdun(m) age(s) ratio vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun",
            "2023/01/08 10:00:00.000 29.999994371 94.999992812 -9.3615 5 8 2.5813 2.2781 7.1259 \
             0.7786 -2.0020 -2.6572 0.00 0.0 0.01216 0.00473 -0.00324 0.14536 0.13159 0.44479 \
             0.03911 -0.13176 -0.16769",
        );
        let position = |fix: &GnssFix| fix.geodetic_or(0.0).unwrap();
        assert!(
            position(&ecef_solution)
                .enu_from(&position(&geodetic))
                .norm()
                < 1e-3
        );
        let error = ecef_solution.velocity_enu_mps() - geodetic.velocity_enu_mps();
        assert!(error.amax() < 2e-5, "{error}");
        let sigmas = |fix: &GnssFix| {
            let s = fix.sigma;
            [s.position_m, s.height_m, s.velocity_mps, s.velocity_up_mps].map(Option::unwrap)
        };
        for (a, b) in sigmas(&ecef_solution).into_iter().zip(sigmas(&geodetic)) {
            assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
        }
    }

    fn epochs(bodies: &[&str]) -> Vec<GnssFix> {
        let mut epochs = Epochs::default();
        for body in bodies {
            let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
            epochs.take(&nmea::parse_str(&format!("${body}*{sum:02X}")).unwrap());
        }
        epochs.fixes()
    }

    /// North velocities in whole knots.
    fn north_kn(bodies: &[String]) -> Vec<Option<i32>> {
        let bodies: Vec<&str> = bodies.iter().map(String::as_str).collect();
        #[allow(clippy::cast_possible_truncation)]
        let knots = |fix: &GnssFix| Some((fix.velocity_en_mps?.y / KNOT_MPS).round() as i32);
        epochs(&bodies).iter().map(knots).collect()
    }

    /// A file that begins and ends with a position is cut off at one end: positions show which.
    #[test]
    fn a_lost_vtg_shifts_no_other() {
        let knots = |second: i32| Some(10 * second);
        for lost in [0, 5] {
            let mut bodies = Vec::new();
            for second in 0..=5 {
                let minutes = 5.0 * f64::from(second * second) / 3600.0;
                let position = format!("45{minutes:010.7},N,00900.0,E");
                bodies.push(format!(
                    "GPGGA,12000{second}.00,{position},1,09,1.0,9.0,M,5.0,M,,"
                ));
                if let Some(kn) = knots(second).filter(|_| second != lost) {
                    bodies.push(format!("GPVTG,0.0,T,,M,{kn},N,,K,A"));
                    // Before its position if the first is lost.
                    let length = bodies.len();
                    bodies[length - 2..].rotate_left(usize::from(lost == 0));
                }
            }
            let expected: Vec<_> = (0..=5).map(|s| knots(s).filter(|_| s != lost)).collect();
            assert_eq!(north_kn(&bodies), expected);
        }
    }

    #[test]
    fn vtg_goes_to_the_fix_of_its_epoch() {
        let gga =
            |second| format!("GPGGA,12000{second}.00,4500.0,N,00900.0,E,1,09,1.0,9.0,M,5.0,M,,");
        let rmc = |second, status, knots| {
            format!("GPRMC,12000{second}.00,{status},4500.0,N,00900.0,E,{knots},0.0,010170,,,A")
        };
        let vtg = |knots| format!("GPVTG,0.0,T,,M,{knots},N,,K,A");
        // Sent before the other sentences of its epoch, it must not go to the previous one.
        let first = [
            vtg(1),
            rmc(1, "A", 1),
            gga(1),
            vtg(2),
            rmc(2, "A", 2),
            gga(2),
            vtg(3),
        ];
        assert_eq!(north_kn(&first), [Some(1), Some(2)]);
        let alone = [gga(1), vtg(1), gga(2), vtg(2)];
        assert_eq!(north_kn(&alone), [Some(1), Some(2)]);
        // No velocity without a valid fix.
        let void = [gga(1), vtg(1), rmc(2, "V", 2), vtg(2)];
        assert_eq!(north_kn(&void), [Some(1), None]);
    }

    #[test]
    fn a_date_is_seconds_since_1970() {
        let time = time("2023/01/08", "10:00:00.500").unwrap();
        assert_eq!(time, Time::from_seconds(1_673_172_000.5).unwrap());
    }
}

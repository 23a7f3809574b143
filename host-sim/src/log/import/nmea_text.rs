//! NMEA 0183: GGA, RMC, VTG and GST of any talker, with an inertial file beside.

use std::path::Path;

use ins_core::{GnssFix, Time};
use nmea::ParseResult;
use nmea::sentences::FixType;
use nmea::sentences::rmc::RmcStatusOfFix;

use super::recording::{Receiver, Recording, degrees, level, over_ground, stated};
use super::text::content;
use crate::log::LogError;

/// A sentence in the first bytes.
pub(super) fn recognised(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let sentence = |line: &str| {
        let line = line.trim();
        line.starts_with('$') && line.contains(',') && line.contains('*')
    };
    text.lines().take(5).any(sentence)
}

const KNOT_MPS: f64 = 1852.0 / 3600.0;
const DAY_S: f64 = 86_400.0;

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let text = content(path)?;
    let mut epochs = Epochs::default();
    for line in text.lines() {
        if let Some(result) = line
            .find('$')
            .and_then(|at| nmea::parse_str(line[at..].trim()).ok())
        {
            epochs.take(&result);
        }
    }
    let receiver = Receiver::new(path, "NMEA", epochs.fixes);
    Ok(Recording::of(Vec::new(), vec![receiver]))
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
        }
        self.day_s = day_s;
    }

    /// The fix of a time of day, begun if it is not there.
    fn epoch(&mut self, time: Option<chrono::NaiveTime>) -> Option<&mut GnssFix> {
        use chrono::Timelike;
        let time = time?;
        let of_day_s =
            f64::from(time.num_seconds_from_midnight()) + 1e-9 * f64::from(time.nanosecond());
        if self
            .last_s
            .is_some_and(|last| of_day_s < last - 0.5 * DAY_S)
        {
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

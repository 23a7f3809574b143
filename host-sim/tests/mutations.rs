//! Recorded logs with the typical mistakes of loggers, converters and users: a log accepted without a
//! warning must give the same estimates as before, and a usable log must not be rejected.
//!
//! Logs are cut to five minutes; `INS_WHOLE_LOGS=1` uses all of them. `--nocapture` prints the table.
// Casts of row numbers, and long tables of mutations.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::too_many_lines
)]

use std::collections::BTreeSet;
use std::fmt::Write as _;

use crate::corrupted::{
    Files, convert, convert_all, each_row, hold, pitch_sensors, set_line, swap_columns,
};
use host_sim::identify::analysis::{Analysis, Input};
use host_sim::identify::quantities::Quantity;
use host_sim::log::{LogError, read};
use indicatif::ProgressBar;
use rayon::prelude::*;

const LOGS: [&str; 4] = [
    "rtklibexplorer_drive_0708",
    "yk_urban_long_turn_loop_nominal_001",
    "umn_thor_flight75",
    "quad_122a",
];
/// Long enough to compare the halves.
const CUT_S: f64 = 310.0;
/// Largest difference of an estimate from the one without the mutation, in combined sigmas.
const SIGMAS: f64 = 4.5;

const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];
const LEVEL: [&str; 2] = ["ve", "vn"];
const PLACE: [&str; 2] = ["lat_deg", "lon_deg"];
const DEG: f64 = 57.295_779_513;

// --- mutations ---

struct Mutation {
    name: &'static str,
    /// Whether the log is still usable.
    usable: bool,
    apply: fn(&mut Files),
    /// Its effect on the estimates: heading, deg; accelerometers, mg; gyros, deg/h; latency, ms. NaN if
    /// unpredictable.
    effect: fn(&mut [f64; 8]),
}

impl Mutation {
    fn with_effect(self, effect: fn(&mut [f64; 8])) -> Self {
        Self { effect, ..self }
    }
}

fn usable(name: &'static str, apply: fn(&mut Files)) -> Mutation {
    let usable = true;
    let effect = |_: &mut [f64; 8]| {};
    Mutation {
        name,
        usable,
        apply,
        effect,
    }
}

fn doubtful(name: &'static str, apply: fn(&mut Files)) -> Mutation {
    Mutation {
        usable: false,
        ..usable(name, apply)
    }
}

/// Index of the row at a fraction of the text.
fn at(text: &str, part: f64) -> usize {
    (part * text.lines().count() as f64) as usize
}

/// Sets cells of the rows within a part of the text.
fn set(text: &mut String, columns: &[usize], part: [f64; 2], to: &str) {
    let [from, till] = part.map(|part| at(text, part));
    each_row(text, |index, cells| {
        for &column in columns.iter().filter(|_| (from..till).contains(&index)) {
            to.clone_into(&mut cells[column]);
        }
        true
    });
}

/// Leaves out the rows within a part of the text.
fn delete_rows(text: &mut String, part: [f64; 2]) {
    let [from, till] = part.map(|part| at(text, part));
    each_row(text, |index, _| !(from..till).contains(&index));
}

fn keep_every(text: &mut String, every: usize) {
    each_row(text, |index, _| index % every == 0);
}

fn rename(text: &mut String, from: &str, to: &str) {
    *text = text.replacen(from, to, 1);
}

fn map_lines(text: &mut String, f: impl FnMut(&str) -> String) {
    *text = text.lines().map(f).collect();
}

fn both(f: &mut Files, column: &str, by: impl Fn(f64) -> f64 + Copy) {
    convert(&mut f.imu, column, by);
    convert(&mut f.gnss, column, by);
}

fn columns_of(text: &str, names: &[&str]) -> Vec<usize> {
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column = |name: &&str| header.iter().position(|cell| cell == name).unwrap();
    names.iter().map(column).collect()
}

fn quantize(step: f64) -> impl Fn(f64) -> f64 + Copy {
    move |x| (x / step).round() * step
}

/// Noise from minus to plus one, from the row.
fn noise(row: usize) -> f64 {
    let hash = (row as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (hash >> 40) as f64 / f64::from(1 << 23) - 1.0
}

fn perturb(text: &mut String, names: &[&str], size: impl Fn(usize) -> f64) {
    for (seed, column) in columns_of(text, names).into_iter().enumerate() {
        each_row(text, |index, cells| {
            if let Ok(value) = cells[column].parse::<f64>() {
                cells[column] = (value + size(index) * noise(7 * index + seed)).to_string();
            }
            true
        });
    }
}

/// Velocity from earlier positions.
fn difference(gnss: &mut String, rows: usize) {
    let mut positions: Vec<[f64; 3]> = Vec::new();
    let columns = columns_of(gnss, &["t_s", "lat_deg", "lon_deg"]);
    let [ve, vn] = [0, 1].map(|axis| columns_of(gnss, &LEVEL)[axis]);
    each_row(gnss, |index, cells| {
        let cell = |which: usize| cells[columns[which]].parse().unwrap_or(f64::NAN);
        positions.push([cell(0), cell(1), cell(2)]);
        let [before, now] = [positions[index.saturating_sub(rows)], positions[index]];
        let metres = 6_378_137.0 / DEG / (now[0] - before[0]);
        let east = (now[2] - before[2]) * metres * (now[1] / DEG).cos();
        let north = (now[1] - before[1]) * metres;
        if index >= rows && east.is_finite() && north.is_finite() {
            cells[ve] = east.to_string();
            cells[vn] = north.to_string();
        }
        true
    });
}

/// The mean of the last seconds.
fn smooth(gnss: &mut String, seconds: f64) {
    let columns = columns_of(gnss, &["t_s", "ve", "vn"]);
    let mut rows: Vec<[f64; 3]> = Vec::new();
    each_row(gnss, |_, cells| {
        let cell = |which: usize| cells[columns[which]].parse().unwrap_or(f64::NAN);
        rows.push([cell(0), cell(1), cell(2)]);
        let since = rows[rows.len() - 1][0] - seconds;
        let recent: Vec<_> = rows.iter().rev().take_while(|row| row[0] > since).collect();
        for axis in [1, 2] {
            let mean = recent.iter().map(|row| row[axis]).sum::<f64>() / recent.len() as f64;
            if mean.is_finite() {
                cells[columns[axis]] = mean.to_string();
            }
        }
        true
    });
}

/// The same road in reverse, which contradicts the sensors.
fn reverse(gnss: &mut String) {
    let header = gnss.lines().next().unwrap().to_owned();
    let rows: Vec<Vec<String>> = gnss
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect();
    let mut text = header;
    for (row, other) in rows.iter().zip(rows.iter().rev()) {
        text += &["\n", &row[0], ",", &other[1..].join(",")].concat();
    }
    *gnss = text + "\n";
    convert_all(gnss, &["ve", "vn", "vu"], |x| -x);
}

fn negate(estimates: &mut [f64; 8], which: &[usize]) {
    for &index in which {
        estimates[index] = -estimates[index];
    }
}

fn set_unknown(estimates: &mut [f64; 8], which: &[usize]) {
    for &index in which {
        estimates[index] = f64::NAN;
    }
}

fn all_unknown(estimates: &mut [f64; 8]) {
    *estimates = [f64::NAN; 8];
}

fn file_formats() -> Vec<Mutation> {
    vec![
        usable("byte-order mark", |f| f.imu.insert(0, '\u{feff}')),
        usable("CRLF", |f| {
            f.imu = f.imu.replace('\n', "\r\n");
            f.gnss = f.gnss.replace('\n', "\r\n");
        }),
        usable("blanks around cells", |f| f.imu = f.imu.replace(',', " , ")),
        usable("columns in another order", |f| {
            swap_columns_and_names(&mut f.imu, 1, 5);
        }),
        usable("more columns", |f| {
            map_lines(&mut f.imu, |line| format!("{line},0\n"));
        }),
        usable("capital headers", |f| {
            let header = f.gnss.lines().next().unwrap().to_owned();
            rename(&mut f.gnss, &header, &header.to_uppercase());
        }),
        usable("quoted headers", |f| {
            let header = f.imu.lines().next().unwrap().to_owned();
            let quoted = format!("\"{}\"", header.replace(',', "\",\""));
            rename(&mut f.imu, &header, &quoted);
        }),
        usable("semicolons", |f| f.gnss = f.gnss.replace(',', ";")),
        usable("semicolons and decimal commas", |f| {
            f.imu = f.imu.replace(',', ";").replace('.', ",");
        }),
        usable("tabs", |f| f.imu = f.imu.replace(',', "\t")),
        usable("a separator at the end of every row", |f| {
            let mut header = true;
            map_lines(&mut f.imu, |line| {
                let end = if std::mem::take(&mut header) { "" } else { "," };
                format!("{line}{end}\n")
            });
        }),
        usable("blank lines", |f| f.gnss = f.gnss.replace('\n', "\n\n")),
        usable("a comment among the rows", |f| {
            set_line(&mut f.imu, 500, "# started logging");
        }),
        usable("a second header among the rows", |f| {
            let header = f.gnss.lines().next().unwrap().to_owned();
            set_line(&mut f.gnss, 100, &header);
        }),
        usable("frd", |f| f.meta = f.meta.replace("\"FRD\"", "\"frd\"")),
        usable("last inertial row cut off", |f| {
            f.imu.truncate(f.imu.len() - 15);
        }),
        usable("last fix cut off", |f| f.gnss.truncate(f.gnss.len() - 15)),
        usable("an inertial row twice", |f| {
            let line = f.imu.lines().nth(900).unwrap().to_owned();
            rename(&mut f.imu, &line, &format!("{line}\n{line}"));
        }),
        usable("a fix twice", |f| {
            let line = f.gnss.lines().nth(90).unwrap().to_owned();
            rename(&mut f.gnss, &line, &format!("{line}\n{line}"));
        }),
        usable("inertial rows swapped", |f| swap_lines(&mut f.imu, 1000)),
        usable("fixes swapped", |f| swap_lines(&mut f.gnss, 100)),
        usable("an empty inertial cell", |f| {
            set(&mut f.imu, &[5], [0.5, 0.5001], "");
        }),
        usable("nan in an inertial cell", |f| {
            set(&mut f.imu, &[2], [0.5, 0.5001], "nan");
        }),
        usable("4 % of inertial rows empty", |f| {
            set(&mut f.imu, &[4], [0.6, 0.64], "");
        }),
        usable("nan in fixes", |f| {
            set(&mut f.gnss, &[1, 2], [0.5, 0.51], "NaN");
        }),
        usable("text in a fix", |f| {
            set(&mut f.gnss, &[3], [0.5, 0.505], "n/a");
        }),
        usable("no heights", |f| set(&mut f.gnss, &[3], [0.0, 1.0], "")),
        usable("no column of heights", |f| rename(&mut f.gnss, "h_m", "x")),
        usable("no column of vertical velocity", |f| {
            rename(&mut f.gnss, "vu", "x");
        }),
        usable("neither of the vertical", |f| {
            rename(&mut f.gnss, "h_m,ve,vn,vu", "x,ve,vn,y");
        }),
        usable("no velocities", |f| {
            rename(&mut f.gnss, "ve,vn,vu", "x,y,z");
        }),
        doubtful("no positions", |f| {
            rename(&mut f.gnss, "lat_deg,lon_deg", "x,y");
        }),
        usable("every other velocity empty", |f| {
            let columns = columns_of(&f.gnss, &["ve", "vn", "vu"]);
            each_row(&mut f.gnss, |index, cells| {
                for &column in columns.iter().filter(|_| index % 2 == 1) {
                    cells[column].clear();
                }
                true
            });
        }),
        doubtful("two columns of one name", |f| {
            rename(&mut f.imu, "gyro_y", "gyro_x");
        }),
        doubtful("a column of another name", |f| {
            rename(&mut f.imu, "gyro_y", "wy");
        }),
        doubtful("no header", |f| delete_header(&mut f.imu)),
        doubtful("two logs joined", |f| {
            let again = f.imu.split_once('\n').unwrap().1.to_owned();
            f.imu += &again;
        }),
        usable("the first minute", |f| {
            delete_rows(&mut f.imu, [0.2, 1.0]);
            delete_rows(&mut f.gnss, [0.2, 1.0]);
        }),
        usable("the first half minute", |f| {
            delete_rows(&mut f.imu, [0.1, 1.0]);
            delete_rows(&mut f.gnss, [0.1, 1.0]);
        }),
    ]
}

fn swap_columns_and_names(text: &mut String, a: usize, b: usize) {
    let mut header: Vec<String> = text
        .lines()
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    swap_columns(text, a, b);
    header.swap(a, b);
    set_line(text, 1, &header.join(","));
}

fn swap_lines(text: &mut String, line: usize) {
    let mut lines: Vec<&str> = text.lines().collect();
    lines.swap(line, line + 1);
    *text = lines.join("\n") + "\n";
}

fn delete_header(text: &mut String) {
    *text = text.split_once('\n').unwrap().1.to_owned();
}

fn clocks() -> Vec<Mutation> {
    vec![
        usable("UNIX time", |f| both(f, "t_s", |t| t + 1_700_000_000.0)),
        usable("seconds of the week", |f| both(f, "t_s", |t| t + 345_600.5)),
        usable("week rollover", |f| {
            let first = first_time_s(&f.imu);
            both(f, "t_s", |t| (t - first + 604_650.0).rem_euclid(604_800.0));
        }),
        usable("day rollover", |f| {
            let first = first_time_s(&f.imu);
            both(f, "t_s", |t| (t - first + 86_250.0).rem_euclid(86_400.0));
        }),
        usable("fixes in GPS time, samples in UTC", |f| {
            convert(&mut f.gnss, "t_s", |t| t + 18.0);
        })
        .with_effect(|a| a[7] += 18e3),
        usable("fixes in UTC, samples in GPS time", |f| {
            convert(&mut f.gnss, "t_s", |t| t - 18.0);
        })
        .with_effect(|a| a[7] -= 18e3),
        usable("fixes 2 s late", |f| {
            convert(&mut f.gnss, "t_s", |t| t + 2.0);
        })
        .with_effect(|a| a[7] += 2e3),
        usable("fixes 3 s early", |f| {
            convert(&mut f.gnss, "t_s", |t| t - 3.0);
        })
        .with_effect(|a| a[7] -= 3e3),
        usable("fixes 90 s late", |f| {
            convert(&mut f.gnss, "t_s", |t| t + 90.0);
        })
        .with_effect(|a| a[7] += 90e3),
        usable("fixes in UNIX time, samples since boot", |f| {
            let first = first_time_s(&f.imu);
            convert(&mut f.imu, "t_s", |t| t - first);
            convert(&mut f.gnss, "t_s", |t| t - first + 1_700_000_000.0);
        })
        .with_effect(|a| a[7] += 1.7e12),
        usable("the next day", |f| {
            convert(&mut f.gnss, "t_s", |t| t + 86_400.0);
        })
        .with_effect(|a| a[7] += 86_400e3),
        doubtful("inertial time in ms", |f| {
            convert(&mut f.imu, "t_s", |t| 1e3 * t);
        }),
        doubtful("inertial time in us", |f| {
            convert(&mut f.imu, "t_s", |t| 1e6 * t);
        }),
        doubtful("all time in ms", |f| both(f, "t_s", |t| 1e3 * t)),
        doubtful("GNSS time in ms", |f| {
            convert(&mut f.gnss, "t_s", |t| 1e3 * t);
        }),
        doubtful("inertial time in minutes", |f| {
            convert(&mut f.imu, "t_s", |t| t / 60.0);
        }),
        usable("inertial stamps that jitter", |f| {
            perturb(&mut f.imu, &["t_s"], |_| 0.002);
        }),
        usable("inertial stamps to the millisecond", |f| {
            convert(&mut f.imu, "t_s", quantize(1e-3));
        }),
        doubtful("inertial stamps to the tenth", |f| {
            convert(&mut f.imu, "t_s", quantize(0.1));
        }),
        doubtful("stamps in f32 of UNIX time", |f| {
            both(f, "t_s", |t| f64::from((t + 1_700_000_000.0) as f32));
        }),
        doubtful("fixes to the whole second", |f| {
            convert(&mut f.gnss, "t_s", f64::floor);
        }),
        doubtful("a clock that is set by a second half way", |f| {
            let (half, column) = (at(&f.gnss, 0.5), 0);
            each_row(&mut f.gnss, |index, cells| {
                if index > half {
                    cells[column] = (cells[column].parse::<f64>().unwrap() + 1.0).to_string();
                }
                true
            });
        })
        .with_effect(|a| a[7] = f64::NAN),
        usable("a gap of 5 s in the samples", |f| {
            delete_rows(&mut f.imu, [0.5, 0.516]);
        }),
        usable("a gap of 30 s in the samples", |f| {
            delete_rows(&mut f.imu, [0.4, 0.5]);
        }),
        usable("an outage of a minute", |f| {
            delete_rows(&mut f.gnss, [0.4, 0.6]);
        }),
        usable("half the samples", |f| keep_every(&mut f.imu, 2)).with_effect(|a| a[7] = f64::NAN),
        usable("a third of the fixes", |f| keep_every(&mut f.gnss, 3)),
        usable("fixes every 5 s", |f| {
            let mut last = f64::MIN;
            each_row(&mut f.gnss, |_, cells| {
                let time = cells[0].parse::<f64>().unwrap();
                let due = time > last + 4.9;
                last = if due { time } else { last };
                due
            });
        }),
    ]
}

fn first_time_s(text: &str) -> f64 {
    text.lines()
        .nth(1)
        .unwrap()
        .split(',')
        .next()
        .unwrap()
        .parse()
        .unwrap()
}

fn fixes() -> Vec<Mutation> {
    vec![
        usable("rows of zeros without a fix", |f| {
            set(&mut f.gnss, &[1, 2, 3], [0.5, 0.55], "0");
        }),
        usable("each fix twice, new stamps", |f| {
            let width = f.gnss.lines().next().unwrap().split(',').count();
            hold(&mut f.gnss, 1..width, |row| row - row % 2);
        }),
        usable("each fix four times, new stamps", |f| {
            let width = f.gnss.lines().next().unwrap().split(',').count();
            hold(&mut f.gnss, 1..width, |row| row - row % 4);
        }),
        usable("positions frozen half way", |f| {
            let half = at(&f.gnss, 0.5);
            hold(&mut f.gnss, 1..4, |row| row.min(half));
        }),
        usable("everything frozen half way", |f| {
            let half = at(&f.gnss, 0.5);
            hold(&mut f.gnss, 1..7, |row| row.min(half));
        }),
        usable("velocities at half the rate", |f| {
            hold(&mut f.gnss, 4..7, |row| row - row % 2);
        }),
        usable("positions to 1e-5 deg", |f| {
            convert_all(&mut f.gnss, &PLACE, quantize(1e-5));
        }),
        doubtful("positions to 1e-4 deg", |f| {
            convert_all(&mut f.gnss, &PLACE, quantize(1e-4));
        }),
        usable("velocities to 0.1 m/s", |f| {
            convert_all(&mut f.gnss, &LEVEL, quantize(0.1));
        }),
        doubtful("velocities to 1 m/s", |f| {
            convert_all(&mut f.gnss, &LEVEL, quantize(1.0));
        }),
        usable("vertical velocity never measured", |f| {
            convert(&mut f.gnss, "vu", |_| 0.0);
        }),
        usable("vertical velocity down", |f| {
            convert(&mut f.gnss, "vu", |x| -x);
        }),
        doubtful("vertical velocity in ft/s", |f| {
            convert(&mut f.gnss, "vu", |x| x / 0.3048);
        }),
        doubtful("vertical velocity in cm/s", |f| {
            convert(&mut f.gnss, "vu", |x| x * 100.0);
        }),
        usable("velocity from positions", |f| difference(&mut f.gnss, 1)),
        doubtful("velocity from positions, over five", |f| {
            difference(&mut f.gnss, 5);
        }),
        doubtful("velocity averaged over 3 s", |f| smooth(&mut f.gnss, 3.0)),
        doubtful("velocity in knots", |f| {
            convert_all(&mut f.gnss, &LEVEL, |x| x / 0.514_444);
        }),
        doubtful("velocity in km/h", |f| {
            convert_all(&mut f.gnss, &LEVEL, |x| x * 3.6);
        }),
        doubtful("velocity in mph", |f| {
            convert_all(&mut f.gnss, &LEVEL, |x| x / 0.447_04);
        }),
        doubtful("velocity in ft/s", |f| {
            convert_all(&mut f.gnss, &LEVEL, |x| x / 0.3048);
        }),
        doubtful("velocity in cm/s", |f| {
            convert_all(&mut f.gnss, &LEVEL, |x| x * 100.0);
        }),
        doubtful("ve and vn swapped", |f| {
            swap_columns_and_names_of(&mut f.gnss, &LEVEL);
        }),
        doubtful("ve to the west", |f| convert(&mut f.gnss, "ve", |x| -x)),
        doubtful("vn to the south", |f| convert(&mut f.gnss, "vn", |x| -x)),
        doubtful("both opposite", |f| {
            convert_all(&mut f.gnss, &LEVEL, |x| -x);
        }),
        doubtful("sign of longitude lost", |f| {
            convert(&mut f.gnss, "lon_deg", |x| -x);
        }),
        doubtful("latitude and longitude swapped", |f| {
            swap_columns_and_names_of(&mut f.gnss, &PLACE);
        }),
        doubtful("positions in radians", |f| {
            convert_all(&mut f.gnss, &PLACE, |x| x / DEG);
        }),
        doubtful("positions in 1e-7 deg", |f| {
            convert_all(&mut f.gnss, &PLACE, |x| x * 1e7);
        }),
        usable("longitude from 0 to 360", |f| {
            convert(&mut f.gnss, "lon_deg", |x| x.rem_euclid(360.0));
        }),
        doubtful("heights in mm", |f| {
            convert(&mut f.gnss, "h_m", |x| x * 1e3);
        }),
        doubtful("heights in feet", |f| {
            convert(&mut f.gnss, "h_m", |x| x / 0.3048);
        }),
        usable("heights of -9999 where there are none", |f| {
            convert(&mut f.gnss, "h_m", |_| -9999.0);
        }),
        usable("heights above the sea", |f| {
            convert(&mut f.gnss, "h_m", |x| x - 42.0);
        }),
        doubtful("fixes of another drive", |f| reverse(&mut f.gnss)),
        usable("2 % of positions 100 m off", |f| {
            perturb(
                &mut f.gnss,
                &PLACE,
                |row| if row % 50 == 7 { 1e-3 } else { 0.0 },
            );
        }),
        usable("2 % of velocities off", |f| {
            perturb(
                &mut f.gnss,
                &LEVEL,
                |row| if row % 50 == 7 { 8.0 } else { 0.0 },
            );
        }),
        usable("noisier velocities", |f| {
            perturb(&mut f.gnss, &LEVEL, |_| 0.2);
        }),
    ]
}

/// Exchanges the contents of two columns.
fn swap_columns_and_names_of(text: &mut String, names: &[&str; 2]) {
    let columns = columns_of(text, names);
    swap_columns(text, columns[0], columns[1]);
}

fn sensors() -> Vec<Mutation> {
    const MG: f64 = 9.806_65e-3;
    const DEG_H: f64 = 1.0 / DEG / 3600.0;
    vec![
        usable("a spike", |f| set(&mut f.imu, &[6], [0.5, 0.5001], "-900")),
        usable("spikes of one gyro", |f| {
            each_row(&mut f.imu, |index, cells| {
                if index % 400 == 399 {
                    "60".clone_into(&mut cells[1]);
                }
                true
            });
        }),
        doubtful("gyro up clipped", |f| {
            convert(&mut f.imu, "gyro_z", |x| x.clamp(-0.2, 0.2));
        }),
        doubtful("accelerometer down clipped", |f| {
            convert(&mut f.imu, "accel_z", |x| x.max(-10.3));
        }),
        doubtful("readings written twice", |f| {
            hold(&mut f.imu, 1..7, |row| row / 2 * 2);
        }),
        doubtful("readings written five times", |f| {
            hold(&mut f.imu, 1..7, |row| row / 5 * 5);
        }),
        doubtful("all channels frozen half way", |f| {
            let half = at(&f.imu, 0.5);
            hold(&mut f.imu, 1..7, |row| row.min(half));
        }),
        doubtful("gyro up frozen half way", |f| {
            let half = at(&f.imu, 0.5);
            hold(&mut f.imu, 3..4, |row| row.min(half));
        }),
        doubtful("gyro forward frozen half way", |f| {
            let half = at(&f.imu, 0.5);
            hold(&mut f.imu, 1..2, |row| row.min(half));
        }),
        doubtful("accelerometer forward frozen half way", |f| {
            let half = at(&f.imu, 0.5);
            hold(&mut f.imu, 4..5, |row| row.min(half));
        }),
        doubtful("gyro up dead", |f| convert(&mut f.imu, "gyro_z", |_| 0.0)),
        doubtful("accelerometer forward dead", |f| {
            convert(&mut f.imu, "accel_x", |_| 0.0);
        }),
        usable("gyro up with an offset", |f| {
            convert(&mut f.imu, "gyro_z", |x| x + 200.0 * DEG_H);
        })
        .with_effect(|a| a[6] += 200.0),
        usable("accelerometer right with an offset", |f| {
            convert(&mut f.imu, "accel_y", |x| x + 5.0 * MG);
        })
        .with_effect(|a| a[2] += 5.0),
        doubtful("gyro offset beyond any class", |f| {
            convert(&mut f.imu, "gyro_z", |x| x + 0.2);
        })
        .with_effect(|a| a[6] += 0.2 / DEG_H),
        doubtful("accelerometers 7 % off", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| 1.07 * x);
        }),
        usable("noisier accelerometers", |f| {
            perturb(&mut f.imu, &ACCEL, |_| 0.2);
        }),
        usable("gyros to 0.001 rad/s", |f| {
            convert_all(&mut f.imu, &GYRO, quantize(1e-3));
        }),
        usable("accelerometers to 0.05 m/s^2", |f| {
            convert_all(&mut f.imu, &ACCEL, quantize(0.05));
        }),
        doubtful("another class of sensors", |f| {
            f.meta = f.meta.replace("[log]", "[log]\ngrade = \"hg1700\"");
        }),
        doubtful("gyros in deg/s", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * DEG);
        }),
        doubtful("gyros in mdeg/s", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * DEG * 1e3);
        }),
        doubtful("gyros in deg/h", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x / DEG_H);
        }),
        doubtful("gyros in mrad/s", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * 1e3);
        }),
        doubtful("gyros converted twice", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x / DEG);
        }),
        doubtful("accelerometers in g", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x / 9.80665);
        }),
        doubtful("accelerometers in mg", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x / MG);
        }),
        doubtful("accelerometers in ft/s^2", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x / 0.3048);
        }),
        doubtful("accelerometers in mm/s^2", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x * 1e3);
        }),
        usable("increments that are said to be", |f| {
            increments(f, [GYRO, ACCEL].concat().as_slice());
            f.meta = f.meta.replace("\"rates\"", "\"increments\"");
        }),
        doubtful("increments called rates", |f| {
            increments(f, [GYRO, ACCEL].concat().as_slice());
        }),
        doubtful("rates called increments", |f| {
            f.meta = f.meta.replace("\"rates\"", "\"increments\"");
        }),
        doubtful("increments of the gyros only", |f| increments(f, &GYRO)),
    ]
}

fn increments(f: &mut Files, names: &[&str]) {
    let columns = columns_of(&f.imu, names);
    let mut last = None;
    each_row(&mut f.imu, |_, cells| {
        let time = cells[0].parse::<f64>().unwrap();
        let interval = last.map_or(0.01, |last| time - last);
        last = Some(time);
        for &column in &columns {
            if let Ok(rate) = cells[column].parse::<f64>() {
                cells[column] = (rate * interval).to_string();
            }
        }
        true
    });
}

fn axes() -> Vec<Mutation> {
    const ACROSS: [&str; 4] = ["gyro_y", "gyro_z", "accel_y", "accel_z"];
    const LEVEL_AXES: [&str; 4] = ["gyro_x", "gyro_y", "accel_x", "accel_y"];
    vec![
        usable("FLU", |f| {
            convert_all(&mut f.imu, &ACROSS, |x| -x);
            f.meta = f.meta.replace("\"FRD\"", "\"FLU\"");
        })
        .with_effect(|a| {
            negate(a, &[2, 3, 5, 6]);
        }),
        usable("RFU", |f| {
            swap_columns(&mut f.imu, 1, 2);
            swap_columns(&mut f.imu, 4, 5);
            convert_all(&mut f.imu, &["gyro_z", "accel_z"], |x| -x);
            f.meta = f.meta.replace("\"FRD\"", "\"RFU\"");
        })
        .with_effect(|a| {
            a.swap(1, 2);
            a.swap(4, 5);
            (a[3], a[6]) = (-a[3], -a[6]);
        }),
        doubtful("FRD called RFU", |f| {
            f.meta = f.meta.replace("\"FRD\"", "\"RFU\"");
        }),
        doubtful("FRD called FLU", |f| {
            f.meta = f.meta.replace("\"FRD\"", "\"FLU\"");
        }),
        doubtful("FLU called FRD", |f| {
            convert_all(&mut f.imu, &ACROSS, |x| -x);
        }),
        doubtful("FLU called RFU", |f| {
            convert_all(&mut f.imu, &ACROSS, |x| -x);
            f.meta = f.meta.replace("\"FRD\"", "\"RFU\"");
        })
        .with_effect(|a| {
            // Equivalent to another mounting if the vehicle's axis need not follow the track.
            a[0] -= 90.0;
            negate(a, &[2, 3, 5, 6]);
        }),
        usable("mounted backwards", |f| {
            convert_all(&mut f.imu, &LEVEL_AXES, |x| -x);
        })
        .with_effect(|a| {
            a[0] += 180.0;
            negate(a, &[1, 2, 4, 5]);
        }),
        usable("mounted across", |f| {
            swap_columns(&mut f.imu, 1, 2);
            swap_columns(&mut f.imu, 4, 5);
            convert_all(&mut f.imu, &["gyro_x", "accel_x"], |x| -x);
        })
        .with_effect(|a| {
            a[0] -= 90.0;
            a.swap(1, 2);
            a.swap(4, 5);
            (a[1], a[4]) = (-a[1], -a[4]);
        }),
        usable("mounted 25 deg nose-down", |f| {
            pitch_sensors(&mut f.imu, 25.0);
        })
        .with_effect(|a| {
            set_unknown(a, &[1, 3, 4, 6]);
        }),
        usable("mounted 40 deg nose-down", |f| {
            pitch_sensors(&mut f.imu, 40.0);
        })
        .with_effect(|a| {
            set_unknown(a, &[1, 3, 4, 6]);
        }),
        doubtful("mounted on its nose", |f| pitch_sensors(&mut f.imu, 90.0))
            .with_effect(all_unknown),
        doubtful("upside down", |f| convert_all(&mut f.imu, &ACROSS, |x| -x))
            .with_effect(all_unknown),
        doubtful("columns of gyros in another order", |f| {
            swap_columns(&mut f.imu, 1, 2);
            swap_columns(&mut f.imu, 2, 3);
        }),
        doubtful("gyros x and y swapped", |f| swap_columns(&mut f.imu, 1, 2)),
        doubtful("accelerometers x and y swapped", |f| {
            swap_columns(&mut f.imu, 4, 5);
        }),
        doubtful("accelerometer x of the wrong sign", |f| {
            convert(&mut f.imu, "accel_x", |x| -x);
        })
        .with_effect(|a| negate(a, &[1])),
        doubtful("accelerometer y of the wrong sign", |f| {
            convert(&mut f.imu, "accel_y", |x| -x);
        })
        .with_effect(|a| negate(a, &[2])),
        doubtful("accelerometer z of the wrong sign", |f| {
            convert(&mut f.imu, "accel_z", |x| -x);
        })
        .with_effect(|a| negate(a, &[3])),
        doubtful("gyro x of the wrong sign", |f| {
            convert(&mut f.imu, "gyro_x", |x| -x);
        })
        .with_effect(|a| negate(a, &[4])),
        doubtful("gyro y of the wrong sign", |f| {
            convert(&mut f.imu, "gyro_y", |x| -x);
        })
        .with_effect(|a| negate(a, &[5])),
        doubtful("gyro z of the wrong sign", |f| {
            convert(&mut f.imu, "gyro_z", |x| -x);
        })
        .with_effect(|a| negate(a, &[6])),
        doubtful("all gyros of the wrong sign", |f| {
            convert_all(&mut f.imu, &GYRO, |x| -x);
        })
        .with_effect(|a| negate(a, &[4, 5, 6])),
        doubtful("all accelerometers of the wrong sign", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| -x);
        })
        .with_effect(|a| negate(a, &[1, 2, 3])),
    ]
}

// --- outcomes ---

/// Result for a log.
struct LogResult {
    estimates: [Quantity; 8],
    warnings: BTreeSet<String>,
}

fn result_of(files: &Files) -> Result<LogResult, LogError> {
    let folder = tempfile::tempdir().unwrap();
    files.write_to(folder.path());
    let (log, warnings) = read(folder.path())?;
    let texts = warnings
        .iter()
        .map(|w| format!("{}: {}", w.expected, w.cause));
    let texts: Vec<String> = texts.collect();
    let input = Input::of(String::new(), log, warnings, None);
    let summary = Analysis::of_input(input, &ProgressBar::hidden())
        .unwrap()
        .summary;
    let mut estimates = summary.quantities.columns().map(|(_, quantity)| quantity);
    estimates[0] = summary.heading_end_deg;
    // Kind of the warning, without its numbers.
    let kind = |text: &String| {
        text.chars()
            .filter(|c| c.is_alphabetic() || *c == '_')
            .collect()
    };
    let warnings = texts
        .iter()
        .chain(&summary.verdict.against)
        .map(kind)
        .collect();
    Ok(LogResult {
        estimates,
        warnings,
    })
}

#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    Same,
    Warned,
    Refused,
    /// Other estimates without a warning: the largest difference, in sigmas, and which.
    Silent(f64, usize),
    /// A usable log rejected.
    Lost,
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Same => f.pad("same"),
            Self::Warned => f.pad("warned"),
            Self::Refused => f.pad("refused"),
            Self::Silent(sigmas, which) => f.pad(&format!("SILENT {sigmas:.0} {which}")),
            Self::Lost => f.pad("LOST"),
        }
    }
}

fn outcome(mutation: &Mutation, files: &Files, before: &LogResult) -> Outcome {
    let mut files = files.clone();
    (mutation.apply)(&mut files);
    let now = match result_of(&files) {
        Ok(now) => now,
        Err(error) => {
            if mutation.usable {
                println!("{}: {error}\n  {}", mutation.name, error.cause);
                return Outcome::Lost;
            }
            return Outcome::Refused;
        }
    };
    let mut expected = before.estimates.map(|quantity| quantity.value);
    (mutation.effect)(&mut expected);
    let observable = (0..8)
        .filter(|&index| now.estimates[index].observable() && before.estimates[index].observable());
    let sigmas = observable.map(|index| {
        let mut difference = now.estimates[index].value - expected[index];
        if index == 0 {
            difference = (difference + 180.0).rem_euclid(360.0) - 180.0;
        }
        (
            difference.abs()
                / now.estimates[index]
                    .sigma
                    .hypot(before.estimates[index].sigma),
            index,
        )
    });
    let exceeding = sigmas.filter(|(sigmas, _)| *sigmas > SIGMAS);
    match exceeding.max_by(|a, b| a.0.total_cmp(&b.0)) {
        _ if !now.warnings.is_subset(&before.warnings) => Outcome::Warned,
        Some((sigmas, which)) => Outcome::Silent(sigmas, which),
        None => Outcome::Same,
    }
}

fn cut(mut files: Files) -> Files {
    if std::env::var_os("INS_WHOLE_LOGS").is_none() {
        let end = first_time_s(&files.imu) + CUT_S;
        let early = |cells: &Vec<String>| cells[0].parse::<f64>().unwrap() < end;
        each_row(&mut files.imu, |_, cells| early(cells));
        each_row(&mut files.gnss, |_, cells| early(cells));
    }
    files
}

#[test]
fn no_silent_change_of_estimates_and_no_usable_log_rejected() {
    let mutations: Vec<Mutation> = [file_formats(), clocks(), fixes(), sensors(), axes()]
        .into_iter()
        .flatten()
        .collect();
    assert!(mutations.len() >= 100);
    let mut table: Vec<String> = mutations.iter().map(|m| format!("{:42}", m.name)).collect();
    let mut counts = [0; 3];
    let mut failures = Vec::new();
    for name in LOGS {
        let Some(files) = Files::recorded(name).map(cut) else {
            continue;
        };
        let before = result_of(&files).unwrap();
        let outcomes: Vec<Outcome> = mutations
            .par_iter()
            .map(|mutation| outcome(mutation, &files, &before))
            .collect();
        for ((line, outcome), mutation) in table.iter_mut().zip(outcomes).zip(&mutations) {
            write!(line, " {outcome:14}").unwrap();
            match outcome {
                Outcome::Same => counts[0] += 1,
                Outcome::Warned => counts[1] += 1,
                Outcome::Refused => counts[2] += 1,
                _ => failures.push(format!("{name}: {}", mutation.name)),
            }
        }
    }
    println!("{}\n", table.join("\n"));
    println!(
        "{} mutations; same, warned, refused: {counts:?}",
        mutations.len()
    );
    assert!(failures.is_empty(), "{failures:#?}");
}

//! Defects of logs, and their messages.
//!
//! The messages are in `log_defects.txt`; `INS_BLESS=1 cargo test` rewrites it.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::write::GzEncoder;
use host_sim::log::{LogError, read};

use crate::corrupted::{
    Files, convert, convert_all, each_row, hold, pitch_sensors, set_line, swap_columns,
};

const META: &str = "name = \"test drive\"\n\n[log]\nbody_axes = \"FRD\"\nimu = \"rates\"\n";
const IMU_STEP_S: f64 = 0.02;
const SPEED_MPS: f64 = 10.0;

/// A car at constant speed on a winding level road for two minutes, 50 Hz and 5 Hz.
fn drive() -> Files {
    log_of(&Motion::default())
}

/// Motion of a vehicle over time; speeds are relative to 10 m/s.
struct Motion {
    turn_radps: fn(f64) -> f64,
    speed_change_mps: fn(f64) -> f64,
    up_mps: fn(f64) -> f64,
    pitch_rad: fn(f64) -> f64,
    /// Right side up, about a point `PENDULUM_M` above.
    swing_rad: fn(f64) -> f64,
}

const PENDULUM_M: f64 = 3.0;

impl Default for Motion {
    fn default() -> Self {
        Self {
            turn_radps: |t| 0.2 * (0.13 * t).sin() + 0.15 * (0.031 * t * t / 4.0).cos(),
            speed_change_mps: |_| 0.0,
            up_mps: |_| 0.0,
            pitch_rad: |_| 0.0,
            swing_rad: |_| 0.0,
        }
    }
}

/// The same road with hills, braking and acceleration.
fn hills() -> Files {
    log_of(&Motion {
        speed_change_mps: |t| 4.0 * (0.35 * t).sin() + (0.21 * t).sin(),
        up_mps: |t| 1.5 * (0.05 * t).cos(),
        ..Motion::default()
    })
}

/// A boat that pitches.
fn swell() -> Files {
    log_of(&Motion {
        pitch_rad: |t| 0.2 * (0.9 * t).sin() + 0.1 * (0.7 * t).sin(),
        ..Motion::default()
    })
}

/// A load under a parachute that swings sideways and does not turn into its course.
fn canopy() -> Files {
    log_of(&Motion {
        turn_radps: |t| 0.02 * (7.0 * t).sin(),
        speed_change_mps: |t| 1.5 * (0.9 * t).sin() + (0.23 * t).sin() - 3.0,
        up_mps: |t| 0.3 * (0.1 * t).sin() - 6.0,
        pitch_rad: |t| 0.02 * (1.1 * t).sin(),
        swing_rad: |t| 0.17 * (1.57 * t).sin() + 0.05 * (1.3 * t + 1.0).sin(),
    })
}

/// Manoeuvres that repeat every 16.5 s.
fn laps() -> Files {
    log_of(&Motion {
        turn_radps: |t| 0.3 * (TAU * t / 16.5).sin(),
        speed_change_mps: |t| 2.0 * (TAU * t / 16.5).cos(),
        ..Motion::default()
    })
}

/// The same every 5.25 s.
fn small_laps() -> Files {
    log_of(&Motion {
        turn_radps: |t| 0.3 * (TAU * t / 5.25).sin(),
        speed_change_mps: |t| 2.0 * (TAU * t / 5.25).cos(),
        ..Motion::default()
    })
}

/// Makes the samples 100 Hz.
fn to_100_hz(files: &mut Files) {
    convert(&mut files.imu, "t_s", |x| x / 2.0);
    convert(&mut files.gnss, "t_s", |x| x / 2.0);
}

/// Log of a motion.
fn log_of(motion: &Motion) -> Files {
    let derivative = |f: fn(f64) -> f64, t: f64| (f(t + 0.01) - f(t - 0.01)) / 0.02;
    let Motion {
        turn_radps,
        speed_change_mps,
        up_mps,
        pitch_rad,
        swing_rad,
    } = *motion;
    let across = |t: f64| PENDULUM_M * derivative(swing_rad, t);
    let mut height_m = 200.0;
    let mut imu = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n".to_owned();
    let mut gnss = "t_s,lat_deg,lon_deg,h_m,ve,vn,vu\n".to_owned();
    let (mut course, mut east_m, mut north_m) = (0.4_f64, 0.0, 0.0);
    for step in 0..6000_i32 {
        let time = f64::from(step) * IMU_STEP_S;
        let rate = turn_radps(time);
        let (speed, up) = (SPEED_MPS + speed_change_mps(time), up_mps(time));
        let (east, north) = course.sin_cos();
        let ve = speed * east + across(time) * north;
        let vn = speed * north - across(time) * east;
        let right_mps2 = speed * rate + (across(time + 0.01) - across(time - 0.01)) / 0.02;
        let (sin_swing, cos_swing) = swing_rad(time).sin_cos();
        let (sin, cos) = pitch_rad(time).sin_cos();
        writeln!(
            imu,
            "{time:.3},{:.3},{:.5},{rate:.6},{:.5},{:.5},{:.5}",
            0.001 - derivative(swing_rad, time),
            derivative(pitch_rad, time) - 0.002,
            0.05 + derivative(speed_change_mps, time) + 9.81 * sin,
            right_mps2 * cos_swing + 9.81 * sin_swing,
            -9.81 * cos * cos_swing - derivative(up_mps, time) + right_mps2 * sin_swing,
        )
        .unwrap();
        if step % 10 == 0 {
            // Metres per degree at 45 degrees north.
            let (lat, lon) = (45.0 + north_m / 111_130.0, 9.0 + east_m / 78_850.0);
            writeln!(
                gnss,
                "{time:.3},{lat:.9},{lon:.9},{height_m:.2},{ve:.4},{vn:.4},{up:.3}"
            )
            .unwrap();
        }
        east_m += ve * IMU_STEP_S;
        north_m += vn * IMU_STEP_S;
        height_m += up * IMU_STEP_S;
        course += rate * IMU_STEP_S;
    }
    Files {
        imu,
        gnss,
        meta: META.to_owned(),
    }
}

const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];

fn message_of(error: &LogError, folder: &Path) -> String {
    let text = format!("{error}\n-> {}", error.cause);
    text.replace(&format!("{}/", folder.display()), "")
        .replace(&folder.display().to_string(), "LOG")
}

/// Messages for a log: the error, or else all warnings.
fn messages_of(case: &Case) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut files = (case.base)();
    match case.modify {
        Modification::Text(modify) => {
            modify(&mut files);
            files.write_to(folder.path());
        }
        Modification::Folder(modify) => {
            files.write_to(folder.path());
            modify(folder.path());
        }
        Modification::Barometer(read) => {
            files.write_to(folder.path());
            let rows = files.gnss.lines().skip(1).map(|line| {
                let cell = |at: usize| line.split(',').nth(at).unwrap().parse().unwrap();
                let (time_s, height_m) = read(cell(0), cell(3));
                format!("{time_s:.3},{height_m:.3}\n")
            });
            let table = format!("t_s,h_m\n{}", rows.collect::<String>());
            fs::write(folder.path().join("baro.csv"), table).unwrap();
        }
    }
    let path = match case.within {
        "" => folder.path().to_owned(),
        within => folder.path().join(within),
    };
    match read(&path) {
        Err(error) => message_of(&error, folder.path()),
        Ok((_, warnings)) if warnings.is_empty() => "no message".to_owned(),
        Ok((_, warnings)) => {
            let message_of = warnings.iter().map(|warning| {
                let kind = if warning.doubt { "doubt" } else { "warning" };
                format!("{kind}: {}", message_of(warning, folder.path()))
            });
            message_of.collect::<Vec<_>>().join("\n")
        }
    }
}

enum Modification {
    Text(fn(&mut Files)),
    Folder(fn(&Path)),
    Barometer(fn(f64, f64) -> (f64, f64)),
}

struct Case {
    name: &'static str,
    /// Path to be read, relative to the folder.
    within: &'static str,
    base: fn() -> Files,
    modify: Modification,
}

fn text(name: &'static str, modify: fn(&mut Files)) -> Case {
    Case {
        name,
        within: "",
        base: drive,
        modify: Modification::Text(modify),
    }
}

fn folder(name: &'static str, modify: fn(&Path)) -> Case {
    Case {
        name,
        within: "",
        base: drive,
        modify: Modification::Folder(modify),
    }
}

/// A barometer on the hills: its time and height from the true ones.
fn barometer(name: &'static str, read: fn(f64, f64) -> (f64, f64)) -> Case {
    let modify = Modification::Barometer(read);
    Case {
        base: hills,
        modify,
        ..text(name, |_| {})
    }
}

fn file_cases() -> Vec<Case> {
    vec![
        text("nothing wrong", |_| {}),
        Case {
            within: "nowhere",
            ..text("no such folder", |_| {})
        },
        Case {
            within: "imu.csv",
            ..text("a file for a folder", |_| {})
        },
        folder("no imu.csv", |f| {
            fs::remove_file(f.join("imu.csv")).unwrap();
        }),
        folder("no log", |f| {
            fs::remove_file(f.join("imu.csv")).unwrap();
            fs::remove_file(f.join("meta.toml")).unwrap();
        }),
        folder("imu.csv twice", |f| {
            fs::write(f.join("imu.csv.gz"), "").unwrap();
        }),
        folder("empty imu.csv", |f| {
            fs::write(f.join("imu.csv"), "").unwrap();
        }),
        text("header alone", |f| {
            f.gnss.truncate(f.gnss.find('\n').unwrap() + 1);
        }),
        text("fixes of the first fifty seconds alone", |f| {
            each_row(&mut f.gnss, |row, _| row < 250);
        }),
        folder("gzip cut short", |f| {
            pack_imu(f, |bytes| bytes.truncate(bytes.len() / 2));
        }),
        folder("gzip damaged", |f| {
            pack_imu(f, |bytes| {
                let middle = bytes.len() / 2;
                bytes[middle..middle + 50].fill(0xff);
            });
        }),
        folder("UTF-16", |f| {
            let text: Vec<u8> = drive()
                .imu
                .encode_utf16()
                .flat_map(u16::to_le_bytes)
                .collect();
            fs::write(f.join("imu.csv"), [&[0xff, 0xfe], text.as_slice()].concat()).unwrap();
        }),
        folder("one byte of another encoding", |f| {
            let mut bytes = drive().gnss.into_bytes();
            let last = bytes.len() - 2;
            bytes[last] = 0xb0;
            fs::write(f.join("gnss.csv"), bytes).unwrap();
        }),
        text("absurdly long line", |f| {
            set_line(&mut f.imu, 100, &"1".repeat(50_000_000));
        }),
        folder("truth.csv of another time", |f| {
            let header = "t_s,lat_deg,lon_deg,h_m,ve,vn,vu,roll_deg,pitch_deg,heading_deg";
            let rows = "1000,45,9,200,4,9,0,0,0,23\n1001,45,9,200,4,9,0,0,0,23";
            fs::write(f.join("truth.csv"), format!("{header}\n{rows}\n")).unwrap();
        }),
        barometer("baro.csv", |t_s, height_m| (t_s, height_m - 40.0)),
        barometer("baro.csv of another time", |t_s, height_m| {
            (t_s + 5000.0, height_m)
        }),
        barometer("baro.csv in feet", |t_s, height_m| (t_s, height_m / 0.3048)),
        barometer("baro.csv of pressures in hPa", |t_s, height_m| {
            (t_s, 1013.25 * (1.0 - height_m / 44_330.0).powf(5.255))
        }),
        text("line ends lost", |f| f.imu = f.imu.replace('\n', " ")),
    ]
}

fn meta_cases() -> Vec<Case> {
    vec![
        folder("no meta.toml", |f| {
            fs::remove_file(f.join("meta.toml")).unwrap();
        }),
        text("meta.toml that is no TOML", |f| {
            f.meta = META.replace("\"FRD\"", "FRD");
        }),
        text("no [log]", |f| {
            f.meta = META.replace("[log]", "[recording]");
        }),
        text("no body_axes", |f| {
            f.meta = META.replace("body_axes = \"FRD\"\n", "");
        }),
        text("unknown axes", |f| f.meta = META.replace("FRD", "NED")),
        text("unknown output", |f| f.meta = META.replace("rates", "rate")),
        text("unknown grade", |f| {
            f.meta.push_str("grade = \"navigation\"\n");
        }),
        text("heading as text", |f| {
            f.meta.push_str("initial_heading_deg = \"north\"\n");
        }),
        text("heading out of range", |f| {
            f.meta.push_str("initial_heading_deg = 900\n");
        }),
        text("lever arm in millimetres", |f| {
            f.meta.push_str("lever_arm_m = [0, 1200, 800]\n");
        }),
        text("clocks an infinity apart", |f| {
            f.meta.push_str("gnss_clock_offset_s = inf\n");
        }),
        text("clocks thirty years apart", |f| {
            f.meta.push_str("gnss_clock_offset_s = 1e9\n");
        }),
        text("a key that is not read", |f| {
            f.meta.push_str("heading_deg = 12.0\n");
        }),
    ]
}

/// Adds a column of stated position sigmas.
fn add_stated_sigma(files: &mut Files, cell: &str) {
    each_row(&mut files.gnss, |_, cells| {
        cells.push(cell.to_owned());
        true
    });
    files.gnss = files.gnss.replacen(",vu\n", ",vu,sd_n\n", 1);
}

fn row_cases() -> Vec<Case> {
    vec![
        text("not a number", |f| {
            set_line(&mut f.imu, 5, "0.06,0,0,abc,0,0,-9.8");
        }),
        text("NaN", |f| set_line(&mut f.imu, 5, "0.06,0,0,0,nan,0,-9.8")),
        text("infinite", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,9,200,-inf,0,0");
        }),
        text("empty cell", |f| {
            set_line(&mut f.imu, 5, "0.06,0,0,0,0,,-9.8");
        }),
        text("no height", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,9,,10,0,0");
        }),
        text("no heights", |f| f.gnss = f.gnss.replace(",200.00,", ",,")),
        text("no column of heights", |f| {
            f.gnss = f.gnss.replace("h_m", "alt");
        }),
        text("no column of vertical velocity", |f| {
            f.gnss = f.gnss.replace("vu", "up");
        }),
        text("no columns of velocity", |f| {
            f.gnss = f.gnss.replace("ve,vn", "speed,course");
        }),
        text("no columns of position", |f| {
            f.gnss = f.gnss.replace("lat_deg,lon_deg", "x,y");
        }),
        text("neither", |f| {
            f.gnss = f
                .gnss
                .replace("lat_deg,lon_deg,h_m,ve,vn,vu", "a,b,c,d,e,f");
        }),
        text("half a position", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,,200,10,0,0");
        }),
        text("one fix, before the samples", |f| {
            f.gnss = f.gnss.lines().take(2).collect::<Vec<_>>().join("\n");
            f.gnss = f.gnss.replace("\n0.000,", "\n-3.000,");
        }),
        text("one increment alone", |f| {
            f.imu = f.imu.lines().take(2).collect::<Vec<_>>().join("\n");
            f.meta = f.meta.replace("rates", "increments");
        }),
        text("spreads below zero", |f| add_stated_sigma(f, "-0.8")),
        text("spreads in millimetres", |f| add_stated_sigma(f, "860")),
        text("nan in fixes", |f| {
            set_line(&mut f.gnss, 5, "0.6,nan,nan,nan,nan,nan,nan");
        }),
    ]
}

/// Lines are numbered as in an editor.
fn line_cases() -> Vec<Case> {
    vec![
        text("a damaged line of CRLF", |f| {
            set_line(&mut f.imu, 100, "x");
            f.imu = f.imu.replace('\n', "\r\n");
        }),
        text("a damaged line after blank ones", |f| {
            set_line(&mut f.gnss, 100, "x");
            f.gnss = f.gnss.replacen('\n', "\n\n\n", 1);
        }),
    ]
}

fn form_cases() -> Vec<Case> {
    vec![
        text("lower-case axes", |f| f.meta = META.replace("FRD", "frd")),
        text("capital headers", |f| {
            f.imu = f.imu.replacen("t_s,gyro_x,gyro_y", "T_s,Gyro_X,GYRO_Y", 1);
        }),
        text("remarks before the header", |f| {
            f.imu.insert_str(0, "# logger 7, of 2026\n# at 50 Hz\n");
        }),
        text("a header that looks like a remark", |f| {
            f.imu = format!("# logger 7, of 2026\n# {}", f.imu.replace(',', ";"));
        }),
        text("quoted headers", |f| {
            let header = f.imu.lines().next().unwrap().to_owned();
            f.imu = f
                .imu
                .replacen(&header, &format!("\"{}\"", header.replace(',', "\",\"")), 1);
        }),
        text("tabs", |f| f.gnss = f.gnss.replace(',', "\t")),
        text("a separator at the end of every row", |f| {
            f.imu = f.imu.replace('\n', ",\n").replacen(",\n", "\n", 1);
        }),
        text("semicolons and decimal commas", |f| {
            f.imu = f.imu.replace(',', ";").replace('.', ",");
        }),
        text("two columns of one name", |f| {
            f.gnss = f.gnss.replacen("vu", "ve", 1);
        }),
        text("rows of text throughout", |f| {
            f.imu = f.imu.replace("0.001", "n/a");
        }),
        text("two rows swapped", |f| {
            let mut lines: Vec<&str> = f.imu.lines().collect();
            lines.swap(100, 101);
            f.imu = lines.join("\n");
        }),
        text("each row twice", |f| {
            let (header, rows) = f.gnss.split_once('\n').unwrap();
            let twice: Vec<String> = rows.lines().map(|row| format!("{row}\n{row}")).collect();
            f.gnss = format!("{header}\n{}", twice.join("\n"));
        }),
        text("stamps of too few digits", |f| {
            convert(&mut f.imu, "t_s", |x| (x * 10.0).floor() / 10.0);
        }),
        text("two logs joined", |f| {
            let again = f.imu.clone();
            f.imu.push_str(again.split_once('\n').unwrap().1);
        }),
        text("week rollover", |f| {
            let week = |x: f64| (x + 604_740.0) % 604_800.0;
            convert(&mut f.imu, "t_s", week);
            convert(&mut f.gnss, "t_s", week);
        }),
        text("five seconds", |f| {
            f.imu = f.imu.lines().take(250).collect::<Vec<_>>().join("\n");
        }),
        text("fixes every 5 s", |f| {
            f.gnss = f.gnss.lines().step_by(25).collect::<Vec<_>>().join("\n");
        }),
        text("half a velocity", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,9,200,10,,0");
        }),
        text("missing column", |f| f.imu = f.imu.replace("gyro_z", "wz")),
        text("no header", |f| {
            f.imu = f.imu.split_once('\n').unwrap().1.to_owned();
        }),
        text("semicolons", |f| f.gnss = f.gnss.replace(',', ";")),
        text("line cut off", |f| f.imu.truncate(f.imu.len() - 20)),
        text("zeros at the end", |f| f.imu.push_str(&"\0".repeat(40_000))),
        text("decimal comma", |f| {
            set_line(&mut f.imu, 5, "0,06,0,0,0,0,0,-9.8");
        }),
        text("stray quote", |f| {
            set_line(&mut f.imu, 5, "0.06,0,0,\"0,0,0,-9.8");
        }),
        text("time repeated", |f| {
            set_line(&mut f.imu, 5, "0.04,0,0,0,0,0,-9.8");
        }),
        text("time reversed", |f| {
            set_line(&mut f.gnss, 5, "0.2,45,9,200,10,0,0");
        }),
        text("time beyond all scales", |f| {
            set_line(&mut f.gnss, 5, "1.7e18,45,9,200,10,0,0");
        }),
        text("latitude and longitude swapped", |f| {
            convert(&mut f.gnss, "lon_deg", |x| x - 114.0);
            swap_columns(&mut f.gnss, 1, 2);
        }),
        text(
            "latitude and longitude swapped, each of which both may be",
            |f| {
                swap_columns(&mut f.gnss, 1, 2);
            },
        ),
        text("position in 1e-7 degrees", |f| {
            convert_all(&mut f.gnss, &["lat_deg", "lon_deg"], |x| x * 1e7);
        }),
        text("height in millimetres", |f| {
            convert(&mut f.gnss, "h_m", |x| x * 1e3);
        }),
    ]
}

fn column_cases() -> Vec<Case> {
    vec![
        text("columns misspelt", |f| {
            f.gnss = f.gnss.replacen("h_m,ve,vn,vu", "hm,ve,vn,vu_mps", 1);
        }),
        text("a first line for spreadsheets", |f| {
            f.imu = format!("sep=;\n{}", f.imu.replace(',', ";").replace('.', ","));
        }),
        text("a column that is not read", |f| {
            f.gnss = f
                .gnss
                .replacen("vu\n", "vu,nsat\n", 1)
                .replace(",0.000\n", ",0.000,9\n");
        }),
        text("units in the names of columns", |f| {
            f.imu = f.imu.replacen("gyro_x", "gyro_x [rad/s]", 1);
        }),
        text("dates for times", |f| {
            f.gnss = f.gnss.replace('\n', "\n2026-05-04T10:00:0");
        }),
    ]
}

/// With the drive on hills.
fn on_hills(name: &'static str, modify: fn(&mut Files)) -> Case {
    Case {
        base: hills,
        ..text(name, modify)
    }
}

fn receiver_cases() -> Vec<Case> {
    vec![
        on_hills("hills and brakings", |_| {}),
        on_hills("rows of zeros without a fix", |f| {
            for line in 100..120 {
                let time = 0.2 * (line as f64 - 2.0);
                set_line(&mut f.gnss, line, &format!("{time:.3},0,0,0,0,0,0"));
            }
        }),
        on_hills("zeros in every row", |f| {
            let all = ["lat_deg", "lon_deg", "h_m", "ve", "vn", "vu"];
            convert_all(&mut f.gnss, &all, |_| 0.0);
        }),
        on_hills("positions in the first row alone", |f| {
            let rows = f.gnss.lines().enumerate().map(|(line, row)| {
                let cells: Vec<&str> = row.split(',').collect();
                let place = if line < 2 {
                    cells[1..4].join(",")
                } else {
                    ",,".to_owned()
                };
                format!("{},{place},{}\n", cells[0], cells[4..].join(","))
            });
            f.gnss = rows.collect();
        }),
        on_hills("each fix four times, new stamps", |f| {
            hold(&mut f.gnss, 1..7, |row| row - row % 4);
        }),
        on_hills("positions frozen", |f| {
            hold(&mut f.gnss, 1..4, |row| row.min(299));
        }),
        on_hills("velocities at half the rate", |f| {
            hold(&mut f.gnss, 4..7, |row| row - row % 2);
        }),
        on_hills("vertical velocity written as zero", |f| {
            convert(&mut f.gnss, "vu", |_| 0.0);
        }),
        on_hills("vertical velocity down", |f| {
            convert(&mut f.gnss, "vu", |x| -x);
        }),
        on_hills("vertical velocity in ft/s", |f| {
            convert(&mut f.gnss, "vu", |x| x / 0.3048);
        }),
        on_hills("velocity differenced from positions", |f| {
            let rows: Vec<Vec<f64>> = f
                .gnss
                .lines()
                .skip(1)
                .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
                .collect();
            for (line, pair) in rows.windows(2).enumerate() {
                let moved =
                    |axis: usize, metres: f64| (pair[1][axis] - pair[0][axis]) * metres / 0.2;
                let row = &pair[1];
                // The ellipsoid's metres per degree at 45 degrees north.
                let (ve, vn) = (moved(2, 78_849.4), moved(1, 111_132.1));
                let text = format!(
                    "{},{},{},{},{ve},{vn},{}",
                    row[0], row[1], row[2], row[3], row[6]
                );
                set_line(&mut f.gnss, line + 3, &text);
            }
        }),
        on_hills("fixes of another drive", |f| {
            f.gnss = log_of(&Motion {
                turn_radps: |t| 0.3 * (0.09 * t).sin() * (0.5 * t).cos(),
                speed_change_mps: |t| 3.0 * (0.11 * t).sin(),
                ..Motion::default()
            })
            .gnss;
        }),
    ]
}

fn sensor_cases() -> Vec<Case> {
    vec![
        on_hills("a spike", |f| {
            set_line(&mut f.imu, 1000, "19.96,0,0,0,0,0,-900");
        }),
        on_hills("spikes on one axis", |f| {
            for line in (60..6000).step_by(120) {
                let time = 0.02 * (line as f64 - 2.0);
                set_line(&mut f.imu, line, &format!("{time:.3},0,0,0,0,5000,-9.81"));
            }
        }),
        on_hills("clipped gyro", |f| {
            convert(&mut f.imu, "gyro_z", |x| (3.0 * x).clamp(-0.6, 0.6));
        }),
        on_hills("frozen half way", |f| {
            hold(&mut f.imu, 1..7, |row| row.min(2999));
        }),
        on_hills("frozen from the start", |f| {
            hold(&mut f.imu, 1..7, |_| 0);
        }),
        on_hills("gyro up frozen half way", |f| {
            hold(&mut f.imu, 3..4, |row| row.min(2999));
        }),
        text("accelerometers in mm/s^2", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x * 1000.0);
        }),
        text("gyro offset of 20 deg/s", |f| {
            convert(&mut f.imu, "gyro_x", |x| x + 0.35);
        }),
        Case {
            base: swell,
            ..text("gyros swapped", |f| swap_columns(&mut f.imu, 1, 2))
        },
        on_hills("accelerometer forward of the wrong sign", |f| {
            convert(&mut f.imu, "accel_x", |x| -x);
        }),
        on_hills("accelerometer right of the wrong sign", |f| {
            convert(&mut f.imu, "accel_y", |x| -x);
        }),
        on_hills("accelerometers swapped", |f| swap_columns(&mut f.imu, 4, 5)),
        on_hills("FLU called RFU", |f| {
            convert_all(
                &mut f.imu,
                &["gyro_y", "gyro_z", "accel_y", "accel_z"],
                |x| -x,
            );
            f.meta = META.replace("FRD", "RFU");
        }),
        on_hills("mounted backwards", |f| {
            convert_all(
                &mut f.imu,
                &["gyro_x", "gyro_y", "accel_x", "accel_y"],
                |x| -x,
            );
        }),
        Case {
            base: swell,
            ..text("a boat in a swell", |_| {})
        },
        Case {
            base: canopy,
            ..text("under a canopy", |_| {})
        },
        Case {
            base: swell,
            ..text("pitch gyro of the wrong sign", |f| {
                convert(&mut f.imu, "gyro_y", |x| -x);
            })
        },
    ]
}

fn unit_cases() -> Vec<Case> {
    const TO_DEG: f64 = 57.295_779_513;
    vec![
        text("gyros in degrees", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * TO_DEG);
        }),
        text("gyros in degrees, at rest", |f| {
            convert(&mut f.imu, "gyro_z", |_| 0.006 * TO_DEG);
            convert(&mut f.imu, "accel_y", |_| 0.1);
            convert_all(&mut f.gnss, &["ve", "vn"], |_| 0.0);
        }),
        text("gyros in deg/h", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * TO_DEG * 3600.0);
        }),
        text("gyros in mrad/s", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * 1e3);
        }),
        text("gyros in mdeg/s", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * TO_DEG * 1000.0);
        }),
        text("gyros converted twice", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x / TO_DEG);
        }),
        text("position in radians", |f| {
            convert_all(&mut f.gnss, &["lat_deg", "lon_deg"], |x| x / TO_DEG);
        }),
        text("accelerometers in g", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x / 9.80665);
        }),
        text("accelerometers in mg", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x / 0.009_806_65);
        }),
        text("accelerometers in unknown units", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x * 40.0);
        }),
        text("accelerometers 7 % off", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x * 1.07);
        }),
        text("increments called rates", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| x * IMU_STEP_S);
            convert_all(&mut f.imu, &GYRO, |x| x * IMU_STEP_S);
        }),
        text("rates called increments", |f| {
            f.meta = META.replace("rates", "increments");
        }),
        text("increments called rates, 100 Hz", |f| {
            to_100_hz(f);
            convert_all(&mut f.imu, &ACCEL, |x| x * 0.01);
            convert_all(&mut f.imu, &GYRO, |x| x * 0.01);
        }),
        text("rates called increments, 100 Hz", |f| {
            to_100_hz(f);
            f.meta = META.replace("rates", "increments");
        }),
        text("increments of the gyros only", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * IMU_STEP_S);
        }),
        text("inertial time in milliseconds", |f| {
            convert(&mut f.imu, "t_s", |x| x * 1e3);
        }),
        text("all times in milliseconds", |f| {
            convert(&mut f.imu, "t_s", |x| x * 1e3);
            convert(&mut f.gnss, "t_s", |x| x * 1e3);
        }),
        text("inertial samples once a second", |f| {
            let (header, rows) = f.imu.split_once('\n').unwrap();
            let rows: Vec<&str> = rows.lines().step_by(50).collect();
            f.imu = format!("{header}\n{}\n", rows.join("\n"));
        }),
        text("inertial samples ten times a second", |f| {
            let (header, rows) = f.imu.split_once('\n').unwrap();
            let rows: Vec<&str> = rows.lines().step_by(5).collect();
            f.imu = format!("{header}\n{}\n", rows.join("\n"));
        }),
        text("inertial time in minutes", |f| {
            convert(&mut f.imu, "t_s", |x| x / 60.0);
        }),
        text("GNSS time in milliseconds", |f| {
            convert(&mut f.gnss, "t_s", |x| x * 1e3);
        }),
        text("inertial time in microseconds", |f| {
            convert(&mut f.imu, "t_s", |x| x * 1e6);
        }),
        text("velocity in km/h", |f| {
            convert_all(&mut f.gnss, &["ve", "vn"], |x| x * 3.6);
        }),
        text("velocity in miles per hour", |f| {
            convert_all(&mut f.gnss, &["ve", "vn"], |x| x / 0.447_04);
        }),
        text("velocity in knots", |f| {
            convert_all(&mut f.gnss, &["ve", "vn"], |x| x / 0.514_444);
        }),
        text("velocity in cm/s, positions as noisy as they are", |f| {
            convert_all(&mut f.gnss, &["lat_deg", "lon_deg"], with_noise);
            convert_all(&mut f.gnss, &["ve", "vn"], |x| 100.0 * x);
        }),
        text("velocity in mm/s, positions as noisy as they are", |f| {
            convert_all(&mut f.gnss, &["lat_deg", "lon_deg"], with_noise);
            convert_all(&mut f.gnss, &["ve", "vn"], |x| 1000.0 * x);
        }),
    ]
}

/// Adds pseudo-random noise of a metre.
fn with_noise(degrees: f64) -> f64 {
    degrees + 1e-5 * (1e9 * degrees).sin()
}

fn axis_cases() -> Vec<Case> {
    vec![
        text("FRD called RFU", |f| f.meta = META.replace("FRD", "RFU")),
        text("FRD called FLU", |f| f.meta = META.replace("FRD", "FLU")),
        text("FLU called FRD", |f| {
            convert_all(
                &mut f.imu,
                &["gyro_y", "gyro_z", "accel_y", "accel_z"],
                |x| -x,
            );
        }),
        text("accelerometer signs turned", |f| {
            convert_all(&mut f.imu, &ACCEL, |x| -x);
        }),
        text("gyro signs turned", |f| {
            convert_all(&mut f.imu, &GYRO, |x| -x);
        }),
        text("vertical gyro of the wrong sign", |f| {
            convert(&mut f.imu, "gyro_z", |x| -x);
        }),
        text("vertical axis in x", |f| {
            swap_columns(&mut f.imu, 1, 3);
            swap_columns(&mut f.imu, 4, 6);
        }),
        text("mounted 40 degrees nose-down", |f| {
            pitch_sensors(&mut f.imu, 40.0);
        }),
        text("mounted 25 degrees nose-down", |f| {
            pitch_sensors(&mut f.imu, 25.0);
        }),
        text("east and north swapped", |f| {
            swap_columns(&mut f.gnss, 4, 5);
        }),
        text("east positive to the west", |f| {
            convert(&mut f.gnss, "ve", |x| -x);
        }),
        text("sign of longitude lost", |f| {
            convert(&mut f.gnss, "lon_deg", |x| -x);
        }),
    ]
}

fn clock_cases() -> Vec<Case> {
    vec![
        text("last stamp years ahead", |f| {
            set_line(&mut f.imu, 6001, "1e9,0.001,0,0,0,0,-9.81");
        }),
        text("leap seconds", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 18.0);
        }),
        text("leap seconds the other way", |f| {
            convert(&mut f.gnss, "t_s", |x| x - 18.0);
        }),
        text("clocks 2 s apart", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 2.0);
        }),
        text("clocks 3 s apart", |f| {
            convert(&mut f.gnss, "t_s", |x| x - 3.0);
        }),
        text("clocks 5 s apart", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 5.0);
        }),
        text("short log, leap seconds", |f| {
            f.imu = f.imu.lines().take(500).collect::<Vec<_>>().join("\n");
            f.gnss = f.gnss.lines().take(50).collect::<Vec<_>>().join("\n");
            convert(&mut f.gnss, "t_s", |x| x + 18.0);
        }),
        text("samples counted from another origin", |f| {
            convert(&mut f.imu, "t_s", |x| x + 1e6);
        }),
        text("different origins", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 1.752e9);
        }),
        Case {
            base: laps,
            ..text("turns that repeat", |_| {})
        },
        // The first shifts in the search are closer to other repetitions than to the latency.
        Case {
            base: small_laps,
            ..text("turns that repeat, latency of 0.25 s", |f| {
                convert(&mut f.gnss, "t_s", |x| x + 0.25);
            })
        },
        Case {
            base: laps,
            ..text("turns that repeat, clocks 20 s apart", |f| {
                convert(&mut f.gnss, "t_s", |x| x + 20.0);
            })
        },
        text("latency of 0.3 s", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 0.3);
        }),
    ]
}

/// Compresses imu.csv and modifies the bytes.
fn pack_imu(folder: &Path, modify: impl Fn(&mut Vec<u8>)) {
    let mut packed = GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed
        .write_all(&fs::read(folder.join("imu.csv")).unwrap())
        .unwrap();
    let mut bytes = packed.finish().unwrap();
    modify(&mut bytes);
    fs::write(folder.join("imu.csv.gz"), bytes).unwrap();
    fs::remove_file(folder.join("imu.csv")).unwrap();
}

#[test]
fn every_defect_gets_its_message() {
    let groups = [
        file_cases(),
        meta_cases(),
        row_cases(),
        line_cases(),
        form_cases(),
        column_cases(),
        receiver_cases(),
        sensor_cases(),
        unit_cases(),
        axis_cases(),
        clock_cases(),
    ];
    let mut table = String::new();
    for case in groups.iter().flatten() {
        writeln!(table, "# {}\n{}\n", case.name, messages_of(case)).unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/log_defects.txt");
    if std::env::var_os("INS_BLESS").is_some() {
        fs::write(&path, &table).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap();
    let differing = table
        .split("\n\n")
        .zip(expected.split("\n\n"))
        .find(|(a, b)| a != b);
    assert_eq!(
        differing, None,
        "left: current message, right: log_defects.txt"
    );
    assert_eq!(table.len(), expected.len(), "cases added or left out");
}

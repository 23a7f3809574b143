//! Every kind of bad log, and the message it gets.
//!
//! The messages stand in `log_defects.txt`; `INS_BLESS=1 cargo test` writes it anew.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::write::GzEncoder;
use host_sim::log::{LogError, read};

const META: &str = "name = \"test drive\"\n\n[log]\nbody_axes = \"FRD\"\nimu = \"rates\"\n";
const IMU_STEP_S: f64 = 0.02;
const SPEED_MPS: f64 = 10.0;

/// The files of a log as text, to be spoilt.
struct Files {
    imu: String,
    gnss: String,
    meta: String,
}

/// A car at constant speed on a winding road for two minutes, 50 Hz and 5 Hz.
fn drive() -> Files {
    let mut imu = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n".to_owned();
    let mut gnss = "t_s,lat_deg,lon_deg,h_m,ve,vn,vu,nsat\n".to_owned();
    let (mut course, mut east_m, mut north_m) = (0.4_f64, 0.0, 0.0);
    for step in 0..6000_i32 {
        let time = f64::from(step) * IMU_STEP_S;
        let rate = 0.2 * (0.13 * time).sin() + 0.15 * (0.031 * time * time / 4.0).cos();
        let (ve, vn) = (SPEED_MPS * course.sin(), SPEED_MPS * course.cos());
        writeln!(
            imu,
            "{time:.3},0.001,-0.002,{rate:.6},0.05,{:.5},-9.81",
            SPEED_MPS * rate
        )
        .unwrap();
        if step % 10 == 0 {
            // Metres per degree at 45 degrees north.
            let (lat, lon) = (45.0 + north_m / 111_130.0, 9.0 + east_m / 78_850.0);
            writeln!(
                gnss,
                "{time:.3},{lat:.9},{lon:.9},200.0,{ve:.4},{vn:.4},0.0,9"
            )
            .unwrap();
        }
        east_m += ve * IMU_STEP_S;
        north_m += vn * IMU_STEP_S;
        course += rate * IMU_STEP_S;
    }
    Files {
        imu,
        gnss,
        meta: META.to_owned(),
    }
}

/// Applies `f` to a column of numbers.
fn convert(text: &mut String, name: &str, f: impl Fn(f64) -> f64) {
    let header = text.lines().next().unwrap().to_owned();
    let column = header.split(',').position(|cell| cell == name).unwrap();
    let mut converted = header;
    for line in text.lines().skip(1) {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[column] = f(cells[column].parse().unwrap()).to_string();
        write!(converted, "\n{}", cells.join(",")).unwrap();
    }
    *text = converted + "\n";
}

fn convert_all(text: &mut String, names: &[&str], f: impl Fn(f64) -> f64 + Copy) {
    for name in names {
        convert(text, name, f);
    }
}

/// Replaces a line, counted from one.
fn set_line(text: &mut String, line: usize, with: &str) {
    let mut lines: Vec<&str> = text.lines().collect();
    lines[line - 1] = with;
    *text = lines.join("\n") + "\n";
}

fn swap_columns(text: &mut String, a: usize, b: usize) {
    let swapped: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(index, line)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if index > 0 {
                cells.swap(a, b);
            }
            cells.join(",")
        })
        .collect();
    *text = swapped.join("\n") + "\n";
}

const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];

fn put(files: &Files, folder: &Path) {
    fs::write(folder.join("imu.csv"), &files.imu).unwrap();
    fs::write(folder.join("gnss.csv"), &files.gnss).unwrap();
    fs::write(folder.join("meta.toml"), &files.meta).unwrap();
}

fn told(error: &LogError, folder: &Path) -> String {
    let text = format!("{error}\n-> {}", error.cause);
    text.replace(&format!("{}/", folder.display()), "")
        .replace(&folder.display().to_string(), "LOG")
}

/// What is said of a log: the error, or else all warnings.
fn said(case: &Case) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut files = drive();
    match case.spoil {
        Spoil::Text(spoil) => {
            spoil(&mut files);
            put(&files, folder.path());
        }
        Spoil::Folder(spoil) => {
            put(&files, folder.path());
            spoil(folder.path());
        }
    }
    let path = match case.within {
        "" => folder.path().to_owned(),
        within => folder.path().join(within),
    };
    match read(&path) {
        Err(error) => told(&error, folder.path()),
        Ok((_, warnings)) if warnings.is_empty() => "no message".to_owned(),
        Ok((_, warnings)) => {
            let told: Vec<String> = warnings.iter().map(|w| told(w, folder.path())).collect();
            format!("warning: {}", told.join("\nwarning: "))
        }
    }
}

enum Spoil {
    Text(fn(&mut Files)),
    Folder(fn(&Path)),
}

struct Case {
    name: &'static str,
    /// What is read: this inside the folder.
    within: &'static str,
    spoil: Spoil,
}

fn text(name: &'static str, spoil: fn(&mut Files)) -> Case {
    Case {
        name,
        within: "",
        spoil: Spoil::Text(spoil),
    }
}

fn folder(name: &'static str, spoil: fn(&Path)) -> Case {
    Case {
        name,
        within: "",
        spoil: Spoil::Folder(spoil),
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
        folder("imu.csv twice", |f| {
            fs::write(f.join("imu.csv.gz"), "").unwrap();
        }),
        folder("empty imu.csv", |f| {
            fs::write(f.join("imu.csv"), "").unwrap();
        }),
        text("header alone", |f| {
            f.gnss.truncate(f.gnss.find('\n').unwrap() + 1);
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
        text("a key that is not read", |f| {
            f.meta.push_str("heading_deg = 12.0\n");
        }),
    ]
}

fn row_cases() -> Vec<Case> {
    vec![
        text("not a number", |f| {
            set_line(&mut f.imu, 5, "0.06,0,0,abc,0,0,-9.8");
        }),
        text("NaN", |f| set_line(&mut f.imu, 5, "0.06,0,0,0,nan,0,-9.8")),
        text("infinite", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,9,200,-inf,0,0,9");
        }),
        text("empty cell", |f| {
            set_line(&mut f.imu, 5, "0.06,0,0,0,0,,-9.8");
        }),
        text("half a position", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,9,,10,0,0,9");
        }),
        text("half a velocity", |f| {
            set_line(&mut f.gnss, 5, "0.6,45,9,200,10,,0,9");
        }),
        text("missing column", |f| f.imu = f.imu.replace("gyro_z", "wz")),
        text("no header", |f| {
            f.imu = f.imu.split_once('\n').unwrap().1.to_owned();
        }),
        text("semicolons", |f| f.gnss = f.gnss.replace(',', ";")),
        text("line cut off", |f| f.imu.truncate(f.imu.len() - 20)),
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
            set_line(&mut f.gnss, 5, "0.2,45,9,200,10,0,0,9");
        }),
        text("time beyond all scales", |f| {
            set_line(&mut f.gnss, 5, "1.7e18,45,9,200,10,0,0,9");
        }),
        text("latitude and longitude swapped", |f| {
            convert(&mut f.gnss, "lon_deg", |x| x - 114.0);
            swap_columns(&mut f.gnss, 1, 2);
        }),
        text("position in 1e-7 degrees", |f| {
            convert_all(&mut f.gnss, &["lat_deg", "lon_deg"], |x| x * 1e7);
        }),
        text("height in millimetres", |f| {
            convert(&mut f.gnss, "h_m", |x| x * 1e3);
        }),
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
        text("increments of the gyros only", |f| {
            convert_all(&mut f.imu, &GYRO, |x| x * IMU_STEP_S);
        }),
        text("inertial time in milliseconds", |f| {
            convert(&mut f.imu, "t_s", |x| x * 1e3);
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
        text("velocity in knots", |f| {
            convert_all(&mut f.gnss, &["ve", "vn"], |x| x / 0.514_444);
        }),
    ]
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
    ]
}

fn clock_cases() -> Vec<Case> {
    vec![
        text("leap seconds", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 18.0);
        }),
        text("leap seconds the other way", |f| {
            convert(&mut f.gnss, "t_s", |x| x - 18.0);
        }),
        text("clocks 5 s apart", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 5.0);
        }),
        text("short log, leap seconds", |f| {
            f.imu = f.imu.lines().take(500).collect::<Vec<_>>().join("\n");
            f.gnss = f.gnss.lines().take(50).collect::<Vec<_>>().join("\n");
            convert(&mut f.gnss, "t_s", |x| x + 18.0);
        }),
        text("different origins", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 1.752e9);
        }),
        text("latency of 0.3 s", |f| {
            convert(&mut f.gnss, "t_s", |x| x + 0.3);
        }),
    ]
}

/// Packs imu.csv and spoils the bytes.
fn pack_imu(folder: &Path, spoil: impl Fn(&mut Vec<u8>)) {
    let mut packed = GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed
        .write_all(&fs::read(folder.join("imu.csv")).unwrap())
        .unwrap();
    let mut bytes = packed.finish().unwrap();
    spoil(&mut bytes);
    fs::write(folder.join("imu.csv.gz"), bytes).unwrap();
    fs::remove_file(folder.join("imu.csv")).unwrap();
}

/// Turns the sensors about their y axis (right), front end down.
fn pitch_sensors(imu: &mut String, down_deg: f64) {
    let (s, c) = down_deg.to_radians().sin_cos();
    let mut turned = imu.lines().next().unwrap().to_owned();
    for line in imu.lines().skip(1) {
        let cell: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let along = |x: f64, z: f64| (c * x + s * z, c * z - s * x);
        let (gx, gz) = along(cell[1], cell[3]);
        let (ax, az) = along(cell[4], cell[6]);
        write!(
            turned,
            "\n{},{gx},{},{gz},{ax},{},{az}",
            cell[0], cell[2], cell[5]
        )
        .unwrap();
    }
    *imu = turned + "\n";
}

#[test]
fn every_kind_of_bad_log_gets_its_message() {
    let groups = [
        file_cases(),
        meta_cases(),
        row_cases(),
        unit_cases(),
        axis_cases(),
        clock_cases(),
    ];
    let mut table = String::new();
    for case in groups.iter().flatten() {
        writeln!(table, "# {}\n{}\n", case.name, said(case)).unwrap();
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
        "left: what is said now, right: log_defects.txt"
    );
    assert_eq!(table.len(), expected.len(), "cases added or left out");
}

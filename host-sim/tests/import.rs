//! Recordings of other programs, generated here from one drive: each must be read as that drive. Real ones
//! are read if available.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use host_sim::log::import::{Choice, open, read};
use host_sim::log::{Grade, Log, LogError};
use host_sim::study::recordings::{Outcome, recordings};
use ins_core::{GnssFix, ImuOutput};
use lz4_flex::frame::FrameEncoder;
use nalgebra::{Vector2, Vector3};

const IMU_HZ: usize = 50;
const FIX_HZ: usize = 5;
const SECONDS: usize = 60;
/// Metres per radian of latitude and of longitude, sufficient for a drive of a kilometre.
const NORTH_M: f64 = 6_367_400.0;
const EAST_M: f64 = 4_517_600.0;

/// An inertial sample of the drive, forward-right-down.
struct Sample {
    time_s: f64,
    gyro: Vector3<f64>,
    accel: Vector3<f64>,
}

/// A fix of the drive.
struct Fix {
    time_s: f64,
    lat_deg: f64,
    lon_deg: f64,
    height_m: f64,
    velocity: Vector2<f64>,
    up_mps: f64,
}

struct Drive {
    imu: Vec<Sample>,
    gnss: Vec<Fix>,
}

/// A winding road at changing speed, up and down.
fn drive() -> Drive {
    let step_s = 1.0 / IMU_HZ as f64;
    let (mut course, mut east_m, mut north_m, mut height_m) = (0.3_f64, 0.0, 0.0, 120.0);
    let (mut imu, mut gnss) = (Vec::new(), Vec::new());
    for step in 0..SECONDS * IMU_HZ {
        let time_s = step as f64 * step_s;
        let rate = 0.2 * (0.4 * time_s).sin() + 0.1 * (0.17 * time_s * time_s / 6.0).cos();
        let speed = 10.0 + 3.0 * (0.3 * time_s).sin();
        let up_mps = 0.8 * (0.2 * time_s).cos();
        let velocity = speed * Vector2::new(course.sin(), course.cos());
        imu.push(Sample {
            time_s,
            gyro: Vector3::new(0.001, -0.002, rate),
            accel: Vector3::new(
                0.9 * (0.3 * time_s).cos(),
                speed * rate,
                -9.81 + 0.16 * (0.2 * time_s).sin(),
            ),
        });
        if step % (IMU_HZ / FIX_HZ) == 0 {
            gnss.push(Fix {
                time_s,
                lat_deg: 45.0 + (north_m / NORTH_M).to_degrees(),
                lon_deg: -9.0 + (east_m / EAST_M).to_degrees(),
                height_m,
                velocity,
                up_mps,
            });
        }
        east_m += velocity.x * step_s;
        north_m += velocity.y * step_s;
        height_m += up_mps * step_s;
        course += rate * step_s;
    }
    Drive { imu, gnss }
}

/// Single precision, as in most formats.
#[allow(clippy::cast_possible_truncation)]
fn single(value: f64) -> [u8; 4] {
    (value as f32).to_le_bytes()
}

/// Precision and content that a format keeps.
#[derive(Clone, Copy)]
struct Expected {
    /// From the drive's clock to the recording's, s.
    clock_s: f64,
    /// Largest error of rates (rad/s), forces (m/s^2), velocities (m/s).
    within: f64,
    climb: bool,
}

fn assert_drive(log: &Log, expected: Expected) {
    let Drive { imu, gnss } = drive();
    let within = expected.within;
    let scale = match log.meta.imu {
        ImuOutput::Rates => 1.0,
        ImuOutput::Increments => IMU_HZ as f64,
    };
    // The last sample may be incomplete.
    assert!(log.imu.len() + 2 > imu.len(), "{} samples", log.imu.len());
    for (actual, sample) in log.imu.iter().zip(&imu) {
        let time_s = actual.time.as_seconds() - expected.clock_s;
        let rfu = |v: Vector3<f64>| Vector3::new(v.y, v.x, -v.z);
        assert!(
            (time_s - sample.time_s).abs() < 2e-3,
            "{time_s} {}",
            sample.time_s
        );
        assert!(
            (scale * actual.gyro - rfu(sample.gyro)).amax() < within,
            "{actual:?} at {time_s}"
        );
        assert!(
            (scale * actual.accel - rfu(sample.accel)).amax() < within,
            "{actual:?} at {time_s}"
        );
    }
    assert_eq!(log.gnss.len(), gnss.len());
    for (actual, fix) in log.gnss.iter().zip(&gnss) {
        assert_fix(actual, fix, expected);
    }
}

fn assert_fix(actual: &GnssFix, fix: &Fix, expected: Expected) {
    let within = expected.within;
    let time_s = actual.time.as_seconds() - expected.clock_s;
    assert!(
        (time_s - fix.time_s).abs() < 2e-3,
        "{time_s} {}",
        fix.time_s
    );
    let position = actual.position.unwrap();
    // A decimetre.
    assert!(
        (position.latitude_rad - fix.lat_deg.to_radians()).abs() < 2e-8,
        "{actual:?}"
    );
    assert!(
        (position.longitude_rad - fix.lon_deg.to_radians()).abs() < 2e-8,
        "{actual:?}"
    );
    assert!(
        (actual.height_m.unwrap() - fix.height_m).abs() < 0.02,
        "{actual:?}"
    );
    assert!(
        (actual.velocity_en_mps.unwrap() - fix.velocity).amax() < within,
        "{actual:?}"
    );
    match actual.velocity_up_mps {
        Some(up_mps) => assert!((up_mps - fix.up_mps).abs() < within),
        None => assert!(!expected.climb),
    }
}

const EXACT: Expected = Expected {
    clock_s: 0.0,
    within: 1e-3,
    climb: true,
};

fn file(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, bytes).unwrap();
    path
}

fn speed_and_course(fix: &Fix) -> (f64, f64) {
    let course = fix.velocity.x.atan2(fix.velocity.y).to_degrees();
    (fix.velocity.norm(), course.rem_euclid(360.0))
}

/// Whole units, rounded.
#[allow(clippy::cast_possible_truncation)]
fn rounded(value: f64) -> i32 {
    value.round() as i32
}

fn millis(time_s: f64) -> u32 {
    rounded(1e3 * time_s).cast_unsigned()
}

// --- DataFlash ---

fn format_message(bytes: &mut Vec<u8>, kind: u8, name: &str, format: &str, labels: &str) {
    let sizes = |c: char| match c {
        'B' => 1,
        'c' | 'H' => 2,
        'Q' => 8,
        _ => 4,
    };
    let length: u8 = format.chars().map(sizes).sum();
    bytes.extend([0xa3, 0x95, 0x80, kind, length + 3]);
    for (text, size) in [(name, 4), (format, 16), (labels, 64)] {
        let mut field = text.as_bytes().to_vec();
        field.resize(size, 0);
        bytes.extend(field);
    }
}

/// Barometer heights equal those of the receiver.
fn assert_heights(log: &Log) {
    assert_eq!(log.baro.len(), log.gnss.len());
    for (height, fix) in log.baro.iter().zip(&log.gnss) {
        assert_eq!(height.time, fix.time);
        assert!((height.height_m - fix.height_m.unwrap()).abs() < 0.01);
    }
}

/// Current form of logs, with two sensors.
fn dataflash(drive: &Drive) -> Vec<u8> {
    dataflash_of(drive, &[1.0, 1.01])
}

/// With one sensor for each scale factor.
fn dataflash_of(drive: &Drive, scales: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::new();
    format_message(
        &mut bytes,
        1,
        "IMU",
        "QQBffffff",
        "TimeUS,SampleUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
    );
    format_message(
        &mut bytes,
        2,
        "GPS",
        "QBBLLefff",
        "TimeUS,I,Status,Lat,Lng,Alt,Spd,GCrs,VZ",
    );
    format_message(&mut bytes, 3, "BARO", "Qf", "TimeUS,Alt");
    format_message(&mut bytes, 4, "GPA", "QBf", "TimeUS,I,Und");
    for sample in &drive.imu {
        for (instance, scale) in (0_u8..).zip(scales) {
            bytes.extend([0xa3, 0x95, 1]);
            bytes.extend(u64::from(millis(sample.time_s) * 1000).to_le_bytes());
            // The driver states no sampling time.
            bytes.extend(0_u64.to_le_bytes());
            bytes.push(instance);
            for value in sample.gyro.iter().chain(&sample.accel) {
                bytes.extend(single(scale * value));
            }
        }
    }
    for fix in &drive.gnss {
        let (speed, course) = speed_and_course(fix);
        bytes.extend([0xa3, 0x95, 2]);
        bytes.extend(u64::from(millis(fix.time_s) * 1000).to_le_bytes());
        bytes.extend([0, 3]);
        bytes.extend(rounded(1e7 * fix.lat_deg).to_le_bytes());
        bytes.extend(rounded(1e7 * fix.lon_deg).to_le_bytes());
        // Heights above sea level, which is 40 m above the ellipsoid.
        bytes.extend(rounded(1e2 * (fix.height_m - 40.0)).to_le_bytes());
        for value in [speed, course, -fix.up_mps] {
            bytes.extend(single(value));
        }
        bytes.extend([0xa3, 0x95, 4]);
        bytes.extend(u64::from(millis(fix.time_s) * 1000).to_le_bytes());
        bytes.push(0);
        bytes.extend(single(-40.0));
        bytes.extend([0xa3, 0x95, 3]);
        bytes.extend(u64::from(millis(fix.time_s) * 1000).to_le_bytes());
        bytes.extend(single(fix.height_m));
    }
    // Incomplete message after a power loss.
    bytes.extend([0xa3, 0x95, 1, 7]);
    bytes
}

#[test]
fn dataflash_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    // Recognized by content.
    let path = file(folder.path(), "flight.txt", dataflash(&drive()));
    let (log, warnings) = open(&path).unwrap();
    assert_drive(&log, EXACT);
    assert_heights(&log);
    assert!(
        warnings[0].found.contains("1 IMU 1 (3000), 2 IMU 2 (3000)"),
        "{warnings:?}"
    );
    // Both commands with the option are mentioned.
    let cause = "1 is used; --imu N of `import` and `tune` chooses another inertial sensor";
    assert_eq!(&*warnings[0].cause, cause);
}

#[test]
fn damage_of_dataflash_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = dataflash_of(&drive(), &[1.0]);
    let (_, warnings) = open(&file(folder.path(), "flight.bin", &bytes)).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    // After four format messages and ten samples.
    let at = 4 * 89 + 10 * 44;
    bytes[at..at + 440].fill(0xff);
    let (log, warnings) = open(&file(folder.path(), "flight.bin", &bytes)).unwrap();
    assert_eq!(log.imu.len(), drive().imu.len() - 10);
    let lost = 440 + 4;
    let found = format!(
        "{lost} of {} bytes that are no messages, from byte {at} on",
        bytes.len()
    );
    assert_eq!(*warnings[0].found, *found);
}

#[test]
fn a_truncated_compressed_recording_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for bytes in [dataflash(&drive()), ulog(&drive()), ros_bag(&drive())] {
        let mut compressed = compressed(&bytes);
        compressed.truncate(compressed.len() * 9 / 10);
        let error = open(&file(folder.path(), "flight.gz", compressed)).unwrap_err();
        assert!(error.cause.contains("broke off: `zcat`"), "{error:?}");
    }
}

/// Invalid lengths, on which the parsers panic.
#[test]
fn parser_panics_are_reported_as_errors() {
    let folder = tempfile::tempdir().unwrap();
    let mut dataflash = dataflash(&drive());
    dataflash[4] = 1;
    let ulog = [ulog(&drive()), ulog_message(b'P', &[200, 0])].concat();
    for bytes in [dataflash, ulog] {
        let path = file(folder.path(), "flight", bytes);
        let error = open(&path).unwrap_err();
        assert_eq!(&*error.found, "data on which its parser fails");
    }
}

#[test]
fn nmea_checksum_errors_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let imu = file(folder.path(), "imu0.csv", euroc(&drive()));
    let text = nmea(&drive()).replacen("$GNGGA,", "$GNGGA,9", 1);
    let line = 1 + text
        .lines()
        .position(|line| line.starts_with("$GNGGA,9"))
        .unwrap() as u64;
    let paths = [imu.clone(), file(folder.path(), "log.nmea", text)];
    let (_, warnings) = read(&paths, Choice::default()).unwrap();
    let warning = warnings.iter().find(|warning| warning.line == Some(line));
    assert!(warning.unwrap().cause.ends_with("left out"), "{warnings:?}");
    // A file without a fix is reported, whichever comes first.
    let void = file(folder.path(), "void.nmea", "$GPRMC,,V,,,,,,,,,,N*53\r\n");
    let error = read(&[imu, void.clone()], Choice::default()).unwrap_err();
    assert_eq!(*error.path, *void);
}

#[test]
fn sensors_are_selected_by_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = [file(folder.path(), "flight.bin", dataflash(&drive()))];
    let of = |imu| {
        read(
            &path,
            Choice {
                imu: Some(imu),
                gnss: None,
            },
        )
    };
    let (one, two) = (of(1).unwrap().0, of(2).unwrap().0);
    let ratio = two.imu.all()[100].accel.z / one.imu.all()[100].accel.z;
    assert!((ratio - 1.01).abs() < 1e-6);
    let error = of(3).unwrap_err();
    assert_eq!(&*error.expected, "--imu from 1 to 2");
    // The file of the sensors is reported, whichever comes first.
    let fixes = file(folder.path(), "log.nmea", nmea(&drive()));
    let (_, warnings) = read(&[fixes, path[0].clone()], Choice::default()).unwrap();
    let several = |warning: &&LogError| &*warning.expected == "one source of inertial samples";
    assert_eq!(*warnings.iter().find(several).unwrap().path, *path[0]);
}

#[test]
fn sensors_after_a_rejected_one_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = dataflash_of(&drive(), &[1.0, 0.0, 1.01]);
    let rows = recordings(&file(folder.path(), "flight.bin", bytes), None);
    let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(
        names,
        ["flight.bin", "flight.bin, sensor 2", "flight.bin, sensor 3"]
    );
    let refused = rows
        .iter()
        .map(|row| matches!(row.outcome, Outcome::Refused(_)));
    assert_eq!(refused.collect::<Vec<_>>(), [false, true, false]);
}

// --- ULog ---

fn ulog_message(kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).unwrap().to_le_bytes();
    [&length, [kind].as_slice(), payload].concat()
}

fn ulog(drive: &Drive) -> Vec<u8> {
    let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
    bytes.extend(0_u64.to_le_bytes());
    bytes.extend(ulog_message(b'B', &[0; 40]));
    for format in [
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;",
        "sensor_gps:uint64_t timestamp;double latitude_deg;double longitude_deg;\
         double altitude_ellipsoid_m;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;float eph;\
         uint8_t fix_type;bool vel_ned_valid;",
        "vehicle_air_data:uint64_t timestamp;float baro_alt_meter;",
    ] {
        bytes.extend(ulog_message(b'F', format.as_bytes()));
    }
    let names = ["sensor_combined", "sensor_gps", "vehicle_air_data"];
    for (id, name) in (0_u16..).zip(names) {
        let head = [&[0], id.to_le_bytes().as_slice()].concat();
        bytes.extend(ulog_message(b'A', &[&head, name.as_bytes()].concat()));
    }
    for sample in &drive.imu {
        let mut data = 0_u16.to_le_bytes().to_vec();
        data.extend(u64::from(millis(sample.time_s) * 1000).to_le_bytes());
        for value in sample.gyro.iter().chain(&sample.accel) {
            data.extend(single(*value));
        }
        bytes.extend(ulog_message(b'D', &data));
    }
    for fix in &drive.gnss {
        let mut data = 2_u16.to_le_bytes().to_vec();
        data.extend(u64::from(millis(fix.time_s) * 1000).to_le_bytes());
        data.extend(single(fix.height_m));
        bytes.extend(ulog_message(b'D', &data));
        let mut data = 1_u16.to_le_bytes().to_vec();
        data.extend(u64::from(millis(fix.time_s) * 1000).to_le_bytes());
        for value in [fix.lat_deg, fix.lon_deg, fix.height_m] {
            data.extend(value.to_le_bytes());
        }
        for value in [fix.velocity.y, fix.velocity.x, -fix.up_mps, 0.7] {
            data.extend(single(value));
        }
        data.extend([3, 1]);
        bytes.extend(ulog_message(b'D', &data));
    }
    bytes
}

#[test]
fn ulog_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "flight.ulg", ulog(&drive()));
    let (log, warnings) = open(&path).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_drive(&log, EXACT);
    assert!((log.gnss[0].sigma.position_m.unwrap() - 0.7).abs() < 1e-6);
    assert_heights(&log);
    let compressed = file(folder.path(), "flight.ulg.gz", compressed(&ulog(&drive())));
    assert_eq!(open(&compressed).unwrap().0.imu, log.imu);
}

#[test]
fn truncated_ulog_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = ulog(&drive());
    let length = bytes.len() - 11;
    bytes.truncate(length);
    let path = file(folder.path(), "flight.ulg", bytes);
    let (log, warnings) = open(&path).unwrap();
    assert_eq!(log.gnss.len(), drive().gnss.len() - 1);
    // The last record has 55 bytes.
    let position = format!("at byte {} of {length}", length - 44);
    let found = format!("one that ends too early, or is damaged {position}");
    assert_eq!(*warnings[0].found, *found);
    // Damage in the definitions, then after them.
    let mut damaged = ulog(&drive());
    let at = damaged.windows(8).position(|w| w == b"uint64_t").unwrap() - 1;
    damaged[at] = b' ';
    let error = open(&file(folder.path(), "flight.ulg", damaged)).unwrap_err();
    assert_eq!(&*error.found, "damaged ones");
    let rounded = ulog(&drive());
    let damaged = [rounded.clone(), ulog_message(b'D', &[0; 3])].concat();
    let (_, warnings) = open(&file(folder.path(), "flight.ulg", damaged)).unwrap();
    let position = format!("at byte {} of {}", rounded.len(), rounded.len() + 6);
    let found = format!("one with a damaged record {position}: read up to there");
    assert_eq!(*warnings[0].found, *found);
    // Zeros are no valid record.
    let damaged = [rounded.as_slice(), &[0; 300]].concat();
    let (_, warnings) = open(&file(folder.path(), "flight.ulg", damaged)).unwrap();
    let position = format!("at byte {} of {}", rounded.len(), rounded.len() + 300);
    assert_eq!(
        *warnings[0].found,
        *format!("one that is damaged {position}")
    );
}

// --- UBX ---

fn ubx_frame(class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).unwrap().to_le_bytes();
    let body = [&[class, id], length.as_slice(), payload].concat();
    let (mut a, mut b) = (0_u8, 0_u8);
    for byte in &body {
        a = a.wrapping_add(*byte);
        b = b.wrapping_add(a);
    }
    [&[0xb5, 0x62], body.as_slice(), &[a, b]].concat()
}

fn nav_pvt(fix: &Fix) -> Vec<u8> {
    let mut payload = vec![0; 92];
    let mut put = |at: usize, value: i32| payload[at..at + 4].copy_from_slice(&value.to_le_bytes());
    put(0, rounded(1e3 * fix.time_s));
    put(24, rounded(1e7 * fix.lon_deg));
    put(28, rounded(1e7 * fix.lat_deg));
    put(32, rounded(1e3 * fix.height_m));
    put(48, rounded(1e3 * fix.velocity.y));
    put(52, rounded(1e3 * fix.velocity.x));
    put(56, rounded(-1e3 * fix.up_mps));
    payload[20] = 3;
    payload[21] = 1;
    ubx_frame(1, 7, &payload)
}

/// All six channels under one time tag.
fn esf_meas(sample: &Sample, tag_ms: u32) -> Vec<u8> {
    let mut payload = tag_ms.to_le_bytes().to_vec();
    payload.extend([0, 6 << 3, 0, 0]);
    let gyro = sample.gyro.map(|x| rounded(x.to_degrees() * 4096.0));
    let accel = sample.accel.map(|x| rounded(x * 1024.0));
    let kinds = [14_u32, 13, 5, 16, 17, 18];
    for (kind, value) in kinds.into_iter().zip(gyro.iter().chain(&accel)) {
        let word = kind << 24 | value.cast_unsigned() & 0x00ff_ffff;
        payload.extend(word.to_le_bytes());
    }
    ubx_frame(0x10, 2, &payload)
}

#[test]
fn ubx_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let week_s = 604_800.0;
    // The second run crosses the end of a week, where the receiver's time wraps.
    for clock_s in [0.0, week_s - 20.0] {
        let Drive { imu, mut gnss } = drive();
        for fix in &mut gnss {
            fix.time_s = (fix.time_s + clock_s) % week_s;
        }
        let mut bytes = b"noise before".to_vec();
        for (index, sample) in imu.iter().enumerate() {
            if index % (IMU_HZ / FIX_HZ) == 0 {
                bytes.extend(nav_pvt(&gnss[index / (IMU_HZ / FIX_HZ)]));
            }
            bytes.extend(esf_meas(sample, millis(sample.time_s) + 77_000));
        }
        let path = file(folder.path(), "drive.ubx", bytes);
        let (log, _) = open(&path).unwrap();
        assert_drive(
            &log,
            Expected {
                within: 1.5e-3,
                clock_s,
                ..EXACT
            },
        );
    }
}

/// The receiver's clock continues, that of its sensors restarts.
#[test]
fn ubx_of_a_restarted_receiver_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let Drive { imu, gnss } = drive();
    let mut bytes = Vec::new();
    for (index, sample) in imu.iter().enumerate() {
        if index % (IMU_HZ / FIX_HZ) == 0 {
            bytes.extend(nav_pvt(&gnss[index / (IMU_HZ / FIX_HZ)]));
        }
        let tag_ms = millis(sample.time_s) + 77_000;
        let off_ms = if index < imu.len() / 2 { 0 } else { 106_000 };
        bytes.extend(esf_meas(sample, tag_ms - off_ms));
    }
    let path = file(folder.path(), "drive.ubx", &bytes);
    let within = 1.5e-3;
    assert_drive(&open(&path).unwrap().0, Expected { within, ..EXACT });
    // Two drives of the same time cannot be joined.
    let path = file(folder.path(), "joined.ubx", bytes.repeat(2));
    let error = open(&path).unwrap_err();
    assert!(error.cause.contains("two logs joined"), "{error}");
}

// --- ROS ---

fn ros_record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut fields = Vec::new();
    for (name, value) in header {
        let length = u32::try_from(name.len() + 1 + value.len()).unwrap();
        fields.extend(length.to_le_bytes());
        fields.extend([name.as_bytes(), b"=", value].concat());
    }
    let size = |bytes: &[u8]| u32::try_from(bytes.len()).unwrap().to_le_bytes();
    [size(&fields).as_slice(), &fields, &size(data), data].concat()
}

fn ros_header(time_s: f64) -> Vec<u8> {
    let nanos = millis(time_s.fract()) * 1_000_000;
    let stamp = [0, rounded(time_s.floor()).cast_unsigned(), nanos, 4];
    let mut bytes: Vec<u8> = stamp.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend(b"link");
    bytes
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn ros_messages(drive: &Drive) -> Vec<(u32, Vec<u8>)> {
    let flu = |v: Vector3<f64>| [v.x, -v.y, -v.z];
    let mut messages = Vec::new();
    for sample in &drive.imu {
        let mut data = ros_header(sample.time_s);
        data.extend(doubles(&[0.0; 13]));
        data.extend(doubles(&flu(sample.gyro)));
        data.extend(doubles(&[0.0; 9]));
        data.extend(doubles(&flu(sample.accel)));
        data.extend(doubles(&[0.0; 9]));
        messages.push((0, data));
    }
    for fix in &drive.gnss {
        let mut data = ros_header(fix.time_s);
        data.extend([0, 1, 0]);
        data.extend(doubles(&[fix.lat_deg, fix.lon_deg, fix.height_m]));
        data.extend(doubles(&[4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0]));
        data.push(2);
        messages.push((1, data));
        let mut data = ros_header(fix.time_s);
        data.extend(doubles(&[
            fix.velocity.x,
            fix.velocity.y,
            fix.up_mps,
            0.0,
            0.0,
            0.0,
        ]));
        messages.push((2, data));
    }
    messages
}

fn ros_bag(drive: &Drive) -> Vec<u8> {
    let connections = [
        (0_u32, "/imu", "sensor_msgs/Imu"),
        (1, "/gps/fix", "sensor_msgs/NavSatFix"),
        (2, "/gps/vel", "geometry_msgs/TwistStamped"),
    ];
    let connection = |(id, topic, kind): (u32, &str, &str)| {
        let data = [
            ("topic", topic.as_bytes()),
            ("type", kind.as_bytes()),
            ("md5sum", b"00000000000000000000000000000000".as_slice()),
            ("message_definition", b"".as_slice()),
        ];
        let data = ros_record(&data, &[]);
        let fields = u32::from_le_bytes(data[..4].try_into().unwrap()) as usize;
        let header: [(&str, &[u8]); 3] = [
            ("op", &[7]),
            ("conn", &id.to_le_bytes()),
            ("topic", topic.as_bytes()),
        ];
        ros_record(&header, &data[4..4 + fields])
    };
    let mut chunk = Vec::new();
    for (id, data) in ros_messages(drive) {
        let header: [(&str, &[u8]); 3] =
            [("op", &[2]), ("conn", &id.to_le_bytes()), ("time", &[0; 8])];
        chunk.extend(ros_record(&header, &data));
    }
    let size = u32::try_from(chunk.len()).unwrap().to_le_bytes();
    let header: [(&str, &[u8]); 3] = [("op", &[5]), ("compression", b"none"), ("size", &size)];
    let chunk = ros_record(&header, &chunk);
    let head = |index: u64| {
        let header: [(&str, &[u8]); 4] = [
            ("op", &[3]),
            ("index_pos", &index.to_le_bytes()),
            ("conn_count", &3_u32.to_le_bytes()),
            ("chunk_count", &1_u32.to_le_bytes()),
        ];
        let mut record = ros_record(&header, &[]);
        // Padded to 4096 bytes.
        let padding = 4096 - record.len();
        let at = record.len() - 4;
        record[at..].copy_from_slice(&u32::try_from(padding).unwrap().to_le_bytes());
        record.resize(4096, b' ');
        record
    };
    let magic = b"#ROSBAG V2.0\n";
    let index = magic.len() + 4096 + chunk.len();
    let head = head(index as u64);
    let mut bytes = [magic.as_slice(), &head, &chunk].concat();
    bytes.extend(connections.into_iter().flat_map(connection));
    bytes
}

#[test]
fn ros_bag_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "drive.bag", ros_bag(&drive()));
    let (log, warnings) = open(&path).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_drive(&log, EXACT);
    assert_eq!(log.gnss[0].sigma.position_m, Some(2.0));
    assert_eq!(log.gnss[0].sigma.height_m, Some(3.0));
}

#[test]
fn damage_of_a_bag_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = ros_bag(&drive());
    let end = bytes.len();
    let warning_of = |bytes: &[u8]| {
        let (log, warnings) = open(&file(folder.path(), "drive", bytes)).unwrap();
        assert_drive(&log, EXACT);
        warnings[0].found.clone()
    };
    let half = file(folder.path(), "drive", &bytes[..end / 2]);
    assert!(
        open(&half)
            .unwrap_err()
            .cause
            .contains("breaks off at byte")
    );
    let cut = warning_of(&[&bytes[..], &[200, 0, 0, 0, 7]].concat());
    assert_eq!(
        *cut,
        *format!("one that breaks off at byte {end} of {}", end + 5)
    );
    let header: [(&str, &[u8]); 2] = [("op", &[5]), ("compression", b"bz2")];
    let chunk = warning_of(&[bytes, ros_record(&header, b"no bz2")].concat());
    let expected = format!("1 of its chunks damaged, the first at byte {end}: left out");
    assert_eq!(*chunk, *expected);
    let mut mcap = mcap(&drive(), false);
    mcap.extend(mcap_chunk("lz4", b"no lz4"));
    assert!(warning_of(&mcap).starts_with("1 of its chunks"));
    mcap.extend(b"\x89MCAP0\r");
    assert!(warning_of(&[mcap, b"\n".to_vec()].concat()).starts_with("1 of its chunks"));
}

fn mcap_record(operation: u8, content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    [&[operation], length.as_slice(), content].concat()
}

fn mcap_text(text: &str) -> Vec<u8> {
    [
        &u32::try_from(text.len()).unwrap().to_le_bytes(),
        text.as_bytes(),
    ]
    .concat()
}

/// CDR encoding of ROS 2: each number aligned to its size, after a header of four bytes.
fn cdr(parts: &[&[u8]]) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    for part in parts {
        while (bytes.len() - 4) % part.len().min(8) != 0 {
            bytes.push(0);
        }
        bytes.extend_from_slice(part);
    }
    bytes
}

fn cdr_message(time_s: f64, parts: &[&[u8]]) -> Vec<u8> {
    let nanos = millis(time_s.fract()) * 1_000_000;
    let stamp = [rounded(time_s.floor()).cast_unsigned(), nanos, 5].map(u32::to_le_bytes);
    let head = stamp.iter().map(<[u8; 4]>::as_slice);
    let frame = b"link\0".chunks(1);
    let head: Vec<&[u8]> = head.chain(frame).collect();
    cdr(&[head, parts.to_vec()].concat())
}

fn mcap(drive: &Drive, compressed: bool) -> Vec<u8> {
    let mut records = Vec::new();
    for (id, topic, kind) in [
        (1_u16, "/imu", "sensor_msgs/msg/Imu"),
        (2, "/gps/fix", "sensor_msgs/msg/NavSatFix"),
        (3, "/gps/vel", "geometry_msgs/msg/TwistStamped"),
    ] {
        let id = id.to_le_bytes();
        let texts = [mcap_text(kind), mcap_text("ros2msg"), mcap_text("")].concat();
        records.extend(mcap_record(3, &[&id, texts.as_slice()].concat()));
        let texts = [mcap_text(topic), mcap_text("cdr"), mcap_text("")].concat();
        records.extend(mcap_record(4, &[&id, id.as_slice(), &texts].concat()));
    }
    let mut add = |channel: u16, data: Vec<u8>| {
        records.extend(mcap_record(
            5,
            &[&channel.to_le_bytes(), [0; 20].as_slice(), &data].concat(),
        ));
    };
    let flu = |v: Vector3<f64>| doubles(&[v.x, -v.y, -v.z]);
    for sample in &drive.imu {
        let (skipped, cov) = (doubles(&[0.0; 13]), doubles(&[0.0; 9]));
        let parts = [
            skipped.as_slice(),
            &flu(sample.gyro),
            &cov,
            &flu(sample.accel),
            &cov,
        ];
        add(1, cdr_message(sample.time_s, &parts));
    }
    for fix in &drive.gnss {
        let position = doubles(&[fix.lat_deg, fix.lon_deg, fix.height_m]);
        let cov = doubles(&[4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0]);
        add(
            2,
            cdr_message(fix.time_s, &[&[0], &[1, 0], &position, &cov, &[2]]),
        );
        let twist = doubles(&[fix.velocity.x, fix.velocity.y, fix.up_mps, 0.0, 0.0, 0.0]);
        add(3, cdr_message(fix.time_s, &[&twist]));
    }
    let mut compression = "";
    if compressed {
        let mut compressed = FrameEncoder::new(Vec::new());
        compressed.write_all(&records).unwrap();
        records = compressed.finish().unwrap();
        compression = "lz4";
    }
    [
        b"\x89MCAP0\r\n".as_slice(),
        &mcap_record(1, &[0; 8]),
        &mcap_chunk(compression, &records),
    ]
    .concat()
}

fn mcap_chunk(compression: &str, records: &[u8]) -> Vec<u8> {
    let length = (records.len() as u64).to_le_bytes();
    let chunk = [
        &[0; 28],
        mcap_text(compression).as_slice(),
        &length,
        records,
    ]
    .concat();
    mcap_record(6, &chunk)
}

#[test]
fn nested_mcap_chunks_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let nested = mcap_chunk("", &mcap_chunk("", &[]));
    let bytes = [b"\x89MCAP0\r\n".as_slice(), &nested].concat();
    let error = open(&file(folder.path(), "nested.mcap", bytes)).unwrap_err();
    assert_eq!(&*error.found, "a chunk within a chunk");
}

#[test]
fn mcap_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    for compressed in [false, true] {
        let path = file(folder.path(), "drive.mcap", mcap(&drive(), compressed));
        let (log, warnings) = open(&path).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_drive(&log, EXACT);
        assert_eq!(log.gnss[0].sigma.height_m, Some(3.0));
    }
}

// --- texts ---

/// With times in 1970, consistent with the NMEA dates.
fn euroc(drive: &Drive) -> String {
    let mut text = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],\
                    a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
        .to_owned();
    for sample in &drive.imu {
        let (g, a) = (sample.gyro, sample.accel);
        let nanos = u64::from(millis(sample.time_s)) * 1_000_000;
        writeln!(
            text,
            "{nanos},{},{},{},{},{},{}",
            g.x, -g.y, -g.z, a.x, -a.y, -a.z
        )
        .unwrap();
    }
    text
}

fn nmea(drive: &Drive) -> String {
    nmea_from(drive, 0.0)
}

/// Starts `clock_s` after midnight; across midnight, the sentence with the date comes first.
fn nmea_from(drive: &Drive, clock_s: f64) -> String {
    let mut text = String::new();
    let mut add = |body: String| {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        writeln!(text, "${body}*{sum:02X}\r").unwrap();
    };
    for fix in &drive.gnss {
        let minutes = |deg: f64, width: usize| {
            let rounded = deg.abs().floor();
            format!("{rounded:0width$.0}{:010.7}", 60.0 * (deg.abs() - rounded))
        };
        let position = format!(
            "{},N,{},W",
            minutes(fix.lat_deg, 2),
            minutes(fix.lon_deg, 3)
        );
        let seconds = clock_s + fix.time_s;
        let (day, of_day) = (1.0 + (seconds / 86_400.0).floor(), seconds % 86_400.0);
        let (hour, minute) = ((of_day / 3600.0).floor(), (of_day / 60.0).floor() % 60.0);
        let time = format!("{hour:02.0}{minute:02.0}{:06.3}", of_day % 60.0);
        let (speed, course) = speed_and_course(fix);
        let knots = speed * 3600.0 / 1852.0;
        let height = fix.height_m - 50.0;
        let mut both = [
            format!("GNGGA,{time},{position},1,09,1.0,{height:.3},M,50.0,M,,"),
            format!("GNRMC,{time},A,{position},{knots:.5},{course:.5},{day:02.0}0170,,,A"),
        ];
        both.rotate_left(usize::from(clock_s > 0.0));
        both.into_iter().for_each(&mut add);
        add(format!("GNGST,{time},1.0,,,,3.0,4.0,7.0"));
    }
    text
}

#[test]
fn vtg_velocities_belong_to_their_epoch_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let imu = file(folder.path(), "imu0.csv", euroc(&drive()));
    for vtg_first in [false, true] {
        let mut lines: Vec<String> = nmea(&drive()).lines().map(str::to_owned).collect();
        for (fix, lines) in drive().gnss.iter().zip(lines.chunks_mut(3)) {
            let (speed, course) = speed_and_course(fix);
            let knots = speed * 3600.0 / 1852.0;
            let body = format!("GNVTG,{course:.5},T,,M,{knots:.5},N,,K,A");
            let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
            // Instead of RMC.
            lines[1] = format!("${body}*{sum:02X}");
            lines[..2].rotate_left(usize::from(vtg_first));
        }
        let gnss = file(folder.path(), "log.nmea", lines.join("\n"));
        assert_nmea_drive(&[imu.clone(), gnss]);
    }
}

#[test]
fn nmea_with_inertial_samples_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let imu = file(folder.path(), "imu0.csv", euroc(&drive()));
    for clock_s in [0.0, 86_380.0] {
        let text = nmea_from(&drive(), clock_s);
        let gnss = file(folder.path(), "log.nmea", text);
        assert_nmea_drive(&[imu.clone(), gnss]);
    }
}

fn assert_nmea_drive(files: &[PathBuf]) {
    let (mut log, _) = read(files, Choice::default()).unwrap();
    // The offset is a whole number of seconds; motion determines it to a fraction.
    let offset_s = log.meta.gnss_clock_offset_s;
    let fraction_s = offset_s - offset_s.round();
    assert!(fraction_s.abs() < 0.1, "{offset_s}");
    for fix in &mut log.gnss {
        fix.time = fix.time.plus_seconds(fraction_s);
    }
    assert_drive(
        &log,
        Expected {
            within: 2e-3,
            climb: false,
            ..EXACT
        },
    );
    let level = log.gnss[0].sigma.position_m.unwrap();
    assert!((level - 12.5_f64.sqrt()).abs() < 1e-6);
    assert_eq!(log.gnss[0].sigma.height_m, Some(7.0));
}

#[test]
fn gnss_alone_is_rejected_with_the_cause() {
    let folder = tempfile::tempdir().unwrap();
    let error = open(&file(folder.path(), "log.nmea", nmea(&drive()))).unwrap_err();
    assert_eq!(
        &*error.cause,
        "none were logged: `import` takes a second file that has them"
    );
}

#[test]
fn rtklib_with_inertial_samples_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "% program   : RTKPOST\n%  GPST   latitude(deg) longitude(deg)  height(m)   Q  \
                    ns   sdn(m)   sde(m)   sdu(m)   vn(m/s)    ve(m/s)    vu(m/s)\n"
        .to_owned();
    for fix in drive().gnss {
        let v = fix.velocity;
        writeln!(
            text,
            "1970/01/01 00:00:{:06.3} {:.9} {:.9} {:.4} 1 9 0.01 0.01 0.02 {:.5} {:.5} {:.5}",
            fix.time_s, fix.lat_deg, fix.lon_deg, fix.height_m, v.y, v.x, fix.up_mps
        )
        .unwrap();
    }
    let imu = file(folder.path(), "imu0.csv", euroc(&drive()));
    let gnss = file(folder.path(), "solution.pos", text);
    let (log, warnings) = read(&[gnss, imu], Choice::default()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_drive(&log, EXACT);
}

/// With other separators and angle formats; longitudes from 0 to 360 deg.
#[test]
fn rtklib_of_any_format_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let imu = file(folder.path(), "imu0.csv", euroc(&drive()));
    let angle = |deg: f64| {
        let minutes = 60.0 * deg.fract();
        format!(
            "{:.0},{:.0},{:.7}",
            deg.trunc(),
            minutes.trunc(),
            60.0 * minutes.fract()
        )
    };
    for unit in ["deg", "d'\""] {
        let mut text = format!(
            "%  GPST    , latitude({unit}),longitude({unit}), height(m),  Q,    vn(m/s),    \
             ve(m/s),    vu(m/s)\n"
        );
        for fix in drive().gnss {
            let (lat, lon, v) = (fix.lat_deg, fix.lon_deg + 360.0, fix.velocity);
            let position = match unit {
                "deg" => format!("{lat:.9},{lon:.9}"),
                _ => format!("{},{}", angle(lat), angle(lon)),
            };
            writeln!(
                text,
                "1970/01/01 00:00:{:06.3}, {position}, {:.4}, 1, {:.5}, {:.5}, {:.5}",
                fix.time_s, fix.height_m, v.y, v.x, fix.up_mps
            )
            .unwrap();
        }
        let gnss = file(folder.path(), "solution.pos", text);
        let (log, warnings) = read(&[gnss, imu.clone()], Choice::default()).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_drive(&log, EXACT);
    }
}

/// The tables of a folder in one archive, after bytes that another format begins with.
fn zip(folder: &Path) -> PathBuf {
    let path = folder.join("phone.zip");
    let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    archive.start_file("Annotation.csv", stored).unwrap();
    archive.write_all(&[0xb5, 0x62, 1, 7, 0, 0, 1, 2]).unwrap();
    for name in ["Gyroscope.csv", "TotalAcceleration.csv", "Location.csv"] {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive
            .write_all(&fs::read(folder.join(name)).unwrap())
            .unwrap();
    }
    archive.finish().unwrap();
    path
}

#[test]
fn a_phone_recording_is_imported() {
    const START_S: f64 = 1_752_154_081.0;
    let folder = tempfile::tempdir().unwrap();
    let Drive { imu, gnss } = drive();
    let stamp = |time_s: f64| 1_752_154_081_000 + u64::from(millis(time_s));
    let table = |of: fn(&Sample) -> Vector3<f64>| {
        let mut text = "time,seconds_elapsed,z,y,x\n".to_owned();
        for sample in &imu {
            let v = of(sample);
            let nanos = stamp(sample.time_s) * 1_000_000;
            writeln!(text, "{nanos},{},{},{},{}", sample.time_s, -v.z, v.x, v.y).unwrap();
        }
        text
    };
    file(folder.path(), "Gyroscope.csv", table(|s| s.gyro));
    file(folder.path(), "TotalAcceleration.csv", table(|s| s.accel));
    let mut text =
        "time,horizontalAccuracy,speedAccuracy,speed,bearing,altitude,longitude,latitude\n"
            .to_owned();
    for fix in &gnss {
        let (speed, course) = speed_and_course(fix);
        writeln!(
            text,
            "{},3.02,0.3,{speed},{course},{},{},{}",
            stamp(fix.time_s) * 1_000_000,
            fix.height_m,
            fix.lon_deg,
            fix.lat_deg
        )
        .unwrap();
    }
    file(folder.path(), "Location.csv", text);
    let (log, warnings) = open(folder.path()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    // From a radius of 68 %.
    assert!((log.gnss[0].sigma.position_m.unwrap() - 2.0).abs() < 1e-9);
    let (from_zip, _) = open(&zip(folder.path())).unwrap();
    assert_eq!((&from_zip.imu, &from_zip.gnss), (&log.imu, &log.gnss));
    let expected = Expected {
        clock_s: START_S,
        climb: false,
        ..EXACT
    };
    assert_drive(&log, expected);
}

#[test]
fn kf_gins_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let Drive { imu, gnss } = drive();
    let (mut recordings_folder, mut fixes) = (String::new(), String::new());
    for s in &imu {
        let (g, a) = (s.gyro / IMU_HZ as f64, s.accel / IMU_HZ as f64);
        writeln!(
            recordings_folder,
            "{:.3} {} {} {} {} {} {}",
            s.time_s, g.x, g.y, g.z, a.x, a.y, a.z
        )
        .unwrap();
    }
    for f in &gnss {
        let v = f.velocity;
        writeln!(
            fixes,
            "{:.3} {} {} {} 1 1 2 {} {} {} 0.1 0.1 0.2",
            f.time_s, f.lat_deg, f.lon_deg, f.height_m, v.y, v.x, -f.up_mps
        )
        .unwrap();
    }
    let imu = file(folder.path(), "imu.txt", recordings_folder);
    let gnss = file(folder.path(), "gnss.txt", fixes);
    let (log, warnings) = read(&[imu, gnss], Choice::default()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_drive(&log, EXACT);
}

#[test]
fn gnss_ins_sim_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let Drive { imu, gnss } = drive();
    let rows = |header: &str, rows: Vec<String>| format!("{header}\n{}\n", rows.join("\n"));
    let vector = |v: Vector3<f64>| format!("{},{},{}", v.x, v.y, v.z);
    let put = |name: &str, text: String| file(folder.path(), name, text);
    put(
        "time.csv",
        rows(
            "time (sec)",
            imu.iter().map(|s| s.time_s.to_string()).collect(),
        ),
    );
    put(
        "gyro-0.csv",
        rows(
            "gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)",
            imu.iter()
                .map(|s| vector(s.gyro.map(f64::to_degrees)))
                .collect(),
        ),
    );
    put(
        "accel-0.csv",
        rows(
            "accel_x (m/s^2),accel_y (m/s^2),accel_z (m/s^2)",
            imu.iter().map(|s| vector(s.accel)).collect(),
        ),
    );
    put(
        "gps_time.csv",
        rows(
            "gps_time (sec)",
            gnss.iter().map(|f| f.time_s.to_string()).collect(),
        ),
    );
    let fix = |f: &Fix| {
        let v = Vector3::new(f.velocity.y, f.velocity.x, -f.up_mps);
        format!("{},{},{},{}", f.lat_deg, f.lon_deg, f.height_m, vector(v))
    };
    put(
        "gps-0.csv",
        rows(
            "gps_lat (deg),gps_lon (deg),gps_alt (m),vN,vE,vD",
            gnss.iter().map(fix).collect(),
        ),
    );
    let (log, warnings) = open(folder.path()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_drive(&log, EXACT);

    // A damaged row leaves the later ones at their times; a missing one does not.
    let intact = fs::read_to_string(folder.path().join("gyro-0.csv")).unwrap();
    let mut lines: Vec<&str> = intact.lines().collect();
    lines[100] = "1.5";
    put("gyro-0.csv", lines.join("\n"));
    let (damaged, warnings) = open(folder.path()).unwrap();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_eq!(damaged.imu.len() + 1, log.imu.len());
    assert!(damaged.imu.last() == log.imu.last());
    lines.remove(100);
    put("gyro-0.csv", lines.join("\n"));
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("rows as in"), "{error}");
}

#[test]
fn kitti_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let Drive { imu, gnss } = drive();
    let mut stamps = String::new();
    for (index, fix) in gnss.iter().enumerate() {
        let sample = &imu[index * IMU_HZ / FIX_HZ];
        writeln!(stamps, "1970-01-01 00:00:{:012.9}", fix.time_s).unwrap();
        let mut cells = [0.0; 30];
        cells[..3].copy_from_slice(&[fix.lat_deg, fix.lon_deg, fix.height_m]);
        (cells[6], cells[7], cells[10]) = (fix.velocity.y, fix.velocity.x, fix.up_mps);
        let flu = |v: Vector3<f64>| [v.x, -v.y, -v.z];
        cells[11..14].copy_from_slice(&flu(sample.accel));
        cells[17..20].copy_from_slice(&flu(sample.gyro));
        let text = cells.map(|cell| cell.to_string()).join(" ");
        file(folder.path(), &format!("oxts/data/{index:010}.txt"), text);
    }
    file(folder.path(), "oxts/timestamps.txt", stamps);
    let (log, _) = open(folder.path()).unwrap();
    assert_eq!((log.imu.len(), log.gnss.len()), (gnss.len(), gnss.len()));
    for (actual, fix) in log.gnss.iter().zip(&gnss) {
        assert_fix(actual, fix, EXACT);
    }
    let sample = &imu[IMU_HZ];
    let accel_error =
        log.imu.all()[FIX_HZ].accel - Vector3::new(sample.accel.y, sample.accel.x, -sample.accel.z);
    assert!(accel_error.norm() < 1e-9);
}

const COLUMNS: &str = r#"
[log]
body_axes = "FRD"
imu = "rates"
[columns.imu]
file = "raw.txt"
t_s = { column = "stamp", unit = "ms" }
gyro_x = { column = "wx", unit = "deg/s" }
gyro_y = { column = "wy", unit = "deg/s" }
gyro_z = { column = "wz", unit = "deg/s", sign = -1 }
accel_x = { column = "ax", unit = "g" }
accel_y = { column = "ay", unit = "g" }
accel_z = { column = "az", unit = "g" }
[columns.gnss]
file = "gps.txt"
t_s = "time"
lat_deg = { column = "lat", unit = "1e-7 deg" }
lon_deg = { column = "lon", unit = "1e-7 deg" }
h_m = { column = "alt", unit = "mm" }
speed_mps = { column = "speed", unit = "km/h" }
course_deg = "course"
vu = { column = "down", sign = -1 }
"#;

fn tables(folder: &Path, meta: &str) {
    let Drive { imu, gnss } = drive();
    let mut text = "stamp;wx;wy;wz;ax;ay;az\n".to_owned();
    for s in &imu {
        let (g, a) = (s.gyro.map(f64::to_degrees), s.accel / 9.80665);
        let stamp = millis(s.time_s);
        writeln!(
            text,
            "{stamp};{};{};{};{};{};{}",
            g.x, g.y, -g.z, a.x, a.y, a.z
        )
        .unwrap();
    }
    file(folder, "raw.txt", text);
    let mut text = "time lat lon alt speed course down\n".to_owned();
    for f in &gnss {
        let (speed, course) = speed_and_course(f);
        let (lat, lon, alt) = (1e7 * f.lat_deg, 1e7 * f.lon_deg, 1e3 * f.height_m);
        writeln!(
            text,
            "{} {lat:.0} {lon:.0} {alt:.0} {} {course} {}",
            f.time_s,
            3.6 * speed,
            -f.up_mps
        )
        .unwrap();
    }
    file(folder, "gps.txt", text);
    file(folder, "meta.toml", meta);
}

#[test]
fn tables_with_configured_columns_are_imported() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), COLUMNS);
    let (log, warnings) = open(folder.path()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_drive(&log, EXACT);
}

#[test]
fn rows_of_another_width_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), COLUMNS);
    let gps = fs::read_to_string(folder.path().join("gps.txt")).unwrap();
    let cut = |every: usize| {
        let lines = gps.lines().enumerate().map(|(index, line)| {
            let cells = if index % every == every - 1 { 4 } else { 7 };
            line.splitn(cells + 1, ' ')
                .take(cells)
                .collect::<Vec<_>>()
                .join(" ")
        });
        lines.collect::<Vec<_>>().join("\n")
    };
    // As a logger and a spreadsheet may begin.
    file(
        folder.path(),
        "gps.txt",
        format!("# receiver 1\nsep= \n{}", cut(25)),
    );
    let (_, warnings) = open(folder.path()).unwrap();
    assert!(
        warnings[0].to_string().contains("others in"),
        "{warnings:?}"
    );
    file(folder.path(), "gps.txt", cut(2));
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("others in"), "{error}");
}

#[test]
fn names_are_found_and_belong_to_the_cells() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), COLUMNS);
    let gps = fs::read_to_string(folder.path().join("gps.txt")).unwrap();
    // The first row has no velocity yet.
    let tabs = gps.replace(' ', "\t");
    let (names, rows) = tabs.split_once('\n').unwrap();
    let (first, rest) = rows.split_once('\n').unwrap();
    let first: Vec<&str> = first.split('\t').take(4).collect();
    let text = format!("#{names}\n{}\t\t\t\n{rest}", first.join("\t"));
    file(folder.path(), "gps.txt", text);
    let (log, warnings) = open(folder.path()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(log.gnss.len(), drive().gnss.len());
    let raw = fs::read_to_string(folder.path().join("raw.txt")).unwrap();
    let decimal_commas = raw.replace([';', '.'], ",");
    file(folder.path(), "raw.txt", decimal_commas);
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("a name for each cell"), "{error}");
}

#[test]
fn a_column_is_not_read_twice() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), &COLUMNS.replace("\"wy\"", "\"wx\""));
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(
        error.contains("gyro_y") && error.contains("gyro_x"),
        "{error}"
    );
}

#[test]
fn barometer_and_truth_with_configured_columns_are_read() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), COLUMNS);
    let (mut baro, mut truth) = (
        "t_s,h_m\n".to_owned(),
        "t_s,lat_deg,lon_deg,h_m,ve,vn,vu,roll_deg,pitch_deg,heading_deg\n".to_owned(),
    );
    for fix in drive().gnss {
        let (t, h, v) = (fix.time_s, fix.height_m, fix.velocity);
        let (lat, lon, up) = (fix.lat_deg, fix.lon_deg, fix.up_mps);
        writeln!(baro, "{t},{h:.2}").unwrap();
        writeln!(truth, "{t},{lat},{lon},{h},{},{},{up},0,0,0", v.x, v.y).unwrap();
    }
    file(folder.path(), "baro.csv", baro);
    file(folder.path(), "truth.csv", truth);
    let (log, warnings) = open(folder.path()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_heights(&log);
    assert_eq!(log.truth.len(), log.gnss.len());
}

#[test]
fn decimal_commas_are_read() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), COLUMNS);
    let raw = folder.path().join("raw.txt");
    let text = fs::read_to_string(&raw).unwrap().replace('.', ",");
    fs::write(&raw, text).unwrap();
    assert_drive(&open(folder.path()).unwrap().0, EXACT);
}

#[test]
fn rows_without_numbers_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    tables(folder.path(), COLUMNS);
    let gps = folder.path().join("gps.txt");
    let text = fs::read_to_string(&gps).unwrap();
    // One row, then all time stamps.
    fs::write(&gps, text.replacen('\n', "\n-\n", 1)).unwrap();
    let (_, warnings) = open(folder.path()).unwrap();
    assert!(warnings[0].found.starts_with("others in 1 of "));
    fs::write(&gps, text.replace('\n', "\n2026-05-04T")).unwrap();
    let error = open(folder.path()).unwrap_err();
    assert!(error.cause.contains("dates for seconds"), "{error}");
}

#[test]
fn other_keys_with_configured_columns_are_used() {
    let folder = tempfile::tempdir().unwrap();
    let keys = "imu = \"rates\"\ninitial_heading_deg = 90\ngrade = \"hg1700\"\n\
                lever_arm_m = [1, 2, 3]\ngnss_clock_offset_s = 0.25\nheading = 1\n";
    tables(folder.path(), &COLUMNS.replace("imu = \"rates\"\n", keys));
    let (log, warnings) = open(folder.path()).unwrap();
    let meta = &log.meta;
    assert_eq!(meta.initial_heading_deg, Some(90.0));
    assert_eq!(meta.grade, Some(Grade::Hg1700));
    assert_eq!(meta.lever_arm_rfu_m, Some(Vector3::new(2.0, 1.0, -3.0)));
    assert!((meta.gnss_clock_offset_s - 0.25).abs() < 1e-12);
    // The imported log has the standard columns.
    assert!(!meta.document.contains_key("columns"));
    let found: Vec<&str> = warnings.iter().map(|w| &*w.found).collect();
    assert_eq!(found, ["`heading`"]);
}

#[test]
fn errors_in_column_names_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let message = |from: &str, to: &str| {
        tables(folder.path(), &COLUMNS.replace(from, to));
        let error = open(folder.path()).unwrap_err();
        format!("expected {}, found {}", error.expected, error.found)
    };
    assert_eq!(
        message("\"course\"", "\"cog\""),
        "expected a column `cog`, found columns time, lat, lon, alt, speed, course, down"
    );
    assert_eq!(
        message("\"km/h\"", "\"kmh\""),
        "expected a unit of `speed_mps`, found kmh"
    );
    let gyro = "gyro_z = { column = \"wz\", unit = \"deg/s\", sign = -1 }\n";
    assert_eq!(message(gyro, ""), "expected a key `gyro_z`, found none");
    assert_eq!(
        message("gyro_z =", "gyro_zed ="),
        "expected one of the columns t_s, gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z, found \
         `gyro_zed`"
    );
    // Optional columns are checked, too.
    assert!(message("h_m =", "height =").ends_with("sd_v, sd_vu, found `height`"));
    assert_eq!(
        message("course_deg = \"course\"\n", ""),
        "expected a key `course_deg`, found none"
    );
    assert_eq!(
        message("sign = -1", "sign = 7"),
        "expected a sign of `gyro_z`, 1 or -1, found 7"
    );
    assert!(message("sign = -1", "scale = 7").starts_with("expected a valid entry"));
    // A unit of another quantity.
    assert_eq!(
        message("\"g\"", "\"deg\""),
        "expected a unit of `accel_x`, found deg"
    );
}

// --- all formats ---

#[test]
fn a_sensor_on_its_side_is_levelled() {
    let folder = tempfile::tempdir().unwrap();
    let mut tilted = drive();
    for sample in &mut tilted.imu {
        // Its y axis is up, its z axis right.
        let turn = |v: Vector3<f64>| Vector3::new(v.x, -v.z, v.y);
        sample.gyro = turn(sample.gyro);
        sample.accel = turn(sample.accel);
    }
    let path = file(folder.path(), "flight.bin", dataflash(&tilted));
    let (log, warnings) = open(&path).unwrap();
    assert!(
        warnings.iter().any(|w| w.cause.contains("quarter turns")),
        "{warnings:?}"
    );
    assert_drive(&log, EXACT);
}

#[test]
fn an_unknown_file_is_reported_with_the_known_formats() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "notes.txt", "nothing of the kind");
    let error = read(&[path], Choice::default()).unwrap_err();
    assert!(error.expected.starts_with("PX4 ULog, ArduPilot DataFlash"));
    assert!(error.cause.contains("[columns]"));
    for (path, cause) in [
        (
            folder.path().join("missing.bin"),
            "a wrong or misspelt path",
        ),
        (
            file(folder.path(), "empty.bin", ""),
            "the logger never wrote to it, or a copy failed",
        ),
    ] {
        assert_eq!(&*read(&[path], Choice::default()).unwrap_err().cause, cause);
    }
    // Files of a log folder get their own message.
    let notes = file(folder.path(), "imu.csv", "nothing of the kind");
    file(folder.path(), "meta.toml", "[log]\n");
    let cause = |paths: &[PathBuf]| read(paths, Choice::default()).unwrap_err().cause;
    for path in [folder.path().to_owned(), notes.clone()] {
        assert!(cause(&[path]).contains("no gnss.csv: write it there"));
    }
    file(folder.path(), "gnss.csv", "nothing of the kind");
    assert!(cause(std::slice::from_ref(&notes)).ends_with("give the folder"));
    let both = [folder.path().to_owned(), notes];
    assert!(cause(&both).contains("give it alone"));
}

#[test]
fn non_finite_values_are_left_out_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let mut drive = drive();
    drive.imu[800].gyro.z = f64::NAN;
    drive.gnss[70].up_mps = f64::INFINITY;
    // In fixes of the other formats it means unknown.
    let all = [
        (dataflash_of(&drive, &[1.0]), 2),
        (ulog(&drive), 1),
        (ros_bag(&drive), 1),
    ];
    for (bytes, lost) in all {
        let (log, warnings) = open(&file(folder.path(), "flight", bytes)).unwrap();
        assert_eq!(log.imu.all().len(), drive.imu.len() - 1);
        assert_eq!(warnings.len(), lost, "{warnings:?}");
        assert!(warnings.iter().all(|w| w.cause.contains("lost value")));
    }
    drive
        .imu
        .iter_mut()
        .step_by(15)
        .for_each(|s| s.accel.x = f64::NAN);
    let error = open(&file(folder.path(), "flight", ulog(&drive))).unwrap_err();
    assert_eq!(error.name.as_deref(), Some("sensor_combined"));
    assert!(
        error
            .cause
            .contains("201 like it: too many to leave out, at most 5 %"),
        "{error:?}"
    );
}

/// Damage at any byte: an error or a log, but no panic.
#[test]
fn damaged_recordings_cause_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive();
    let texts = [euroc(&drive), nmea(&drive)].map(String::into_bytes);
    let all = [
        vec![dataflash(&drive), ulog(&drive)],
        vec![ros_bag(&drive), mcap(&drive, true), mcap(&drive, false)],
        texts.to_vec(),
    ]
    .concat();
    for bytes in all {
        for seed in 0..20_usize {
            let mut damaged = bytes.clone();
            for k in 0..40_usize {
                let at = (seed * 7919 + k * 104_729 + k * k * 31) % damaged.len();
                damaged[at] = damaged[at].wrapping_add(u8::try_from(17 * (k + 1) % 256).unwrap());
            }
            damaged.truncate(damaged.len() - seed * damaged.len() / 40);
            let _ = open(&file(folder.path(), "damaged", damaged));
        }
    }
}

/// Recordings of the formats, if available.
fn recordings_folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/formats");
    folder.is_dir().then_some(folder)
}

/// Compared with the log converted by another program, to half of its last digit.
#[test]
fn a_real_flight_is_imported_like_its_log() {
    let Some(recordings_folder) = recordings_folder() else {
        println!("No recordings available.");
        return;
    };
    for (number, name) in [(1, "quad_joey1"), (2, "quad_joey1_imu2")] {
        let choice = Choice {
            imu: Some(number),
            gnss: None,
        };
        let (log, _) = read(
            &[recordings_folder.join("arducopter_3.1_joey1.bin")],
            choice,
        )
        .unwrap();
        let (made, _) = host_sim::log::read(&recordings_folder.join("../data").join(name)).unwrap();
        assert_eq!(
            (log.imu.len(), log.gnss.len()),
            (made.imu.len(), made.gnss.len())
        );
        for (a, b) in log.imu.iter().zip(made.imu.iter()) {
            assert_eq!(a.time, b.time);
            assert!((a.gyro - b.gyro).amax() < 1e-7 && (a.accel - b.accel).amax() < 1e-6);
        }
        for (a, b) in log.gnss.iter().zip(&made.gnss) {
            assert_eq!(a.time, b.time);
            let error = a
                .geodetic_or(0.0)
                .unwrap()
                .enu_from(&b.geodetic_or(0.0).unwrap());
            let velocity = a.velocity_enu_mps() - b.velocity_enu_mps();
            assert!(error.norm() < 1e-6 && velocity.amax() < 1e-4, "{a:?} {b:?}");
        }
    }
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut compressed = GzEncoder::new(Vec::new(), Compression::default());
    compressed.write_all(bytes).unwrap();
    compressed.finish().unwrap()
}

#[test]
fn compressed_tables_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let imu = file(
        folder.path(),
        "imu0.csv.gz",
        compressed(euroc(&drive()).as_bytes()),
    );
    let gnss = file(folder.path(), "log.nmea", nmea(&drive()));
    assert!(read(&[imu, gnss], Choice::default()).is_ok());
}

//! Command `tune`: conversions by worked examples, and complete logs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use host_sim::identify::analysis::{Analysis, Input};
use host_sim::identify::error_model::{Identified, Record};
use host_sim::identify::quantities::DEG_H_RADPS;
use host_sim::log::{self, BodyAxes, Compression, Grade, Log, LogError, Meta};
use host_sim::sim::car::Car;
use host_sim::sim::drive::Recording;
use host_sim::sim::motion::Mounted;
use host_sim::sim::vehicles::{Begin, Plane, Quadrotor};
use host_sim::sim::{ErrorModel, Motion, SimulatedDrive, record};
use host_sim::tune::targets::{self, Target};
use host_sim::tune::{Found, Tuning, Vehicle};
use indicatif::ProgressBar;
use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::Geodetic;
use nalgebra::{UnitQuaternion, Vector3};

// --- each target's sign, axes and units ---

fn known<const N: usize>(values: [f64; N]) -> [Found; N] {
    values.map(|value| Found::known(value, 0.001 * value.abs()))
}

/// A tuning without any known value, to be filled in.
fn unknown() -> Tuning {
    let drive = at_rest();
    let home = tempfile::tempdir().unwrap();
    tuning(&drive, home.path())
}

#[track_caller]
fn assert_prints(t: &Tuning, target: Target, lines: &[&str]) {
    let text = targets::text(t, target).unwrap();
    for line in lines {
        assert!(
            text.lines().any(|own| own.trim() == *line),
            "{line} not in\n{text}"
        );
    }
}

#[test]
fn px4_uses_frd_and_adds_to_existing_parameters() {
    let mut t = unknown();
    [t.gnss_delay_s] = known([0.122]);
    // 0.3 m to the left, 0.5 m behind, 1.2 m above.
    t.lever_arm_m = known([-0.3, -0.5, 1.2]);
    // A board with right side down, nose up and nose left.
    [t.mount.roll_rad, t.mount.pitch_rad, t.mount.heading_rad] = known([0.01, 0.05, -0.02]);
    // An up bias of 0.02 m/s^2 is -0.02 along down, and twice that before a scale of 0.5.
    t.accel_bias_mps2 = known([0.01, 0.03, 0.02]);
    for (name, value) in [("SCALE", 0.5), ("OFF", 0.0)] {
        t.parameters.insert(format!("CAL_ACC0_Z{name}"), value);
    }
    // (0.015 * 0.01)^2 a step, a hundred steps a second.
    [t.gyro_noise] = known([1.5e-3]);
    let lines = [
        "param set SENS_GPS0_DELAY 122",
        "param set SENS_GPS0_OFFX -0.50000",
        "param set SENS_GPS0_OFFY -0.30000",
        "param set SENS_GPS0_OFFZ -1.2000",
        "# SENS_BOARD_X_OFF: 0.57296 +- 0.00057 deg",
        "# SENS_BOARD_Y_OFF: 2.8648 +- 0.0029 deg",
        "# SENS_BOARD_Z_OFF: -1.1459 +- 0.0011 deg",
        "param set CAL_ACC0_ZOFF -0.040000",
        "# EKF2_GYR_NOISE: 0.015000 +- 0.000015 rad/s",
    ];
    assert_prints(&t, Target::Px4, &lines);
    // 110 ms were subtracted from time stamps before logging; 12 ms remain.
    [t.gnss_delay_s] = known([0.012]);
    t.source = "sensor_combined and vehicle_gps_position 0".to_owned();
    t.parameters.insert("SENS_GPS0_DELAY".to_owned(), 110.0);
    assert_prints(&t, Target::Px4, &["param set SENS_GPS0_DELAY 122"]);
}

#[test]
fn ardupilot_uses_frd() {
    let mut t = unknown();
    [t.gnss_delay_s] = known([0.22]);
    // 0.1 m to the right, 0.2 m ahead, 0.15 m above.
    t.lever_arm_m = known([0.1, 0.2, 0.15]);
    // A board with its nose up senses forward specific force at rest, which levelling stores as trim.
    [t.mount.roll_rad, t.mount.pitch_rad] = known([-0.01, 0.03]);
    t.accel_bias_mps2 = known([0.01, -0.02, 0.03]);
    t.source = "IMU 2 and GPS 1".to_owned();
    for (name, value) in [("SCAL_Z", 2.0), ("OFFS_X", 0.0), ("OFFS_Z", 0.0)] {
        t.parameters.insert(format!("INS_ACC2{name}"), value);
    }
    // (0.0137 * 0.012)^2 a step of 0.012 s.
    [t.gyro_noise] = known([1.5e-3]);
    let lines = [
        "GPS1_DELAY_MS,220",
        "GPS1_POS_X,0.20000",
        "GPS1_POS_Y,0.10000",
        "GPS1_POS_Z,-0.15000",
        "AHRS_TRIM_X,-0.010000",
        "AHRS_TRIM_Y,0.030000",
        "INS_ACC2OFFS_X,-0.020000",
        "INS_ACC2OFFS_Z,-0.015000",
        "# EK3_GYRO_P_NSE: 0.013693 +- 0.000014 rad/s",
    ];
    assert_prints(&t, Target::Ardupilot, &lines);
    // Parameters of the first IMU have no number.
    t.source = "IMU 1 and GPS 1".to_owned();
    t.parameters.insert("INS_ACCOFFS_X".to_owned(), 0.01);
    assert_prints(&t, Target::Ardupilot, &["INS_ACCOFFS_X,-0.010000"]);
}

#[test]
fn parameters_are_those_of_the_selected_sensor_and_receiver() {
    let mut t = unknown();
    [t.gnss_delay_s] = known([0.12]);
    t.lever_arm_m = known([0.0, 0.5, 0.0]);
    t.gyro_bias_radps = known([0.0, 0.0012, 0.0]);
    for (name, value) in [
        ("INS_GYROFFS_X", 0.1),
        ("INS_GYR3OFFS_X", 0.2),
        ("INS4_GYROFFS_X", 0.3),
        ("CAL_GYRO0_XOFF", 0.1),
        ("CAL_GYRO1_XOFF", 0.2),
    ] {
        t.parameters.insert(name.to_owned(), value);
    }
    let not_known = "# not set: which number the autopilot's parameters give this one is not known";
    for (target, source, lines, first) in [
        (
            Target::Ardupilot,
            "IMU 4 and GPS 2",
            vec!["INS4_GYROFFS_X,0.3012000", "GPS2_DELAY_MS,120"],
            "INS_GYROFFS_X",
        ),
        (
            Target::Ardupilot,
            "GYR and ACC 3 and GPS 2",
            vec![
                "INS_GYR3OFFS_X,0.2012000",
                "# before 4.6 GPS_DELAY_MS2",
                "# before 4.6 GPS_POS2_X",
            ],
            "GPS1_",
        ),
        (
            Target::Ardupilot,
            "IMU 1 and GPS 3",
            vec!["INS_GYROFFS_X,0.1012000", not_known],
            "\nGPS",
        ),
        (
            Target::Px4,
            "vehicle_imu 1 and sensor_gps 1",
            vec![
                "# CAL_GYRO1_XOFF: 0.0012000 +- 0.0000012 rad/s",
                not_known,
                "param set SENS_GPS1_DELAY 120",
                "param set SENS_GPS1_OFFX 0.50000",
            ],
            "CAL_GYRO0",
        ),
        (
            Target::Px4,
            "sensor_gyro and sensor_accel 1 and sensor_gps 2",
            vec![not_known, "# SENS_GPS2_DELAY: 120.00 +- 0.12 ms"],
            "param set SENS_GPS",
        ),
    ] {
        t.source = source.to_owned();
        assert_prints(&t, target, &lines);
        let text = targets::text(&t, target).unwrap();
        assert!(!text.contains(first), "{source}: {text}");
    }
    // With several sensors the one used is unknown.
    t.parameters.insert("CAL_GYRO1_ID".to_owned(), 5.0);
    t.source = "sensor_combined and vehicle_gps_position 0".to_owned();
    let text = targets::text(&t, Target::Px4).unwrap();
    assert!(!text.contains("param set CAL_"), "{text}");
    // Parameters bound to device ids need not have the instance numbers of the messages.
    t.parameters.insert("SENS_GPS0_ID".to_owned(), 7.0);
    t.source = "vehicle_imu 0 and sensor_gps 1".to_owned();
    let text = targets::text(&t, Target::Px4).unwrap();
    assert!(!text.contains("param set SENS_GPS"), "{text}");
}

#[test]
fn antenna_position_is_relative_to_the_configured_unit_position() {
    let mut t = unknown();
    t.lever_arm_m = known([0.0, -0.062, 0.0]);
    for name in ["EKF2_IMU_POS_X", "INS_POS1_X", "INS_POS3_X"] {
        let place = if name == "INS_POS3_X" { 2.5 } else { 1.5 };
        t.parameters.insert(name.to_owned(), place);
    }
    assert_prints(&t, Target::Px4, &["param set SENS_GPS0_OFFX 1.438000"]);
    assert_prints(&t, Target::Ardupilot, &["GPS1_POS_X,1.438000"]);
    t.source = "IMU 3 and GPS 1".to_owned();
    assert_prints(&t, Target::Ardupilot, &["GPS1_POS_X,2.438000"]);
}

#[test]
fn sensor_models_have_their_own_units() {
    let mut t = unknown();
    [t.gnss_delay_s] = known([0.122]);
    // dataset/kf-gins.yaml: 0.136 m ahead, 0.301 m to the left, 0.184 m above.
    t.lever_arm_m = known([-0.301, 0.136, 0.184]);
    t.gyro_bias_radps = known([1.0, 2.0, 3.0].map(|deg_h| deg_h * DEG_H_RADPS));
    // 0.011 m/s^2 is 1100 mGal.
    t.accel_bias_mps2 = known([0.03, 0.02, 0.011]);
    [t.gyro_noise, t.accel_noise] = known([1e-4, 1e-3]);
    [t.gyro_bias_wander, t.gyro_bias_correlation_s] = known([40.0 * DEG_H_RADPS, 1800.0]);
    // A fix stamped 10.122 is valid at 10.000 = 10.122 + shift.
    let shift = "# t_imu = t_gnss + shift: -0.12200 +- 0.00012 s";
    assert_prints(
        &t,
        Target::Kalibr,
        &[shift, "gyroscope_noise_density: 0.000100000"],
    );
    // Positions that are 50 ms later than velocities.
    t.gnss_position_delay_s = Found::known(0.05, 0.000_159);
    let lines = [
        "# delay of positions: 0.17200 +- 0.00020 s",
        "antlever: [0.13600, -0.30100, -0.18400]",
        "initgyrbias: [2.0000, 1.0000, -3.0000]",
        "initaccbias: [2000.0, 3000.0, -1100.0]",
        "arw: [0.34377, 0.34377, 0.34377]",
        "vrw: [0.060000, 0.060000, 0.060000]",
        "gbstd: [40.000, 40.000, 40.000]",
        "corrtime: 0.50000",
    ];
    assert_prints(&t, Target::KfGins, &lines);
    let added = "imu_err['accel_b'] = np.array([0.020000, 0.030000, -0.011000])";
    assert_prints(&t, Target::GnssInsSim, &[added]);
}

// --- whole logs ---

const MINUTES: f64 = 20.0;

/// Consumer sensors on a vehicle.
fn drive<M: Motion>(
    vehicle: M,
    mount: UnitQuaternion<f64>,
    antenna_m: Vector3<f64>,
) -> SimulatedDrive {
    let mut errors = ErrorModel::mems();
    errors.gnss.habits.lever_arm_m = (mount.inverse() * antenna_m).into();
    let recording = Recording {
        seed: 5,
        duration_s: 60.0 * MINUTES,
        imu_hz: 50.0,
        truth_every: 5,
        origin: Geodetic {
            latitude_rad: 0.84,
            longitude_rad: 0.2,
            height_m: 500.0,
        },
        errors,
    };
    record(Mounted::new(vehicle, mount), &recording)
}

fn log_of(drive: &SimulatedDrive, grade: Grade) -> Log {
    Log {
        meta: Meta {
            grade: Some(grade),
            ..Meta::new(BodyAxes::Frd, ErrorModel::mems().imu.output)
        },
        imu: drive.imu.clone().into(),
        gnss: drive.gnss.clone(),
        baro: Vec::new(),
        truth: Vec::new(),
    }
}

fn car() -> Car {
    Car::new(5, 60.0 * MINUTES, Some([30.0, 60.0]))
}

fn level_drive() -> SimulatedDrive {
    drive(car(), UnitQuaternion::identity(), Vector3::zeros())
}

/// Only the initial rest.
fn at_rest() -> SimulatedDrive {
    let mut drive = level_drive();
    drive.imu.truncate(1250);
    let end = drive.imu.last().unwrap().time;
    drive.gnss.retain(|fix| fix.time < end);
    drive
}

fn tuning(drive: &SimulatedDrive, folder: &Path) -> Tuning {
    let log = log_of(drive, Grade::Mems);
    fs::create_dir_all(folder).unwrap();
    log::write(&log, folder, Compression::Gzip).unwrap();
    let analysis = Analysis::of_log(folder, None, &ProgressBar::hidden()).unwrap();
    let model = Identified::new(
        &[Record::new(&analysis.log, &analysis.found)],
        Grade::Mems,
        None,
    );
    Tuning::new(&analysis, &model)
}

/// Within five sigmas.
fn is_within_sigmas(found: &Found, truth: f64) -> bool {
    found.is_known() && (found.value - truth).abs() < 5.0 * found.sigma
}

#[test]
fn mounting_in_a_car_is_estimated_and_printed_for_all_targets() {
    let angles = [0.03, -0.2, 0.4];
    let mount = from_euler(&Euler {
        roll_rad: angles[0],
        pitch_rad: angles[1],
        heading_rad: angles[2],
    });
    let antenna_m = Vector3::new(0.4, -0.8, 1.1);
    let drive = drive(car(), mount, antenna_m);
    let home = tempfile::tempdir().unwrap();
    let t = tuning(&drive, home.path());
    println!("{}", targets::text(&t, Target::Table).unwrap());
    assert_eq!(t.mount.vehicle, Vehicle::Car);
    let found = [t.mount.roll_rad, t.mount.pitch_rad, t.mount.heading_rad];
    assert!(
        found
            .iter()
            .zip(angles)
            .all(|(found, truth)| is_within_sigmas(found, truth))
    );
    assert!(is_within_sigmas(
        &t.gnss_delay_s,
        drive.errors.gnss_latency_s
    ));
    let arm = mount.inverse() * antenna_m;
    assert!(
        t.lever_arm_m
            .iter()
            .zip(arm.iter())
            .all(|(found, arm)| { !found.is_known() || is_within_sigmas(found, *arm) })
    );
    // The configuration is valid, and every output has its values.
    assert!(ins_core::Navigator::new(t.config).is_ok());
    let delay = format!("{:.0}", 1e3 * t.gnss_delay_s.value);
    for (target, line) in [
        (
            Target::Px4,
            format!("\nparam set SENS_GPS0_DELAY {delay}\n"),
        ),
        (Target::Ardupilot, format!("\nGPS1_DELAY_MS,{delay}\n")),
        (
            Target::Kalibr,
            format!("\ngyroscope_noise_density: {}\n", t.gyro_noise.digits()),
        ),
        (Target::KfGins, "\nimunoise:\n".to_owned()),
        (
            Target::GnssInsSim,
            "\nimu_err['gyro_arw'] = np.array([".to_owned(),
        ),
        (Target::Core, "\nconfig.sensors.gyro_noise = [".to_owned()),
        (Target::All, format!("\nGPS1_DELAY_MS,{delay}\n")),
    ] {
        let text = targets::text(&t, target).unwrap();
        assert!(text.contains(&line), "{target:?}: {line} not in\n{text}");
    }
    // Offsets are relative to the autopilot's parameters, which a log folder does not contain.
    let px4 = targets::text(&t, Target::Px4).unwrap();
    assert!(!px4.contains("param set CAL_"), "{px4}");
    let json = targets::text(&t, Target::Json).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["gnss_delay_s"]["value"], t.gnss_delay_s.value);
    assert!(json["accel_bias_walk"]["value"].is_null() && json["config"]["sensors"].is_object());
    let spread_s = 3.0 * t.gnss_delay_s.sigma;
    assert_eq!(json["config"]["gnss"]["latency_sigma_s"], spread_s);
}

#[test]
fn offsets_are_added_to_recorded_parameters() {
    let home = tempfile::tempdir().unwrap();
    let drive = level_drive();
    let mut t = tuning(&drive, home.path());
    t.source = "sensor_combined and vehicle_gps_position 0".to_owned();
    t.parameters.insert("SENS_GPS0_DELAY".to_owned(), 20.0);
    t.parameters.insert("CAL_GYRO0_XOFF".to_owned(), 0.5);
    let text = targets::text(&t, Target::Px4).unwrap();
    let delay = format!("SENS_GPS0_DELAY {:.0}\n", 20.0 + 1e3 * t.gnss_delay_s.value);
    let forward = t.gyro_bias_radps[1].plus(0.5).digits();
    assert!(text.contains(&delay), "{text}");
    assert!(
        text.contains(&format!("param set CAL_GYRO0_XOFF {forward}\n")),
        "{text}"
    );
    // A board that is rotated has sensors along other axes.
    t.parameters.insert("SENS_BOARD_ROT".to_owned(), 4.0);
    let text = targets::text(&t, Target::Px4).unwrap();
    assert!(!text.contains("param set CAL_"), "{text}");
}

#[test]
fn mounting_heading_is_observable_on_an_aircraft_not_on_a_multicopter() {
    let seconds = 60.0 * MINUTES;
    let home = tempfile::tempdir().unwrap();
    let level = UnitQuaternion::identity();
    let plane = Plane::new(5, seconds, [0.5, 0.8], Begin::OnGround);
    let t = tuning(
        &drive(plane, level, Vector3::zeros()),
        &home.path().join("plane"),
    );
    println!("{:?}", t.mount);
    assert_eq!(t.mount.vehicle, Vehicle::Aircraft);
    assert!(is_within_sigmas(&t.mount.heading_rad, 0.0) && !t.mount.pitch_rad.is_known());
    let quadrotor = Quadrotor::new(5, seconds, Some(20.0));
    let t = tuning(
        &drive(quadrotor, level, Vector3::zeros()),
        &home.path().join("quadrotor"),
    );
    println!("{:?}", t.mount);
    assert_eq!(t.mount.vehicle, Vehicle::Other);
    assert!(!t.mount.heading_rad.is_known() && !t.mount.roll_rad.is_known());
}

#[test]
fn json_names_axes_and_units() {
    let mut t = unknown();
    [t.mount.roll_rad] = known([0.01]);
    let json: serde_json::Value =
        serde_json::from_str(&targets::text(&t, Target::Json).unwrap()).unwrap();
    assert_eq!(json["axes"], "RFU");
    assert_eq!(json["mount"]["roll_rad"]["value"], 0.01);
}

#[test]
fn unknown_values_are_comments() {
    let t = unknown();
    assert!(!t.verdict.trusted && !t.gnss_delay_s.is_known());
    for target in [Target::Px4, Target::Ardupilot] {
        let text = targets::text(&t, target).unwrap();
        let value = |line: &&str| !line.starts_with('#') && line.contains("DELAY");
        assert_eq!(text.lines().find(value), None, "{text}");
        assert!(text.contains("not known; "), "{text}");
    }
}

#[test]
fn sensors_of_another_class_are_reported_in_the_verdict() {
    let drive = level_drive();
    let lines = [Grade::Mems, Grade::Hg1700].map(|grade| {
        let input = Input::of(String::new(), log_of(&drive, grade), Vec::new(), None);
        let analysis = Analysis::of_input(input, &ProgressBar::hidden()).unwrap();
        analysis.summary.verdict.lines().join("\n")
    });
    println!("{}\n{}", lines[0], lines[1]);
    assert!(lines[0].starts_with("Verdict: nothing speaks against"));
    assert!(lines[1].starts_with("Verdict: do NOT trust"));
}

#[test]
fn a_log_with_serious_warnings_is_not_trusted() {
    let warning = LogError {
        path: Path::new("imu.csv").into(),
        line: None,
        character: None,
        name: None,
        expected: "sensors that feel the motion".into(),
        found: "others".into(),
        cause: "gyro_x and gyro_y are swapped".into(),
        doubt: true,
    };
    let log = log_of(&level_drive(), Grade::Mems);
    let input = Input::of(String::new(), log, vec![warning], None);
    let analysis = Analysis::of_input(input, &ProgressBar::hidden()).unwrap();
    let verdict = analysis.summary.verdict;
    assert!(!verdict.trusted && verdict.lines()[1].contains("swapped"));
}

#[test]
fn sensor_selection_is_rejected_for_a_log_folder() {
    let home = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["tune", "--imu", "2"])
        .arg(home.path())
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && stderr.contains("leave them out"),
        "{stderr}"
    );
}

fn recordings_folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/formats");
    folder.is_dir().then_some(folder)
}

#[test]
fn recordings_are_accepted_directly() {
    let Some(folder) = recordings_folder() else {
        println!("No recordings available.");
        return;
    };
    let tune = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let output = command
            .current_dir(&folder)
            .arg("tune")
            .args(arguments)
            .output();
        let output = output.unwrap();
        (
            output.status.success(),
            String::from_utf8(output.stdout).unwrap(),
        )
    };
    let flight = "arducopter_3.1_joey1.bin";
    for sensor in ["1", "2"] {
        let (success, text) = tune(&[flight, "--imu", sensor, "--format", "ardupilot"]);
        assert!(success && text.starts_with("# ArduPilot"), "{text}");
        assert!(text.contains("Verdict: "), "{text}");
    }
    let (success, text) = tune(&[flight, "--json"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(
        success && json["parameters"]["AHRS_ORIENTATION"].is_number(),
        "{text}"
    );
    // No output on failure.
    assert_eq!(tune(&["sample.ulg"]), (false, String::new()));
}

//! The command `tune`: conversions by worked examples, and whole logs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use host_sim::identify::analysis::{Analysis, Input};
use host_sim::identify::error_model::{Identified, Record};
use host_sim::identify::quantities::DEG_H_RADPS;
use host_sim::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use host_sim::sim::car::Car;
use host_sim::sim::drive::Recording;
use host_sim::sim::motion::Mounted;
use host_sim::sim::vehicles::{Begin, Plane, Quadrotor};
use host_sim::sim::{ErrorModel, Motion, SimulatedDrive, record};
use host_sim::tune::targets::{
    self, Target, a_step, ardupilot, gnss_ins_sim, kalibr, kf_gins, px4,
};
use host_sim::tune::{Found, Mount, Tuning, Vehicle, config};
use indicatif::ProgressBar;
use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::Geodetic;
use nalgebra::{UnitQuaternion, Vector3};

// --- each target's sign, axes and units ---

fn known(values: [f64; 3]) -> [Found; 3] {
    values.map(|value| Found::known(value, 0.01))
}

fn values<const N: usize>(found: [Found; N]) -> [f64; N] {
    found.map(|found| found.value)
}

fn near<const N: usize>(found: [Found; N], expected: [f64; N]) -> bool {
    let off = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6 * b.abs().max(1e-6);
    values(found).iter().zip(&expected).all(off)
}

/// Right side down, nose up, clockwise.
fn mounted(angles: [f64; 3]) -> Mount {
    let [roll, pitch, heading] = known(angles);
    Mount {
        vehicle: Vehicle::Car,
        roll,
        pitch,
        heading,
        spread_rad: None,
    }
}

#[test]
fn px4_takes_the_latency_and_adds_what_the_stamps_are_free_of() {
    assert!(near(
        [px4::delay_ms(Found::known(0.122, 0.001), 0.0)],
        [122.0]
    ));
    // 110 ms were taken from the stamps before they were logged, and 12 ms are left.
    assert!(near(
        [px4::delay_ms(Found::known(0.012, 0.001), 110.0)],
        [122.0]
    ));
}

#[test]
fn px4_counts_forward_right_down() {
    // 0.3 m to the left, 0.5 m behind, 1.2 m above.
    assert!(near(
        px4::antenna_m(&known([-0.3, -0.5, 1.2])),
        [-0.5, -0.3, -1.2]
    ));
    // A board with its right side down and its nose up is turned by as much, nose to the left.
    let board = px4::board_deg(&mounted([0.01, 0.05, -0.02]));
    assert!(near(board, [0.572_957_8, 2.864_789, -1.145_915_6]));
    // 0.02 m/s^2 too much along up is too little along down, and as much more before a scale of 0.5.
    assert!(near(
        px4::offsets(&known([0.0, 0.0, 0.02]), [1.0, 1.0, 0.5]),
        [0.0, 0.0, -0.04]
    ));
}

#[test]
fn noise_of_a_step_adds_up_to_the_density() {
    let sigma = a_step(Found::known(1.5e-3, 1e-4), px4::STEP_S).value;
    assert!((sigma - 1.5e-2).abs() < 1e-12);
    // (0.015 * 0.01)^2 a step, a hundred steps a second.
    assert!(((sigma * 0.01).powi(2) * 100.0 - 1.5e-3_f64.powi(2)).abs() < 1e-15);
    let sigma = a_step(Found::known(1.5e-3, 1e-4), ardupilot::STEP_S).value;
    assert!(((sigma * 0.012).powi(2) / 0.012 - 1.5e-3_f64.powi(2)).abs() < 1e-15);
}

#[test]
fn ardupilot_counts_forward_right_down() {
    assert!(near(
        [ardupilot::delay_ms(Found::known(0.22, 0.005))],
        [220.0]
    ));
    // 0.1 m to the right, 0.2 m ahead, 0.15 m above.
    assert!(near(
        ardupilot::antenna_m(&known([0.1, 0.2, 0.15])),
        [0.2, 0.1, -0.15]
    ));
    // A board with its nose up reads specific force forwards at rest: what levelling keeps as trim.
    assert!(near(
        ardupilot::trim_rad(&mounted([-0.01, 0.03, 1.0])),
        [-0.01, 0.03]
    ));
    let found = ardupilot::offsets(&known([0.01, -0.02, 0.03]), [1.0, 1.0, 2.0]);
    assert!(near(found, [-0.02, 0.01, -0.015]));
    assert_eq!(ardupilot::number("IMU 1 and GPS 1"), "");
    assert_eq!(ardupilot::number("IMU 2 and GPS 1"), "2");
}

#[test]
fn kalibr_adds_a_shift_to_the_other_stamp() {
    // Stamped 10.122, it shows 10.000: 10.000 = 10.122 + shift.
    assert!(near(
        [kalibr::shift_s(Found::known(0.122, 0.001))],
        [-0.122]
    ));
}

#[test]
fn kf_gins_gets_its_own_example_and_units() {
    // dataset/kf-gins.yaml: 0.136 m ahead, 0.301 m to the left, 0.184 m above.
    let arm = kf_gins::antlever_m(&known([-0.301, 0.136, 0.184]));
    assert!(near(arm, [0.136, -0.301, -0.184]));
    let bias = known([1.0, 2.0, 3.0]).map(|found| found.scaled(DEG_H_RADPS));
    assert!(near(kf_gins::gyrbias_deg_h(&bias), [2.0, 1.0, -3.0]));
    // 0.01 m/s^2 is 1000 mGal.
    assert!(near(
        kf_gins::accbias_mgal(&known([0.0, 0.0, 0.01])),
        [0.0, 0.0, -1000.0]
    ));
    assert!(near(
        [kf_gins::arw(Found::known(1e-4, 1e-6))],
        [0.343_774_7]
    ));
    assert!(near([kf_gins::vrw(Found::known(1e-3, 1e-5))], [0.06]));
    let wander = kf_gins::wander(
        Found::known(40.0 * DEG_H_RADPS, 1e-6),
        Found::known(1800.0, 9.0),
    );
    assert!(near(wander, [40.0, 0.5]));
}

#[test]
fn gnss_ins_sim_adds_offsets_to_the_truth() {
    assert!(near(
        gnss_ins_sim::accel_b(&known([0.01, 0.02, 0.03])),
        [0.02, 0.01, -0.03]
    ));
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
        truth: Vec::new(),
    }
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

/// Within five of its own sigmas: the drive is one of many.
fn right(found: &Found, truth: f64) -> bool {
    found.is_known() && (found.value - truth).abs() < 5.0 * found.sigma
}

#[test]
fn a_tilted_unit_in_a_car_is_found_and_printed_for_all() {
    let angles = [0.03, -0.2, 0.4];
    let mount = from_euler(&Euler {
        roll_rad: angles[0],
        pitch_rad: angles[1],
        heading_rad: angles[2],
    });
    let antenna_m = Vector3::new(0.4, -0.8, 1.1);
    let car = Car::new(5, 60.0 * MINUTES, Some([30.0, 60.0]));
    let drive = drive(car, mount, antenna_m);
    let home = tempfile::tempdir().unwrap();
    let t = tuning(&drive, home.path());
    println!("{}", targets::text(&t, Target::Table).unwrap());
    assert_eq!(t.mount.vehicle, Vehicle::Car);
    let found = [t.mount.roll, t.mount.pitch, t.mount.heading];
    assert!(
        found
            .iter()
            .zip(angles)
            .all(|(found, truth)| right(found, truth))
    );
    assert!(right(&t.gnss_delay_s, drive.errors.gnss_latency_s));
    let arm = mount.inverse() * antenna_m;
    assert!(
        t.lever_arm_m
            .iter()
            .zip(arm.iter())
            .all(|(found, arm)| { !found.is_known() || right(found, *arm) })
    );
    // The configuration flies, and all files are written, each value beside its sigma.
    let again = config(&t, t.config);
    assert_eq!(again, t.config);
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
    // Offsets add to what was set, which a log folder does not hold.
    let px4 = targets::text(&t, Target::Px4).unwrap();
    assert!(!px4.contains("param set CAL_"), "{px4}");
    let json = targets::text(&t, Target::Json).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["gnss_delay_s"]["value"], t.gnss_delay_s.value);
    assert!(json["accel_bias_walk"]["value"].is_null() && json["config"]["sensors"].is_object());
}

#[test]
fn what_was_set_in_the_recording_is_added_to() {
    let home = tempfile::tempdir().unwrap();
    let car = Car::new(5, 60.0 * MINUTES, Some([30.0, 60.0]));
    let drive = drive(car, UnitQuaternion::identity(), Vector3::zeros());
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
fn an_aircraft_shows_its_heading_and_a_multicopter_nothing() {
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
    assert!(right(&t.mount.heading, 0.0) && !t.mount.pitch.is_known());
    let quadrotor = Quadrotor::new(5, seconds, Some(20.0));
    let t = tuning(
        &drive(quadrotor, level, Vector3::zeros()),
        &home.path().join("quadrotor"),
    );
    println!("{:?}", t.mount);
    assert_eq!(t.mount.vehicle, Vehicle::Other);
    assert!(!t.mount.heading.is_known() && !t.mount.roll.is_known());
}

#[test]
fn what_is_not_known_is_a_comment() {
    let home = tempfile::tempdir().unwrap();
    // It never leaves the place it rests at.
    let car = Car::new(5, 60.0 * MINUTES, Some([30.0, 60.0]));
    let mut drive = drive(car, UnitQuaternion::identity(), Vector3::zeros());
    drive.imu.truncate(1250);
    let end = drive.imu.last().unwrap().time;
    drive.gnss.retain(|fix| fix.time < end);
    let t = tuning(&drive, home.path());
    assert!(!t.verdict.trusted && !t.gnss_delay_s.is_known());
    for target in [Target::Px4, Target::Ardupilot] {
        let text = targets::text(&t, target).unwrap();
        let value = |line: &&str| !line.starts_with('#') && line.contains("DELAY");
        assert_eq!(text.lines().find(value), None, "{text}");
        assert!(text.contains("not known; "), "{text}");
    }
}

#[test]
fn sensors_of_another_class_are_told_in_the_verdict() {
    let car = Car::new(5, 60.0 * MINUTES, Some([30.0, 60.0]));
    let drive = drive(car, UnitQuaternion::identity(), Vector3::zeros());
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
fn sensors_are_not_chosen_in_a_log_folder() {
    let home = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["tune", "--imu", "2"])
        .arg(home.path())
        .output()
        .unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && told.contains("leave them out"),
        "{told}"
    );
}

fn samples() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/formats");
    folder.is_dir().then_some(folder)
}

#[test]
fn recordings_are_taken_as_they_are() {
    let Some(folder) = samples() else {
        println!("No recordings to try.");
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
        let (well, text) = tune(&[flight, "--imu", sensor, "--format", "ardupilot"]);
        assert!(well && text.starts_with("# ArduPilot"), "{text}");
        assert!(text.contains("Verdict: "), "{text}");
    }
    let (well, text) = tune(&[flight, "--json"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(
        well && json["parameters"]["AHRS_ORIENTATION"].is_number(),
        "{text}"
    );
    // Nothing of what fails.
    assert_eq!(tune(&["sample.ulg"]), (false, String::new()));
}

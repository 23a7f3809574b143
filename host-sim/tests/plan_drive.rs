//! Plans of drives, from outside.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use host_sim::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use host_sim::sim::drive::Recording;
use host_sim::sim::profile::Profile;
use host_sim::sim::{DriveConfig, Kinematics, Motion, record};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

fn plan_drive(home: &Path, target: &str, options: &[&str]) -> Output {
    fs::write(home.join("target.toml"), target).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let command = command.current_dir(home);
    let plan = ["plan-drive", "--target", "target.toml"];
    command.args(plan).args(options).output().unwrap()
}

fn planned(home: &Path, target: &str, options: &[&str]) -> Value {
    let output = plan_drive(home, target, &[options, &["--json"]].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn of<'a>(reached: &'a Value, quantity: &str) -> &'a Value {
    let all = reached.as_array().unwrap();
    let found = all.iter().find(|one| one["quantity"] == quantity);
    found.unwrap_or_else(|| panic!("no {quantity} in {reached}"))
}

/// Why a quantity is not reached.
fn why<'a>(plan: &'a Value, quantity: &str) -> &'a str {
    of(&plan["unreached"], quantity)["why"].as_str().unwrap()
}

fn manoeuvres(plan: &Value) -> Vec<&str> {
    let stages = plan["stages"].as_array().unwrap().iter();
    stages
        .map(|stage| stage["manoeuvre"].as_str().unwrap())
        .collect()
}

const SHIPPED: &str = include_str!("../targets/drive_target.toml");

#[test]
fn sigmas_shrink_until_all_are_what_is_wanted() {
    let home = tempfile::tempdir().unwrap();
    let plan = planned(home.path(), SHIPPED, &["--out", "plan"]);
    assert_eq!(plan["reached"], true);
    let stages = plan["stages"].as_array().unwrap();
    let end = stages.last().unwrap();
    assert!(end["end_s"].as_f64().unwrap() < 20.0 * 60.0);
    for before in plan["before"].as_array().unwrap() {
        let quantity = before["quantity"].as_str().unwrap();
        let after = of(&end["reached"], quantity);
        let [was, is, wanted] =
            [&before["sigma"], &after["sigma"], &after["target"]].map(|v| v.as_f64().unwrap());
        assert!(
            is <= wanted && is < 0.5 * was,
            "{quantity}: {was} to {is} of {wanted}"
        );
        assert!(before["observable"] == false && after["observable"] == true);
    }
    // One stage less is not enough.
    let last_but_one = &stages[stages.len() - 2]["reached"];
    let misses = |one: &Value| {
        one["observable"] == false
            || one["sigma"].as_f64().unwrap() > one["target"].as_f64().unwrap()
    };
    assert!(last_but_one.as_array().unwrap().iter().any(misses));
    let written = |name: &str| fs::read_to_string(home.path().join("plan").join(name)).unwrap();
    assert_eq!(
        serde_json::from_str::<Value>(&written("plan.json")).unwrap(),
        plan
    );
    assert_eq!(written("drive.txt").lines().count(), stages.len());
    assert!(written("drive.txt").starts_with("1. Stop and stand still"));
    assert!(written("route.svg").starts_with("<svg"));
    assert!(written("report.html").contains("What is known after each stage"));
}

#[test]
fn a_plan_is_the_same_whatever_the_number_of_threads() {
    let home = tempfile::tempdir().unwrap();
    let target = "target.azimuth_deg = 0.2\ntarget.accel_bias_mg = 1.0";
    let on = |threads: &str| {
        fs::write(home.path().join("target.toml"), target).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let command = command
            .current_dir(home.path())
            .env("RAYON_NUM_THREADS", threads);
        let plan = ["plan-drive", "--target", "target.toml", "--json"];
        command.args(plan).output().unwrap().stdout
    };
    let one = on("1");
    assert!(!one.is_empty() && one == on("3"));
}

/// The last step, a fifth of what was driven and more, is cut.
#[test]
fn a_plan_ends_within_what_the_site_allows() {
    let home = tempfile::tempdir().unwrap();
    let target = "
        [target]
        azimuth_deg = 0.02
        accel_bias_mg = 0.05
        [site]
        longest_minutes = 4";
    let plan = planned(home.path(), target, &[]);
    assert_eq!(plan["reached"], false);
    let stages = plan["stages"].as_array().unwrap();
    let end_s = stages.last().unwrap()["end_s"].as_f64().unwrap();
    // Any manoeuvre takes less than a minute here, so that none is left out that fits.
    assert!((180.0..=240.0).contains(&end_s), "{end_s}");
}

#[test]
fn what_no_drive_shows_is_said_with_the_reason() {
    let home = tempfile::tempdir().unwrap();
    let straight = "
        [target]
        accel_bias_mg = { y = 1.0 }
        turn_scale_percent = 0.1
        gyro_scale_percent = { z = 0.1 }
        [site]
        manoeuvres = [\"stand\", \"start_and_brake\", \"cruise\"]
        longest_minutes = 12";
    let plan = planned(home.path(), straight, &[]);
    assert_eq!(plan["reached"], false);
    for quantity in ["accelerometer y", "gyro scale, vertical"] {
        let why = why(&plan, quantity);
        assert!(
            why.contains("the site does not allow what shows it"),
            "{quantity}: {why}"
        );
    }
    let why_scale = why(&plan, "gyro scale z");
    assert!(
        why_scale.contains("no manoeuvre of a car tips the unit"),
        "{why_scale}"
    );
    // One attitude of the mount, and sensors that may be misaligned against each other.
    let misaligned = "
        [target]
        accel_bias_mg = { x = 0.2, z = 0.2 }
        [site]
        longest_minutes = 12
        [config]
        sensors.misalignment_rad = 1e-3";
    let plan = planned(home.path(), misaligned, &[]);
    let why_bias = why(&plan, "accelerometer x");
    assert!(
        why_bias.contains("at one attitude of the mount"),
        "{why_bias}"
    );
    // 1 mrad of g.
    let left = of(&plan["unreached"], "accelerometer x")["sigma"]
        .as_f64()
        .unwrap();
    assert!((0.9..1.3).contains(&left), "{left}");
    let standing = "
        [target]
        azimuth_deg = 1.0
        [site]
        manoeuvres = [\"stand\"]";
    let plan = planned(home.path(), standing, &[]);
    let why_azimuth = why(&plan, "azimuth");
    assert!(
        why_azimuth.starts_with("the site does not allow what shows it: level and heading")
            && !why_azimuth.ends_with('.'),
        "{why_azimuth}"
    );
}

/// A log of straight driving: the plan for a site without turns, recorded.
#[test]
fn a_log_of_straight_driving_is_told_to_turn() {
    let home = tempfile::tempdir().unwrap();
    straight_log(&home.path().join("straight"));
    let target = "
        [target]
        azimuth_deg = 0.5
        accel_bias_mg = 1.0";
    let plan = planned(home.path(), target, &["straight"]);
    assert_eq!(plan["log"], "straight");
    let before = &plan["before"];
    assert_eq!(of(before, "azimuth")["observable"], true);
    assert_eq!(of(before, "accelerometer y")["observable"], false);
    assert_eq!(plan["reached"], true, "{plan:#}");
    let turns = ["block", "there_and_back", "roundabout", "figure_eight"];
    let told = manoeuvres(&plan);
    assert!(told.iter().any(|one| turns.contains(one)), "{told:?}");
    assert!(told.len() <= 2, "{told:?}");
    // Nothing is added to what shows everything, and a site without turns cannot help.
    let easy = "[target]\nazimuth_deg = 1.5";
    let plan = planned(home.path(), easy, &["straight", "--out", "easy"]);
    assert!(plan["reached"] == true && manoeuvres(&plan).is_empty());
    let page = fs::read_to_string(home.path().join("easy/report.html")).unwrap();
    assert!(page.contains("after straight") && !page.contains("Route and course"));
    let no_turns = format!("{target}\n[site]\nmanoeuvres = [\"stand\", \"start_and_brake\"]");
    let plan = planned(home.path(), &no_turns, &["straight"]);
    assert!(why(&plan, "accelerometer y").contains("the site does not allow what shows it"));
}

/// Ring lasers are taken to be at the antenna, and to be better than what is wanted here.
#[test]
fn a_log_shows_an_antenna_that_is_wanted_and_what_is_sharper_than_wanted() {
    let home = tempfile::tempdir().unwrap();
    let mut drive = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let drive = drive.current_dir(home.path());
    let drive = drive.args(["drive", "--minutes", "6", "--seed", "2", "--out", "log"]);
    assert!(drive.output().unwrap().status.success());
    let target = "[target]\nlever_arm_m = { x = 0.1 }\ngyro_bias_deg_h = { x = 30.0 }";
    let plan = planned(home.path(), target, &["log"]);
    assert_eq!(plan["reached"], true, "{plan:#}");
    assert!(!manoeuvres(&plan).is_empty());
}

/// Starts and brakings along a straight road.
struct Straight(Profile);

impl Motion for Straight {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let speed = self.0.at(time_s);
        Kinematics {
            velocity_enu_mps: Vector3::new(0.0, speed.value, 0.0),
            acceleration_enu_mps2: Vector3::new(0.0, speed.slope, 0.0),
            attitude: UnitQuaternion::identity(),
            angular_rate_lb_b_radps: Vector3::zeros(),
        }
    }
}

fn straight_log(folder: &Path) {
    let mut speed = Profile::new(0.0);
    let mut now_s = 30.0;
    for _ in 0..6 {
        now_s = speed.step_to(14.0, now_s, 2.0, 1.0);
        now_s = speed.step_to(0.0, now_s + 5.0, 2.0, 1.0) + 5.0;
    }
    let recording = Recording {
        duration_s: now_s,
        ..DriveConfig::new(3, Grade::Mems, 1.0).recording
    };
    let drive = record(Straight(speed), &recording);
    let log = Log {
        meta: Meta {
            grade: Some(Grade::Mems),
            ..Meta::new(BodyAxes::Frd, recording.errors.imu.output)
        },
        imu: drive.imu.into(),
        gnss: drive.gnss,
        baro: Vec::new(),
        truth: Vec::new(),
    };
    fs::create_dir(folder).unwrap();
    log::write(&log, folder, Compression::Plain).unwrap();
}

#[test]
fn a_target_file_is_refused_with_its_place() {
    let home = tempfile::tempdir().unwrap();
    for (target, said) in [
        (
            "[target]\nazimuth = 1",
            "target.toml, line 2: `azimuth` cannot be wanted; expected one of azimuth_deg,",
        ),
        (
            "[target]\n\nazimuth_deg = -1",
            "line 3: `azimuth_deg`: expected a sigma above zero",
        ),
        (
            "[target]\naccel_bias_mg = { w = 1.0 }",
            "some of `{ x = 1.0, y = 1.0, z = 1.0 }`",
        ),
        ("[target]", "nothing is wanted"),
        (
            "[target]\nazimuth_deg = 1\n[site]\nspeed_kmh = 5",
            "line 4: `speed_kmh = 5`: expected 10 to 250",
        ),
        // A comment may name the key, too.
        (
            "# speed_kmh: slow\n[target]\nazimuth_deg = 1\n[site]\nspeed_kmh = 5",
            "line 5: `speed_kmh = 5`: expected 10 to 250",
        ),
        (
            "[target]\nazimuth_deg = 1\n[unit]\nantenna_m = [nan, 0, 0]",
            "line 4: `antenna_m = NaN`: expected -30 to 30",
        ),
        (
            "[target]\nazimuth_deg = 1\n[site]\nmanoeuvres = [\"loop\"]",
            "line 4: unknown variant `loop`",
        ),
        (
            "[target]\nazimuth_deg = 1\n[errors]\ngnss.rate_hz = 0",
            "target.toml, line 4: [errors]: gnss.rate_hz = 0: expected more than zero",
        ),
        (
            "[target]\nazimuth_deg = 1\n[config]\ngnss.rate_hz = 1",
            "target.toml, line 4: [config]: `gnss.rate_hz` is not known",
        ),
        // A whole number is a number: it is the other key that is refused.
        (
            "[target]\nazimuth_deg = 1\n[unit]\nsensors = \"mems\"\n[config]\nmax_gap_s = 1\nmax_gap = 1",
            "target.toml, line 7: [config]: `max_gap` is not known",
        ),
    ] {
        let output = plan_drive(home.path(), target, &["--out", "plan"]);
        let told = String::from_utf8_lossy(&output.stderr).replace(['\n', '\u{2502}'], " ");
        let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            !output.status.success() && told.contains(said),
            "{target}: {told}"
        );
        assert!(!home.path().join("plan").exists());
    }
}

#[test]
fn what_is_predicted_is_what_drives_reach() {
    let home = tempfile::tempdir().unwrap();
    let target = "
        [target]
        azimuth_deg = 0.1
        accel_bias_mg = 0.15
        [unit]
        sensors = \"hg1700\"";
    fs::write(home.path().join("target.toml"), target).unwrap();
    let study = [
        "study",
        "plan-drive",
        "--target",
        "target.toml",
        "--runs",
        "48",
        "--json",
    ];
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command
        .current_dir(home.path())
        .args(study)
        .output()
        .unwrap();
    let results: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(results[0]["without_solution"], 0);
    let rows = results[0]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    for row in rows {
        // Of 48 errors the RMS is good to a tenth; azimuths are predicted up to 1.45 times too large.
        let ratio = row["ratio"].as_f64().unwrap();
        assert!((0.6..1.9).contains(&ratio), "{row}");
    }
}

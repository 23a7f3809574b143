//! Invalid aircraft files and flight plans, and their messages.

use std::path::Path;

use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::input::read_aircraft;
use host_sim::aircraft::plan::Plan;
use host_sim::aircraft::{CESSNA_172_TOML, cessna172};

#[test]
fn invalid_aircraft_are_rejected_with_line_and_cause() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("aircraft.toml");
    for (good, bad, message) in [
        (
            "mass_kg = 1043.0",
            "mass_kg = -1043.0",
            "expected a positive number",
        ),
        ("mass_kg = 1043.0", "mass = 1043.0", "unknown field `mass`"),
        ("mass_kg = 1043.0", "", "missing field `mass_kg`"),
        (
            "wing_span_m = 10.912",
            "wing_span_m = nan",
            "expected a positive number",
        ),
        ("name = ", "name ", "complete example"),
        (
            "alpha = -0.89 ",
            "alpha = nan ",
            "`pitch.alpha = NaN`: expected a number",
        ),
        (
            "elevator = -1.28",
            "elevator = 0.0",
            "`pitch.elevator = 0`: expected a negative number",
        ),
        (
            "product_of_inertia_kgm2 = 0.0",
            "product_of_inertia_kgm2 = 1852.0",
            "expected a square less than roll times yaw inertia",
        ),
        ("friction = 0.12", "friction = 1.0", "expected 0 to below 1"),
        (
            "order = 1.0",
            "order = 0.0",
            "expected a positive multiple of the engine speed",
        ),
    ] {
        let text = CESSNA_172_TOML.replacen(good, bad, 1);
        assert_ne!(text, CESSNA_172_TOML, "{good}");
        std::fs::write(&file, text).unwrap();
        let error = read_aircraft(&file).unwrap_err().to_string();
        assert!(error.contains("aircraft.toml, line "), "{bad}: {error}");
        assert!(error.contains(message), "{bad}: {error}");
    }
}

const GOOD: &str = "\
[start]
latitude_deg = 56.0
longitude_deg = 40.0
height_m = 600
heading_deg = 0
airspeed_mps = 50

[air]
wind_from_deg = 270
wind_speed_mps = 5
turbulence = \"light\"

[flight]
bank_deg = 20

[[leg]]
latitude_deg = 56.2
longitude_deg = 40.0

[[leg]]
latitude_deg = 56.2
longitude_deg = 40.4
height_m = 1000
airspeed_mps = 45

[[leg]]
bank_deg = 15
duration_s = 60
";

fn parse(text: &str) -> Result<Plan, String> {
    Plan::parse(Path::new("plan.toml"), text, &Dynamics::new(&cessna172()))
        .map_err(|error| error.to_string())
}

#[test]
fn a_valid_plan_is_read() {
    let plan = parse(GOOD).unwrap();
    assert_eq!(plan.legs.len(), 3);
    // Wind from the west blows east.
    assert!((plan.wind_enu_mps.x - 5.0).abs() < 1e-12 && plan.wind_enu_mps.y.abs() < 1e-12);
    // Keys missing in a leg keep their values.
    assert!((plan.legs[2].height_m - 1000.0).abs() < 1e-12);
}

#[test]
fn shipped_plans_are_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("plans");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        Plan::read(&path, &Dynamics::new(&cessna172())).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn invalid_plans_are_rejected_with_line_and_cause() {
    // Replacement in the valid plan, line of the error, and parts of its message.
    for (old, new, line, message) in [
        (
            "airspeed_mps = 50",
            "airspeed_mps = 25",
            6,
            &["stalls at", "expected at least"][..],
        ),
        (
            "airspeed_mps = 50",
            "airspeed_mps = 180",
            6,
            &["too fast", "km/h"],
        ),
        ("airspeed_mps = 45", "airspeed_mps = 30", 24, &["stalls"]),
        (
            "height_m = 1000",
            "height_m = 9000",
            23,
            &["ceiling", "feet"],
        ),
        ("height_m = 1000", "height_m = 5", 23, &["ground_height_m"]),
        (
            "height_m = 1000",
            "height_m = 3500",
            20,
            &["+2900 m", "leg longer"],
        ),
        (
            "latitude_deg = 56.2\nlongitude_deg = 40.4",
            "latitude_deg = 56.2\nlongitude_deg = 40.003",
            20,
            &["too short", "bank"],
        ),
        (
            "latitude_deg = 56.0",
            "latitude_deg = 95",
            2,
            &["-80 to 80", "swapped"],
        ),
        (
            "heading_deg = 0",
            "heading_deg = \"north\"",
            5,
            &["expected f64"],
        ),
        (
            "heading_deg = 0",
            "heading = 0",
            5,
            &["unknown field", "heading_deg"],
        ),
        (
            "bank_deg = 20",
            "bank_deg = 75",
            14,
            &["expected 3 to 29.7,"],
        ),
        (
            "bank_deg = 15",
            "bank_deg = -80",
            27,
            &["expected -29.7 to 29.7; the most that the autopilot"],
        ),
        (
            "bank_deg = 15\nduration_s = 60",
            "bank_deg = 15",
            26,
            &["duration_s"],
        ),
        (
            "bank_deg = 15\n",
            "bank_deg = 15\nheading_deg = 3\n",
            26,
            &["ambiguous"],
        ),
        (
            "wind_speed_mps = 5",
            "wind_speed_mps = 60",
            10,
            &["half the airspeed", "knots"],
        ),
        (
            "turbulence = \"light\"",
            "turbulence = \"wild\"",
            11,
            &["unknown variant", "light"],
        ),
        ("[start]", "[start", 1, &["complete example"]),
        ("duration_s = 60", "duration_s = -60", 28, &["seconds"]),
    ] {
        assert_rejected(old, new, line, message);
    }
}

#[test]
fn invalid_legs_and_winds_are_rejected() {
    for (old, new, line, message) in [
        (
            "longitude_deg = 40.0",
            "longitude_deg = 320.0",
            3,
            &["-180 to 180", "360"][..],
        ),
        (
            "longitude_deg = 40.4",
            "longitude_deg = 40.0",
            20,
            &["ends where it begins"],
        ),
        (
            "wind_speed_mps = 5\n",
            "",
            9,
            &["wind_speed_mps", "no wind"],
        ),
        ("wind_from_deg = 270\n", "", 9, &["wind_from_deg"]),
        (
            "airspeed_mps = 45\n\n[[leg]]\nbank_deg = 15",
            "airspeed_mps = 36\n\n[[leg]]\nbank_deg = 29",
            27,
            &["`airspeed_mps = 36`", "stalls"],
        ),
    ] {
        assert_rejected(old, new, line, message);
    }
    parse(&GOOD.replace(
        "wind_from_deg = 270\nwind_speed_mps = 5",
        "wind_speed_mps = 0",
    ))
    .unwrap();
}

#[test]
fn nan_and_out_of_range_numbers_are_rejected() {
    for (old, new, line, message) in [
        ("latitude_deg = 56.0", "latitude_deg = nan", 2, "expected"),
        ("height_m = 600", "height_m = nan", 4, "expected"),
        ("airspeed_mps = 50", "airspeed_mps = nan", 6, "expected"),
        ("wind_from_deg = 270", "wind_from_deg = nan", 9, "north"),
        (
            "[flight]",
            "ground_height_m = nan\n[flight]",
            13,
            "ellipsoid",
        ),
        (
            "[flight]",
            "ground_height_m = 30e3\n[flight]",
            13,
            "ellipsoid",
        ),
    ] {
        assert_rejected(old, new, line, &[message]);
    }
}

#[test]
fn the_airspeed_limit_of_the_message_is_accepted() {
    let with = |speed: &str| parse(&GOOD.replace("airspeed_mps = 50", speed));
    for (speed, message) in [("180", "expected at most "), ("25", "expected at least ")] {
        let error = with(&format!("airspeed_mps = {speed}")).unwrap_err();
        let limit = error.split_once(message).unwrap().1;
        let limit = limit.split([' ', ';']).next().unwrap();
        with(&format!("airspeed_mps = {limit}")).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// With a replacement in the valid plan.
fn assert_rejected(old: &str, new: &str, line: u32, message: &[&str]) {
    let text = GOOD.replacen(old, new, 1);
    assert_ne!(text, GOOD, "{old}");
    let error = parse(&text).expect_err(new);
    let location = format!("plan.toml, line {line}:");
    assert!(error.starts_with(&location), "{new}: {error}");
    for part in message {
        assert!(error.contains(part), "{new}: {error:?} lacks {part:?}");
    }
}

/// Limited by its own bank angle or that of the turns of the plan, whichever is larger.
#[test]
fn a_slow_leg_is_valid_at_a_small_bank_angle() {
    parse(&GOOD.replace("airspeed_mps = 45", "airspeed_mps = 36")).unwrap();
}

/// Out and back.
const CLOSED: &str = "\
[start]
latitude_deg = 56.0
longitude_deg = 40.0
height_m = 600
heading_deg = 0
airspeed_mps = 50

[[leg]]
latitude_deg = 56.1
longitude_deg = 40.0

[[leg]]
latitude_deg = 56.1
longitude_deg = 40.2

[[leg]]
latitude_deg = 56.1
longitude_deg = 40.0
";

#[test]
fn a_closed_plan_is_flown_once_or_without_its_last_leg() {
    parse(CLOSED).unwrap();
    let again = format!("[flight]\nduration_s = 3600\n{CLOSED}");
    let error = parse(&again).unwrap_err();
    let message = "plan.toml, line 18: this waypoint is that of the first leg";
    assert!(error.starts_with(message), "{error}");
    let legs: Vec<&str> = again.split("[[leg]]").collect();
    parse(&legs[..3].join("[[leg]]")).unwrap();
    let alone = parse(&legs[..2].join("[[leg]]")).unwrap_err();
    assert!(alone.contains("that of the first leg"), "{alone}");
}

/// Each value is valid, but it cannot fly.
#[test]
fn an_aircraft_that_cannot_climb_gets_its_own_message() {
    let mut parameters = cessna172();
    parameters.engine.rated_power_w = 10.0;
    let error = Plan::parse(Path::new("plan.toml"), GOOD, &Dynamics::new(&parameters));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("does not climb at any height"), "{error}");
}

#[test]
fn a_missing_plan_file_is_reported() {
    let error = Plan::read(Path::new("nowhere.toml"), &Dynamics::new(&cessna172())).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("nowhere.toml: cannot be read"),
        "{error}"
    );
}

//! From a plan to a log to a report, with an aircraft from a file.

use std::path::Path;
use std::process::Command;

use host_sim::identify::configure;
use host_sim::log::{Grade, read};
use ins_core::Navigator;
use ins_core::earth::wrap_pi;
use serde_json::Value;

fn host_sim(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(arguments)
        .arg("--json")
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The plan of an hour, limited to some seconds.
fn write_plan(plan: &Path, seconds: u32) {
    let route = std::fs::read_to_string("plans/route_one_hour.toml").unwrap();
    let duration = format!("[flight]\nduration_s = {seconds}\n");
    std::fs::write(plan, route.replacen("[flight]\n", &duration, 1)).unwrap();
}

#[test]
fn a_flight_is_identified() {
    let folder = tempfile::tempdir().unwrap();
    let [plan, log, report] = ["plan.toml", "log", "report"].map(|name| folder.path().join(name));
    write_plan(&plan, 1800);

    let aircraft = ["--aircraft", "aircraft/cessna182.toml"];
    let files = ["fly", "--plan", text(&plan), "--out", text(&log)];
    let flight = host_sim(&[files.as_slice(), &aircraft].concat());
    assert_eq!(flight["aircraft"], "Cessna 182");

    let found = host_sim(&["identify", text(&log), "--out", text(&report)]);
    // There is no rest in a flight: the class of the sensors is taken from the log.
    assert_eq!(found["grade"], "hg1700");
    let truth = &flight["errors"];
    for (name, truth) in [
        ("azimuth_error_deg", &truth["azimuth_error_deg"]),
        ("gnss_latency_ms", &truth["gnss_latency_ms"]),
    ] {
        let number = |value: &Value| value.as_f64().unwrap();
        let error = number(&found[name]["value"]) - number(truth);
        // The heading is given for the first sample; the turn until navigation begins is known to a few
        // per cent: 0.2 deg.
        let bound = 4.0 * number(&found[name]["sigma"]) + 0.2;
        assert!(error.abs() < bound, "{name}: error {error}, bound {bound}");
    }

    let errors = &found["against_truth"];
    let of = |which: &str, what: &str| errors[which][what].as_f64().unwrap();
    // GNSS has white noise of 1 m and 0.1 m/s at 10 Hz, which the loops average. Correlated noise of some
    // metres is configured for positions, which are averaged over a minute.
    assert!(of("damped", "position_m") < 1.5, "{errors}");
    assert!(of("damped", "velocity_mps") < 0.05, "{errors}");
    // 15 min unaided: kilometres with raw readings, far less with corrected ones.
    assert!(of("as_logged", "position_m") > 1000.0, "{errors}");
    assert!(
        of("free", "position_m") < 0.5 * of("as_logged", "position_m"),
        "{errors}"
    );
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    assert!(page.contains("Against the truth of the log"));
}

/// In flight the specific force of a climbing turn is used as vertical, with errors of degrees. With a tilt
/// sigma that covers it, the INS does not attribute the innovations to its heading.
#[test]
fn a_start_in_the_air_keeps_its_heading() {
    let folder = tempfile::tempdir().unwrap();
    let [plan, log] = ["plan.toml", "log"].map(|name| folder.path().join(name));
    write_plan(&plan, 120);
    for seed in ["1", "2", "3"] {
        let files = ["fly", "--plan", text(&plan), "--out", text(&log)];
        host_sim(&[files.as_slice(), &["--seed", seed, "--force"]].concat());
        let (log, _) = read(&log).unwrap();
        let mut navigator = Navigator::new(configure::config(&log, Grade::Hg1700)).unwrap();
        let (mut fixes, mut truths) = (log.gnss.iter().peekable(), log.truth.iter().peekable());
        let (mut errors_deg, mut sigmas) = (Vec::new(), Vec::new());
        for sample in log.imu.iter() {
            while let Some(fix) = fixes.next_if(|fix| fix.time < sample.time) {
                let _ = navigator.on_gnss(fix);
            }
            let _ = navigator.on_imu(&sample);
            let Some(truth) = truths.next_if(|truth| truth.time <= sample.time) else {
                continue;
            };
            if let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) {
                let error = wrap_pi(solution.euler().heading_rad - truth.euler().heading_rad).abs();
                errors_deg.push(error.to_degrees());
                sigmas.push(error / sigma.attitude_rad.z);
            }
        }
        // A given heading has a sigma of 17 deg, and the turn before the start adds some; the largest of a
        // thousand errors is beyond three sigmas.
        let largest = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
        assert!(largest(&errors_deg) < 34.0, "{seed}: {errors_deg:?}");
        assert!(largest(&sigmas) < 3.5, "{seed}: {sigmas:?}");
        assert!(errors_deg.last().unwrap() < &2.0, "{seed}: {errors_deg:?}");
    }
}

/// Half a second is reported as clock offset in one of the drives and as latency in the other.
#[test]
fn drives_with_a_late_receiver_get_the_same_latency() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let found = path("found");
    let drives = ["31", "32"].map(|seed| {
        let drive = path(seed);
        let of = [
            "--errors",
            "tests/late_receiver.toml",
            "--minutes",
            "10",
            "--seed",
            seed,
        ];
        host_sim(&[["drive", "--out", text(&drive)].as_slice(), &of].concat());
        drive
    });
    let [first, second] = drives.each_ref().map(|drive| text(drive));
    host_sim(&["identify", first, second, "--out", text(&found)]);
    let model = std::fs::read_to_string(found.join("error-model.toml")).unwrap();
    let model: toml::Value = toml::from_str(&model).unwrap();
    for bound in model["gnss"]["latency_s"].as_array().unwrap() {
        let error_s = bound.as_float().unwrap() - 0.5;
        assert!(error_s.abs() < 0.02, "{bound}");
    }
}

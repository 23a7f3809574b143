//! Published filters through their adaptors, on the same flights.
//!
//! With an argument this program is an adaptor itself: `cargo test --test` builds no examples.
#![allow(
    clippy::duplicate_mod,
    reason = "elsewhere each is a program of its own"
)]

#[path = "../adaptors/fusion_nav.rs"]
mod fusion_nav;
#[path = "../adaptors/kinavis_ins.rs"]
mod kinavis_ins;

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// With GNSS; the noise of positions is 1 m.
const POSITION_M: f64 = 2.0;
/// The initial heading has a sigma of 3 deg, and turns make it observable.
const HEADING_DEG: f64 = 2.0;

fn main() -> std::io::Result<()> {
    match std::env::args().nth(1).as_deref() {
        Some("fusion-nav") => fusion_nav::main(),
        Some("kinavis-ins") => kinavis_ins::main(),
        // Options of the test harness, which this does not use.
        _ => {
            published_filters_are_accurate();
            println!("published_filters_are_accurate ... ok");
            Ok(())
        }
    }
}

fn published_filters_are_accurate() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    // Long enough for filters to settle.
    let plan = include_str!("turns.toml").replace("duration_s = 150", "duration_s = 240");
    fs::write(home.join("plan.toml"), plan).unwrap();
    // python-ins takes a tenth of a second per fix, and kinavis-ins accepts no delayed fixes.
    let receiver = "gnss.rate_hz = 1.0\ngnss.latency_s = [0.0, 0.0]";
    fs::write(home.join("receiver.toml"), receiver).unwrap();
    let words = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
    host_sim(home, &words("drive --minutes 6 --seed 2 --out drive"));
    let this = std::env::current_exe().unwrap();
    let mut options = words(
        "rehearse drive --plan plan.toml --out out --minutes-free 1 --flights 2 --models 0 \
         --budget 0 --set receiver.toml",
    );
    let mut with = |filter: String| options.extend(["--with".to_owned(), filter]);
    for name in ["fusion-nav", "kinavis-ins"] {
        with(format!("{name}='{}' {name}", this.display()));
    }
    if let Some(python) = std::env::var_os("PYINS_PYTHON") {
        let adaptor = Path::new(env!("CARGO_MANIFEST_DIR")).join("adaptors/python_ins.py");
        let python = Path::new(&python).display();
        with(format!("python-ins='{python}' '{}'", adaptor.display()));
    } else {
        assert!(std::env::var_os("CI").is_none(), "PYINS_PYTHON is not set");
        println!("python-ins is not tested: PYINS_PYTHON names no Python that has it");
    }
    host_sim(home, &options);
    let text = fs::read_to_string(home.join("out/rehearsal.json")).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    for tested in summary["tested"].as_array().unwrap() {
        assert_eq!(tested["flights"], 2, "{tested}");
        for (quantity, most) in [("level position", POSITION_M), ("heading", HEADING_DEG)] {
            let rms = rms(tested, quantity);
            println!("{}: {quantity} {rms}", tested["with"]);
            assert!(rms < most, "{tested}");
        }
    }
}

/// With GNSS.
fn rms(tested: &Value, quantity: &str) -> f64 {
    let rows = tested["rows"].as_array().unwrap();
    let wanted = |row: &&Value| row["quantity"] == quantity && row["without_gnss_s"].is_null();
    rows.iter().find(wanted).unwrap()["rms"].as_f64().unwrap()
}

fn host_sim(home: &Path, arguments: &[String]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command.current_dir(home).args(arguments).output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

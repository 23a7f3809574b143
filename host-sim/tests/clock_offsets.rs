//! Clock offsets of up to two minutes, on recorded logs of cars, aircraft and multicopters: estimated from
//! the motion, and reported as part of the latency or, beyond a second, as clock offset. `--nocapture`
//! prints the table.

use std::fs;
use std::path::Path;

use crate::corrupted::{Files, convert};
use host_sim::identify::configure;
use host_sim::identify::quantities::{Quantities, Quantity};
use host_sim::identify::run::identify;
use host_sim::log::read;
use indicatif::ProgressBar;

/// Each with the change of the core's latency estimate, ms, beyond its sigma, if the clock is shifted by
/// less than a fix interval: with fast small manoeuvres it converges to one of several values.
const LOGS: [(&str, f64); 6] = [
    ("rtklibexplorer_drive_0708", 0.0),
    ("yk_urban_short_turn_loop_nominal_001", 0.0),
    ("umn_thor_flight75", 0.0),
    ("plane_px4", 60.0),
    ("quad_122a", 60.0),
    ("quad_joey1", 60.0),
];
const OFFSETS_S: [f64; 10] = [0.5, 1.0, 2.0, 5.0, 9.7, 18.0, 36.9, 61.3, 90.5, 120.0];

/// Result for a log: total latency including the clock offset, ms; clock offset, s; whether there was a
/// warning.
fn latency_and_offset(folder: &Path) -> Option<(Quantity, f64, bool)> {
    let (log, warnings) = read(folder).ok()?;
    let config = configure::config(&log, configure::grade(&log, None));
    let result = identify(&log, config, &ProgressBar::hidden()).unwrap();
    let mut latency = Quantities::of_log(&result.end.estimates, &log.meta).gnss_latency_ms;
    latency.value += 1e3 * log.meta.clock_offset_s();
    let is_clock_warning =
        |warning: &host_sim::log::LogError| warning.found.contains("by the motion");
    let warned = warnings.iter().any(is_clock_warning);
    Some((latency, log.meta.gnss_clock_offset_s, warned))
}

#[test]
fn clock_offsets_are_estimated_and_reported() {
    let mut wrong = Vec::new();
    for (name, ambiguity_ms) in LOGS {
        let Some(files) = Files::recorded(name) else {
            continue;
        };
        let folder = tempfile::tempdir().unwrap();
        files.write_to(folder.path());
        let (original, ..) = latency_and_offset(folder.path()).unwrap();
        println!("{name}: {:.1} +- {:.1} ms", original.value, original.sigma);
        for offset_s in OFFSETS_S.into_iter().flat_map(|s| [s, -s]) {
            let mut gnss = files.gnss.clone();
            convert(&mut gnss, "t_s", |t| t + offset_s);
            fs::write(folder.path().join("gnss.csv"), gnss).unwrap();
            let Some((latency, clock_offset_s, warned)) = latency_and_offset(folder.path()) else {
                println!("{offset_s:8.1} s: refused");
                wrong.push((name, offset_s));
                continue;
            };
            let error_ms = latency.value - 1e3 * offset_s - original.value;
            let offset_error_s = clock_offset_s - offset_s - 1e-3 * original.value;
            println!(
                "{offset_s:8.1} s: clock offset {clock_offset_s:8.2} s, latency {:10.1} +- {:4.1} ms, error {error_ms:6.1} ms, {:4.1} sigmas",
                latency.value,
                latency.sigma,
                error_ms / latency.sigma
            );
            let is_correct = (latency.observable() || ambiguity_ms > 0.0)
                && error_ms.abs() < 3.0 * latency.sigma + ambiguity_ms
                && (clock_offset_s == 0.0 && offset_s.abs() < 1.0 || offset_error_s.abs() < 0.3)
                && warned == (clock_offset_s != 0.0);
            if !is_correct {
                wrong.push((name, offset_s));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

//! Clocks that differ by up to two minutes, on recorded logs of what drives, flies and hovers: found
//! from the motion, and told as a part of the latency or, beyond a second, apart. `--nocapture` prints
//! the table.

use std::fs;
use std::path::Path;

use crate::spoilt::{Files, convert};
use host_sim::identify::configure;
use host_sim::identify::quantities::{Quantities, Quantity};
use host_sim::identify::run::identify;
use host_sim::log::read;
use indicatif::ProgressBar;

/// Each with what the core's own latency changes by, ms, beyond its sigma, where the clock is moved
/// by less than a fix's interval: on quick small manoeuvres it settles on one of several values.
const LOGS: [(&str, f64); 6] = [
    ("rtklibexplorer_drive_0708", 0.0),
    ("yk_urban_short_turn_loop_nominal_001", 0.0),
    ("umn_thor_flight75", 0.0),
    ("plane_px4", 60.0),
    ("quad_122a", 60.0),
    ("quad_joey1", 60.0),
];
const OFFSETS_S: [f64; 10] = [0.5, 1.0, 2.0, 5.0, 9.7, 18.0, 36.9, 61.3, 90.5, 120.0];

/// What is said of a log: latency with what is of the clocks in ms, what was moved in s, and whether there
/// was a warning.
fn found(folder: &Path) -> Option<(Quantity, f64, bool)> {
    let (log, warnings) = read(folder).ok()?;
    let config = configure::config(&log, configure::grade(&log, None));
    let found = identify(&log, config, &ProgressBar::hidden()).unwrap();
    let mut latency = Quantities::of_log(&found.end.estimates, &log.meta).gnss_latency_ms;
    latency.value += 1e3 * log.meta.clock_offset_s();
    let of_clocks = |warning: &host_sim::log::LogError| warning.found.contains("by the motion");
    let warned = warnings.iter().any(of_clocks);
    Some((latency, log.meta.gnss_clock_offset_s, warned))
}

#[test]
fn offsets_are_found_and_told() {
    let mut wrong = Vec::new();
    for (name, settles_ms) in LOGS {
        let Some(files) = Files::recorded(name) else {
            continue;
        };
        let folder = tempfile::tempdir().unwrap();
        files.put(folder.path());
        let (as_it_is, ..) = found(folder.path()).unwrap();
        println!("{name}: {:.1} +- {:.1} ms", as_it_is.value, as_it_is.sigma);
        for offset_s in OFFSETS_S.into_iter().flat_map(|s| [s, -s]) {
            let mut gnss = files.gnss.clone();
            convert(&mut gnss, "t_s", |t| t + offset_s);
            fs::write(folder.path().join("gnss.csv"), gnss).unwrap();
            let Some((latency, moved_s, warned)) = found(folder.path()) else {
                println!("{offset_s:8.1} s: refused");
                wrong.push((name, offset_s));
                continue;
            };
            let off_ms = latency.value - 1e3 * offset_s - as_it_is.value;
            let rough_s = moved_s - offset_s - 1e-3 * as_it_is.value;
            println!(
                "{offset_s:8.1} s: moved {moved_s:8.2} s, latency {:10.1} +- {:4.1} ms, off by {off_ms:6.1} ms, {:4.1} sigmas",
                latency.value,
                latency.sigma,
                off_ms / latency.sigma
            );
            let sound = (latency.observable() || settles_ms > 0.0)
                && off_ms.abs() < 3.0 * latency.sigma + settles_ms
                && (moved_s == 0.0 && offset_s.abs() < 1.0 || rough_s.abs() < 0.3)
                && warned == (moved_s != 0.0);
            if !sound {
                wrong.push((name, offset_s));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

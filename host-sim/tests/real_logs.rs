//! Recorded drives, if available: `INS_LOGS`, or `../shared/data` beside the workspace.

use std::env;
use std::path::{Path, PathBuf};

use host_sim::compare::kalman::Noise;
use host_sim::compare::outage;
use host_sim::identify::analysis::Analysis;
use host_sim::identify::configure;
use host_sim::identify::error_model::{Identified, Record};
use host_sim::log::read;
use host_sim::sim::ErrorModel;
use host_sim::sim::noise::Random;
use indicatif::ProgressBar;

fn logs() -> Vec<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = env::var_os("INS_LOGS").map_or(default, PathBuf::from);
    let Ok(entries) = folder.read_dir() else {
        println!(
            "No recorded logs in {}: set INS_LOGS to test with them.",
            folder.display()
        );
        return Vec::new();
    };
    let mut logs: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.is_dir())
        .collect();
    logs.sort();
    logs
}

#[test]
fn every_recorded_log_is_read() {
    for path in logs() {
        let (log, warnings) = read(&path).unwrap_or_else(|e| panic!("{e}\n{}", e.cause));
        for warning in warnings {
            println!("warning: {warning}\n  -> {}", warning.cause);
        }
        println!(
            "{}: {:.1} s, {} fixes",
            path.display(),
            log.duration_s(),
            log.gnss.len()
        );
        assert!(log.duration_s() > 10.0 && log.gnss.len() > 10);
    }
}

/// With the same sensor errors configured, on average over logs. The phone is left out: it is not fixed to the
/// vehicle.
#[test]
fn drift_without_gnss_is_that_of_a_kalman_filter() {
    let mut ratios = Vec::new();
    for path in logs()
        .into_iter()
        .filter(|path| !path.ends_with("phone_loose"))
    {
        let (log, _) = read(&path).unwrap();
        let config = configure::config(&log, configure::grade(&log, None));
        let test = outage::test(&log, false, config, Noise::of_config(&config)).unwrap();
        let Some(test) = test else { continue };
        let [core, kalman] = &test.navigators[..2] else {
            panic!("two navigators at least");
        };
        let ratio = core.position_rms_m / kalman.position_rms_m;
        println!("{}: {ratio:.2}", path.display());
        // A fixed wing with one fix per second drifts twice as far.
        assert!(ratio < 2.2, "{}: {ratio}", path.display());
        ratios.push(ratio);
    }
    let mean = ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len().max(1) as f64;
    assert!(ratios.is_empty() || mean.exp() < 1.1, "{ratios:?}");
}

/// On some logs the likelihood is flat: such noises must not be reported as observable.
#[test]
fn observable_noises_have_finite_intervals() {
    for path in logs() {
        let analysis = Analysis::of_log(&path, None, &ProgressBar::hidden()).unwrap();
        let records = [Record::new(&analysis.log, &analysis.found)];
        let found = Identified::new(&records, analysis.summary.grade, None);
        let model = found.drawn(&mut Random::stream(1, "drawn")).model();
        let text = toml::to_string(&model).unwrap();
        assert_eq!(ErrorModel::from_toml(&text).unwrap(), model);
        for parameter in found.parameters() {
            let noise = ["gyro_deg_h.white_noise", "gnss.velocity_sigma_mps"];
            if !noise.contains(&parameter.name) || !parameter.observable {
                continue;
            }
            let interval = parameter.found.unwrap();
            let ratio = interval.high / interval.low;
            println!("{}: {} {interval:?}", path.display(), parameter.name);
            assert!((1.02..100.0).contains(&ratio), "{parameter:?}");
        }
    }
}

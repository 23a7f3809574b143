//! GNSS outages, and the comparison of all methods on one log.

use std::path::Path;

use host_sim::compare::Comparison;
use host_sim::compare::kalman::Noise;
use host_sim::compare::outage::{OutageTest, Reference, test};
use host_sim::identify::analysis::Input;
use host_sim::identify::true_errors::Truth;
use host_sim::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use host_sim::sim::{DriveConfig, simulate};
use host_sim::study::accuracy::config_of;
use indicatif::ProgressBar;
use ins_core::Config;
use ins_core::config::HeadingSource;

/// A drive as a log, with its truth, and a configuration for it.
fn drive_log(grade: Grade, minutes: f64) -> (Log, Truth, Config) {
    let drive = simulate(&DriveConfig::new(4, grade, minutes));
    let mut config = config_of(grade);
    let mut meta = Meta::new(BodyAxes::Frd, config.imu_output);
    meta.grade = Some(grade);
    if let Some(heading) = drive.given_heading_rad {
        config.heading = HeadingSource::Given(heading);
        meta.initial_heading_deg = Some(heading.to_degrees());
    }
    let truth = Truth::new(&drive.errors, None, BodyAxes::Frd);
    let log = Log {
        meta,
        imu: drive.imu.into(),
        gnss: drive.gnss,
        baro: Vec::new(),
        truth: drive.truth,
    };
    (log, truth, config)
}

fn outages(grade: Grade) -> OutageTest {
    let (log, _, config) = drive_log(grade, 15.0);
    let noise = Noise::of_model(&grade.errors());
    test(&log, true, config, noise).unwrap().unwrap()
}

/// Drift in 30 s due to the expected errors of the estimates. Ring lasers: averaged velocity noise of 0.1 m/s,
/// 0.05 deg of heading. MEMS: a gyro scale error of 0.5 % in turns, and an outage ten seconds after
/// alignment, which dominates (6 of 0.8 m/s RMS over 74).
#[test]
fn drift_in_outages_is_within_the_expected_errors() {
    for (grade, position_m, velocity_mps) in [(Grade::Hg1700, 4.0, 0.25), (Grade::Mems, 12.0, 0.85)]
    {
        let test = outages(grade);
        assert_eq!(test.against, Reference::Truth);
        let [core, kalman] = &test.navigators[..2] else {
            panic!("two navigators at least");
        };
        println!("{grade:?} {core:?}\n{kalman:?}");
        assert!(core.count > 60 && kalman.count == core.count);
        assert!(core.position_rms_m < position_m);
        assert!(core.velocity_rms_mps < velocity_mps);
        assert!(core.position_max_m >= core.position_rms_m);
        // The filter does not model scale errors: it may be worse, but not much better.
        assert!(core.position_rms_m < 1.5 * kalman.position_rms_m);
    }
}

fn comparison_of(folder: &Path) -> Comparison {
    let progress = ProgressBar::hidden();
    let input = Input::read(folder, None, &progress).unwrap();
    Comparison::of_input(input, &progress).unwrap()
}

/// Errors are within sigmas, and all files are written.
#[test]
fn a_comparison_contains_each_method() {
    let home = tempfile::tempdir().unwrap();
    let (log, truth, _) = drive_log(Grade::Hg1700, 8.0);
    log::write(&log, home.path(), Compression::Gzip).unwrap();
    std::fs::write(home.path().join("errors.toml"), truth.to_toml().unwrap()).unwrap();
    let comparison = comparison_of(home.path());
    assert!(comparison.simulated);
    assert_eq!(comparison.methods.len(), 8);
    for method in &comparison.methods {
        for result in &method.quantities {
            // The heading has no column in errors.toml.
            if let Some(error) = result.error.filter(|_| result.name != "heading_deg") {
                let index = method.quantities.iter().position(|q| q.name == result.name);
                let truth = truth.columns()[index.unwrap()].unwrap();
                assert!((result.quantity.value - truth - error).abs() < 1e-9);
                // Literal sigmas are not promised; the noise / 3 one is too small by that.
                let literal = ["literal", "five stages"];
                let sigmas = if literal.iter().any(|form| method.method.contains(form)) {
                    20.0
                } else {
                    12.0
                };
                assert!(error.abs() < sigmas * result.quantity.sigma, "{method:?}");
            }
        }
    }
    let error = |name: &str| {
        let mut methods = comparison.methods.iter();
        let method = methods.find(|method| method.method == name).unwrap();
        method.trajectory.unwrap()
    };
    let (exact, kalman) = (
        error("compensation, exact"),
        error("Kalman, noise of the class"),
    );
    assert!(error("its smoother").velocity_mps < 0.7 * kalman.velocity_mps);
    assert!(exact.heading_deg < 0.5 && kalman.heading_deg < 0.5);
    assert_eq!(comparison.costs.len(), 5);
    let out = tempfile::tempdir().unwrap();
    comparison.write(out.path()).unwrap();
    for name in ["compare.json", "compare.csv", "outages.csv", "report.html"] {
        let text = std::fs::read_to_string(out.path().join(name)).unwrap();
        assert!(text.len() > 500, "{name}");
    }
}

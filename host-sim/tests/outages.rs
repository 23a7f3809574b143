//! An INS without GNSS, and the comparison of all methods on one log.

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
fn driven(grade: Grade, minutes: f64) -> (Log, Truth, Config) {
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
    let (log, _, config) = driven(grade, 15.0);
    let noise = Noise::of_model(&grade.errors());
    test(&log, true, config, noise).unwrap().unwrap()
}

/// What 30 s make of errors as large as they should be by then. Ring lasers: 0.1 m/s of velocity
/// noise averaged, 0.05 deg of heading. MEMS: a scale error of the gyros of 0.5 % and its turns, and
/// an outage ten seconds after alignment, which is most of it (6 of 0.8 m/s RMS over 74).
#[test]
fn the_core_drifts_no_further_than_its_estimates_say() {
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
        // With scale errors unknown to the filter it may be worse, never much better.
        assert!(core.position_rms_m < 1.5 * kalman.position_rms_m);
    }
}

fn compared(folder: &Path) -> Comparison {
    let progress = ProgressBar::hidden();
    let input = Input::read(folder, None, &progress).unwrap();
    Comparison::of_input(input, &progress).unwrap()
}

/// Every number of the comparison is that of the run it names, and all files are there.
#[test]
fn a_comparison_says_what_each_method_found() {
    let home = tempfile::tempdir().unwrap();
    let (log, truth, _) = driven(Grade::Hg1700, 8.0);
    log::write(&log, home.path(), Compression::Gzip).unwrap();
    std::fs::write(home.path().join("errors.toml"), truth.to_toml().unwrap()).unwrap();
    let comparison = compared(home.path());
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

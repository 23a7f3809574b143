//! Figures of the thesis, reproduced by simulation.

use host_sim::log::{BodyAxes, Grade, Log, Meta};
use host_sim::sim::{DriveConfig, simulate};
use host_sim::study::reproduce::{Recorded, Reproduction, Settings, reproduce};

/// A drive without truth.
fn recorded() -> Recorded {
    let drive = simulate(&DriveConfig::new(4, Grade::Mems, 15.0));
    Recorded {
        name: "a drive".to_owned(),
        log: Log {
            meta: Meta::new(BodyAxes::Rfu, Grade::Mems.errors().imu.output),
            imu: drive.imu.into(),
            gnss: drive.gnss,
            baro: Vec::new(),
            truth: Vec::new(),
        },
    }
}

/// One of everything.
fn reproduce_small(threads: usize) -> Reproduction {
    let settings = Settings {
        drives: 1,
        minutes: 40.0,
        units: 2,
        unit_minutes: 30.0,
        flights: 1,
        flight_minutes: 120.0,
        ..Settings::new(3)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let run = || reproduce(settings, Some(&recorded())).unwrap();
    pool.build().unwrap().install(run)
}

fn number(reproduction: &Reproduction, part: &str, what: &str) -> f64 {
    let part = reproduction.parts.iter().find(|p| p.name == part).unwrap();
    let number = part.numbers.iter().find(|n| n.what.starts_with(what));
    number.unwrap().ours
}

#[test]
fn results_match_the_thesis_on_any_number_of_threads() {
    let reproduction = reproduce_small(1);
    assert_eq!(reproduction, reproduce_small(2));
    let number = |part: &str, what: &str| number(&reproduction, part, what);
    // Figure 8: an order of magnitude.
    assert!(number("figure-8", "improvement factor") > 10.0);
    // Figures 3 and 4, 6 and 7: errors within sigmas, and as accurate as a filter with the true noises.
    for (figures, line) in [
        ("figures-3-4", "azimuth"),
        ("figures-6-7", "gyro right"),
        ("figures-6-7", "gyro forward"),
    ] {
        assert!(number(figures, "compensation, largest error at an end") < 4.0);
        let ratio = number(figures, &format!("{line}, compensation / Kalman"));
        assert!((0.5..1.5).contains(&ratio), "{line}: {ratio}");
    }
    let difference = number("figures-3-4-recorded", "azimuth, difference");
    assert!(difference < 0.5, "{difference}");
    // Figure 9: Schuler's 84.4 min, approximately because the vehicle turns.
    let period_min = number("figure-9", "period");
    assert!((70.0..100.0).contains(&period_min), "{period_min}");
    // Figure 5: less than a tenth remains.
    assert!(number("figure-5", "improvement factor") > 10.0);
    // Table 1: laboratory values explain a tenth of the biases, drives most of them.
    let predicted =
        |from: &str| number("table-1-argument", &format!("predicted from the {from} /"));
    assert!(predicted("laboratory") < 0.5, "{}", predicted("laboratory"));
    let drives = predicted("drives");
    assert!((0.4..2.5).contains(&drives), "{drives}");
    // Table 2, within 2 % of the specification.
    assert!((number("table-2", "stall") / 87.0 - 1.0).abs() < 0.02);
    let folder = tempfile::tempdir().unwrap();
    reproduction.write(folder.path()).unwrap();
    for part in &reproduction.parts {
        let data = folder.path().join(format!("{}.csv", part.name));
        let lines = std::fs::read_to_string(data).unwrap().lines().count();
        assert!(lines > 3, "{}", part.name);
        assert_eq!(
            part.svg.is_some(),
            folder.path().join(format!("{}.svg", part.name)).exists()
        );
    }
}

#[test]
fn a_recorded_drive_without_fixes_is_rejected() {
    let mut drive = recorded();
    drive.log.gnss.clear();
    let error = reproduce(Settings::new(1), Some(&drive)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "a drive: navigation never begins, nothing to draw"
    );
}

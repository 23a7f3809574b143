//! Configuration: open or closed feedback, exact or literal form, and rejected values.

use host_sim::identify::run::in_order_of_time;
use host_sim::log::Grade;
use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use host_sim::study::accuracy::{Results, Study, config_of};
use indicatif::ProgressBar;
use ins_core::config::{Feedback, Form, HeadingSource};
use ins_core::mechanization::Mechanization;
use ins_core::{Config, Estimates, Navigator};
use serde_json::Value;

/// The damped INS and the estimates at every second of a drive.
fn damped(drive: &SimulatedDrive, tune: &dyn Fn(&mut Config)) -> Vec<(Mechanization, Estimates)> {
    let mut config = config_of(Grade::Hg1700);
    config.heading = HeadingSource::Given(drive.given_heading_rad.unwrap());
    tune(&mut config);
    let mut navigator = Navigator::new(config).unwrap();
    in_order_of_time(&drive.imu, &drive.gnss)
        .filter_map(|event| {
            let sample = event.give_to(&mut navigator)?;
            let full_second = sample.time.as_micros() % 1_000_000 == 0;
            let ins = navigator.mechanization().filter(|_| full_second)?;
            Some((*ins, navigator.estimates()))
        })
        .collect()
}

#[test]
fn without_feedback_estimates_do_not_affect_the_ins() {
    let drive = simulate(&DriveConfig::new(1, Grade::Hg1700, 6.0));
    let open = |config: &mut Config| config.feedback = Feedback::Open;
    let reference = damped(&drive, &open);
    // Another form, and other configured sensor errors: other estimates, the same INS.
    let literal = damped(&drive, &|config| {
        open(config);
        config.form = Form::Literal;
    });
    let other_sigmas = damped(&drive, &|config| {
        open(config);
        config.sensors.gyro_bias_radps *= 10.0;
        config.sensors.accel_bias_mps2 *= 3.0;
        config.gnss.latency_sigma_s = 0.5;
    });
    let closed = damped(&drive, &|_| {});
    let ins = |seen: &[(Mechanization, Estimates)]| seen.iter().map(|s| s.0).collect::<Vec<_>>();
    assert!(reference.len() > 200);
    assert!(ins(&reference) == ins(&literal), "the form affects the INS");
    let differ = |a: &(Mechanization, Estimates), b: &(Mechanization, Estimates)| {
        (a.0.velocity_enu_mps - b.0.velocity_enu_mps).norm() > 1e-6
    };
    assert!(
        !reference
            .iter()
            .zip(&other_sigmas)
            .any(|(a, b)| differ(a, b))
    );
    assert!(ins(&reference) != ins(&closed));
    assert_ne!(reference.last().unwrap().1, other_sigmas.last().unwrap().1);
    assert_ne!(reference.last().unwrap().1, literal.last().unwrap().1);
}

#[test]
fn literal_form_converges_and_exact_form_is_better() {
    let of = |form| -> Results {
        let study = Study {
            form: Some(form),
            ..Study::new(Grade::Hg1700, 4)
        };
        Results::new(
            study,
            study
                .drive(&|_| {}, &|_| {}, &ProgressBar::hidden())
                .unwrap(),
        )
    };
    let (exact, literal) = (of(Form::Exact), of(Form::Literal));
    assert_eq!(literal.converged, 4);
    // Before: 3 deg, 1 mg, 50 to 300 ms. Measured: 0.15 deg, 0.2 mg, 13 ms.
    for (which, limit) in [(0, 0.5), (1, 0.7), (2, 0.7), (7, 40.0)] {
        let rms = |results: &Results| results.quantities[which].rms_error;
        let (exact, literal) = (rms(&exact), rms(&literal));
        assert!(literal < limit, "{which}: {literal}");
        assert!(exact < 0.5 * literal, "{which}: {exact} {literal}");
    }
}

#[test]
fn configuration_round_trips() {
    let mut config = Config::mems();
    config.heading = HeadingSource::Given(1.25);
    config.form = Form::Literal;
    config.feedback = Feedback::Open;
    for config in [config, Config::hg1700(), Config::mems()] {
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<Config>(&text).unwrap(), config);
    }
}

/// Paths of all numbers in a JSON tree.
fn numbers(tree: &Value, path: &str, found: &mut Vec<String>) {
    match tree {
        Value::Number(_) => found.push(path.to_owned()),
        Value::Object(parts) => {
            for (name, part) in parts {
                numbers(part, &format!("{path}/{name}"), found);
            }
        }
        _ => {}
    }
}

#[test]
fn negative_numbers_are_rejected() {
    let tree = serde_json::to_value(Config::hg1700()).unwrap();
    let mut paths = Vec::new();
    numbers(&tree, "", &mut paths);
    assert!(paths.len() > 20, "{paths:?}");
    for path in paths {
        let mut bad = tree.clone();
        *bad.pointer_mut(&path).unwrap() = Value::from(-1.0);
        let config: Config = serde_json::from_value(bad).unwrap();
        let error = Navigator::new(config).expect_err(&path).to_string();
        // The message names the part of the configuration.
        let part = path
            .trim_start_matches('/')
            .split('/')
            .take(2)
            .collect::<Vec<_>>()
            .join(".");
        assert!(error.starts_with(&part), "{path}: {error}");
    }
}

#[test]
fn non_finite_numbers_are_rejected() {
    let nan = f64::NAN;
    let tune: [fn(&mut Config, f64); 5] = [
        |c, v| c.damping.horizontal.bandwidth_radps = v,
        |c, v| c.sensors.gyro_noise[1] = v,
        |c, v| c.max_gap_s = v,
        |c, v| c.climb_sigma_mps = v,
        |c, v| c.heading = HeadingSource::Given(v),
    ];
    for set in tune {
        for bad in [nan, f64::INFINITY, f64::NEG_INFINITY] {
            let mut config = Config::hg1700();
            set(&mut config, bad);
            assert!(Navigator::new(config).is_err());
        }
    }
}

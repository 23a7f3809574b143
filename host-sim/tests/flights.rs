//! Statistics of aided and then unaided flights, with a few short ones.

use host_sim::sim::ErrorModel;
use host_sim::sim::errors::BiasModel;
use host_sim::study::flights::linear::{Agreement, random_walk_position_m};
use host_sim::study::flights::route::Route;
use host_sim::study::flights::run::{Run, Settings, VARIANTS, all, cell_errors, run, run_alone};
use host_sim::study::flights::schuler::schuler;
use host_sim::study::flights::statistics::rms;
use indicatif::ProgressBar;
use ins_core::earth::LocalEarth;

fn route() -> Route {
    Route::cessna172().unwrap_or_else(|error| panic!("{error}"))
}

fn short(errors: ErrorModel) -> Settings {
    Settings {
        minutes_aided: 8,
        minutes_free: 4,
        errors,
    }
}

fn end(run: &Run, variant: &str) -> f64 {
    let at = VARIANTS.iter().position(|name| *name == variant).unwrap();
    run.free[at].last().unwrap().position_m
}

#[test]
fn results_are_independent_of_the_number_of_threads() {
    let (route, settings) = (route(), short(ErrorModel::hg1700()));
    let on = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| all(0..3, &route, &settings, &ProgressBar::hidden()).unwrap())
    };
    let alone = on(1);
    assert_eq!(alone, on(3));
    assert_eq!(alone.iter().map(|r| r.seed).collect::<Vec<_>>(), [0, 1, 2]);
    // Seeds differ, and estimates after 8 min reduce the drift.
    assert_ne!(alone[0], alone[1]);
    let all = |variant| rms(alone.iter().map(|run| end(run, variant)));
    assert!(all("with_estimates") < all("raw"));
}

/// Only integration errors of simulation and INS remain, and their effect on the estimates.
#[test]
fn ideal_sensors_do_not_drift() {
    let run = run(3, &route(), &short(ErrorModel::ideal())).unwrap();
    // The cell without errors starts at the truth: strapdown errors only, 1 m in an hour.
    assert!(run.grid_m[0] < 0.05, "{} m", run.grid_m[0]);
    // 1 deg/h alone causes 90 m in 4 min. The noise of a perfect receiver is estimated as a tenth of the
    // configured one, and it may smooth: 5.7 m measured.
    for variant in ["with_estimates", "without_noise"] {
        assert!(end(&run, variant) < 9.0, "{variant}: {run:?}");
    }
    // Without estimates, an error of 0.04 mg for 4 min: 11 m.
    assert!(end(&run, "raw") < 20.0, "{run:?}");
}

/// Without a heading the first minutes are spent on the heading search, and its result is not exact.
#[test]
fn a_model_without_a_heading_gives_no_initial_heading() {
    let azimuth_error = |given_heading_sigma_deg| {
        let errors = ErrorModel {
            given_heading_sigma_deg,
            ..ErrorModel::hg1700()
        };
        run_alone(3, &route(), &short(errors)).map(|(result, _)| result.azimuth_deg)
    };
    let [none, exact] = [None, Some(0.0)].map(azimuth_error);
    assert_ne!(none, exact);
}

#[test]
fn grid_errors_grow_with_the_configured_errors() {
    let route = route();
    let settings = Settings {
        minutes_aided: 2,
        minutes_free: 10,
        errors: ErrorModel::hg1700(),
    };
    let runs = all(0..24, &route, &settings, &ProgressBar::hidden()).unwrap();
    let cell = |bias: f64, walk: f64| {
        let at = (0..24)
            .find(|&cell| cell_errors(cell) == (bias, walk))
            .unwrap();
        rms(runs.iter().map(|run| run.grid_m[at]))
    };
    // The same draws, ten times as large: linear except for tilts of 1e-4 rad.
    assert!((cell(1.0, 0.0) / cell(0.1, 0.0) - 10.0).abs() < 0.01);
    // 24 flights with two channels each: 10 % one sigma of a variance's root.
    let origin = route.plan().start.position;
    let earth = LocalEarth::at(origin.latitude_rad, origin.height_m);
    let density = 0.125_f64.to_radians() / 60.0;
    let ratio = cell(0.0, 0.125) / random_walk_position_m(density, 600.0, &earth);
    assert!((0.7..1.3).contains(&ratio), "{ratio}");
}

/// The analytic value against a sum over impulses: `R (1 - cos wt)` for each.
#[test]
fn random_walk_error_matches_the_sum_over_impulses() {
    let earth = LocalEarth::at(1.0, 1000.0);
    let w = (earth.gravity_mps2 / earth.north_radius_m).sqrt();
    let square: f64 = (0..3600)
        .map(|s| earth.north_radius_m * (1.0 - f64::cos(w * (f64::from(s) + 0.5))))
        .map(|m| 2.0 * m * m)
        .sum();
    let value = random_walk_position_m(1.0, 3600.0, &earth);
    assert!((value / square.sqrt() - 1.0).abs() < 1e-6);
}

/// Over a few minutes the frame hardly rotates, and (1)-(2) as printed are accurate.
#[test]
fn velocity_error_follows_the_linear_model() {
    let runs = all(
        0..3,
        &route(),
        &short(ErrorModel::hg1700()),
        &ProgressBar::hidden(),
    )
    .unwrap();
    for which in 0..2 {
        let [printed, rotating] = [0, 1]
            .map(|terms| Agreement::relative(runs.iter().map(|run| &run.agreement[which][terms])));
        // In 240 s the Earth rotates by 0.0175 rad, which couples the tilts; the azimuth error, larger than
        // the tilts, also couples into them at Earth rate.
        assert!(printed < 0.1, "{which}: {printed}");
        // Second order in errors of 1e-3 rad, and noise beneath the 10 ms steps.
        assert!(rotating < 0.01, "{which}: {rotating}");
    }
}

/// Two Schuler periods. The residual of the model with frame rotation is of second order in the errors.
#[test]
fn oscillates_with_the_schuler_period() {
    let mut errors = ErrorModel::hg1700();
    let full = schuler(0, &route(), &errors).unwrap();
    let is_near = |value: f64, expected: f64, part: f64| (value / expected - 1.0).abs() < part;
    assert!(
        is_near(full.model.period_min, full.period_min, 0.005),
        "{full:?}"
    );
    // Earth rotation turns the plane of the oscillation by 0.6 rad meanwhile.
    assert!(is_near(full.ins.period_min, full.period_min, 0.03));
    let amplitude =
        |of: host_sim::study::flights::schuler::Oscillation| of.east_mps.hypot(of.north_mps);
    assert!(is_near(
        amplitude(full.ins),
        amplitude(full.rotating_model),
        0.03
    ));
    assert!(is_near(amplitude(full.ins), amplitude(full.model), 0.1));

    errors.gyro_deg_h.bias = BiasModel::constant(0.1);
    errors.accel_mps2.bias = BiasModel::constant(0.001);
    let tenth = schuler(0, &route(), &errors).unwrap();
    let ratio = full.rotating_model_difference / tenth.rotating_model_difference;
    assert!((5.0..20.0).contains(&ratio), "{ratio}");
}

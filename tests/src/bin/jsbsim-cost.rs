//! Cost per 100 Hz step compared with `JSBSim`'s c172x, in one run:
//! `cargo run --release -p ins-tests --bin jsbsim-cost`.

use std::path::Path;
use std::time::Instant;

use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::flight::Flight;
use host_sim::aircraft::plan::Plan;
use host_sim::identify::run::in_order_of_time;
use host_sim::log::Grade;
use host_sim::page::table::markdown;
use host_sim::sim::drive::{Recording, SimulatedDrive};
use host_sim::sim::ideal::IdealSensors;
use host_sim::sim::{Motion, record};
use ins_core::{Config, Navigator, Time};
use ins_tests::aircraft::jsbsim_step_s;
use ins_tests::cargo::repository;

const STEPS: u32 = 360_000;
const STEP_S: f64 = 0.01;

fn per_step(run: impl FnOnce()) -> f64 {
    let start = Instant::now();
    run();
    start.elapsed().as_secs_f64() / f64::from(STEPS)
}

/// The core over a flight, called as by firmware.
fn navigate(run: &SimulatedDrive, config: Config) {
    let mut navigator = Navigator::new(config).expect("the preset is valid");
    for event in in_order_of_time(&run.imu, &run.gnss) {
        let _ = event.give_to(&mut navigator);
    }
    std::hint::black_box(navigator.solution());
}

fn main() -> Result<(), String> {
    let dynamics = Dynamics::new(&cessna172());
    let path = Path::new("host-sim/plans/route_one_hour.toml");
    let plan =
        Plan::read(&repository().join(path), &dynamics).map_err(|error| error.to_string())?;
    let flight = Flight::new(&dynamics, &plan, 1).map_err(|error| error.to_string())?;

    let mut alone = flight.clone();
    let dynamics_s = per_step(|| {
        for i in 0..STEPS {
            std::hint::black_box(alone.kinematics(STEP_S * f64::from(i)));
        }
    });
    let mut sensors = IdealSensors::new(flight.clone(), plan.start.position, Time::default());
    let ideal_s = per_step(|| {
        for i in 1..=STEPS {
            std::hint::black_box(
                sensors.advance(Time::default().plus_seconds(STEP_S * f64::from(i))),
            );
        }
    });
    let recording = Recording {
        seed: 1,
        duration_s: f64::from(STEPS) * STEP_S,
        imu_hz: 100.0,
        truth_every: 10,
        origin: plan.start.position,
        errors: Grade::Hg1700.errors(),
    };
    let mut run = None;
    let errors_s = per_step(|| run = Some(record(flight, &recording)));
    let run = run.ok_or("nothing recorded")?;
    let mut config = Config::hg1700();
    config.imu_output = recording.errors.imu.output;
    let core_s = per_step(|| navigate(&run, config));
    let jsbsim_s = jsbsim_step_s()?;

    let chain_s = errors_s + core_s;
    let row = |(name, seconds): (&str, f64)| {
        vec![
            name.to_owned(),
            format!("{:.2}", 1e6 * seconds),
            format!("{:.2}", f64::from(STEPS) * seconds),
            format!("{:.1}", jsbsim_s / seconds),
        ]
    };
    let header = [
        "",
        "step of 10 ms, us",
        "hour of flight, s",
        "JSBSim takes, times",
    ];
    let rows = [
        ("aircraft, autopilot, air", dynamics_s),
        ("and ideal sensors", ideal_s),
        ("and sensor errors, GNSS, truth", errors_s),
        ("core", core_s),
        ("whole chain: with errors, core", chain_s),
        ("JSBSim c172x alone", jsbsim_s),
    ];
    print!("{}", markdown(&header.map(str::to_owned), &rows.map(row)));
    Ok(())
}

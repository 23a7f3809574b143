//! The thesis's post-processing on simulated drives of ring-laser class.

use host_sim::accuracy::config_of;
use host_sim::five_stage::{self, FiveStage, Stage};
use host_sim::log::{BodyAxes, Log, Meta};
use host_sim::quantities::{DEG_H_RADPS, MG_MPS2};
use host_sim::sim::{DriveConfig, Grade, SensorErrors, simulate};
use ins_core::config::HeadingSource;
use ins_core::earth::wrap_pi;
use ins_core::{Config, Observability};

const DEG: f64 = std::f64::consts::PI / 180.0;

/// A drive, its configuration with a heading off by so much, and its true errors.
fn drive(seed: u64, azimuth_error_deg: f64) -> (Log, Config, SensorErrors) {
    let drive = simulate(&DriveConfig::new(seed, Grade::Hg1700, 40.0));
    let heading_rad = drive.truth[0].euler().heading_rad;
    let config = Config {
        heading: HeadingSource::Given(wrap_pi(heading_rad + azimuth_error_deg * DEG)),
        ..config_of(Grade::Hg1700)
    };
    let log = Log {
        meta: Meta::new(BodyAxes::Rfu, config.imu_output),
        imu: drive.imu,
        gnss: drive.gnss,
        truth: Vec::new(),
    };
    (log, config, drive.errors)
}

/// Estimates minus truth: azimuth deg, accelerometers mg, gyros deg/h, latency ms.
fn errors(found: &FiveStage, azimuth_error_deg: f64, truth: &SensorErrors) -> [f64; 8] {
    let e = &found.estimates;
    let accel = |i: usize| (e.accel_bias_mps2[i].value - truth.accel_bias_mps2[i]) / MG_MPS2;
    let gyro = |i: usize| (e.gyro_bias_radps[i].value - truth.gyro_bias_radps[i]) / DEG_H_RADPS;
    [
        e.azimuth_error_rad.value / DEG - azimuth_error_deg,
        accel(0),
        accel(1),
        accel(2),
        gyro(0),
        gyro(1),
        gyro(2),
        1e3 * (e.gnss_latency_s.value - truth.gnss_latency_s),
    ]
}

#[test]
fn experiment() {
    for seed in 0..8 {
        let (log, config, truth) = drive(seed, 3.0);
        for rounds in [five_stage::PUBLISHED, five_stage::REPEATED] {
            let found = five_stage::run(&log, config, rounds).unwrap();
            let off = errors(&found, 3.0, &truth);
            println!("{seed} {rounds} {off:.3?}  tau {:.0}", 1e3 * truth.gnss_latency_s);
        }
    }
    let _ = (Stage::ALL, Observability::Observable);
}

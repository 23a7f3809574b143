//! What scale errors and misalignments of the sensors look like to an INS whose unit is tilted.

use host_sim::sim::car::Car;
use host_sim::sim::errors::BiasModel;
use host_sim::sim::mounted::Mounted;
use host_sim::sim::{DriveConfig, Grade, SimulatedDrive, record};
use ins_core::config::HeadingSource;
use ins_core::earth::GRAVITY_EQUATOR_MPS2 as G;
use ins_core::{Config, Navigator};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

const MINUTES: f64 = 20.0;
/// Of an uncalibrated unit; they make of each accelerometer some tenths of m/s^2.
const SCALE: f64 = 0.01;
const GYRO: f64 = 0.003;

/// A car with a unit that is turned, rolled and pitched by tens of degrees against it.
fn drive(mount: UnitQuaternion<f64>) -> SimulatedDrive {
    let mut config = DriveConfig::new(5, Grade::Hg1700, MINUTES);
    let errors = &mut config.recording.errors;
    errors.accel_mps2.bias = BiasModel::constant(0.1);
    errors.accel_mps2.scale_sigma = SCALE;
    errors.accel_mps2.misalignment_sigma = SCALE;
    errors.gyro_deg_h.scale_sigma = GYRO;
    errors.gyro_deg_h.misalignment_sigma = GYRO;
    let recording = &config.recording;
    let car = Car::new(recording.seed, recording.duration_s, config.initial_rest_s);
    record(Mounted::new(car, mount), recording)
}

fn config(drive: &SimulatedDrive) -> Config {
    let preset = Config::hg1700();
    let mut config = Config {
        imu_output: Grade::Hg1700.errors().imu.output,
        heading: HeadingSource::Given(drive.truth[0].euler().heading_rad + 0.02),
        ..preset
    };
    config.sensors.accel_bias_mps2 = 0.15;
    config.sensors.accel_scale = SCALE;
    config.sensors.gyro_scale = GYRO;
    config.sensors.cross_axis = 0.0;
    config.sensors.misalignment_rad = GYRO;
    config
}

fn navigated(drive: &SimulatedDrive) -> Navigator {
    let mut navigator: Navigator = Navigator::new(config(drive)).unwrap();
    let mut fixes = drive.gnss.iter().peekable();
    for sample in &drive.imu {
        while let Some(fix) = fixes.next_if(|fix| fix.time < sample.time) {
            let _ = navigator.on_gnss(fix);
        }
        let _ = navigator.on_imu(sample);
    }
    navigator
}

/// Bias of the accelerometers that turns about the vertical show: `b + M_a f - g p`, with `f` the
/// force felt at the level and `p` what the gyros read of such a turn in level directions.
fn shown(drive: &SimulatedDrive, up: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let felt = |matrix: &Matrix3<f64>| matrix * up;
    let errors = &drive.errors;
    let accel = Vector3::from(errors.accel_bias_mps2) + G * felt(&errors.accel_matrix);
    let read = felt(&errors.gyro_matrix);
    [accel, G * (read - up * up.dot(&read))]
}

#[test]
fn an_accelerometer_bias_is_what_a_compensation_needs() {
    for (right, forward) in [(0.0, 0.0), (0.5, -0.3), (0.0, 0.9)] {
        let mount = UnitQuaternion::from_scaled_axis(Vector3::new(right, forward, 0.0));
        let drive = drive(mount);
        let up = mount.inverse() * Vector3::z();
        let [accel, by_gyros] = shown(&drive, &up);
        let estimates = navigated(&drive).estimates();
        let found = estimates.accel_bias_mps2.map(|accel| accel.value);
        let left = Vector3::from(found) - (accel - by_gyros);
        println!("{left:?} of {accel:?} and {by_gyros:?}");
        // Of what gyros make of it, well below half is left to noise and to scale errors that have
        // no parameter.
        assert!(by_gyros.norm() > 0.015, "{by_gyros}");
        assert!(left.norm() < 0.4 * by_gyros.norm(), "{left}");
        // What it is apart from the gyros is within the spread.
        for (axis, estimate) in estimates.accel_bias_mps2.iter().enumerate() {
            let off = estimate.value - accel[axis];
            assert!(off.abs() < 4.0 * estimate.sigma, "{off} {estimate:?}");
        }
    }
}

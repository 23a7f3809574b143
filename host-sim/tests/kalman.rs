//! The Kalman filter that the core is compared with: it must be a good one.

use host_sim::accuracy::config_of;
use host_sim::kalman::filter::Start;
use host_sim::kalman::{Filter, Known, Noise, Record, Run, STATES, States, index, smooth};
use host_sim::sim::{DriveConfig, Grade, SimulatedDrive, simulate};
use ins_core::attitude::matrix;
use ins_core::config::HeadingSource;
use ins_core::earth::Geodetic;
use ins_core::increments::Interval;
use ins_core::mechanization::Mechanization;
use ins_core::{Config, GnssFix, Solution, Time};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

fn drive(seed: u64, minutes: f64) -> (SimulatedDrive, Config) {
    let drive = simulate(&DriveConfig::new(seed, Grade::Hg1700, minutes));
    let config = config_for(&drive);
    (drive, config)
}

fn config_for(drive: &SimulatedDrive) -> Config {
    Config {
        heading: HeadingSource::Given(drive.given_heading_rad.unwrap()),
        ..config_of(Grade::Hg1700)
    }
}

fn exact() -> Noise {
    Noise::of_model(&Grade::Hg1700.errors())
}

/// What is still wrong with a filter, in its own states.
fn errors(known: &Known, truth: &Solution, drive: &SimulatedDrive) -> States {
    let mut errors = States::zeros();
    let mut set = |at: usize, value: Vector3<f64>| {
        errors.fixed_rows_mut::<3>(at).copy_from(&value);
    };
    let ins = &known.ins;
    set(index::POSITION, ins.position.enu_from(&truth.position));
    set(
        index::VELOCITY,
        ins.velocity_enu_mps - truth.velocity_enu_mps,
    );
    // C' C^T = I - [Phi x].
    let turned = matrix(&ins.attitude) * matrix(&truth.attitude).transpose();
    let phi = 0.5
        * Vector3::new(
            turned.m23 - turned.m32,
            turned.m31 - turned.m13,
            turned.m12 - turned.m21,
        );
    set(index::ATTITUDE, phi);
    set(
        index::ACCEL,
        Vector3::from(drive.errors.accel_bias_mps2) - known.accel_bias_mps2,
    );
    set(
        index::GYRO,
        Vector3::from(drive.errors.gyro_bias_radps) - known.gyro_bias_radps,
    );
    errors[index::LATENCY] = drive.errors.gnss_latency_s - known.latency_s;
    errors
}

fn truth_at(drive: &SimulatedDrive, time: Time) -> Option<&Solution> {
    let at = drive.truth.partition_point(|truth| truth.time < time);
    drive.truth.get(at).filter(|truth| truth.time == time)
}

/// Squared errors in units of the whole covariance, summed over drives: chi-square of 16 degrees
/// of freedom for each.
#[test]
fn its_covariance_is_honest() {
    const DRIVES: u64 = 12;
    let mut sums = [0.0; 3];
    let mut parts = States::zeros();
    for seed in 0..DRIVES {
        let (drive, config) = drive(seed, 15.0);
        let mut run = Run::new(&drive.imu, &drive.gnss, config, exact()).unwrap();
        let looks = [300.0, 600.0, 900.0];
        let mut next = 0;
        while let Some(time) = run.step(&mut |_, _| {}) {
            if next == looks.len() || time.as_seconds() < looks[next] {
                continue;
            }
            let Some(truth) = truth_at(&drive, time) else {
                continue;
            };
            let filter = run.filter().unwrap();
            let errors = errors(&filter.known, truth, &drive);
            let weighed = filter.covariance.cholesky().unwrap().solve(&errors);
            sums[next] += errors.dot(&weighed);
            let sigma = filter.sigmas();
            parts += errors.component_div(&sigma).map(|e| e * e);
            next += 1;
        }
        assert_eq!(next, looks.len());
    }
    println!("NEES {:?}", sums.map(|sum| sum / DRIVES as f64));
    println!("by state {:.2}", parts / (3.0 * DRIVES as f64));
    // 192 degrees of freedom: 0.05 % lie below 132 and 0.05 % above 262.
    for sum in sums {
        assert!(
            (132.0..262.0).contains(&sum),
            "{sum} of {}",
            STATES as u64 * DRIVES
        );
    }
}

/// Root mean squares over a drive: velocity, tilt and heading of filter and smoother.
fn trajectories(seed: u64) -> [[f64; 3]; 2] {
    let mut recorded = DriveConfig::new(seed, Grade::Hg1700, 10.0);
    // Corrections come at any sample.
    recorded.recording.truth_every = 1;
    let drive = simulate(&recorded);
    let config = config_for(&drive);
    let mut run = Run::new(&drive.imu, &drive.gnss, config, exact()).unwrap();
    let mut records = Vec::new();
    let mut filtered = Vec::new();
    let record = &mut |filter: &Filter, correction| {
        filtered.push((filter.time, filter.known));
        records.push(Record::new(filter, correction));
    };
    while run.step(record).is_some() {}
    let smoothed = smooth(&records);
    assert_eq!(smoothed.len(), records.len());
    let rms = |points: &mut dyn Iterator<Item = (Time, Known)>| {
        let (mut sums, mut count) = ([0.0; 3], 0.0);
        for (time, known) in points {
            let Some(truth) = truth_at(&drive, time) else {
                continue;
            };
            let e = errors(&known, truth, &drive);
            sums[0] += e.fixed_rows::<3>(index::VELOCITY).norm_squared();
            sums[1] += e.fixed_rows::<2>(index::ATTITUDE).norm_squared();
            sums[2] += e[index::ATTITUDE + 2].powi(2);
            count += 1.0;
        }
        assert!(count > 200.0, "{count}");
        sums.map(|sum| (sum / count).sqrt())
    };
    [
        rms(&mut filtered.into_iter()),
        rms(&mut smoothed.iter().map(|s| (s.time, s.known))),
    ]
}

#[test]
fn the_smoother_is_better_than_the_filter() {
    for seed in 0..3 {
        let [filtered, smoothed] = trajectories(seed);
        println!("{filtered:?} {smoothed:?}");
        // Over ten minutes from an unknown azimuth all three fall by much more than their chance.
        for (filtered, smoothed) in filtered.iter().zip(smoothed) {
            assert!(smoothed < 0.8 * filtered, "{filtered} {smoothed}");
        }
    }
}

/// A vehicle at rest with a biased upright accelerometer and perfect sensors otherwise: the filter
/// must give the straight line of least squares through the velocities, and its spread.
#[test]
fn a_bias_at_rest_is_the_slope_of_a_straight_line() {
    const BIAS: f64 = 0.01;
    const SIGMA: f64 = 0.1;
    const FIXES: i32 = 100;
    let place = Geodetic::default();
    let ins = Mechanization::new(place, Vector3::zeros(), UnitQuaternion::identity());
    let earth = ins.local_earth();
    let noise = Noise {
        gyro_noise: 0.0,
        gyro_bias_walk: 0.0,
        gyro_bias_radps: 1e-9,
        accel_noise: 0.0,
        accel_bias_walk: 0.0,
        accel_bias_mps2: 1.0,
        velocity_sigma_mps: SIGMA,
        // Gravity falls with height: a metre is 3e-6 m/s^2.
        position_sigma_m: Vector3::repeat(1.0),
        latency_sigma_s: 1e-6,
        heading_sigma_rad: 1e-6,
    };
    let start = Start {
        time: Time::default(),
        ins,
        tilt_sigma_rad: None,
        heading_sigma_rad: 1e-6,
        gyro_bias_radps: Vector3::zeros(),
        gyro_bias_sigma_radps: [1e-9; 3],
    };
    let mut filter = Filter::new(&start, &noise);
    let interval = Interval {
        seconds: 0.1,
        angle_rad: 0.1 * earth.earth_rate(),
        force_mps: 0.1 * Vector3::new(0.0, 0.0, earth.gravity_mps2 + BIAS),
        ..Interval::default()
    };
    // Errors of the fixes that are no straight line.
    let wrong = |k: i32| SIGMA * f64::from((k * k) % 7 - 3) / 2.0;
    let (mut sum_t, mut sum_tt, mut sum_v, mut sum_tv) = (0.0, 0.0, 0.0, 0.0);
    for k in 1..=FIXES {
        let time = Time::default().plus_seconds(0.1 * f64::from(k));
        filter.predict(time, &interval);
        let fix = GnssFix {
            time,
            velocity_en_mps: Some(Vector2::zeros()),
            velocity_up_mps: Some(wrong(k)),
            ..GnssFix::default()
        };
        let _ = filter.correct(&fix);
        let t = time.as_seconds();
        // What an INS that is left alone would differ by.
        let v = BIAS * t - wrong(k);
        sum_t += t;
        sum_tt += t * t;
        sum_v += v;
        sum_tv += t * v;
    }
    let n = f64::from(FIXES);
    let spread = sum_tt - sum_t * sum_t / n;
    let slope = (sum_tv - sum_t * sum_v / n) / spread;
    let sigma = SIGMA / spread.sqrt();
    let up = index::ACCEL + 2;
    // The prior of 1 m/s on the first velocity weighs 1e-4 against a hundred fixes of 0.1 m/s.
    let found = filter.known.accel_bias_mps2.z;
    assert!(
        (found - slope).abs() < 0.02 * sigma,
        "{found} {slope} +- {sigma}"
    );
    assert!((filter.sigmas()[up] / sigma - 1.0).abs() < 0.01);
}

/// Noise guessed three times too large makes the filter doubt more, and too small less.
#[test]
fn a_guess_moves_the_stated_spread() {
    let (drive, config) = drive(3, 6.0);
    let gyro_sigma = |noise: Noise| {
        let mut run = Run::new(&drive.imu, &drive.gnss, config, noise).unwrap();
        run.finish();
        run.filter().unwrap().sigmas()[index::ATTITUDE]
    };
    let sigmas = [1.0 / 3.0, 1.0, 3.0].map(|factor| gyro_sigma(exact().guessed(factor)));
    assert!(
        sigmas[0] < 0.8 * sigmas[1] && sigmas[1] < 0.8 * sigmas[2],
        "{sigmas:?}"
    );
}

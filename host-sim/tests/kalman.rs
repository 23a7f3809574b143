//! The Kalman filter that the core is compared with: consistency of its covariance.

use host_sim::compare::kalman::filter::Start;
use host_sim::compare::kalman::{Filter, Noise, Nominal, Record, Run, States, index, smooth};
use host_sim::log::Grade;
use host_sim::sim::noise::Random;
use host_sim::sim::{DriveConfig, ErrorModel, SimulatedDrive, simulate};
use host_sim::study::accuracy::config_of;
use ins_core::attitude::matrix;
use ins_core::config::{self, GnssConfig, HeadingSource, SensorConfig};
use ins_core::earth::Geodetic;
use ins_core::increments::Interval;
use ins_core::mechanization::Mechanization;
use ins_core::{Config, GnssFix, Solution, Time};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

fn drive(seed: u64, minutes: f64) -> (SimulatedDrive, Config) {
    drive_with(&Grade::Hg1700.errors(), seed, minutes)
}

fn drive_with(errors: &ErrorModel, seed: u64, minutes: f64) -> (SimulatedDrive, Config) {
    let mut config = DriveConfig::new(seed, Grade::Hg1700, minutes);
    config.recording.errors = errors.clone();
    let drive = simulate(&config);
    let config = config_for(&drive);
    (drive, config)
}

fn config_for(drive: &SimulatedDrive) -> Config {
    Config {
        heading: HeadingSource::Given(drive.given_heading_rad.unwrap()),
        ..config_of(Grade::Hg1700)
    }
}

fn model_noise() -> Noise {
    Noise::of_model(&Grade::Hg1700.errors())
}

/// True errors of a filter, as states.
fn errors(nominal: &Nominal, truth: &Solution, drive: &SimulatedDrive) -> States {
    let mut errors = States::zeros(index::COUNT);
    let mut set = |at: usize, value: Vector3<f64>| {
        errors.fixed_rows_mut::<3>(at).copy_from(&value);
    };
    let ins = &nominal.ins;
    set(index::POSITION, ins.position.enu_from(&truth.position));
    set(
        index::VELOCITY,
        ins.velocity_enu_mps - truth.velocity_enu_mps,
    );
    // C' C^T = I - [Phi x].
    let rotation = matrix(&ins.attitude) * matrix(&truth.attitude).transpose();
    let phi = 0.5
        * Vector3::new(
            rotation.m23 - rotation.m32,
            rotation.m31 - rotation.m13,
            rotation.m12 - rotation.m21,
        );
    set(index::ATTITUDE, phi);
    set(
        index::ACCEL,
        Vector3::from(drive.errors.accel_bias_mps2) - nominal.accel_bias_mps2,
    );
    set(
        index::GYRO,
        Vector3::from(drive.errors.gyro_bias_radps) - nominal.gyro_bias_radps,
    );
    errors[index::LATENCY] = drive.errors.gnss_latency_s - nominal.latency_s;
    errors
}

fn truth_at(drive: &SimulatedDrive, time: Time) -> Option<&Solution> {
    let at = drive.truth.partition_point(|truth| truth.time < time);
    drive.truth.get(at).filter(|truth| truth.time == time)
}

/// NEES of the filter after 5, 10 and 15 min, summed over drives: chi-square with as many degrees of freedom
/// as there are errors. `modify` adds the errors described by `noise`; `errors_of` gives the true errors.
fn sums_of_squares(
    model: &ErrorModel,
    noise: Noise,
    modify: fn(&mut SimulatedDrive, u64),
    errors_of: fn(&Filter, &Solution, &SimulatedDrive) -> States,
) -> [f64; 3] {
    let mut sums = [0.0; 3];
    let mut parts: Option<States> = None;
    for seed in 0..DRIVES {
        let (mut drive, config) = drive_with(model, seed, 15.0);
        modify(&mut drive, seed);
        let mut run = Run::new(&drive.imu, &drive.gnss, config, noise).unwrap();
        let times_s = [300.0, 600.0, 900.0];
        let mut next = 0;
        while let Some(time) = run.step(&mut |_, _| {}) {
            if next == times_s.len() || time.as_seconds() < times_s[next] {
                continue;
            }
            let Some(truth) = truth_at(&drive, time) else {
                continue;
            };
            let filter = run.filter().unwrap();
            let errors = errors_of(filter, truth, &drive);
            let size = errors.len();
            let own = filter.covariance.view((0, 0), (size, size)).into_owned();
            let weighted = own.cholesky().unwrap().solve(&errors);
            sums[next] += errors.dot(&weighted);
            let sigma = filter.sigmas().rows(0, size).into_owned();
            *parts.get_or_insert_with(|| States::zeros(size)) +=
                errors.component_div(&sigma).map(|e| e * e);
            next += 1;
        }
        assert_eq!(next, times_s.len());
    }
    println!("NEES {:?}", sums.map(|sum| sum / DRIVES as f64));
    println!("by state {:.2}", parts.unwrap() / (3.0 * DRIVES as f64));
    sums
}

fn basic_errors(filter: &Filter, truth: &Solution, drive: &SimulatedDrive) -> States {
    errors(&filter.nominal, truth, drive)
}

const DRIVES: u64 = 12;
/// 192 degrees of freedom: 0.05 % lie below 132 and 0.05 % above 262.
const CONSISTENT: core::ops::Range<f64> = 132.0..262.0;

#[test]
fn covariance_is_consistent() {
    let sums = sums_of_squares(
        &Grade::Hg1700.errors(),
        model_noise(),
        |_, _| {},
        basic_errors,
    );
    assert!(sums.iter().all(|sum| CONSISTENT.contains(sum)), "{sums:?}");
}

const VELOCITY: config::Noise = config::Noise {
    white: 0.02,
    correlated: 0.08,
    correlation_s: 3.0,
};
const POSITION: config::Noise = config::Noise {
    white: 0.3,
    correlated: 2.0,
    correlation_s: 60.0,
};

/// A receiver with the white noise above.
fn receiver() -> ErrorModel {
    let mut errors = Grade::Hg1700.errors();
    errors.gnss.velocity_sigma_mps = VELOCITY.white;
    errors.gnss.horizontal_sigma_m = POSITION.white;
    errors.gnss.vertical_sigma_m = POSITION.white;
    errors
}

/// Steps of a Gauss-Markov process in three axes, from one time to the next.
fn process(part: config::Noise, mut random: Random) -> impl FnMut(f64) -> Vector3<f64> {
    let mut state = part.correlated * Vector3::from(random.normal3());
    move |seconds| {
        let decay = (-seconds / part.correlation_s).exp();
        let driving = part.correlated * Vector3::from(random.normal3());
        state = decay * state + (1.0 - decay * decay).sqrt() * driving;
        state
    }
}

/// Adds the coloured noise above to all fixes.
fn add_coloured_noise(drive: &mut SimulatedDrive, seed: u64) {
    let mut velocity_noise = process(VELOCITY, Random::stream(seed, "coloured velocity"));
    let mut position_noise = process(POSITION, Random::stream(seed, "coloured position"));
    let mut last = Time::default();
    for fix in &mut drive.gnss {
        let seconds = fix.time.seconds_since(last);
        last = fix.time;
        let velocity = fix.velocity_enu_mps() + velocity_noise(seconds);
        let position = fix.geodetic_or(0.0).unwrap();
        let mut ins = Mechanization::new(position, velocity, UnitQuaternion::identity());
        ins.move_by(&ins.local_earth(), &position_noise(seconds));
        *fix = GnssFix {
            velocity_en_mps: Some(velocity.xy()),
            velocity_up_mps: Some(velocity.z),
            ..fix.at(&ins.position)
        };
    }
}

fn with_receiver(velocity: config::Noise, position: config::Noise) -> Noise {
    let mut noise = model_noise();
    noise.gnss = GnssConfig {
        velocity_mps: velocity,
        velocity_up_mps: velocity,
        position_m: position,
        height_m: position,
        ..noise.gnss
    };
    noise
}

/// With the coloured noise modelled the filter is consistent; with white noise of the same variance, or the
/// white part alone, it is not.
#[test]
fn covariance_is_consistent_with_coloured_noise() {
    let sums = sums_of_squares(
        &receiver(),
        with_receiver(VELOCITY, POSITION),
        add_coloured_noise,
        basic_errors,
    );
    assert!(sums.iter().all(|sum| CONSISTENT.contains(sum)), "{sums:?}");
    let total = |part: &config::Noise| part.variance().sqrt();
    for sigma in [total, |part: &config::Noise| part.white] {
        let [velocity, position] =
            [VELOCITY, POSITION].map(|part| config::Noise::white(sigma(&part)));
        let noise = with_receiver(velocity, position);
        let sums = sums_of_squares(&receiver(), noise, add_coloured_noise, basic_errors);
        assert!(sums.iter().any(|sum| *sum > CONSISTENT.end), "{sums:?}");
    }
}

/// Lever arm of the antenna, m, and its configured sigma.
const ARM_M: [f64; 3] = [0.7, -1.6, 1.9];
const ARM_SIGMA_M: f64 = 1.5;

/// Refers fixes to the antenna instead of the sensors.
fn to_antenna(drive: &mut SimulatedDrive, _: u64) {
    const STEP_S: f64 = 0.05;
    let arm = Vector3::from(ARM_M);
    for fix in &mut drive.gnss {
        let valid_at = fix.time.plus_seconds(-drive.errors.gnss_latency_s);
        let at = |seconds: f64| attitude_at(&drive.truth, valid_at.plus_seconds(seconds));
        let (Some(before), Some(now), Some(after)) = (at(-STEP_S), at(0.0), at(STEP_S)) else {
            continue;
        };
        let arm_velocity = (after * arm - before * arm) / (2.0 * STEP_S);
        let velocity = fix.velocity_enu_mps() + arm_velocity;
        let position = fix.geodetic_or(0.0).unwrap();
        let mut ins = Mechanization::new(position, velocity, now);
        ins.move_by(&ins.local_earth(), &(now * arm));
        *fix = GnssFix {
            velocity_en_mps: Some(velocity.xy()),
            velocity_up_mps: Some(velocity.z),
            ..fix.at(&ins.position)
        };
    }
}

fn attitude_at(truth: &[Solution], time: Time) -> Option<UnitQuaternion<f64>> {
    let next = truth.partition_point(|row| row.time <= time);
    let (before, after) = (truth.get(next.checked_sub(1)?)?, truth.get(next)?);
    let span_s = after.time.seconds_since(before.time);
    let part = time.seconds_since(before.time) / span_s;
    Some(before.attitude.nlerp(&after.attitude, part))
}

/// All of them estimated.
#[test]
fn covariance_is_consistent_with_scale_errors_and_lever_arm() {
    let mut model = Grade::Hg1700.errors();
    model.gyro_deg_h.scale_sigma = 0.002;
    model.accel_mps2.scale_sigma = 0.003;
    let mut noise = Noise::of_model(&model);
    noise.gnss.lever_arm_sigma_m = ARM_SIGMA_M;
    noise.gnss.clock_drift_sigma = 1e-5;
    let sums = sums_of_squares(&model, noise, to_antenna, |filter, truth, drive| {
        let nominal = &filter.nominal;
        let arm = Vector3::from(ARM_M) - nominal.lever_arm_m;
        let accel = drive.errors.accel_matrix.diagonal() - nominal.accel_scale;
        let gyro = drive.errors.gyro_matrix.diagonal() - nominal.gyro_scale;
        let mut all: Vec<f64> = errors(nominal, truth, drive).iter().copied().collect();
        all.push(-nominal.clock_drift);
        for three in [arm, accel, gyro] {
            all.extend(&three);
        }
        States::from_vec(all)
    });
    // 312 degrees of freedom: 0.05 % lie below 233 and 0.05 % above 402.
    assert!(
        sums.iter().all(|sum| (233.0..402.0).contains(sum)),
        "{sums:?}"
    );
}

/// Root mean squares over a drive: velocity, tilt and heading of filter and smoother.
fn trajectories(seed: u64) -> [[f64; 3]; 2] {
    let mut recorded = DriveConfig::new(seed, Grade::Hg1700, 10.0);
    // Corrections may be at any sample.
    recorded.recording.truth_every = 1;
    let drive = simulate(&recorded);
    let config = config_for(&drive);
    let mut run = Run::new(&drive.imu, &drive.gnss, config, model_noise()).unwrap();
    let mut records = Vec::new();
    let mut filtered = Vec::new();
    let record = &mut |filter: &Filter, correction| {
        filtered.push((filter.time, filter.nominal));
        records.push(Record::new(filter, correction));
    };
    while run.step(record).is_some() {}
    let smoothed = smooth(&records, &model_noise());
    assert_eq!(smoothed.len(), records.len());
    let rms = |points: &mut dyn Iterator<Item = (Time, Nominal)>| {
        let (mut sums, mut count) = ([0.0; 3], 0.0);
        for (time, nominal) in points {
            let Some(truth) = truth_at(&drive, time) else {
                continue;
            };
            let e = errors(&nominal, truth, &drive);
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
        rms(&mut smoothed.iter().map(|s| (s.time, s.nominal))),
    ]
}

#[test]
fn smoother_is_better_than_filter() {
    for seed in 0..3 {
        let [filtered, smoothed] = trajectories(seed);
        println!("{filtered:?} {smoothed:?}");
        // Over ten minutes from an unknown azimuth all three are reduced significantly.
        for (filtered, smoothed) in filtered.iter().zip(smoothed) {
            assert!(smoothed < 0.8 * filtered, "{filtered} {smoothed}");
        }
    }
}

/// At rest with a biased up accelerometer and otherwise perfect sensors, the filter must give the slope of
/// a least-squares line through the velocities, and its sigma.
#[test]
fn bias_at_rest_matches_a_least_squares_line() {
    const BIAS: f64 = 0.01;
    const SIGMA: f64 = 0.1;
    const FIXES: i32 = 100;
    let position = Geodetic::default();
    let ins = Mechanization::new(position, Vector3::zeros(), UnitQuaternion::identity());
    let earth = ins.local_earth();
    // Gravity falls with height: a metre is 3e-6 m/s^2.
    let mut noise = with_receiver(config::Noise::white(SIGMA), config::Noise::white(1.0));
    noise.sensors = SensorConfig {
        gyro_noise: [0.0; 3],
        gyro_bias_walk: 0.0,
        gyro_bias_radps: 1e-9,
        accel_noise: [0.0; 3],
        accel_bias_walk: 0.0,
        accel_bias_mps2: 1.0,
        ..noise.sensors
    };
    noise.gnss.latency_sigma_s = 1e-6;
    noise.heading_sigma_rad = 1e-6;
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
    // Nonlinear errors of the fixes.
    let fix_error = |k: i32| SIGMA * f64::from((k * k) % 7 - 3) / 2.0;
    let (mut sum_t, mut sum_tt, mut sum_v, mut sum_tv) = (0.0, 0.0, 0.0, 0.0);
    for k in 1..=FIXES {
        let time = Time::default().plus_seconds(0.1 * f64::from(k));
        let _ = filter.predict(time, &interval);
        let fix = GnssFix {
            time,
            velocity_en_mps: Some(Vector2::zeros()),
            velocity_up_mps: Some(fix_error(k)),
            ..GnssFix::default()
        };
        let _ = filter.correct(&fix);
        let t = time.as_seconds();
        // Difference of an uncorrected INS.
        let v = BIAS * t - fix_error(k);
        sum_t += t;
        sum_tt += t * t;
        sum_v += v;
        sum_tv += t * v;
    }
    let n = f64::from(FIXES);
    let sum_of_squares = sum_tt - sum_t * sum_t / n;
    let slope = (sum_tv - sum_t * sum_v / n) / sum_of_squares;
    let sigma = SIGMA / sum_of_squares.sqrt();
    let up = index::ACCEL + 2;
    // The prior of 1 m/s on the first velocity weighs 1e-4 against a hundred fixes of 0.1 m/s.
    let found = filter.nominal.accel_bias_mps2.z;
    assert!(
        (found - slope).abs() < 0.02 * sigma,
        "{found} {slope} +- {sigma}"
    );
    assert!((filter.sigmas()[up] / sigma - 1.0).abs() < 0.01);
}

/// Noise three times too large increases sigmas, and too small reduces them.
#[test]
fn configured_noise_scales_the_sigmas() {
    let (drive, config) = drive(3, 6.0);
    let gyro_sigma = |noise: Noise| {
        let mut run = Run::new(&drive.imu, &drive.gnss, config, noise).unwrap();
        run.finish();
        run.filter().unwrap().sigmas()[index::ATTITUDE]
    };
    let sigmas = [1.0 / 3.0, 1.0, 3.0].map(|factor| gyro_sigma(model_noise().scaled(factor)));
    assert!(
        sigmas[0] < 0.8 * sigmas[1] && sigmas[1] < 0.8 * sigmas[2],
        "{sigmas:?}"
    );
}

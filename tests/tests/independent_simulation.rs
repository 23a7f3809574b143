//! The core in a simulation that shares no code with the simulator it was developed on: the Earth is a gravity
//! field in rotating axes, motion is a path of positions and attitudes, and sensors measure its differences.
//! Errors are compared with the sigmas of the core.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use ins_core::earth::{Geodetic, wrap_pi};
use ins_core::{
    Config, Estimate, GnssFix, ImuOutput, ImuSample, Navigator, Observability, Phase, Time,
};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

/// Step of the path, s, and steps per sample.
const STEP_S: f64 = 0.001;
const SAMPLE: usize = 10;
/// Steps per fix.
const FIX: usize = 200;
/// Steps of a run: ten minutes.
const STEPS: usize = 600_000;
/// Errors beyond this are wrong and sure.
const SURE_SIGMAS: f64 = 4.5;

#[test]
fn errors_are_within_sigmas_in_an_independent_simulation() {
    let mut statistics = ErrorStatistics::default();
    for seed in 1..=4 {
        for kind in [Kind::Town, Kind::Hills, Kind::Bicycle, Kind::Multirotor] {
            statistics.run(kind, seed);
        }
    }
    statistics.assert_consistent();
}

/// Normalized errors of solutions at every second, and of estimates at the end.
#[derive(Debug, Default)]
struct ErrorStatistics {
    heading: Row,
    tilt: Row,
    position: Row,
    height: Row,
    velocity: Row,
    climb: Row,
    gyros: Row,
    accels: Row,
    latency: Row,
    arm: Row,
}

#[derive(Debug, Default)]
struct Row {
    count: f64,
    squares: f64,
    wrong: f64,
}

impl Row {
    fn add(&mut self, error: f64, sigma: f64) {
        let ratio = (error / sigma).abs();
        self.count += 1.0;
        self.squares += ratio * ratio;
        self.wrong += f64::from(u8::from(ratio > SURE_SIGMAS));
    }

    fn add_estimate(&mut self, estimate: &Estimate, truth: f64) {
        if estimate.observability == Observability::Observable {
            self.add(estimate.value - truth, estimate.sigma);
        }
    }
}

impl ErrorStatistics {
    /// Errors are correlated over time: at least one is independent per run, and the mean of sixteen squared
    /// normals exceeds 2.45 with a probability of 0.1 %.
    fn assert_consistent(&self) {
        for (what, row) in [
            ("heading", &self.heading),
            ("tilt", &self.tilt),
            ("position", &self.position),
            ("height", &self.height),
            ("velocity", &self.velocity),
            ("climb", &self.climb),
            ("gyros", &self.gyros),
            ("accelerometers", &self.accels),
            ("latency", &self.latency),
            ("lever arm", &self.arm),
        ] {
            println!("{what}: {row:?}, {:.2}", row.squares / row.count);
            assert!(row.count > 12.0, "{what}: {row:?}");
            assert!(row.squares < 2.45 * row.count, "{what}: {row:?}");
            assert!(row.wrong <= 1e-3 * row.count, "{what}: {row:?}");
        }
    }

    fn run(&mut self, kind: Kind, seed: u64) {
        let simulation = Simulation::new(kind, seed);
        let mut config = Config::mems();
        config.imu_output = ImuOutput::Increments;
        let mut navigator = Navigator::new(config).unwrap();
        let mut unit = Unit::new(seed);
        let mut receiver = Receiver::new(seed);
        let steps = simulation.path.len() - 1;
        for step in 1..steps {
            unit.add_step(&simulation, step);
            if step % FIX == 0 {
                let fix = receiver.fix(&simulation, step);
                let _ = navigator.on_gnss(&fix);
            }
            if step % SAMPLE != 0 {
                continue;
            }
            let _ = navigator.on_imu(&unit.sample(step));
            if step % 1000 == 0 && navigator.phase() == Phase::Navigating {
                self.add_errors(&navigator, &simulation, step);
            }
        }
        let found = navigator.estimates();
        // At a constant attitude a scale error is a bias.
        let scale_error = Vector3::z() * (found.level_force_mps2.norm() * unit.scale[1].z);
        let accel_bias_mps2 = unit.accel_bias_mps2 + scale_error;
        self.latency
            .add_estimate(&found.gnss_latency_now_s, receiver.latency_s);
        for axis in 0..3 {
            self.gyros
                .add_estimate(&found.gyro_bias_radps[axis], unit.gyro_bias_radps[axis]);
            self.accels
                .add_estimate(&found.accel_bias_mps2[axis], accel_bias_mps2[axis]);
            self.arm
                .add_estimate(&found.lever_arm_m[axis], receiver.arm_m[axis]);
        }
    }

    fn add_errors(&mut self, navigator: &Navigator, simulation: &Simulation, step: usize) {
        let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) else {
            return;
        };
        let (position, attitude) = simulation.at_end_of(step);
        let (geodetic, enu) = geodetic(&(simulation.origin_m + simulation.to_earth * position));
        let local = enu.transpose() * simulation.to_earth;
        let velocity_mps = local * (simulation.path[step + 1].0 - simulation.path[step].0) / STEP_S;
        let truth = Rotation3::from_matrix_unchecked(local * attitude.matrix());
        let attitude_error =
            (solution.attitude.to_rotation_matrix() * truth.inverse()).scaled_axis();
        let velocity_error = solution.velocity_enu_mps - velocity_mps;
        let position_error = solution.position.enu_from(&geodetic);
        if navigator.estimates().azimuth_error_rad.observability == Observability::Observable {
            self.heading
                .add(wrap_pi(attitude_error.z), sigma.attitude_rad.z);
        }
        for axis in 0..2 {
            self.tilt
                .add(attitude_error[axis], sigma.attitude_rad[axis]);
            self.velocity
                .add(velocity_error[axis], sigma.velocity_mps[axis]);
            self.position
                .add(position_error[axis], sigma.position_m[axis]);
        }
        self.climb.add(velocity_error.z, sigma.velocity_mps.z);
        self.height.add(position_error.z, sigma.position_m.z);
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Town,
    Hills,
    Bicycle,
    Multirotor,
}

/// A path in the tangent plane of its origin, fixed to the Earth.
struct Simulation {
    origin_m: Vector3<f64>,
    /// From the tangent plane, east-north-up, to the Earth's axes.
    to_earth: Matrix3<f64>,
    path: Vec<(Vector3<f64>, Rotation3<f64>)>,
}

impl Simulation {
    fn new(kind: Kind, seed: u64) -> Self {
        let mut random = Random::new(seed, 1);
        let latitude_rad = random.between(-1.0, 1.1);
        let longitude_rad = random.between(-PI, PI);
        let to_earth = axes(latitude_rad, longitude_rad);
        let origin_m = on_ellipsoid(latitude_rad, random.between(0.0, 900.0), &to_earth);
        let mut vehicle = Vehicle::new(kind, &mut random);
        let path = (0..STEPS).map(|_| vehicle.step(&mut random)).collect();
        Self {
            origin_m,
            to_earth,
            path,
        }
    }

    /// At the end of the interval centred on a step.
    fn at_end_of(&self, step: usize) -> (Vector3<f64>, Rotation3<f64>) {
        let [(position, attitude), (next, next_attitude)] = [self.path[step], self.path[step + 1]];
        (0.5 * (position + next), attitude.slerp(&next_attitude, 0.5))
    }
}

/// Rest, then random legs.
struct Vehicle {
    kind: Kind,
    time_s: f64,
    until_s: f64,
    /// Commanded speed or velocity, curvature or yaw rate, and grade.
    command: [f64; 4],
    smooth: [[f64; 3]; 5],
    speed_mps: f64,
    velocity_mps: Vector3<f64>,
    position_m: Vector3<f64>,
    heading_rad: f64,
}

impl Vehicle {
    fn new(kind: Kind, random: &mut Random) -> Self {
        Self {
            kind,
            time_s: 0.0,
            until_s: random.between(20.0, 60.0),
            command: [0.0; 4],
            smooth: [[0.0; 3]; 5],
            speed_mps: 0.0,
            velocity_mps: Vector3::zeros(),
            position_m: Vector3::zeros(),
            heading_rad: random.between(0.0, TAU),
        }
    }

    fn step(&mut self, random: &mut Random) -> (Vector3<f64>, Rotation3<f64>) {
        self.time_s += STEP_S;
        if self.time_s > self.until_s {
            let duration_s;
            (duration_s, self.command) = leg(self.kind, random);
            self.until_s += duration_s;
        }
        if self.kind == Kind::Multirotor {
            self.step_in_the_air()
        } else {
            self.step_on_wheels()
        }
    }

    /// On wheels: along its heading, rolling outwards in a bend, or inwards on two wheels.
    fn step_on_wheels(&mut self) -> (Vector3<f64>, Rotation3<f64>) {
        let [speed, curvature, grade, _] = self.command;
        let accel = ((speed - self.speed_mps) / 1.5).clamp(-2.5, 2.0);
        let accel = low_pass(&mut self.smooth[0], accel, 0.15);
        self.speed_mps += accel * STEP_S;
        let turn = self.speed_mps * low_pass(&mut self.smooth[1], curvature, 0.25);
        self.heading_rad += turn * STEP_S;
        let grade = low_pass(&mut self.smooth[2], grade, 1.0);
        let (sin, cos) = self.heading_rad.sin_cos();
        let along = Vector3::new(sin * grade.cos(), cos * grade.cos(), grade.sin());
        self.position_m += along * (self.speed_mps * STEP_S);
        let lean = if self.kind == Kind::Bicycle {
            0.1
        } else {
            -0.006
        };
        let roll = low_pass(&mut self.smooth[3], lean * self.speed_mps * turn, 0.12);
        let pitch = grade + low_pass(&mut self.smooth[4], 0.004 * accel, 0.12);
        let attitude = attitude_of(self.heading_rad, pitch, roll);
        // Position of the unit relative to the wheels.
        (
            self.position_m + attitude * Vector3::new(0.3, 1.2, 0.6),
            attitude,
        )
    }

    /// In the air: thrust along the required acceleration.
    fn step_in_the_air(&mut self) -> (Vector3<f64>, Rotation3<f64>) {
        let [east, north, up, yaw] = self.command;
        let error = (Vector3::new(east, north, up) - self.velocity_mps) / 0.8;
        let accel_mps2 = Vector3::from_fn(|axis, _| {
            low_pass(&mut self.smooth[axis], error[axis].clamp(-3.0, 3.0), 0.15)
        });
        self.velocity_mps += accel_mps2 * STEP_S;
        self.position_m += self.velocity_mps * STEP_S;
        self.heading_rad += low_pass(&mut self.smooth[3], yaw, 0.15) * STEP_S;
        let thrust =
            (accel_mps2 + 0.2 * self.velocity_mps + Vector3::new(0.0, 0.0, 9.8)).normalize();
        let forward = Vector3::new(self.heading_rad.sin(), self.heading_rad.cos(), 0.0);
        let right = forward.cross(&thrust).normalize();
        let columns = [right, thrust.cross(&right), thrust];
        let attitude = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns));
        (self.position_m, attitude)
    }
}

/// Duration and commands of the next leg.
fn leg(kind: Kind, random: &mut Random) -> (f64, [f64; 4]) {
    let chance = random.between(0.0, 1.0);
    let side = random.between(-1.0, 1.0).signum();
    let normal = random.normal();
    match kind {
        Kind::Town if chance < 0.15 => (random.between(5.0, 40.0), [0.0; 4]),
        Kind::Town if chance < 0.6 => (
            random.between(5.0, 20.0),
            [random.between(6.0, 14.0), 0.0, 0.01 * normal, 0.0],
        ),
        Kind::Town => {
            let curvature = 1.0 / random.between(10.0, 20.0);
            let corner = [5.0, side * curvature, 0.01 * normal, 0.0];
            (FRAC_PI_2 / (5.0 * curvature), corner)
        }
        Kind::Hills => {
            let bend = if chance < 0.5 {
                0.0
            } else {
                0.04 * random.normal()
            };
            (
                random.between(4.0, 15.0),
                [random.between(6.0, 12.0), bend, 0.06 * normal, 0.0],
            )
        }
        Kind::Bicycle if chance < 0.1 => (random.between(4.0, 20.0), [0.0; 4]),
        Kind::Bicycle => {
            let bend = if chance < 0.6 { 0.005 } else { 0.08 };
            (
                random.between(3.0, 12.0),
                [random.between(3.0, 7.0), bend * normal, 0.0, 0.0],
            )
        }
        Kind::Multirotor if chance < 0.3 => {
            (random.between(4.0, 12.0), [0.0, 0.0, 0.0, 0.4 * normal])
        }
        Kind::Multirotor => {
            let [east, north, up] = [(); 3].map(|()| random.normal());
            (
                random.between(4.0, 10.0),
                [4.0 * east, 4.0 * north, up, 0.3 * normal],
            )
        }
    }
}

/// Inertial sensors: errors, and increments since the last sample.
struct Unit {
    random: Random,
    gyro_bias_radps: Vector3<f64>,
    accel_bias_mps2: Vector3<f64>,
    scale: [Vector3<f64>; 2],
    angle_rad: Vector3<f64>,
    velocity_mps: Vector3<f64>,
}

impl Unit {
    const GYRO_NOISE: f64 = 1.5e-4;
    const ACCEL_NOISE: f64 = 2e-3;

    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, 2);
        let gyro_bias_radps = 6e-3 * random.normals();
        let accel_bias_mps2 = 0.15 * random.normals();
        let scale = [(); 2].map(|()| 2e-3 * random.normals());
        Self {
            random,
            gyro_bias_radps,
            accel_bias_mps2,
            scale,
            angle_rad: Vector3::zeros(),
            velocity_mps: Vector3::zeros(),
        }
    }

    /// Adds the increments of a step: specific force in rotating axes, and rate relative to inertial space.
    fn add_step(&mut self, simulation: &Simulation, step: usize) {
        let [before, now, after] = [step - 1, step, step + 1].map(|at| simulation.path[at]);
        let velocity = (after.0 - before.0) / (2.0 * STEP_S);
        let accel = (after.0 - 2.0 * now.0 + before.0) / (STEP_S * STEP_S);
        let to_local = simulation.to_earth.transpose();
        let earth = to_local * Vector3::new(0.0, 0.0, EARTH_RADPS);
        let gravity = to_local * gravity(&(simulation.origin_m + simulation.to_earth * now.0));
        let force = now.1.inverse() * (accel + 2.0 * earth.cross(&velocity) - gravity);
        let turn = (before.1.inverse() * after.1).scaled_axis() / 2.0;
        self.angle_rad += turn + now.1.inverse() * earth * STEP_S;
        self.velocity_mps += force * STEP_S;
    }

    fn sample(&mut self, step: usize) -> ImuSample {
        let seconds = STEP_S * SAMPLE as f64;
        let [gyro, accel] = self.scale.map(|scale| scale.add_scalar(1.0));
        let noise = seconds.sqrt();
        let gyro = self.angle_rad.component_mul(&gyro)
            + self.gyro_bias_radps * seconds
            + Self::GYRO_NOISE * noise * self.random.normals();
        let accel = self.velocity_mps.component_mul(&accel)
            + self.accel_bias_mps2 * seconds
            + Self::ACCEL_NOISE * noise * self.random.normals();
        (self.angle_rad, self.velocity_mps) = (Vector3::zeros(), Vector3::zeros());
        ImuSample {
            time: time((step as f64 + 0.5) * STEP_S),
            gyro,
            accel,
        }
    }
}

/// With latency, lever arm, white and correlated noise.
struct Receiver {
    random: Random,
    latency_s: f64,
    arm_m: Vector3<f64>,
    position_noise_m: Vector3<f64>,
    velocity_noise_mps: Vector3<f64>,
}

impl Receiver {
    const POSITION_NOISE: [f64; 2] = [0.8, 60.0];
    const VELOCITY_NOISE: [f64; 2] = [0.02, 3.0];

    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, 3);
        let latency_s = random.between(0.0, 0.3);
        let arm_m = random.normals().component_mul(&Vector3::new(0.4, 0.8, 0.8));
        let position_noise_m = Self::POSITION_NOISE[0] * random.normals();
        let velocity_noise_mps = Self::VELOCITY_NOISE[0] * random.normals();
        Self {
            random,
            latency_s,
            arm_m,
            position_noise_m,
            velocity_noise_mps,
        }
    }

    fn fix(&mut self, simulation: &Simulation, step: usize) -> GnssFix {
        for (of, [sigma, duration_s]) in [
            (&mut self.position_noise_m, Self::POSITION_NOISE),
            (&mut self.velocity_noise_mps, Self::VELOCITY_NOISE),
        ] {
            let decay = (-STEP_S * FIX as f64 / duration_s).exp();
            *of = *of * decay + sigma * (1.0 - decay * decay).sqrt() * self.random.normals();
        }
        let antenna = |at: usize| simulation.path[at].0 + simulation.path[at].1 * self.arm_m;
        let velocity = (antenna(step + 1) - antenna(step - 1)) / (2.0 * STEP_S);
        let position = antenna(step) + self.position_noise_m + 0.3 * self.random.normals();
        let velocity = velocity + self.velocity_noise_mps + 0.05 * self.random.normals();
        let (geodetic, enu) = geodetic(&(simulation.origin_m + simulation.to_earth * position));
        let velocity = enu.transpose() * simulation.to_earth * velocity;
        GnssFix {
            time: time(step as f64 * STEP_S + self.latency_s),
            velocity_en_mps: Some(Vector2::new(velocity.x, velocity.y)),
            velocity_up_mps: Some(velocity.z),
            ..GnssFix::default()
        }
        .at(&geodetic)
    }
}

const EARTH_RADPS: f64 = 7.292_115e-5;
const EQUATOR_M: f64 = 6_378_137.0;
const SQUARED_ECCENTRICITY: f64 = 6.694_379_990_14e-3;

/// Gravity with the zonal harmonics J2 and J4, and centrifugal force; Earth-fixed axes.
fn gravity(position: &Vector3<f64>) -> Vector3<f64> {
    const ATTRACTION: f64 = 3.986_004_418e14;
    const J2: f64 = 1.082_629_821e-3;
    const J4: f64 = -2.370_911e-6;
    let radius = position.norm();
    let ratio2 = (EQUATOR_M / radius).powi(2);
    let sin2 = (position.z / radius).powi(2);
    let (second, fourth) = (1.5 * J2 * ratio2, 1.875 * J4 * ratio2 * ratio2);
    let level =
        1.0 + second * (1.0 - 5.0 * sin2) - fourth * (1.0 - 14.0 * sin2 + 21.0 * sin2 * sin2);
    let polar =
        1.0 + second * (3.0 - 5.0 * sin2) - fourth * (5.0 - 70.0 / 3.0 * sin2 + 21.0 * sin2 * sin2);
    let centrifugal = Vector3::new(position.x, position.y, 0.0) * (EARTH_RADPS * EARTH_RADPS);
    centrifugal
        - position.component_mul(&Vector3::new(level, level, polar)) * (ATTRACTION / radius.powi(3))
}

/// East, north and up in the Earth's axes.
fn axes(latitude_rad: f64, longitude_rad: f64) -> Matrix3<f64> {
    let (sin_lat, cos_lat) = latitude_rad.sin_cos();
    let (sin_lon, cos_lon) = longitude_rad.sin_cos();
    Matrix3::from_columns(&[
        Vector3::new(-sin_lon, cos_lon, 0.0),
        Vector3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
        Vector3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat),
    ])
}

fn on_ellipsoid(latitude_rad: f64, height_m: f64, axes: &Matrix3<f64>) -> Vector3<f64> {
    let normal_m = EQUATOR_M / (1.0 - SQUARED_ECCENTRICITY * latitude_rad.sin().powi(2)).sqrt();
    let up = axes.column(2);
    up * (normal_m + height_m) - Vector3::z() * (SQUARED_ECCENTRICITY * normal_m * up.z)
}

/// By Bowring's method, accurate to far below a millimetre; also the axes there.
fn geodetic(position: &Vector3<f64>) -> (Geodetic, Matrix3<f64>) {
    let polar_m = EQUATOR_M * (1.0 - SQUARED_ECCENTRICITY).sqrt();
    let axial_distance_m = position.x.hypot(position.y);
    let (sin, cos) = (position.z * EQUATOR_M)
        .atan2(axial_distance_m * polar_m)
        .sin_cos();
    let second = SQUARED_ECCENTRICITY / (1.0 - SQUARED_ECCENTRICITY);
    let latitude_rad = (position.z + second * polar_m * sin.powi(3))
        .atan2(axial_distance_m - SQUARED_ECCENTRICITY * EQUATOR_M * cos.powi(3));
    let longitude_rad = position.y.atan2(position.x);
    let enu = axes(latitude_rad, longitude_rad);
    let height_m = enu
        .column(2)
        .dot(&(position - on_ellipsoid(latitude_rad, 0.0, &enu)));
    (
        Geodetic {
            latitude_rad,
            longitude_rad,
            height_m,
        },
        enu,
    )
}

/// Heading clockwise from north, nose up, right side down; right-forward-up to east-north-up.
fn attitude_of(heading_rad: f64, pitch_rad: f64, roll_rad: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), -heading_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch_rad)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), roll_rad)
}

/// Third order with equal time constants: the output has a second derivative.
fn low_pass(stages: &mut [f64; 3], command: f64, seconds: f64) -> f64 {
    stages.iter_mut().fold(command, |before, stage| {
        *stage += (before - *stage) * (STEP_S / seconds);
        *stage
    })
}

fn time(seconds: f64) -> Time {
    Time::from_seconds(seconds).unwrap()
}

/// Xorshift and Box-Muller.
struct Random(u64);

impl Random {
    fn new(seed: u64, stream: u64) -> Self {
        let mut own = Self((4 * seed + stream).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        for _ in 0..20 {
            own.uniform();
        }
        own
    }

    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    fn normals(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal())
    }
}

//! The core in a world that shares nothing with the simulator it was developed on: the Earth is a field of
//! gravity in axes that turn, motion is a path of positions and attitudes, and sensors show its differences.
//! What the core says of its errors is held against them.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use ins_core::earth::{Geodetic, wrap_pi};
use ins_core::{
    Config, Estimate, GnssFix, ImuOutput, ImuSample, Navigator, Observability, Phase, Time,
};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

/// Of the path, and between two samples, s.
const STEP_S: f64 = 0.001;
const SAMPLE: usize = 10;
/// Between two fixes, in steps.
const FIX: usize = 200;
/// Of a run: ten minutes.
const STEPS: usize = 600_000;
/// Beyond so many of its own sigmas an error is wrong and sure.
const SURE: f64 = 4.5;

#[test]
fn what_the_core_states_of_its_errors_holds_in_another_world() {
    let mut judged = Judged::default();
    for seed in 1..=4 {
        for kind in [Kind::Town, Kind::Hills, Kind::Bicycle, Kind::Multirotor] {
            judged.run(kind, seed);
        }
    }
    judged.hold();
}

/// Errors of solutions, second by second, and of what is found at the end, in their sigmas.
#[derive(Debug, Default)]
struct Judged {
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
        self.wrong += f64::from(u8::from(ratio > SURE));
    }

    fn add_known(&mut self, estimate: &Estimate, truth: f64) {
        if estimate.observability == Observability::Observable {
            self.add(estimate.value - truth, estimate.sigma);
        }
    }
}

impl Judged {
    /// Errors last: each of the sixteen runs has one of a kind at least, and the mean of sixteen squares of
    /// normals is beyond 2.45 one time in a thousand.
    fn hold(&self) {
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
        let world = World::new(kind, seed);
        let mut config = Config::mems();
        config.imu_output = ImuOutput::Increments;
        let mut navigator = Navigator::new(config).unwrap();
        let mut unit = Unit::new(seed);
        let mut receiver = Receiver::new(seed);
        let steps = world.path.len() - 1;
        for step in 1..steps {
            unit.feel(&world, step);
            if step % FIX == 0 {
                let fix = receiver.fix(&world, step);
                let _ = navigator.on_gnss(&fix);
            }
            if step % SAMPLE != 0 {
                continue;
            }
            let _ = navigator.on_imu(&unit.sample(step));
            if step % 1000 == 0 && navigator.phase() == Phase::Navigating {
                self.look(&navigator, &world, step);
            }
        }
        let found = navigator.estimates();
        // At one attitude a scale error is a bias.
        let heavier = Vector3::z() * (found.level_force_mps2.norm() * unit.scale[1].z);
        let accel_bias_mps2 = unit.accel_bias_mps2 + heavier;
        self.latency
            .add_known(&found.gnss_latency_now_s, receiver.latency_s);
        for axis in 0..3 {
            self.gyros
                .add_known(&found.gyro_bias_radps[axis], unit.gyro_bias_radps[axis]);
            self.accels
                .add_known(&found.accel_bias_mps2[axis], accel_bias_mps2[axis]);
            self.arm
                .add_known(&found.lever_arm_m[axis], receiver.arm_m[axis]);
        }
    }

    fn look(&mut self, navigator: &Navigator, world: &World, step: usize) {
        let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) else {
            return;
        };
        let (place, attitude) = world.at_end_of(step);
        let (geodetic, enu) = geodetic(&(world.origin_m + world.to_earth * place));
        let local = enu.transpose() * world.to_earth;
        let velocity_mps = local * (world.path[step + 1].0 - world.path[step].0) / STEP_S;
        let truth = Rotation3::from_matrix_unchecked(local * attitude.matrix());
        let off_rad = (solution.attitude.to_rotation_matrix() * truth.inverse()).scaled_axis();
        let off_mps = solution.velocity_enu_mps - velocity_mps;
        let off_m = solution.position.enu_from(&geodetic);
        if navigator.estimates().azimuth_error_rad.observability == Observability::Observable {
            self.heading.add(wrap_pi(off_rad.z), sigma.attitude_rad.z);
        }
        for axis in 0..2 {
            self.tilt.add(off_rad[axis], sigma.attitude_rad[axis]);
            self.velocity.add(off_mps[axis], sigma.velocity_mps[axis]);
            self.position.add(off_m[axis], sigma.position_m[axis]);
        }
        self.climb.add(off_mps.z, sigma.velocity_mps.z);
        self.height.add(off_m.z, sigma.position_m.z);
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Town,
    Hills,
    Bicycle,
    Multirotor,
}

/// A path in the tangent plane of its origin, which the Earth carries along.
struct World {
    origin_m: Vector3<f64>,
    /// From the tangent plane, east-north-up, to the Earth's axes.
    to_earth: Matrix3<f64>,
    path: Vec<(Vector3<f64>, Rotation3<f64>)>,
}

impl World {
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

    /// At the end of the interval whose middle a step is.
    fn at_end_of(&self, step: usize) -> (Vector3<f64>, Rotation3<f64>) {
        let [(place, attitude), (next, turned)] = [self.path[step], self.path[step + 1]];
        (0.5 * (place + next), attitude.slerp(&turned, 0.5))
    }
}

/// Rests at first, then does one thing after another.
struct Vehicle {
    kind: Kind,
    time_s: f64,
    until_s: f64,
    /// Speed or velocity, curvature or yaw rate, and grade that are asked for.
    wanted: [f64; 4],
    smooth: [[f64; 3]; 5],
    speed_mps: f64,
    velocity_mps: Vector3<f64>,
    place_m: Vector3<f64>,
    heading_rad: f64,
}

impl Vehicle {
    fn new(kind: Kind, random: &mut Random) -> Self {
        Self {
            kind,
            time_s: 0.0,
            until_s: random.between(20.0, 60.0),
            wanted: [0.0; 4],
            smooth: [[0.0; 3]; 5],
            speed_mps: 0.0,
            velocity_mps: Vector3::zeros(),
            place_m: Vector3::zeros(),
            heading_rad: random.between(0.0, TAU),
        }
    }

    fn step(&mut self, random: &mut Random) -> (Vector3<f64>, Rotation3<f64>) {
        self.time_s += STEP_S;
        if self.time_s > self.until_s {
            let lasts_s;
            (lasts_s, self.wanted) = leg(self.kind, random);
            self.until_s += lasts_s;
        }
        if self.kind == Kind::Multirotor {
            self.hover()
        } else {
            self.roll()
        }
    }

    /// On wheels: along its heading, leaning out of a bend, or into it on two of them.
    fn roll(&mut self) -> (Vector3<f64>, Rotation3<f64>) {
        let [speed, curvature, grade, _] = self.wanted;
        let push = ((speed - self.speed_mps) / 1.5).clamp(-2.5, 2.0);
        let push = low_pass(&mut self.smooth[0], push, 0.15);
        self.speed_mps += push * STEP_S;
        let turn = self.speed_mps * low_pass(&mut self.smooth[1], curvature, 0.25);
        self.heading_rad += turn * STEP_S;
        let grade = low_pass(&mut self.smooth[2], grade, 1.0);
        let (sin, cos) = self.heading_rad.sin_cos();
        let along = Vector3::new(sin * grade.cos(), cos * grade.cos(), grade.sin());
        self.place_m += along * (self.speed_mps * STEP_S);
        let lean = if self.kind == Kind::Bicycle {
            0.1
        } else {
            -0.006
        };
        let roll = low_pass(&mut self.smooth[3], lean * self.speed_mps * turn, 0.12);
        let pitch = grade + low_pass(&mut self.smooth[4], 0.004 * push, 0.12);
        let attitude = turned(self.heading_rad, pitch, roll);
        // The unit is not where the wheels are.
        (
            self.place_m + attitude * Vector3::new(0.3, 1.2, 0.6),
            attitude,
        )
    }

    /// In the air: its thrust points where the acceleration wants it.
    fn hover(&mut self) -> (Vector3<f64>, Rotation3<f64>) {
        let [east, north, up, yaw] = self.wanted;
        let error = (Vector3::new(east, north, up) - self.velocity_mps) / 0.8;
        let pull = Vector3::from_fn(|axis, _| {
            low_pass(&mut self.smooth[axis], error[axis].clamp(-3.0, 3.0), 0.15)
        });
        self.velocity_mps += pull * STEP_S;
        self.place_m += self.velocity_mps * STEP_S;
        self.heading_rad += low_pass(&mut self.smooth[3], yaw, 0.15) * STEP_S;
        let thrust = (pull + 0.2 * self.velocity_mps + Vector3::new(0.0, 0.0, 9.8)).normalize();
        let ahead = Vector3::new(self.heading_rad.sin(), self.heading_rad.cos(), 0.0);
        let right = ahead.cross(&thrust).normalize();
        let columns = [right, thrust.cross(&right), thrust];
        let attitude = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns));
        (self.place_m, attitude)
    }
}

/// What comes next, and for how long.
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

/// Inertial sensors: what they are biased by, and what has come together since the last sample.
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

    /// What one step adds: the Earth's axes turn, and what falls freely feels nothing.
    fn feel(&mut self, world: &World, step: usize) {
        let [before, now, after] = [step - 1, step, step + 1].map(|at| world.path[at]);
        let velocity = (after.0 - before.0) / (2.0 * STEP_S);
        let accel = (after.0 - 2.0 * now.0 + before.0) / (STEP_S * STEP_S);
        let to_local = world.to_earth.transpose();
        let earth = to_local * Vector3::new(0.0, 0.0, EARTH_RADPS);
        let gravity = to_local * gravity(&(world.origin_m + world.to_earth * now.0));
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

/// Late, away from the unit, noisy anew in each fix and for a while.
struct Receiver {
    random: Random,
    latency_s: f64,
    arm_m: Vector3<f64>,
    wander_m: Vector3<f64>,
    drift_mps: Vector3<f64>,
}

impl Receiver {
    const WANDERS: [f64; 2] = [0.8, 60.0];
    const DRIFTS: [f64; 2] = [0.02, 3.0];

    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, 3);
        let latency_s = random.between(0.0, 0.3);
        let arm_m = random.normals().component_mul(&Vector3::new(0.4, 0.8, 0.8));
        let wander_m = Self::WANDERS[0] * random.normals();
        let drift_mps = Self::DRIFTS[0] * random.normals();
        Self {
            random,
            latency_s,
            arm_m,
            wander_m,
            drift_mps,
        }
    }

    fn fix(&mut self, world: &World, step: usize) -> GnssFix {
        for (of, [sigma, lasts_s]) in [
            (&mut self.wander_m, Self::WANDERS),
            (&mut self.drift_mps, Self::DRIFTS),
        ] {
            let keep = (-STEP_S * FIX as f64 / lasts_s).exp();
            *of = *of * keep + sigma * (1.0 - keep * keep).sqrt() * self.random.normals();
        }
        let antenna = |at: usize| world.path[at].0 + world.path[at].1 * self.arm_m;
        let velocity = (antenna(step + 1) - antenna(step - 1)) / (2.0 * STEP_S);
        let place = antenna(step) + self.wander_m + 0.3 * self.random.normals();
        let velocity = velocity + self.drift_mps + 0.05 * self.random.normals();
        let (geodetic, enu) = geodetic(&(world.origin_m + world.to_earth * place));
        let velocity = enu.transpose() * world.to_earth * velocity;
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

/// Gravity of an Earth with its second and fourth zonal harmonics, and the centrifugal force; its axes.
fn gravity(place: &Vector3<f64>) -> Vector3<f64> {
    const ATTRACTION: f64 = 3.986_004_418e14;
    const J2: f64 = 1.082_629_821e-3;
    const J4: f64 = -2.370_911e-6;
    let radius = place.norm();
    let flat = (EQUATOR_M / radius).powi(2);
    let sin2 = (place.z / radius).powi(2);
    let (second, fourth) = (1.5 * J2 * flat, 1.875 * J4 * flat * flat);
    let level =
        1.0 + second * (1.0 - 5.0 * sin2) - fourth * (1.0 - 14.0 * sin2 + 21.0 * sin2 * sin2);
    let polar =
        1.0 + second * (3.0 - 5.0 * sin2) - fourth * (5.0 - 70.0 / 3.0 * sin2 + 21.0 * sin2 * sin2);
    let spun = Vector3::new(place.x, place.y, 0.0) * (EARTH_RADPS * EARTH_RADPS);
    spun - place.component_mul(&Vector3::new(level, level, polar)) * (ATTRACTION / radius.powi(3))
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

/// By Bowring's method, exact to far below a millimetre; with east, north and up there.
fn geodetic(place: &Vector3<f64>) -> (Geodetic, Matrix3<f64>) {
    let polar_m = EQUATOR_M * (1.0 - SQUARED_ECCENTRICITY).sqrt();
    let away_m = place.x.hypot(place.y);
    let (sin, cos) = (place.z * EQUATOR_M).atan2(away_m * polar_m).sin_cos();
    let second = SQUARED_ECCENTRICITY / (1.0 - SQUARED_ECCENTRICITY);
    let latitude_rad = (place.z + second * polar_m * sin.powi(3))
        .atan2(away_m - SQUARED_ECCENTRICITY * EQUATOR_M * cos.powi(3));
    let longitude_rad = place.y.atan2(place.x);
    let enu = axes(latitude_rad, longitude_rad);
    let height_m = enu
        .column(2)
        .dot(&(place - on_ellipsoid(latitude_rad, 0.0, &enu)));
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
fn turned(heading_rad: f64, pitch_rad: f64, roll_rad: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), -heading_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch_rad)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), roll_rad)
}

/// Three of one time constant: what comes out has a second derivative.
fn low_pass(stages: &mut [f64; 3], wanted: f64, seconds: f64) -> f64 {
    stages.iter_mut().fold(wanted, |before, stage| {
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

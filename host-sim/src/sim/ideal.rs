//! Sensors without error: any motion on the rotating WGS-84 ellipsoid.

use ins_core::earth::{Geodetic, LocalEarth, wrap_pi};
use ins_core::increments;
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{ImuOutput, ImuSample, Solution, Time};
use nalgebra::Vector3;

use super::motion::{Kinematics, Motion};

/// Inner nodes of the four-point Gauss-Lobatto rule on [0, 1], `(1 -+ 1/sqrt 5) / 2`.
///
/// As exact as three-point Gauss-Legendre (degree 5), but with nodes at the ends of the interval, which
/// the truth needs anyway.
const INNER_NODES: [f64; 2] = [0.276_393_202_250_021, 0.723_606_797_749_979];
const END_WEIGHT: f64 = 1.0 / 12.0;
const INNER_WEIGHT: f64 = 5.0 / 12.0;

/// Increments of integrating sensors over an interval, in the rotating body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increments {
    /// Integral of the angular rate of the body against inertial space.
    pub angle_b_rad: Vector3<f64>,
    pub velocity_b_mps: Vector3<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Angular rate of the body against inertial space.
    pub angular_rate_ib_b_radps: Vector3<f64>,
    /// Specific force: at rest +g upwards.
    pub specific_force_b_mps2: Vector3<f64>,
}

impl Rates {
    fn at(kinematics: &Kinematics, earth: &LocalEarth) -> Self {
        let velocity = &kinematics.velocity_enu_mps;
        let earth_rate = earth.earth_rate();
        let transport_rate = earth.transport_rate(velocity);
        let to_body = kinematics.attitude.inverse();
        let coriolis = (2.0 * earth_rate + transport_rate).cross(velocity);
        let gravity_reaction = Vector3::new(0.0, 0.0, earth.gravity_mps2);
        Self {
            angular_rate_ib_b_radps: kinematics.angular_rate_lb_b_radps
                + to_body * (earth_rate + transport_rate),
            specific_force_b_mps2: to_body
                * (kinematics.acceleration_enu_mps2 + coriolis + gravity_reaction),
        }
    }
}

/// The exact state of the vehicle at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueState {
    pub solution: Solution,
    pub acceleration_enu_mps2: Vector3<f64>,
    pub rates: Rates,
}

/// Position and velocity of the sensors between two states one sampling interval or less apart.
///
/// Velocity is the cubic with the states' velocities and accelerations at its ends (error
/// h^4/384 of its fourth derivative: some 1e-9 m/s for a car at 100 Hz), position its integral.
fn between(from: &TrueState, to: &TrueState, time_s: f64) -> Antenna {
    let start_s = from.solution.time.as_seconds();
    let h = to.solution.time.seconds_since(from.solution.time);
    let u = (time_s - start_s) / h;
    let end = |state: &TrueState| {
        let solution = &state.solution;
        [solution.velocity_enu_mps, h * state.acceleration_enu_mps2]
    };
    let velocity = Cubic::between(end(from), end(to));
    let moved = h * u * velocity.mean_until(u);
    Antenna {
        position: displaced(&from.solution.position, &moved),
        velocity_enu_mps: velocity.at(u).0,
    }
}

/// Position displaced by a vector in metres.
pub(crate) fn displaced(from: &Geodetic, moved_enu_m: &Vector3<f64>) -> Geodetic {
    displaced_on(
        &LocalEarth::at(from.latitude_rad, from.height_m),
        from,
        moved_enu_m,
    )
}

fn displaced_on(earth: &LocalEarth, from: &Geodetic, moved_enu_m: &Vector3<f64>) -> Geodetic {
    let east_rad = moved_enu_m.x / (earth.east_radius_m * earth.cos_latitude);
    Geodetic {
        latitude_rad: from.latitude_rad + moved_enu_m.y / earth.north_radius_m,
        longitude_rad: wrap_pi(from.longitude_rad + east_rad),
        height_m: from.height_m + moved_enu_m.z,
    }
}

/// Position and velocity of an antenna, at the lever arm from the inertial sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Antenna {
    pub position: Geodetic,
    pub velocity_enu_mps: Vector3<f64>,
}

impl Antenna {
    /// Between two states one sampling interval or less apart.
    ///
    /// Sensors and arm are interpolated separately, each by the cubic through its values and derivatives at
    /// the two states: arm and its velocity are accurate to h^3 of the rotation's fourth derivative.
    pub fn between(from: &TrueState, to: &TrueState, time_s: f64, arm_m: &[f64; 3]) -> Self {
        let sensors = between(from, to, time_s);
        let arm = Vector3::from(*arm_m);
        if arm.norm_squared() == 0.0 {
            return sensors;
        }
        let h = to.solution.time.seconds_since(from.solution.time);
        let u = (time_s - from.solution.time.as_seconds()) / h;
        let end = |state: &TrueState| {
            let (reach, swing) = arm_enu(state, &arm);
            [reach, h * swing]
        };
        let (reach, swing) = Cubic::between(end(from), end(to)).at(u);
        Self {
            position: displaced(&sensors.position, &reach),
            velocity_enu_mps: sensors.velocity_enu_mps + swing / h,
        }
    }
}

/// The arm and its velocity against the Earth, ENU.
fn arm_enu(state: &TrueState, arm: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let at = &state.solution.position;
    let attitude = state.solution.attitude;
    let earth_rate = LocalEarth::at(at.latitude_rad, at.height_m).earth_rate();
    let rate = attitude * state.rates.angular_rate_ib_b_radps - earth_rate;
    let reach = attitude * arm;
    (reach, rate.cross(&reach))
}

/// Hermite cubic of a vector on [0, 1].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cubic([Vector3<f64>; 4]);

impl Cubic {
    /// Through value and derivative at both ends.
    pub(crate) fn between([v0, d0]: [Vector3<f64>; 2], [v1, d1]: [Vector3<f64>; 2]) -> Self {
        Self([
            v0,
            d0,
            3.0 * (v1 - v0) - 2.0 * d0 - d1,
            2.0 * (v0 - v1) + d0 + d1,
        ])
    }

    /// Value and derivative.
    pub(crate) fn at(&self, u: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [c0, c1, c2, c3] = &self.0;
        (
            c0 + u * (c1 + u * (c2 + u * c3)),
            c1 + u * (2.0 * c2 + 3.0 * u * c3),
        )
    }

    /// Mean from the start on.
    pub(crate) fn mean_until(&self, u: f64) -> Vector3<f64> {
        let [c0, c1, c2, c3] = &self.0;
        c0 + u * (c1 / 2.0 + u * (c2 / 3.0 + u * c3 / 4.0))
    }

    /// Over [0, 1].
    pub(crate) fn integral(&self) -> Vector3<f64> {
        let [c0, c1, c2, c3] = &self.0;
        c0 + c1 / 2.0 + c2 / 3.0 + c3 / 4.0
    }
}

/// Ideal inertial sensors on a motion.
#[derive(Clone, Debug)]
pub struct IdealSensors<M> {
    motion: M,
    state: TrueState,
    kinematics: Kinematics,
    earth: LocalEarth,
}

impl<M: Motion> IdealSensors<M> {
    /// Places a motion at `origin` at the instant `start`.
    pub fn new(mut motion: M, origin: Geodetic, start: Time) -> Self {
        let kinematics = motion.kinematics(start.as_seconds());
        let earth = LocalEarth::at(origin.latitude_rad, origin.height_m);
        let state = true_state(start, origin, &kinematics, &earth);
        Self {
            motion,
            state,
            kinematics,
            earth,
        }
    }

    pub fn state(&self) -> &TrueState {
        &self.state
    }

    /// Advances to a later instant; returns the increments.
    pub fn advance(&mut self, to: Time) -> Increments {
        let from = self.state.solution;
        let start_s = from.time.as_seconds();
        let h = to.seconds_since(from.time);
        let [early, late] = INNER_NODES.map(|node| self.motion.kinematics(start_s + node * h));
        let end = self.motion.kinematics(to.as_seconds());

        // Earth rate, gravity and radii change so slowly that mid-interval values serve the inner nodes:
        // the error is of third order in the interval.
        let halfway = displaced_on(
            &self.earth,
            &from.position,
            &(0.5 * h * from.velocity_enu_mps),
        );
        let mid_earth = LocalEarth::at(halfway.latitude_rad, halfway.height_m);
        let moved = integral(
            h,
            &[self.kinematics, early, late, end].map(|k| k.velocity_enu_mps),
        );
        let position = displaced_on(&mid_earth, &from.position, &moved);

        let start_rates = self.state.rates;
        self.earth = LocalEarth::at(position.latitude_rad, position.height_m);
        self.state = true_state(to, position, &end, &self.earth);
        self.kinematics = end;
        let rates = [
            start_rates,
            Rates::at(&early, &mid_earth),
            Rates::at(&late, &mid_earth),
            self.state.rates,
        ];
        Increments {
            angle_b_rad: integral(h, &rates.map(|r| r.angular_rate_ib_b_radps)),
            velocity_b_mps: integral(h, &rates.map(|r| r.specific_force_b_mps2)),
        }
    }
}

fn true_state(
    time: Time,
    position: Geodetic,
    kinematics: &Kinematics,
    earth: &LocalEarth,
) -> TrueState {
    TrueState {
        solution: Solution {
            time,
            position,
            velocity_enu_mps: kinematics.velocity_enu_mps,
            attitude: kinematics.attitude,
        },
        acceleration_enu_mps2: kinematics.acceleration_enu_mps2,
        rates: Rates::at(kinematics, earth),
    }
}

fn integral(h: f64, [start, early, late, end]: &[Vector3<f64>; 4]) -> Vector3<f64> {
    h * (END_WEIGHT * (start + end) + INNER_WEIGHT * (early + late))
}

/// Largest errors over a run of position (m), velocity (m/s) and attitude (rad) of a strapdown without
/// errors, fed by ideal sensors, `rate_hz` increments a second.
pub fn strapdown_errors(
    motion: impl Motion,
    origin: Geodetic,
    rate_hz: u32,
    duration_s: u32,
) -> [f64; 3] {
    let mut sensors = IdealSensors::new(motion, origin, Time::default());
    let start = sensors.state().solution;
    let mut ins = Mechanization::new(start.position, start.velocity_enu_mps, start.attitude);
    let mut before: Option<increments::Increments> = None;
    let mut worst = [0.0_f64; 3];
    let interval_s = 1.0 / f64::from(rate_hz);
    for count in 1..=rate_hz * duration_s {
        let time = Time::default().plus_seconds(f64::from(count) * interval_s);
        let gained = sensors.advance(time);
        let sample = ImuSample {
            time,
            gyro: gained.angle_b_rad,
            accel: gained.velocity_b_mps,
        };
        let before = before
            .get_or_insert_with(|| increments::Increments::new(ImuOutput::Increments, &sample));
        ins.step(&before.interval(&sample, interval_s), &Controls::default());
        let truth = sensors.state().solution;
        let errors = [
            ins.position.enu_from(&truth.position).norm(),
            (ins.velocity_enu_mps - truth.velocity_enu_mps).norm(),
            ins.attitude.angle_to(&truth.attitude),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use ins_core::attitude::{Euler, from_euler};
    use ins_core::earth::{ECCENTRICITY_SQUARED, ROTATION_RATE_RADPS, SEMI_MAJOR_AXIS_M};
    use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

    use super::super::car::Car;
    use super::*;

    /// Level, at constant speed, straight on.
    struct Steady {
        speed_mps: f64,
        heading_rad: f64,
    }

    impl Motion for Steady {
        fn kinematics(&mut self, _: f64) -> Kinematics {
            let (sin, cos) = self.heading_rad.sin_cos();
            Kinematics {
                velocity_enu_mps: self.speed_mps * Vector3::new(sin, cos, 0.0),
                acceleration_enu_mps2: Vector3::zeros(),
                attitude: from_euler(&Euler {
                    heading_rad: self.heading_rad,
                    ..Euler::default()
                }),
                angular_rate_lb_b_radps: Vector3::zeros(),
            }
        }
    }

    const ORIGIN: Geodetic = Geodetic {
        latitude_rad: 0.9,
        longitude_rad: 3.1,
        height_m: 150.0,
    };

    fn seconds(time_s: f64) -> Time {
        Time::default().plus_seconds(time_s)
    }

    /// Mean rate and specific force over 10 ms.
    fn read(speed_mps: f64, heading_rad: f64) -> [Vector3<f64>; 2] {
        let motion = Steady {
            speed_mps,
            heading_rad,
        };
        let gained = IdealSensors::new(motion, ORIGIN, Time::default()).advance(seconds(0.01));
        [gained.angle_b_rad, gained.velocity_b_mps].map(|gained| gained / 0.01)
    }

    fn assert_near(value: &Vector3<f64>, expected: [f64; 3], tolerance: f64) {
        let off = (value - Vector3::from(expected)).norm();
        assert!(off < tolerance, "{value} is {off} from {expected:?}");
    }

    #[test]
    fn at_rest_reads_gravity_and_earth_rate() {
        let [turned, felt] = read(0.0, 0.0);
        let earth = LocalEarth::at(ORIGIN.latitude_rad, ORIGIN.height_m);
        let (sin, cos) = ORIGIN.latitude_rad.sin_cos();
        let rate = ROTATION_RATE_RADPS;
        assert_near(&turned, [0.0, rate * cos, rate * sin], 1e-16);
        assert_near(&felt, [0.0, 0.0, earth.gravity_mps2], 1e-12);
    }

    #[test]
    fn driving_east_weighs_less_and_turns_with_the_earth() {
        // Along a parallel the vehicle circles the Earth's axis: everything follows from one
        // circle of radius RE cos(lat), turned through at Omega + V / (RE cos(lat)).
        let v = 30.0;
        let [turned, felt] = read(v, core::f64::consts::FRAC_PI_2);
        let earth = LocalEarth::at(ORIGIN.latitude_rad, ORIGIN.height_m);
        let (sin, cos) = ORIGIN.latitude_rad.sin_cos();
        let radius = earth.east_radius_m * cos;
        let at_rest = ROTATION_RATE_RADPS;
        let moving = at_rest + v / radius;
        // Towards the axis, beyond what gravity already holds at rest.
        let inwards = radius * (moving * moving - at_rest * at_rest);
        // Body axes: right is south, forward east, up.
        assert_near(&turned, [-moving * cos, 0.0, moving * sin], 1e-15);
        let up = earth.gravity_mps2 - inwards * cos;
        assert_near(&felt, [-inwards * sin, 0.0, up], 1e-11);
    }

    #[test]
    fn increments_add_up_whatever_the_interval() {
        let total = |step_s: f64| {
            let mut sensors = IdealSensors::new(Car::new(2, 100.0, None), ORIGIN, Time::default());
            let steps = (1..).map(|k| seconds(f64::from(k) * step_s));
            steps
                .take_while(|t| *t <= seconds(100.0))
                .fold([Vector3::zeros(); 2], |sum, t| {
                    let gained = sensors.advance(t);
                    [sum[0] + gained.angle_b_rad, sum[1] + gained.velocity_b_mps]
                })
        };
        let [angle, velocity] = total(0.02);
        let [fine_angle, fine_velocity] = total(0.005);
        // Quadrature errors at 50 Hz where segments of the motion join: measured 4e-9, 8e-10.
        assert!((angle - fine_angle).norm() < 1e-8);
        assert!((velocity - fine_velocity).norm() < 1e-8);
    }

    #[test]
    fn a_state_between_two_is_that_of_the_motion() {
        let mut car = Car::new(4, 600.0, None);
        let mut sensors = IdealSensors::new(car.clone(), ORIGIN, Time::default());
        let mut exact = IdealSensors::new(car.clone(), ORIGIN, Time::default());
        for k in 1..60_000 {
            let before = *sensors.state();
            let time_s = f64::from(k) * 0.01 - 0.0063;
            sensors.advance(seconds(f64::from(k) * 0.01));
            let found = between(&before, sensors.state(), time_s);
            exact.advance(seconds(time_s));
            assert_near(
                &found.velocity_enu_mps,
                car.kinematics(time_s).velocity_enu_mps.into(),
                1e-8,
            );
            // Both positions round latitude to 1e-16 rad, 1 nm, at each of 60000 steps.
            let off = found.position.enu_from(&exact.state().solution.position);
            assert!(off.norm() < 1e-6, "{off} at {time_s} s");
        }
    }

    /// A strapdown in inertial axes, where there is neither transport rate nor Coriolis term.
    struct InertialStrapdown {
        time_s: f64,
        position_m: Vector3<f64>,
        velocity_mps: Vector3<f64>,
        attitude: UnitQuaternion<f64>,
        last: Option<Increments>,
    }

    fn spin() -> Vector3<f64> {
        Vector3::new(0.0, 0.0, ROTATION_RATE_RADPS)
    }

    /// Axes east, north, up at a point, in Earth axes turned by the Earth's rotation since 0.
    fn enu_axes(at: &Geodetic, time_s: f64) -> Rotation3<f64> {
        let (sl, cl) = at.latitude_rad.sin_cos();
        let (so, co) = (at.longitude_rad + ROTATION_RATE_RADPS * time_s).sin_cos();
        Rotation3::from_matrix_unchecked(Matrix3::new(
            -so,
            -sl * co,
            cl * co, //
            co,
            -sl * so,
            cl * so, //
            0.0,
            cl,
            sl,
        ))
    }

    impl InertialStrapdown {
        fn of(solution: &Solution) -> Self {
            let time_s = solution.time.as_seconds();
            let at = &solution.position;
            let axes = enu_axes(at, time_s);
            let sl = at.latitude_rad.sin();
            let normal = SEMI_MAJOR_AXIS_M / (1.0 - ECCENTRICITY_SQUARED * sl * sl).sqrt();
            let up = axes * Vector3::z();
            let mut position_m = (normal + at.height_m) * up;
            position_m.z -= ECCENTRICITY_SQUARED * normal * sl;
            Self {
                time_s,
                position_m,
                velocity_mps: axes * solution.velocity_enu_mps + spin().cross(&position_m),
                attitude: UnitQuaternion::from_rotation_matrix(&axes) * solution.attitude,
                last: None,
            }
        }

        /// `near` gives gravity its latitude, longitude and height, to some metres.
        fn advance(&mut self, gained: &Increments, near: &Geodetic, step_s: f64) {
            let (angle, velocity) = (gained.angle_b_rad, gained.velocity_b_mps);
            let last = self.last.replace(*gained);
            let (angle_before, velocity_before) =
                last.map_or_else(Default::default, |l| (l.angle_b_rad, l.velocity_b_mps));
            let rotation = angle + angle_before.cross(&angle) / 12.0;
            let sculling = (angle_before.cross(&velocity) + velocity_before.cross(&angle)) / 12.0;
            let turned = velocity + 0.5 * angle.cross(&velocity) + sculling;

            let mid_s = self.time_s + 0.5 * step_s;
            let earth = LocalEarth::at(near.latitude_rad, near.height_m);
            let mid_position = self.position_m + 0.5 * step_s * self.velocity_mps;
            let up = enu_axes(near, mid_s) * Vector3::z();
            let gravitation = -earth.gravity_mps2 * up + spin().cross(&spin().cross(&mid_position));

            let velocity_before = self.velocity_mps;
            self.velocity_mps += self.attitude * turned + step_s * gravitation;
            self.position_m += 0.5 * step_s * (velocity_before + self.velocity_mps);
            self.attitude *= UnitQuaternion::from_scaled_axis(rotation);
            self.time_s += step_s;
        }
    }

    #[test]
    fn an_inertial_strapdown_reproduces_a_drive() {
        let duration_s = 3600.0;
        let car = Car::new(11, duration_s, Some([30.0, 120.0]));
        let mut sensors = IdealSensors::new(car, ORIGIN, Time::default());
        let mut strapdown = InertialStrapdown::of(&sensors.state().solution);
        for k in 1..=360_000 {
            let before = sensors.state().solution.position;
            let gained = sensors.advance(seconds(f64::from(k) * 0.01));
            let moved = sensors.state().solution.position.enu_from(&before);
            strapdown.advance(&gained, &displaced(&before, &(0.5 * moved)), 0.01);
        }
        let truth = InertialStrapdown::of(&sensors.state().solution);
        let position = (strapdown.position_m - truth.position_m).norm();
        let velocity = (strapdown.velocity_mps - truth.velocity_mps).norm();
        let attitude = strapdown.attitude.angle_to(&truth.attitude);
        // The strapdown's own trapezoid rule and two-sample corrections leave 0.25 m, 0.2 mm/s and
        // 0.001 arc seconds; all fall at least with the square of the interval (0.007 m at
        // 400 Hz), so the increments are better than that.
        assert!(position < 0.5, "{position} m");
        assert!(velocity < 5e-4, "{velocity} m/s");
        assert!(attitude < 1e-8, "{attitude} rad");
    }
}

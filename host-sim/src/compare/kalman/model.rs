//! How the errors grow from one covariance step to the next, and what measurements say of them:
//! differences, and what a unit of each error adds to them.

use ins_core::GnssFix;
use ins_core::attitude::matrix;
use ins_core::earth::{Geodetic, LocalEarth, ROTATION_RATE_RADPS};
use ins_core::increments::Interval;
use ins_core::mechanization::{Mechanization, Step};
use nalgebra::{DVector, Matrix3, Vector3};

use super::index::{ACCEL, ATTITUDE, GYRO, LATENCY, POSITION, VELOCITY};
use super::{Known, Layout, Noise, Part, StateMatrix, times};

/// Climb of a vehicle of whose height and vertical velocity a fix says nothing, m/s: enough to
/// keep gravity what it is.
const CLIMB_MPS: f64 = 5.0;
/// Rate of a vehicle standing with people in it, rad/s in the mean of a second: as in the core.
const SWAY_RADPS: f64 = 3e-4;

/// What the INS did since the last covariance step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Span {
    pub seconds: f64,
    /// Integral of specific force, ENU, m/s.
    force_mps: Vector3<f64>,
    /// Integral of `C_B^L`, s.
    attitude_s: Matrix3<f64>,
    /// Integrals of its columns, each times what that accelerometer and that gyro read.
    force_columns_mps: Matrix3<f64>,
    turn_columns_rad: Matrix3<f64>,
}

impl Span {
    pub fn add(&mut self, interval: &Interval, step: &Step) {
        let read = |reading: &Vector3<f64>| step.attitude * Matrix3::from_diagonal(reading);
        self.seconds += interval.seconds;
        self.force_mps += step.force_enu_mps;
        self.attitude_s += step.attitude * interval.seconds;
        self.force_columns_mps += read(&interval.force_mps);
        self.turn_columns_rad += read(&interval.angle_rad);
    }

    /// Transition of the errors over the span, `I + F t + (F t)^2 / 2`; coloured noise fades
    /// exactly.
    pub fn transition(&self, ins: &Mechanization, layout: &Layout, noise: &Noise) -> StateMatrix {
        let growth = self.growth(&ins.local_earth(), &ins.velocity_enu_mps, layout);
        let identity = StateMatrix::identity(layout.size, layout.size);
        let mut transition = identity + 0.5 * times(&growth, &growth) + growth;
        for (part, state) in layout.coloured() {
            transition[(state, state)] = noise.kept(part, self.seconds);
        }
        transition
    }

    /// `F t`.
    ///
    /// Equations (1), (2) with all that they leave out, but for the curvature of the Earth in the
    /// position itself and the growth of radii with height, both below 1e-6.
    fn growth(
        &self,
        earth: &LocalEarth,
        velocity_mps: &Vector3<f64>,
        layout: &Layout,
    ) -> StateMatrix {
        let t = self.seconds;
        let (sin, cos) = (earth.sin_latitude, earth.safe_cos_latitude());
        let (north, east) = (earth.north_radius_m, earth.east_radius_m);
        let earth_rate = earth.earth_rate();
        let transport_rate = earth.transport_rate(velocity_mps);
        // Errors of the two rates: by latitude, that is north position, and by velocity.
        let earth_rate_by_north =
            Vector3::new(0.0, -ROTATION_RATE_RADPS * sin, ROTATION_RATE_RADPS * cos) / north;
        let transport_by_north =
            Vector3::new(0.0, 0.0, velocity_mps.x / (east * cos * cos) / north);
        #[rustfmt::skip]
        let transport_by_velocity = Matrix3::new(
            0.0, -1.0 / north, 0.0,
            1.0 / east, 0.0, 0.0,
            sin / cos / east, 0.0, 0.0,
        );
        let coriolis = (2.0 * earth_rate + transport_rate).cross_matrix();
        let velocity_cross = velocity_mps.cross_matrix();

        let mut growth = StateMatrix::zeros(layout.size, layout.size);
        let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
            growth.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        };
        set(POSITION, VELOCITY, t * Matrix3::identity());
        set(
            VELOCITY,
            VELOCITY,
            t * (velocity_cross * transport_by_velocity - coriolis),
        );
        set(VELOCITY, ATTITUDE, self.force_mps.cross_matrix());
        set(VELOCITY, ACCEL, self.attitude_s);
        set(ATTITUDE, VELOCITY, t * transport_by_velocity);
        set(
            ATTITUDE,
            ATTITUDE,
            -t * (earth_rate + transport_rate).cross_matrix(),
        );
        set(ATTITUDE, GYRO, -self.attitude_s);
        if let Some(at) = layout.accel_scale {
            set(VELOCITY, at, self.force_columns_mps);
        }
        if let Some(at) = layout.gyro_scale {
            set(ATTITUDE, at, -self.turn_columns_rad);
        }
        let mut by_north = |row: usize, value: Vector3<f64>| {
            growth
                .fixed_view_mut::<3, 1>(row, POSITION + 1)
                .copy_from(&(t * value));
        };
        by_north(
            VELOCITY,
            velocity_mps.cross(&(2.0 * earth_rate_by_north + transport_by_north)),
        );
        by_north(ATTITUDE, earth_rate_by_north + transport_by_north);
        growth[(VELOCITY + 2, POSITION + 2)] += t * 2.0 * earth.gravity_mps2 / north;
        if let Some(at) = layout.clock_drift {
            growth[(LATENCY, at)] = t;
        }
        growth
    }
}

/// Some numbers measured at one time, each with noise of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// A row for each number, a column for each error.
    pub by: StateMatrix,
    /// INS minus measured, or what else is zero but for errors and noise.
    pub difference: DVector<f64>,
    pub variance: DVector<f64>,
    /// Covariance of errors (rows) and noise (columns); none where a noise is its own.
    pub shared: Option<StateMatrix>,
}

impl Seen {
    fn new(rows: usize, layout: &Layout) -> Self {
        Self {
            by: StateMatrix::zeros(rows, layout.size),
            difference: DVector::zeros(rows),
            variance: DVector::zeros(rows),
            shared: None,
        }
    }

    /// Three columns of a row, as of an axis.
    fn set(&mut self, row: usize, first: usize, block: &Matrix3<f64>, axis: usize) {
        let mut by = self.by.fixed_view_mut::<1, 3>(row, first);
        by.copy_from(&block.row(axis));
    }
}

/// The INS at the moment that a fix shows.
#[derive(Clone, Copy, Debug)]
pub struct AtMoment<'a> {
    /// At the end of the interval that the moment lies in.
    pub known: &'a Known,
    /// How long before that end, s.
    pub since_s: f64,
    pub accel_mps2: Vector3<f64>,
    /// Angular rate against the Earth over that interval, body, rad/s.
    pub rate_radps: Vector3<f64>,
}

impl AtMoment<'_> {
    /// Compares a part of a fix; `None` where the fix has none.
    pub fn compare(
        &self,
        part: Part,
        fix: &GnssFix,
        noise: &Noise,
        layout: &Layout,
    ) -> Option<Seen> {
        let measured = match part {
            Part::Velocity => fix.velocity_en_mps.map(|_| fix.velocity_enu_mps())?,
            Part::VelocityUp if fix.height_m.is_none() && fix.velocity_up_mps.is_none() => {
                return Some(self.level_motion(layout));
            }
            Part::VelocityUp => fix.velocity_up_mps.map(|_| fix.velocity_enu_mps())?,
            Part::Position => self.metres_to(&fix.geodetic_or(self.height_m())?),
            Part::Height => self.metres_to(&Geodetic {
                height_m: fix.height_m?,
                ..self.known.ins.position
            }),
        };
        let (antenna, by_attitude, by_arm) = self.antenna(part);
        let (ins, by_latency) = if part.is_velocity() {
            (self.velocity_mps(), self.accel_mps2)
        } else {
            (Vector3::zeros(), self.velocity_mps())
        };
        let difference = ins + antenna - (measured - self.known.colour(part));
        let by_gyro = self.antenna_by_gyro(part);
        let sigma = noise.white_of(part, fix);
        let mut seen = Seen::new(part.axes().len(), layout);
        for (row, axis) in part.axes().enumerate() {
            seen.set(row, ATTITUDE, &by_attitude, axis);
            seen.set(row, GYRO, &by_gyro, axis);
            if let Some(at) = layout.lever_arm {
                seen.set(row, at, &by_arm, axis);
            }
            if let Some(state) = layout.colour(part).nth(row) {
                seen.by[(row, state)] = -1.0;
            }
            seen.by[(row, part.states().start + row)] = 1.0;
            seen.by[(row, LATENCY)] = by_latency[axis];
            seen.difference[row] = difference[axis];
            seen.variance[row] = sigma * sigma;
        }
        Some(seen)
    }

    fn velocity_mps(&self) -> Vector3<f64> {
        self.known.ins.velocity_enu_mps - self.since_s * self.accel_mps2
    }

    fn height_m(&self) -> f64 {
        self.known.ins.position.height_m
    }

    /// From where the INS was at the moment to a place, ENU, m.
    fn metres_to(&self, place: &Geodetic) -> Vector3<f64> {
        let ins: &Mechanization = &self.known.ins;
        let moved = self.since_s * (ins.velocity_enu_mps - 0.5 * self.since_s * self.accel_mps2);
        moved - ins.position.enu_from(place)
    }

    /// What the antenna has beyond the sensors, by attitude, and by the arm: `C l` and `C (w x l)`.
    fn antenna(&self, part: Part) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
        let attitude = matrix(&self.known.ins.attitude);
        let turn = if part.is_velocity() {
            attitude * self.rate_radps.cross_matrix()
        } else {
            attitude
        };
        let antenna = turn * self.known.lever_arm_m;
        // C' u = C u - Phi x C u; the arm is known minus what is left of its error.
        (antenna, antenna.cross_matrix(), -turn)
    }

    /// A gyro that reads too much makes the antenna move more: `C (dw x l)`.
    fn antenna_by_gyro(&self, part: Part) -> Matrix3<f64> {
        if !part.is_velocity() {
            return Matrix3::zeros();
        }
        -matrix(&self.known.ins.attitude) * self.known.lever_arm_m.cross_matrix()
    }

    /// Nothing is known of the height: the vehicle stays about where it is.
    fn level_motion(&self, layout: &Layout) -> Seen {
        let mut seen = Seen::new(1, layout);
        seen.by[(0, VELOCITY + 2)] = 1.0;
        seen.difference[0] = self.known.ins.velocity_enu_mps.z;
        seen.variance[0] = CLIMB_MPS * CLIMB_MPS;
        seen
    }
}

/// What the gyros read in a block of rest, less the turn of the Earth and their known errors.
///
/// Their noise in the block is what turned the platform meanwhile: both have it in common.
pub fn at_rest(
    known: &Known,
    rate_radps: &Vector3<f64>,
    seconds: f64,
    noise: &Noise,
    layout: &Layout,
) -> Seen {
    let attitude = matrix(&known.ins.attitude);
    let earth_rate = known.ins.local_earth().earth_rate();
    let turn = attitude.tr_mul(&earth_rate);
    // C'^T w = C^T w + C^T (Phi x w).
    let by_attitude = attitude.transpose() * earth_rate.cross_matrix();
    let mut seen = Seen::new(3, layout);
    let mut shared = StateMatrix::zeros(layout.size, 3);
    for axis in 0..3 {
        let power = noise.sensors.gyro_noise[axis] * noise.sensors.gyro_noise[axis];
        seen.set(axis, ATTITUDE, &by_attitude, axis);
        seen.by[(axis, GYRO + axis)] = 1.0;
        seen.difference[axis] = rate_radps[axis] - turn[axis] - known.gyro_bias_radps[axis];
        seen.variance[axis] = (power + SWAY_RADPS * SWAY_RADPS) / seconds;
        // The angle that the noise made is minus the error of the platform, in body axes.
        let tilt = -power * attitude.column(axis);
        shared
            .fixed_view_mut::<3, 1>(ATTITUDE, axis)
            .copy_from(&tilt);
    }
    seen.shared = Some(shared);
    seen
}

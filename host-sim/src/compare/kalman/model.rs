//! Transition matrix of the errors between covariance steps, and measurement models: differences and their
//! Jacobians.

use ins_core::GnssFix;
use ins_core::attitude::matrix;
use ins_core::earth::{Geodetic, LocalEarth, ROTATION_RATE_RADPS};
use ins_core::increments::Interval;
use ins_core::mechanization::{Mechanization, Step};
use nalgebra::{DVector, Matrix3, Vector3};

use super::index::{ACCEL, ATTITUDE, GYRO, LATENCY, POSITION, VELOCITY};
use super::{Kind, Layout, Noise, Nominal, StateMatrix, times};

/// Sigma of the vertical velocity of a vehicle whose fixes have neither height nor climb, m/s: enough to
/// keep the vertical channel from diverging.
const CLIMB_MPS: f64 = 5.0;
/// Angular rate of a vehicle at rest with people in it, rad/s in the mean of a second: as in the core.
const SWAY_RADPS: f64 = 3e-4;

/// Integrals over the INS motion since the last covariance step, for the transition matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepIntegrals {
    pub seconds: f64,
    /// Integral of specific force, ENU, m/s.
    force_mps: Vector3<f64>,
    /// Integral of `C_B^L`, s.
    attitude_s: Matrix3<f64>,
    /// Integrals of its columns, each times the reading of its accelerometer or gyro: scale errors.
    force_columns_mps: Matrix3<f64>,
    angle_columns_rad: Matrix3<f64>,
}

impl StepIntegrals {
    pub fn add(&mut self, interval: &Interval, step: &Step) {
        let read = |reading: &Vector3<f64>| step.attitude * Matrix3::from_diagonal(reading);
        self.seconds += interval.seconds;
        self.force_mps += step.force_enu_mps;
        self.attitude_s += step.attitude * interval.seconds;
        self.force_columns_mps += read(&interval.force_mps);
        self.angle_columns_rad += read(&interval.angle_rad);
    }

    /// Transition matrix, `I + F t + (F t)^2 / 2`; that of coloured noise is exact.
    pub fn transition(&self, ins: &Mechanization, layout: &Layout, noise: &Noise) -> StateMatrix {
        let system = self.system(&ins.local_earth(), &ins.velocity_enu_mps, layout);
        let identity = StateMatrix::identity(layout.size, layout.size);
        let mut transition = identity + 0.5 * times(&system, &system) + system;
        for (kind, state) in layout.coloured_states() {
            transition[(state, state)] = noise.correlation(kind, self.seconds);
        }
        transition
    }

    /// System matrix times step, `F t`.
    ///
    /// Equations (1), (2) with the terms that they neglect, except the curvature of the Earth in the
    /// position itself and the change of the radii with height, both below 1e-6.
    fn system(
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
        // Partials of the two rates by latitude, that is north position, and by velocity.
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

        let mut system = StateMatrix::zeros(layout.size, layout.size);
        let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
            system.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
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
            set(ATTITUDE, at, -self.angle_columns_rad);
        }
        let mut by_north = |row: usize, value: Vector3<f64>| {
            system
                .fixed_view_mut::<3, 1>(row, POSITION + 1)
                .copy_from(&(t * value));
        };
        by_north(
            VELOCITY,
            velocity_mps.cross(&(2.0 * earth_rate_by_north + transport_by_north)),
        );
        by_north(ATTITUDE, earth_rate_by_north + transport_by_north);
        system[(VELOCITY + 2, POSITION + 2)] += t * 2.0 * earth.gravity_mps2 / north;
        if let Some(at) = layout.clock_drift {
            system[(LATENCY, at)] = t;
        }
        system
    }
}

/// A vector measurement with mutually independent noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// `H`: a row for each component, a column for each error.
    pub jacobian: StateMatrix,
    /// INS minus measured, or another quantity that is zero except for errors and noise.
    pub difference: DVector<f64>,
    pub variance: DVector<f64>,
    /// Covariance of errors (rows) and measurement noise (columns); none where they are independent.
    pub noise_correlation: Option<StateMatrix>,
}

impl Measurement {
    fn new(rows: usize, layout: &Layout) -> Self {
        Self {
            jacobian: StateMatrix::zeros(rows, layout.size),
            difference: DVector::zeros(rows),
            variance: DVector::zeros(rows),
            noise_correlation: None,
        }
    }

    /// Sets three columns of a Jacobian row to a row of a block.
    fn set(&mut self, row: usize, first: usize, block: &Matrix3<f64>, axis: usize) {
        let mut jacobian = self.jacobian.fixed_view_mut::<1, 3>(row, first);
        jacobian.copy_from(&block.row(axis));
    }
}

/// The INS at the time of a fix, less latency.
#[derive(Clone, Copy, Debug)]
pub struct PastState<'a> {
    /// At the end of the interval that contains that time.
    pub nominal: &'a Nominal,
    /// By how much it precedes that end, s.
    pub age_s: f64,
    pub accel_mps2: Vector3<f64>,
    /// Angular rate against the Earth over that interval, body, rad/s.
    pub rate_radps: Vector3<f64>,
}

impl PastState<'_> {
    /// Measurement of one kind in a fix; `None` where the fix does not have it.
    pub fn measurement(
        &self,
        kind: Kind,
        fix: &GnssFix,
        noise: &Noise,
        layout: &Layout,
    ) -> Option<Measurement> {
        let measured = match kind {
            Kind::Velocity => fix.velocity_en_mps.map(|_| fix.velocity_enu_mps())?,
            Kind::VelocityUp if fix.height_m.is_none() && fix.velocity_up_mps.is_none() => {
                return Some(self.zero_climb(layout));
            }
            Kind::VelocityUp => fix.velocity_up_mps.map(|_| fix.velocity_enu_mps())?,
            Kind::Position => self.enu_from(&fix.geodetic_or(self.height_m())?),
            Kind::Height => self.enu_from(&Geodetic {
                height_m: fix.height_m?,
                ..self.nominal.ins.position
            }),
        };
        let (lever_arm, by_attitude, by_arm) = self.lever_arm(kind);
        let (ins, by_latency) = if kind.is_velocity() {
            (self.velocity_mps(), self.accel_mps2)
        } else {
            (Vector3::zeros(), self.velocity_mps())
        };
        let difference = ins + lever_arm - (measured - self.nominal.coloured(kind));
        let by_gyro = self.lever_arm_by_gyro(kind);
        let sigma = noise.white_sigma(kind, fix);
        let mut measurement = Measurement::new(kind.axes().len(), layout);
        for (row, axis) in kind.axes().enumerate() {
            measurement.set(row, ATTITUDE, &by_attitude, axis);
            measurement.set(row, GYRO, &by_gyro, axis);
            if let Some(at) = layout.lever_arm {
                measurement.set(row, at, &by_arm, axis);
            }
            if let Some(state) = layout.coloured(kind).nth(row) {
                measurement.jacobian[(row, state)] = -1.0;
            }
            measurement.jacobian[(row, kind.states().start + row)] = 1.0;
            measurement.jacobian[(row, LATENCY)] = by_latency[axis];
            measurement.difference[row] = difference[axis];
            measurement.variance[row] = sigma * sigma;
        }
        Some(measurement)
    }

    fn velocity_mps(&self) -> Vector3<f64> {
        self.nominal.ins.velocity_enu_mps - self.age_s * self.accel_mps2
    }

    fn height_m(&self) -> f64 {
        self.nominal.ins.position.height_m
    }

    /// INS at that time minus a measured position, ENU, m.
    fn enu_from(&self, position: &Geodetic) -> Vector3<f64> {
        let ins: &Mechanization = &self.nominal.ins;
        let moved = self.age_s * (ins.velocity_enu_mps - 0.5 * self.age_s * self.accel_mps2);
        moved - ins.position.enu_from(position)
    }

    /// Effect of the lever arm, `C l` or `C (w x l)`, and its partials by attitude and by the arm.
    fn lever_arm(&self, kind: Kind) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
        let attitude = matrix(&self.nominal.ins.attitude);
        let turn = if kind.is_velocity() {
            attitude * self.rate_radps.cross_matrix()
        } else {
            attitude
        };
        let lever_arm = turn * self.nominal.lever_arm_m;
        // C' u = C u - Phi x C u; the state is the true arm minus the estimate.
        (lever_arm, lever_arm.cross_matrix(), -turn)
    }

    /// Partials of the antenna velocity by the gyro errors: `C (dw x l)`.
    fn lever_arm_by_gyro(&self, kind: Kind) -> Matrix3<f64> {
        if !kind.is_velocity() {
            return Matrix3::zeros();
        }
        -matrix(&self.nominal.ins.attitude) * self.nominal.lever_arm_m.cross_matrix()
    }

    /// Pseudo-measurement of zero vertical velocity, where no fix has height or climb.
    fn zero_climb(&self, layout: &Layout) -> Measurement {
        let mut measurement = Measurement::new(1, layout);
        measurement.jacobian[(0, VELOCITY + 2)] = 1.0;
        measurement.difference[0] = self.nominal.ins.velocity_enu_mps.z;
        measurement.variance[0] = CLIMB_MPS * CLIMB_MPS;
        measurement
    }
}

/// Zero-rate update: mean gyro rates of a block at rest, less earth rate and estimated biases.
///
/// Gyro noise in the block also drove the attitude: measurement noise and attitude error are correlated.
pub fn zero_rate(
    nominal: &Nominal,
    rate_radps: &Vector3<f64>,
    seconds: f64,
    noise: &Noise,
    layout: &Layout,
) -> Measurement {
    let attitude = matrix(&nominal.ins.attitude);
    let earth_rate = nominal.ins.local_earth().earth_rate();
    let turn = attitude.tr_mul(&earth_rate);
    // C'^T w = C^T w + C^T (Phi x w).
    let by_attitude = attitude.transpose() * earth_rate.cross_matrix();
    let mut measurement = Measurement::new(3, layout);
    let mut shared = StateMatrix::zeros(layout.size, 3);
    for axis in 0..3 {
        let power = noise.sensors.gyro_noise[axis] * noise.sensors.gyro_noise[axis];
        measurement.set(axis, ATTITUDE, &by_attitude, axis);
        measurement.jacobian[(axis, GYRO + axis)] = 1.0;
        measurement.difference[axis] =
            rate_radps[axis] - turn[axis] - nominal.gyro_bias_radps[axis];
        measurement.variance[axis] = (power + SWAY_RADPS * SWAY_RADPS) / seconds;
        // The angle of the gyro noise is minus the attitude error, in body axes.
        let tilt = -power * attitude.column(axis);
        shared
            .fixed_view_mut::<3, 1>(ATTITUDE, axis)
            .copy_from(&tilt);
    }
    measurement.noise_correlation = Some(shared);
    measurement
}

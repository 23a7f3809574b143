//! Error model of the INS, (1) and (2), driven by the sensor errors.

use nalgebra::{RealField, Scalar, Vector3, convert};

use crate::earth::{GRAVITY_EQUATOR_MPS2, SEMI_MAJOR_AXIS_M};
use crate::history::Span;
use crate::math::{self, singles};
use crate::parameters::{Parameters, index};

/// Gradient of the gravity that the INS computes at its own position: by a height error, `2 g / R`, and by a
/// level one, `-g / R` (Schuler), 1/s^2.
pub const VERTICAL_PER_S2: f64 = 2.0 * GRAVITY_EQUATOR_MPS2 / SEMI_MAJOR_AXIS_M;
pub const SCHULER_PER_S2: f64 = -GRAVITY_EQUATOR_MPS2 / SEMI_MAJOR_AXIS_M;

/// Error of the INS, ENU: INS minus truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InsError<T: Scalar = f64> {
    /// Position, m; its third component is dh.
    pub position_m: Vector3<T>,
    /// dV, m/s.
    pub velocity_mps: Vector3<T>,
    /// Phi, rad. The level components are the platform's tilt in its own azimuth, the third its azimuth
    /// error: first levelled, then turned. The effect of an accelerometer bias and the tilt that it has
    /// caused turn alike when the platform is turned about the vertical: the azimuth says nothing of
    /// either.
    pub tilt_rad: Vector3<T>,
}

/// Transition of every error over a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<T: Scalar = f64> {
    /// Duration, s.
    seconds: T,
    /// Coupling of the tilts into velocity, m/s, and position, m.
    to_velocity: TiltCoupling<T>,
    to_position: TiltCoupling<T>,
    /// Cosine and sine of the azimuth error, and of the platform's turn about the vertical relative to the
    /// frame.
    azimuth: [T; 2],
    turn: [T; 2],
    /// Rotation of the frame against inertial space.
    frame_rad: Vector3<T>,
    /// Half of the platform's level rotation: rotations do not commute, which gives a turn about the
    /// vertical.
    half_level_rad: Vector3<T>,
}

/// Coupling of the tilts into velocity or position over a span: of the level ones by the platform's force,
/// turned by its azimuth error.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TiltCoupling<T> {
    /// Force up, times cosine and sine of the azimuth.
    up: [T; 2],
    /// Level force.
    level: [T; 2],
    /// Of the azimuth.
    by_azimuth: [T; 2],
}

impl TiltCoupling<f64> {
    /// Of a force that contains the effects of this tilt and bias.
    fn new(
        force: &Vector3<f64>,
        tilt_rad: &Vector3<f64>,
        push: &Vector3<f64>,
        azimuth: [f64; 2],
    ) -> Self {
        let apparent = force.cross(&level_of(tilt_rad)) + push;
        let by_azimuth = about_up(&(apparent - force), azimuth);
        Self {
            up: azimuth.map(|part| part * force.z),
            level: [force.x, force.y],
            by_azimuth: [-by_azimuth.y, by_azimuth.x],
        }
    }

    fn single(&self) -> TiltCoupling<f32> {
        TiltCoupling {
            up: self.up.map(math::single),
            level: self.level.map(math::single),
            by_azimuth: self.by_azimuth.map(math::single),
        }
    }
}

impl<T: RealField + Copy> TiltCoupling<T> {
    fn apply(&self, tilt: &Vector3<T>) -> Vector3<T> {
        let ([cos, sin], [east, north]) = (self.up, self.level);
        Vector3::new(
            self.by_azimuth[0] * tilt.z - cos * tilt.y - sin * tilt.x,
            self.by_azimuth[1] * tilt.z + cos * tilt.x - sin * tilt.y,
            east * tilt.y - north * tilt.x,
        )
    }
}

/// Rotation about the vertical, by cosine and sine.
fn about_up<T: RealField + Copy>(v: &Vector3<T>, [cos, sin]: [T; 2]) -> Vector3<T> {
    Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)
}

/// Input of the parameters over a span, and what was compensated of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forcing {
    /// Rotation of the platform, rad.
    drift_rad: Vector3<f64>,
    /// Velocity, m/s.
    push_mps: Vector3<f64>,
    /// Compensated part of the velocity, which the span has among its controls, m/s.
    compensated_mps: Vector3<f64>,
}

impl Forcing {
    /// Of `parameters`, where `accel_mps2` is compensated.
    pub fn over(
        span: &Span,
        level_force_mps2: &Vector3<f64>,
        parameters: &Parameters,
        accel_mps2: &Vector3<f64>,
    ) -> Self {
        let mut forcing = Self {
            drift_rad: Vector3::zeros(),
            push_mps: Vector3::zeros(),
            compensated_mps: span.attitude_s * accel_mps2,
        };
        for_each_input(span, level_force_mps2, |which, input| match input {
            Input::Tilt(by) => forcing.drift_rad += by * parameters.value(which),
            Input::Velocity(by) => forcing.push_mps += by * parameters.value(which),
        });
        forcing
    }
}

impl Transition {
    /// Over a span in a frame that turns at `frame_rate_radps`, about this error.
    pub fn over(
        span: &Span,
        frame_rate_radps: &Vector3<f64>,
        forcing: &Forcing,
        tilt_rad: &Vector3<f64>,
    ) -> Self {
        let platform_rad = span.control_tilt_rad + forcing.drift_rad;
        let azimuth = rotation(tilt_rad.z);
        let push_mps = forcing.push_mps - forcing.compensated_mps;
        let push_m = push_mps * (0.5 * span.seconds);
        Self {
            seconds: span.seconds,
            to_velocity: TiltCoupling::new(&span.force_mps, tilt_rad, &push_mps, azimuth),
            to_position: TiltCoupling::new(&span.force_position_m, tilt_rad, &push_m, azimuth),
            azimuth,
            turn: rotation(-platform_rad.z),
            frame_rad: frame_rate_radps * span.seconds,
            half_level_rad: 0.5 * level_of(&platform_rad),
        }
    }

    pub fn single(&self) -> Transition<f32> {
        Transition {
            seconds: math::single(self.seconds),
            to_velocity: self.to_velocity.single(),
            to_position: self.to_position.single(),
            azimuth: self.azimuth.map(math::single),
            turn: self.turn.map(math::single),
            frame_rad: singles(&self.frame_rad),
            half_level_rad: singles(&self.half_level_rad),
        }
    }
}

/// Cosine and sine of an angle to second order, normalized.
fn rotation(angle_rad: f64) -> [f64; 2] {
    let half = 0.5 * angle_rad;
    let scale = 1.0 / (1.0 + half * half);
    [(1.0 - half * half) * scale, angle_rad * scale]
}

/// Level components.
fn level_of<T: RealField + Copy>(v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(v.x, v.y, T::zero())
}

/// Input to (1)-(2) by a unit of a parameter over a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input<T: Scalar = f64> {
    /// `-C dw`, rad.
    Tilt(Vector3<T>),
    /// `C df`, m/s.
    Velocity(Vector3<T>),
}

impl Input {
    pub fn single(&self) -> Input<f32> {
        match self {
            Self::Tilt(tilt) => Input::Tilt(singles(tilt)),
            Self::Velocity(velocity) => Input::Velocity(singles(velocity)),
        }
    }
}

impl<T: RealField + Copy> InsError<T> {
    /// One of its nine components.
    pub fn component(&mut self, which: usize) -> Option<&mut T> {
        let vector = match which / 3 {
            0 => &mut self.position_m,
            1 => &mut self.velocity_mps,
            _ => &mut self.tilt_rad,
        };
        vector.get_mut(which % 3)
    }

    /// `dp' = dV`, `dV' = f x Phi + dg`, `Phi' = -w_in x Phi`: (1)-(2) in the frame at the INS's position,
    /// to whose vertical the tilt refers and where `dg` comes from. The two verticals differ by 0.16 mrad
    /// per kilometre.
    pub fn propagate(&mut self, transition: &Transition<T>) {
        let (tilt, half) = (self.tilt_rad, &transition.half_level_rad);
        self.position_m +=
            self.velocity_mps * transition.seconds + transition.to_position.apply(&tilt);
        let seconds = transition.seconds;
        let [level, up] = [SCHULER_PER_S2, VERTICAL_PER_S2].map(|per_s2| seconds * convert(per_s2));
        let gravity = Vector3::new(level, level, up);
        self.velocity_mps +=
            transition.to_velocity.apply(&tilt) + gravity.component_mul(&self.position_m);
        self.tilt_rad = about_up(&tilt, transition.turn) + tilt.cross(&transition.frame_rad);
        self.tilt_rad.z += tilt.x * half.y - tilt.y * half.x;
    }

    /// Constant input over a span, after [`Self::propagate`].
    pub fn add_input(&mut self, transition: &Transition<T>, input: &Input<T>) {
        let half = convert::<f64, T>(0.5);
        match input {
            Input::Tilt(tilt) => {
                let third = convert::<f64, T>(1.0 / 3.0);
                self.position_m += transition.to_position.apply(tilt) * third;
                self.velocity_mps += transition.to_velocity.apply(tilt) * half;
                self.tilt_rad += tilt;
            }
            Input::Velocity(velocity) => {
                let velocity = about_up(velocity, transition.azimuth);
                self.position_m += velocity * (half * transition.seconds);
                self.velocity_mps += velocity;
            }
        }
    }

    /// Adds `factor` times another error.
    pub fn add_scaled(&mut self, other: &Self, factor: T) {
        self.position_m += other.position_m * factor;
        self.velocity_mps += other.velocity_mps * factor;
        self.tilt_rad += other.tilt_rad * factor;
    }
}

impl InsError {
    /// The error at the end of a span.
    #[must_use]
    pub fn propagated(&self, span: &Span, transition: &Transition, forcing: &Forcing) -> Self {
        let mut error = *self;
        error.propagate(transition);
        // Second order of the tilt, positive as the force is that of the tilted frame; and the full
        // azimuth.
        let level = level_of(&self.tilt_rad);
        let azimuth = self.tilt_rad - level;
        let longer = 0.5 * level.cross(&span.force_mps.cross(&level));
        let turned = |force: &Vector3<f64>| force - about_up(force, transition.azimuth);
        let compensated_mps = turned(&forcing.compensated_mps);
        error.velocity_mps +=
            about_up(&longer, transition.azimuth) + turned(&span.force_mps) + compensated_mps
                - transition.to_velocity.apply(&azimuth);
        error.position_m += turned(&span.force_position_m)
            + compensated_mps * (0.5 * transition.seconds)
            - transition.to_position.apply(&azimuth);
        // A control tilt turns with the platform for half of the span on average.
        let platform_rad = span.control_tilt_rad + forcing.drift_rad;
        let half_turn = Vector3::new(0.0, 0.0, 0.5 * platform_rad.z);
        error.add_input(transition, &Input::Tilt(forcing.drift_rad));
        error.add_input(transition, &Input::Velocity(forcing.push_mps));
        error.position_m += span.control_position_m;
        error.velocity_mps += span.control_velocity_mps;
        error.tilt_rad += span.control_tilt_rad + platform_rad.cross(&half_turn);
        error
    }
}

/// Calls `visit` with the input by a unit of each parameter; the others have none.
///
/// Bias and scale error of an accelerometer are one number under a constant force. The bias is that number
/// at the level attitude of the mount, with `level_force_mps2`; the scale error acts on the excess force.
/// Likewise gyros: in level turns their scale errors are one error about the vertical and a tilt that
/// cannot be told from accelerometer biases; the individual ones act on other rotations. So do
/// misalignments, of which only the part about the vertical accumulates, over banked turns to either side;
/// the rest averages out over headings, and is process noise.
pub fn for_each_input(
    span: &Span,
    level_force_mps2: &Vector3<f64>,
    mut visit: impl FnMut(usize, Input),
) {
    // A span of no length has no inputs.
    let seconds = math::max(span.seconds, 1e-9);
    let mount_up = level_force_mps2 / GRAVITY_EQUATOR_MPS2;
    let level_turn_rad = span.angle_rad - mount_up * span.turn_rad;
    for (axis, (level, level_turn_rad)) in level_force_mps2.iter().zip(&level_turn_rad).enumerate()
    {
        let column = span.attitude_s.column(axis).into_owned();
        visit(index::GYRO + axis, Input::Tilt(-column));
        visit(index::ACCEL + axis, Input::Velocity(column));
        // C f_k, with f_k the specific force on the axis.
        let felt = column.dot(&span.force_mps) / (seconds * seconds) - level;
        visit(index::ACCEL_SCALE + axis, Input::Velocity(felt * column));
        visit(
            index::GYRO_SCALE + axis,
            Input::Tilt(-level_turn_rad / seconds * column),
        );
    }
    let turned = span.attitude_s * (mount_up * (span.turn_rad / seconds));
    visit(index::TURN_SCALE, Input::Tilt(-turned));
    for (axis, level_turn_rad) in level_turn_rad.iter().enumerate() {
        visit(
            index::GYRO_MISALIGNMENT + axis,
            Input::Tilt(Vector3::new(0.0, 0.0, -level_turn_rad)),
        );
    }
}

/// White noise of these variances per body axis: variance of a level axis on average, and of the vertical,
/// which is `up` in body axes.
pub fn level_and_up(up: &Vector3<f64>, variance: &Vector3<f64>) -> (f64, f64) {
    let up_variance = up.component_mul(up).dot(variance);
    (0.5 * (variance.sum() - up_variance), up_variance)
}

#[cfg(test)]
#[path = "../tests/unit/ins_error.rs"]
mod tests;

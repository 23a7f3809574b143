//! Level gyro biases over time: (9), interval by interval.

use ins_core::attitude::matrix;
use ins_core::{Navigator, Time};
use nalgebra::{Matrix2, Vector2, Vector3};

/// Shortest interval, s. In longer ones vehicles turn, and a bias in body axes then follows the
/// platform at its ends only: at 30 s a free INS keeps ten times the velocity error.
const INTERVAL_S: f64 = 10.0;
/// An interval lasts until this much of the attitude's mean is left: after a whole circle a bias
/// has done nothing that could be seen.
const LEAST_MEAN: f64 = 0.5;

/// Piecewise constant biases in body axes that turn a platform as `w^C` did, over every interval:
/// `INT C dw = INT w^C`. Means of (9) itself would not, where the vehicle has turned meanwhile. The
/// walk of the angle is part of them, as far as GNSS shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroHistory {
    /// Taken out of the readings before.
    constant_radps: Vector3<f64>,
    /// End of each interval, and what is left of right and forward gyro, rad/s.
    biases: Vec<(Time, Vector2<f64>)>,
    /// The interval going on.
    seconds: f64,
    attitude_s: Matrix2<f64>,
    turned_rad: Vector2<f64>,
    /// Last sample; attitude and control from then on.
    last: Option<(Time, Matrix2<f64>, Vector2<f64>)>,
}

impl GyroHistory {
    pub(super) fn new(constant_radps: Vector3<f64>) -> Self {
        Self {
            constant_radps,
            biases: Vec::new(),
            seconds: 0.0,
            attitude_s: Matrix2::zeros(),
            turned_rad: Vector2::zeros(),
            last: None,
        }
    }

    /// After an inertial sample; the control is that of the next.
    pub(super) fn on_sample(&mut self, navigator: &Navigator, time: Time) {
        let Some(ins) = navigator.mechanization() else {
            return;
        };
        if let Some((since, attitude, control)) = self.last {
            let seconds = time.seconds_since(since);
            self.seconds += seconds;
            self.attitude_s += seconds * attitude;
            self.turned_rad += seconds * control;
        }
        let attitude = matrix(&ins.attitude).fixed_view::<2, 2>(0, 0).into_owned();
        let control = navigator.damping_signals().rate_enu_radps.xy();
        self.last = Some((time, attitude, control));
        let mean = self.attitude_s / self.seconds.max(1e-9);
        if self.seconds >= INTERVAL_S && mean.determinant() > LEAST_MEAN * LEAST_MEAN {
            if let Some(inverse) = self.attitude_s.try_inverse() {
                self.biases.push((time, inverse * self.turned_rad));
            }
            self.seconds = 0.0;
            self.attitude_s = Matrix2::zeros();
            self.turned_rad = Vector2::zeros();
        }
    }

    /// Biases at a time; constant after the last interval.
    pub fn at(&self, time: Time) -> Vector3<f64> {
        let which = self.biases.partition_point(|(end, _)| *end < time);
        let level = self
            .biases
            .get(which)
            .map_or(Vector2::zeros(), |bias| bias.1);
        self.constant_radps + Vector3::new(level.x, level.y, 0.0)
    }
}

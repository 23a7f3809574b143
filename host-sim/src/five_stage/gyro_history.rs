//! Level gyro biases over time: (9), interval by interval.

use ins_core::attitude::matrix;
use ins_core::estimators::literal::level_gyros;
use ins_core::{GnssFix, Navigator, Time};
use nalgebra::{Vector2, Vector3};

/// Length of an interval, s: short against the time in which gyros and headings change, long
/// against the settling of the loop.
const INTERVAL_S: f64 = 10.0;

/// Means of `w^C` in body axes. Walk of the angle is part of them, as far as GNSS shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroHistory {
    /// Taken out of the readings before.
    constant_radps: Vector3<f64>,
    /// End of each interval, and what is left of right and forward gyro, rad/s.
    means: Vec<(Time, Vector2<f64>)>,
    begin: Option<Time>,
    /// Moment of the last fix, and the control from then on in body axes.
    acting: Option<(Time, Vector2<f64>)>,
    turned_rad: Vector2<f64>,
}

impl GyroHistory {
    pub(super) fn new(constant_radps: Vector3<f64>) -> Self {
        Self {
            constant_radps,
            means: Vec::new(),
            begin: None,
            acting: None,
            turned_rad: Vector2::zeros(),
        }
    }

    /// After a fix, with its control acting.
    pub(super) fn on_fix(&mut self, navigator: &Navigator, fix: &GnssFix) {
        let Some(ins) = navigator.mechanization() else {
            return;
        };
        let now = fix.time;
        if let Some((since, control)) = self.acting {
            self.turned_rad += now.seconds_since(since) * control;
        }
        let control = navigator.damping_signals().rate_enu_radps;
        self.acting = Some((now, level_gyros(&matrix(&ins.attitude), &control)));
        let begin = *self.begin.get_or_insert(now);
        let seconds = now.seconds_since(begin);
        if seconds >= INTERVAL_S {
            self.means.push((now, self.turned_rad / seconds));
            self.begin = Some(now);
            self.turned_rad = Vector2::zeros();
        }
    }

    /// Biases at a time: constant before the first and after the last interval.
    pub fn at(&self, time: Time) -> Vector3<f64> {
        let which = self.means.partition_point(|(end, _)| *end < time);
        let level = self.means.get(which).map_or(Vector2::zeros(), |mean| mean.1);
        self.constant_radps + Vector3::new(level.x, level.y, 0.0)
    }
}

//! Estimates in engineering units and in the log's own axes.

use ins_core::{Estimate, Estimates, Observability};
use serde::{Serialize, Serializer};

use crate::log::{BodyAxes, Meta};

/// One mg, m/s^2.
pub const MG_MPS2: f64 = 9.806_65e-3;
/// One deg/h, rad/s.
pub const DEG_H_RADPS: f64 = std::f64::consts::PI / 180.0 / 3600.0;

/// An estimate in some unit; without a value in JSON unless observable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Best value.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
    /// Whether the value stands on data.
    pub observability: Observability,
}

/// A quantity per axis of the log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Axes<T> {
    /// First column.
    pub x: T,
    /// Second column.
    pub y: T,
    /// Third column.
    pub z: T,
}

/// Everything that is identified.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantities {
    /// Heading minus true heading of an INS that keeps the heading it started with, deg.
    pub azimuth_error_deg: Quantity,
    /// To be subtracted from readings, mg.
    pub accel_bias_mg: Axes<Quantity>,
    /// To be subtracted from readings, deg/h.
    pub gyro_bias_deg_h: Axes<Quantity>,
    /// A fix stamped t shows the motion at t minus this, ms.
    pub gnss_latency_ms: Quantity,
}

impl Quantity {
    /// An SI estimate in a unit of `unit` SI units.
    pub(crate) fn of(estimate: &Estimate, unit: f64) -> Self {
        Self {
            value: estimate.value / unit,
            sigma: estimate.sigma / unit.abs(),
            observability: estimate.observability,
        }
    }

    /// Whether the value stands on data.
    pub fn observable(&self) -> bool {
        self.observability == Observability::Observable
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Written {
            value: Option<f64>,
            sigma: f64,
            observable: bool,
            why: &'static str,
        }
        Written {
            value: self.observable().then_some(self.value),
            sigma: self.sigma,
            observable: self.observable(),
            why: self.observability.why(),
        }
        .serialize(serializer)
    }
}

impl<T> Axes<T> {
    /// From a function of the axis: 0, 1, 2.
    pub fn from_fn(f: impl Fn(usize) -> T) -> Self {
        Self {
            x: f(0),
            y: f(1),
            z: f(2),
        }
    }

    /// Axis names and what belongs to them.
    pub fn named(&self) -> [(&'static str, &T); 3] {
        [("x", &self.x), ("y", &self.y), ("z", &self.z)]
    }
}

impl Quantities {
    /// The core's estimates for a log in the given axes.
    pub fn new(estimates: &Estimates, axes: BodyAxes) -> Self {
        Self {
            azimuth_error_deg: Quantity::of(&estimates.azimuth_error_rad, 1_f64.to_radians()),
            accel_bias_mg: in_axes(axes, &estimates.accel_bias_mps2, MG_MPS2),
            gyro_bias_deg_h: in_axes(axes, &estimates.gyro_bias_radps, DEG_H_RADPS),
            gnss_latency_ms: Quantity::of(&estimates.gnss_latency_s, 1e-3),
        }
    }

    /// In a log's axes, and by its stamps as they came.
    pub fn of_log(estimates: &Estimates, meta: &Meta) -> Self {
        let mut quantities = Self::new(estimates, meta.body_axes);
        quantities.gnss_latency_ms.value += 1e3 * meta.gnss_clock_offset_s;
        quantities
    }

    /// Column names and quantities, in the order of the files.
    pub fn columns(&self) -> [(&'static str, Quantity); 8] {
        let (a, g) = (&self.accel_bias_mg, &self.gyro_bias_deg_h);
        [
            ("azimuth_error_deg", self.azimuth_error_deg),
            ("accel_bias_x_mg", a.x),
            ("accel_bias_y_mg", a.y),
            ("accel_bias_z_mg", a.z),
            ("gyro_bias_x_deg_h", g.x),
            ("gyro_bias_y_deg_h", g.y),
            ("gyro_bias_z_deg_h", g.z),
            ("gnss_latency_ms", self.gnss_latency_ms),
        ]
    }
}

/// A right-forward-up vector in the given axes, in a unit of `unit` SI units.
pub(crate) fn in_axes(axes: BodyAxes, rfu: &[Estimate; 3], unit: f64) -> Axes<Quantity> {
    Axes::from_fn(|axis| {
        let (component, sign) = axes.rfu_component(axis);
        Quantity::of(&rfu[component], sign * unit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_order_follow_the_axes_of_the_log() {
        let bias = |value| Estimate {
            value,
            sigma: 0.5,
            observability: Observability::Observable,
        };
        let estimates = Estimates {
            accel_bias_mps2: [bias(MG_MPS2), bias(2.0 * MG_MPS2), bias(3.0 * MG_MPS2)],
            ..Estimates::default()
        };
        let values = |axes| {
            let a = Quantities::new(&estimates, axes).accel_bias_mg;
            assert!(a.named().iter().all(|(_, quantity)| quantity.sigma > 0.0));
            a.named().map(|(_, quantity)| quantity.value)
        };
        let near = |axes, expected: [f64; 3]| {
            values(axes)
                .iter()
                .zip(&expected)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(near(BodyAxes::Rfu, [1.0, 2.0, 3.0]));
        assert!(near(BodyAxes::Frd, [2.0, 1.0, -3.0]));
        assert!(near(BodyAxes::Flu, [2.0, -1.0, 3.0]));
    }

    #[test]
    fn what_is_not_observable_has_no_number() {
        let quantity = Quantity {
            value: 1.0,
            sigma: 2.0,
            observability: Observability::NeedsTurn,
        };
        let json = serde_json::to_value(quantity).unwrap();
        assert!(json["value"].is_null() && json["observable"] == false);
        assert_eq!(json["why"], "needs a turn");
    }
}

//! Estimates in engineering units and in the log's own axes.

use ins_core::{Estimate, Estimates, Observability};
use serde::{Serialize, Serializer};

use crate::log::{BodyAxes, Meta};

pub const MG_MPS2: f64 = 9.806_65e-3;
pub const DEG_H_RADPS: f64 = std::f64::consts::PI / 180.0 / 3600.0;

/// An estimate in some unit; without a value in JSON unless observable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    pub value: f64,
    pub sigma: f64,
    /// Whether the value is observable, or why not.
    pub observability: Observability,
}

/// A quantity per axis of the log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Axes {
    pub x: Quantity,
    pub y: Quantity,
    pub z: Quantity,
}

/// Column in the files, displayed name and unit of all that is identified.
pub(crate) const QUANTITIES: [(&str, &str, &str); 8] = [
    ("azimuth_error_deg", "Azimuth error", "deg"),
    ("accel_bias_x_mg", "Accelerometer bias x", "mg"),
    ("accel_bias_y_mg", "Accelerometer bias y", "mg"),
    ("accel_bias_z_mg", "Accelerometer bias z", "mg"),
    ("gyro_bias_x_deg_h", "Gyro bias x", "deg/h"),
    ("gyro_bias_y_deg_h", "Gyro bias y", "deg/h"),
    ("gyro_bias_z_deg_h", "Gyro bias z", "deg/h"),
    ("gnss_latency_ms", "GNSS latency", "ms"),
];

/// Name of one of them, a bias with the direction of its axis.
pub(crate) fn title(index: usize, axes: BodyAxes) -> String {
    let (_, name, _) = QUANTITIES[index];
    match index {
        1..=6 => format!("{name}, {}", axes.direction((index - 1) % 3)),
        _ => name.to_owned(),
    }
}

/// Name of an axis, and where it points.
pub(crate) fn axis_name(axis: usize, axes: BodyAxes) -> String {
    format!("{}, {}", ["x", "y", "z"][axis], axes.direction(axis))
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantities {
    /// Heading minus true heading of an INS that keeps the heading it started with, deg.
    pub azimuth_error_deg: Quantity,
    /// To be subtracted from readings, mg.
    pub accel_bias_mg: Axes,
    /// To be subtracted from readings, deg/h.
    pub gyro_bias_deg_h: Axes,
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

impl Axes {
    pub(crate) fn each(&self) -> [Quantity; 3] {
        [self.x, self.y, self.z]
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

    /// In a log's axes; the latency with the shift of the stamps before, unless that is of the clocks.
    pub fn of_log(estimates: &Estimates, meta: &Meta) -> Self {
        let mut quantities = Self::new(estimates, meta.body_axes);
        quantities.gnss_latency_ms = latency_of_log(&estimates.gnss_latency_s, meta);
        quantities
    }

    /// Column names and quantities, in the order of the files.
    pub fn columns(&self) -> [(&'static str, Quantity); 8] {
        let [ax, ay, az] = self.accel_bias_mg.each();
        let [gx, gy, gz] = self.gyro_bias_deg_h.each();
        let (azimuth, latency) = (self.azimuth_error_deg, self.gnss_latency_ms);
        let all = [azimuth, ax, ay, az, gx, gy, gz, latency];
        core::array::from_fn(|index| (QUANTITIES[index].0, all[index]))
    }
}

/// A latency of a log's fixes as reported: with the shift of the stamps before, ms.
pub(crate) fn latency_of_log(estimate: &Estimate, meta: &Meta) -> Quantity {
    let quantity = Quantity::of(estimate, 1e-3);
    Quantity {
        value: quantity.value + 1e3 * meta.latency_offset_s(),
        ..quantity
    }
}

/// A right-forward-up vector in the given axes, in a unit of `unit` SI units.
pub(crate) fn in_axes(axes: BodyAxes, rfu: &[Estimate; 3], unit: f64) -> Axes {
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let (component, sign) = axes.rfu_component(axis);
        Quantity::of(&rfu[component], sign * unit)
    });
    Axes { x, y, z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ins_core::ImuOutput;

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
            let biases = Quantities::new(&estimates, axes).accel_bias_mg.each();
            assert!(biases.iter().all(|quantity| quantity.sigma > 0.0));
            biases.map(|quantity| quantity.value)
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
    fn a_shift_that_no_receiver_has_is_of_the_clocks() {
        let mut meta = Meta::new(BodyAxes::Rfu, ImuOutput::Rates);
        let mut told = |offset_s| {
            meta.gnss_clock_offset_s = offset_s;
            let quantities = Quantities::of_log(&Estimates::default(), &meta);
            (quantities.gnss_latency_ms.value, meta.clock_offset_s())
        };
        assert_eq!(told(0.75), (750.0, 0.0));
        assert_eq!(told(-18.0), (0.0, -18.0));
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

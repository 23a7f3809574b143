//! Quantities that may be the goal of a drive.

use core::f64::consts::PI;

use clap::ValueEnum;
use ins_core::{Estimates, Navigator};
use serde::Serialize;

use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2, Quantity as Known};
use crate::log::BodyAxes;
use crate::statistics::rms;

/// Quantities of one kind; the key names the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    Azimuth,
    AccelBias,
    GyroBias,
    Latency,
    LeverArm,
    AccelScale,
    TurnScale,
    GyroScale,
    GyroMisalignment,
}

impl Kind {
    /// Key in a target file, name, unit, SI value of the unit.
    fn entry(self) -> (&'static str, &'static str, &'static str, f64) {
        match self {
            Self::Azimuth => ("azimuth_deg", "azimuth", "deg", PI / 180.0),
            Self::AccelBias => ("accel_bias_mg", "accelerometer", "mg", MG_MPS2),
            Self::GyroBias => ("gyro_bias_deg_h", "gyro", "deg/h", DEG_H_RADPS),
            Self::Latency => ("gnss_latency_ms", "latency", "ms", 1e-3),
            Self::LeverArm => ("lever_arm_m", "lever arm", "m", 1.0),
            Self::AccelScale => ("accel_scale_percent", "accelerometer scale", "%", 1e-2),
            Self::TurnScale => ("turn_scale_percent", "gyro scale, vertical", "%", 1e-2),
            Self::GyroScale => ("gyro_scale_percent", "gyro scale", "%", 1e-2),
            Self::GyroMisalignment => ("gyro_misalignment_mrad", "gyro misalignment", "mrad", 1e-3),
        }
    }

    pub fn key(self) -> &'static str {
        self.entry().0
    }

    pub fn has_axes(self) -> bool {
        !matches!(self, Self::Azimuth | Self::Latency | Self::TurnScale)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    pub kind: Kind,
    /// Axis of the unit: 0, 1, 2.
    pub axis: usize,
}

impl Quantity {
    pub fn name(self) -> String {
        let (_, name, ..) = self.kind.entry();
        if self.kind.has_axes() {
            format!("{name} {}", ["x", "y", "z"][self.axis])
        } else {
            name.to_owned()
        }
    }

    pub fn unit(self) -> &'static str {
        self.kind.entry().2
    }

    pub fn si(self) -> f64 {
        self.kind.entry().3
    }

    /// Estimate of it, in its unit, for these axes of the unit.
    pub fn known(self, estimates: &Estimates, axes: BodyAxes) -> Known {
        let (component, sign) = axes.rfu_component(self.axis);
        let (estimate, sign) = match self.kind {
            Kind::Azimuth => (&estimates.azimuth_error_rad, 1.0),
            Kind::AccelBias => (&estimates.accel_bias_mps2[component], sign),
            Kind::GyroBias => (&estimates.gyro_bias_radps[component], sign),
            // As `identify` states it: the mean, where the clocks drift.
            Kind::Latency => (&estimates.gnss_latency_s, 1.0),
            Kind::LeverArm => (&estimates.lever_arm_m[component], sign),
            Kind::AccelScale => (&estimates.accel_scale[component], 1.0),
            Kind::TurnScale => (&estimates.turn_scale, 1.0),
            Kind::GyroScale => (&estimates.gyro_scale[component], 1.0),
            Kind::GyroMisalignment => (&estimates.gyro_misalignment_rad[component], sign),
        };
        Known::of(estimate, sign * self.si())
    }
}

/// A quantity and the sigma that is wanted of it, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    pub quantity: Quantity,
    pub sigma: f64,
}

/// A quantity at some time, against its goal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GoalStatus {
    pub quantity: String,
    pub unit: &'static str,
    pub sigma: f64,
    pub target: f64,
    pub observable: bool,
}

impl Goal {
    /// Status over several drives: RMS of their sigmas, observable if it is in all.
    pub fn reached<'a>(
        &self,
        drives: impl Iterator<Item = &'a Navigator>,
        axes: BodyAxes,
    ) -> GoalStatus {
        let known = |drive: &Navigator| self.quantity.known(&drive.estimates(), axes);
        let known: Vec<Known> = drives.map(known).collect();
        GoalStatus {
            quantity: self.quantity.name(),
            unit: self.quantity.unit(),
            sigma: rms(known.iter().map(|known| known.sigma)),
            target: self.sigma,
            observable: known.iter().all(Known::observable),
        }
    }
}

/// Cost of a quantity that is not observable, its sigma being as wanted, nepers; and least, of a much smaller one.
const UNOBSERVABLE: f64 = 1.0;
const UNOBSERVABLE_LEAST: f64 = 1e-3;

impl GoalStatus {
    /// An unobservable value is not given, whatever its sigma.
    pub fn is_met(&self) -> bool {
        self.observable && self.sigma <= self.target
    }

    /// Cost of the goal: logarithm of sigma over target, in nepers.
    pub fn missing(&self) -> f64 {
        let left = libm::log(self.sigma / self.target);
        if self.observable {
            left.max(0.0)
        } else {
            // Always positive, and falls with the sigma.
            (UNOBSERVABLE + left).max(UNOBSERVABLE_LEAST * self.sigma / self.target)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where clocks drift apart, it is not that of the last fix.
    #[test]
    fn the_latency_that_is_wanted_is_the_one_that_is_identified() {
        let mut estimates = Estimates::default();
        (
            estimates.gnss_latency_s.value,
            estimates.gnss_latency_now_s.value,
        ) = (0.1, 0.2);
        let latency = Quantity {
            kind: Kind::Latency,
            axis: 0,
        };
        let wanted = latency.known(&estimates, BodyAxes::Rfu).value;
        let identified = crate::identify::quantities::Quantities::new(&estimates, BodyAxes::Rfu);
        assert!((wanted - identified.gnss_latency_ms.value).abs() < 1e-9);
    }
}

//! An identified quantity, or what would make it observable.

use ins_core::Estimate;
use serde::{Serialize, Serializer};

use crate::identify::error_model::interval::{Interval, NORMAL_95};
use crate::identify::free_inertial::known;
use crate::page::digits;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Best value; meaningless unless known.
    pub value: f64,
    pub sigma: f64,
    /// Manoeuvres that would make it known; none if it is.
    pub missing: Option<&'static str>,
}

impl Found {
    /// Known, with a sigma.
    pub fn known(value: f64, sigma: f64) -> Self {
        Self {
            value,
            sigma,
            missing: None,
        }
    }

    pub fn unknown(missing: &'static str) -> Self {
        Self {
            value: 0.0,
            sigma: f64::INFINITY,
            missing: Some(missing),
        }
    }

    pub fn of(estimate: &Estimate, missing: &'static str) -> Self {
        Self {
            value: estimate.value,
            sigma: estimate.sigma,
            missing: (!known(estimate)).then_some(missing),
        }
    }

    /// A noise or sigma with a 95 % interval; not known if uncertain by more than a factor of two, one sigma.
    pub fn within(interval: Option<Interval>, missing: &'static str) -> Self {
        let known = |found: &Interval| {
            found.low > 0.0 && found.low < found.high && found.high < 16.0 * found.low
        };
        interval
            .filter(known)
            .map_or(Self::unknown(missing), |found| {
                let relative = 0.5 * libm::log(found.high / found.low) / NORMAL_95;
                Self::known(found.value, found.value * relative)
            })
    }

    /// Not known if there is a reason.
    #[must_use]
    pub fn unless(self, missing: Option<&'static str>) -> Self {
        Self {
            missing: self.missing.or(missing),
            ..self
        }
    }

    /// In another unit, or with the opposite sign.
    #[must_use]
    pub fn scaled(self, by: f64) -> Self {
        Self {
            value: by * self.value,
            sigma: by.abs() * self.sigma,
            ..self
        }
    }

    /// Added to a value that is already set.
    #[must_use]
    pub fn plus(self, set: f64) -> Self {
        Self {
            value: self.value + set,
            ..self
        }
    }

    /// The sum of two independent quantities.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            sigma: self.sigma.hypot(other.sigma),
            missing: self.missing.or(other.missing),
        }
    }

    pub fn is_known(&self) -> bool {
        self.missing.is_none()
    }

    /// Rounded to the second digit of its sigma.
    pub fn digits(&self) -> String {
        digits(self.sigma, self.value)
    }

    pub fn with_sigma(&self) -> String {
        format!("{} +- {}", self.digits(), digits(self.sigma, self.sigma))
    }
}

impl Serialize for Found {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Written {
            value: Option<f64>,
            sigma: f64,
            known: bool,
            #[serde(skip_serializing_if = "Option::is_none")]
            to_know: Option<&'static str>,
        }
        Written {
            value: self.is_known().then_some(self.value),
            sigma: self.sigma,
            known: self.is_known(),
            to_know: self.missing,
        }
        .serialize(serializer)
    }
}

/// Components right, forward, up as those forward, right, down.
pub(super) fn frd([right, forward, up]: &[Found; 3]) -> [Found; 3] {
    [*forward, *right, up.scaled(-1.0)]
}

//! Inputs: inertial samples and GNSS fixes.

use nalgebra::{Vector2, Vector3};

use crate::earth::{Geodetic, LatLon, wrap_pi};
use crate::time::Time;

/// Meaning of the two vectors of an [`ImuSample`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuOutput {
    /// Instantaneous angular rate (rad/s) and specific force (m/s^2) at the stamp.
    #[default]
    Rates,
    /// Angle (rad) and velocity (m/s) gained over the interval that ends at the stamp.
    Increments,
}

impl ImuOutput {
    /// Reading per unit of a constant rate over an interval, s: 1 of rates, that interval of increments.
    pub fn per_rate(self, interval_s: f64) -> f64 {
        match self {
            Self::Rates => 1.0,
            Self::Increments => interval_s,
        }
    }
}

/// One reading of the inertial sensors, body axes right-forward-up.
///
/// Units follow [`ImuOutput`] of the configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImuSample {
    /// Stamp of the reading, or end of its interval.
    pub time: Time,
    /// Angular rate of the body against inertial space, rad/s, or its increment, rad.
    pub gyro: Vector3<f64>,
    /// Specific force, m/s^2 (at rest: +g on the up axis), or its increment, m/s.
    pub accel: Vector3<f64>,
}

/// One-sigma noise of a fix's parts as the receiver states it; none, or not positive, where it does not. A
/// position with a sigma of 100 km or more, or a velocity with 100 m/s, is taken for missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FixSigma {
    /// East and north position, each, m.
    pub position_m: Option<f64>,
    /// Height, m.
    pub height_m: Option<f64>,
    /// East and north velocity, each, m/s.
    pub velocity_mps: Option<f64>,
    /// Vertical velocity, m/s.
    pub velocity_up_mps: Option<f64>,
}

/// One GNSS fix. Every part may be missing; a fix with no part is refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GnssFix {
    /// Stamp of the fix, on the same scale as the inertial stamps.
    pub time: Time,
    /// Latitude and longitude of the antenna.
    pub position: Option<LatLon>,
    /// Height of the antenna above the ellipsoid, m.
    pub height_m: Option<f64>,
    /// East and north velocity, m/s.
    pub velocity_en_mps: Option<Vector2<f64>>,
    /// Vertical velocity, up positive, m/s.
    pub velocity_up_mps: Option<f64>,
    /// Noise as the receiver states it.
    pub sigma: FixSigma,
}

/// A measured heading: of two antennas, or of a compass.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Heading {
    /// Its time, on the scale of the inertial stamps and without latency.
    pub time: Time,
    /// Of the forward axis, clockwise from true north, within a turn of it, rad.
    pub heading_rad: f64,
    /// One standard deviation, rad; 1e-5 at least and half a turn at most. It includes the misalignment of
    /// the antennas' line, or the compass, to the forward axis: there is no parameter for that, and however
    /// many headings come, they tell the azimuth no better than to this.
    pub sigma_rad: f64,
}

/// Height of a barometer, above any level: only its changes count.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BaroHeight {
    /// Its time, on the scale of the inertial stamps.
    pub time: Time,
    /// Of a standard atmosphere, m.
    pub height_m: f64,
    /// One standard deviation of the noise of one reading, m, including changes of wind and of the flow
    /// about the vehicle within two seconds; above zero, and no less than its resolution. Air that is
    /// warmer or colder than standard is allowed for in addition.
    pub sigma_m: f64,
}

/// Sigmas from which a part counts as missing, m and m/s: without a fix receivers write the largest number
/// they have.
pub(crate) const ANYWHERE_M: f64 = 1e5;
const ANY_MPS: f64 = 100.0;

/// Speed above which the vehicle moves, m/s, and sigmas of its noise on top.
const MOTION_MPS: f64 = 0.2;
const MOTION_SIGMAS: f64 = 4.0;

impl GnssFix {
    /// The antenna's position, if latitude, longitude and height are all known, or `height_m` where the fix
    /// has none.
    pub fn geodetic_or(&self, height_m: f64) -> Option<Geodetic> {
        let own = Geodetic {
            height_m,
            ..Geodetic::default()
        };
        self.position.map(|_| self.position_or(&own))
    }

    /// The antenna's position, with `own` for what the fix does not have.
    pub(crate) fn position_or(&self, own: &Geodetic) -> Geodetic {
        let place = self.position.unwrap_or(own.lat_lon());
        Geodetic {
            latitude_rad: place.latitude_rad,
            longitude_rad: wrap_pi(place.longitude_rad),
            height_m: self.height_m.unwrap_or(own.height_m),
        }
    }

    /// The same fix with the antenna at a position.
    #[must_use]
    pub fn at(self, place: &Geodetic) -> Self {
        Self {
            position: Some(place.lat_lon()),
            height_m: Some(place.height_m),
            ..self
        }
    }

    /// Without placeholders of missing parts: of sigmas beyond any, or all zero.
    #[must_use]
    pub(crate) fn without_placeholders(mut self) -> Self {
        let sigma = &mut self.sigma;
        known(&mut self.position, &mut sigma.position_m, ANYWHERE_M);
        known(&mut self.height_m, &mut sigma.height_m, ANYWHERE_M);
        known(&mut self.velocity_en_mps, &mut sigma.velocity_mps, ANY_MPS);
        known(
            &mut self.velocity_up_mps,
            &mut sigma.velocity_up_mps,
            ANY_MPS,
        );
        let zeros = Self {
            time: self.time,
            position: self.position.map(|_| LatLon::default()),
            height_m: self.height_m.map(|_| 0.0),
            velocity_en_mps: self.velocity_en_mps.map(|_| Vector2::zeros()),
            velocity_up_mps: self.velocity_up_mps.map(|_| 0.0),
            sigma: self.sigma,
        };
        if self == zeros && self.position.is_some() {
            return Self {
                time: self.time,
                ..Self::default()
            };
        }
        self
    }

    /// Velocity ENU, m/s; zero where a component is missing.
    pub fn velocity_enu_mps(&self) -> Vector3<f64> {
        let level = self.velocity_en_mps.unwrap_or_default();
        Vector3::new(level.x, level.y, self.velocity_up_mps.unwrap_or_default())
    }

    /// Horizontal speed, m/s.
    pub fn speed_mps(&self) -> f64 {
        self.velocity_en_mps.unwrap_or_default().norm()
    }

    /// Whether the speed is above its noise, of this sigma.
    pub(crate) fn is_moving(&self, sigma_mps: f64) -> bool {
        let velocity = self.velocity_en_mps.unwrap_or_default();
        let least = MOTION_MPS + MOTION_SIGMAS * sigma_mps;
        velocity.norm_squared() > least * least
    }
}

/// Removes a part whose sigma is beyond any.
fn known<T>(part: &mut Option<T>, sigma: &mut Option<f64>, anything: f64) {
    if sigma.is_some_and(|sigma| sigma >= anything) {
        (*part, *sigma) = (None, None);
    }
}

//! The WGS-84 Earth: ellipsoid, gravity, rotation, and the rates they give a local frame.
//!
//! Frame: East-North-Up (ENU) at the vehicle. Source of the constants: NGA.STND.0036 (WGS 84,
//! 2014), tables 3.1 and 3.4 to 3.6; derived ones are derived below.

use nalgebra::Vector3;

use crate::math;

/// Semi-major axis, m.
pub const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;
/// Flattening.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared, `f (2 - f)`.
pub const ECCENTRICITY_SQUARED: f64 = FLATTENING * (2.0 - FLATTENING);
/// Rotation rate, rad/s.
pub const ROTATION_RATE_RADPS: f64 = 7.292_115e-5;
/// Gravitational constant times mass, m^3/s^2.
pub const GM_M3PS2: f64 = 3.986_004_418e14;
/// Normal gravity at the equator, m/s^2.
pub const GRAVITY_EQUATOR_MPS2: f64 = 9.780_325_335_9;
/// Normal gravity at the poles, m/s^2.
pub const GRAVITY_POLE_MPS2: f64 = 9.832_184_937_8;
/// Ratio `m = omega^2 a^2 b / GM` of centrifugal to gravitational acceleration at the equator.
pub const CENTRIFUGAL_RATIO: f64 = ROTATION_RATE_RADPS
    * ROTATION_RATE_RADPS
    * SEMI_MAJOR_AXIS_M
    * SEMI_MAJOR_AXIS_M
    * SEMI_MAJOR_AXIS_M
    * (1.0 - FLATTENING)
    / GM_M3PS2;

/// Geodetic latitude and longitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LatLon {
    /// Geodetic latitude, rad, north positive.
    pub latitude_rad: f64,
    /// Longitude, rad, east positive, in [-pi, pi].
    pub longitude_rad: f64,
}

/// A point by geodetic latitude, longitude and height above the ellipsoid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Geodetic {
    /// Geodetic latitude, rad, north positive.
    pub latitude_rad: f64,
    /// Longitude, rad, east positive, in [-pi, pi].
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

impl Geodetic {
    /// The same without its height.
    pub fn lat_lon(&self) -> LatLon {
        LatLon {
            latitude_rad: self.latitude_rad,
            longitude_rad: self.longitude_rad,
        }
    }

    /// East, north and up metres from `origin` to `self`, for points some kilometres apart.
    ///
    /// Metres along the curved frame at the mean latitude: relative error below `d / R`.
    pub fn enu_from(&self, origin: &Self) -> Vector3<f64> {
        let mean = 0.5 * (self.latitude_rad + origin.latitude_rad);
        LocalEarth::at(mean, origin.height_m).enu_between(origin, self)
    }
}

/// The Earth as seen from one latitude and height.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LocalEarth {
    /// Sine of the latitude.
    pub sin_latitude: f64,
    /// Cosine of the latitude.
    pub cos_latitude: f64,
    /// Meridian radius of curvature plus height, m: `dlat/dt = V_N / north_radius_m`.
    pub north_radius_m: f64,
    /// Prime-vertical radius of curvature plus height, m.
    pub east_radius_m: f64,
    /// Normal gravity, m/s^2, down positive.
    pub gravity_mps2: f64,
}

impl LocalEarth {
    /// Evaluates the ellipsoid at a latitude (rad) and height (m).
    pub fn at(latitude_rad: f64, height_m: f64) -> Self {
        let (s, c) = math::sin_cos(latitude_rad);
        Self::from_sin_cos(s, c, height_m)
    }

    /// The same from the sine and cosine of the latitude.
    pub fn from_sin_cos(sin_latitude: f64, cos_latitude: f64, height_m: f64) -> Self {
        let s2 = sin_latitude * sin_latitude;
        let inverse_w = inverse_root(ECCENTRICITY_SQUARED * s2);
        let prime_vertical = SEMI_MAJOR_AXIS_M * inverse_w;
        let meridian = prime_vertical * (1.0 - ECCENTRICITY_SQUARED) * inverse_w * inverse_w;
        Self {
            sin_latitude,
            cos_latitude,
            north_radius_m: meridian + height_m,
            east_radius_m: prime_vertical + height_m,
            gravity_mps2: normal_gravity(s2, inverse_w, height_m),
        }
    }

    /// Earth rotation in ENU, rad/s.
    pub fn earth_rate(&self) -> Vector3<f64> {
        Vector3::new(
            0.0,
            ROTATION_RATE_RADPS * self.cos_latitude,
            ROTATION_RATE_RADPS * self.sin_latitude,
        )
    }

    /// Rotation of the ENU frame against the Earth for a velocity in ENU (m/s), rad/s.
    ///
    /// Singular at the poles, where the east direction is: right below 89.9 degrees.
    pub fn transport_rate(&self, velocity_enu_mps: &Vector3<f64>) -> Vector3<f64> {
        let east = velocity_enu_mps.x / self.east_radius_m;
        Vector3::new(
            -velocity_enu_mps.y / self.north_radius_m,
            east,
            east * self.sin_latitude / self.safe_cos_latitude(),
        )
    }

    /// East, north and up metres between points some kilometres around here.
    pub fn enu_between(&self, from: &Geodetic, to: &Geodetic) -> Vector3<f64> {
        let east_rad = wrap_pi(to.longitude_rad - from.longitude_rad);
        Vector3::new(
            east_rad * self.east_radius_m * self.cos_latitude,
            (to.latitude_rad - from.latitude_rad) * self.north_radius_m,
            to.height_m - from.height_m,
        )
    }

    /// Cosine of the latitude, kept from zero at the poles so that nothing becomes infinite.
    pub fn safe_cos_latitude(&self) -> f64 {
        math::max(self.cos_latitude, 1e-3)
    }
}

/// Sine and cosine of a slowly changing latitude, by series about a remembered one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct LatitudeTrig {
    latitude_rad: f64,
    sin: f64,
    cos: f64,
}

impl LatitudeTrig {
    /// Remembers `latitude_rad`.
    pub(crate) fn at(latitude_rad: f64) -> Self {
        let (sin, cos) = math::sin_cos(latitude_rad);
        Self {
            latitude_rad,
            sin,
            cos,
        }
    }

    /// Remembers a new latitude once the series would lose digits: beyond 1e-3 rad, 6 km, its
    /// first dropped term reaches 1e-14.
    pub(crate) fn follow(&mut self, latitude_rad: f64) {
        let moved = latitude_rad - self.latitude_rad;
        if !(-1e-3..=1e-3).contains(&moved) {
            *self = Self::at(latitude_rad);
        }
    }

    /// Sine and cosine of a latitude near the remembered one.
    pub(crate) fn sin_cos(&self, latitude_rad: f64) -> (f64, f64) {
        let d = latitude_rad - self.latitude_rad;
        let d2 = d * d;
        let (s, c) = (d * (1.0 - d2 / 6.0), 1.0 - d2 * (0.5 - d2 / 24.0));
        (self.sin * c + self.cos * s, self.cos * c - self.sin * s)
    }
}

/// `1 / sqrt(1 - x)` for `x` up to the squared eccentricity: the first dropped term is 2e-14.
/// Many processors have no square root of doubles, or the language does not let it be used.
fn inverse_root(x: f64) -> f64 {
    let tail = x * (5.0 / 16.0 + x * (35.0 / 128.0 + x * (63.0 / 256.0)));
    1.0 + x * (0.5 + x * (3.0 / 8.0 + tail))
}

/// Somigliana's normal gravity with the second-order height term (NGA.STND.0036 (4-1), (4-3)).
fn normal_gravity(sin2_latitude: f64, inverse_w: f64, height_m: f64) -> f64 {
    const K: f64 = (1.0 - FLATTENING) * GRAVITY_POLE_MPS2 / GRAVITY_EQUATOR_MPS2 - 1.0;
    let surface = GRAVITY_EQUATOR_MPS2 * (1.0 + K * sin2_latitude) * inverse_w;
    let x = height_m / SEMI_MAJOR_AXIS_M;
    let linear = 1.0 + FLATTENING + CENTRIFUGAL_RATIO - 2.0 * FLATTENING * sin2_latitude;
    surface * (1.0 - 2.0 * linear * x + 3.0 * x * x)
}

/// The same angle in [-pi, pi], for angles within a few turns of zero.
pub fn wrap_pi(angle_rad: f64) -> f64 {
    if math::abs(angle_rad) <= core::f64::consts::PI {
        return angle_rad;
    }
    angle_rad - core::f64::consts::TAU * math::round(angle_rad / core::f64::consts::TAU)
}

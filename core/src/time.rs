//! Time stamps. The core has no clock: every sample brings its own.

/// An instant on the log's or the receiver's own time scale, in whole microseconds.
///
/// Integer, so that differences of two stamps are exact however long the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Time {
    micros: i64,
}

// Stamps within the bound of `from_seconds` are exact in f64 to a microsecond over 285 years.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss
)]
impl Time {
    /// The instant `micros` microseconds after the origin of the scale.
    pub const fn from_micros(micros: i64) -> Self {
        Self { micros }
    }

    /// The nearest microsecond to `seconds`; `None` if not finite or beyond +-10^12 s.
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        // The bound keeps every later sum and difference of stamps far from overflow.
        (seconds.is_finite() && seconds.abs() <= 1e12)
            .then(|| Self::from_micros(libm::round(seconds * 1e6) as i64))
    }

    /// Microseconds since the origin of the scale.
    pub const fn as_micros(self) -> i64 {
        self.micros
    }

    /// Seconds since the origin of the scale (rounded to f64).
    pub fn as_seconds(self) -> f64 {
        self.micros as f64 * 1e-6
    }

    /// Seconds from `earlier` to `self`, negative if `self` comes first.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        let micros = self.micros.saturating_sub(earlier.micros);
        // `micros as f64` in halves, which is the same: small processors convert 32 bits at once.
        (f64::from((micros >> 32) as i32) * 4_294_967_296.0 + f64::from(micros as u32)) * 1e-6
    }

    /// The instant `seconds` later, to the microsecond; saturates, and a NaN adds nothing.
    #[must_use]
    #[inline(never)]
    pub fn plus_seconds(self, seconds: f64) -> Self {
        // Casts cut off what is after the point, saturate, and map NaN to zero.
        let micros = (seconds * 1e6 + libm::copysign(0.5, seconds)) as i64;
        Self::from_micros(self.micros.saturating_add(micros))
    }
}

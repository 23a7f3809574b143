//! Velocity observations for the alignment: of fixes, or mean velocities between positions.
//!
//! Receivers give up to 25 fixes a second, whose errors hardly change within a second: a few of them are
//! enough. Positions are differenced over a second, which removes their slow errors.

use nalgebra::Vector2;

use crate::config::Config;
use crate::earth::Geodetic;
use crate::math;
use crate::samples::GnssFix;
use crate::time::Time;

/// Least interval of velocities, s.
const SPACING_S: f64 = 0.19;
/// Least time between two positions that are differenced, s.
const SPAN_S: f64 = 0.95;
/// Longest: the mean hides what happened within.
const LONGEST_SPAN_S: f64 = 5.0;
/// Correlation time of a receiver's errors, s.
const SHARED_S: f64 = 2.0;
/// Change of a position error within a second, m: decimetres of smoothed positions, a metre of others.
const WANDER_M: f64 = 0.7;
/// Speed that shows motion, sigmas.
const MOTION_SIGMAS: f32 = 4.0;
/// Observations kept.
const KEPT: u32 = 16;

/// Velocity of the vehicle, or its mean over some time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Observation {
    /// Stamp; of a mean, of its end.
    pub(crate) time: Time,
    /// Duration of the mean, s; zero if none.
    pub(crate) span_s: f32,
    /// East and north, m/s.
    pub(crate) velocity_mps: Vector2<f32>,
    /// Standard deviation of each component, m/s.
    pub(crate) sigma_mps: f32,
    /// Number of successive ones that share an error.
    pub(crate) shared: f32,
}

impl Observation {
    /// Whether the speed is above its noise.
    pub(crate) fn is_moving(&self) -> bool {
        let least = MOTION_SIGMAS * self.sigma_mps;
        self.velocity_mps.norm_squared() > least * least
    }
}

/// The last observations, numbered from the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Observations {
    kept: [Observation; KEPT as usize],
    count: u32,
    last: Option<Time>,
    /// Position that the next difference starts from.
    before: Option<(Time, Geodetic)>,
}

impl Default for Observations {
    fn default() -> Self {
        Self {
            // Not copied over the stack, as one by one.
            kept: [Observation::default(); KEPT as usize],
            count: 0,
            last: None,
            before: None,
        }
    }
}

impl Observations {
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    /// Time of the last.
    pub(crate) fn last(&self) -> Option<Time> {
        self.last
    }

    /// Speed of the last, m/s.
    pub(crate) fn speed_mps(&self) -> f64 {
        let last = self.count.checked_sub(1).and_then(|last| self.get(last));
        last.map_or(0.0, |last| f64::from(last.velocity_mps.norm()))
    }

    /// An observation by its number, while it is kept.
    pub(crate) fn get(&self, number: u32) -> Option<&Observation> {
        let age = self.count.checked_sub(number)?;
        if age == 0 || age > KEPT {
            return None;
        }
        self.kept.get((number % KEPT) as usize)
    }

    /// Number of the oldest that is kept.
    pub(crate) fn oldest(&self) -> u32 {
        self.count.saturating_sub(KEPT)
    }

    /// Takes a fix; an observation if it makes one.
    pub(crate) fn add(&mut self, fix: &GnssFix, config: &Config) -> Option<Observation> {
        let observation = if fix.velocity_en_mps.is_some() {
            self.before = None;
            self.velocity(fix, config)
        } else {
            self.difference(fix)
        }?;
        self.last = Some(fix.time);
        if let Some(place) = self.kept.get_mut((self.count % KEPT) as usize) {
            *place = observation;
        }
        self.count += 1;
        Some(observation)
    }

    fn velocity(&self, fix: &GnssFix, config: &Config) -> Option<Observation> {
        let since_s = self
            .last
            .map_or(SHARED_S, |last| fix.time.seconds_since(last));
        if since_s < SPACING_S {
            return None;
        }
        let stated = fix.sigma.velocity_mps.unwrap_or(0.0);
        let (white, [_, most]) = (config.gnss.velocity_mps.white, config.gnss.noise_range);
        let sigma = math::min(math::max(stated, white), most * white);
        let sharing = math::max(SHARED_S / since_s, 1.0);
        Some(Observation {
            time: fix.time,
            span_s: 0.0,
            velocity_mps: fix.velocity_en_mps?.map(math::single),
            sigma_mps: math::single(sigma),
            shared: math::single(sharing),
        })
    }

    fn difference(&mut self, fix: &GnssFix) -> Option<Observation> {
        let place = fix.geodetic_or(0.0)?;
        let Some((time, before)) = self.before else {
            self.before = Some((fix.time, place));
            return None;
        };
        let span_s = fix.time.seconds_since(time);
        if span_s < SPAN_S {
            return None;
        }
        self.before = Some((fix.time, place));
        if span_s > LONGEST_SPAN_S {
            return None;
        }
        let velocity = place.enu_from(&before).xy() / span_s;
        Some(Observation {
            time: fix.time,
            span_s: math::single(span_s),
            velocity_mps: velocity.map(math::single),
            sigma_mps: math::single(core::f64::consts::SQRT_2 * WANDER_M / span_s),
            shared: 1.0,
        })
    }
}

//! The chosen form of the estimators.

use nalgebra::Vector3;

use crate::config::Config;
#[cfg(feature = "literal")]
use crate::config::Form;
use crate::error_model::InsError;
use crate::history::{History, Span};
#[cfg(feature = "literal")]
use crate::literal::Literal;
use crate::observer::Observer;
use crate::parameters::Parameters;
use crate::time::Time;

/// Longest span of one time update, s: within it attitude and force change little. Somewhat more than the
/// fixes that are compared as one.
const LONGEST_SPAN_S: f64 = 0.35;

/// The chosen form of the estimators. Both live in place: there is nowhere else.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(clippy::large_enum_variant)]
pub enum Estimator {
    /// All parameters jointly.
    Exact(Observer),
    /// (7) to (11) of the thesis.
    #[cfg(feature = "literal")]
    Literal(Literal),
}

impl Estimator {
    /// Starts with a tilt sigma and variances of the climb and of the position.
    #[expect(
        clippy::inline_always,
        reason = "made where it stays: otherwise it is copied over the stack"
    )]
    #[inline(always)]
    pub fn new(
        start: Time,
        tilt_sigma_rad: f64,
        variances: [f64; 2],
        level_force_mps2: Vector3<f64>,
        config: &Config,
    ) -> Self {
        // Of two values of a `match`, one would be copied over the stack.
        #[cfg_attr(not(feature = "literal"), expect(unused_mut))]
        let mut estimator = Self::Exact(Observer::new(
            start,
            tilt_sigma_rad,
            variances,
            level_force_mps2,
            config,
        ));
        #[cfg(feature = "literal")]
        if config.form == Form::Literal {
            estimator = Self::Literal(Literal::new(start, config));
        }
        estimator
    }

    /// The exact form, if chosen.
    #[cfg_attr(not(feature = "literal"), expect(clippy::unnecessary_wraps))]
    pub fn exact(&self) -> Option<&Observer> {
        match self {
            Self::Exact(observer) => Some(observer),
            #[cfg(feature = "literal")]
            Self::Literal(_) => None,
        }
    }

    #[cfg_attr(not(feature = "literal"), expect(clippy::unnecessary_wraps))]
    pub fn exact_mut(&mut self) -> Option<&mut Observer> {
        match self {
            Self::Exact(observer) => Some(observer),
            #[cfg(feature = "literal")]
            Self::Literal(_) => None,
        }
    }

    pub fn parameters(&self) -> &Parameters {
        match self {
            Self::Exact(observer) => observer.parameters(),
            #[cfg(feature = "literal")]
            Self::Literal(literal) => literal.parameters(),
        }
    }

    /// Specific force in the body at the level attitude of the mount, m/s^2; (7) to (11) need none.
    pub fn level_force_mps2(&self) -> Vector3<f64> {
        match self {
            Self::Exact(observer) => *observer.level_force_mps2(),
            #[cfg(feature = "literal")]
            Self::Literal(_) => Vector3::zeros(),
        }
    }

    pub fn horizon(&self) -> Time {
        match self {
            Self::Exact(observer) => observer.horizon(),
            #[cfg(feature = "literal")]
            Self::Literal(literal) => literal.horizon(),
        }
    }

    /// Propagates to a later time in the ring, or a step toward it.
    #[inline(never)]
    pub fn advance<const N: usize>(
        &mut self,
        history: &History<N>,
        to: Time,
        frame_rate_radps: &Vector3<f64>,
        accel_mps2: &Vector3<f64>,
        config: &Config,
    ) {
        // In place: it is large.
        let Some((span, end)) = &history.next_span(self.horizon(), to, LONGEST_SPAN_S) else {
            return;
        };
        match self {
            Self::Exact(observer) => {
                observer.propagate(span, *end, frame_rate_radps, accel_mps2, config);
            }
            #[cfg(feature = "literal")]
            Self::Literal(literal) => literal.propagate(span, *end),
        }
    }

    /// Error of the INS propagated over `since` from the horizon, as estimated and not yet corrected.
    pub fn predicted_error(&self, since: &Span, accel_mps2: &Vector3<f64>) -> InsError {
        match self {
            Self::Exact(observer) => observer.predicted_error(since, accel_mps2),
            #[cfg(feature = "literal")]
            Self::Literal(literal) => {
                let mut error = InsError::default();
                error.tilt_rad.z = literal.azimuth_left_rad(since);
                error
            }
        }
    }
}

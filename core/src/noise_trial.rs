//! How coloured the noise of GNSS velocity is, by trial: beside the observer runs a second one that
//! assumes its correlated part stronger, weaker, slower or faster, on the same differences. If its
//! innovations are clearly likelier, its assumption is taken over, and the next is tried.
//!
//! White innovations of the right variance are the most likely ones, so this tells noise of GNSS
//! that is correlated from an INS that wanders more than its gyros should: the one comes back, the
//! other does not. Likelihoods are compared at the best common factor of all variances each, for
//! that factor is measured anyway.

use nalgebra::Vector2;

use crate::channel::{Channel, Gains, Growth, Measured, Renewal};
use crate::config::{Config, Noise};
use crate::math;

/// Factor of the correlated part or of its time from one trial to the next.
const STEP: f64 = 2.0;
/// Least correlated part that is tried, against the white one.
const LEAST_COLOUR: f64 = 0.5;
/// Shortest and longest correlation time that is tried, s: a shorter one is white, a longer one an
/// error of the INS.
const CORRELATION_S: [f64; 2] = [0.5, 16.0];
/// Difference of log-likelihoods that decides: odds of one in 3000, for a drive sees a hundred trials.
const DECIDED: f64 = 8.0;
/// Time after which a start does not show in the innovations any more, s.
const SETTLING_S: f64 = 10.0;
/// Longest trial, s, and least number of innovations.
const LONGEST_S: f64 = 60.0;
const LEAST_COUNT: f64 = 40.0;
/// Largest square of an innovation, in its variance, that counts: outliers are no noise.
const ROBUST: f64 = 9.0;

/// One change of what is assumed of the noise, within the bounds of the user; the same where that is
/// not allowed.
fn changed(own: &Noise, change: u8, config: &Config) -> Noise {
    let within = |value: f64, [least, most]: [f64; 2]| math::max(math::min(value, most), least);
    let gnss = &config.gnss;
    let white = own.white;
    let [_, most] = gnss.noise_range;
    let mut noise = *own;
    match change {
        _ if gnss.trust_stated_sigma => {}
        0 => {
            let allowed = [LEAST_COLOUR * white, most * white];
            noise.correlated = within(noise.correlated * STEP, allowed);
        }
        1 if noise.correlated > LEAST_COLOUR * white => noise.correlated /= STEP,
        1 => noise.correlated = 0.0,
        // The time of what is not there does not matter.
        2 | 3 if noise.correlated <= 0.0 => {}
        2 => noise.correlation_s = within(noise.correlation_s * STEP, CORRELATION_S),
        3 => noise.correlation_s = within(noise.correlation_s / STEP, CORRELATION_S),
        // Steps in one direction do not lead everywhere.
        _ => {
            noise.correlated = BOLD_COLOUR * white;
            noise.correlation_s = if change == FIRST_BOLD {
                gnss.velocity_mps.correlation_s
            } else {
                BOLD_CORRELATION_S
            };
        }
    }
    noise
}

const CHANGES: u8 = 6;
/// From this one on they are bold: a colour is tried in place of all else.
const FIRST_BOLD: u8 = 4;
/// Which, against the white part, and a slow one, s.
const BOLD_COLOUR: f64 = 4.0;
const BOLD_CORRELATION_S: f64 = 8.0;

/// Log-likelihood of innovations, whatever the common factor of their variances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Likelihood {
    count: f64,
    squares: f64,
    logarithms: f64,
}

impl Likelihood {
    fn add(&mut self, innovation: &Vector2<f64>, variance: f64) {
        self.count += 2.0;
        let square = innovation.norm_squared() / variance;
        self.squares += math::min(square, 2.0 * ROBUST);
        self.logarithms += 2.0 * math::log(variance);
    }

    fn value(&self) -> f64 {
        let scale = math::log(self.squares / self.count);
        -0.5 * (self.count * scale + self.logarithms)
    }
}

/// Level errors of the INS and of GNSS as the rival sees them, less what the observer sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Apart {
    position_m: Vector2<f64>,
    velocity_mps: Vector2<f64>,
    /// `(-Phi_N, Phi_E)`: what accelerates east and north.
    tilt_rad: Vector2<f64>,
    velocity_noise: Vector2<f64>,
    position_noise: Vector2<f64>,
}

/// A level innovation of the observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Own {
    /// East and north.
    pub innovation: Vector2<f64>,
    /// What of it is the parameters', as known but not yet taken over: no noise.
    pub explained: Vector2<f64>,
    /// Of a component.
    pub variance: f64,
    /// What it is corrected with.
    pub gains: Gains,
}

/// A trial going on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NoiseTrial {
    change: u8,
    /// What the rival assumes.
    pub noise: Noise,
    /// Its covariance.
    pub level: Channel,
    apart: Apart,
    own: Likelihood,
    rival: Likelihood,
    seconds: f64,
    /// Time until the start has died out, s: what it was believed to be off by is no noise.
    unsettled_s: f64,
}

impl NoiseTrial {
    /// Tries the next change that the user's bounds allow, beside an observer that assumes `own`.
    pub fn new(after: u8, own: &Noise, level: &Channel, config: &Config) -> Self {
        let mut change = after;
        let mut noise = *own;
        for _ in 0..CHANGES {
            change = if change + 1 < CHANGES { change + 1 } else { 0 };
            noise = changed(own, change, config);
            if noise != *own {
                break;
            }
        }
        Self {
            change,
            noise,
            level: *level,
            apart: Apart::default(),
            own: Likelihood::default(),
            rival: Likelihood::default(),
            seconds: 0.0,
            unsettled_s: 0.0,
        }
    }

    /// The same where the observer has just begun, or begun anew.
    pub fn after_start(after: u8, own: &Noise, level: &Channel, config: &Config) -> Self {
        Self {
            unsettled_s: SETTLING_S,
            ..Self::new(after, own, level, config)
        }
    }

    /// The first of all is a colour that few receivers are without.
    pub fn first(own: &Noise, level: &Channel, config: &Config) -> Self {
        Self::after_start(CHANGES - 3, own, level, config)
    }

    /// Which change is on trial.
    pub fn change(&self) -> u8 {
        self.change
    }

    /// Carries the rival over a span: see [`Channel::propagate`].
    pub fn propagate(&mut self, growth: &Growth, noises: [Renewal; 2]) {
        self.level.propagate(growth, noises);
        self.seconds += growth.seconds;
        self.unsettled_s -= growth.seconds;
        let [velocity, position] = noises;
        let apart = &mut self.apart;
        apart.position_m +=
            apart.velocity_mps * growth.seconds + apart.tilt_rad * growth.force_up_moved_m;
        apart.velocity_mps += apart.tilt_rad * growth.force_up_mps;
        apart.velocity_noise *= velocity.keep;
        apart.position_noise *= position.keep;
    }

    /// Takes a level innovation of the observer, with this white noise in it.
    pub fn take(&mut self, measured: Measured, own: &Own, white: f64) {
        let apart = &mut self.apart;
        let shown = match measured {
            Measured::Velocity => apart.velocity_mps + apart.velocity_noise,
            Measured::Position => apart.position_m + apart.position_noise,
        };
        let rival = own.innovation - shown;
        let variance = self.level.predicted(measured) + white;
        let gains = self.level.update(measured, white);
        apart.position_m += gains.x * rival - own.gains.x * own.innovation;
        apart.velocity_mps += gains.y * rival - own.gains.y * own.innovation;
        apart.tilt_rad += gains.z * rival - own.gains.z * own.innovation;
        apart.velocity_noise += gains.w * rival - own.gains.w * own.innovation;
        apart.position_noise += gains.a * rival - own.gains.a * own.innovation;
        if self.unsettled_s > 0.0 {
            return;
        }
        self.own
            .add(&(own.innovation - own.explained), own.variance);
        self.rival.add(&(rival - own.explained), variance);
    }

    /// Whether the rival has won; none while the trial goes on. `inflation` is the number of the
    /// observer's innovations that tell as much as one that is independent: correlated ones, of
    /// vibration say, prefer any colour to none, and a bold one has to do better than that.
    pub fn verdict(&self, inflation: f64) -> Option<bool> {
        if self.own.count < LEAST_COUNT {
            return (self.seconds > 10.0 * LONGEST_S).then_some(false);
        }
        let gain = self.rival.value() - self.own.value();
        let bold = self.change >= FIRST_BOLD;
        if gain > DECIDED * if bold { inflation } else { 1.0 } {
            return Some(true);
        }
        (gain < -DECIDED || self.seconds > LONGEST_S).then_some(false)
    }

    /// What the rival sees beyond the observer, on an axis, 0 or 1: position, velocity, tilt that
    /// accelerates it, and the correlated noises of velocity and position.
    pub fn apart(&self, axis: usize) -> Gains {
        let of = |v: &Vector2<f64>| v.get(axis).copied().unwrap_or(0.0);
        let a = &self.apart;
        Gains::from([
            of(&a.position_m),
            of(&a.velocity_mps),
            of(&a.tilt_rad),
            of(&a.velocity_noise),
            of(&a.position_noise),
        ])
    }
}

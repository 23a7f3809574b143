//! Sigmas of solution and parameters.

use nalgebra::{SVector, Vector2, Vector3};

use super::Observer;
use super::consistency::Consistency;
use crate::config::{Config, GnssConfig};
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::history::{LONG_SMOOTHING_S, Span};
use crate::innovations::Innovations;
use crate::math;
use crate::measurement::Kind;
use crate::parameters::{COUNT, index};
use crate::solution::SolutionSigma;

/// Gradient of gravity, `2 g / R`, 1/s^2.
const GRADIENT_PER_S2: f64 = 3.1e-6;
/// Components of the INS error.
const COMPONENTS: usize = 9;
/// Ratio by which a measurement reduces a variance only where it was not held by fixes before.
pub(super) const KNOWN_RATIO: f64 = 0.5;
/// Growth of the smoothing, over what it was linearized at, and at first over the prior sigma unless it is
/// known, from which it is learnt anew: beyond chance in a receiver that does not smooth.
const RELEARN_RATIO: f64 = 2.0;

impl Observer {
    /// Variance of the tilt that scale errors and misalignments of the gyros leave in turns about the
    /// vertical, along each body axis, rad^2. Gyros that read `p` of such a turn in a level direction tilt
    /// the platform by as much, like level accelerometer biases of `-g p`: turns cannot separate the two,
    /// so it is no parameter but always stated. With scale errors `s`, `p_k = u_k (s_k - sum s_j u_j^2)` on
    /// a unit whose up axis is `u`.
    pub fn unobservable_tilt(&self, config: &Config) -> Vector3<f64> {
        let s = &config.sensors;
        let u2 = self
            .level_force_mps2
            .map(|f| (f / GRAVITY_EQUATOR_MPS2) * (f / GRAVITY_EQUATOR_MPS2));
        let u4 = u2.norm_squared();
        let misaligned = s.misalignment_rad * s.misalignment_rad;
        u2.map(|u2| {
            let scale = s.gyro_scale * s.gyro_scale * u2 * math::max(1.0 - 2.0 * u2 + u4, 0.0);
            scale + misaligned * math::max(1.0 - u2, 0.0)
        })
    }

    /// Unobservable part of the accelerometer biases, as a variance along each body axis, `(m/s^2)^2`: `g`
    /// times that tilt, gravity at an unknown height, and misalignments times the mean excess force, as in
    /// turns to one side.
    pub fn unobservable_accel(&self, config: &Config) -> Vector3<f64> {
        let tilted = GRAVITY_EQUATOR_MPS2 * GRAVITY_EQUATOR_MPS2;
        let up = self.level_force_mps2 / GRAVITY_EQUATOR_MPS2;
        let lighter = GRADIENT_PER_S2 * GRADIENT_PER_S2 * self.vertical.position();
        let beyond2 = self.excess_mps2.map(|beyond| f64::from(beyond * beyond));
        let across = beyond2.map(|own| beyond2.sum() - own) * config.sensors.cross_axis_variance();
        self.unobservable_tilt(config) * tilted + up.component_mul(&up) * lighter + across
    }

    /// Sigmas of position, velocity and attitude, ENU, propagated from the horizon over `since`.
    pub fn sigma(&self, since: &Span, config: &Config) -> SolutionSigma {
        let unobservable = 0.5 * self.unobservable_tilt(config).sum();
        let (level, up) = (&self.level, &self.vertical);
        let [velocity, climb, position, height] = self.inflations();
        let sigma = |level: f64, up: f64, added: &Vector3<f32>, inflation_up: f64| {
            let inflation = Vector3::new(velocity, velocity, inflation_up);
            let added = added.map(f64::from).component_mul(&inflation);
            (Vector3::new(level, level, up) + added).map(math::sqrt)
        };
        let added = &self.parameter_variance;
        let tilt = level.tilt() * velocity + unobservable;
        let attitude_rad = sigma(tilt, self.azimuth_walk, &added.tilt_rad, velocity);
        let velocities = [level.velocity() * velocity, up.velocity() * climb];
        let positions = [level.position() * position, up.position() * height];
        let mut velocity_mps = sigma(velocities[0], velocities[1], &added.velocity_mps, climb);
        let mut position_m = sigma(positions[0], positions[1], &added.position_m, climb);
        // Errors since the horizon have one cause, and add up linearly in an outage.
        let tilted_mps = tilted_force_sigma(&since.force_mps, &attitude_rad);
        let rss = |at_horizon: f64, since: f64| math::sqrt(at_horizon * at_horizon + since * since);
        position_m += (velocity_mps + 0.5 * tilted_mps) * since.seconds;
        velocity_mps = velocity_mps.zip_map(&tilted_mps, rss);
        // While fixes that agree are refused, either may be wrong.
        let [velocity, climb, position, height] =
            (self.innovations.each_ref()).map(|kind| kind.rejected_offset(self.horizon));
        let of = |own: [Vector2<f64>; 2], way: [Vector2<f64>; 2], kind: Kind| {
            if self.aided_by(kind) { own[0] } else { way[1] }
        };
        let level = of(velocity, position, Kind::Velocity);
        let up = of(climb, height, Kind::Climb);
        velocity_mps = velocity_mps.zip_map(&level.push(up.x), rss);
        position_m = position_m.zip_map(&position[0].push(height[0].x), rss);
        SolutionSigma {
            position_m,
            velocity_mps,
            attitude_rad,
        }
    }

    /// Sigma of roll and pitch, rad, with all parameters known.
    pub fn tilt_sigma_rad(&self) -> f64 {
        math::sqrt(self.level.tilt())
    }

    /// Updates one sigma in turn: of a parameter, or the parameters' part in a component of the INS error.
    #[inline(never)]
    pub fn update_next_sigma(&mut self, config: &Config) {
        let turn = usize::from(self.next_sigma);
        let which = turn / 2;
        if let Some(more) = self.reinflation.take() {
            self.add_walk(which, more);
        } else if turn % 2 == 0 {
            self.update_parameter_variance(which % COMPONENTS);
        } else {
            self.update_sigma(which, config);
        }
        // Adding variance back is a step of its own.
        if self.reinflation.is_none() {
            self.next_sigma = if turn + 1 < 2 * COUNT {
                self.next_sigma + 1
            } else {
                0
            };
        }
    }

    /// Sigma of a parameter, and check of its consistency; not of the azimuth, which is corrected with the
    /// others and walks like the gyros.
    fn update_sigma(&mut self, which: usize, config: &Config) {
        if which >= self.corrections.count() {
            return;
        }
        let mut variance = self.corrections.variance(which);
        let relearn_variance = self.relearn_variance(which, &config.gnss);
        if let Some(consistency) = self.consistency.get_mut(which)
            && which != index::AZIMUTH
        {
            let more = math::max(consistency.check(variance), relearn_variance);
            self.reinflation = (more > 0.0).then_some(more);
            // Stated from now on.
            variance += self.reinflation.unwrap_or_default();
        }
        if which == index::SMOOTHING {
            self.by_shape = if self.smoothing_time_s() > LONG_SMOOTHING_S {
                self.corrections.regression_on(which) * math::single(self.smoothing_s2())
            } else {
                SVector::zeros()
            };
        } else if let Some(by_shape) = self.by_shape.get(which) {
            variance += by_shape * by_shape;
        }
        let sigma = math::sqrt(f64::from(variance) * self.inflation_of(which));
        let value = self.parameters.value(which);
        self.parameters.set(which, value, sigma);
    }

    /// Variance given back to smoothing and arm once the smoothing is found to be much longer than where
    /// their rows were linearized: the effect of a swing is not linear in it, and the old rows hold it
    /// where it was, and let a wrong arm explain the swing.
    fn relearn_variance(&mut self, which: usize, gnss: &GnssConfig) -> f32 {
        match which {
            index::SMOOTHING => {
                let (s2, at_first) = (self.smoothing_s2(), gnss.smoothing_s2);
                let known = self.smoothing_time_s() > LONG_SMOOTHING_S;
                let least = if known { 0.0 } else { at_first };
                let is_longer = s2 > RELEARN_RATIO * math::max(self.linearized_at_s2, least);
                self.relearns_arm = is_longer && at_first > 0.0;
                if !self.relearns_arm {
                    return 0.0;
                }
                self.linearized_at_s2 = s2;
                math::single(s2 * s2)
            }
            index::LEVER_ARM..index::ACCEL_SCALE if self.relearns_arm => {
                math::single(gnss.lever_arm_sigma_m * gnss.lever_arm_sigma_m)
            }
            _ => 0.0,
        }
    }

    /// A measurement has reduced the variances of position, velocity and tilt for given parameters from
    /// these to those. If by much, the parameters' part has grown, and it is not its turn: it is stated as
    /// without correlations, but as no more than was lost.
    #[inline(never)]
    pub(super) fn on_known(&mut self, kind: Kind, before: [f64; 3], after: [f64; 3]) {
        let axes = if kind.is_up() { 2..3 } else { 0..2 };
        for (state, (before, after)) in before.into_iter().zip(after).enumerate() {
            if after >= KNOWN_RATIO * before {
                continue;
            }
            for component in axes.clone().map(|axis| 3 * state + axis) {
                let mut most = 0.0;
                for (own, sigma) in self.sensitivities.iter_mut().zip(&self.parameters.sigma) {
                    let by = own.error.component(component).map_or(0.0, |by| *by * sigma);
                    most += by * by;
                }
                if let Some(own) = self.parameter_variance.component(component) {
                    *own = math::max(*own, math::min(*own + math::single(before - after), most));
                }
            }
        }
    }

    /// Part of the parameters in the variance of one component.
    fn update_parameter_variance(&mut self, component: usize) {
        let partials: [f32; COUNT] = core::array::from_fn(|which| {
            let sensitivity = self.sensitivities.get_mut(which);
            let partial = sensitivity.and_then(|own| own.error.component(component));
            partial.copied().unwrap_or(0.0)
        });
        let variance = self.corrections.variance_of(partials);
        if let Some(added) = self.parameter_variance.component(component) {
            *added = variance;
        }
    }

    /// Inflation of the variances by unmodelled correlation of innovations, per kind; without velocities
    /// that of positions holds for the velocity, too.
    fn inflations(&self) -> [f64; 4] {
        let [velocity, climb, position, height] = &self.innovations;
        let learnt = |own: &Innovations, other: f64| {
            if own.has_data() {
                own.inflation()
            } else {
                other
            }
        };
        let (position, height) = (position.inflation(), height.inflation());
        let (velocity, climb) = (learnt(velocity, position), learnt(climb, height));
        // Positions integrate the errors of velocities.
        [
            velocity,
            climb,
            math::max(position, velocity),
            math::max(height, climb),
        ]
    }

    /// That of the level axes.
    pub(super) fn inflation(&self) -> f64 {
        let [level, ..] = self.inflations();
        level
    }

    /// That of a parameter, times that of its consistency: an accelerometer that points up shows in the
    /// vertical.
    pub(super) fn inflation_of(&self, which: usize) -> f64 {
        let own = self
            .consistency
            .get(which)
            .map_or(1.0, Consistency::inflation);
        let [level, vertical, ..] = self.inflations();
        let axis = which.wrapping_sub(index::ACCEL);
        let up = self.level_force_mps2.get(axis).unwrap_or(&0.0) / self.gravity_mps2;
        (level + up * up * (vertical - level)) * own
    }
}

/// Sigma of `f x Phi`, the velocity error by tilts of such sigmas.
fn tilted_force_sigma(force_mps: &Vector3<f64>, attitude_rad: &Vector3<f64>) -> Vector3<f64> {
    let square = |v: &Vector3<f64>| v.component_mul(v);
    let (force, attitude) = (square(force_mps), square(attitude_rad));
    let sum = Vector3::new(
        force.y * attitude.z + force.z * attitude.y,
        force.z * attitude.x + force.x * attitude.z,
        force.x * attitude.y + force.y * attitude.x,
    );
    sum.map(math::sqrt)
}

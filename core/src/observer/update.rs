//! Measurement update: the innovation of a fix, its partials, and what filter and noise model learn of it.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::skew::{skew_mps, skew_variance};
use super::uncertainty::KNOWN_RATIO;
use super::{JUMPS, Observer, estimated};
use crate::channel::Measured;
use crate::config::{Config, Noise};
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::history::{PastState, SPACING_S};
use crate::innovations::{GateResult, is_inlier, ratio_to_configured};
use crate::math::{self, singles};
use crate::measurement::{Difference, Kind};
use crate::parameters::{COUNT, index};

/// Jacobian of `R` measured components, a row for each parameter.
type Partials<const R: usize> = [[f32; R]; COUNT];

/// Square of the jerk that aliasing of a swing of unit velocity variance leaves: a third of it is in the
/// means over a tenth of a second, their second difference is four times that, on two axes.
const ALIASING_PER_S4: f64 = 6e4;

/// Sigmas by which the smoothing must differ from zero before the ring applies it in full: applied from the
/// start, a swing that is out of phase by a wrong latency would hold it at zero.
const SMOOTHING_SIGMAS: f64 = 3.0;

/// Delay of positions from which on the INS error changes meanwhile, s: before, by centimetres.
const LEAST_DELAY_S: f64 = 0.05;

/// Sigmas of gyro noise, in its mean between two entries of the ring, within which a rate shows no lever
/// arm: beyond, the noise of all three is a thirtieth of its square.
const NOISE_SIGMAS: f64 = 10.0;

impl Observer {
    /// Measurement update with a fix at the horizon, which must be within the ring; whether it was used.
    pub fn update(
        &mut self,
        past: &PastState,
        kind: Kind,
        difference: &Difference,
        config: &Config,
    ) -> bool {
        let delay_s = self.parameters.value(index::POSITION_DELAY);
        let own_time = math::abs(delay_s) > LEAST_DELAY_S
            && kind.measured() == Measured::Position
            && self.aided_by(Kind::Velocity);
        if own_time {
            self.advance_position(kind, -delay_s);
        }
        let result = self.form_innovation(past, kind, difference, config);
        if own_time {
            self.advance_position(kind, delay_s);
        }
        match result {
            GateResult::Accepted(_) => true,
            GateResult::Rejected => false,
            GateResult::Diverged(error) => {
                self.on_diverged(kind, &error, config);
                false
            }
        }
    }

    /// Refers the position error of a kind to another time, with the velocity error as it is: a position may
    /// be of another time than the velocity beside it.
    #[inline(never)]
    fn advance_position(&mut self, kind: Kind, seconds: f64) {
        let channel = if kind.is_up() {
            &mut self.vertical
        } else {
            &mut self.level
        };
        channel.advance_position(seconds);
        self.state.advance_position(kind, seconds);
        for sensitivity in estimated(&mut self.sensitivities, &self.corrections) {
            sensitivity.advance_position(kind, math::single(seconds));
        }
    }

    /// Forms innovation, partials and measurement noise of one kind, and updates with them.
    #[inline(never)]
    fn form_innovation(
        &mut self,
        past: &PastState,
        kind: Kind,
        difference: &Difference,
        config: &Config,
    ) -> GateResult {
        let timing = if kind.is_up() {
            &mut self.vertical_timing
        } else {
            &mut self.level_timing
        };
        timing.step(self.horizon);
        let per_manoeuvre = timing.per_manoeuvre;
        let model = self.receiver_model(past, kind, difference, config);
        let residual = difference.value - self.predict(&model, kind.measured(), difference);
        let extra = self.linearization_variance(past, kind, &model)
            + per_manoeuvre
                * skew_variance(self.smoothing_s2(), third2(past, kind) + model.arm_snap2)
            + difference.extra_variance;
        if kind.is_up() {
            let mut partials = self.partials(&model, kind.measured(), |own| [own.z]);
            self.apply_innovation(kind, &mut partials, [residual.z], difference, extra, config)
        } else {
            let mut partials = self.partials(&model, kind.measured(), |own| [own.x, own.y]);
            let residual = [residual.x, residual.y];
            if kind == Kind::Velocity {
                let sigma_s2 = self.parameters.sigma(index::SMOOTHING);
                let (accel_mps2, snap_mps4) = (&past.accel_mps2, &past.snap_mps4);
                let skew_mps = skew_mps(accel_mps2, snap_mps4, self.smoothing_s2(), sigma_s2);
                self.skewed_arm.add(&partials, &singles(&skew_mps));
            }
            self.apply_innovation(kind, &mut partials, residual, difference, extra, config)
        }
    }

    /// Updates with the innovations of one kind, one for each of its axes.
    fn apply_innovation<const R: usize>(
        &mut self,
        kind: Kind,
        partials: &mut Partials<R>,
        innovation: [f64; R],
        difference: &Difference,
        extra: f64,
        config: &Config,
    ) -> GateResult {
        let gnss = &config.gnss;
        let configured = kind.noise(config);
        let learnt = self.noise_ratio(kind, difference.stated_variance, config);
        let channel = if kind.is_up() {
            &mut self.vertical
        } else {
            &mut self.level
        };
        let Some(innovations) = self.innovations.get_mut(kind as usize) else {
            return GateResult::Rejected;
        };
        let noise = configured.white * configured.white * learnt / difference.fixes;
        let white = noise + extra;
        let predicted = channel.predicted_variance(kind.measured());
        let components = if kind.is_up() { 1.0 } else { 2.0 };
        let pair = Vector2::from([0, 1].map(|axis| innovation.get(axis).copied().unwrap_or(0.0)));
        // The variance due to the parameters is only computed if the gate needs it.
        let mut variance = predicted;
        if !is_inlier(&pair, components * (predicted + white)) {
            variance += self.corrections.mean_variance(partials);
        }
        let result = innovations.gate(self.horizon, &pair, components, variance, white);
        let (nis, timing) = if kind.is_up() {
            (&mut self.vertical_nis, &self.vertical_timing)
        } else {
            (&mut self.nis, &self.level_timing)
        };
        let seconds = timing.seconds;
        if kind == Kind::Velocity && seconds > 0.0 {
            let accepted = matches!(result, GateResult::Accepted(_));
            for (jump, (which, test)) in self.jumps.iter_mut().zip(&JUMPS) {
                if let Some([east, north]) = partials.get(*which).and_then(|own| own.first_chunk())
                    && (accepted || test.uses_rejected)
                {
                    let partial = Vector2::new(*east, *north).map(f64::from);
                    jump.add(&pair, &partial, predicted + white, seconds, test);
                }
            }
        }
        let GateResult::Accepted(white) = result else {
            // A refused climb counts: one knock can upset the vertical. Level fixes count only once they
            // agree, and heights alone may be wrong for a while.
            if result == GateResult::Rejected && kind == Kind::Climb {
                nis.add(pair.norm_squared() / (variance + white), seconds);
            }
            return result;
        };
        // Both level axes have the same covariance.
        let tilt = channel.tilt();
        let before = [channel.position(), channel.velocity(), tilt];
        let gains = channel.update(kind.measured(), white);
        let after = [channel.position(), channel.velocity(), channel.tilt()];
        let known = before
            .iter()
            .zip(&after)
            .any(|(before, after)| *after < KNOWN_RATIO * before);
        let total = predicted + white;
        self.state.correct(&gains, &innovation);
        let single_gains = gains.map(math::single);
        let sensitivities = estimated(&mut self.sensitivities, &self.corrections);
        for (sensitivity, partial) in sensitivities.iter_mut().zip(partials.iter()) {
            sensitivity.correct(&single_gains, &partial.map(|own| -own));
        }
        let weights = [math::single(1.0 / total); R];
        let added = self
            .corrections
            .add(partials, innovation.map(math::single), weights);
        let square = f64::from(added.square) / components;
        nis.add(square, seconds);
        // Barometer and vertical sign add a variance that is not the receiver's.
        if difference.extra_variance < noise {
            let sigmas = pair / math::sqrt(total * 0.5 * components);
            let trusted = gnss.trust_stated_sigma;
            let range = if trusted { [1.0; 2] } else { gnss.noise_range };
            innovations.learn(square, noise / total, &sigmas, range);
            // Uncertain parameters hide the noise.
            if !trusted && f64::from(added.determinant) < 1.0 + components {
                self.learn_noise(kind, &pair, components, total, config);
            }
        }
        if kind == Kind::Height {
            self.height_score.update(&pair, total, white);
            self.height_correlation.update(&pair, total, white);
        }
        if !kind.is_up() {
            let variance = total * math::sqrt(f64::from(added.determinant));
            let left = self.level.tilt();
            let process = &mut self.gyro_noise;
            process.corrected(&pair, variance, gains.z, tilt - left);
            process.adapt(left, config.sensors.noise_range);
        }
        if known {
            self.on_known(kind, before, after);
        }
        result
    }

    /// Ratio of a measurement's noise to the configured one, in variance, by the stated sigma and by what
    /// was learnt; scales the correlated noise from now on as well.
    #[inline(never)]
    fn noise_ratio(&mut self, kind: Kind, stated: Option<f64>, config: &Config) -> f64 {
        let gnss = &config.gnss;
        let configured = kind.noise(config);
        let number = kind as usize;
        let (Some(innovations), Some(coloured)) = (
            self.innovations.get_mut(number),
            self.coloured_noise.get_mut(number),
        ) else {
            return 1.0;
        };
        // Innovations do not show what lasts for minutes in positions, and show all of velocities.
        let is_position = kind.measured() == Measured::Position;
        let relative = match stated {
            Some(variance) if gnss.trust_stated_sigma || is_position => {
                ratio_to_configured(variance, configured, gnss.noise_range[0])
            }
            Some(variance) => innovations.ratio_to_average(variance),
            None => 1.0,
        };
        let learnt = relative * innovations.scale;
        if !is_position {
            coloured.scale(learnt);
            return learnt;
        }
        let [_, most] = gnss.noise_range;
        let expected = math::max(coloured.strength, most * most);
        coloured.scale(math::max(learnt, relative));
        // A stated sigma beyond the expected range counts at once.
        if stated.is_some() {
            let worse = math::max(coloured.strength - expected, 0.0);
            let channel = if kind.is_up() {
                &mut self.vertical
            } else {
                &mut self.level
            };
            channel.add_noise_variance(configured.correlated * configured.correlated * worse);
        }
        learnt
    }

    /// Learns the strength of the correlated noise of a kind: of heights by the likelihood of the
    /// innovation, of the others from the estimated noise state.
    fn learn_noise(
        &mut self,
        kind: Kind,
        innovation: &Vector2<f64>,
        components: f64,
        total: f64,
        config: &Config,
    ) {
        let range = config.gnss.noise_range;
        let Some(coloured) = self.coloured_noise.get_mut(kind as usize) else {
            return;
        };
        if kind == Kind::Height {
            let sensitivity = &self.height_score;
            coloured.learn(sensitivity, innovation, components, total, range);
            if !self.aided_by(Kind::Climb) {
                self.height_correlation.learn(innovation, total, range);
            }
            return;
        }
        let channel = if kind.is_up() {
            &self.vertical
        } else {
            &self.level
        };
        let time_ratio = match kind.measured() {
            Measured::Velocity => 1.0,
            Measured::Position => coloured.time_ratio(),
        };
        let estimate = self.state.noise(kind);
        let left = channel.noise(kind.measured());
        coloured.learn_from_state(
            self.horizon,
            &estimate,
            components,
            left,
            (kind.noise(config), time_ratio),
            range,
        );
    }

    /// Variance of the linearization error per component: latency squared in a jerk, latency times unknown
    /// arm of a swinging antenna, latency times azimuth. It falls as these become known; motion too fast
    /// for the ring stays.
    fn linearization_variance(&self, past: &PastState, kind: Kind, model: &ReceiverModel) -> f64 {
        let square = |x: f64| x * x;
        let p = &self.parameters;
        let own_delay = if model.has_delay {
            square(p.sigma(index::POSITION_DELAY))
        } else {
            0.0
        };
        let latency = square(p.sigma(index::LATENCY)) + own_delay;
        let azimuth = square(p.sigma(index::AZIMUTH));
        let arm_axis = |axis: usize| square(p.sigma(index::LEVER_ARM + axis));
        let arm = (arm_axis(0) + arm_axis(1) + arm_axis(2)) / 3.0;
        // Vibration hardly shows in positions.
        let (first, second, swing, unresolved) = match kind.measured() {
            Measured::Velocity => (
                &past.accel_mps2,
                &past.jerk_mps3,
                &past.attitude_accel,
                past.unresolved_velocity + past.unresolved_rate * model.arm_m.norm_squared(),
            ),
            Measured::Position => (
                &past.velocity_mps,
                &past.accel_mps2,
                &past.attitude_rate,
                0.0,
            ),
        };
        let by_azimuth = 0.5 * azimuth * first.norm_squared();
        let by_arm = arm * swing.norm_squared() / 3.0;
        let by_jerk = 0.25 * latency * second.norm_squared();
        unresolved + latency * (by_jerk + by_arm + by_azimuth)
    }

    /// Effect of receiver and antenna on INS minus GNSS, and its partials.
    fn receiver_model(
        &self,
        past: &PastState,
        kind: Kind,
        difference: &Difference,
        config: &Config,
    ) -> ReceiverModel {
        let measured = kind.measured();
        if !difference.from_receiver {
            return ReceiverModel::default();
        }
        let arm_m = self.parameters.lever_arm();
        // The platform leans with the GNSS noise of the past, and gravity would pass for acceleration
        // correlated with the error to come: errors in variables, 2 sigmas of the latency of a slow
        // vehicle.
        let (force_mps2, tilt) = (&past.accel_mps2, &self.state.error.tilt_rad);
        let up_mps2 = force_mps2.z + GRAVITY_EQUATOR_MPS2;
        let mut accel_mps2 = past.accel_mps2 + past.attitude_accel * arm_m;
        accel_mps2.x += up_mps2 * tilt.y - force_mps2.y * tilt.z;
        accel_mps2.y += force_mps2.x * tilt.z - up_mps2 * tilt.x;
        // Velocities may also come in fixes of their own.
        let has_delay = measured == Measured::Position && self.aided_by(Kind::Velocity);
        let delay_s = if has_delay {
            self.parameters.value(index::POSITION_DELAY)
        } else {
            0.0
        };
        let smoothing_s2 = self.smoothing_s2();
        // A position that lags less than the velocity beside it is smoothed over what is left of the time
        // constant: a share of its variance, less the delay times what is left.
        let (share, left_s) = if delay_s < 0.0 {
            let left_s = math::max(math::sqrt(smoothing_s2) + delay_s, 0.0);
            (left_s / (left_s - delay_s), left_s)
        } else {
            (1.0, 0.0)
        };
        let [arm_rows, arm_curvature] = self.arm_rows(past, measured, config);
        let (arm_jerk_mps3, arm_effect) = (arm_curvature * arm_m, arm_rows * arm_m);
        let jerk_mps3 = past.jerk_mps3 + arm_jerk_mps3;
        let (part, by_latency, by_smoothing) = match measured {
            Measured::Velocity => {
                let part = 0.5 * vehicle_share(past, &jerk_mps3) * self.smoothing_gain(past);
                (part, accel_mps2, -part * jerk_mps3)
            }
            Measured::Position => (
                0.0,
                past.velocity_mps + past.attitude_rate * arm_m - accel_mps2 * delay_s,
                -0.5 * share * accel_mps2,
            ),
        };
        let by_latency = by_latency * self.latency_gain(past, kind, &by_latency);
        let jerk2 = arm_jerk_mps3.norm_squared();
        let by_azimuth = Vector3::new(arm_effect.y, -arm_effect.x, 0.0);
        ReceiverModel {
            arm_m,
            by_latency,
            has_delay,
            by_delay: by_latency - accel_mps2 * left_s,
            // Of half a second the second order is decimetres.
            delay_part: (by_latency + 0.5 * accel_mps2 * (delay_s - left_s)) * delay_s,
            by_smoothing,
            by_lever_arm: arm_rows + arm_curvature * (part * smoothing_s2),
            arm_part: by_azimuth * tilt.z - arm_effect,
            by_azimuth,
            arm_snap2: jerk2 * math::sqrt(jerk2 / (arm_effect.norm_squared() + 1e-6)),
        }
    }

    /// Partials by the lever arm, negative, with the azimuth of the INS, and their second derivative, of
    /// which a smoothing receiver shows a part. The level tilt takes part, for it is correlated with GNSS
    /// noise; and rates within gyro noise, which drives the INS as well, give none: either would bias the
    /// arm (errors in variables).
    fn arm_rows(&self, past: &PastState, measured: Measured, config: &Config) -> [Matrix3<f64>; 2] {
        let rows = match measured {
            Measured::Velocity => {
                let noise = NOISE_SIGMAS * config.sensors.mean_gyro_noise();
                let least = noise * noise * self.gyro_noise.ratio / SPACING_S;
                if 0.5 * past.attitude_rate.norm_squared() < least {
                    return [Matrix3::zeros(); 2];
                }
                [past.attitude_rate, past.attitude_jerk.map(f64::from)]
            }
            Measured::Position => [past.attitude, Matrix3::zeros()],
        };
        let tilt = &self.state.error.tilt_rad;
        let level = Vector3::new(tilt.x, tilt.y, 0.0);
        rows.map(|rows| rows + level.cross_matrix() * rows)
    }

    /// Describing-function gain of the latency partial: a swing whose phase is uncertain by the latency's
    /// sigma `s` is too fast for a tangent. By statistical linearization (Gelb and Vander Velde, 1968) a
    /// sine keeps `exp(-w^2 s^2 / 2)` of its derivative, with `w` of level and vertical apart; a smoothing
    /// receiver attenuates it like the swing itself.
    fn latency_gain(&self, past: &PastState, kind: Kind, first: &Vector3<f64>) -> f64 {
        let sigma_s = self.parameters.sigma(index::LATENCY);
        let rate2 = math::sqrt(third2(past, kind) / (square_of(first, kind) + 1e-9));
        let attenuation = 1.0 + 0.5 * self.smoothing_s2() * rate2;
        math::decayed(0.5 * sigma_s * sigma_s * rate2) / attenuation
    }

    /// The same gain of the smoothing partial: no more than all of a swing can be smoothed away. Of a known
    /// smoothing the ring has the exact derivative.
    fn smoothing_gain(&self, past: &PastState) -> f64 {
        if past.smoothed {
            return 1.0;
        }
        let smoothing_s2 = self.smoothing_s2();
        let rate4 = past.snap_mps4.norm_squared() / (past.accel_mps2.norm_squared() + 1e-9);
        let sigma = self.parameters.sigma(index::SMOOTHING);
        math::decayed(0.5 * math::sqrt((smoothing_s2 * smoothing_s2 + sigma * sigma) * rate4))
    }

    /// INS minus GNSS as predicted.
    fn predict(
        &self,
        model: &ReceiverModel,
        measured: Measured,
        difference: &Difference,
    ) -> Vector3<f64> {
        let p = &self.parameters;
        let latency = p.value(index::LATENCY) + self.unsolved_s * p.value(index::CLOCK_DRIFT);
        let late = model.by_latency * (latency - difference.latency_applied_s);
        let smoothed = model.by_smoothing * p.value(index::SMOOTHING);
        self.state.measurement(measured) + late + model.delay_part + smoothed + model.arm_part
    }

    /// Its partials by each parameter, of the axes that `of` selects.
    fn partials<const R: usize>(
        &self,
        model: &ReceiverModel,
        measured: Measured,
        of: impl Fn(&Vector3<f32>) -> [f32; R],
    ) -> Partials<R> {
        let mut partials = [[0.0; R]; COUNT];
        let estimated = self.sensitivities.iter().take(self.corrections.count());
        for (partial, sensitivity) in partials.iter_mut().zip(estimated) {
            *partial = of(&sensitivity.measurement(measured));
        }
        let mut add = |which: usize, more: &Vector3<f32>| {
            if let Some(partial) = partials.get_mut(which) {
                for (own, more) in partial.iter_mut().zip(of(more)) {
                    *own += more;
                }
            }
        };
        // A swinging antenna shows the azimuth.
        add(index::AZIMUTH, &singles(&model.by_azimuth));
        let by_latency = singles(&model.by_latency);
        add(index::LATENCY, &by_latency);
        if model.has_delay {
            add(index::POSITION_DELAY, &singles(&model.by_delay));
        }
        let drifted = by_latency * math::single(self.unsolved_s);
        add(index::CLOCK_DRIFT, &drifted);
        let by_lever_arm = model.by_lever_arm.map(math::single);
        for axis in 0..3 {
            add(index::LEVER_ARM + axis, &-by_lever_arm.column(axis));
        }
        add(index::SMOOTHING, &singles(&model.by_smoothing));
        partials
    }

    /// Time constant of a receiver that is known to smooth, s; else zero.
    pub fn smoothing_time_s(&self) -> f64 {
        let smoothing_s2 = self.smoothing_s2();
        if smoothing_s2 > SMOOTHING_SIGMAS * self.parameters.sigma(index::SMOOTHING) {
            math::sqrt(smoothing_s2)
        } else {
            0.0
        }
    }

    /// Variance of the delays over which one output of the receiver averages, s^2.
    pub fn smoothing_s2(&self) -> f64 {
        math::max(self.parameters.value(index::SMOOTHING), 0.0)
    }

    /// Assumed noise of GNSS velocity, with the white part as configured.
    pub fn velocity_noise(&self, config: &Config) -> Noise {
        let [velocity, ..] = &self.coloured_noise;
        let noise = config.gnss.velocity_mps;
        Noise {
            correlated: noise.correlated * math::sqrt(velocity.ratio),
            ..noise
        }
    }
}

/// Partials of INS minus GNSS by latency and smoothing, and, with opposite sign, by the lever arm.
#[derive(Default)]
struct ReceiverModel {
    arm_m: Vector3<f64>,
    /// Velocity or acceleration of the antenna at `C l`, with the derivatives of that: of a mast they are
    /// most of it.
    by_latency: Vector3<f64>,
    /// Whether a position has a delay of its own beyond the latency, its partial, and its effect as
    /// estimated, with what it is thus smoothed less.
    has_delay: bool,
    by_delay: Vector3<f64>,
    delay_part: Vector3<f64>,
    /// A mean over delays of variance `s` differs by `s / 2` times the second derivative.
    by_smoothing: Vector3<f64>,
    by_lever_arm: Matrix3<f64>,
    /// Effect of the arm as estimated and with the azimuth corrected, and partials by azimuth.
    arm_part: Vector3<f64>,
    by_azimuth: Vector3<f64>,
    /// Squared third derivative of a swinging arm, by the frequency that its jerk shows, (m/s^4)^2.
    arm_snap2: f64,
}

/// Squared third derivative of the measured quantity.
fn third2(past: &PastState, kind: Kind) -> f64 {
    let third = match kind.measured() {
        Measured::Velocity => &past.snap_mps4,
        Measured::Position => &past.jerk_mps3,
    };
    square_of(third, kind)
}

/// Squared norm of the components that a kind measures.
fn square_of(vector: &Vector3<f64>, kind: Kind) -> f64 {
    if kind.is_up() {
        vector.z * vector.z
    } else {
        vector.xy().norm_squared()
    }
}

/// Part of the jerk that is the vehicle's and no aliasing, which the fixes show as well: it would pass for
/// smoothing.
fn vehicle_share(past: &PastState, jerk_mps3: &Vector3<f64>) -> f64 {
    let jerk = jerk_mps3.norm_squared();
    jerk / (jerk + ALIASING_PER_S4 * past.unresolved_velocity + 1e-9)
}

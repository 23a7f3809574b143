//! Time update of error state, sensitivities and covariance.

use nalgebra::Vector3;

use super::{Observer, UNKNOWN_HEIGHT_M, estimated};
use crate::channel::{ChannelStep, Markov, Measured};
use crate::config::Config;
use crate::error_model::{
    Forcing, InsError, SCHULER_PER_S2, Transition, VERTICAL_PER_S2, for_each_input, level_and_up,
};
use crate::history::Span;
use crate::math;
use crate::measurement::Kind;
use crate::parameters::index;
use crate::time::Time;

impl Observer {
    /// INS error propagated from the horizon over `since`.
    pub fn predicted_error(&self, since: &Span, accel_mps2: &Vector3<f64>) -> InsError {
        let forcing = Forcing::over(since, &self.level_force_mps2, &self.parameters, accel_mps2);
        // The horizon is close: the frame's rotation is left out.
        let transition =
            Transition::over(since, &Vector3::zeros(), &forcing, &self.error().tilt_rad);
        self.state.error.propagated(since, &transition, &forcing)
    }

    /// Time update over a span that ends at `to`, in a frame that turns at `frame_rate`.
    #[inline(never)]
    pub fn propagate(
        &mut self,
        span: &Span,
        to: Time,
        frame_rate: &Vector3<f64>,
        accel_mps2: &Vector3<f64>,
        config: &Config,
    ) {
        let forcing = Forcing::over(span, &self.level_force_mps2, &self.parameters, accel_mps2);
        let transition = Transition::over(span, frame_rate, &forcing, &self.error().tilt_rad);
        self.state.error = self.state.error.propagated(span, &transition, &forcing);
        let azimuth_sigma = self.parameters.sigma(index::AZIMUTH);
        let azimuth = self.state.error.tilt_rad.z;
        self.parameters.set(index::AZIMUTH, azimuth, azimuth_sigma);

        let [velocity, climb, position, height] = &self.coloured_noise;
        let gnss = &config.gnss;
        let time_ratio = position.time_ratio();
        let level = [
            Markov::over(span.seconds, &gnss.velocity_mps, velocity.strength),
            Markov::over(
                span.seconds / time_ratio,
                &gnss.position_m,
                position.strength * time_ratio,
            ),
        ];
        let time_ratio = self.height_correlation.ratio_of(height);
        let up = [
            Markov::over(span.seconds, &gnss.velocity_up_mps, climb.strength),
            Markov::over(
                span.seconds / time_ratio,
                &gnss.height_m,
                height.strength * time_ratio,
            ),
        ];
        let assumed = height.variance(&gnss.height_m, time_ratio);
        self.height_score.propagate(&up[1]);
        self.height_correlation.propagate(
            &up[1],
            span.seconds / (gnss.height_m.correlation_s * time_ratio),
            assumed,
            &self.state.noise(Kind::Height),
            self.vertical.noise(Measured::Position),
        );
        let kept = |steps: &[Markov; 2]| steps.map(|step| step.decay);
        self.state.decay(kept(&level), kept(&up));

        let single = transition.single();
        let (level_kept, up_kept) = (kept(&level).map(math::single), kept(&up).map(math::single));
        let sensitivities = estimated(&mut self.sensitivities, &self.corrections);
        for sensitivity in sensitivities.iter_mut() {
            sensitivity.error.propagate(&single);
            sensitivity.decay(level_kept, up_kept);
        }
        for_each_input(span, &self.level_force_mps2, |which, input| {
            if let Some(sensitivity) = sensitivities.get_mut(which) {
                sensitivity.error.add_input(&single, &input.single());
            }
        });
        self.grow_variance(span, level, up, config);
        self.unsolved_s += span.seconds;
        self.horizon = to;
    }

    /// Time update of the channels' covariance.
    #[inline(never)]
    fn grow_variance(&mut self, span: &Span, level: [Markov; 2], up: [Markov; 2], config: &Config) {
        let s = &config.sensors;
        let up_b = span.attitude_s.row(2).transpose() / span.seconds;
        let shares = |noise: &[f64; 3], ratio: f64| {
            let noise = Vector3::from(*noise);
            level_and_up(&up_b, &(noise.component_mul(&noise) * ratio))
        };
        let (gyro_level, gyro_up) = shares(&s.gyro_noise, self.gyro_noise.ratio);
        let (accel_level, accel_up) = shares(&s.accel_noise, 1.0);
        self.gyro_noise
            .add_noise(span.seconds, gyro_level * span.seconds);
        let step = ChannelStep {
            seconds: span.seconds,
            force_up_mps: span.force_mps.z,
            force_up_position_m: span.force_position_m.z,
            gravity_per_s: SCHULER_PER_S2 * span.seconds,
            accel_noise: accel_level,
            gyro_noise: gyro_level,
        };
        self.level.propagate(&step, level);
        // With an unknown height the gradient would make gravity share its error with an accelerometer
        // bias.
        let known = self.vertical.position() < 0.25 * UNKNOWN_HEIGHT_M * UNKNOWN_HEIGHT_M;
        let gradient_per_s2 = if known { VERTICAL_PER_S2 } else { 0.0 };
        self.vertical.propagate(
            &ChannelStep {
                seconds: span.seconds,
                gravity_per_s: gradient_per_s2 * span.seconds,
                accel_noise: accel_up,
                ..ChannelStep::default()
            },
            up,
        );
        self.azimuth_walk += gyro_up * span.seconds;
        self.add_manoeuvre_noise(span, config);
    }

    /// Scale errors and misalignments of gyros and accelerometers, as far as they are no parameters, and the
    /// gyros' response to specific force, as process noise: of errors proportional to the turn, or to the
    /// velocity gained, and not to its square root.
    fn add_manoeuvre_noise(&mut self, span: &Span, config: &Config) {
        let up = span.attitude_s.row(2).transpose() / span.seconds;
        let tilt_growth = self.tilt_transient.grow(&(up - self.up), span.seconds);
        self.up = up;
        self.force_mps2 = span.attitude_s.tr_mul(&span.force_mps) / (span.seconds * span.seconds);
        let pulled_mps = (self.force_mps2 - self.level_force_mps2) * span.seconds;
        let pull_growth = self.pull_transient.grow(&pulled_mps, span.seconds);
        let cross = config.sensors.cross_axis_variance();
        let per_mps2 = config.sensors.gyro_g_sensitivity;
        let tilt = cross * tilt_growth + per_mps2 * per_mps2 * pull_growth;
        self.level.add_variance(0.0, tilt);
        self.azimuth_walk += tilt;
        let level_force = Vector3::new(span.force_mps.x, span.force_mps.y, 0.0);
        let force_growth = self.velocity_transient.grow(&level_force, span.seconds);
        self.level.add_variance(cross * force_growth, 0.0);
        // Level force on a tilted platform, as in a steep bank: otherwise the channels are independent.
        self.vertical
            .add_variance((2.0 * cross + self.level.tilt()) * force_growth, 0.0);
    }
}

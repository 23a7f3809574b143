//! From one moment to the next: what the errors do, what a unit of each parameter does, and noise.

use nalgebra::Vector3;

use super::{Observer, UNKNOWN_HEIGHT_M, estimated};
use crate::channel::{Growth, Measured, Renewal};
use crate::config::Config;
use crate::error_model::{
    Forcing, InsError, Passage, RUNAWAY_PER_S2, SCHULER_PER_S2, for_each_input, level_and_up,
};
use crate::history::Span;
use crate::math;
use crate::measurement::Kind;
use crate::parameters::index;
use crate::time::Time;

impl Observer {
    /// The error of the INS after what has happened since the horizon, as estimated.
    pub fn error_after(&self, since: &Span, accel_mps2: &Vector3<f64>) -> InsError {
        let forcing = Forcing::over(since, &self.level_force_mps2, &self.parameters, accel_mps2);
        // The horizon is close: the frame stands still.
        let passage = Passage::over(since, &Vector3::zeros(), &forcing, &self.error().tilt_rad);
        self.followed.error.after(since, &passage, &forcing)
    }

    /// Carries the observer over a span that ends at `to`, in a frame that turns at `frame_rate`.
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
        let passage = Passage::over(span, frame_rate, &forcing, &self.error().tilt_rad);
        self.followed.error = self.followed.error.after(span, &passage, &forcing);
        let azimuth_sigma = self.parameters.sigma(index::AZIMUTH);
        let azimuth = self.followed.error.tilt_rad.z;
        self.parameters.set(index::AZIMUTH, azimuth, azimuth_sigma);

        let [velocity, climb, position, height] = &self.colours;
        let gnss = &config.gnss;
        let lasts = position.lasts();
        let level = [
            Renewal::over(span.seconds, &gnss.velocity_mps, velocity.strength),
            Renewal::over(
                span.seconds / lasts,
                &gnss.position_m,
                position.strength * lasts,
            ),
        ];
        let lasts = self.height_persistence.of(height);
        let up = [
            Renewal::over(span.seconds, &gnss.velocity_up_mps, climb.strength),
            Renewal::over(
                span.seconds / lasts,
                &gnss.height_m,
                height.strength * lasts,
            ),
        ];
        let assumed = height.variance(&gnss.height_m, lasts);
        self.height_sensitivity.renew(&up[1]);
        self.height_persistence.renew(
            &up[1],
            span.seconds / (gnss.height_m.correlation_s * lasts),
            assumed,
            &self.followed.noise(Kind::Height),
            self.vertical.noise(Measured::Position),
        );
        let kept = |renewals: &[Renewal; 2]| renewals.map(|renewal| renewal.keep);
        self.followed.renew(kept(&level), kept(&up));

        let single_passage = passage.single();
        let (level_keep, up_keep) = (kept(&level).map(math::single), kept(&up).map(math::single));
        let responses = estimated(&mut self.responses, &self.corrections);
        for response in responses.iter_mut() {
            response.error.carry(&single_passage);
            response.renew(level_keep, up_keep);
        }
        for_each_input(span, &self.level_force_mps2, |which, input| {
            if let Some(response) = responses.get_mut(which) {
                response.error.feed(&single_passage, &input.single());
            }
        });
        self.grow_noise(span, level, up, config);
        self.unsolved_s += span.seconds;
        self.horizon = to;
    }

    /// Lets the channels grow by the noises, with the correlated ones of GNSS.
    #[inline(never)]
    fn grow_noise(&mut self, span: &Span, level: [Renewal; 2], up: [Renewal; 2], config: &Config) {
        let s = &config.sensors;
        let shares = |noise: &[f64; 3], ratio: f64| {
            let noise = Vector3::from(*noise);
            let variance = noise.component_mul(&noise) * ratio;
            level_and_up(&span.attitude_s, span.seconds, &variance)
        };
        let (gyro_level, gyro_up) = shares(&s.gyro_noise, self.gyro_noise.ratio);
        let (accel_level, accel_up) = shares(&s.accel_noise, 1.0);
        self.gyro_noise
            .came(span.seconds, gyro_level * span.seconds);
        let growth = Growth {
            seconds: span.seconds,
            force_up_mps: span.force_mps.z,
            force_up_moved_m: span.force_moved_m.z,
            gravity_per_s: SCHULER_PER_S2 * span.seconds,
            accel_noise: accel_level,
            gyro_noise: gyro_level,
        };
        self.level.propagate(&growth, level);
        // Gravity tells no height that is not known: a bias of the accelerometer would be shared with it.
        let known = self.vertical.position() < 0.25 * UNKNOWN_HEIGHT_M * UNKNOWN_HEIGHT_M;
        let runaway_per_s2 = if known { RUNAWAY_PER_S2 } else { 0.0 };
        self.vertical.propagate(
            &Growth {
                seconds: span.seconds,
                gravity_per_s: runaway_per_s2 * span.seconds,
                accel_noise: accel_up,
                ..Growth::default()
            },
            up,
        );
        self.azimuth_walk += gyro_up * span.seconds;
        self.doubt_manoeuvre(span, config);
    }

    /// Errors of scale and misalignment turn the platform as the vehicle turns and push it as the
    /// vehicle is pushed. What has no parameter is noise: of an error that grows with the turn
    /// itself, not with its square root.
    fn doubt_manoeuvre(&mut self, span: &Span, config: &Config) {
        let up = span.attitude_s.row(2).transpose() / span.seconds;
        let tipped = self.tipped.grow(&(up - self.up), span.seconds);
        self.up = up;
        self.felt = span.attitude_s.tr_mul(&span.force_mps) / (span.seconds * span.seconds);
        let cross = config.sensors.cross_axis_variance();
        let tilt = cross * tipped;
        self.level.doubt(0.0, tilt);
        self.azimuth_walk += tilt;
        let pull = Vector3::new(span.force_mps.x, span.force_mps.y, 0.0);
        let pulled = self.pulled.grow(&pull, span.seconds);
        self.level.doubt(cross * pulled, 0.0);
        // Level force on a tilted platform, as in a steep bank: the channels are otherwise apart.
        self.vertical
            .doubt((2.0 * cross + self.level.tilt()) * pulled, 0.0);
    }
}

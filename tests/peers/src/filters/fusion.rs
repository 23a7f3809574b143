//! `fusion-nav`, as configured by default.

use fusion_nav::prelude::{
    Acceleration, AngularRate, Attitude, Covariance, Eskf, ImuSample, Ned, Position, Propagation,
    Seconds, State, Timestamp, Velocity, VelocityNoise,
};
use ins_core::{GnssFix, Time};

use super::{AtRest, Peer, SAMPLE_S, VELOCITY_SIGMA_MPS, rates_frd, velocity_ned};

/// The filter.
#[derive(Clone)]
pub struct FusionNav(Eskf);

impl Peer for FusionNav {
    type Sample = ImuSample;
    type Fix = (Timestamp, Velocity<Ned>);

    fn new(at_rest: &AtRest) -> Option<Self> {
        let half = |angle: f64| libm::sincosf((0.5 * angle) as f32);
        let (sr, cr) = half(at_rest.roll_rad);
        let (sp, cp) = half(at_rest.pitch_rad);
        let (sy, cy) = half(at_rest.heading_rad);
        let attitude = fusion_nav::Quaternion {
            w: cr * cp * cy + sr * sp * sy,
            x: sr * cp * cy - cr * sp * sy,
            y: cr * sp * cy + sr * cp * sy,
            z: cr * cp * sy - sr * sp * cy,
        };
        let state = State {
            attitude: Attitude::from_body_to_ned(attitude),
            ..State::default()
        };
        // Level 1 deg and heading 3 deg, velocity, position, accelerometers, gyros.
        let sigmas = [
            0.02, 0.02, 0.05, 0.1, 0.1, 0.1, 5.0, 5.0, 5.0, 0.02, 0.02, 0.02, 1e-4, 1e-4, 1e-4,
        ];
        let mut filter = Eskf::default();
        let _: fusion_nav::Alignment = filter
            .initialize_from(
                state,
                Covariance::from_sigmas(sigmas),
                timestamp(at_rest.time),
            )
            .ok()?;
        Some(Self(filter))
    }

    fn sample(sample: &ins_core::ImuSample) -> Option<ImuSample> {
        let narrow = |v: [f64; 3]| v.map(|component| component as f32);
        let (rate, force) = rates_frd(sample);
        Some(ImuSample::from_rates(
            timestamp(sample.time),
            AngularRate::from_array(narrow(rate)),
            Acceleration::from_array(narrow(force)),
            Seconds::from_secs(SAMPLE_S as f32),
        ))
    }

    fn fix(fix: &GnssFix) -> Option<Self::Fix> {
        let [north, east, down] = velocity_ned(fix).map(|component| component as f32);
        Some((timestamp(fix.time), Velocity::ned(north, east, down)))
    }

    fn on_imu(&mut self, sample: ImuSample) -> bool {
        self.0.predict(sample) == Propagation::Propagated
    }

    fn on_gnss(&mut self, (time, velocity): Self::Fix) -> bool {
        let noise = VelocityNoise::from_speed_accuracy(VELOCITY_SIGMA_MPS as f32);
        self.0
            .fuse_gnss_velocity(time, velocity, noise, Position::zero())
            .is_accepted()
    }
}

fn timestamp(time: Time) -> Timestamp {
    Timestamp::from_micros(time.as_micros().max(0).cast_unsigned())
}

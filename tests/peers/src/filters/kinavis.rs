//! `kinavis-ins`, with its tactical-grade noise and standard priors.

use core::time::Duration;

use ins_core::GnssFix;
use kinavis_ins::{GatingPolicy, ImuNoise, ImuSample, InsFilter, InsPriors, Quaternion, Strapdown};
use kinavis_kernel::{
    Angle, Distance, GeodeticPoint, Height, Instant, Ned, Position, Speed, TrueCourse, Utc, Vector3,
};

use super::{AtRest, Peer, SAMPLE_S, VELOCITY_SIGMA_MPS, rates_frd, velocity_ned};

/// The filter.
#[derive(Clone)]
pub struct KinavisIns(InsFilter);

impl Peer for KinavisIns {
    type Sample = ImuSample;
    type Fix = Vector3<Ned, Speed>;

    fn new(at_rest: &AtRest) -> Option<Self> {
        let angle = |radians: f64| Angle::from_degrees(radians.to_degrees()).ok();
        let turns = libm::floor(at_rest.heading_rad.to_degrees() / 360.0);
        let course = TrueCourse::new(at_rest.heading_rad.to_degrees() - 360.0 * turns).ok()?;
        let position = Position::from_degrees(
            at_rest.position.latitude_rad.to_degrees(),
            at_rest.position.longitude_rad.to_degrees(),
        );
        let strapdown = Strapdown::new(
            Instant::<Utc>::from_unix_seconds(0),
            GeodeticPoint::new(position.ok()?, Height::above_ellipsoid(Distance::ZERO)),
            Vector3::new(Speed::ZERO, Speed::ZERO, Speed::ZERO),
            Quaternion::from_euler(angle(at_rest.roll_rad)?, angle(at_rest.pitch_rad)?, course),
        )
        .ok()?;
        Some(Self(InsFilter::new(
            strapdown,
            ImuNoise::tactical(),
            &InsPriors::standard(),
        )))
    }

    fn sample(sample: &ins_core::ImuSample) -> Option<ImuSample> {
        let (rate, force) = rates_frd(sample);
        ImuSample::new(rate, force, Duration::from_secs_f64(SAMPLE_S)).ok()
    }

    fn fix(fix: &GnssFix) -> Option<Self::Fix> {
        let [north, east, down] =
            velocity_ned(fix).map(|mps| Speed::from_metres_per_second(mps).ok());
        Some(Vector3::new(north?, east?, down?))
    }

    fn on_imu(&mut self, sample: ImuSample) -> bool {
        self.0.predict(&sample).is_ok()
    }

    fn on_gnss(&mut self, velocity: Self::Fix) -> bool {
        let Ok(sigma) = Speed::from_metres_per_second(VELOCITY_SIGMA_MPS) else {
            return false;
        };
        self.0
            .update_velocity(velocity, sigma, GatingPolicy::none())
            .is_ok()
    }
}

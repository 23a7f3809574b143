//! Ours and the peers behind one interface, each in its own axes and types.
#![allow(clippy::cast_possible_truncation, reason = "fusion-nav takes f32")]

use std::time::Duration;

use fusion_nav::prelude as fusion;
use ins_core::{Config, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Navigator, Solution};
use kinavis_ins as kinavis;
use kinavis_kernel as kernel;

/// One inertial sample and one velocity fix at a time. Both say whether they were taken.
pub trait Estimator: Clone {
    const NAME: &str;
    fn on_imu(&mut self, sample: &Sample) -> bool;
    fn on_gnss(&mut self, sample: &Fix) -> bool;
}

/// An inertial sample in the form of each estimator, so that conversion is not timed.
pub struct Sample {
    ours: ImuSample,
    fusion: fusion::ImuSample,
    kinavis: kinavis::ImuSample,
}

impl Sample {
    /// From a sample of increments that took `seconds`.
    pub fn new(ours: ImuSample, seconds: f64) -> Self {
        // Right-forward-up to forward-right-down.
        let frd = |v: nalgebra::Vector3<f64>| [v.y / seconds, v.x / seconds, -v.z / seconds];
        let (rate, force) = (frd(ours.gyro), frd(ours.accel));
        let narrow = |v: [f64; 3]| v.map(|component| component as f32);
        let over = Duration::from_secs_f64(seconds);
        Self {
            ours,
            fusion: fusion::ImuSample::from_rates(
                timestamp(ours.time),
                fusion::AngularRate::from_array(narrow(rate)),
                fusion::Acceleration::from_array(narrow(force)),
                fusion::Seconds::from_secs(seconds as f32),
            ),
            kinavis: kinavis::ImuSample::new(rate, force, over).expect("the simulation is finite"),
        }
    }
}

/// A fix in the form of each estimator.
pub struct Fix {
    ours: GnssFix,
    fusion: (fusion::Timestamp, fusion::Velocity<fusion::Ned>),
    kinavis: kernel::Vector3<kernel::Ned, kernel::Speed>,
}

impl Fix {
    /// From a fix with a velocity. Fusion-nav has to be told the latency.
    pub fn new(ours: GnssFix, latency_s: f64) -> Self {
        let level = ours
            .velocity_en_mps
            .expect("the simulated receiver gives velocity");
        let down = -ours.velocity_up_mps.expect("and its vertical part");
        let speed = |mps| kernel::Speed::from_metres_per_second(mps).expect("finite");
        Self {
            ours,
            fusion: (
                timestamp(ours.time.plus_seconds(-latency_s)),
                fusion::Velocity::ned(level.y as f32, level.x as f32, down as f32),
            ),
            kinavis: kernel::Vector3::new(speed(level.y), speed(level.x), speed(down)),
        }
    }

    pub fn time(&self) -> ins_core::Time {
        self.ours.time
    }
}

fn timestamp(time: ins_core::Time) -> fusion::Timestamp {
    fusion::Timestamp::from_micros(u64::try_from(time.as_micros()).expect("no negative stamps"))
}

impl Estimator for Navigator {
    const NAME: &str = "ins-core";

    fn on_imu(&mut self, sample: &Sample) -> bool {
        Self::on_imu(self, &sample.ours) == ImuOutcome::Accepted
    }

    fn on_gnss(&mut self, fix: &Fix) -> bool {
        matches!(
            Self::on_gnss(self, &fix.ours),
            GnssOutcome::Accepted | GnssOutcome::Queued
        )
    }
}

/// Ours, as shipped for the class of the simulated sensors.
pub fn ours(config: Config) -> Navigator {
    Navigator::new(config).expect("a preset is valid")
}

impl Estimator for fusion::Eskf {
    const NAME: &str = "fusion-nav";

    fn on_imu(&mut self, sample: &Sample) -> bool {
        self.predict(sample.fusion) == fusion::Propagation::Propagated
    }

    fn on_gnss(&mut self, fix: &Fix) -> bool {
        let noise = fusion::VelocityNoise::from_speed_accuracy(SIGMA_MPS as f32);
        let (time, velocity) = fix.fusion;
        self.fuse_gnss_velocity(time, velocity, noise, fusion::Position::zero())
            .is_accepted()
    }
}

/// One sigma of the simulated receiver's velocity, m/s.
const SIGMA_MPS: f64 = 0.1;

/// Fusion-nav as configured by default, at rest with the true attitude.
pub fn fusion_nav(start: &Solution) -> fusion::Eskf {
    let e = start.euler();
    let half = |angle: f64| ((0.5 * angle).sin() as f32, (0.5 * angle).cos() as f32);
    let (sr, cr) = half(e.roll_rad);
    let (sp, cp) = half(e.pitch_rad);
    let (sy, cy) = half(e.heading_rad);
    let attitude = fusion_nav::Quaternion {
        w: cr * cp * cy + sr * sp * sy,
        x: sr * cp * cy - cr * sp * sy,
        y: cr * sp * cy + sr * cp * sy,
        z: cr * cp * sy - sr * sp * cy,
    };
    let state = fusion::State {
        attitude: fusion::Attitude::from_body_to_ned(attitude),
        ..fusion::State::default()
    };
    // Attitude 1 deg and 3 deg of heading, velocity, position, accelerometer, gyro.
    let sigmas = [
        0.02, 0.02, 0.05, 0.1, 0.1, 0.1, 5.0, 5.0, 5.0, 0.02, 0.02, 0.02, 1e-4, 1e-4, 1e-4,
    ];
    let mut filter = fusion::Eskf::default();
    let _: fusion::Alignment = filter
        .initialize_from(
            state,
            fusion::Covariance::from_sigmas(sigmas),
            timestamp(start.time),
        )
        .expect("a finite start");
    filter
}

impl Estimator for kinavis::InsFilter {
    const NAME: &str = "kinavis-ins";

    fn on_imu(&mut self, sample: &Sample) -> bool {
        self.predict(&sample.kinavis).is_ok()
    }

    fn on_gnss(&mut self, fix: &Fix) -> bool {
        let sigma = kernel::Speed::from_metres_per_second(SIGMA_MPS).expect("finite");
        self.update_velocity(fix.kinavis, sigma, kinavis::GatingPolicy::none())
            .is_ok()
    }
}

/// Kinavis-ins with its tactical-grade noise and standard priors, at rest with the true attitude.
pub fn kinavis_ins(start: &Solution) -> kinavis::InsFilter {
    let e = start.euler();
    let angle = |radians: f64| kernel::Angle::from_degrees(radians.to_degrees()).expect("finite");
    let course = kernel::TrueCourse::new(e.heading_rad.to_degrees().rem_euclid(360.0));
    let point = kernel::GeodeticPoint::new(
        kernel::Position::from_degrees(
            start.position.latitude_rad.to_degrees(),
            start.position.longitude_rad.to_degrees(),
        )
        .expect("a place on Earth"),
        kernel::Height::above_ellipsoid(kernel::Distance::ZERO),
    );
    let still = kernel::Vector3::new(
        kernel::Speed::ZERO,
        kernel::Speed::ZERO,
        kernel::Speed::ZERO,
    );
    let attitude = kinavis::Quaternion::from_euler(
        angle(e.roll_rad),
        angle(e.pitch_rad),
        course.expect("within a turn"),
    );
    let strapdown = kinavis::Strapdown::new(
        kernel::Instant::<kernel::Utc>::from_unix_seconds(0),
        point,
        still,
        attitude,
    )
    .expect("a place on Earth");
    kinavis::InsFilter::new(
        strapdown,
        kinavis::ImuNoise::tactical(),
        &kinavis::InsPriors::standard(),
    )
}

//! kinavis-ins as an algorithm under test, told the noise and the spreads of the unit. It fuses
//! what is true now: a position is moved along by its velocity over the latency.

mod lines;

use std::time::Duration;

use kinavis_ins::{GatingPolicy, ImuNoise, ImuSample, InsFilter, InsPriors, Quaternion, Strapdown};
use kinavis_kernel::{Angle, Distance, GeodeticPoint, Height, Instant, Ned, Position, Speed};
use kinavis_kernel::{KernelError, TrueCourse, Utc, Vector3};
use lines::{Filter, Start, State, Unit};

/// With the latency, the sigmas of position and height, and that of velocity.
struct KinavisIns(InsFilter, f64, [Distance; 2], Speed);

type Result<T> = std::result::Result<T, KernelError>;

fn velocity(ned: [f64; 3]) -> Result<Vector3<Ned, Speed>> {
    let [n, e, d] = ned.map(Speed::from_metres_per_second);
    Ok(Vector3::new(n?, e?, d?))
}

fn point([lat, lon, h]: [f64; 3]) -> Result<GeodeticPoint> {
    let (place, height) = (Position::from_degrees(lat, lon)?, Distance::from_metres(h)?);
    Ok(GeodeticPoint::new(place, Height::above_ellipsoid(height)))
}

fn begin(unit: &Unit, start: &Start) -> Result<KinavisIns> {
    let [position, ned, [roll, pitch, heading]] = start.state;
    let [roll, pitch] = [roll, pitch].map(Angle::from_degrees);
    let course = TrueCourse::new(heading.rem_euclid(360.0))?;
    let attitude = Quaternion::from_euler(roll?, pitch?, course);
    let clock = Instant::<Utc>::from_unix_seconds(0);
    let strapdown = Strapdown::new(clock, point(position)?, velocity(ned)?, attitude)?;
    let least = |sigma: f64| sigma.max(1e-9); // It takes no zero.
    let walks = [unit.gyro_bias_walk, unit.accel_bias_walk].map(least);
    let noise = ImuNoise::new(unit.gyro_noise, unit.accel_noise, walks[0], walks[1])?;
    let [level, heading] = [start.level_deg, start.heading_deg].map(Angle::from_degrees);
    let place = Distance::from_metres(start.position_m)?;
    let speed = Speed::from_metres_per_second(start.velocity_mps)?;
    let [gyro, accel] = [unit.gyro_bias, unit.accel_bias].map(least);
    let priors = InsPriors::new(place, place, speed, level?, heading?, gyro, accel)?;
    let filter = InsFilter::new(strapdown, noise, &priors);
    let [level, up] = [unit.position_sigma, unit.height_sigma].map(Distance::from_metres);
    let speed = Speed::from_metres_per_second(unit.velocity_sigma)?;
    Ok(KinavisIns(filter, unit.latency, [level?, up?], speed))
}

impl Filter for KinavisIns {
    fn start(unit: &Unit, start: &Start) -> Option<Self> {
        begin(unit, start).ok()
    }

    fn imu(&mut self, _t: f64, dt: f64, theta: [f64; 3], dv: [f64; 3]) {
        let (rate, force) = (theta.map(|angle| angle / dt), dv.map(|speed| speed / dt));
        let sample = ImuSample::new(rate, force, Duration::from_secs_f64(dt));
        let _ = sample.map(|sample| self.0.predict(&sample));
    }

    fn gnss(&mut self, _t: f64, position: Option<[f64; 3]>, ned: Option<[f64; 3]>) {
        let Self(filter, latency, [level, up], speed) = self;
        let gate = GatingPolicy::none();
        let now = |position| point(lines::moved(position, ned.unwrap_or_default(), *latency));
        if let Some(Ok(place)) = position.map(now) {
            let _ = filter.update_point(place, *level, *up, gate);
        }
        if let Some(Ok(ned)) = ned.map(velocity) {
            let _ = filter.update_velocity(ned, *speed, gate);
        }
    }

    fn solution(&self) -> Option<State> {
        let (v, a) = (self.0.velocity(), self.0.attitude());
        let point = self.0.nominal().point().ok()?;
        let (place, height) = (point.position(), point.height().value().metres());
        let (lat, lon) = (place.latitude().degrees(), place.longitude().degrees());
        let ned = [v.north(), v.east(), v.down()].map(Speed::metres_per_second);
        let [roll, pitch, yaw] = [a.roll.degrees(), a.pitch.degrees(), a.yaw.degrees()];
        Some([[lat, lon, height], ned, [roll, pitch, yaw]])
    }
}

pub fn main() -> std::io::Result<()> {
    lines::serve::<KinavisIns>()
}

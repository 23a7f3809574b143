//! The scenario of one run. A kind modifies a plain scenario.

use core::f64::consts::PI;

use ins_core::earth::Geodetic;
use nalgebra::{Unit, UnitQuaternion, Vector3};

use crate::log::Grade;
use crate::sim::car::{Car, RouteBounds};
use crate::sim::drive::{Recording, truth_stride};
use crate::sim::errors::{ErrorModel, Outage};
use crate::sim::motion::{Envelope, Harmonic, Mounted, Oscillating, Slip};
use crate::sim::noise::Random;
use crate::sim::receiver::{Correlated, Habits, Outliers, Stated, Trouble, Wrong};
use crate::sim::vehicles::{Anchored, Begin, Boat, Plane, Quadrotor, Walker};
use crate::sim::{Motion, SimulatedDrive, record};

/// Sigma of the correlated noise of positions, m, and its correlation time, s: as of recorded receivers without
/// corrections, half a metre to some metres over a minute to some minutes (`study logs`).
const WANDER_M: [f64; 2] = [0.5, 2.0];
const WANDER_S: [f64; 2] = [30.0, 300.0];

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Vehicle {
    /// A car that leans `lean` times as far as a family car; it begins at rest for a time between the
    /// bounds, s, or in motion.
    Car { rest_s: Option<[f64; 2]>, lean: f64 },
    /// A family car on a motorway, beginning in the bend of its ramp.
    Motorway,
    /// A vehicle on a route of straights and turns, on wheels or wings.
    OnRoute(RouteBounds),
    /// A boat at anchor that then sails.
    Boat(Anchored),
    /// An aircraft whose turns are banked between two angles, rad.
    Plane { bank_rad: [f64; 2], begin: Begin },
    /// A quadrotor that is on the ground for a time first, s, or flies from the start.
    Quadrotor { ground_s: Option<f64> },
    /// A person who stands still for a time first, s.
    Walker { rest_s: f64 },
}

impl Vehicle {
    /// A family car that begins in motion.
    pub const MOVING_CAR: Self = Self::Car {
        rest_s: None,
        lean: 1.0,
    };
}

/// One run's vehicle, mount, unit and receiver.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub seed: u64,
    pub class: Grade,
    pub minutes: f64,
    pub imu_hz: f64,
    pub origin: Geodetic,
    pub vehicle: Vehicle,
    /// Superposed vibration and slow oscillation.
    pub vibration: Vec<(Envelope, Vec<Harmonic>)>,
    /// From the axes of the unit to those of the vehicle.
    pub mount: UnitQuaternion<f64>,
    /// Change of the mount during the run; requires the antenna to be on the unit.
    pub slip: Option<Slip>,
    /// Antenna from the unit in the axes of the vehicle, right, forward, up, m.
    pub antenna_m: Vector3<f64>,
    pub errors: ErrorModel,
    /// Random numbers of the kind.
    pub random: Random,
}

impl Scenario {
    /// A car with 30 to 60 s of rest first and a plain receiver, unit level, antenna on it.
    pub fn plain(class: Grade, seed: u64, minutes: f64, kind: &str) -> Self {
        let mut random = Random::stream(seed, kind);
        let mut scenario = Self {
            // Kinds with the same units and routes would not be independent.
            seed: random.whole(),
            class,
            minutes,
            imu_hz: 100.0,
            origin: Geodetic {
                latitude_rad: 48.1_f64.to_radians(),
                longitude_rad: 11.6_f64.to_radians(),
                height_m: 500.0,
            },
            vehicle: Vehicle::Car {
                rest_s: Some([30.0, 60.0]),
                lean: 1.0,
            },
            vibration: Vec::new(),
            mount: UnitQuaternion::identity(),
            slip: None,
            antenna_m: Vector3::zeros(),
            errors: class.errors(),
            random,
        };
        scenario.habits().stated = Stated::White;
        // A stream of its own leaves the other draws of a kind unchanged.
        let mut wander = Random::stream(seed, &format!("{kind} wander"));
        scenario.wander(wander.log_uniform(WANDER_M), wander.log_uniform(WANDER_S));
        scenario
    }

    pub fn duration_s(&self) -> f64 {
        60.0 * self.minutes
    }

    /// Antenna from the unit in the axes of the unit, m.
    pub fn lever_arm_m(&self) -> Vector3<f64> {
        self.mount.inverse() * self.antenna_m
    }

    pub fn simulate(&self) -> SimulatedDrive {
        let mut errors = self.errors.clone();
        errors.gnss.habits.lever_arm_m = self.lever_arm_m().into();
        // With the unit pointing up or down, heading is undefined.
        let forward = self.mount * Vector3::y();
        if forward.z.abs() > 0.7 {
            errors.given_heading_sigma_deg = None;
        }
        let recording = Recording {
            seed: self.seed,
            duration_s: self.duration_s(),
            imu_hz: self.imu_hz,
            truth_every: truth_stride(self.imu_hz),
            origin: self.origin,
            errors,
        };
        record(self.motion(), &recording)
    }

    pub fn motion(&self) -> Box<dyn Motion> {
        let (seed, duration_s) = (self.seed, self.duration_s());
        let mut motion: Box<dyn Motion> = match self.vehicle {
            Vehicle::Car { rest_s, lean } => {
                Box::new(Car::new(seed, duration_s, rest_s).leaning(lean))
            }
            Vehicle::Motorway => Box::new(Car::on_motorway(seed, duration_s)),
            Vehicle::OnRoute(route) => Box::new(Car::on_route(seed, duration_s, &route)),
            Vehicle::Boat(anchored) => Box::new(Boat::new(seed, duration_s, anchored)),
            Vehicle::Plane { bank_rad, begin } => {
                Box::new(Plane::new(seed, duration_s, bank_rad, begin))
            }
            Vehicle::Quadrotor { ground_s } => Box::new(Quadrotor::new(seed, duration_s, ground_s)),
            Vehicle::Walker { rest_s } => Box::new(Walker::new(seed, duration_s, rest_s)),
        };
        for (envelope, harmonics) in &self.vibration {
            motion = Box::new(Oscillating::new(motion, harmonics, *envelope, seed));
        }
        Box::new(Mounted::new(motion, self.mount).slipping(self.slip))
    }

    // --- building blocks of kinds ---

    pub fn habits(&mut self) -> &mut Habits {
        &mut self.errors.gnss.habits
    }

    /// Rate of fixes, and the noise of their velocities and positions.
    pub fn receiver(&mut self, rate_hz: f64, velocity: [f64; 3], position: [f64; 3]) {
        self.errors.gnss.rate_hz = rate_hz;
        self.noise(velocity, position);
    }

    /// Noise of velocity and position: white sigma, correlated sigma, correlation time.
    pub fn noise(&mut self, velocity: [f64; 3], position: [f64; 3]) {
        self.velocity_noise(velocity);
        self.position_noise(position);
    }

    pub fn velocity_noise(&mut self, [white_mps, sigma, time_s]: [f64; 3]) {
        self.errors.gnss.velocity_sigma_mps = white_mps;
        self.habits().velocity = Correlated { sigma, time_s };
    }

    /// The noise of height is 1.5 times as large.
    pub fn position_noise(&mut self, [white_m, sigma, time_s]: [f64; 3]) {
        self.errors.gnss.horizontal_sigma_m = white_m;
        self.errors.gnss.vertical_sigma_m = 1.5 * white_m;
        self.wander(sigma, time_s);
    }

    /// A receiver whose positions do not wander.
    pub fn all_white(&mut self) {
        self.wander(0.0, 1.0);
    }

    /// The correlated part of position noise only.
    fn wander(&mut self, sigma: f64, time_s: f64) {
        self.habits().horizontal = Correlated { sigma, time_s };
        self.habits().vertical = Correlated {
            sigma: 1.5 * sigma,
            time_s,
        };
    }

    /// Mounts the unit rotated about a random axis, by an angle within bounds, deg.
    pub fn tilt_mount(&mut self, degrees: [f64; 2]) {
        self.mount = UnitQuaternion::from_scaled_axis(self.random_rotation(degrees));
    }

    /// Rotation vector, rad, with a random axis and an angle within bounds, deg.
    fn random_rotation(&mut self, degrees: [f64; 2]) -> Vector3<f64> {
        let axis = Unit::new_normalize(Vector3::from(self.random.normal3()));
        axis.into_inner() * self.random.uniform(degrees).to_radians()
    }

    /// The mount slips about a random axis, by an angle within bounds, deg, in the third quarter of the run;
    /// `sampled` or in a gap of the inertial samples.
    pub fn slip(&mut self, degrees: [f64; 2], duration_s: f64, sampled: bool) {
        let start_s = self.random.uniform([0.5, 0.65]) * self.duration_s();
        self.slip = Some(Slip {
            start_s,
            duration_s,
            turn_rad: self.random_rotation(degrees),
        });
        if !sampled {
            self.imu_gap(start_s, duration_s);
        }
    }

    /// A gap in the inertial samples.
    pub fn imu_gap(&mut self, start_s: f64, duration_s: f64) {
        self.errors.imu.holes.push(Outage {
            start_s,
            duration_s,
        });
    }

    /// A fixed-wing aircraft with bounds of its bank angle, and the rate of fixes.
    pub fn fixed_wing(&mut self, bank_deg: [f64; 2], begin: Begin, rate_hz: f64) {
        let bank_rad = bank_deg.map(f64::to_radians);
        self.vehicle = Vehicle::Plane { bank_rad, begin };
        self.errors.gnss.rate_hz = rate_hz;
    }

    /// A boat that yaws at anchor, with a peak rate in deg/s, and then sails.
    pub fn boat(&mut self, until_s: f64, period_s: f64, peak_deg_s: f64) {
        let peak_radps = peak_deg_s.to_radians();
        self.vehicle = Vehicle::Boat(Anchored {
            until_s,
            period_s,
            peak_radps,
        });
    }

    /// Misalignment of gyros and accelerometers, one sigma, rad.
    pub fn misaligned(&mut self, sigma_rad: f64) {
        self.errors.gyro_deg_h.misalignment_sigma = sigma_rad;
        self.errors.accel_mps2.misalignment_sigma = sigma_rad;
    }

    /// Random position of the antenna within bounds, right, forward, up, m.
    pub fn antenna_within(&mut self, reach_m: [f64; 3]) {
        let position = reach_m.map(|reach| self.random.uniform([-reach, reach]));
        self.antenna_m = position.into();
    }

    /// Random times from `from_s` on, at intervals of one to two `gap_s`.
    pub fn random_times(&mut self, from_s: f64, gap_s: f64) -> Vec<f64> {
        let mut times = Vec::new();
        let mut now_s = from_s + self.random.uniform([0.0, gap_s]);
        while now_s < self.duration_s() {
            times.push(now_s);
            now_s += gap_s + self.random.uniform([0.0, gap_s]);
        }
        times
    }

    /// A car that leans `lean` times as far as a family car, after a rest.
    pub fn leaning(&mut self, lean: f64) {
        let rest_s = Some([30.0, 60.0]);
        self.vehicle = Vehicle::Car { rest_s, lean };
    }

    /// Independent outliers: their fraction, and one sigma of their errors.
    pub fn outliers(&mut self, fraction: f64, velocity_mps: f64, position_m: f64) {
        self.habits().outliers = Outliers {
            fraction,
            velocity_mps,
            position_m,
        };
    }

    /// The same fault at random times from `from_s` on, with random durations within bounds.
    pub fn random_faults(&mut self, from_s: f64, gap_s: f64, duration_s: [f64; 2], wrong: Wrong) {
        for start_s in self.random_times(from_s, gap_s) {
            let duration_s = self.random.uniform(duration_s);
            self.faults(&[start_s], duration_s, wrong);
        }
    }

    /// Float ambiguities at random times, with random durations within bounds: positions then have an
    /// offset of `off_m`.
    pub fn float_ambiguities(&mut self, gap_s: f64, off_m: f64, duration_s: [f64; 2]) {
        for start_s in self.random_times(60.0, gap_s) {
            let duration_s = self.random.uniform(duration_s);
            let wrong = Wrong::Float(self.horizontal_vector(off_m));
            self.faults(&[start_s], duration_s, wrong);
        }
    }

    /// The same fault at each of the times.
    pub fn faults(&mut self, times: &[f64], duration_s: f64, wrong: Wrong) {
        let troubles = times.iter().map(|start_s| Trouble {
            start_s: *start_s,
            duration_s,
            wrong,
        });
        self.habits().troubles.extend(troubles);
    }

    /// An outage of GNSS at each of the times.
    pub fn outages(&mut self, times: &[f64], duration_s: f64) {
        let outages = times.iter().map(|start_s| Outage {
            start_s: *start_s,
            duration_s,
        });
        self.errors.gnss.outages.extend(outages);
    }

    /// Horizontal vector of random direction.
    pub fn horizontal_vector(&mut self, length: f64) -> [f64; 3] {
        let (sin, cos) = libm::sincos(PI * self.random.uniform([-1.0, 1.0]));
        [length * sin, length * cos, 0.0]
    }
}

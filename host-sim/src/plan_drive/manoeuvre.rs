//! Manoeuvres, as motion and in words for the driver.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::sim::car::DriveProfile;
use crate::sim::noise::Random;

/// A minute or so of driving, from the final speed of the last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Manoeuvre {
    Stand,
    StartAndBrake,
    Cruise,
    Block,
    ThereAndBack,
    Roundabout,
    FigureEight,
    Hill,
}

/// Times to apply pedal and steering, s: the middle of those of the simulated driver.
const PEDAL_S: f64 = 1.1;
const STEERING_S: f64 = 1.3;
/// Brisk, but comfortable lateral acceleration, m/s^2.
const LATERAL_MPS2: f64 = 2.5;
/// Radii of a street corner, of a half turn or a figure of eight on a wide road, and of a
/// roundabout, m.
const CORNER_M: f64 = 10.0;
const CIRCLE_M: f64 = 8.0;
const ROUNDABOUT_M: f64 = 20.0;
/// At a stand, at a steady speed, and between one pedal and the other, s.
const STAND_S: f64 = 30.0;
const CRUISE_S: f64 = 30.0;
const HOLD_S: f64 = 3.0;
/// Length of a hill up and down again, and of the change of grade, m.
const HILL_M: f64 = 150.0;
const ROUNDING_M: f64 = 40.0;
/// Relative scatter of a driver.
const SCATTER: f64 = 0.1;

impl Manoeuvre {
    pub fn all() -> impl Iterator<Item = Self> {
        Self::value_variants().iter().copied()
    }

    /// For tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stand => "stand",
            Self::StartAndBrake => "start and brake",
            Self::Cruise => "cruise",
            Self::Block => "round the block",
            Self::ThereAndBack => "there and back",
            Self::Roundabout => "roundabout",
            Self::FigureEight => "figure of eight",
            Self::Hill => "hill",
        }
    }

    /// For the driver.
    pub fn words(self, site: &Site) -> String {
        let kmh = |mps: f64| format!("{:.0} km/h", 3.6 * mps);
        let top = kmh(site.speed_mps());
        let gain = site.speed_mps() / site.acceleration_mps2 + PEDAL_S;
        let slow = match site.slow_mps() {
            0.0 => "to a stop".to_owned(),
            slow => format!("to {}", kmh(slow)),
        };
        match self {
            Self::Stand => {
                format!("Stop and stand still for {STAND_S:.0} s; nobody moves in the car.")
            }
            Self::StartAndBrake => {
                let lose = (site.speed_mps() - site.slow_mps()) / site.braking_mps2 + PEDAL_S;
                format!(
                    "On a straight road: accelerate to {top} within {gain:.0} s, hold it for \
                     {HOLD_S:.0} s, brake {slow} within {lose:.0} s. Twice."
                )
            }
            Self::Cruise => format!("Drive straight at a steady {top} for {CRUISE_S:.0} s."),
            Self::Block => format!(
                "Drive round a block, to the right: between the four corners accelerate to {}, take \
                 each corner at {}.",
                kmh(site.street_mps()),
                kmh(site.round_mps(CORNER_M))
            ),
            Self::ThereAndBack => format!(
                "Accelerate to {top} within {gain:.0} s, slow down to {}, turn round in half a circle \
                 of {CIRCLE_M:.0} m radius; the same back.",
                kmh(site.round_mps(CIRCLE_M))
            ),
            Self::Roundabout => format!(
                "Drive twice round a roundabout of some {ROUNDABOUT_M:.0} m radius at {}.",
                kmh(site.round_mps(ROUNDABOUT_M))
            ),
            Self::FigureEight => format!(
                "Drive a figure of eight at {}: a full circle to the right of {CIRCLE_M:.0} m radius, \
                 then one to the left.",
                kmh(site.round_mps(CIRCLE_M))
            ),
            Self::Hill => format!(
                "Drive up a slope of {:.0} % for some {HILL_M:.0} m and down again at {}.",
                site.slope_percent,
                kmh(site.street_mps())
            ),
        }
    }

    pub(crate) fn drive(self, course: &mut DriveProfile, site: &Site, driver: &mut Driver) {
        let mut builder = CourseBuilder {
            course,
            site,
            driver,
        };
        let top = site.speed_mps();
        match self {
            Self::Stand => {
                builder.come_to(0.0);
                builder.hold(STAND_S);
            }
            Self::StartAndBrake => {
                for _ in 0..2 {
                    builder.come_to(top);
                    builder.hold(HOLD_S);
                    builder.come_to(site.slow_mps());
                    builder.hold(HOLD_S);
                }
            }
            Self::Cruise => {
                builder.come_to(top);
                builder.hold(CRUISE_S);
            }
            Self::Block => {
                for _ in 0..4 {
                    builder.come_to(site.street_mps());
                    builder.hold(HOLD_S);
                    builder.turn(FRAC_PI_2, CORNER_M);
                }
            }
            Self::ThereAndBack => {
                for _ in 0..2 {
                    builder.come_to(top);
                    builder.hold(HOLD_S);
                    builder.turn(PI, CIRCLE_M);
                }
            }
            Self::Roundabout => builder.turn(-2.0 * TAU, ROUNDABOUT_M),
            Self::FigureEight => {
                builder.turn(TAU, CIRCLE_M);
                builder.turn(-TAU, CIRCLE_M);
            }
            Self::Hill => {
                builder.come_to(site.street_mps());
                builder.hill();
            }
        }
    }
}

/// Where and how the vehicle may be driven.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Site {
    pub manoeuvres: Vec<Manoeuvre>,
    pub speed_kmh: f64,
    pub acceleration_mps2: f64,
    pub braking_mps2: f64,
    /// Of the hill.
    pub slope_percent: f64,
    pub longest_minutes: f64,
}

impl Default for Site {
    fn default() -> Self {
        let level = |manoeuvre: &Manoeuvre| *manoeuvre != Manoeuvre::Hill;
        Self {
            manoeuvres: Manoeuvre::all().filter(level).collect(),
            speed_kmh: 50.0,
            acceleration_mps2: 2.0,
            braking_mps2: 2.5,
            slope_percent: 6.0,
            longest_minutes: 40.0,
        }
    }
}

impl Site {
    pub fn speed_mps(&self) -> f64 {
        self.speed_kmh / 3.6
    }

    /// Speed in streets.
    fn street_mps(&self) -> f64 {
        0.6 * self.speed_mps()
    }

    /// Speed at the end of braking: above zero where stops are not allowed.
    fn slow_mps(&self) -> f64 {
        if self.manoeuvres.contains(&Manoeuvre::Stand) {
            0.0
        } else {
            0.3 * self.speed_mps()
        }
    }

    /// Speed in a turn of a radius.
    fn round_mps(&self, radius_m: f64) -> f64 {
        (LATERAL_MPS2 * radius_m).sqrt().min(self.speed_mps())
    }
}

/// A driver, exact or with scatter.
#[derive(Clone, Debug)]
pub struct Driver(Option<Random>);

impl Driver {
    pub fn exact() -> Self {
        Self(None)
    }

    /// With a scatter of some per cent, as people drive.
    pub fn human(seed: u64) -> Self {
        Self(Some(Random::stream(seed, "driver of a plan")))
    }

    /// Initial heading: random, or north if exact.
    pub fn heading_rad(&mut self) -> f64 {
        let circle = [-PI, PI];
        self.0.as_mut().map_or(0.0, |random| random.uniform(circle))
    }

    fn scattered(&mut self, asked: f64) -> f64 {
        let scatter = [1.0 - SCATTER, 1.0 + SCATTER];
        let part = self
            .0
            .as_mut()
            .map_or(1.0, |random| random.uniform(scatter));
        part * asked
    }
}

struct CourseBuilder<'a> {
    course: &'a mut DriveProfile,
    site: &'a Site,
    driver: &'a mut Driver,
}

impl CourseBuilder<'_> {
    fn come_to(&mut self, speed_mps: f64) {
        let to_mps = self.driver.scattered(speed_mps);
        let gains = to_mps > self.course.speed_mps();
        let pedal = if gains {
            self.site.acceleration_mps2
        } else {
            self.site.braking_mps2
        };
        let acceleration = self.driver.scattered(pedal);
        self.course.change_speed(to_mps, acceleration, PEDAL_S);
    }

    fn hold(&mut self, seconds: f64) {
        self.course.now_s += self.driver.scattered(seconds);
    }

    fn turn(&mut self, angle_rad: f64, radius_m: f64) {
        self.come_to(self.site.round_mps(radius_m));
        let rate_radps = self.course.speed_mps() / self.driver.scattered(radius_m);
        self.course.turn(angle_rad, rate_radps, STEERING_S);
    }

    /// Up, down, and level again.
    fn hill(&mut self) {
        let grade_rad = libm::atan(0.01 * self.site.slope_percent);
        for (to_rad, length_m) in [(grade_rad, HILL_M), (-grade_rad, HILL_M), (0.0, 0.0)] {
            self.course.change_grade(to_rad, ROUNDING_M, length_m);
        }
    }
}

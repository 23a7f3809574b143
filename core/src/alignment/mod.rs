//! Alignment: roll and pitch at rest or from a mean in motion, heading by gyrocompassing or from motion.
//!
//! Levelling ends with a heading that is given or gyrocompassed, or else starts a search: a bank of level
//! INS of arbitrary azimuth, each with another initial latency of GNSS, runs behind the sensors until
//! motion shows the heading.

mod bank;
mod candidate;
mod coarse;
mod covariance;
pub mod levelling;
mod nodes;
mod observations;
pub mod rest;

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};

use self::bank::{Answer, Bank, Mixture};
use self::candidate::{Start, largest_gyro_sigma};
use self::coarse::{CoarseLevel, Level};
use self::levelling::{RestMean, UNSEEN_RADPS};
use self::nodes::Nodes;
use self::observations::Observations;
use self::rest::{RestBlock, RestDetector, Verdict};
use crate::attitude::{euler, matrix, turned, up};
use crate::calibration::RUN_S;
use crate::config::{Config, HeadingSource, Noise};
use crate::earth::{GRAVITY_EQUATOR_MPS2, Geodetic, LocalEarth};
use crate::increments::Interval;
use crate::math;
use crate::mechanization::Mechanization;
use crate::outcome::GnssOutcome;
use crate::parameters::{AGREES_SIGMAS, Parameters, index};
use crate::samples::{GnssFix, Heading};
use crate::solution::Phase;
use crate::time::Time;

/// Duration of rest for levelling, and for gyrocompassing, s.
const LEVEL_S: f64 = 8.0;
const GYROCOMPASS_S: f64 = 60.0;
/// Least duration of rest if motion ends it, s.
const LEAST_REST_S: f64 = 2.0;
/// Longest wait for rest beside the rest itself, s; shorter when GNSS shows motion.
const WAIT_S: f64 = 20.0;
const WAIT_MOVING_S: f64 = 3.0;
/// Speed that shows motion beyond doubt, m/s.
pub(crate) const MOVING_MPS: f64 = 1.0;
/// Largest tilt sigma of a level in motion to start the search with, rad: beyond, it is not linear.
const COARSE_TILT_RAD: f64 = 0.15;
/// Ratio of sigmas by which a known latency stands against that of the search.
const KNOWN_BETTER: f64 = 4.0;
/// Tilt sigma of levelling at rest beside that of the accelerometers, rad.
const LEVEL_SIGMA_RAD: f64 = 0.005;
/// Tilt sigma after a gap or with the level of a search that failed, rad.
const RESUMED_TILT_RAD: f64 = 0.1;
/// Largest sigma of a heading to navigate on, rad.
const HEADING_SIGMA_RAD: f64 = 0.3;
/// Time for which a fix separates rest from an even turn, s.
const RECENT_FIX_S: f64 = 3.0;
/// Steps of work a second on nodes, observations and answers: twice as many as arise.
const WORK_PER_S: f64 = 120.0;
/// Largest delay of a measured heading while aligning, s; longest interval of regular ones; and age at
/// which the last expires, since the next is late, too.
const HEADING_DELAY_S: f64 = 1.0;
const HEADING_INTERVAL_S: f64 = 1.5;
const HEADING_OLD_S: f64 = HEADING_DELAY_S + 1.0;
/// Least sigma of one that old, rad.
const LEAST_HEADING_SIGMA_RAD: f64 = 0.01;
/// Age of a fix up to which its position is extrapolated to the start of navigation, s.
const OLDEST_FIX_S: f64 = 5.0;

/// Roll and pitch with their sigma, and, if known, the heading with its own, rad.
struct Levelled {
    level: Level,
    heading: Option<(f64, f64)>,
    source: AttitudeSource,
}

/// Source of the attitude: which sensor biases are correlated with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AttitudeSource {
    /// Motion: none.
    Motion,
    /// Roll and pitch by the accelerometers.
    Level,
    /// And heading by the gyros: the azimuth's sigma is without their biases.
    Gyrocompass,
}

/// Initial INS for navigation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Aligned {
    /// Level, with a heading.
    pub ins: Mechanization,
    /// Sigma of roll and pitch, rad; that of the azimuth is in [`Alignment::known`].
    pub tilt_sigma_rad: f64,
    pub source: AttitudeSource,
    /// Variance of an unmeasured climb, (m/s)^2; else zero.
    pub climb_variance: f64,
    /// Variance of the position beyond that of a first fix, m^2.
    pub position_variance: f64,
}

impl Aligned {
    /// Specific force at rest in this attitude, body, m/s^2.
    pub fn level_force_mps2(&self) -> Vector3<f64> {
        self.ins.local_earth().gravity_mps2 * up(&self.ins.attitude)
    }
}

/// The search for the heading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Search {
    nodes: Nodes,
    bank: Bank,
    /// The candidate that has found it, while it catches up with the sensors.
    found: Option<u8>,
}

/// All live in place: there is nowhere else.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(clippy::large_enum_variant)]
enum Stage {
    Levelling(CoarseLevel),
    /// To begin from this level.
    Begin(Level),
    Searching(Search),
    Aligned(Aligned),
}

/// State of the alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alignment {
    start: Time,
    /// Whether it is the first: a given heading is that of the start.
    first: bool,
    /// Whether the INS before diverged with headings that agreed with it.
    bad_headings: bool,
    known: Parameters,
    /// Time of that.
    known_at: Option<Time>,
    detector: RestDetector,
    rest: RestMean,
    /// Last velocity, ENU, whether its climb is measured, last position and height, and time of the
    /// position.
    velocity_mps: Vector3<f64>,
    climb_known: bool,
    position: Geodetic,
    position_time: Option<Time>,
    /// Variance of position and height since an INS diverged, until fixes measure them again, m^2.
    stale_variance: [f64; 2],
    observations: Observations,
    measured: Option<Heading>,
    stage: Stage,
}

impl Alignment {
    /// Starts with levelling; the known parameters may be of an earlier time.
    #[expect(
        clippy::inline_always,
        reason = "made where it stays: otherwise it is copied over the stack"
    )]
    #[inline(always)]
    pub fn new(start: Time, known_at: Option<Time>, known: &Parameters) -> Self {
        Self {
            start,
            known_at,
            first: true,
            bad_headings: false,
            known: *known,
            detector: RestDetector::default(),
            rest: RestMean::default(),
            velocity_mps: Vector3::zeros(),
            climb_known: false,
            position: Geodetic::default(),
            position_time: None,
            stale_variance: [0.0; 2],
            observations: Observations::default(),
            measured: None,
            stage: Stage::Levelling(CoarseLevel::default()),
        }
    }

    /// Follows on a diverged INS: whether measured headings agreed with it, the variances of its position
    /// and height, and, if only its level is still good, its attitude as a start.
    pub fn begin_again(
        &mut self,
        bad_headings: bool,
        position_variance: [f64; 2],
        left: Option<&Mechanization>,
    ) {
        self.first = false;
        self.bad_headings = bad_headings;
        self.stale_variance = position_variance;
        if let Some(ins) = left {
            self.position = ins.position;
            self.position_time = Some(self.start);
            self.stage = Stage::Begin(resumed(ins.attitude));
        }
    }

    /// How far it has come.
    pub fn phase(&self) -> Phase {
        match self.stage {
            Stage::Levelling(_) => Phase::Levelling,
            Stage::Begin(_) | Stage::Searching(_) | Stage::Aligned(_) => Phase::FindingHeading,
        }
    }

    /// Parameters as known.
    pub fn known(&self) -> &Parameters {
        &self.known
    }

    /// Starts at `time`, before which inertial samples are missing.
    pub fn begin_at(&mut self, time: Time) {
        let level = match &self.stage {
            Stage::Begin(level) => Some(*level),
            Stage::Searching(search) => search.bank.leader().map(|c| resumed(*c.attitude())),
            Stage::Levelling(_) | Stage::Aligned(_) => None,
        };
        self.restart(time);
        if let Some(level) = level {
            self.stage = Stage::Begin(level);
        }
    }

    /// Unobserved until `time`: a given heading still holds if the vehicle stood.
    pub fn on_outage(&mut self, time: Time) {
        self.first &= self.moved_s(time) <= 0.0;
    }

    /// Restarts levelling; the parameters stay.
    #[inline(never)]
    pub fn restart(&mut self, time: Time) {
        self.start = time;
        self.detector = RestDetector::default();
        self.rest = RestMean::default();
        self.observations = Observations::default();
        self.measured = None;
        self.stage = Stage::Levelling(CoarseLevel::default());
    }

    /// Variance of position and height since an INS diverged, until fixes measure them again, m^2.
    pub fn stale_variance(&self) -> &[f64; 2] {
        &self.stale_variance
    }

    /// The INS to start from, once aligned.
    pub fn aligned(&self) -> Option<&Aligned> {
        match &self.stage {
            Stage::Aligned(aligned) => Some(aligned),
            _ => None,
        }
    }

    /// Takes the interval that ends at `time`.
    pub fn on_interval(&mut self, time: Time, interval: &Interval, config: &Config) {
        let verdict = self.detector.on_interval(interval);
        if verdict.is_some() {
            self.age_parameters(time, config);
        }
        match &self.stage {
            Stage::Levelling(_) => self.continue_levelling(time, interval, verdict, config),
            Stage::Begin(level) => {
                let level = *level;
                self.start_search(time, &level, config);
            }
            Stage::Searching(_) => {
                self.continue_search(time, interval, config);
                if let Some(verdict) = verdict {
                    self.relevel(time, verdict, config);
                }
            }
            Stage::Aligned(_) => {}
        }
    }

    /// Takes a fix; what it does not have stays as it was.
    #[inline(never)]
    pub fn on_fix(&mut self, fix: &GnssFix, config: &Config) {
        let last = &self.velocity_mps;
        let level = fix.velocity_en_mps.unwrap_or(last.xy());
        self.velocity_mps = level.push(fix.velocity_up_mps.unwrap_or(last.z));
        self.climb_known |= fix
            .velocity_up_mps
            .is_some_and(|up_mps| math::abs(up_mps) > 0.0);
        if let Some(position_time) = self.position_time
            && fix.position.is_none()
        {
            let since_s = fix.time.seconds_since(position_time);
            if math::abs(since_s) < OLDEST_FIX_S {
                let mut ins = Mechanization::new(
                    self.position,
                    self.velocity_mps,
                    UnitQuaternion::identity(),
                );
                ins.extrapolate(since_s);
                self.position = ins.position;
                self.position_time = Some(fix.time);
            }
        }
        self.position = fix.position_or(&self.position);
        let [position, height] = &mut self.stale_variance;
        let gnss = &config.gnss;
        if fix.position.is_some() {
            self.position_time = Some(fix.time);
            *position = beyond(fix.sigma.position_m, &gnss.position_m);
        }
        if fix.height_m.is_some() {
            *height = beyond(fix.sigma.height_m, &gnss.height_m);
        }
        if fix.is_moving(gnss.velocity_mps.white) {
            self.detector.on_motion();
        }
        let Some(observation) = self.observations.add(fix, config) else {
            return;
        };
        let mut seen_mps = Vector2::zeros();
        if observation.is_moving() {
            self.detector.on_motion();
            seen_mps = observation.velocity_mps.map(f64::from);
        }
        if fix.velocity_en_mps.is_none() {
            self.velocity_mps = seen_mps.push(self.velocity_mps.z);
        }
        match &mut self.stage {
            Stage::Levelling(coarse) => {
                coarse.on_velocity(&observation.velocity_mps.map(f64::from));
            }
            Stage::Searching(Search {
                bank, found: None, ..
            }) => bank.on_observation(&observation, self.observations.count() - 1),
            _ => {}
        }
    }

    /// Takes a measured heading; `now` is the last inertial stamp.
    pub fn on_heading(&mut self, now: Time, heading: &Heading) -> GnssOutcome {
        let ago_s = now.seconds_since(heading.time);
        if ago_s > HEADING_DELAY_S {
            return GnssOutcome::TooOld;
        }
        if ago_s < -HEADING_DELAY_S {
            return GnssOutcome::TooFarAhead;
        }
        if heading.sigma_rad > HEADING_SIGMA_RAD {
            return GnssOutcome::OutOfRange;
        }
        if self.bad_headings {
            return GnssOutcome::Outlier;
        }
        // There will be one at the end of levelling, too.
        let follows = |last: Heading| heading.time.seconds_since(last.time) <= HEADING_INTERVAL_S;
        let seeks = matches!(self.stage, Stage::Searching(Search { found: None, .. }));
        if seeks && self.measured.is_some_and(follows) {
            self.restart(now);
        }
        self.measured = Some(*heading);
        GnssOutcome::Accepted
    }

    /// Heading at the end of levelling relative to that of the level, with its sigma: a measured one,
    /// extrapolated by the present rate, or the given one of the start, with the turn since that is not in
    /// the level.
    #[inline(never)]
    fn heading(
        &self,
        time: Time,
        level: &Level,
        turning_radps: f64,
        turned_rad: f64,
        config: &Config,
    ) -> Option<(f64, f64)> {
        let recent =
            |measured: &Heading| math::abs(time.seconds_since(measured.time)) <= HEADING_OLD_S;
        if let Some(measured) = self.measured.filter(recent) {
            // Half as much or half as much again, where a turn begins or ends.
            let since_rad = turning_radps * time.seconds_since(measured.time);
            let spread = 0.25 * since_rad * since_rad + measured.sigma_rad * measured.sigma_rad;
            let sigma_rad = math::max(math::sqrt(spread), LEAST_HEADING_SIGMA_RAD);
            let level_rad = euler(&level.attitude).heading_rad;
            return Some((measured.heading_rad + since_rad - level_rad, sigma_rad));
        }
        match config.heading {
            HeadingSource::Given(heading_rad) if self.first => {
                let drift_rad = self.moved_s(time) * largest_gyro_sigma(&self.known, config);
                Some((heading_rad + turned_rad, HEADING_SIGMA_RAD + drift_rad))
            }
            _ => None,
        }
    }

    /// Duration of levelling in motion, s; zero if within the detection time of rest.
    #[inline(never)]
    fn moved_s(&self, time: Time) -> f64 {
        let seconds = time.seconds_since(self.start) - self.rest.seconds;
        if seconds > WAIT_MOVING_S {
            seconds
        } else {
            0.0
        }
    }

    /// Process noise of the parameters up to now: bias walks, clock drift.
    #[inline(never)]
    fn age_parameters(&mut self, time: Time, config: &Config) {
        let last = self.known_at.replace(time).unwrap_or(time);
        // Clocks may have been set meanwhile.
        let seconds = math::clamp(time.seconds_since(last), [0.0, RUN_S]);
        let known = &mut self.known;
        known.shift(index::LATENCY, seconds * known.value(index::CLOCK_DRIFT));
        let drifted_s = seconds * known.sigma(index::CLOCK_DRIFT);
        known.widen(index::LATENCY, drifted_s * drifted_s);
        let s = &config.sensors;
        for axis in 0..3 {
            known.widen(
                index::GYRO + axis,
                s.gyro_bias_walk * s.gyro_bias_walk * seconds,
            );
            known.widen(
                index::ACCEL + axis,
                s.accel_bias_walk * s.accel_bias_walk * seconds,
            );
        }
    }

    /// The interval, compensated by the known parameters.
    pub fn compensated(&self, interval: &Interval) -> Interval {
        interval.without_bias(
            &self.known.vector(index::GYRO),
            &self.known.vector(index::ACCEL),
        )
    }

    /// Levelling takes an interval.
    #[inline(never)]
    fn continue_levelling(
        &mut self,
        time: Time,
        interval: &Interval,
        verdict: Option<Verdict>,
        config: &Config,
    ) {
        let interval = self.compensated(interval);
        if let Stage::Levelling(coarse) = &mut self.stage {
            coarse.on_interval(&interval);
        }
        if let Some(level) = verdict.and_then(|verdict| self.level(time, &verdict, config)) {
            self.end_levelling(time, &level, config);
        }
    }

    /// Levels after enough rest, or when waiting for it is in vain.
    #[inline(never)]
    fn level(&mut self, time: Time, verdict: &Verdict, config: &Config) -> Option<Levelled> {
        if let Verdict::Rest(block) = verdict {
            self.add_rest(time, block, config);
        }
        let moving = verdict.moves();
        let Some(earth) = self.earth() else {
            // Rest before unobserved motion says nothing of the attitude after it.
            if moving {
                self.rest = RestMean::default();
            }
            return None;
        };
        let compass = config.heading == HeadingSource::Auto
            && levelling::gyrocompass_sigma(&config.sensors, &earth, GYROCOMPASS_S)
                < HEADING_SIGMA_RAD;
        let wanted = if compass { GYROCOMPASS_S } else { LEVEL_S };
        if self.rest.seconds >= wanted || (moving && self.rest.seconds >= LEAST_REST_S) {
            return Some(self.level_from_rest(time, &earth, config));
        }
        self.level_in_motion(time, verdict, config)
    }

    /// Level by a mean in motion that is good enough, or as good as it gets.
    fn level_in_motion(&self, time: Time, verdict: &Verdict, config: &Config) -> Option<Levelled> {
        let waited = time.seconds_since(self.start);
        let speed = self.observations.speed_mps();
        let in_vain = waited - self.rest.seconds > WAIT_S;
        let moves = waited > WAIT_MOVING_S && verdict.moves() && speed > MOVING_MPS;
        if !in_vain && !moves {
            return None;
        }
        let Stage::Levelling(coarse) = &self.stage else {
            return None;
        };
        let level = coarse.level(largest_gyro_sigma(&self.known, config))?;
        let good = level.tilt_sigma_rad < COARSE_TILT_RAD || (in_vain && coarse.is_long());
        let rate_radps = verdict.block().rate_radps - self.known.vector(index::GYRO);
        let turning_radps = -(matrix(&level.attitude) * rate_radps).z;
        good.then(|| Levelled {
            heading: self.heading(time, &level, turning_radps, 0.0, config),
            level,
            source: AttitudeSource::Level,
        })
    }

    /// Takes a block of rest; if the gyro biases have changed, the known ones are dropped. An even turn
    /// looks alike: only GNSS separates it from rest. Whether it was taken.
    fn add_rest(&mut self, time: Time, block: &RestBlock, config: &Config) -> bool {
        let agrees = self.rest.agrees(block, &config.sensors);
        let off = math::largest(&(block.rate_radps - self.known.vector(index::GYRO)));
        let credible = UNSEEN_RADPS + largest_gyro_sigma(&self.known, config);
        let recent = |last: Time| time.seconds_since(last) < RECENT_FIX_S;
        if !((agrees && off < AGREES_SIGMAS * credible)
            || self.observations.last().is_some_and(recent))
        {
            return false;
        }
        if !agrees {
            self.rest = RestMean::default();
            for which in index::GYRO..index::ACCEL {
                let value = self.known.value(which);
                self.known.set(which, value, config.sensors.gyro_bias_radps);
            }
        }
        self.rest.add(block);
        true
    }

    fn level_from_rest(&mut self, time: Time, earth: &LocalEarth, config: &Config) -> Levelled {
        let rest = self.rest;
        let force_mps2 = rest.force_mps2 - self.known.vector(index::ACCEL);
        let before = self.known.vector(index::GYRO);
        let level_attitude = levelling::level(&force_mps2, 0.0);
        let attitude = matrix(&level_attitude);
        self.learn_gyros(&rest, &attitude, earth, config);
        // Turn before it stood, less the drift by the bias that rest has shown.
        let moved_s = self.moved_s(time);
        let turned_rad = match &self.stage {
            Stage::Levelling(coarse) if moved_s > 0.0 => {
                let learnt = attitude * (self.known.vector(index::GYRO) - before);
                coarse.heading_rad() + learnt.z * (moved_s + rest.seconds)
            }
            _ => 0.0,
        };
        let level = Level {
            attitude: level_attitude,
            tilt_sigma_rad: LEVEL_SIGMA_RAD,
        };
        let told = self.heading(time, &level, 0.0, turned_rad, config);
        let sigma = levelling::gyrocompass_sigma(&config.sensors, earth, rest.seconds);
        let compassed = told.is_none()
            && config.heading == HeadingSource::Auto
            && sigma < HEADING_SIGMA_RAD
            && turns_with_earth(&rest, &attitude, earth, config);
        let compass = || {
            let heading_rad = levelling::gyrocompass(&attitude, &(rest.rate_radps - before));
            let noise = levelling::gyrocompass_noise(&config.sensors, earth, rest.seconds);
            (heading_rad, noise)
        };
        Levelled {
            level,
            heading: told.or_else(|| compassed.then(compass)),
            source: if compassed {
                AttitudeSource::Gyrocompass
            } else {
                AttitudeSource::Level
            },
        }
    }

    /// The Earth at the last position, once there is one.
    fn earth(&self) -> Option<LocalEarth> {
        let Geodetic {
            latitude_rad,
            height_m,
            ..
        } = self.position;
        self.position_time
            .map(|_| LocalEarth::at(latitude_rad, height_m))
    }

    /// Ends levelling: with a heading, or with the search for one.
    fn end_levelling(&mut self, time: Time, levelled: &Levelled, config: &Config) {
        let level = &levelled.level;
        let Some((heading_rad, sigma_rad)) = levelled.heading else {
            self.start_search(time, level, config);
            return;
        };
        self.known.set(index::AZIMUTH, 0.0, sigma_rad);
        let attitude = turned(&level.attitude, heading_rad);
        let (ins, position_variance) = self.placed(time, self.velocity_mps, attitude);
        self.stage = Stage::Aligned(Aligned {
            ins,
            tilt_sigma_rad: math::max(level.tilt_sigma_rad, LEVEL_SIGMA_RAD),
            source: levelled.source,
            climb_variance: self.climb_variance(config),
            position_variance,
        });
    }

    /// An INS at a time, and the variance of its position beyond that of a fix: the last one was of another.
    fn placed(
        &self,
        time: Time,
        velocity_mps: Vector3<f64>,
        attitude: UnitQuaternion<f64>,
    ) -> (Mechanization, f64) {
        let mut ins = Mechanization::new(self.position, velocity_mps, attitude);
        let age_s = time.seconds_since(self.position_time.unwrap_or(time))
            + self.known.value(index::LATENCY);
        let [mut variance, _] = self.stale_variance;
        if math::abs(age_s) < OLDEST_FIX_S {
            ins.extrapolate(age_s);
        } else {
            variance += velocity_mps.norm_squared() * age_s * age_s;
        }
        (ins, variance)
    }

    /// Variance of the unmeasured climb of a vehicle in motion.
    fn climb_variance(&self, config: &Config) -> f64 {
        if self.climb_known || self.rest.seconds >= LEAST_REST_S {
            return 0.0;
        }
        config.climb_sigma_mps * config.climb_sigma_mps
    }

    /// Starts the search for the heading.
    fn start_search(&mut self, time: Time, level: &Level, config: &Config) {
        let Some(earth) = self.earth() else {
            return;
        };
        let rate = earth.earth_rate();
        // The search has no accelerometer biases.
        let bias_tilt = config.sensors.accel_bias_mps2 / GRAVITY_EQUATOR_MPS2;
        let start = Start {
            time,
            attitude: level.attitude,
            tilt_sigma_rad: math::max(level.tilt_sigma_rad, 2.0 * bias_tilt + LEVEL_SIGMA_RAD),
            earth_rate_radps: Vector2::new(rate.y, rate.z),
        };
        self.start_search_at(&start, config);
    }

    #[inline(never)]
    fn start_search_at(&mut self, start: &Start, config: &Config) {
        self.stage = Stage::Searching(Search {
            nodes: Nodes::default(),
            bank: Bank::new(start, &self.known, config),
            found: None,
        });
    }

    /// Levels a vehicle again as long as it has not moved.
    #[inline(never)]
    fn relevel(&mut self, time: Time, verdict: Verdict, config: &Config) {
        let Stage::Searching(Search {
            bank, found: None, ..
        }) = &self.stage
        else {
            return;
        };
        match verdict {
            Verdict::Motion(_) => self.rest = RestMean::default(),
            Verdict::Rest(block) if !bank.has_moved() && self.add_rest(time, &block, config) => {
                let Some(earth) = self.earth() else {
                    return;
                };
                let levelled = self.level_from_rest(time, &earth, config);
                if self.rest.seconds < GYROCOMPASS_S {
                    self.start_search(time, &levelled.level, config);
                } else {
                    self.end_levelling(time, &levelled, config);
                }
            }
            Verdict::Rest(_) | Verdict::Perhaps(_) => {}
        }
    }

    /// Gyro biases by the rate at rest beyond Earth rate; its level part is unknown without a heading. The
    /// mean improves with the rest, and replaces what was known less well.
    fn learn_gyros(
        &mut self,
        rest: &RestMean,
        attitude: &Matrix3<f64>,
        earth: &LocalEarth,
        config: &Config,
    ) {
        let rate = earth.earth_rate();
        let bias = rest.rate_radps - attitude.tr_mul(&Vector3::new(0.0, 0.0, rate.z));
        let variance = rest.gyro_variance(&config.sensors);
        for (axis, (bias, variance)) in bias.iter().zip(&variance).enumerate() {
            let sigma = math::sqrt(variance + rate.y * rate.y);
            if sigma < self.known.sigma(index::GYRO + axis) {
                self.known.set(index::GYRO + axis, *bias, sigma);
            }
        }
    }

    /// The search takes an interval, and works off nodes and observations in proportion to its duration.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    #[inline(never)]
    fn continue_search(&mut self, time: Time, interval: &Interval, config: &Config) {
        let force_mps = self.compensated(interval).force_mps;
        let Stage::Searching(search) = &mut self.stage else {
            return;
        };
        let ended = search.nodes.add(&Interval {
            force_mps,
            ..*interval
        });
        // One more where a node has ended: it is taken in before the hand-over at its end.
        for _ in 0..=(WORK_PER_S * interval.seconds) as u32 + u32::from(ended) {
            let nodes = &search.nodes;
            match search.found {
                None if search
                    .bank
                    .work(nodes, &self.observations, &self.known, config) =>
                {
                    return self.ask(time);
                }
                None => {}
                Some(best) if search.bank.catch_up(best, nodes, config) => {}
                Some(best) if ended => return self.finish(time, best, config),
                Some(_) => return,
            }
        }
    }

    /// Asks whether enough is found.
    #[inline(never)]
    fn ask(&mut self, time: Time) {
        let Stage::Searching(search) = &mut self.stage else {
            return;
        };
        match search.bank.answer(&self.known) {
            Answer::Wait => {}
            Answer::Ready(mixture) => {
                search.found = Some(mixture.best);
                self.learn(&mixture);
            }
            Answer::Wrong => self.restart(time),
        }
    }

    fn learn(&mut self, mixture: &Mixture) {
        let found = &mixture.found;
        self.known
            .set(index::AZIMUTH, 0.0, mixture.rotation_sigma_rad);
        let (latency_s, sigma_s) = (mixture.latency_s, mixture.latency_sigma_s);
        // The search did not use a much better known latency.
        let known_s = self.known.sigma(index::LATENCY);
        let stands = self
            .known
            .agrees(index::LATENCY, latency_s, sigma_s * sigma_s);
        if !(stands && KNOWN_BETTER * known_s < sigma_s) {
            self.known.set(index::LATENCY, latency_s, sigma_s);
        }
        let gyros = found.gyro_bias_radps.iter().zip(&found.gyro_sigma_radps);
        for (axis, (bias, sigma)) in gyros.enumerate() {
            if *sigma < self.known.sigma(index::GYRO + axis) {
                self.known.set(index::GYRO + axis, *bias, *sigma);
            }
        }
    }

    /// Hands over, at the end of a node.
    #[inline(never)]
    fn finish(&mut self, time: Time, best: u8, config: &Config) {
        let Stage::Searching(Search { bank, .. }) = &self.stage else {
            return;
        };
        let Some(candidate) = bank.candidate(best) else {
            return;
        };
        let level = candidate.velocity_en_mps();
        let found = candidate.found();
        let velocity = Vector3::new(level.x, level.y, self.velocity_mps.z);
        let (mut ins, position_variance) = self.placed(time, velocity, *candidate.attitude());
        ins.turn_heading(-found.rotation_rad);
        let level = config.sensors.accel_bias_mps2 / GRAVITY_EQUATOR_MPS2;
        let tilt = found.tilt_sigma_rad * found.tilt_sigma_rad + level * level;
        self.stage = Stage::Aligned(Aligned {
            ins,
            tilt_sigma_rad: math::sqrt(tilt),
            source: AttitudeSource::Motion,
            climb_variance: self.climb_variance(config),
            position_variance,
        });
    }
}

/// Stated variance beyond the usual one; a sigma below zero, as -1 of many receivers, states none.
fn beyond(stated: Option<f64>, usual: &Noise) -> f64 {
    let stated = math::max(stated.unwrap_or(0.0), 0.0);
    math::max(stated * stated - usual.variance(), 0.0)
}

/// Level of an earlier attitude.
fn resumed(attitude: UnitQuaternion<f64>) -> Level {
    Level {
        attitude,
        tilt_sigma_rad: RESUMED_TILT_RAD,
    }
}

/// Whether gyros at rest read the Earth rate about up, so that nothing else turns the vehicle.
fn turns_with_earth(
    rest: &RestMean,
    attitude: &Matrix3<f64>,
    earth: &LocalEarth,
    config: &Config,
) -> bool {
    let off = (attitude * rest.rate_radps).z - earth.earth_rate().z;
    let bias = config.sensors.gyro_bias_radps;
    let variance = bias * bias + rest::gyro_variance(&config.sensors, rest.seconds);
    off * off < AGREES_SIGMAS * AGREES_SIGMAS * variance
}

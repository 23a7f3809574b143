//! The filter itself: predicts over intervals, corrects by fixes and at rest.

use ins_core::config::HeadingSource;
use ins_core::increments::Interval;
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::rest::{RestBlock, RestDetector, Verdict};
use ins_core::{Estimates, GnssFix, Navigator, Solution, Time};
use nalgebra::Vector3;

use super::model::{AtMoment, Seen, Span, at_rest};
use super::noise::{Noise, total};
use super::{Known, Layout, Part, StateMatrix, States, index, propagated, sigmas, times};

/// Spread of the velocity at the start, that of an old fix, m/s, and age of its position, s.
const START_VELOCITY_MPS: f64 = 1.0;
const START_AGE_S: f64 = 0.5;
/// Longest step of the covariance, s; a fix ends it earlier.
const COVARIANCE_STEP_S: f64 = 0.1;
/// Time constant of the acceleration by which a fix is carried to its own moment, s: short beside
/// a manoeuvre, long beside the vibration of an engine.
const ACCEL_S: f64 = 0.03;
/// An innovation beyond this many sigmas counts as if it were noisier (Huber); one beyond so many
/// is not believed.
const ROBUST_SIGMAS: f64 = 3.0;
const GATE_SIGMAS: f64 = 6.0;
/// A part of fixes that has not been believed for so long, and in so many fixes, shows that the
/// filter is wrong: longer than receivers take to come back from a bridge or a reflection, short
/// beside the minutes in which an INS is lost.
const LOST_S: f64 = 5.0;
const LOST_FIXES: u32 = 5;
/// A filter that is wrong may be so by this much in tilt and azimuth, rad: a start in motion, and
/// a heading found from it.
const LOST_TILT_RAD: f64 = 0.1;
const LOST_AZIMUTH_RAD: f64 = 1.0;
/// Speed above which a fix shows motion, m/s, and sigmas of its noise on top: as in the core.
const MOTION_MPS: f64 = 0.2;
const MOTION_SIGMAS: f64 = 4.0;
/// Age of the last fix up to which it tells rest from steady motion, s: as in the core.
const HOLD_S: f64 = 1.5;
/// What gyros read at rest is not believed beyond so many sigmas: the vehicle turns slowly.
const REST_SIGMAS: f64 = 4.0;

/// An INS and the covariance of its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Stamp of the last interval's end.
    pub time: Time,
    /// The INS and its sensors, less all errors that were found.
    pub known: Known,
    /// Covariance of the errors that are left, as of the last covariance step.
    pub covariance: StateMatrix,
    pub layout: Layout,
    noise: Noise,
    since: Time,
    /// Spread of each error beyond which it is never doubted.
    largest: States,
    /// Zero: at every inertial sample, as most filters in firmware do.
    pub(super) covariance_step_s: f64,
    span: Span,
    transition: StateMatrix,
    accel_mps2: Vector3<f64>,
    rate_radps: Vector3<f64>,
    refused: [Option<Refused>; 4],
    rest: RestDetector,
    last_fix: Time,
}

/// Fixes in a row of which a part was not believed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Refused {
    count: u32,
    since: Time,
}

/// What a measurement did: all that a smoother needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// Transition of the errors since the last correction.
    pub transition: StateMatrix,
    pub predicted: StateMatrix,
    pub corrected: StateMatrix,
    pub errors: States,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    pub time: Time,
    pub ins: Mechanization,
    /// Spread of its roll and pitch, rad, if that is known.
    pub tilt_sigma_rad: Option<f64>,
    pub heading_sigma_rad: f64,
    /// Gyro biases as the alignment knows them, rad/s.
    pub gyro_bias_radps: Vector3<f64>,
    pub gyro_bias_sigma_radps: [f64; 3],
}

impl Start {
    /// Where the core's alignment has ended; `None` before. The error of a heading that is given
    /// nobody but the user knows.
    pub fn of(navigator: &Navigator, time: Time, noise: &Noise) -> Option<Self> {
        let ins = *navigator.mechanization()?;
        let estimates = navigator.estimates();
        let [x, y, z] = estimates.gyro_bias_radps;
        let given = matches!(navigator.config().heading, HeadingSource::Given(_));
        Some(Self {
            time,
            ins,
            tilt_sigma_rad: navigator.tilt_sigma_rad(),
            heading_sigma_rad: if given {
                noise.heading_sigma_rad
            } else {
                estimates.azimuth_error_rad.sigma
            },
            gyro_bias_radps: [x.value, y.value, z.value].into(),
            gyro_bias_sigma_radps: [x.sigma, y.sigma, z.sigma],
        })
    }

    fn covariance(&self, noise: &Noise, layout: &Layout) -> StateMatrix {
        let (sensors, gnss) = (&noise.sensors, &noise.gnss);
        let moved = Vector3::repeat(START_AGE_S * self.ins.velocity_enu_mps.norm());
        let [level, up] = [&gnss.position_m, &gnss.height_m].map(total);
        let levelled = noise.levelled_rad();
        let tilt = self.tilt_sigma_rad.unwrap_or_default().max(levelled);
        let gyro = self.gyro_bias_sigma_radps;
        let gyro = gyro.map(|sigma| sigma.min(sensors.gyro_bias_radps));
        let mut sigma = States::zeros(layout.size);
        let mut set = |at: usize, values: Vector3<f64>| {
            sigma.fixed_rows_mut::<3>(at).copy_from(&values);
        };
        let place = 2.0 * Vector3::new(level, level, up) + moved;
        let angles = Vector3::new(tilt, tilt, self.heading_sigma_rad);
        set(index::POSITION, place);
        set(index::VELOCITY, Vector3::repeat(START_VELOCITY_MPS));
        set(index::ATTITUDE, angles);
        set(index::ACCEL, Vector3::repeat(sensors.accel_bias_mps2));
        set(index::GYRO, gyro.into());
        for (at, spread) in [
            (layout.lever_arm, gnss.lever_arm_sigma_m),
            (layout.accel_scale, sensors.accel_scale),
            (layout.gyro_scale, sensors.gyro_scale),
        ] {
            if let Some(at) = at {
                set(at, Vector3::repeat(spread));
            }
        }
        sigma[index::LATENCY] = gnss.latency_sigma_s;
        if let Some(at) = layout.clock_drift {
            sigma[at] = gnss.clock_drift_sigma;
        }
        for (part, state) in layout.coloured() {
            sigma[state] = noise.part(part).correlated;
        }
        StateMatrix::from_diagonal(&sigma.component_mul(&sigma))
    }
}

impl Filter {
    pub fn new(start: &Start, noise: &Noise) -> Self {
        let layout = noise.layout();
        let covariance = start.covariance(noise, &layout);
        Self {
            time: start.time,
            known: Known::new(start.ins, start.gyro_bias_radps, noise),
            largest: largest(&covariance),
            covariance,
            layout,
            noise: *noise,
            since: start.time,
            covariance_step_s: COVARIANCE_STEP_S,
            span: Span::default(),
            transition: StateMatrix::identity(layout.size, layout.size),
            accel_mps2: Vector3::zeros(),
            rate_radps: Vector3::zeros(),
            refused: [None; 4],
            rest: RestDetector::default(),
            last_fix: start.time,
        }
    }

    /// Begins again with what was known of sensors, receiver and antenna.
    pub(super) fn keep_sensors_of(&mut self, lost: &Self) {
        self.since = lost.since;
        self.known = Known {
            ins: self.known.ins,
            colour: self.known.colour,
            ..lost.known
        };
        let coloured: Vec<usize> = self.layout.coloured().map(|(_, state)| state).collect();
        let kept: Vec<usize> = (index::ACCEL..self.layout.size)
            .filter(|state| !coloured.contains(state))
            .collect();
        for (&row, &column) in kept
            .iter()
            .flat_map(|row| kept.iter().map(move |column| (row, column)))
        {
            self.covariance[(row, column)] = lost.covariance[(row, column)];
        }
    }

    pub fn sigmas(&self) -> States {
        sigmas(&self.covariance)
    }

    pub(super) fn run_s(&self) -> f64 {
        self.time.seconds_since(self.since)
    }

    pub fn solution(&self) -> Solution {
        self.known.solution(self.time)
    }

    pub fn estimates(&self) -> Estimates {
        self.known
            .estimates(&self.covariance, self.run_s(), &self.layout, &self.noise)
    }

    /// Advances over the interval that ends at `time`; at rest, corrects by what the gyros read.
    pub fn predict(&mut self, time: Time, raw: &Interval) -> Option<Correction> {
        let interval = self.known.corrected(raw);
        let before = self.known.ins.velocity_enu_mps;
        let step = self.known.ins.step(&interval, &Controls::default());
        let accel = (self.known.ins.velocity_enu_mps - before) / interval.seconds;
        let part = (interval.seconds / ACCEL_S).min(1.0);
        self.accel_mps2 += part * (accel - self.accel_mps2);
        let earth_rate = self.known.ins.local_earth().earth_rate();
        self.rate_radps = interval.angle_rad / interval.seconds - step.attitude.tr_mul(&earth_rate);
        self.span.add(&interval, &step);
        self.time = time;
        if self.span.seconds >= self.covariance_step_s {
            self.step_covariance();
        }
        match self.rest.on_interval(raw) {
            Some(Verdict::Rest(block)) if time.seconds_since(self.last_fix) <= HOLD_S => {
                self.correct_at_rest(&block)
            }
            _ => None,
        }
    }

    fn step_covariance(&mut self) {
        let seconds = self.span.seconds;
        if seconds <= 0.0 {
            return;
        }
        let transition = (self.span).transition(&self.known.ins, &self.layout, &self.noise);
        // Half of the noise before and half after: exact to second order.
        let growth = 0.5 * seconds * self.noise.growth(&self.layout, &self.known.ins);
        self.covariance += &growth;
        self.covariance = propagated(&transition, &self.covariance) + growth;
        for (part, state) in self.layout.coloured() {
            let colour = self.noise.part(part).correlated;
            let renewed = colour * colour * (1.0 - self.noise.kept(part, 2.0 * seconds));
            self.covariance[(state, state)] += renewed;
        }
        make_symmetric(&mut self.covariance);
        self.known.age(seconds, &self.noise);
        self.transition = times(&transition, &self.transition);
        self.span = Span::default();
    }

    /// Compares a fix whose moment has just passed, and takes out the errors it shows.
    pub fn correct(&mut self, fix: &GnssFix) -> Correction {
        self.step_covariance();
        let mut update = Update::new(&self.covariance);
        let known = self.known;
        let moment = AtMoment {
            known: &known,
            since_s: self
                .time
                .seconds_since(fix.time.plus_seconds(-known.latency_s)),
            accel_mps2: self.accel_mps2,
            rate_radps: self.rate_radps,
        };
        for part in Part::ALL {
            if let Some(seen) = moment.compare(part, fix, &self.noise, &self.layout) {
                self.take(part, &seen, &mut update);
            }
        }
        self.last_fix = self.time;
        if self.shows_motion(fix) {
            self.rest.on_motion();
        }
        self.finish(update)
    }

    fn take(&mut self, part: Part, seen: &Seen, update: &mut Update) {
        let refused = &mut self.refused[part as usize];
        let mut distance = update.distance(seen);
        let is_long = |refused: &Refused| {
            refused.count >= LOST_FIXES && self.time.seconds_since(refused.since) >= LOST_S
        };
        let lost = refused.as_ref().is_some_and(is_long) && distance > GATE_SIGMAS;
        if lost {
            update.doubt(part, distance / ROBUST_SIGMAS, &self.largest);
            distance = update.distance(seen);
        }
        if distance > GATE_SIGMAS && !lost {
            let since = self.time;
            refused.get_or_insert(Refused { count: 0, since }).count += 1;
            return;
        }
        *refused = None;
        update.take(seen, (distance / ROBUST_SIGMAS).max(1.0));
    }

    fn correct_at_rest(&mut self, block: &RestBlock) -> Option<Correction> {
        self.step_covariance();
        if !self.noise.reads_rest {
            return None;
        }
        let (rate, seconds) = (&block.rate_radps, block.seconds);
        let seen = at_rest(&self.known, rate, seconds, &self.noise, &self.layout);
        let mut update = Update::new(&self.covariance);
        if update.distance(&seen) > REST_SIGMAS {
            return None;
        }
        update.take(&seen, 1.0);
        Some(self.finish(update))
    }

    fn finish(&mut self, update: Update) -> Correction {
        self.known = self.known.less(&update.errors, &self.layout);
        self.covariance = update.covariance;
        let identity = StateMatrix::identity(self.layout.size, self.layout.size);
        Correction {
            transition: core::mem::replace(&mut self.transition, identity),
            predicted: update.predicted,
            corrected: self.covariance.clone(),
            errors: update.errors,
        }
    }

    fn shows_motion(&self, fix: &GnssFix) -> bool {
        fix.speed_mps() > MOTION_MPS + MOTION_SIGMAS * total(&self.noise.gnss.velocity_mps)
    }
}

/// Spreads as they were at the start, but for those of what the filter itself moves.
fn largest(start: &StateMatrix) -> States {
    let mut largest = sigmas(start);
    for state in index::POSITION..index::ATTITUDE {
        largest[state] = f64::INFINITY;
    }
    for state in index::ATTITUDE..index::ATTITUDE + 2 {
        largest[state] = largest[state].max(LOST_TILT_RAD);
    }
    let azimuth = index::ATTITUDE + 2;
    largest[azimuth] = largest[azimuth].max(LOST_AZIMUTH_RAD);
    largest
}

/// Measurements being taken, part by part.
struct Update {
    predicted: StateMatrix,
    errors: States,
    covariance: StateMatrix,
}

impl Update {
    fn new(predicted: &StateMatrix) -> Self {
        Self {
            predicted: predicted.clone(),
            errors: States::zeros(predicted.nrows()),
            covariance: predicted.clone(),
        }
    }

    fn innovation(&self, seen: &Seen) -> States {
        &seen.difference - &seen.by * &self.errors
    }

    /// Covariance of errors and innovation, and of the innovation.
    fn variances(&self, seen: &Seen) -> [StateMatrix; 2] {
        let mut cross = &self.covariance * seen.by.transpose();
        let mut own = &seen.by * &cross;
        if let Some(shared) = &seen.shared {
            let by_noise = &seen.by * shared;
            own += &by_noise + by_noise.transpose();
            cross += shared;
        }
        own += StateMatrix::from_diagonal(&seen.variance);
        [cross, own]
    }

    /// Of the innovation from zero, in sigmas of all its components together.
    fn distance(&self, seen: &Seen) -> f64 {
        let [_, own] = self.variances(seen);
        let innovation = self.innovation(seen);
        // Without noise and without doubt there is nothing to weigh: whatever comes is wild.
        own.cholesky().map_or(f64::INFINITY, |root| {
            innovation.dot(&root.solve(&innovation)).sqrt()
        })
    }

    /// Takes a measurement whose innovation has `noisier` times the variance that it should have.
    ///
    /// `P + K S K^T - K (P H^T)^T - (P H^T) K^T`: Joseph's form for noise that the errors share.
    fn take(&mut self, seen: &Seen, noisier: f64) {
        let [cross, own] = self.variances(seen);
        let own = own * noisier;
        let Some(root) = own.clone().cholesky() else {
            return;
        };
        let gain = root.solve(&cross.transpose()).transpose();
        self.errors += &gain * self.innovation(seen);
        let both = &gain * cross.transpose();
        self.covariance += &gain * (own * gain.transpose()) - &both - both.transpose();
        make_symmetric(&mut self.covariance);
    }

    /// Widens what a part of fixes shows to be wrong: the errors that it sees, and those behind
    /// them, by a factor, but none beyond its largest.
    fn doubt(&mut self, part: Part, factor: f64, largest: &States) {
        let sigma = sigmas(&self.covariance);
        let behind = if part.is_velocity() {
            index::ATTITUDE..index::LATENCY
        } else {
            0..0
        };
        for state in part.states().chain(behind) {
            let factor = factor.min(largest[state] / sigma[state]).max(1.0);
            self.covariance.row_mut(state).scale_mut(factor);
            self.covariance.column_mut(state).scale_mut(factor);
        }
    }
}

fn make_symmetric(matrix: &mut StateMatrix) {
    *matrix = 0.5 * (&*matrix + matrix.transpose());
}

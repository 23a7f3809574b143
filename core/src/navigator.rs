//! The whole navigator: samples and fixes in, solution and estimates out.
//!
//! Data flows one way: sample, increments, mechanization under the damping controls, ring of past states;
//! fix, comparison with the INS of its own time, damping controls, estimators, compensation.

use nalgebra::{Vector2, Vector3};

use crate::aided::{AidedIns, Barometer};
use crate::alignment::Alignment;
use crate::calibration::{Calibration, at_level};
use crate::config::{Config, ConfigError, Noise};
use crate::damping::DampingSignals;
use crate::earth::{GRAVITY_EQUATOR_MPS2, LatLon};
use crate::estimate::Estimates;
use crate::health::{Counts, Health};
use crate::increments::{Increments, Interval};
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::mechanization::{Controls, Mechanization};
use crate::observer::Observer;
use crate::outcome::{GnssOutcome, ImuOutcome};
use crate::parameters::index;
use crate::samples::{ANYWHERE_M, BaroHeight, GnssFix, Heading, ImuSample};
use crate::solution::{BodyMotion, Phase, Solution, SolutionSigma};
use crate::time::Time;

/// Entries of the ring unless the user chooses: two seconds, for a latency and a late arrival of one second
/// each.
pub const RING_MOMENTS: usize = 22;
/// Largest difference of a fix's stamp from the inertial ones, s.
const LARGEST_OFFSET_S: f64 = 1.5;
/// Duration of a run of consistent stamps until it is accepted after a gap, and before the last stamp, s. A
/// few stray ones must not move the clock, nor a buffer of old samples that is sent again.
const AFTER_GAP_S: f64 = 0.05;
/// Longest gap that a single stamp proves, and longest interval within a run of stamps, s.
const CERTAIN_GAP_S: f64 = 0.5;
const SET_BACK_S: f64 = 1.0;
/// Longer than any increment, s: the interval of the first, or of one after a gap, is not known.
const LONGEST_READING_S: f64 = 1.0;
/// Part of the range by which a clipped reading may be more than that, and by which the truth may be more than a
/// clipped reading, as in jolts and vibration for which a sensor was not chosen.
const MORE_THAN_FULL_SCALE: f64 = 1.1;
const BEYOND_RANGE: f64 = 0.25;
/// Heights, m, and speed, m/s, beyond those of any vehicle this is for.
const LOWEST_M: f64 = -12_000.0;
const HIGHEST_M: f64 = 100_000.0;
const FASTEST_MPS: f64 = 3_000.0;
/// Least sigma of a heading, rad.
const LEAST_HEADING_SIGMA_RAD: f64 = 1e-5;
/// Least time between two fixes of like content, s: each takes a step of work, of which there are a hundred
/// a second, and the estimators need theirs.
const LEAST_FIX_INTERVAL_S: f64 = 0.015;

/// Sigmas of a stopgap solution after its fix, m, m/s and rad of tilt, by which it drifts.
const STOPGAP_M: f64 = 20.0;
const STOPGAP_MPS: f64 = 5.0;
const STOPGAP_RAD: f64 = 0.1;
/// Longest gap over which it is extrapolated, s.
const EXTRAPOLATED_S: f64 = 60.0;
/// Sigmas of that tilt by which the direction of gravity after a gap shows that the unit has slipped.
const SLIPPED_SIGMAS: f64 = 4.0;

/// Strapdown INS damped by GNSS velocity, with running estimators of its sensors' errors.
///
/// Clone it for a snapshot, or serialize it: a restored one continues bit for bit. Two are equal if they
/// will answer alike, whatever each has counted so far.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Navigator<const RING: usize = RING_MOMENTS> {
    #[cfg_attr(feature = "serde", serde(deserialize_with = "usable"))]
    config: Config,
    state: State<RING>,
    counts: Counts,
}

impl<const RING: usize> PartialEq for Navigator<RING> {
    fn eq(&self, other: &Self) -> bool {
        self.config == other.config && self.state == other.state
    }
}

#[cfg(feature = "serde")]
fn usable<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Config, D::Error> {
    let config: Config = serde::Deserialize::deserialize(from)?;
    config.check().map_err(serde::de::Error::custom)?;
    Ok(config)
}

/// Run of stamps that do not follow the last one, but each other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct OutOfSequence {
    first: Time,
    last: Time,
}

/// Time in which a position may be a copy of the last, s: those of GNSS come once a second at least.
const REPEATED_S: f64 = 1.5;

/// All state but the counts.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct State<const RING: usize> {
    /// Last inertial stamp and the reading there; none before the first sample.
    inertial: Option<(Time, Increments)>,
    /// Samples whose stamps do not follow the last one.
    out_of_sequence: Option<OutOfSequence>,
    /// Last interval, uncompensated.
    interval: Interval,
    /// Last fix that was taken: its stamp, level velocity and position.
    last_fix: Option<(Time, Option<Vector2<f64>>, Option<LatLon>)>,
    barometer: Barometer,
    restarts: u32,
    /// At which the accelerometer biases that alignment knows were estimated; zero: at its own level.
    level_force_mps2: Vector3<f64>,
    /// During a new alignment: the diverged INS, set to each fix, and the time of its last position.
    stopgap: Option<(Time, Mechanization)>,
    mode: Mode<RING>,
}

/// Both live in place: there is nowhere else.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(clippy::large_enum_variant)]
enum Mode<const RING: usize> {
    Aligning(Alignment),
    Navigating(AidedIns<RING>),
}

impl Navigator {
    /// A navigator without prior calibration.
    ///
    /// # Errors
    /// [`ConfigError`] names the first value that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        Self::with_ring(config, None)
    }

    /// A navigator with the calibration of an earlier run of the same unit.
    ///
    /// What the configuration gives stays as given. Where the position is known too, give it as a first
    /// fix; a heading by [`Navigator::on_heading`].
    ///
    /// # Errors
    /// As [`Self::new`]; also for a calibration that is not finite, or a negative sigma. With a
    /// sigma of zero a value is unused, and the configuration stands.
    pub fn warm(config: Config, calibration: &Calibration) -> Result<Self, ConfigError> {
        Self::with_ring(config, Some(calibration))
    }
}

impl<const RING: usize> Navigator<RING> {
    /// A navigator with `RING` past states, a good tenth of a second apart: fixes of an older time, by
    /// their latency and late arrival together, are lost. Each takes 160 bytes.
    ///
    /// # Errors
    /// As [`Navigator::warm`].
    pub fn with_ring(
        config: Config,
        calibration: Option<&Calibration>,
    ) -> Result<Self, ConfigError> {
        const { assert!(RING > 2, "three moments are needed to compare a fix") };
        config.check()?;
        let known = calibration.map_or(Ok(config.prior()), |known| known.prior(&config))?;
        let state = State {
            inertial: None,
            out_of_sequence: None,
            interval: Interval::default(),
            last_fix: None,
            barometer: Barometer::default(),
            restarts: 0,
            level_force_mps2: calibration.map_or_else(Vector3::zeros, |c| c.level_force_mps2),
            stopgap: None,
            mode: Mode::Aligning(Alignment::new(Time::default(), None, &known)),
        };
        Ok(Self {
            config,
            state,
            counts: Counts::default(),
        })
    }

    /// Takes one inertial sample, in order of time.
    // Never inlined, nor is the next: their stack is then not the caller's.
    #[inline(never)]
    pub fn on_imu(&mut self, sample: &ImuSample) -> ImuOutcome {
        let (state, config) = (&mut self.state, &self.config);
        // One after the other: nested, their stacks would add up.
        let outcome = match state.on_imu(sample, &mut self.counts, config) {
            Ok(bridged) => {
                state.on_interval(config);
                state.follow_up(&mut self.counts, config);
                if bridged {
                    ImuOutcome::Bridged
                } else {
                    ImuOutcome::Accepted
                }
            }
            Err(outcome) => outcome,
        };
        self.counts.sample(outcome);
        outcome
    }

    /// Takes one GNSS fix, in order of time.
    #[inline(never)]
    pub fn on_gnss(&mut self, fix: &GnssFix) -> GnssOutcome {
        let outcome = self.state.on_gnss(fix, &mut self.counts, &self.config);
        self.counts.fix(fix.time, outcome);
        outcome
    }

    /// Takes a measured heading, at any time, up to a tenth of a second before the sample of its time.
    /// While aligning it is the initial heading, if levelling ends within a second; headings that are never
    /// a second old end a search for one, and levelling starts anew. One with a sigma above 0.3 rad is
    /// [`GnssOutcome::OutOfRange`] until then: motion shows it better. After the divergence of an INS with
    /// which headings agreed, all are [`GnssOutcome::Outlier`] until motion has shown it. The literal form
    /// takes none later.
    #[inline(never)]
    pub fn on_heading(&mut self, heading: &Heading) -> GnssOutcome {
        let Some((now, _)) = self.state.inertial else {
            return GnssOutcome::NoInertialData;
        };
        if !(heading.heading_rad.is_finite() && heading.sigma_rad.is_finite()) {
            return GnssOutcome::NotFinite;
        }
        let spreads = LEAST_HEADING_SIGMA_RAD..=core::f64::consts::PI;
        let possible = math::abs(heading.heading_rad) <= core::f64::consts::TAU;
        if !possible || !spreads.contains(&heading.sigma_rad) {
            return GnssOutcome::OutOfRange;
        }
        match &mut self.state.mode {
            Mode::Aligning(alignment) => alignment.on_heading(now, heading),
            Mode::Navigating(ins) => ins.on_heading(heading),
        }
    }

    /// Takes the height of a barometer, in order of time: its change in two seconds aids the vertical while
    /// no fix does. It is no fix, and [`Health`] counts none for it. The literal form does not use it.
    /// [`GnssOutcome::Repeated`]: the same to the last bit as two seconds ago, of a barometer that is stuck
    /// or too coarse.
    #[inline(never)]
    pub fn on_baro(&mut self, height: &BaroHeight) -> GnssOutcome {
        self.state
            .on_baro(height)
            .err()
            .unwrap_or(GnssOutcome::Accepted)
    }

    /// The configuration it runs with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// How far the alignment has come.
    pub fn phase(&self) -> Phase {
        match &self.state.mode {
            Mode::Aligning(alignment) => alignment.phase(),
            Mode::Navigating(_) => Phase::Navigating,
        }
    }

    /// Position, velocity and attitude at the last inertial sample, once navigating.
    ///
    /// With closed feedback the estimated error of the damped INS is corrected here; with open feedback it
    /// is the damped INS itself.
    ///
    /// A diverged INS is aligned anew; meanwhile the solution is the last fix, propagated by the sensors,
    /// with a heading that may be wrong; none where its level is wrong too.
    pub fn solution(&self) -> Option<Solution> {
        if let (Some((_, ins)), Some((time, _))) = (&self.state.stopgap, &self.state.inertial) {
            return Some(Solution {
                time: *time,
                position: ins.position,
                velocity_enu_mps: ins.velocity_enu_mps,
                attitude: ins.attitude,
            });
        }
        Some(self.aided()?.solution(&self.config))
    }

    /// The damped INS without that correction; its azimuth error is [`Self::azimuth_left_rad`].
    pub fn mechanization(&self) -> Option<&Mechanization> {
        Some(self.aided()?.mechanization())
    }

    /// Azimuth error that is still in the damped INS, rad.
    pub fn azimuth_left_rad(&self) -> f64 {
        self.aided().map_or(0.0, AidedIns::azimuth_left_rad)
    }

    /// Sigma of roll and pitch of the damped INS, rad, without the part by the level accelerometers'
    /// biases; none in the literal form.
    pub fn tilt_sigma_rad(&self) -> Option<f64> {
        Some(self.observer()?.tilt_sigma_rad())
    }

    /// Noise of GNSS velocity: the correlated part as learnt, the white one as configured; none in the
    /// literal form.
    pub fn velocity_noise(&self) -> Option<Noise> {
        Some(self.observer()?.velocity_noise(&self.config))
    }

    /// One standard deviation of the [solution](Self::solution), with open feedback after correction by the
    /// estimated error; none in the literal form. The part of the parameters is up to five seconds old.
    pub fn sigma(&self) -> Option<SolutionSigma> {
        if let (Some((since, _)), Some((time, _)), Mode::Aligning(alignment)) =
            (&self.state.stopgap, &self.state.inertial, &self.state.mode)
        {
            return Some(stopgap_sigma(
                time.seconds_since(*since),
                alignment.stale_variance(),
            ));
        }
        self.aided()?.sigma(&self.config)
    }

    /// Compensated angular rate and specific force, for an autopilot.
    pub fn body_motion(&self) -> Option<BodyMotion> {
        let (time, _) = self.state.inertial.as_ref()?;
        let raw = &self.state.interval;
        let interval = match &self.state.mode {
            Mode::Aligning(alignment) => alignment.compensated(raw),
            Mode::Navigating(ins) => ins.compensated(raw),
        };
        (raw.seconds > 0.0).then(|| BodyMotion {
            time: *time,
            rate_radps: interval.angle_rad / interval.seconds,
            force_mps2: interval.force_mps / interval.seconds,
        })
    }

    /// State of health.
    pub fn health(&self) -> Health {
        let observer = self.observer();
        Health {
            phase: self.phase(),
            coasting_since: self.aided().and_then(AidedIns::coasting_since),
            last_fix: self.counts.last_fix,
            level_nis: observer.map(|own| own.nis.mean),
            vertical_nis: observer.map(|own| own.vertical_nis.mean),
            last_reset: observer.and_then(Observer::last_reset),
            restarts: self.state.restarts,
            fixes: self.counts.fixes,
            samples: self.counts.samples,
        }
    }

    /// The calibration of the unit, for its next run.
    pub fn calibration(&self) -> Calibration {
        match &self.state.mode {
            Mode::Aligning(alignment) => {
                Calibration::of(alignment.known(), self.state.level_force_mps2)
            }
            Mode::Navigating(ins) => {
                Calibration::of(&ins.stated(&self.config), ins.level_force_mps2())
            }
        }
    }

    /// Estimated errors of the sensors.
    pub fn estimates(&self) -> Estimates {
        match &self.state.mode {
            Mode::Aligning(alignment) => {
                Estimates::from_parameters(alignment.known(), &self.config, alignment.phase())
            }
            Mode::Navigating(ins) => ins.estimates(&self.config),
        }
    }

    /// The present manoeuvre.
    pub fn manoeuvre(&self) -> Manoeuvre {
        self.aided()
            .map_or_else(Manoeuvre::default, |ins| ins.manoeuvre)
    }

    /// The damping signals of the last fix.
    pub fn damping_signals(&self) -> DampingSignals {
        self.aided()
            .map_or_else(DampingSignals::default, AidedIns::signals)
    }

    fn aided(&self) -> Option<&AidedIns<RING>> {
        match &self.state.mode {
            Mode::Aligning(_) => None,
            Mode::Navigating(ins) => Some(ins),
        }
    }

    fn observer(&self) -> Option<&Observer> {
        self.aided()?.observer()
    }
}

impl<const RING: usize> State<RING> {
    /// Makes the interval that ends with a sample. `Ok` says whether it bridges a gap, `Err` is the outcome of a
    /// sample that ends none.
    #[inline(never)]
    fn on_imu(
        &mut self,
        sample: &ImuSample,
        counts: &mut Counts,
        config: &Config,
    ) -> Result<bool, ImuOutcome> {
        if !(sample.gyro.sum() + sample.accel.sum()).is_finite() {
            return Err(ImuOutcome::NotFinite);
        }
        let Some((last, increments)) = &mut self.inertial else {
            return Err(self.on_first(sample, config));
        };
        let largest = Largest::of(sample);
        let seconds = sample.time.seconds_since(*last);
        if seconds <= 0.0 {
            if largest.out_of_range(LONGEST_READING_S, config) {
                return Err(ImuOutcome::OutOfRange);
            }
            if self.resumes(sample.time, SET_BACK_S) {
                self.restart_at(sample, counts, config);
            }
            return Err(ImuOutcome::TimeNotIncreasing);
        }
        let gap = increments.has_gap(seconds);
        let reading_s = math::min(increments.reading_seconds(seconds, gap), LONGEST_READING_S);
        let unusual = gap
            || seconds > CERTAIN_GAP_S
            || increments.turns_too_far(largest.gyro, seconds)
            || largest.beyond_range(reading_s, config)
            || increments.jitters(seconds)
            || self.out_of_sequence.is_some();
        let bridged = unusual
            && self.on_unusual(sample, largest, [seconds, reading_s], gap, counts, config)?;
        let Some((last, increments)) = &mut self.inertial else {
            return Err(ImuOutcome::Gap);
        };
        self.interval = increments.interval_of(sample, seconds, gap);
        *last = sample.time;
        Ok(bridged)
    }

    /// A sample `seconds` after the last, whose reading covers `reading_s`, is to be refused, or the interval before
    /// it is noisier or not whole. Returns what `on_imu` does.
    #[inline(never)]
    fn on_unusual(
        &mut self,
        sample: &ImuSample,
        largest: Largest,
        [seconds, reading_s]: [f64; 2],
        gap: bool,
        counts: &mut Counts,
        config: &Config,
    ) -> Result<bool, ImuOutcome> {
        let Some((_, increments)) = &self.inertial else {
            return Err(ImuOutcome::Gap);
        };
        let too_far = increments.turns_too_far(largest.gyro, seconds);
        let bridgeable = if gap {
            seconds <= config.max_gap_s && !too_far && increments.ends_agree(sample, seconds)
        } else {
            seconds <= CERTAIN_GAP_S
        };
        if largest.out_of_range(reading_s, config) {
            // Increments over longer intervals are larger.
            let rarer = gap && !largest.out_of_range(seconds, config);
            if rarer && self.resumes(sample.time, AFTER_GAP_S) {
                self.restart_at(sample, counts, config);
                self.inertial = Some((sample.time, Increments::new(config.imu_output, sample)));
            }
            return Err(ImuOutcome::OutOfRange);
        }
        if too_far && !gap {
            return Err(ImuOutcome::OutOfRange);
        }
        if !bridgeable || seconds > CERTAIN_GAP_S {
            if !self.resumes(sample.time, AFTER_GAP_S) {
                return Err(ImuOutcome::Gap);
            }
            if !bridgeable {
                self.restart_at(sample, counts, config);
                return Err(ImuOutcome::Gap);
            }
        }
        let lost = lost_in_saturation(sample, reading_s, config);
        Ok(self.on_irregular(sample, seconds, gap, &lost))
    }

    /// The interval before a sample is noisier by `lost`, or not whole. Returns whether it bridges a gap: missing
    /// samples, or those that were refused since the clock was set back. Single stamps out of order are
    /// neither.
    fn on_irregular(
        &mut self,
        sample: &ImuSample,
        seconds: f64,
        gap: bool,
        lost: &[Vector3<f64>; 2],
    ) -> bool {
        let Some((last, increments)) = &self.inertial else {
            return false;
        };
        let set_back_s = self.out_of_sequence.take().map_or(0.0, |out_of_sequence| {
            let resumes = !increments.has_gap(sample.time.seconds_since(out_of_sequence.last));
            if resumes {
                math::max(last.seconds_since(out_of_sequence.first), 0.0)
            } else {
                0.0
            }
        });
        let bridges = gap || set_back_s > 0.0;
        let Mode::Navigating(ins) = &mut self.mode else {
            return bridges;
        };
        ins.on_noise(lost);
        if increments.jitters(seconds) {
            ins.on_noise(&increments.jitter_noise(sample, seconds));
        }
        if bridges {
            let [mut rate, accel] = increments.ends_differ(sample);
            if set_back_s > 0.0 {
                rate = increments.lost_turn(sample);
            }
            ins.on_gap(seconds + set_back_s, set_back_s, &[rate, accel]);
        }
        bridges
    }

    /// Advances over the last interval.
    #[inline(never)]
    fn on_interval(&mut self, config: &Config) {
        let Some((last, increments)) = &self.inertial else {
            return;
        };
        let interval = &self.interval;
        let late_s = increments.stamped_late_s();
        let now = if late_s == 0.0 {
            *last
        } else {
            last.plus_seconds(-late_s)
        };
        match &mut self.mode {
            Mode::Aligning(alignment) => {
                step_stopgap(&mut self.stopgap, alignment, interval);
                alignment.on_interval(now, interval, config);
            }
            Mode::Navigating(ins) => ins.on_interval(now, interval, config),
        }
    }

    #[inline(never)]
    fn on_first(&mut self, sample: &ImuSample, config: &Config) -> ImuOutcome {
        if Largest::of(sample).out_of_range(LONGEST_READING_S, config) {
            return ImuOutcome::OutOfRange;
        }
        self.inertial = Some((sample.time, Increments::new(config.imu_output, sample)));
        if let Mode::Aligning(alignment) = &mut self.mode {
            alignment.begin_at(sample.time);
        }
        ImuOutcome::Accepted
    }

    /// A stamp that does not follow the last one is ignored, unless a run of `credible_s` goes on from
    /// there: then the clock was set, or a gap is over.
    fn resumes(&mut self, time: Time, credible_s: f64) -> bool {
        let in_step = self.out_of_sequence.filter(|out_of_sequence| {
            let seconds = time.seconds_since(out_of_sequence.last);
            seconds > 0.0 && seconds <= CERTAIN_GAP_S
        });
        let first = in_step.map_or(time, |out_of_sequence| out_of_sequence.first);
        self.out_of_sequence = Some(OutOfSequence { first, last: time });
        time.seconds_since(first) >= credible_s
    }

    #[inline(never)]
    fn restart_at(&mut self, sample: &ImuSample, counts: &mut Counts, config: &Config) {
        self.out_of_sequence = None;
        self.last_fix = None;
        self.barometer = Barometer::default();
        self.interval = Interval::default();
        let (mut until, mut slipped) = (sample.time, false);
        if let Some((last, increments)) = &mut self.inertial {
            until = core::mem::replace(last, sample.time);
            let [_, accel_mps2] = increments.ends_differ(sample);
            slipped =
                math::largest(&accel_mps2) > SLIPPED_SIGMAS * STOPGAP_RAD * GRAVITY_EQUATOR_MPS2;
            increments.restart(sample);
        }
        self.realign(sample.time, until, slipped, counts, config);
    }

    /// The INS was propagated up to `until`. If gravity has another direction than before, the unit may
    /// have been `slipped`, and the level is not kept.
    #[inline(never)]
    fn realign(
        &mut self,
        time: Time,
        until: Time,
        slipped: bool,
        counts: &mut Counts,
        config: &Config,
    ) {
        let gap_s = time.seconds_since(until);
        match &mut self.mode {
            Mode::Aligning(alignment) => {
                alignment.on_outage(time);
                if slipped {
                    self.stopgap = None;
                    alignment.restart(time);
                } else {
                    alignment.begin_at(time);
                    extrapolate_stopgap(&mut self.stopgap, gap_s);
                }
            }
            Mode::Navigating(ins) => {
                self.restarts = self.restarts.saturating_add(1);
                if let Some((newest, fixes)) = ins.undecided() {
                    counts.fixes(newest, fixes, GnssOutcome::TooOld);
                }
                let bad_headings = ins.diverged && ins.is_heading_aided();
                let mut stale_variance =
                    ins.observer().map_or([0.0; 2], Observer::position_variance);
                // It may have moved otherwise than it did before.
                let speed_mps = ins.mechanization().velocity_enu_mps.norm() + STOPGAP_MPS;
                let moved_m = speed_mps * math::max(gap_s, 0.0);
                stale_variance[0] += moved_m * moved_m;
                let known = if ins.parameters_invalid {
                    config.prior()
                } else {
                    ins.stated(config)
                };
                self.level_force_mps2 = if ins.parameters_invalid {
                    Vector3::zeros()
                } else {
                    ins.level_force_mps2()
                };
                let since = ins.coasting_since().unwrap_or(until);
                let left = (!ins.parameters_invalid && !slipped).then(|| *ins.mechanization());
                self.stopgap = left.filter(is_possible).map(|ins| (since, ins));
                extrapolate_stopgap(&mut self.stopgap, gap_s);
                // In place: else it would be copied over the stack.
                self.mode = Mode::Aligning(Alignment::new(time, Some(until), &known));
                if let Mode::Aligning(alignment) = &mut self.mode {
                    let left = self.stopgap.as_ref().map(|(_, ins)| ins);
                    alignment.begin_again(bad_headings, stale_variance, left);
                }
            }
        }
    }

    /// Work after a sample.
    fn follow_up(&mut self, counts: &mut Counts, config: &Config) {
        match &mut self.mode {
            Mode::Aligning(_) => {
                self.start_navigation(config);
                // What is known from before is compensated from the first sample on, not a second later.
                if let Mode::Navigating(ins) = &mut self.mode {
                    ins.compensate(config);
                }
            }
            Mode::Navigating(ins) => {
                ins.follow_up(&self.interval, counts, config);
                if let Some((now, _)) = &self.inertial
                    && (ins.diverged || !is_possible(ins.mechanization()))
                {
                    let now = *now;
                    self.realign(now, now, false, counts, config);
                }
            }
        }
    }

    /// Starts navigation once aligned. Rare and large: its temporaries must not lie on the stack of every
    /// sample.
    #[inline(never)]
    fn start_navigation(&mut self, config: &Config) {
        if let (Mode::Aligning(alignment), Some((now, _))) = (&self.mode, &self.inertial)
            && let Some(aligned) = alignment.aligned()
        {
            // Copied, to construct in place from them.
            let (now, aligned, mut known) = (*now, *aligned, *alignment.known());
            let level_force_mps2 = aligned.level_force_mps2();
            if self.level_force_mps2 != Vector3::zeros() {
                at_level(&mut known, &self.level_force_mps2, &level_force_mps2);
            }
            self.stopgap = None;
            self.mode = Mode::Navigating(AidedIns::new(now, &aligned, config));
            if let Mode::Navigating(ins) = &mut self.mode {
                ins.set_prior(&known, aligned.source, config);
            }
        }
    }

    #[inline(never)]
    fn on_gnss(&mut self, fix: &GnssFix, counts: &mut Counts, config: &Config) -> GnssOutcome {
        let fix = &fix.without_placeholders();
        if let Err(outcome) = check_fix(fix) {
            return outcome;
        }
        let Some((now, _)) = &self.inertial else {
            return GnssOutcome::NoInertialData;
        };
        let follows = |(last, velocity, _): (Time, Option<_>, _)| {
            let shared = velocity.is_some() == fix.velocity_en_mps.is_some();
            fix.time > last && !(shared && fix.time.seconds_since(last) < LEAST_FIX_INTERVAL_S)
        };
        if !self.last_fix.is_none_or(follows) {
            return GnssOutcome::TimeNotIncreasing;
        }
        if let Err(outcome) = check_time(fix.time, *now) {
            return outcome;
        }
        let last = self.last_fix.as_ref();
        // A copy of the last fix, while it shows motion; without a velocity the INS shows it, which may be
        // wrong.
        let repeats = |ins: &AidedIns<RING>| {
            last.is_some_and(|(time, velocity, position)| {
                if fix.velocity_en_mps.is_some() {
                    *velocity == fix.velocity_en_mps
                        && fix.is_moving(config.gnss.velocity_mps.white)
                } else {
                    fix.position.is_some()
                        && *position == fix.position
                        && ins.is_moving()
                        && fix.time.seconds_since(*time) < REPEATED_S
                }
            })
        };
        let outcome = match &mut self.mode {
            Mode::Navigating(ins) if repeats(ins) => GnssOutcome::Repeated,
            Mode::Navigating(ins) => {
                let outcome = ins.on_fix(fix, counts, config);
                if outcome == GnssOutcome::Queued
                    && let Some((_, increments)) = &self.inertial
                {
                    ins.on_coning(&increments.unresolved_coning_radps());
                }
                outcome
            }
            Mode::Aligning(alignment) => {
                alignment.on_fix(fix, config);
                if let Some((since, ins)) = &mut self.stopgap {
                    *ins = ins.at_fix(fix);
                    if fix.position.is_some() {
                        *since = fix.time;
                        let late_s = alignment.known().value(index::LATENCY);
                        ins.extrapolate(now.seconds_since(fix.time) + late_s);
                    }
                }
                GnssOutcome::Accepted
            }
        };
        if matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued) {
            self.last_fix = Some((fix.time, fix.velocity_en_mps, fix.position));
        }
        outcome
    }

    fn on_baro(&mut self, height: &BaroHeight) -> Result<(), GnssOutcome> {
        let Some((now, _)) = &self.inertial else {
            return Err(GnssOutcome::NoInertialData);
        };
        if !(height.height_m.is_finite() && height.sigma_m.is_finite()) {
            return Err(GnssOutcome::NotFinite);
        }
        let possible = height.height_m > LOWEST_M && height.height_m < HIGHEST_M;
        if !possible || height.sigma_m <= 0.0 || height.sigma_m >= ANYWHERE_M {
            return Err(GnssOutcome::OutOfRange);
        }
        check_time(height.time, *now)?;
        let climb = self.barometer.take(height)?;
        if let (Mode::Navigating(ins), Some(climb)) = (&mut self.mode, climb) {
            ins.on_climb(&climb);
        }
        Ok(())
    }
}

/// Whether a stamp is near the inertial ones.
fn check_time(time: Time, now: Time) -> Result<(), GnssOutcome> {
    let ahead_s = time.seconds_since(now);
    if ahead_s > LARGEST_OFFSET_S {
        Err(GnssOutcome::TooFarAhead)
    } else if ahead_s < -LARGEST_OFFSET_S {
        Err(GnssOutcome::TooOld)
    } else {
        Ok(())
    }
}

/// Largest magnitudes of a sample's readings, which are finite.
#[derive(Clone, Copy, Debug)]
struct Largest {
    gyro: f64,
    accel: f64,
}

impl Largest {
    fn of(sample: &ImuSample) -> Self {
        Self {
            gyro: math::largest(&sample.gyro),
            accel: math::largest(&sample.accel),
        }
    }

    /// Whether one is beyond the sensors' range, with increments over so many seconds.
    fn beyond_range(self, seconds: f64, config: &Config) -> bool {
        let scale = config.imu_output.per_rate(seconds);
        self.gyro > scale * config.sensors.gyro_range_radps
            || self.accel > scale * config.sensors.accel_range_mps2
    }

    /// Whether one is no reading of such sensors.
    fn out_of_range(self, seconds: f64, config: &Config) -> bool {
        let less = |reading| reading / MORE_THAN_FULL_SCALE;
        let own = Self {
            gyro: less(self.gyro),
            accel: less(self.accel),
        };
        own.beyond_range(seconds, config)
    }
}

/// Variances of the angle and of the velocity that a sample over so many seconds may lack, per body axis: of
/// readings that may be clipped.
#[inline(never)]
fn lost_in_saturation(sample: &ImuSample, seconds: f64, config: &Config) -> [Vector3<f64>; 2] {
    let s = &config.sensors;
    let reading_s = config.imu_output.per_rate(seconds);
    [
        (&sample.gyro, s.gyro_range_radps),
        (&sample.accel, s.accel_range_mps2),
    ]
    .map(|(readings, range)| {
        let lost = BEYOND_RANGE * range * seconds;
        readings.map(|reading| {
            let saturated = math::abs(reading) > range * reading_s;
            if saturated { lost * lost } else { 0.0 }
        })
    })
}

/// Sigmas of a stopgap whose position was last set so many seconds ago, ENU; the variances, m^2, are those
/// of position and height before that.
fn stopgap_sigma(seconds: f64, stale_variance: &[f64; 2]) -> SolutionSigma {
    let seconds = math::max(seconds, 0.0);
    let pulled_mps = GRAVITY_EQUATOR_MPS2 * STOPGAP_RAD * seconds;
    let moved_m = (STOPGAP_MPS + 0.5 * pulled_mps) * seconds;
    let [level_m, height_m] =
        stale_variance.map(|variance| STOPGAP_M + moved_m + math::sqrt(variance));
    SolutionSigma {
        position_m: Vector3::new(level_m, level_m, height_m),
        velocity_mps: Vector3::repeat(STOPGAP_MPS + pulled_mps),
        attitude_rad: Vector3::new(STOPGAP_RAD, STOPGAP_RAD, 1.0),
    }
}

/// Advances a stopgap over an interval.
#[inline(never)]
fn step_stopgap(
    stopgap: &mut Option<(Time, Mechanization)>,
    alignment: &Alignment,
    interval: &Interval,
) {
    if let Some((_, ins)) = stopgap {
        ins.step(&alignment.compensated(interval), &Controls::default());
        *stopgap = stopgap.filter(|(_, ins)| is_possible(ins));
    }
}

/// Extrapolates a stopgap over a gap of so many seconds; a clock that was set back makes it no younger.
#[inline(never)]
fn extrapolate_stopgap(stopgap: &mut Option<(Time, Mechanization)>, seconds: f64) {
    if let Some((since, ins)) = stopgap {
        if seconds > 0.0 {
            ins.extrapolate(math::min(seconds, EXTRAPOLATED_S));
        } else {
            *since = since.plus_seconds(seconds);
        }
    }
}

/// Whether an INS is no faster than any vehicle: else numbers would soon overflow.
fn is_possible(ins: &Mechanization) -> bool {
    ins.velocity_enu_mps.norm_squared() < FASTEST_MPS * FASTEST_MPS
}

/// Whether a fix can be true.
#[inline(never)]
fn check_fix(fix: &GnssFix) -> Result<(), GnssOutcome> {
    let velocity = fix.velocity_enu_mps();
    let position = fix.position.unwrap_or_default();
    let height_m = fix.height_m.unwrap_or_default();
    let place = Vector3::new(position.latitude_rad, position.longitude_rad, height_m);
    let s = &fix.sigma;
    let sigmas = [s.position_m, s.height_m, s.velocity_mps, s.velocity_up_mps];
    let stated = sigmas.iter().flatten().all(|sigma| sigma.is_finite());
    if !(math::all_finite(&velocity) && math::all_finite(&place) && stated) {
        return Err(GnssOutcome::NotFinite);
    }
    if fix.position.is_none()
        && fix.height_m.is_none()
        && fix.velocity_en_mps.is_none()
        && fix.velocity_up_mps.is_none()
    {
        return Err(GnssOutcome::Empty);
    }
    let possible = math::abs(place.x) <= core::f64::consts::FRAC_PI_2
        && math::abs(place.y) <= core::f64::consts::TAU
        && place.z > LOWEST_M
        && place.z < HIGHEST_M
        && velocity.norm_squared() < FASTEST_MPS * FASTEST_MPS;
    possible.then_some(()).ok_or(GnssOutcome::OutOfRange)
}

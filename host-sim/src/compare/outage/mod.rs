//! Simulated GNSS outages all along a log: drift of the unaided INS.
//!
//! Each navigator runs over the log once, and a copy of it over every outage without fixes.

mod ins;
#[cfg(feature = "peers")]
mod peer;

use ins_core::earth::Geodetic;
use ins_core::{Config, ConfigError, GnssFix, Navigator, Phase, Solution, Time};
use nalgebra::Vector2;
use serde::Serialize;

use crate::compare::kalman::{Filter, Noise, Run};
use crate::identify::free_inertial::{known, value};
use crate::identify::run::{Event, Settling, in_order_of_time};
use crate::log::Log;
use crate::page::brief;
use crate::page::table::{Table, heads};
use crate::statistics::rms;
use ins::Ins;

/// Duration of an outage, and interval between their starts, s.
pub const OUTAGE_S: f64 = 30.0;
pub(crate) const STRIDE_S: f64 = 10.0;
/// Aided navigation before the first outage, s: as long as an outage.
pub(crate) const SETTLE_S: f64 = OUTAGE_S;
/// Largest age of the last fix at which an outage may begin, s; older, the log has an outage of its own.
pub(crate) const FIX_AGE_S: f64 = 1.5;
/// Largest age of the last reference point at the end of an outage, s.
const REFERENCE_AGE_S: f64 = 1.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// The true motion of a simulation.
    Truth,
    /// The fixes withheld from the navigators.
    Gnss,
}

/// All navigators over the same outages.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutageTest {
    pub against: Reference,
    /// Root mean square of the drifts of each.
    pub navigators: Vec<Drifts>,
}

/// Horizontal errors in one outage: at its end, and largest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Drift {
    /// Start, since the first sample, s.
    pub start_s: f64,
    pub position_end_m: f64,
    pub velocity_end_mps: f64,
    pub position_max_m: f64,
    pub velocity_max_mps: f64,
}

/// One navigator over all outages: RMS at their ends, and the largest in any.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drifts {
    pub navigator: &'static str,
    pub count: usize,
    pub position_rms_m: f64,
    pub position_max_m: f64,
    pub velocity_rms_mps: f64,
    pub velocity_max_mps: f64,
    #[serde(skip)]
    pub outages: Vec<Drift>,
}

impl Drifts {
    fn new(navigator: &'static str, outages: Vec<Drift>) -> Self {
        let rms = |value: fn(&Drift) -> f64| rms(outages.iter().map(value));
        let most = |value: fn(&Drift) -> f64| outages.iter().map(value).fold(0.0, f64::max);
        Self {
            navigator,
            count: outages.len(),
            position_rms_m: rms(|drift| drift.position_end_m),
            position_max_m: most(|drift| drift.position_max_m),
            velocity_rms_mps: rms(|drift| drift.velocity_end_mps),
            velocity_max_mps: most(|drift| drift.velocity_max_mps),
            outages,
        }
    }
}

/// Places outages all along a log, and runs every navigator over them; `None` where none fits.
pub fn test(
    log: &Log,
    simulated: bool,
    config: Config,
    noise: Noise,
) -> Result<Option<OutageTest>, ConfigError> {
    let Some(plan) = OutagePlan::new(log, simulated, config)? else {
        return Ok(None);
    };
    let against = if simulated {
        Reference::Truth
    } else {
        Reference::Gnss
    };
    let navigators = plan.navigators(config, noise)?;
    Ok(navigators.map(|navigators| OutageTest {
        against,
        navigators,
    }))
}

/// Drifts over the outages in which all navigators had a solution; `None` where there is none.
fn in_common(navigators: &[Drifts]) -> Option<Vec<Drifts>> {
    let in_all = |outage: &Drift| {
        let same = |other: &Drift| other.start_s.total_cmp(&outage.start_s).is_eq();
        navigators
            .iter()
            .all(|drifts| drifts.outages.iter().any(same))
    };
    let common = |drifts: &Drifts| {
        let outages = drifts.outages.iter().copied().filter(in_all);
        Drifts::new(drifts.navigator, outages.collect())
    };
    let all: Vec<Drifts> = navigators.iter().map(common).collect();
    all.first()
        .is_some_and(|first| first.count > 0)
        .then_some(all)
}

impl OutageTest {
    pub(crate) fn table(&self) -> Table {
        let against = match self.against {
            Reference::Truth => "the truth",
            Reference::Gnss => "the fixes kept from the navigators",
        };
        let title = format!(
            "Horizontal drift over {OUTAGE_S:.0} s without GNSS, against {against}; one outage \
             every {STRIDE_S:.0} s"
        );
        let header = heads("| outages | RMS, m | largest, m | RMS, m/s | largest, m/s");
        let row = |drifts: &Drifts| {
            let numbers = [
                drifts.position_rms_m,
                drifts.position_max_m,
                drifts.velocity_rms_mps,
                drifts.velocity_max_mps,
            ];
            let mut cells = vec![drifts.navigator.to_owned(), drifts.count.to_string()];
            cells.extend(numbers.map(brief));
            cells
        };
        Table::of(title, header, self.navigators.iter().map(row))
    }
}

/// The outages of a log, and the reference of the drifts.
#[derive(Clone, Debug)]
pub(crate) struct OutagePlan<'a> {
    log: &'a Log,
    #[cfg(feature = "peers")]
    latency_s: f64,
    starts: Vec<Time>,
    reference: Vec<Point>,
}

/// Reference motion at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    time: Time,
    position: Geodetic,
    /// Delay of the position relative to that time, s: a receiver's may be later than its velocities.
    position_delay_s: f64,
    velocity_en_mps: Vector2<f64>,
}

impl<'a> OutagePlan<'a> {
    /// From the time at which the core has settled and, if it ever does, observes the azimuth; `None` where
    /// no outage fits.
    ///
    /// Recorded logs have no truth: their reference is the fixes withheld from the navigators, with the
    /// delays that the core estimates.
    pub(crate) fn new(
        log: &'a Log,
        simulated: bool,
        config: Config,
    ) -> Result<Option<Self>, ConfigError> {
        let (first, delays_s) = settling_and_delays(log, config)?;
        let reference: Vec<Point> = if simulated {
            log.truth.iter().map(true_point).collect()
        } else {
            let fixes = log.gnss.iter();
            fixes.filter_map(|fix| fix_point(fix, delays_s)).collect()
        };
        let plan = Self {
            log,
            #[cfg(feature = "peers")]
            latency_s: delays_s[0],
            starts: first.map_or_else(Vec::new, |first| starts(log, first, &reference)),
            reference,
        };
        Ok((!plan.starts.is_empty()).then_some(plan))
    }

    /// Drifts of all navigators, the core first, then the Kalman filter; `None` where there is no outage in
    /// which each of them has a solution.
    pub(crate) fn navigators(
        &self,
        config: Config,
        noise: Noise,
    ) -> Result<Option<Vec<Drifts>>, ConfigError> {
        let (core, kalman) = rayon::join(|| self.core(config), || self.kalman(config, noise));
        #[allow(unused_mut, reason = "peers are a feature")]
        let mut navigators = vec![core?, kalman?];
        #[cfg(feature = "peers")]
        navigators.push(self.peer(config, noise)?);
        Ok(in_common(&navigators))
    }

    pub(crate) fn core(&self, config: Config) -> Result<Drifts, ConfigError> {
        let core = Navigator::new(config)?;
        Ok(Drifts::new("compensation", self.drifts(core)))
    }

    #[cfg(feature = "peers")]
    fn peer(&self, config: Config, noise: Noise) -> Result<Drifts, ConfigError> {
        let peer = peer::Peer::new(config, noise, self.latency_s)?;
        Ok(Drifts::new("fusion-nav", self.drifts(peer)))
    }

    /// The Kalman filter over them. It is at the fixes' times less latency, not at their stamps.
    fn kalman(&self, config: Config, noise: Noise) -> Result<Drifts, ConfigError> {
        let imu = self.log.imu.all();
        let mut run = Run::new(&imu, &self.log.gnss, config, noise)?;
        let mut drifts = Vec::new();
        let mut starts = self.starts.iter().peekable();
        while let Some(time) = run.step(&mut |_, _| {}) {
            let latency_s = run.filter().map_or(0.0, |filter| filter.nominal.latency_s);
            let reached = |start: &&Time| start.plus_seconds(-latency_s) <= time;
            while let Some(start) = starts.next_if(reached) {
                let mut run = run.clone();
                run.ignore_fixes_from(*start);
                drifts.extend(self.drift(*start, || {
                    run.step(&mut |_, _| {})?;
                    Some(run.filter().map(Filter::solution))
                }));
            }
        }
        Ok(Drifts::new("Kalman", drifts))
    }

    /// Any INS over them, each from the sample after the last one processed.
    fn drifts<I: Ins>(&self, mut ins: I) -> Vec<Drift> {
        let log = self.log;
        let mut drifts = Vec::new();
        let mut starts = self.starts.iter().peekable();
        for event in in_order_of_time(log.imu.iter(), &log.gnss) {
            let now = event.time();
            while let Some(start) = starts.next_if(|start| **start <= now) {
                let (mut unaided, mut samples) = (ins.clone(), log.imu.since(*start));
                drifts.extend(self.drift(*start, || {
                    unaided.on_imu(&samples.next()?);
                    Some(unaided.solution())
                }));
            }
            match event {
                Event::Imu(sample) => ins.on_imu(&sample),
                Event::Gnss(fix) => ins.on_gnss(fix),
            }
        }
        drifts
    }

    /// Drift in an outage that begins at `start`, until the reference or the log ends; none of a navigator
    /// without a solution somewhere in it, as one that aligns after a gap.
    fn drift(
        &self,
        start: Time,
        mut step: impl FnMut() -> Option<Option<Solution>>,
    ) -> Option<Drift> {
        let after = |time: Time| self.reference.partition_point(|point| point.time <= time);
        let outage = after(start)..after(start.plus_seconds(OUTAGE_S));
        let mut points = self.reference[outage].iter().peekable();
        let mut drift = Drift {
            start_s: start.seconds_since(self.log.start()),
            ..Drift::default()
        };
        while points.peek().is_some()
            && let Some(solution) = step()
        {
            let solution = solution?;
            while let Some(point) = points.next_if(|point| point.time <= solution.time) {
                drift.add(&solution, point);
            }
        }
        Some(drift)
    }
}

impl Drift {
    /// Adds the next reference point; the solution is at most a sample later.
    fn add(&mut self, solution: &Solution, point: &Point) {
        let since_s = solution.time.seconds_since(point.time);
        let velocity = solution.velocity_enu_mps.xy();
        let moved_m = (since_s + point.position_delay_s) * velocity;
        let position = solution.position.enu_from(&point.position).xy() - moved_m;
        self.position_end_m = position.norm();
        self.velocity_end_mps = (velocity - point.velocity_en_mps).norm();
        self.position_max_m = self.position_max_m.max(self.position_end_m);
        self.velocity_max_mps = self.velocity_max_mps.max(self.velocity_end_mps);
    }
}

/// From the core over the whole log: when outages may begin, and final latency and position delay, where
/// observable, s.
fn settling_and_delays(log: &Log, config: Config) -> Result<(Option<Time>, [f64; 2]), ConfigError> {
    let mut navigator = Navigator::new(config)?;
    let mut settling = Settling::default();
    for event in in_order_of_time(log.imu.iter(), &log.gnss) {
        if let Some(sample) = event.give_to(&mut navigator) {
            let navigates = navigator.phase() == Phase::Navigating;
            settling.at(sample.time, navigates, SETTLE_S, || {
                known(&navigator.estimates().azimuth_error_rad)
            });
        }
    }
    let Settling {
        settled,
        azimuth_known,
        ..
    } = settling;
    let first = settled.map(|settled| settled.max(azimuth_known.unwrap_or(settled)));
    let found = navigator.estimates();
    let delays = [found.gnss_latency_s, found.gnss_position_delay_s];
    Ok((first, delays.map(|delay| value(&delay))))
}

fn true_point(truth: &Solution) -> Point {
    Point {
        time: truth.time,
        position: truth.position,
        position_delay_s: 0.0,
        velocity_en_mps: truth.velocity_enu_mps.xy(),
    }
}

/// A fix at its time less latency, if it has position and velocity.
fn fix_point(fix: &GnssFix, [latency_s, position_delay_s]: [f64; 2]) -> Option<Point> {
    Some(Point {
        time: fix.time.plus_seconds(-latency_s),
        position: fix.geodetic_or(0.0)?,
        position_delay_s,
        velocity_en_mps: fix.velocity_en_mps?,
    })
}

/// Starts of outages at whole strides, with a fix before and a reference at the end.
fn starts(log: &Log, first: Time, reference: &[Point]) -> Vec<Time> {
    let has_fix = |start: Time| {
        let before = &log.gnss[..log.gnss.partition_point(|fix| fix.time < start)];
        let last = before.iter().rfind(|fix| fix.velocity_en_mps.is_some());
        last.is_some_and(|fix| start.seconds_since(fix.time) < FIX_AGE_S)
    };
    let has_reference = |end: Time| {
        let until = &reference[..reference.partition_point(|point| point.time <= end)];
        until
            .last()
            .is_some_and(|point| end.seconds_since(point.time) < REFERENCE_AGE_S)
    };
    let last = log.imu.last().map_or(first, |sample| sample.time);
    let next = |start: &Time| Some(start.plus_seconds(STRIDE_S));
    std::iter::successors(Some(first), next)
        .take_while(|start| start.plus_seconds(OUTAGE_S) <= last)
        .filter(|start| has_fix(*start) && has_reference(start.plus_seconds(OUTAGE_S)))
        .collect()
}

//! Maximum likelihood of the gyro models (3) and (4) over all drives at once.

use super::filter::{Answer, Candidate, Class, Dynamics, filter};
use super::interval::{self, Interval, Measured, NORMAL_95};
use super::maximum::{crossing, curvature, maximum};
use super::record::Record;
use crate::sim::errors::Law;
use crate::sim::receiver::Correlated;

/// Twice the log-likelihood falls by chi-square of one degree of freedom, 95 %: 3.84.
const DROP: f64 = 1.92;
/// Of two degrees of freedom: 5.99.
const DROP_OF_TWO: f64 = 3.0;
/// Logarithm of a spread that is none.
const NONE: f64 = -60.0;
/// Times of a memory of GNSS that are tried, s. Shorter ones are noise to epochs, longer ones
/// errors of the INS.
const MEMORIES_S: [f64; 3] = [3.0, 15.0, 100.0];
/// Log-likelihoods closer than this are equal: on the way, and at the top itself.
const TOLERANCE: f64 = 0.02;
const TOP_TOLERANCE: f64 = 0.001;
/// And where a bound is sought of which that decides little.
const ROUGH_TOLERANCE: f64 = 0.1;
/// Step of the numerical curvature in the logarithm of a parameter.
const CURVATURE_STEP: f64 = 0.03;
/// A bound further away than this factor is none.
const BOUNDLESS: f64 = 1e3;
/// As far as this factor a parameter without a bound is followed.
const FAR: f64 = 5.0;
/// Weight, of the greatest, below which an interval between jumps is out of the question.
const NEGLIGIBLE: f64 = 1e-3;
/// Log-likelihood below the greatest at which an interval is not looked at again.
const UNLIKELY: f64 = 12.0;
/// Most points at which the likelihood of the interval is looked at again.
const REFINEMENTS: usize = 60;
/// A walk of the bias is tried as jumps so many seconds apart.
const WALK_S: f64 = 10.0;
/// Upper over lower bound beyond which an interval between jumps is not known.
const VAGUE: f64 = 3.0;
/// By how much the log-likelihood of (3) must exceed that of (4) to be preferred: its interval is the
/// best of some fifty that differ, ln 50.
const PREFERENCE: f64 = 4.0;

/// What all drives say of the gyros and of GNSS velocity; SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroFit {
    /// Root of the noise density, rad/sqrt(s).
    pub noise: Interval,
    /// Noise of a GNSS velocity component, m/s, white with the density that the fixes have.
    pub gnss_sigma_mps: Interval,
    /// Part of it with a memory, m/s; zero if none is seen.
    pub gnss_memory_mps: Interval,
    /// Correlation time of that, s.
    pub gnss_memory_s: Interval,
    /// Run-to-run spread at the start, or of the constant, rad/s.
    pub initial_sigma: Interval,
    /// How they move after that: in jumps, or as correlated noise over a trend.
    pub law: Law,
    /// Mean of a jump, rad/s, or run-to-run spread of the trend, rad/s^2.
    pub drift: Interval,
    /// Spread of a jump, or standard deviation of the correlated part, rad/s.
    pub size: Interval,
    /// Interval between jumps, or correlation time, s.
    pub time_s: Interval,
    /// Log-likelihood, up to a constant that is the same for both models.
    pub log_likelihood: f64,
    /// Drives behind it.
    pub drives: usize,
}

impl GyroFit {
    /// Whether the biases were seen to move at random.
    pub fn moves(&self) -> bool {
        self.size.is_spread()
    }

    /// Whether the noise of GNSS velocity was seen to have a memory.
    pub fn remembers(&self) -> bool {
        self.gnss_memory_mps.is_spread()
    }

    /// Whether the time scale of that is known.
    pub fn has_time_scale(&self) -> bool {
        self.moves() && self.time_s.high < VAGUE * VAGUE * self.time_s.low
    }
}

/// Fits one model, or the likelier of the two.
pub fn fit(
    records: &[Record],
    accel_noise: f64,
    class: Class,
    law: Option<Law>,
) -> Option<GyroFit> {
    let drives: Vec<&Record> = (records.iter())
        .filter(|record| !record.epochs.is_empty())
        .collect();
    if drives.is_empty() {
        return None;
    }
    let fitter = Fitter {
        drives,
        accel_noise,
        class,
    };
    let start = fitter.start();
    Some(match law {
        Some(Law::Wave) => fitter.wave(&start),
        Some(Law::Continuous) => fitter.continuous(&start),
        None => {
            let (wave, continuous) = (fitter.wave(&start), fitter.continuous(&start));
            let gain = wave.log_likelihood - continuous.log_likelihood;
            if wave.has_time_scale() && gain > PREFERENCE {
                wave
            } else {
                continuous
            }
        }
    })
}

/// Log-likelihood, its curvature in the logarithms of (noise, GNSS noise, size and time of the
/// random part) at given values: the information behind the bound of Cramer and Rao.
pub fn information(records: &[Record], at: &Candidate) -> nalgebra::Matrix4<f64> {
    let fitter = Fitter {
        drives: records.iter().collect(),
        accel_noise: at.accel_noise,
        class: at.class,
    };
    let Dynamics { law, size, time_s } = at.dynamics;
    let point = [at.gyro_noise, at.gnss_sigma_mps, size, time_s].map(libm::log);
    let Correlated { sigma, time_s } = at.gnss_memory;
    let [memory, memory_time] = [sigma.max(libm::exp(NONE)), time_s.max(1.0)].map(libm::log);
    let f = |x: &[f64; 4]| {
        let point = Point {
            noise: x[0],
            gnss: x[1],
            memory,
            memory_time,
            size: x[2],
            time: x[3],
        };
        fitter.at(law, &point)
    };
    -curvature(f, point, CURVATURE_STEP)
}

struct Fitter<'a> {
    drives: Vec<&'a Record>,
    accel_noise: f64,
    class: Class,
}

/// Logarithms of the parameters of a model: gyro noise, GNSS noise, size and time of its memory,
/// size and time of the random part of the biases.
#[derive(Clone, Copy)]
struct Point {
    noise: f64,
    gnss: f64,
    memory: f64,
    memory_time: f64,
    size: f64,
    time: f64,
}

/// A point and the log-likelihood there.
#[derive(Clone, Copy)]
struct Top {
    at: Point,
    value: f64,
}

/// Where every model begins.
struct Start {
    /// Biases that do not move.
    still: Top,
    /// Biases that walk at random.
    walk: Top,
}

impl Fitter<'_> {
    fn candidate(&self, law: Law, point: &Point) -> Candidate {
        Candidate {
            gyro_noise: libm::exp(point.noise),
            accel_noise: self.accel_noise,
            gnss_sigma_mps: libm::exp(point.gnss),
            gnss_memory: Correlated {
                sigma: libm::exp(point.memory),
                time_s: libm::exp(point.memory_time),
            },
            dynamics: Dynamics {
                law,
                size: libm::exp(point.size),
                time_s: libm::exp(point.time),
            },
            class: self.class,
        }
    }

    /// What the drives say at a point.
    fn answers(&self, law: Law, at: &Point) -> Vec<Answer> {
        let candidate = self.candidate(law, at);
        let filter = |record: &&Record| filter(record, &candidate);
        self.drives.iter().map(filter).collect()
    }

    /// Log-likelihood at a point.
    fn at(&self, law: Law, point: &Point) -> f64 {
        let candidate = self.candidate(law, point);
        let sum: f64 = (self.drives.iter())
            .map(|record| filter(record, &candidate).log_likelihood)
            .sum();
        // Variances beyond all sense overflow.
        if sum.is_finite() {
            sum
        } else {
            f64::NEG_INFINITY
        }
    }

    fn top(&self, law: Law, at: Point) -> Top {
        let value = self.at(law, &at);
        Top { at, value }
    }

    /// The best of the points that so many numbers stand for.
    fn best<const N: usize>(
        &self,
        law: Law,
        start: [f64; N],
        step: [f64; N],
        tolerance: f64,
        point: impl Fn(&[f64; N]) -> Point,
    ) -> Top {
        let (x, value) = maximum(|x| self.at(law, &point(x)), start, step, tolerance);
        Top {
            at: point(&x),
            value,
        }
    }

    /// The memory of GNSS is told from biases that move, and both from noise.
    fn start(&self) -> Start {
        let still = self.still();
        let walk = self.walk(&still);
        let walk = self.with_memory(&walk);
        let still = self.top(
            Law::Continuous,
            Point {
                memory: walk.at.memory,
                memory_time: walk.at.memory_time,
                ..still.at
            },
        );
        Start { still, walk }
    }

    /// Biases that do not move.
    fn still(&self) -> Top {
        let point = |x: &[f64; 2]| Point {
            noise: x[0],
            gnss: x[1],
            memory: NONE,
            memory_time: libm::log(MEMORIES_S[1]),
            size: NONE,
            time: 5.0,
        };
        // From lasers to the worst of MEMS: the likelihood has one top, but a long way off.
        let starts = [1e-6, 1e-5, 1e-4, 1e-3].map(libm::log);
        let gnss = libm::log(0.1);
        let at = |noise: f64| self.at(Law::Continuous, &point(&[noise, gnss]));
        let start = (starts.into_iter())
            .max_by(|a, b| at(*a).total_cmp(&at(*b)))
            .unwrap_or(starts[1]);
        let law = Law::Continuous;
        self.best(law, [start, gnss], [0.7, 0.3], TOLERANCE, point)
    }

    /// With what noise of GNSS has a memory, if that makes the drives likelier than chance would.
    fn with_memory(&self, without: &Top) -> Top {
        let point = |x: &[f64; 5]| Point {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            memory: x[3],
            memory_time: remembered(x[4]),
            ..without.at
        };
        let Point {
            noise, gnss, size, ..
        } = without.at;
        let starts = MEMORIES_S.map(|time| [noise, gnss, size, gnss - 2.0, libm::log(time)]);
        let at = |x: &[f64; 5]| self.at(Law::Wave, &point(x));
        let start = (starts.into_iter())
            .max_by(|a, b| at(a).total_cmp(&at(b)))
            .unwrap_or(starts[1]);
        // A memory that makes drives less likely by its first bit is none.
        if at(&start) <= without.value {
            return *without;
        }
        let step = [-0.1, -0.1, -0.2, 0.7, 0.5];
        let with = self.best(Law::Wave, start, step, TOLERANCE, point);
        if with.value > without.value + DROP_OF_TWO {
            with
        } else {
            *without
        }
    }

    /// Length of the longest drive, s.
    fn longest_s(&self) -> f64 {
        (self.drives.iter())
            .map(|record| record.duration_s)
            .fold(0.0, f64::max)
    }

    // --- (4) ---

    fn continuous(&self, start: &Start) -> GyroFit {
        let top = self.polished(Law::Continuous, self.continuous_top(&start.still));
        let size = self.size_interval(Law::Continuous, &top, start.still.value);
        let time = self.time_interval(&top);
        self.assemble(Law::Continuous, &top, [size, time])
    }

    fn continuous_top(&self, still: &Top) -> Top {
        // What the noise of ten minutes hides.
        let unit = still.at.noise - 0.5 * libm::log(600.0);
        let longest = libm::log(self.longest_s());
        let sizes = [0.3_f64, 1.0, 3.0, 10.0].map(|by| unit + libm::log(by));
        let times = [20.0_f64, 60.0, 200.0, 600.0, 2000.0].map(libm::log);
        let mut start: Option<Top> = None;
        for size in sizes {
            for time in times.into_iter().filter(|time| *time < longest) {
                let at = Point {
                    size,
                    time,
                    ..still.at
                };
                let top = self.top(Law::Continuous, at);
                if start.is_none_or(|start| top.value > start.value) {
                    start = Some(top);
                }
            }
        }
        let start = start.unwrap_or(*still).at;
        let point = |x: &[f64; 4]| Point {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            time: bounded(x[3], longest),
            ..start
        };
        let from = [start.noise, start.gnss, start.size, start.time];
        let step = [-0.1, 0.02, 0.4, 0.6];
        self.best(Law::Continuous, from, step, TOP_TOLERANCE, point)
    }

    /// Profile over the size of the random part. The noises are left where they are: they hardly
    /// move with it.
    fn size_interval(&self, law: Law, top: &Top, still: f64) -> Interval {
        let longest = libm::log(self.longest_s());
        let profile = |size: f64| {
            let point = |x: &[f64; 1]| Point {
                size,
                time: bounded(x[0], longest),
                ..top.at
            };
            let value = match law {
                Law::Wave => self.at(law, &Point { size, ..top.at }),
                Law::Continuous => {
                    let from = [top.at.time];
                    self.best(law, from, [0.3], TOLERANCE, point).value
                }
            };
            value - top.value + DROP
        };
        let low = if still - top.value + DROP > 0.0 {
            0.0
        } else {
            libm::exp(bound(profile, top.at.size, -0.3))
        };
        Interval {
            value: libm::exp(top.at.size),
            low,
            high: libm::exp(bound(profile, top.at.size, 0.3)),
        }
    }

    fn time_interval(&self, top: &Top) -> Interval {
        let profile = |time: f64| {
            let point = |x: &[f64; 1]| Point {
                size: x[0],
                time,
                ..top.at
            };
            let best = self.best(Law::Continuous, [top.at.size], [0.2], TOLERANCE, point);
            best.value - top.value + DROP
        };
        Interval {
            value: libm::exp(top.at.time),
            low: libm::exp(bound(profile, top.at.time, -0.4)),
            high: libm::exp(bound(profile, top.at.time, 0.4)),
        }
    }

    // --- (3) ---

    fn wave(&self, start: &Start) -> GyroFit {
        let (top, interval_s) = self.wave_top(&start.walk);
        let top = self.polished(Law::Wave, top);
        let jump_sigma = self.size_interval(Law::Wave, &top, start.still.value);
        self.assemble(Law::Wave, &top, [jump_sigma, interval_s])
    }

    fn wave_top(&self, walk: &Top) -> (Top, Interval) {
        let scan = Scan::new(self, walk.at);
        let (time, _) = scan.best();
        // Size at that interval, then the interval anew with it.
        let point = |x: &[f64; 3]| Point {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            time,
            ..walk.at
        };
        let start = [walk.at.noise, walk.at.gnss, scan.size(time)];
        let near = self.best(Law::Wave, start, [-0.1, 0.02, 0.3], TOP_TOLERANCE, point);
        let mut scan = scan.again(near.at);
        scan.refine();
        let (time, value) = scan.best();
        let at = Point {
            size: scan.size(time),
            time,
            ..near.at
        };
        (Top { at, value }, scan.interval())
    }

    /// The bias as a random walk: its rate is known long before its steps are.
    fn walk(&self, still: &Top) -> Top {
        let Point { noise, gnss, .. } = still.at;
        let point = |x: &[f64; 3]| Point {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            time: libm::log(WALK_S),
            ..still.at
        };
        let unit = noise - libm::log(600.0) + 0.5 * libm::log(WALK_S);
        let sizes = [0.3_f64, 1.0, 3.0, 10.0].map(|by| unit + libm::log(by));
        let at = |size: f64| self.at(Law::Wave, &point(&[noise, gnss, size]));
        let size = (sizes.into_iter())
            .max_by(|a, b| at(*a).total_cmp(&at(*b)))
            .unwrap_or(unit);
        let start = [noise, gnss, size];
        self.best(Law::Wave, start, [-0.1, 0.02, 0.4], TOLERANCE, point)
    }

    // --- both ---

    /// With the memory of GNSS found again, now that the biases move as they do.
    fn polished(&self, law: Law, top: Top) -> Top {
        let Point {
            noise,
            gnss,
            memory,
            memory_time,
            size,
            ..
        } = top.at;
        if memory == NONE {
            return top;
        }
        let point = |x: &[f64; 5]| Point {
            noise: x[0],
            gnss: x[1],
            memory: x[2],
            memory_time: remembered(x[3]),
            size: x[4],
            ..top.at
        };
        let start = [noise, gnss, memory, memory_time, size];
        let step = [-0.5, -0.05, 0.3, 0.8, 0.2];
        self.best(law, start, step, TOP_TOLERANCE, point)
    }

    /// With size and time of the random part as found.
    fn assemble(&self, law: Law, top: &Top, [size, time_s]: [Interval; 2]) -> GyroFit {
        let answers = self.answers(law, &top.at);
        let open = (bounds(&size).map(|size| Point { size, ..top.at }).iter())
            .chain(&bounds(&time_s).map(|time| Point { time, ..top.at }))
            .map(|at| self.answers(law, at))
            .collect::<Vec<_>>();
        let of_all = |of: fn(&Answer) -> [Measured; 3], found: fn(&[Measured]) -> Interval| {
            let found =
                |answers: &[Answer]| found(&answers.iter().flat_map(of).collect::<Vec<Measured>>());
            open.iter()
                .fold(found(&answers), |best, other| best.reaching(&found(other)))
        };
        let initial_sigma = of_all(|answer| answer.constants, interval::sigma_behind);
        let drift = of_all(
            |answer| answer.trends,
            match law {
                Law::Wave => {
                    |trends| interval::mean(trends).unwrap_or(interval::common_value(trends))
                }
                Law::Continuous => interval::sigma_behind,
            },
        );
        let [noise, gnss_sigma_mps, gnss_memory_mps, gnss_memory_s] =
            self.noise_intervals(law, top);
        let (trend_mean, trend_sigma) = match law {
            Law::Wave => (drift.value, 0.0),
            Law::Continuous => (0.0, drift.value),
        };
        let log_likelihood = (answers.iter())
            .map(|answer| answer.marginal(initial_sigma.value, trend_mean, trend_sigma))
            .sum();
        GyroFit {
            noise,
            gnss_sigma_mps,
            gnss_memory_mps,
            gnss_memory_s,
            initial_sigma,
            law,
            drift,
            size,
            time_s,
            log_likelihood,
            drives: self.drives.len(),
        }
    }

    /// By the curvature in the logarithms, with the size of the random part free. A memory that was
    /// not seen is zero, and has the bound of one of 15 s.
    fn noise_intervals(&self, law: Law, top: &Top) -> [Interval; 4] {
        let f = |x: &[f64; 5]| {
            let at = Point {
                noise: x[0],
                gnss: x[1],
                memory: x[2],
                memory_time: x[3],
                size: x[4],
                ..top.at
            };
            self.at(law, &at)
        };
        let Point {
            noise,
            gnss,
            memory,
            memory_time,
            size,
            ..
        } = top.at;
        let at = [noise, gnss, memory, memory_time, size];
        let information = -curvature(f, at, CURVATURE_STEP);
        // Without a random part its row is flat, and so is that of a memory.
        let variance = (information + nalgebra::Matrix5::identity() * 1e-6)
            .try_inverse()
            .unwrap_or_default();
        let interval = |which: usize| {
            let half = NORMAL_95 * variance[(which, which)].max(0.0).sqrt();
            Interval {
                value: libm::exp(at[which]),
                low: libm::exp(at[which] - half),
                high: libm::exp(at[which] + half),
            }
        };
        let [memory, memory_time] = if memory == NONE {
            [self.no_memory(law, top), interval(3)]
        } else {
            self.memory_intervals(law, top)
        };
        [interval(0), interval(1), memory, memory_time]
    }

    /// Profiles, for neither is normal: a short memory is a white noise.
    fn memory_intervals(&self, law: Law, top: &Top) -> [Interval; 2] {
        let Point {
            noise,
            memory,
            memory_time,
            ..
        } = top.at;
        let below = |start: [f64; 2], point: &dyn Fn(&[f64; 2]) -> Point| {
            let best = self.best(law, start, [-0.3, 0.3], ROUGH_TOLERANCE, point);
            best.value - top.value + DROP
        };
        let of_size = |memory: f64| {
            below([noise, memory_time], &|x| Point {
                noise: x[0],
                memory,
                memory_time: remembered(x[1]),
                ..top.at
            })
        };
        let of_time = |memory_time: f64| {
            below([noise, memory], &|x| Point {
                noise: x[0],
                memory: x[1],
                memory_time,
                ..top.at
            })
        };
        let around = |profile: &dyn Fn(f64) -> f64, top: f64| {
            let [low, high] = [-0.3, 0.3].map(|step| libm::exp(bound(profile, top, step)));
            let value = libm::exp(top);
            Interval { value, low, high }
        };
        [around(&of_size, memory), around(&of_time, memory_time)]
    }

    fn no_memory(&self, law: Law, top: &Top) -> Interval {
        let profile = |memory: f64| self.at(law, &Point { memory, ..top.at }) - top.value + DROP;
        Interval {
            value: 0.0,
            low: 0.0,
            high: libm::exp(bound(profile, top.at.gnss - 3.0, 0.5)),
        }
    }
}

/// Logarithms of both bounds; of a side without one, of what is far.
fn bounds(interval: &Interval) -> [f64; 2] {
    let Interval { value, low, high } = *interval;
    let near = [value / FAR, value * FAR];
    [low.max(near[0]), high.min(near[1])].map(libm::log)
}

/// Correlation times that a drive can tell from a constant and a trend, as logarithms.
fn bounded(time: f64, longest: f64) -> f64 {
    time.clamp(libm::log(2.0), longest + 1.0)
}

/// Times of a memory that are tried, as logarithms.
fn remembered(time: f64) -> f64 {
    time.clamp(libm::log(MEMORIES_S[0]), libm::log(MEMORIES_S[2]))
}

/// Where a profile falls below zero on the way from its top; infinite if it never does.
fn bound(profile: impl Fn(f64) -> f64, top: f64, step: f64) -> f64 {
    let (mut inside, mut step) = (top, step);
    loop {
        let next = inside + step;
        if profile(next) < 0.0 {
            return crossing(profile, inside, next, 4);
        }
        inside = next;
        step *= 1.6;
        if (inside - top).abs() > libm::log(BOUNDLESS) {
            return f64::INFINITY * step.signum();
        }
    }
}

/// Log-likelihood over the interval between jumps, at the rate of a walk.
struct Scan<'a> {
    fitter: &'a Fitter<'a>,
    top: Point,
    /// Logarithm of the interval, and the value there; ascending.
    points: Vec<(f64, f64)>,
}

impl<'a> Scan<'a> {
    fn new(fitter: &'a Fitter<'a>, top: Point) -> Self {
        let longest_s = fitter.longest_s();
        let mut scan = Self {
            fitter,
            top,
            points: Vec::new(),
        };
        let (mut time, end) = (libm::log(WALK_S), libm::log(0.5 * longest_s));
        while time < end {
            scan.points.push((time, scan.value(time)));
            // A jump is seen to within the time that noise needs to hide it; the last one moves
            // by as many intervals as went before.
            let seen_s = libm::exp(2.0 * (top.noise - scan.size(time)));
            time += (seen_s / longest_s).clamp(0.008, 0.1);
        }
        scan
    }

    /// The likely points anew, about another top.
    fn again(&self, top: Point) -> Self {
        let least = self.best().1 - UNLIKELY;
        let mut scan = Self {
            fitter: self.fitter,
            top,
            points: Vec::new(),
        };
        // With their neighbours, so that the likely ones lie inside.
        let likely = |at: usize| {
            let near = self.points[at.saturating_sub(1)..].iter().take(3);
            near.into_iter().any(|point| point.1 > least)
        };
        scan.points = (0..self.points.len())
            .filter(|at| likely(*at))
            .map(|at| (self.points[at].0, scan.value(self.points[at].0)))
            .collect();
        scan
    }

    /// Size of the jumps that keeps the rate of the walk.
    fn size(&self, time: f64) -> f64 {
        self.top.size + 0.5 * (time - self.top.time)
    }

    fn value(&self, time: f64) -> f64 {
        let point = Point {
            size: self.size(time),
            time,
            ..self.top
        };
        self.fitter.at(Law::Wave, &point)
    }

    fn best(&self) -> (f64, f64) {
        (self.points.iter())
            .copied()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((libm::log(WALK_S), f64::NEG_INFINITY))
    }

    /// Adds points where the likelihood is, widest gaps first.
    fn refine(&mut self) {
        for _ in 0..REFINEMENTS {
            let top = self.best().1;
            let mass = |pair: &[(f64, f64)]| {
                let weight = libm::exp(pair[0].1 - top) + libm::exp(pair[1].1 - top);
                if weight > NEGLIGIBLE {
                    weight * (pair[1].0 - pair[0].0)
                } else {
                    0.0
                }
            };
            let widest = (self.points.windows(2).enumerate())
                .max_by(|a, b| mass(a.1).total_cmp(&mass(b.1)))
                .map(|(at, pair)| (at, 0.5 * (pair[0].0 + pair[1].0), mass(pair)));
            let Some((at, time, mass)) = widest else {
                return;
            };
            if mass <= 0.0 {
                return;
            }
            self.points.insert(at + 1, (time, self.value(time)));
        }
    }

    /// Where 95 % of the likelihood lie.
    fn interval(&self) -> Interval {
        let (best, top) = self.best();
        let mut sums = vec![(self.points[0].0, 0.0)];
        let mut sum = 0.0;
        for pair in self.points.windows(2) {
            let weight = libm::exp(pair[0].1 - top) + libm::exp(pair[1].1 - top);
            sum += 0.5 * weight * (pair[1].0 - pair[0].0);
            sums.push((pair[1].0, sum));
        }
        let quantile = |part: f64| {
            let at = sums.partition_point(|(_, below)| *below < part * sum);
            let at = at.clamp(1, sums.len() - 1);
            let ((from, before), (to, after)) = (sums[at - 1], sums[at]);
            let inside = if after > before {
                (part * sum - before) / (after - before)
            } else {
                0.5
            };
            libm::exp(from + inside * (to - from))
        };
        Interval {
            value: libm::exp(best),
            low: quantile(0.025),
            high: quantile(0.975),
        }
    }
}

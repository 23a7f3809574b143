//! Maximum likelihood of the gyro models (3) and (4) over all drives at once.

use super::filter::{Answer, Candidate, Class, Dynamics, filter};
use super::interval::{self, Interval, Measured};
use super::maximum::{climbed, curvature, maximum};
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
/// Correlation times of biases that are tried, s.
const CORRELATIONS_S: [f64; 5] = [20.0, 60.0, 200.0, 600.0, 2000.0];
/// Log-likelihoods closer than this are equal: on the way, and at a top.
const TOLERANCE: f64 = 0.02;
const TOP_TOLERANCE: f64 = 0.005;
/// Tops whose parameters differ by less than this in the logarithm are one.
const SAME: f64 = 0.2;
/// Step of the numerical curvature in the logarithm of a parameter.
const CURVATURE_STEP: f64 = 0.03;
/// First step towards a bound where the curvature tells none, and the longest.
const BOUND_STEP: f64 = 0.7;
/// A bound is found to this part of its distance, in so many steps at most.
const BOUND_TOLERANCE: f64 = 0.03;
const BOUND_STEPS: u32 = 20;
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
    let f = |x: &[f64; 4]| fitter.at(law, &[x[0], x[1], memory, memory_time, x[2], x[3]]);
    -curvature(f, point, CURVATURE_STEP)
}

struct Fitter<'a> {
    drives: Vec<&'a Record>,
    accel_noise: f64,
    class: Class,
}

/// Logarithms of the parameters of a model.
type Point = [f64; 6];

/// Gyro noise, GNSS noise, size and time of its memory, size and time of the random part of the
/// biases.
const NOISE: usize = 0;
const GNSS: usize = 1;
const MEMORY: usize = 2;
const MEMORY_TIME: usize = 3;
const SIZE: usize = 4;
const TIME: usize = 5;

/// The point with some coordinates set otherwise.
fn with<const N: usize>(point: &Point, set: [(usize, f64); N]) -> Point {
    let mut point = *point;
    for (which, value) in set {
        point[which] = value;
    }
    point
}

/// A point and the log-likelihood there.
#[derive(Clone, Copy)]
struct Top {
    at: Point,
    value: f64,
}

impl Top {
    fn is_at(&self, other: &Self) -> bool {
        (self.at.iter().zip(other.at)).all(|(a, b)| (a - b).abs() < SAME)
    }
}

/// The top of a model, from which intervals are sought.
struct Peak {
    law: Law,
    top: Top,
    /// Others that chance may prefer to it.
    others: Vec<Top>,
    /// Of the log-likelihood there.
    curvature: nalgebra::Matrix6<f64>,
    /// Which coordinates move with others: not the times of jumps, which make steps in the likelihood,
    /// nor a memory that is none.
    free: [bool; 6],
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
        let [gyro_noise, gnss_sigma_mps, memory, memory_s, size, time_s] = point.map(libm::exp);
        Candidate {
            gyro_noise,
            accel_noise: self.accel_noise,
            gnss_sigma_mps,
            gnss_memory: Correlated {
                sigma: memory,
                time_s: memory_s,
            },
            dynamics: Dynamics { law, size, time_s },
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
        let answers = self.answers(law, point);
        let sum: f64 = answers.iter().map(|answer| answer.log_likelihood).sum();
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

    fn likeliest(&self, law: Law, points: impl IntoIterator<Item = Point>) -> Option<Top> {
        let tops = points.into_iter().map(|at| self.top(law, at));
        tops.max_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// The best that some coordinates make of a point, each from a first step.
    fn best<const N: usize>(
        &self,
        law: Law,
        from: &Point,
        free: [(usize, f64); N],
        tolerance: f64,
    ) -> Top {
        let point = |x: &[f64; N]| {
            let bounded = |at: usize| (free[at].0, self.bounded(free[at].0, x[at]));
            with(from, core::array::from_fn::<_, N, _>(bounded))
        };
        let (start, step) = (free.map(|(which, _)| from[which]), free.map(|(_, by)| by));
        let (x, value) = maximum(|x| self.at(law, &point(x)), start, step, tolerance);
        Top {
            at: point(&x),
            value,
        }
    }

    /// Times of a memory that are tried, and correlation times that a drive can tell from a constant
    /// and a trend; all else as it is.
    fn bounded(&self, which: usize, value: f64) -> f64 {
        let [least, .., most] = MEMORIES_S;
        match which {
            MEMORY_TIME => value.clamp(libm::log(least), libm::log(most)),
            TIME => value.clamp(libm::log(2.0), libm::log(self.longest_s()) + 1.0),
            _ => value,
        }
    }

    /// The memory of GNSS is told from biases that move, and both from noise.
    fn start(&self) -> Start {
        let still = self.still();
        let walk = self.with_memory(&self.walk(&still));
        let memory = [MEMORY, MEMORY_TIME].map(|which| (which, walk.at[which]));
        let still = self.top(Law::Continuous, with(&still.at, memory));
        Start { still, walk }
    }

    fn still(&self) -> Top {
        // From lasers to the worst of MEMS: the likelihood has one top, but a long way off.
        let starts = [1e-6_f64, 1e-5, 1e-4, 1e-3].map(|noise| {
            let memory_time = libm::log(MEMORIES_S[1]);
            [
                libm::log(noise),
                libm::log(0.1),
                NONE,
                memory_time,
                NONE,
                5.0,
            ]
        });
        let start = self.likeliest(Law::Continuous, starts);
        let start = start.map_or(starts[1], |start| start.at);
        let free = [(NOISE, 0.7), (GNSS, 0.3)];
        self.best(Law::Continuous, &start, free, TOLERANCE)
    }

    /// With what noise of GNSS has a memory, if that makes the drives likelier than chance would.
    fn with_memory(&self, without: &Top) -> Top {
        let starts = MEMORIES_S.map(|time_s| {
            let memory = (MEMORY, without.at[GNSS] - 2.0);
            with(&without.at, [memory, (MEMORY_TIME, libm::log(time_s))])
        });
        let start = self.likeliest(Law::Wave, starts).unwrap_or(*without);
        // A memory that makes drives less likely by its first bit is none.
        if start.value <= without.value {
            return *without;
        }
        let free = [
            (NOISE, -0.1),
            (GNSS, -0.1),
            (SIZE, -0.2),
            (MEMORY, 0.7),
            (MEMORY_TIME, 0.5),
        ];
        let with = self.best(Law::Wave, &start.at, free, TOLERANCE);
        if with.value > without.value + DROP_OF_TWO {
            with
        } else {
            *without
        }
    }

    fn longest_s(&self) -> f64 {
        (self.drives.iter())
            .map(|record| record.duration_s)
            .fold(0.0, f64::max)
    }

    // --- (4) ---

    fn continuous(&self, start: &Start) -> GyroFit {
        let peak = self.peak(Law::Continuous, &self.continuous_top(&start.still));
        let time = self.profiled(&peak, TIME, NONE);
        self.assemble(&peak, time)
    }

    fn continuous_top(&self, still: &Top) -> Top {
        // What the noise of ten minutes hides.
        let unit = still.at[NOISE] - 0.5 * libm::log(600.0);
        let longest = libm::log(self.longest_s());
        let sizes = [0.3_f64, 1.0, 3.0, 10.0].map(|by| unit + libm::log(by));
        let times = CORRELATIONS_S.map(libm::log);
        let times = times.into_iter().filter(|time| *time < longest);
        let starts =
            times.flat_map(|time| sizes.map(|size| with(&still.at, [(SIZE, size), (TIME, time)])));
        let start = self.likeliest(Law::Continuous, starts).unwrap_or(*still);
        let free = [(NOISE, -0.1), (GNSS, 0.02), (SIZE, 0.4), (TIME, 0.6)];
        self.best(Law::Continuous, &start.at, free, TOLERANCE)
    }

    // --- (3) ---

    fn wave(&self, start: &Start) -> GyroFit {
        let (top, interval_s) = self.wave_top(&start.walk);
        self.assemble(&self.peak(Law::Wave, &top), interval_s)
    }

    fn wave_top(&self, walk: &Top) -> (Top, Interval) {
        let scan = Scan::new(self, walk.at);
        let (time, _) = scan.best();
        // Size at that interval, then the interval anew with it.
        let free = [(NOISE, -0.1), (GNSS, 0.02), (SIZE, 0.3)];
        let near = self.best(Law::Wave, &scan.at(time), free, TOP_TOLERANCE);
        let mut scan = scan.again(near.at);
        scan.refine();
        let (time, value) = scan.best();
        let at = scan.at(time);
        (Top { at, value }, scan.interval())
    }

    /// The bias as a random walk: its rate is known long before its steps are.
    fn walk(&self, still: &Top) -> Top {
        let unit = still.at[NOISE] - libm::log(600.0) + 0.5 * libm::log(WALK_S);
        let starts = [0.3_f64, 1.0, 3.0, 10.0].map(|by| {
            let size = (SIZE, unit + libm::log(by));
            with(&still.at, [size, (TIME, libm::log(WALK_S))])
        });
        let start = self.likeliest(Law::Wave, starts).unwrap_or(*still);
        let free = [(NOISE, -0.1), (GNSS, 0.02), (SIZE, 0.4)];
        self.best(Law::Wave, &start.at, free, TOLERANCE)
    }

    // --- both ---

    /// With all found again, now that the biases move as they do.
    fn peak(&self, law: Law, near: &Top) -> Peak {
        let curvature = curvature(|at| self.at(law, at), near.at, CURVATURE_STEP);
        let mut free = [true; 6];
        free[TIME] = law == Law::Continuous;
        if near.at[MEMORY] == NONE {
            (free[MEMORY], free[MEMORY_TIME]) = (false, false);
        }
        let mut tops = vec![self.climbed(law, near.at, &curvature, free, TOP_TOLERANCE)];
        // There are others at other times, far below or above.
        for (which, times) in [(MEMORY_TIME, &MEMORIES_S[..]), (TIME, &CORRELATIONS_S)] {
            let from = tops[0];
            for time_s in times.iter().filter(|_| free[which]) {
                let mut held = free;
                held[which] = false;
                let time = self.bounded(which, libm::log(*time_s));
                let start = with(&from.at, [(which, time)]);
                let near = self.climbed(law, start, &curvature, held, TOLERANCE);
                if near.value > from.value - UNLIKELY {
                    tops.push(self.climbed(law, near.at, &curvature, free, TOP_TOLERANCE));
                }
            }
            tops.sort_by(|a, b| b.value.total_cmp(&a.value));
        }
        let top = tops.remove(0);
        tops.retain(|other| other.value > top.value - DROP && !other.is_at(&top));
        Peak {
            law,
            top,
            others: tops,
            curvature,
            free,
        }
    }

    fn climbed(
        &self,
        law: Law,
        from: Point,
        curvature: &nalgebra::Matrix6<f64>,
        free: [bool; 6],
        tolerance: f64,
    ) -> Top {
        let bounded = |x: &Point| -> Point {
            let one = |at: usize| {
                if free[at] {
                    self.bounded(at, x[at])
                } else {
                    x[at]
                }
            };
            core::array::from_fn(one)
        };
        let f = |x: &Point| self.at(law, &bounded(x));
        let (x, value) = climbed(f, from, curvature, free, tolerance);
        Top {
            at: bounded(&x),
            value,
        }
    }

    /// Where the log-likelihood has fallen on both sides of its top, all others found anew on the way.
    /// From below `least` nothing is told apart.
    fn profiled(&self, peak: &Peak, which: usize, least: f64) -> Interval {
        let mut free = peak.free;
        free[which] = false;
        let at = peak.top.at[which];
        // Not a number where there is no curvature: then the longest.
        let sigma = (1.0 / -peak.curvature[(which, which)]).sqrt();
        let step = (2.0 * sigma).min(BOUND_STEP);
        let side = |from: &Top, step: f64| {
            let mut near = from.at;
            let fallen = |value: f64| {
                let start = with(&near, [(which, value)]);
                let best = self.climbed(peak.law, start, &peak.curvature, free, TOLERANCE);
                near = best.at;
                peak.top.value - best.value
            };
            let from = from.at[which];
            if step > 0.0 {
                bound(fallen, from.max(least), step)
            } else if from < least {
                f64::NEG_INFINITY
            } else {
                bound(fallen, from, step)
            }
        };
        let all = || peak.others.iter().chain([&peak.top]);
        let low = all().map(|top| side(top, -step)).fold(at, f64::min);
        let high = all().map(|top| side(top, step)).fold(at, f64::max);
        [at, low, high].map(libm::exp).into()
    }

    /// With the time of the random part as found.
    fn assemble(&self, peak: &Peak, time_s: Interval) -> GyroFit {
        let (law, top) = (peak.law, &peak.top);
        // Less than a tenth of what the noise of ten minutes hides is none.
        let hidden = top.at[NOISE] - 0.5 * libm::log(600.0) - libm::log(10.0);
        let mut size = self.profiled(peak, SIZE, hidden);
        if law == Law::Wave {
            // The rate of the walk is known, and its steps no better than their number.
            size.low *= (time_s.low / time_s.value).sqrt();
            size.high *= (time_s.high / time_s.value).sqrt();
        }
        let likeliest = self.answers(law, &top.at);
        // What is not above the noise is none in the model, and constants hold what it may be.
        let answers = if size.is_spread() {
            likeliest.clone()
        } else {
            self.answers(law, &with(&top.at, [(SIZE, NONE)]))
        };
        let open = [(SIZE, &size), (TIME, &time_s)]
            .into_iter()
            .flat_map(|(which, found)| {
                bounds(found).map(|end| self.answers(law, &with(&top.at, [(which, end)])))
            });
        // Of a noise that is not known to be there constants are known to what it may hide.
        let [noise, gnss_sigma_mps, gnss_memory_mps, gnss_memory_s] = self.noise_intervals(peak);
        let noisy = Some(noise.high).filter(|high| !noise.is_spread() && high.is_finite());
        let noisy = noisy.map(|high| self.answers(law, &with(&top.at, [(NOISE, libm::log(high))])));
        let open: Vec<_> = open.chain(noisy).collect();
        let of_all = |found: &dyn Fn(&[Answer]) -> Interval| {
            open.iter()
                .fold(found(&answers), |best, other| best.reaching(&found(other)))
        };
        let drift = of_all(&|answers| {
            if law == Law::Continuous {
                return spread_or_unknown(answers.iter().flat_map(Answer::shown_trends));
            }
            let trends: Vec<_> = answers.iter().flat_map(Answer::trends).collect();
            interval::mean(&trends).unwrap_or(interval::common_value(&trends))
        });
        let trend = |drift: f64| match law {
            Law::Wave => (drift, 0.0),
            Law::Continuous => (0.0, drift),
        };
        // Beside a trend that is free little is left of a constant.
        let beside = |answers: &[Answer], drift: f64| {
            let (mean, sigma) = trend(drift);
            spread_or_unknown(
                (answers.iter()).flat_map(|answer| answer.shown_constants(mean, sigma)),
            )
        };
        let in_model = match law {
            Law::Wave if size.is_spread() => drift.value,
            Law::Wave => 0.0,
            Law::Continuous => drift.spread_or_none(),
        };
        let initial_sigma = of_all(&|answers| {
            let best = beside(answers, in_model);
            [drift.low, drift.high]
                .into_iter()
                .fold(best, |best, end| best.reaching(&beside(answers, end)))
        });
        let (trend_mean, trend_sigma) = trend(drift.value);
        let constants: Vec<_> = (likeliest.iter())
            .flat_map(|answer| answer.constants_given(trend_mean, trend_sigma))
            .collect();
        let constant_sigma = interval::sigma_behind(&constants).value;
        let log_likelihood = (likeliest.iter())
            .map(|answer| answer.marginal(constant_sigma, trend_mean, trend_sigma))
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
        }
    }

    /// A memory that was not seen is zero, and has the bound of one of 15 s.
    fn noise_intervals(&self, peak: &Peak) -> [Interval; 4] {
        let at = peak.top.at;
        let mut all = [NOISE, GNSS, MEMORY, MEMORY_TIME].map(|which| {
            let least = if which == MEMORY {
                at[GNSS] - 3.0
            } else {
                NONE
            };
            self.profiled(peak, which, least)
        });
        if at[MEMORY] == NONE {
            all[2].value = 0.0;
            all[3] = [libm::exp(at[MEMORY_TIME]), 0.0, f64::INFINITY].into();
        }
        all
    }
}

/// Standard deviation about zero of what drives show.
fn spread_or_unknown(shown: impl Iterator<Item = Measured>) -> Interval {
    interval::spread_of(&shown.collect::<Vec<_>>()).unwrap_or(Interval::UNKNOWN)
}

/// Logarithms of both bounds; of a side without one, of what is far.
fn bounds(interval: &Interval) -> [f64; 2] {
    let [value, low, high] = interval.each();
    let near = [value / FAR, value * FAR];
    [low.max(near[0]), high.min(near[1])].map(libm::log)
}

/// Where a profile has fallen as far as chance takes it, from a point near its top; infinite if it never
/// does. Its root is about a straight line.
fn bound(mut fallen: impl FnMut(f64) -> f64, from: f64, first: f64) -> f64 {
    let (mut inside, mut outside) = ((0.0, 0.0), None);
    let mut step = first;
    for _ in 0..BOUND_STEPS {
        let root = (fallen(from + step) / DROP).max(0.0).sqrt();
        if (root - 1.0).abs() < BOUND_TOLERANCE {
            return from + step;
        }
        if root < 1.0 {
            inside = (step, root);
        } else {
            outside = Some((step, root));
        }
        step = match outside {
            Some((far, above)) => {
                let part: f64 = (1.0 - inside.1) / (above - inside.1);
                inside.0 + part.clamp(0.1, 0.9) * (far - inside.0)
            }
            None => step * (1.0 / root).clamp(1.2, 2.5),
        };
        if step.abs() > libm::log(BOUNDLESS) {
            break;
        }
    }
    outside.map_or(f64::INFINITY * first, |(far, _)| from + far)
}

/// Of two points together, that of the top being one.
fn weight(pair: &[(f64, f64)], top: f64) -> f64 {
    libm::exp(pair[0].1 - top) + libm::exp(pair[1].1 - top)
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
            let seen_s = libm::exp(2.0 * (top[NOISE] - scan.size(time)));
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
        self.top[SIZE] + 0.5 * (time - self.top[TIME])
    }

    fn at(&self, time: f64) -> Point {
        with(&self.top, [(SIZE, self.size(time)), (TIME, time)])
    }

    fn value(&self, time: f64) -> f64 {
        self.fitter.at(Law::Wave, &self.at(time))
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
                let weight = weight(pair, top);
                if weight > NEGLIGIBLE {
                    weight * (pair[1].0 - pair[0].0)
                } else {
                    0.0
                }
            };
            let widest = (self.points.windows(2).enumerate())
                .max_by(|a, b| mass(a.1).total_cmp(&mass(b.1)))
                .map(|(at, pair)| (at, 0.5 * (pair[0].0 + pair[1].0), mass(pair)));
            let Some((at, time, _)) = widest.filter(|(_, _, mass)| *mass > 0.0) else {
                return;
            };
            self.points.insert(at + 1, (time, self.value(time)));
        }
    }

    /// Where 95 % of the likelihood lie, and what chance makes the best of some fifty better than.
    fn interval(&self) -> Interval {
        let (best, top) = self.best();
        // A drive too short for two jumps says nothing of what lies between them.
        let [first, _, ..] = self.points[..] else {
            return [libm::exp(best), 0.0, f64::INFINITY].into();
        };
        let mut sums = vec![(first.0, 0.0)];
        let mut sum = 0.0;
        for pair in self.points.windows(2) {
            sum += 0.5 * weight(pair, top) * (pair[1].0 - pair[0].0);
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
        // Up to the first points that are out of the question: nothing is known before.
        let likely = |pair: &&[(f64, f64)]| pair[0].1.max(pair[1].1) > top - DROP - PREFERENCE;
        let others = self.points.windows(2).filter(likely).flatten();
        let all = Interval::from([libm::exp(best), quantile(0.025), quantile(0.975)]);
        others.fold(all, |all, point| {
            all.reaching(&[libm::exp(point.0); 3].into())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_where_the_likelihood_has_fallen() {
        let square = |value: f64| 0.5 * (value - 1.0) * (value - 1.0);
        for step in [-0.01, 0.5, 20.0, 1.5] {
            let off = bound(square, 1.0, step) - 1.0;
            assert!((off / step.signum() - 1.96).abs() < 0.07, "{off}");
        }
        // Flat, and never falling far enough.
        assert!(bound(|_| 0.0, 1.0, 0.5).is_infinite());
        assert!(bound(|value| 0.8 * DROP * (1.0 - value.exp()), 0.0, -0.5).is_infinite());
    }
}

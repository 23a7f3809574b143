//! Maximum likelihood of the gyro models (3) and (4) over all drives at once.

use super::filter::{Answer, Candidate, Dynamics, filter};
use super::interval::{self, Interval, NORMAL_95};
use super::maximum::{crossing, curvature, maximum};
use super::record::Record;
use crate::sim::errors::Law;

/// Twice the log-likelihood falls by chi-square of one degree of freedom, 95 %: 3.84.
const DROP: f64 = 1.92;
/// Log-likelihoods closer than this are equal: on the way, and at the top itself.
const TOLERANCE: f64 = 0.02;
const TOP_TOLERANCE: f64 = 0.001;
/// Step of the numerical curvature in the logarithm of a parameter.
const CURVATURE_STEP: f64 = 0.03;
/// A bound further away than this factor is none.
const BOUNDLESS: f64 = 1e3;
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
/// By how much the log-likelihood of (3) must exceed that of (4) to be preferred.
const PREFERENCE: f64 = 2.0;

/// What all drives say of the gyros and of GNSS velocity; SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroFit {
    /// Root of the noise density, rad/sqrt(s).
    pub noise: Interval,
    /// Noise of a GNSS velocity component, m/s, white with the density that the fixes have.
    pub gnss_sigma_mps: Interval,
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

    /// Whether the time scale of that is known.
    pub fn has_time_scale(&self) -> bool {
        self.moves() && self.time_s.high < VAGUE * VAGUE * self.time_s.low
    }
}

/// Fits one model, or the likelier of the two.
pub fn fit(records: &[Record], accel_noise: f64, law: Option<Law>) -> Option<GyroFit> {
    let drives: Vec<&Record> = (records.iter())
        .filter(|record| !record.epochs.is_empty())
        .collect();
    if drives.is_empty() {
        return None;
    }
    let fitter = Fitter {
        drives,
        accel_noise,
    };
    let still = fitter.still();
    Some(match law {
        Some(Law::Wave) => fitter.wave(&still),
        Some(Law::Continuous) => fitter.continuous(&still),
        None => {
            let (wave, continuous) = (fitter.wave(&still), fitter.continuous(&still));
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
pub fn information(records: &[Record], accel_noise: f64, at: &Candidate) -> nalgebra::Matrix4<f64> {
    let fitter = Fitter {
        drives: records.iter().collect(),
        accel_noise,
    };
    let Dynamics { law, size, time_s } = at.dynamics;
    let point = [at.gyro_noise, at.gnss_sigma_mps, size, time_s].map(libm::log);
    let f = |x: &[f64; 4]| fitter.at(x[0], x[1], law, x[2], x[3]);
    -curvature(f, point, CURVATURE_STEP)
}

struct Fitter<'a> {
    drives: Vec<&'a Record>,
    accel_noise: f64,
}

/// The best point of a model: logarithms of gyro noise, GNSS noise, size and time of the random
/// part, and the log-likelihood there.
#[derive(Clone, Copy)]
struct Top {
    noise: f64,
    gnss: f64,
    size: f64,
    time: f64,
    value: f64,
}

impl Fitter<'_> {
    /// From logarithms of the parameters.
    fn candidate(&self, noise: f64, gnss: f64, law: Law, size: f64, time: f64) -> Candidate {
        Candidate {
            gyro_noise: libm::exp(noise),
            accel_noise: self.accel_noise,
            gnss_sigma_mps: libm::exp(gnss),
            dynamics: Dynamics {
                law,
                size: libm::exp(size),
                time_s: libm::exp(time),
            },
        }
    }

    /// What the drives say at the best point of a model.
    fn answers(&self, law: Law, top: &Top) -> Vec<Answer> {
        let candidate = self.candidate(top.noise, top.gnss, law, top.size, top.time);
        let filter = |record: &&Record| filter(record, &candidate);
        self.drives.iter().map(filter).collect()
    }

    /// Log-likelihood at logarithms of the parameters.
    fn at(&self, noise: f64, gnss: f64, law: Law, size: f64, time: f64) -> f64 {
        let candidate = self.candidate(noise, gnss, law, size, time);
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

    /// Biases that do not move: a start for everything else.
    fn still(&self) -> Top {
        let none = -60.0;
        let f = |x: &[f64; 2]| self.at(x[0], x[1], Law::Continuous, none, 5.0);
        // From lasers to the worst of MEMS: the likelihood has one top, but a long way off.
        let starts = [1e-6, 1e-5, 1e-4, 1e-3].map(libm::log);
        let gnss = libm::log(0.1);
        let start = (starts.into_iter())
            .max_by(|a, b| f(&[*a, gnss]).total_cmp(&f(&[*b, gnss])))
            .unwrap_or(starts[1]);
        let ([noise, gnss], value) = maximum(f, [start, gnss], [0.7, 0.3], TOLERANCE);
        Top {
            noise,
            gnss,
            size: none,
            time: 5.0,
            value,
        }
    }

    /// Length of the longest drive, s.
    fn longest_s(&self) -> f64 {
        (self.drives.iter())
            .map(|record| record.duration_s)
            .fold(0.0, f64::max)
    }

    // --- (4) ---

    fn continuous(&self, still: &Top) -> GyroFit {
        let top = self.continuous_top(still);
        let size = self.size_interval(Law::Continuous, &top, still.value);
        let time = self.time_interval(&top);
        let answers = self.answers(Law::Continuous, &top);
        let trends: Vec<_> = answers.iter().flat_map(|answer| answer.trends).collect();
        let trend = interval::sigma_behind(&trends);
        self.assemble(Law::Continuous, &top, &answers, [trend, size, time])
    }

    fn continuous_top(&self, still: &Top) -> Top {
        // What the noise of ten minutes hides.
        let unit = still.noise - 0.5 * libm::log(600.0);
        let longest = libm::log(self.longest_s());
        let sizes = [0.3_f64, 1.0, 3.0, 10.0].map(|by| unit + libm::log(by));
        let times = [20.0_f64, 60.0, 200.0, 600.0, 2000.0].map(libm::log);
        let mut best = *still;
        for size in sizes {
            for time in times.into_iter().filter(|time| *time < longest) {
                let value = self.at(still.noise, still.gnss, Law::Continuous, size, time);
                if value > best.value || best.size < unit - 10.0 {
                    best = Top {
                        size,
                        time,
                        value,
                        ..*still
                    };
                }
            }
        }
        let f = |x: &[f64; 4]| self.at(x[0], x[1], Law::Continuous, x[2], bounded(x[3], longest));
        let start = [best.noise, best.gnss, best.size, best.time];
        let (x, value) = maximum(f, start, [-0.1, 0.02, 0.4, 0.6], TOP_TOLERANCE);
        Top {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            time: bounded(x[3], longest),
            value,
        }
    }

    /// Profile over the size of the random part. The noises are left where they are: they hardly
    /// move with it.
    fn size_interval(&self, law: Law, top: &Top, still: f64) -> Interval {
        let longest = libm::log(self.longest_s());
        let profile = |size: f64| {
            let at = |time: f64| self.at(top.noise, top.gnss, law, size, time);
            let value = match law {
                Law::Wave => at(top.time),
                Law::Continuous => {
                    let f = |x: &[f64; 1]| at(bounded(x[0], longest));
                    maximum(f, [top.time], [0.3], TOLERANCE).1
                }
            };
            value - top.value + DROP
        };
        let low = if still - top.value + DROP > 0.0 {
            0.0
        } else {
            libm::exp(bound(profile, top.size, -0.3))
        };
        Interval {
            value: libm::exp(top.size),
            low,
            high: libm::exp(bound(profile, top.size, 0.3)),
        }
    }

    fn time_interval(&self, top: &Top) -> Interval {
        let profile = |time: f64| {
            let f = |x: &[f64; 1]| self.at(top.noise, top.gnss, Law::Continuous, x[0], time);
            maximum(f, [top.size], [0.2], TOLERANCE).1 - top.value + DROP
        };
        Interval {
            value: libm::exp(top.time),
            low: libm::exp(bound(profile, top.time, -0.4)),
            high: libm::exp(bound(profile, top.time, 0.4)),
        }
    }

    // --- (3) ---

    fn wave(&self, still: &Top) -> GyroFit {
        let (top, interval_s) = self.wave_top(still);
        let jump_sigma = self.size_interval(Law::Wave, &top, still.value);
        let answers = self.answers(Law::Wave, &top);
        let trends: Vec<_> = answers.iter().flat_map(|answer| answer.trends).collect();
        let jump_mean = interval::mean(&trends).unwrap_or(interval::common_value(&trends));
        let found = [jump_mean, jump_sigma, interval_s];
        self.assemble(Law::Wave, &top, &answers, found)
    }

    fn wave_top(&self, still: &Top) -> (Top, Interval) {
        let walk = self.walk(still);
        let scan = Scan::new(self, &walk);
        let (time, _) = scan.best();
        // Size at that interval, then the interval anew with it.
        let f = |x: &[f64; 3]| self.at(x[0], x[1], Law::Wave, x[2], time);
        let start = [walk.noise, walk.gnss, scan.size(time)];
        let (x, value) = maximum(f, start, [-0.1, 0.02, 0.3], TOP_TOLERANCE);
        let near = Top {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            time,
            value,
        };
        let mut scan = scan.again(&near);
        scan.refine();
        let (time, value) = scan.best();
        let top = Top {
            size: scan.size(time),
            time,
            value,
            ..near
        };
        (top, scan.interval())
    }

    /// The bias as a random walk: its rate is known long before its steps are.
    fn walk(&self, still: &Top) -> Top {
        let time = libm::log(WALK_S);
        let unit = still.noise - libm::log(600.0) + 0.5 * libm::log(WALK_S);
        let sizes = [0.3_f64, 1.0, 3.0, 10.0].map(|by| unit + libm::log(by));
        let at = |size: f64| self.at(still.noise, still.gnss, Law::Wave, size, time);
        let size = (sizes.into_iter())
            .max_by(|a, b| at(*a).total_cmp(&at(*b)))
            .unwrap_or(unit);
        let f = |x: &[f64; 3]| self.at(x[0], x[1], Law::Wave, x[2], time);
        let start = [still.noise, still.gnss, size];
        let (x, value) = maximum(f, start, [-0.1, 0.02, 0.4], TOLERANCE);
        Top {
            noise: x[0],
            gnss: x[1],
            size: x[2],
            time,
            value,
        }
    }

    // --- both ---

    /// With drift, size and time of the bias as found.
    fn assemble(&self, law: Law, top: &Top, answers: &[Answer], found: [Interval; 3]) -> GyroFit {
        let constants: Vec<_> = answers.iter().flat_map(|answer| answer.constants).collect();
        let initial_sigma = interval::sigma_behind(&constants);
        let [noise, gnss_sigma_mps] = self.noise_intervals(law, top);
        let [drift, size, time_s] = found;
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
            initial_sigma,
            law,
            drift,
            size,
            time_s,
            log_likelihood,
            drives: self.drives.len(),
        }
    }

    /// By the curvature in the logarithms, with the size of the random part free.
    fn noise_intervals(&self, law: Law, top: &Top) -> [Interval; 2] {
        let f = |x: &[f64; 3]| self.at(x[0], x[1], law, x[2], top.time);
        let at = [top.noise, top.gnss, top.size];
        let information = -curvature(f, at, CURVATURE_STEP);
        // Without a random part its row is flat.
        let variance = (information + nalgebra::Matrix3::identity() * 1e-6)
            .try_inverse()
            .unwrap_or_default();
        [0, 1].map(|which| {
            let half = NORMAL_95 * variance[(which, which)].max(0.0).sqrt();
            Interval {
                value: libm::exp(at[which]),
                low: libm::exp(at[which] - half),
                high: libm::exp(at[which] + half),
            }
        })
    }
}

/// Correlation times that a drive can tell from a constant and a trend, as logarithms.
fn bounded(time: f64, longest: f64) -> f64 {
    time.clamp(libm::log(2.0), longest + 1.0)
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
    top: Top,
    /// Logarithm of the interval, and the value there; ascending.
    points: Vec<(f64, f64)>,
}

impl<'a> Scan<'a> {
    fn new(fitter: &'a Fitter<'a>, top: &Top) -> Self {
        let longest_s = fitter.longest_s();
        let mut scan = Self {
            fitter,
            top: *top,
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
    fn again(&self, top: &Top) -> Self {
        let least = self.best().1 - UNLIKELY;
        let mut scan = Self {
            fitter: self.fitter,
            top: *top,
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
        let Top { noise, gnss, .. } = self.top;
        (self.fitter).at(noise, gnss, Law::Wave, self.size(time), time)
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

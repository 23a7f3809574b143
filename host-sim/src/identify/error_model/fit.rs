//! Maximum likelihood of the gyro models (3) and (4) over all drives at once.

use super::filter::{Candidate, Class, Dynamics, Posterior, filter};
use super::interval::{self, Interval, Measured};
use super::maximum::{curvature, nelder_mead, newton};
use super::record::Record;
use crate::sim::errors::Law;
use crate::sim::receiver::Correlated;

/// Drop of the log-likelihood at a 95 % bound: half of chi-square of one degree of freedom, 3.84.
const DROP_95: f64 = 1.92;
/// The same of two degrees of freedom: 5.99.
const DROP_95_2D: f64 = 3.0;
/// Logarithm of a sigma of zero.
const LOG_ZERO: f64 = -60.0;
/// Correlation times of coloured GNSS noise that are tried, s. Shorter ones are white to epochs, longer
/// ones cannot be told from errors of the INS.
const COLOURED_S: [f64; 3] = [3.0, 15.0, 100.0];
/// Correlation times of biases that are tried, s.
const CORRELATIONS_S: [f64; 5] = [20.0, 60.0, 200.0, 600.0, 2000.0];
/// Convergence of the log-likelihood: on the way, and at a maximum.
const TOLERANCE: f64 = 0.02;
const FINAL_TOLERANCE: f64 = 0.005;
/// Maxima whose parameters differ by less than this in the logarithm are one.
const SAME: f64 = 0.2;
/// Step of the numerical curvature in the logarithm of a parameter.
const CURVATURE_STEP: f64 = 0.03;
/// First step towards a bound where the curvature gives none, and the longest.
const BOUND_STEP: f64 = 0.7;
/// A bound is found to this part of its distance, in so many steps at most.
const BOUND_TOLERANCE: f64 = 0.03;
const BOUND_STEPS: u32 = 20;
/// A bound further away than this factor is none.
const BOUNDLESS: f64 = 1e3;
/// Factor up to which a parameter without a bound is followed.
const FAR: f64 = 5.0;
/// Likelihood over the greatest below which an interval between jumps is not refined.
const NEGLIGIBLE: f64 = 1e-3;
/// Log-likelihood below the greatest at which a point is not followed up.
const UNLIKELY: f64 = 12.0;
/// Most points added to the scan of the interval.
const REFINEMENTS: usize = 60;
/// A random walk of the bias is modelled as jumps so many seconds apart.
const WALK_S: f64 = 10.0;
/// Upper over lower bound beyond which an interval between jumps is not known.
const VAGUE: f64 = 3.0;
/// Log-likelihood of (3) over that of (4) from which it is preferred: its interval is the best of some
/// fifty distinct ones, ln 50.
const WAVE_MARGIN: f64 = 4.0;

/// Error model of gyros and GNSS velocity, from all drives; SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroFit {
    /// Root of the noise density, rad/sqrt(s).
    pub noise: Interval,
    /// Noise of a GNSS velocity component, m/s, white with the density that the fixes have.
    pub gnss_sigma_mps: Interval,
    /// Its coloured part, m/s; zero if not significant.
    pub gnss_coloured_mps: Interval,
    /// Correlation time of that, s.
    pub gnss_correlation_s: Interval,
    /// Run-to-run spread at the start, or of the constant, rad/s.
    pub initial_sigma: Interval,
    /// Process of the biases: jumps, or correlated noise over a trend.
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
    /// Whether the random part of the biases is significant.
    pub fn is_random(&self) -> bool {
        self.size.is_bounded()
    }

    /// Whether the coloured noise of GNSS velocity is significant.
    pub fn has_coloured_gnss(&self) -> bool {
        self.gnss_coloured_mps.is_bounded()
    }

    pub fn has_time_scale(&self) -> bool {
        self.is_random() && self.time_s.high < VAGUE * VAGUE * self.time_s.low
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
            if wave.has_time_scale() && gain > WAVE_MARGIN {
                wave
            } else {
                continuous
            }
        }
    })
}

/// Fisher information (Cramer-Rao bound) of the logarithms of (noise, GNSS noise, size and time of the
/// random part): negative curvature of the log-likelihood.
pub fn information(records: &[Record], at: &Candidate) -> nalgebra::Matrix4<f64> {
    let fitter = Fitter {
        drives: records.iter().collect(),
        accel_noise: at.accel_noise,
        class: at.class,
    };
    let Dynamics { law, size, time_s } = at.dynamics;
    let point = [at.gyro_noise, at.gnss_sigma_mps, size, time_s].map(libm::log);
    let Correlated { sigma, time_s } = at.gnss_coloured;
    let [coloured, coloured_time] =
        [sigma.max(libm::exp(LOG_ZERO)), time_s.max(1.0)].map(libm::log);
    let f = |x: &[f64; 4]| fitter.at(law, &[x[0], x[1], coloured, coloured_time, x[2], x[3]]);
    -curvature(f, point, CURVATURE_STEP)
}

struct Fitter<'a> {
    drives: Vec<&'a Record>,
    accel_noise: f64,
    class: Class,
}

/// Logarithms of the parameters of a model.
type Point = [f64; 6];

/// Gyro noise, GNSS noise, size and time of its coloured part, size and time of the random part of
/// the biases.
const NOISE: usize = 0;
const GNSS: usize = 1;
const COLOURED: usize = 2;
const COLOURED_TIME: usize = 3;
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
struct Maximum {
    at: Point,
    value: f64,
}

impl Maximum {
    fn is_at(&self, other: &Self) -> bool {
        (self.at.iter().zip(other.at)).all(|(a, b)| (a - b).abs() < SAME)
    }
}

/// The maximum of a model, from which the profiles are drawn.
struct Optimum {
    law: Law,
    max: Maximum,
    /// Local maxima within the 95 % drop of it.
    others: Vec<Maximum>,
    /// Curvature of the log-likelihood there.
    curvature: nalgebra::Matrix6<f64>,
    /// Coordinates that are maximized: not the interval of jumps, in which the likelihood has steps, nor
    /// coloured noise of zero.
    free: [bool; 6],
}

/// Start of the maximization of every model.
struct Start {
    /// Constant biases.
    still: Maximum,
    /// Biases that are random walks.
    walk: Maximum,
}

impl Fitter<'_> {
    fn candidate(&self, law: Law, point: &Point) -> Candidate {
        let [
            gyro_noise,
            gnss_sigma_mps,
            coloured,
            coloured_s,
            size,
            time_s,
        ] = point.map(libm::exp);
        Candidate {
            gyro_noise,
            accel_noise: self.accel_noise,
            gnss_sigma_mps,
            gnss_coloured: Correlated {
                sigma: coloured,
                time_s: coloured_s,
            },
            dynamics: Dynamics { law, size, time_s },
            class: self.class,
        }
    }

    /// Posterior of each drive at a point.
    fn posteriors(&self, law: Law, at: &Point) -> Vec<Posterior> {
        let candidate = self.candidate(law, at);
        let filter = |record: &&Record| filter(record, &candidate);
        self.drives.iter().map(filter).collect()
    }

    /// Log-likelihood at a point.
    fn at(&self, law: Law, point: &Point) -> f64 {
        let posteriors = self.posteriors(law, point);
        let sum: f64 = posteriors.iter().map(|drive| drive.log_likelihood).sum();
        // Extreme variances overflow.
        if sum.is_finite() {
            sum
        } else {
            f64::NEG_INFINITY
        }
    }

    fn evaluated(&self, law: Law, at: Point) -> Maximum {
        let value = self.at(law, &at);
        Maximum { at, value }
    }

    fn likeliest(&self, law: Law, points: impl IntoIterator<Item = Point>) -> Option<Maximum> {
        let maxima = points.into_iter().map(|at| self.evaluated(law, at));
        maxima.max_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// Maximum over some coordinates, each with its first step.
    fn best<const N: usize>(
        &self,
        law: Law,
        from: &Point,
        free: [(usize, f64); N],
        tolerance: f64,
    ) -> Maximum {
        let point = |x: &[f64; N]| {
            let bounded = |at: usize| (free[at].0, self.bounded(free[at].0, x[at]));
            with(from, core::array::from_fn::<_, N, _>(bounded))
        };
        let (start, step) = (free.map(|(which, _)| from[which]), free.map(|(_, by)| by));
        let (x, value) = nelder_mead(|x| self.at(law, &point(x)), start, step, tolerance);
        Maximum {
            at: point(&x),
            value,
        }
    }

    /// Limits correlation times to those tried of GNSS noise, and to those of biases that a drive can
    /// tell from a constant and a trend.
    fn bounded(&self, which: usize, value: f64) -> f64 {
        let [least, .., most] = COLOURED_S;
        match which {
            COLOURED_TIME => value.clamp(libm::log(least), libm::log(most)),
            TIME => value.clamp(libm::log(2.0), libm::log(self.longest_s()) + 1.0),
            _ => value,
        }
    }

    /// Coloured GNSS noise is fitted beside a random walk of the biases, to separate the two.
    fn start(&self) -> Start {
        let still = self.still();
        let walk = self.with_coloured_gnss(&self.walk(&still));
        let coloured = [COLOURED, COLOURED_TIME].map(|which| (which, walk.at[which]));
        let still = self.evaluated(Law::Continuous, with(&still.at, coloured));
        Start { still, walk }
    }

    fn still(&self) -> Maximum {
        // From ring lasers to the worst of MEMS: the likelihood has one maximum, but maybe far off.
        let starts = [1e-6_f64, 1e-5, 1e-4, 1e-3].map(|noise| {
            let coloured_time = libm::log(COLOURED_S[1]);
            [
                libm::log(noise),
                libm::log(0.1),
                LOG_ZERO,
                coloured_time,
                LOG_ZERO,
                5.0,
            ]
        });
        let start = self.likeliest(Law::Continuous, starts);
        let start = start.map_or(starts[1], |start| start.at);
        let free = [(NOISE, 0.7), (GNSS, 0.3)];
        self.best(Law::Continuous, &start, free, TOLERANCE)
    }

    /// With coloured GNSS noise, if the gain in likelihood is significant.
    fn with_coloured_gnss(&self, without: &Maximum) -> Maximum {
        let starts = COLOURED_S.map(|time_s| {
            let coloured = (COLOURED, without.at[GNSS] - 2.0);
            with(&without.at, [coloured, (COLOURED_TIME, libm::log(time_s))])
        });
        let start = self.likeliest(Law::Wave, starts).unwrap_or(*without);
        // No coloured noise where a little of it lowers the likelihood.
        if start.value <= without.value {
            return *without;
        }
        let free = [
            (NOISE, -0.1),
            (GNSS, -0.1),
            (SIZE, -0.2),
            (COLOURED, 0.7),
            (COLOURED_TIME, 0.5),
        ];
        let with = self.best(Law::Wave, &start.at, free, TOLERANCE);
        if with.value > without.value + DROP_95_2D {
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
        let peak = self.peak(Law::Continuous, &self.continuous_maximum(&start.still));
        let time = self.profile(&peak, TIME, LOG_ZERO);
        self.assemble(&peak, time)
    }

    fn continuous_maximum(&self, still: &Maximum) -> Maximum {
        // Bias below the noise of ten minutes.
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
        let (max, interval_s) = self.wave_maximum(&start.walk);
        self.assemble(&self.peak(Law::Wave, &max), interval_s)
    }

    fn wave_maximum(&self, walk: &Maximum) -> (Maximum, Interval) {
        let scan = Scan::new(self, walk.at);
        let (time, _) = scan.best();
        // Size at that interval, then the interval again with it.
        let free = [(NOISE, -0.1), (GNSS, 0.02), (SIZE, 0.3)];
        let near = self.best(Law::Wave, &scan.at(time), free, FINAL_TOLERANCE);
        let mut scan = scan.again(near.at);
        scan.refine();
        let (time, value) = scan.best();
        let at = scan.at(time);
        (Maximum { at, value }, scan.interval())
    }

    /// The bias as a random walk: its rate is observable long before its jumps are.
    fn walk(&self, still: &Maximum) -> Maximum {
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

    /// Maximum over all free coordinates, from a start near it.
    fn peak(&self, law: Law, near: &Maximum) -> Optimum {
        let curvature = curvature(|at| self.at(law, at), near.at, CURVATURE_STEP);
        let mut free = [true; 6];
        free[TIME] = law == Law::Continuous;
        if near.at[COLOURED] == LOG_ZERO {
            (free[COLOURED], free[COLOURED_TIME]) = (false, false);
        }
        let mut maxima = vec![self.newton(law, near.at, &curvature, free, FINAL_TOLERANCE)];
        // Local maxima at other correlation times, far below or above.
        for (which, times) in [(COLOURED_TIME, &COLOURED_S[..]), (TIME, &CORRELATIONS_S)] {
            let from = maxima[0];
            for time_s in times.iter().filter(|_| free[which]) {
                let mut held = free;
                held[which] = false;
                let time = self.bounded(which, libm::log(*time_s));
                let start = with(&from.at, [(which, time)]);
                let near = self.newton(law, start, &curvature, held, TOLERANCE);
                if near.value > from.value - UNLIKELY {
                    maxima.push(self.newton(law, near.at, &curvature, free, FINAL_TOLERANCE));
                }
            }
            maxima.sort_by(|a, b| b.value.total_cmp(&a.value));
        }
        let max = maxima.remove(0);
        maxima.retain(|other| other.value > max.value - DROP_95 && !other.is_at(&max));
        Optimum {
            law,
            max,
            others: maxima,
            curvature,
            free,
        }
    }

    fn newton(
        &self,
        law: Law,
        from: Point,
        curvature: &nalgebra::Matrix6<f64>,
        free: [bool; 6],
        tolerance: f64,
    ) -> Maximum {
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
        let (x, value) = newton(f, from, curvature, free, tolerance);
        Maximum {
            at: bounded(&x),
            value,
        }
    }

    /// Bounds of a parameter by the profile likelihood, the others maximized at each value. Values below
    /// `least` cannot be told apart.
    fn profile(&self, peak: &Optimum, which: usize, least: f64) -> Interval {
        let mut free = peak.free;
        free[which] = false;
        let at = peak.max.at[which];
        // Not a number where there is no curvature: then the longest step.
        let sigma = (1.0 / -peak.curvature[(which, which)]).sqrt();
        let step = (2.0 * sigma).min(BOUND_STEP);
        let side = |from: &Maximum, step: f64| {
            let mut near = from.at;
            let fallen = |value: f64| {
                let start = with(&near, [(which, value)]);
                let best = self.newton(peak.law, start, &peak.curvature, free, TOLERANCE);
                near = best.at;
                peak.max.value - best.value
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
        let all = || peak.others.iter().chain([&peak.max]);
        let low = all().map(|max| side(max, -step)).fold(at, f64::min);
        let high = all().map(|max| side(max, step)).fold(at, f64::max);
        [at, low, high].map(libm::exp).into()
    }

    /// All parameters, with the time of the random part as found.
    fn assemble(&self, peak: &Optimum, time_s: Interval) -> GyroFit {
        let (law, max) = (peak.law, &peak.max);
        // Below a tenth of the noise of ten minutes nothing is observable.
        let hidden = max.at[NOISE] - 0.5 * libm::log(600.0) - libm::log(10.0);
        let mut size = self.profile(peak, SIZE, hidden);
        if law == Law::Wave {
            // The rate of the walk is known, the size of its jumps no better than their number.
            size.low *= (time_s.low / time_s.value).sqrt();
            size.high *= (time_s.high / time_s.value).sqrt();
        }
        let likeliest = self.posteriors(law, &max.at);
        // A random part below the noise is zero in the model, and the constants contain it.
        let posteriors = if size.is_bounded() {
            likeliest.clone()
        } else {
            self.posteriors(law, &with(&max.at, [(SIZE, LOG_ZERO)]))
        };
        let open = [(SIZE, &size), (TIME, &time_s)]
            .into_iter()
            .flat_map(|(which, found)| {
                bounds(found).map(|end| self.posteriors(law, &with(&max.at, [(which, end)])))
            });
        // If the noise is not bounded from below, the constants are as uncertain as at its upper bound.
        let [noise, gnss_sigma_mps, gnss_coloured_mps, gnss_correlation_s] =
            self.noise_intervals(peak);
        let noisy = Some(noise.high).filter(|high| !noise.is_bounded() && high.is_finite());
        let noisy =
            noisy.map(|high| self.posteriors(law, &with(&max.at, [(NOISE, libm::log(high))])));
        let open: Vec<_> = open.chain(noisy).collect();
        let of_all = |found: &dyn Fn(&[Posterior]) -> Interval| {
            open.iter()
                .fold(found(&posteriors), |best, other| best.hull(&found(other)))
        };
        let drift = of_all(&|posteriors| {
            if law == Law::Continuous {
                return sigma_or_unknown(posteriors.iter().flat_map(Posterior::observed_trends));
            }
            let trends: Vec<_> = posteriors.iter().flat_map(Posterior::trends).collect();
            interval::mean(&trends).unwrap_or(interval::common_value(&trends))
        });
        let trend = |drift: f64| match law {
            Law::Wave => (drift, 0.0),
            Law::Continuous => (0.0, drift),
        };
        // Beside a free trend a constant is hardly observable.
        let beside = |posteriors: &[Posterior], drift: f64| {
            let (mean, sigma) = trend(drift);
            sigma_or_unknown(
                (posteriors.iter()).flat_map(|drive| drive.observed_constants(mean, sigma)),
            )
        };
        let in_model = match law {
            Law::Wave if size.is_bounded() => drift.value,
            Law::Wave => 0.0,
            Law::Continuous => drift.bounded_or_zero(),
        };
        let initial_sigma = of_all(&|posteriors| {
            let best = beside(posteriors, in_model);
            [drift.low, drift.high]
                .into_iter()
                .fold(best, |best, end| best.hull(&beside(posteriors, end)))
        });
        let (trend_mean, trend_sigma) = trend(drift.value);
        let constants: Vec<_> = (likeliest.iter())
            .flat_map(|drive| drive.constants_given(trend_mean, trend_sigma))
            .collect();
        let constant_sigma = interval::true_sigma(&constants).value;
        let log_likelihood = (likeliest.iter())
            .map(|drive| drive.marginal(constant_sigma, trend_mean, trend_sigma))
            .sum();
        GyroFit {
            noise,
            gnss_sigma_mps,
            gnss_coloured_mps,
            gnss_correlation_s,
            initial_sigma,
            law,
            drift,
            size,
            time_s,
            log_likelihood,
        }
    }

    /// Coloured noise that is not significant is zero, with the upper bound of one of 15 s.
    fn noise_intervals(&self, peak: &Optimum) -> [Interval; 4] {
        let at = peak.max.at;
        let mut all = [NOISE, GNSS, COLOURED, COLOURED_TIME].map(|which| {
            let least = if which == COLOURED {
                at[GNSS] - 3.0
            } else {
                LOG_ZERO
            };
            self.profile(peak, which, least)
        });
        if at[COLOURED] == LOG_ZERO {
            all[2].value = 0.0;
            all[3] = [libm::exp(at[COLOURED_TIME]), 0.0, f64::INFINITY].into();
        }
        all
    }
}

/// Standard deviation about zero of the constants or trends observed.
fn sigma_or_unknown(shown: impl Iterator<Item = Measured>) -> Interval {
    interval::sigma_if_any(&shown.collect::<Vec<_>>()).unwrap_or(Interval::UNKNOWN)
}

/// Logarithms of both bounds, no further than the factor `FAR`.
fn bounds(interval: &Interval) -> [f64; 2] {
    let [value, low, high] = interval.each();
    let near = [value / FAR, value * FAR];
    [low.max(near[0]), high.min(near[1])].map(libm::log)
}

/// Where a profile has fallen by `DROP_95`, from a point near its maximum; infinite if it never does.
/// The root of the drop is about linear.
fn bound(mut fallen: impl FnMut(f64) -> f64, from: f64, first: f64) -> f64 {
    let (mut inside, mut outside) = ((0.0, 0.0), None);
    let mut step = first;
    for _ in 0..BOUND_STEPS {
        let root = (fallen(from + step) / DROP_95).max(0.0).sqrt();
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

/// Likelihood of two points together, over that at the maximum.
fn weight(pair: &[(f64, f64)], max: f64) -> f64 {
    libm::exp(pair[0].1 - max) + libm::exp(pair[1].1 - max)
}

/// Log-likelihood over the interval between jumps, at a constant rate of the random walk.
struct Scan<'a> {
    fitter: &'a Fitter<'a>,
    max: Point,
    /// Logarithm of the interval, and the value there; ascending.
    points: Vec<(f64, f64)>,
}

impl<'a> Scan<'a> {
    fn new(fitter: &'a Fitter<'a>, max: Point) -> Self {
        let longest_s = fitter.longest_s();
        let mut scan = Self {
            fitter,
            max,
            points: Vec::new(),
        };
        let (mut time, end) = (libm::log(WALK_S), libm::log(0.5 * longest_s));
        while time < end {
            scan.points.push((time, scan.value(time)));
            // A jump is located to within the time in which its integral exceeds the noise's; the last
            // one shifts by as many intervals as there are before it.
            let seen_s = libm::exp(2.0 * (max[NOISE] - scan.size(time)));
            time += (seen_s / longest_s).clamp(0.008, 0.1);
        }
        scan
    }

    /// The likely points again, about another maximum.
    fn again(&self, max: Point) -> Self {
        let least = self.best().1 - UNLIKELY;
        let mut scan = Self {
            fitter: self.fitter,
            max,
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

    /// Size of the jumps at the same rate of the walk.
    fn size(&self, time: f64) -> f64 {
        self.max[SIZE] + 0.5 * (time - self.max[TIME])
    }

    fn at(&self, time: f64) -> Point {
        with(&self.max, [(SIZE, self.size(time)), (TIME, time)])
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

    /// Adds points where the likelihood is concentrated, widest spacing first.
    fn refine(&mut self) {
        for _ in 0..REFINEMENTS {
            let max = self.best().1;
            let mass = |pair: &[(f64, f64)]| {
                let weight = weight(pair, max);
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

    /// 95 % of the likelihood, and the points within the drop and the margin for the best of fifty.
    fn interval(&self) -> Interval {
        let (best, max) = self.best();
        // A drive too short for two jumps does not bound their interval.
        let [first, _, ..] = self.points[..] else {
            return [libm::exp(best), 0.0, f64::INFINITY].into();
        };
        let mut sums = vec![(first.0, 0.0)];
        let mut sum = 0.0;
        for pair in self.points.windows(2) {
            sum += 0.5 * weight(pair, max) * (pair[1].0 - pair[0].0);
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
        // Up to the first points that are rejected.
        let likely = |pair: &&[(f64, f64)]| pair[0].1.max(pair[1].1) > max - DROP_95 - WAVE_MARGIN;
        let others = self.points.windows(2).filter(likely).flatten();
        let all = Interval::from([libm::exp(best), quantile(0.025), quantile(0.975)]);
        others.fold(all, |all, point| all.hull(&[libm::exp(point.0); 3].into()))
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
        assert!(bound(|value| 0.8 * DROP_95 * (1.0 - value.exp()), 0.0, -0.5).is_infinite());
    }
}

//! All parameters of an error model as identified, each with its interval.

use serde::Serialize;

use super::filter::Class;
use super::fit::{self, GyroFit};
use super::interval::{self, Interval, Measured};
use super::record::Record;
use super::rest_noise::RestNoise;
use crate::identify::quantities::DEG_H_RADPS;
use crate::log::Grade;
use crate::page::digits;
use crate::sim::ErrorModel;
use crate::sim::errors::{BiasModel, Law};
use crate::sim::noise::Random;
use crate::sim::receiver::Correlated;

/// One parameter of the file, in its unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Path in the file.
    pub name: &'static str,
    pub unit: &'static str,
    /// Value and 95 % interval; none without any data.
    #[serde(flatten)]
    pub found: Option<Interval>,
    pub observable: bool,
    /// What is missing if not observable.
    pub why: &'static str,
}

/// A part of the model that is assumed, not identified.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Assumed {
    /// Path in the file, or the name of an effect that is not in it.
    pub name: &'static str,
    pub unit: &'static str,
    /// Value in the model.
    pub value: f64,
    /// Why the drives do not show it.
    pub why: &'static str,
}

impl Assumed {
    /// None if it is observable, with a bound on either side.
    fn of(parameter: &Parameter, model: &ErrorModel) -> Option<Self> {
        let bounded = parameter.found.is_none_or(|found| found.high.is_finite());
        (!parameter.observable || !bounded).then(|| Self {
            name: parameter.name,
            unit: parameter.unit,
            value: in_file(model, parameter.name),
            why: if bounded { parameter.why } else { NO_BOUND },
        })
    }

    /// Name, value with unit, reason.
    pub fn cells(&self) -> [String; 3] {
        let value = if self.value == 0.0 {
            "none".to_owned()
        } else {
            format!("{} {}", digits(0.1 * self.value, self.value), self.unit)
        };
        [self.name.to_owned(), value, self.why.to_owned()]
    }
}

/// The value at a path of a model's file; if absent zero, of `noise_times` one.
pub(crate) fn in_file(model: &ErrorModel, path: &str) -> f64 {
    let mut keys = path.split(['.', '[', ']']).filter(|key| !key.is_empty());
    let file = toml::Value::try_from(model).ok();
    let value = file.and_then(|file| {
        keys.try_fold(file, |at, key| match key.parse::<usize>() {
            Ok(index) => at.get(index).cloned(),
            Err(_) => at.get(key).cloned(),
        })
    });
    let absent = f64::from(u8::from(path.contains("noise_times")));
    value.and_then(|value| value.as_float()).unwrap_or(absent)
}

/// Error model identified from drives.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    pub drives: usize,
    grade: Grade,
    /// The gyros and GNSS velocity; none of drives that are too short.
    pub(crate) gyro: Option<GyroFit>,
    /// Of the gyros, deg/h/sqrt(Hz).
    gyro_at_rest: Option<RestNoise>,
    accel_at_rest: Option<RestNoise>,
    accel_sigma: Option<Interval>,
    gyro_scale: Option<Interval>,
    accel_scale: Option<Interval>,
    latency_s: Option<[Interval; 2]>,
    /// The stamps of a drive's fixes were shifted, and the latency is the remainder.
    clocks_shifted: bool,
    fix_rate_hz: f64,
}

impl Identified {
    /// Of at least one drive; `law` is that of the gyro biases, or the likelier.
    pub fn new(records: &[Record], grade: Grade, law: Option<Law>) -> Self {
        let class = grade.errors();
        let accel_at_rest = RestNoise::new(records, |block| block.force_mps2);
        let class_noise = class.accel_mps2.white_noise;
        let known_noise = accel_at_rest.map_or(class_noise, |noise| noise.density.value);
        // A scale error of the up axis acts as a bias of it.
        let axes = if class.accel_mps2.scale_sigma > 0.0 {
            2
        } else {
            3
        };
        let accels: Vec<Measured> = (records.iter())
            .flat_map(|record| &record.accel_bias_mps2[..axes])
            .filter_map(Measured::of)
            .collect();
        let all = |of: fn(&Record) -> &Vec<Measured>| -> Vec<Measured> {
            records.iter().flat_map(of).copied().collect()
        };
        let latencies: Vec<Measured> = (records.iter())
            .filter_map(|record| Measured::of(&record.latency_s))
            .collect();
        let mut rates: Vec<f64> = records.iter().map(|record| record.fix_rate_hz).collect();
        rates.sort_by(f64::total_cmp);
        let gyro_at_rest = RestNoise::new(records, |block| block.rate_radps / DEG_H_RADPS);
        // Unless noise is observed, or bounded below that of the class, the rest of the fit is void.
        let observed =
            |found: &Interval, of_class: f64| found.is_bounded() || found.high < of_class;
        let mut gyro = fit::fit(records, known_noise, Class::of(&class), law).filter(|gyro| {
            observed(&gyro.noise, class.gyro_deg_h.white_noise * DEG_H_RADPS)
                || observed(&gyro.gnss_sigma_mps, class.gnss.velocity_sigma_mps)
        });
        if let (Some(gyro), Some(rest)) = (&mut gyro, &gyro_at_rest) {
            gyro.noise = not_below_rest(gyro.noise, &rest.density.scaled(DEG_H_RADPS));
        }
        Self {
            drives: records.len(),
            grade,
            gyro,
            gyro_at_rest,
            accel_at_rest,
            accel_sigma: interval::sigma_if_any(&accels),
            gyro_scale: interval::sigma_if_any(&all(|record| &record.gyro_scale)),
            accel_scale: interval::sigma_if_any(&all(|record| &record.accel_scale)),
            latency_s: latency_bounds(&latencies),
            clocks_shifted: records.iter().any(|record| record.clock_offset_s != 0.0),
            // A rate that occurs, not a mean of several.
            fix_rate_hz: rates[rates.len() / 2],
        }
    }

    /// Gyro noise at rest alone, deg/h/sqrt(Hz): more in motion means vibration.
    pub fn gyro_noise_at_rest(&self) -> Option<Interval> {
        self.gyro_at_rest.map(|noise| noise.density)
    }

    /// Accelerometer noise at rest, m/s^2/sqrt(Hz).
    pub fn accel_noise(&self) -> Option<Interval> {
        self.accel_at_rest.map(|noise| noise.density)
    }

    /// All parameters in the order of the file.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut all = self.gyro_parameters();
        all.extend(times(GYRO_TIMES, self.gyro_at_rest));
        all.extend([
            spread(GYRO_SCALE, self.gyro_scale, NO_MANOEUVRE),
            known(ACCEL_NOISE, self.accel_noise(), NO_REST),
            spread(ACCEL_SIGMA, self.accel_sigma, NO_TURN),
            spread(ACCEL_SCALE, self.accel_scale, NO_MANOEUVRE),
        ]);
        all.extend(times(ACCEL_TIMES, self.accel_at_rest));
        let gnss = |of: fn(&GyroFit) -> Interval| self.gyro.as_ref().map(of);
        all.extend([
            above_noise(GNSS_NOISE, gnss(|gyro| gyro.gnss_sigma_mps)),
            above_noise(GNSS_COLOURED, gnss(|gyro| gyro.gnss_coloured_mps)),
        ]);
        if let Some(gyro) = self.gyro.as_ref().filter(|gyro| gyro.has_coloured_gnss()) {
            let time_s = Some(gyro.gnss_correlation_s);
            all.push(spread(GNSS_CORRELATION_TIME, time_s, NO_TIME_SCALE));
        }
        for (which, name) in LATENCY.into_iter().enumerate() {
            let bound = self.latency_s.map(|bounds| bounds[which]);
            all.push(known(name, bound, NO_LATENCY));
        }
        all
    }

    fn gyro_parameters(&self) -> Vec<Parameter> {
        let Some(gyro) = &self.gyro else {
            let rest = self.gyro_noise_at_rest();
            return vec![
                known(GYRO_NOISE, rest, NO_REST),
                known(GYRO_SIGMA, None, NO_MINUTES),
            ];
        };
        let deg_h = |found: &Interval| Some(found.scaled(1.0 / DEG_H_RADPS));
        let timed = |name| {
            let seen = gyro.has_time_scale();
            parameter(name, Some(gyro.time_s), seen, NO_TIME_SCALE)
        };
        let mut all = vec![
            above_noise(GYRO_NOISE, deg_h(&gyro.noise)),
            above_noise(GYRO_SIGMA, deg_h(&gyro.initial_sigma)),
        ];
        let (drift, size) = (deg_h(&gyro.drift), deg_h(&gyro.size));
        all.extend(match gyro.law {
            Law::Wave => [
                timed(JUMP_INTERVAL),
                parameter(JUMP_MEAN, drift, gyro.is_random(), NO_TIME_SCALE),
                above_noise(JUMP_SIGMA, size),
            ],
            Law::Continuous => [
                above_noise(SLOPE_SIGMA, drift),
                above_noise(CORRELATED_SIGMA, size),
                timed(CORRELATION_TIME),
            ],
        });
        all
    }

    /// A random model within the confidence intervals, every value drawn independently. Values without
    /// an upper bound keep theirs, and so do noises and times that are not observed: see
    /// [`Self::assumed`].
    #[must_use]
    pub fn drawn(&self, random: &mut Random) -> Self {
        let mut draw = |interval: &Interval| interval.drawn(random);
        let mut gyro = self.gyro.clone();
        if let Some(gyro) = &mut gyro {
            let may_be_none = [
                &mut gyro.initial_sigma,
                &mut gyro.drift,
                &mut gyro.size,
                &mut gyro.gnss_coloured_mps,
            ];
            let never_none = [
                &mut gyro.noise,
                &mut gyro.gnss_sigma_mps,
                &mut gyro.time_s,
                &mut gyro.gnss_correlation_s,
            ];
            let bounded = may_be_none
                .into_iter()
                .filter(|found| found.high.is_finite());
            let seen = never_none.into_iter().filter(|found| found.is_bounded());
            for interval in bounded.chain(seen) {
                *interval = draw(interval);
            }
        }
        Self {
            gyro,
            accel_sigma: self.accel_sigma.as_ref().map(&mut draw),
            gyro_scale: self.gyro_scale.as_ref().map(&mut draw),
            accel_scale: self.accel_scale.as_ref().map(&mut draw),
            latency_s: self.latency_s.map(|[least, most]| {
                let low = draw(&least);
                let high = if most == least { low } else { draw(&most) };
                if low.value <= high.value {
                    [low, high]
                } else {
                    [high, low]
                }
            }),
            gyro_at_rest: self.gyro_at_rest.map(|noise| noise.drawn(random)),
            accel_at_rest: self.accel_at_rest.map(|noise| noise.drawn(random)),
            ..self.clone()
        }
    }

    /// What is not observable in the drives, and the values assumed instead.
    pub fn assumed(&self) -> Vec<Assumed> {
        let model = self.model();
        let mut all: Vec<Assumed> = (self.parameters().into_iter())
            .filter_map(|parameter| Assumed::of(&parameter, &model))
            .collect();
        let moved = self.clocks_shifted.then_some((LATENCY[1], CLOCKS));
        for ((name, unit), why) in moved.into_iter().chain(NEVER_SHOWN) {
            let value = in_file(&model, name);
            all.push(Assumed {
                name,
                unit,
                value,
                why,
            });
        }
        all
    }

    /// The model for simulated flights and drives; what was not identified is that of the class.
    pub fn model(&self) -> ErrorModel {
        let mut model = self.grade.errors();
        if let Some(noise) = self.gyro_noise_at_rest() {
            model.gyro_deg_h.white_noise = noise.value;
        }
        if let Some(gyro) = &self.gyro {
            for (found, in_model) in [
                (
                    gyro.noise.scaled(1.0 / DEG_H_RADPS),
                    &mut model.gyro_deg_h.white_noise,
                ),
                (gyro.gnss_sigma_mps, &mut model.gnss.velocity_sigma_mps),
            ] {
                *in_model = observed_or(*in_model, &found);
            }
            model.gyro_deg_h.bias = gyro_bias(gyro, model.gyro_deg_h.bias.initial_sigma());
            if gyro.has_coloured_gnss() {
                model.gnss.habits.velocity = Correlated {
                    sigma: gyro.gnss_coloured_mps.value,
                    time_s: gyro.gnss_correlation_s.value,
                };
            }
        }
        if let Some(noise) = &self.gyro_at_rest {
            let in_motion = model.gyro_deg_h.white_noise / noise.density.value;
            model.gyro_deg_h.noise_times = noise.model_times(in_motion);
        }
        if let Some(noise) = &self.accel_at_rest {
            model.accel_mps2.white_noise = noise.density.value;
            model.accel_mps2.noise_times = noise.model_times(1.0);
        }
        if let Some(sigma) = self.accel_sigma {
            model.accel_mps2.bias.set_initial_sigma(sigma.value);
        }
        for (found, in_model) in [
            (self.gyro_scale, &mut model.gyro_deg_h.scale_sigma),
            (self.accel_scale, &mut model.accel_mps2.scale_sigma),
        ] {
            if let Some(sigma) = found {
                *in_model = observed_or(*in_model, &sigma);
            }
        }
        if let Some(bounds) = self.latency_s {
            model.gnss.latency_s = bounds.map(|bound| bound.value);
        }
        if self.fix_rate_hz > 0.0 {
            model.gnss.rate_hz = (100.0 * self.fix_rate_hz).round() / 100.0;
        }
        model
    }
}

/// Path in the file, and unit.
type Name = (&'static str, &'static str);

const GYRO_NOISE: Name = ("gyro_deg_h.white_noise", "deg/h/sqrt(Hz)");
const GYRO_SIGMA: Name = ("gyro_deg_h.bias.initial_sigma", "deg/h");
const JUMP_INTERVAL: Name = ("gyro_deg_h.bias.interval_s", "s");
const JUMP_MEAN: Name = ("gyro_deg_h.bias.jump_mean", "deg/h");
const JUMP_SIGMA: Name = ("gyro_deg_h.bias.jump_sigma", "deg/h");
const SLOPE_SIGMA: Name = ("gyro_deg_h.bias.slope_sigma_per_s", "deg/h/s");
const CORRELATED_SIGMA: Name = ("gyro_deg_h.bias.correlated_sigma", "deg/h");
const CORRELATION_TIME: Name = ("gyro_deg_h.bias.correlation_time_s", "s");
const GYRO_SCALE: Name = ("gyro_deg_h.scale_sigma", "1");
const ACCEL_NOISE: Name = ("accel_mps2.white_noise", "m/s^2/sqrt(Hz)");
const ACCEL_SIGMA: Name = ("accel_mps2.bias.initial_sigma", "m/s^2");
const ACCEL_SCALE: Name = ("accel_mps2.scale_sigma", "1");
const GNSS_NOISE: Name = ("gnss.velocity_sigma_mps", "m/s");
const GNSS_COLOURED: Name = ("gnss.habits.velocity.sigma", "m/s");
const GNSS_CORRELATION_TIME: Name = ("gnss.habits.velocity.time_s", "s");
const LATENCY: [Name; 2] = [("gnss.latency_s[0]", "s"), ("gnss.latency_s[1]", "s")];

const NO_REST: &str = "needs some seconds at rest";
const NO_SCATTER: &str = "needs some seconds at rest in which every axis scatters";
const NO_TURN: &str = "needs turns and stops, or is below the error of its estimates";
const NO_MINUTES: &str = "needs some minutes of navigation";
const NO_MANOEUVRE: &str =
    "needs turns for gyros, banks and hard braking for accelerometers, or is below what they show";
const NO_LATENCY: &str = "needs starts and brakings";
const NOT_ABOVE_NOISE: &str = "not above what the noise hides: no more than the upper bound";
/// What is observable in no drive, and why.
const NEVER_SHOWN: [(Name, &str); 8] = [
    (("gyro_deg_h.misalignment_sigma", "1"), NOT_FITTED),
    (("accel_mps2.misalignment_sigma", "1"), NOT_FITTED),
    (("imu.gyro_g_sensitivity_deg_h_g", "deg/h/g"), NOT_FITTED),
    (("accel_mps2.bias.correlated_sigma", "m/s^2"), DROWNED),
    (("gnss.horizontal_sigma_m", "m"), NOTHING_BETTER),
    (("gnss.vertical_sigma_m", "m"), NOTHING_BETTER),
    (("temperature, vibration rectification", ""), NO_TERM),
    (
        ("antenna; what the receiver leaves out, delays, smooths", ""),
        NOT_CARRIED,
    ),
];
const NOT_BOUNDED: &str = "has no upper bound: more drives would set one, or longer ones";
const NO_BOUND: &str = "has no upper bound: models drawn keep the value";
const CLOCKS: &str =
    "without the shift by which the fixes were moved: that is taken for one of clocks";
const NOT_FITTED: &str = "not told from a bias at one attitude";
const DROWNED: &str = "drowns in the noise of GNSS";
const NOTHING_BETTER: &str = "nothing better to compare positions with";
const NOT_CARRIED: &str = "not carried over: a file for --set says it";
const NO_TERM: &str = "no term of the model: what the drives had of it is in noise and biases";
const NO_TIME_SCALE: &str = "needs a larger random part, or more and longer drives";

const GYRO_TIMES: [&str; 3] = [
    "gyro_deg_h.noise_times[0]",
    "gyro_deg_h.noise_times[1]",
    "gyro_deg_h.noise_times[2]",
];
const ACCEL_TIMES: [&str; 3] = [
    "accel_mps2.noise_times[0]",
    "accel_mps2.noise_times[1]",
    "accel_mps2.noise_times[2]",
];

fn times(names: [&'static str; 3], noise: Option<RestNoise>) -> [Parameter; 3] {
    let found = noise.and_then(|noise| noise.times);
    let of = |axis: usize| known((names[axis], "1"), found.map(|all| all[axis]), NO_SCATTER);
    [0, 1, 2].map(of)
}

fn known(name: Name, found: Option<Interval>, missing: &'static str) -> Parameter {
    parameter(name, found, found.is_some(), missing)
}

/// A sigma is observable if it is bounded away from zero.
fn spread(name: Name, found: Option<Interval>, missing: &'static str) -> Parameter {
    let observable = found.is_some_and(|found| found.is_bounded());
    parameter(name, found, observable, missing)
}

/// A sigma that is not observed is below its upper bound, if there is one.
fn above_noise(name: Name, found: Option<Interval>) -> Parameter {
    let missing = match found {
        Some(found) if found.high.is_finite() => NOT_ABOVE_NOISE,
        Some(_) => NOT_BOUNDED,
        None => NO_MINUTES,
    };
    spread(name, found, missing)
}

/// The value identified, else that assumed, within the bounds.
fn observed_or(assumed: f64, found: &Interval) -> f64 {
    if found.is_bounded() {
        found.value
    } else {
        assumed.max(found.low).min(found.high)
    }
}

fn parameter(
    (name, unit): Name,
    found: Option<Interval>,
    observable: bool,
    missing: &'static str,
) -> Parameter {
    Parameter {
        name,
        unit,
        found,
        observable,
        why: if observable { "" } else { missing },
    }
}

/// With the initial sigma of the class where that of the unit has no upper bound.
fn gyro_bias(gyro: &GyroFit, of_class: f64) -> BiasModel {
    let deg_h = 1.0 / DEG_H_RADPS;
    let initial_sigma = if gyro.initial_sigma.high.is_finite() {
        deg_h * gyro.initial_sigma.value
    } else {
        of_class
    };
    match gyro.law {
        Law::Wave if gyro.is_random() => BiasModel::Wave {
            initial_sigma,
            interval_s: gyro.time_s.value,
            jump_mean: deg_h * gyro.drift.value,
            jump_sigma: deg_h * gyro.size.value,
        },
        Law::Wave => BiasModel::constant(initial_sigma),
        Law::Continuous => BiasModel::Continuous {
            initial_sigma,
            slope_sigma_per_s: deg_h * gyro.drift.bounded_or_zero(),
            correlated_sigma: deg_h * gyro.size.bounded_or_zero(),
            correlation_time_s: gyro.time_s.value,
        },
    }
}

/// Motion adds to the noise of a gyro: less than at rest, or none, means that it was attributed to the
/// biases. Only the upper bound is then that of motion.
fn not_below_rest(in_motion: Interval, at_rest: &Interval) -> Interval {
    if in_motion.low > 0.0 && in_motion.value >= at_rest.low {
        return in_motion;
    }
    Interval {
        high: in_motion.high.max(at_rest.high),
        ..*at_rest
    }
}

/// One value if all drives agree on it, else the bounds of a uniform distribution.
fn latency_bounds(latencies: &[Measured]) -> Option<[Interval; 2]> {
    if latencies.is_empty() {
        return None;
    }
    if interval::are_consistent(latencies) {
        return Some([interval::common_value(latencies); 2]);
    }
    let values: Vec<f64> = latencies.iter().map(|latency| latency.value).collect();
    Some(interval::uniform_bounds(&values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::recovery::{drive_record, flight_record, true_model};

    fn identified(model: &ErrorModel, law: Option<Law>) -> Identified {
        let records = [1, 2].map(|seed| drive_record(seed, model, Grade::Hg1700, 25.0));
        Identified::new(&records, Grade::Hg1700, law)
    }

    /// Whether a value lies in the interval, widened from two standard deviations to three: one of
    /// twenty correct intervals misses.
    fn is_near(found: &Identified, name: &str, value: f64) -> bool {
        let all = found.parameters();
        let parameter = all.iter().find(|parameter| parameter.name == name);
        let Interval {
            value: best,
            low,
            high,
        } = parameter.unwrap().found.unwrap();
        (best - 1.5 * (best - low)..best + 1.5 * (high - best)).contains(&value)
    }

    #[test]
    fn noises_are_told_from_constants_and_nothing_is_invented() {
        let found = identified(&ErrorModel::hg1700(), None);
        for (name, value) in [
            ("gyro_deg_h.white_noise", 7.5),
            ("gyro_deg_h.bias.initial_sigma", 1.0),
            ("accel_mps2.white_noise", 0.0005),
            ("accel_mps2.bias.initial_sigma", 0.01),
            ("gnss.velocity_sigma_mps", 0.1),
        ] {
            assert!(is_near(&found, name, value), "{name}: {:?}", found.table());
        }
        // The biases were made constant.
        let BiasModel::Continuous {
            correlated_sigma,
            slope_sigma_per_s,
            ..
        } = found.model().gyro_deg_h.bias
        else {
            panic!("jumps were seen: {:?}", found.table());
        };
        assert!(correlated_sigma == 0.0 && slope_sigma_per_s == 0.0);
    }

    #[test]
    fn what_may_move_as_slowly_as_a_drive_lasts_is_not_lost_from_the_constants() {
        // Here a correlation time of hours is as likely as constants, and took their place.
        let records =
            [114, 115].map(|seed| drive_record(seed, &ErrorModel::hg1700(), Grade::Hg1700, 25.0));
        let found = Identified::new(&records, Grade::Hg1700, Some(Law::Continuous));
        let gyro = found.gyro.as_ref().unwrap();
        let slowly = gyro.size.value / DEG_H_RADPS;
        assert!(slowly > 0.5 && !gyro.is_random(), "{:?}", found.table());
        // Of six draws, whose spread is good to 29 %.
        let in_model = found.model().gyro_deg_h.bias.initial_sigma();
        assert!((in_model - 1.0).abs() < 3.0 * 0.29, "{in_model}");
    }

    #[test]
    fn noise_is_shared_among_axes_as_at_rest() {
        let mut model = ErrorModel::hg1700();
        (model.gyro_deg_h.noise_times, model.accel_mps2.noise_times) =
            ([1.5, 0.5, 0.5_f64.sqrt()], [0.5, 0.5_f64.sqrt(), 1.5]);
        let found = identified(&model, Some(Law::Continuous));
        for (names, times) in [
            (GYRO_TIMES, model.gyro_deg_h.noise_times),
            (ACCEL_TIMES, model.accel_mps2.noise_times),
        ] {
            for (name, times) in names.into_iter().zip(times) {
                assert!(is_near(&found, name, times), "{name}: {:?}", found.table());
                let in_model = in_file(&found.model(), name);
                assert!((in_model / times - 1.0).abs() < 0.3, "{name}: {in_model}");
            }
        }
        let file = super::super::output::toml(&found).unwrap();
        assert!(file.contains("noise_times are those at rest"), "{file}");
    }

    #[test]
    fn large_jumps_are_counted_and_preferred() {
        let mut model = true_model(Grade::Hg1700, Law::Wave);
        model.gyro_deg_h.white_noise = 1.0;
        let found = identified(&model, None);
        let BiasModel::Wave { interval_s, .. } = found.model().gyro_deg_h.bias else {
            panic!("no jumps were seen: {:?}", found.table());
        };
        // Jumps of 2 deg/h are seen to within some seconds, the fourth of them to a quarter.
        assert!((interval_s - 300.0).abs() < 2.0, "{interval_s}");
        assert!(
            is_near(&found, "gyro_deg_h.bias.jump_sigma", 2.0),
            "{:?}",
            found.table()
        );
    }

    #[test]
    fn scales_in_banks_and_the_memory_of_gnss_are_not_taken_for_noise() {
        let model = true_model(Grade::Mems, Law::Continuous);
        let records = [3, 4].map(|seed| flight_record(seed, &model, Grade::Mems, 20.0));
        let found = Identified::new(&records, Grade::Mems, Some(Law::Continuous));
        // Without scales in the likelihood, 13.7 deg/h/sqrt(Hz) came out as 30 with such bounds.
        for (name, value) in [
            ("gyro_deg_h.white_noise", model.gyro_deg_h.white_noise),
            ("gnss.velocity_sigma_mps", model.gnss.velocity_sigma_mps),
            (
                "gnss.habits.velocity.sigma",
                model.gnss.habits.velocity.sigma,
            ),
        ] {
            assert!(is_near(&found, name, value), "{name}: {:?}", found.table());
        }
        let memory = found.gyro.as_ref().unwrap().gnss_coloured_mps;
        assert!(memory.is_bounded(), "{memory:?}");
        let in_model = found.model().gnss.habits.velocity.sigma;
        assert!((in_model - memory.value).abs() < 1e-12);
    }

    #[test]
    fn what_a_short_drive_leaves_open_is_not_called_known() {
        // Of some of these the curvature of the likelihood gave bounds of zero width, or none at all.
        for (grade, model) in [
            (Grade::Hg1700, ErrorModel::hg1700()),
            (Grade::Mems, ErrorModel::mems()),
        ] {
            for seed in 1..=8 {
                let mut record = drive_record(seed, &model, grade, 4.0);
                // A short drive without a rest.
                record
                    .epochs
                    .retain(|epoch| epoch.rest_rate_radps.is_none());
                let before = record.epochs.len().saturating_sub(20);
                record.epochs.drain(..before);
                let found = Identified::new(&[record], grade, None);
                let table = found.table();
                let of = |name: &str| {
                    let mut all = found.parameters().into_iter();
                    all.find(|one| one.name == name).unwrap()
                };
                for (name, value) in [
                    ("gyro_deg_h.white_noise", model.gyro_deg_h.white_noise),
                    ("gnss.velocity_sigma_mps", model.gnss.velocity_sigma_mps),
                ] {
                    let Some(interval) = of(name).found else {
                        continue;
                    };
                    let Interval { low, high, .. } = interval;
                    assert_eq!(of(name).observable, interval.is_bounded(), "{table:?}");
                    if of(name).observable {
                        assert!((1.05..300.0).contains(&(high / low)), "{table:?}");
                    }
                    // Where bounds miss, they miss by little.
                    assert!((0.5 * low..2.0 * high).contains(&value), "{table:?}");
                    // The value in the model is allowed by both.
                    let drawn = found.drawn(&mut Random::stream(seed, "drawn")).model();
                    for model in [found.model(), drawn] {
                        let in_model = in_file(&model, name);
                        assert!(in_model > 0.0 && in_model < 100.0 * value, "{table:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_file_is_what_flights_take() {
        let found = identified(&ErrorModel::hg1700(), Some(Law::Continuous));
        let text = crate::identify::error_model::toml(&found).unwrap();
        assert_eq!(ErrorModel::from_toml(&text).unwrap(), found.model());
        assert!(text.contains("# gyro_deg_h.white_noise"), "{text}");
    }

    #[test]
    fn what_was_not_shown_is_named_with_what_stands_instead() {
        let mut found = identified(&ErrorModel::hg1700(), Some(Law::Continuous));
        let names = |found: &Identified| -> Vec<&str> {
            found.assumed().iter().map(|part| part.name).collect()
        };
        assert!(!names(&found).contains(&"accel_mps2.white_noise"));
        assert!(names(&found).contains(&"gnss.horizontal_sigma_m"));
        found.accel_at_rest = None;
        let all = found.assumed();
        let noise = all
            .iter()
            .find(|part| part.name == "accel_mps2.white_noise")
            .unwrap();
        assert!((noise.value - 0.0005).abs() < 1e-12 && noise.why == NO_REST);
        let latency = found.latency_s.unwrap().map(|bound| bound.value);
        assert!((in_file(&found.model(), "gnss.latency_s[1]") - latency[1]).abs() < 1e-15);
        let text = crate::identify::error_model::toml(&found).unwrap();
        assert!(text.contains("# gnss.horizontal_sigma_m"), "{text}");
    }
}

//! Truth for recorded data: the log altered in ways whose effect on the estimates is known.
//!
//! The estimates of latency and of six biases have to change accordingly. Both runs share the noise of the
//! log, so that their differences should be well below the joint sigma.

use indicatif::ProgressBar;
use ins_core::{ConfigError, GnssFix, ImuOutput, ImuSample};
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use crate::aircraft::plan::at;
use crate::compare::measure::{COMPARED, columns};
use crate::compare::tracks;
use crate::identify::configure;
use crate::identify::halves::Difference;
use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2, Quantity};
use crate::identify::run::identify;
use crate::log::{BodyAxes, Grade, Log};
use crate::sim::ideal::displaced;

const GYRO_RADPS: [f64; 3] = [
    0.4_f64.to_radians(),
    -0.5_f64.to_radians(),
    0.6_f64.to_radians(),
];
const ACCEL_MPS2: [f64; 3] = [0.2, -0.25, 0.3];

/// Effect of an alteration on the expected estimates, right-forward-up.
#[derive(Clone, Copy)]
enum Effect {
    Nothing,
    LatencyS(f64),
    Biases,
    Turned,
}

/// An alteration of a log: name, effect on the expected estimates, and function.
type Alteration = (&'static str, Effect, fn(&mut Log));

const ALTERATIONS: [Alteration; 10] = [
    (
        "fixes stamped 0.15 s later",
        Effect::LatencyS(0.15),
        |log| stamp(log, 0.15),
    ),
    ("0.2 s earlier", Effect::LatencyS(-0.2), |log| {
        stamp(log, -0.2);
    }),
    ("0.5 s later", Effect::LatencyS(0.5), |log| stamp(log, 0.5)),
    (
        "half a degree a second and 20 to 30 mg more",
        Effect::Biases,
        add_biases,
    ),
    ("unit turned by 70, -20 and 30 deg", Effect::Turned, turn),
    ("every second fix", Effect::Nothing, |log| {
        log.gnss = log.gnss.iter().step_by(2).copied().collect();
    }),
    ("every second sample", Effect::Nothing, halve_sample_rate),
    ("no height", Effect::Nothing, |log| {
        each_fix(log, |fix| fix.height_m = None);
    }),
    ("no vertical velocity", Effect::Nothing, |log| {
        each_fix(log, |fix| fix.velocity_up_mps = None);
    }),
    ("world turned by 90 deg", Effect::Nothing, turn_trajectory),
];

/// Estimates of an altered log less the expected ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Altered {
    pub how: &'static str,
    /// Of quantities that are observable in both.
    pub differences: Vec<Difference>,
    /// Quantities that are observable in the log as it is and not in the altered one.
    pub lost: usize,
}

/// Runs all alterations of a log, whose final estimates are `end`.
pub fn test(log: &Log, grade: Grade, end: &tracks::Point) -> Result<Vec<Altered>, ConfigError> {
    let unaltered = columns(BodyAxes::Rfu, end);
    let altered = ALTERATIONS.par_iter().map(|(name, effect, alter)| {
        let mut altered = log.clone();
        alter(&mut altered);
        let config = configure::config(&altered, grade);
        let run = identify(&altered, config, &ProgressBar::hidden())?;
        let end = tracks::points(&run.history, &run.end).pop();
        let found = end.map(|end| columns(BodyAxes::Rfu, &end));
        Ok(compare(name, &effect.on(&unaltered), found.as_ref()))
    });
    altered.collect()
}

/// All but the heading, which two of the alterations redefine.
fn compare(name: &'static str, expected: &[Quantity; 8], found: Option<&[Quantity; 8]>) -> Altered {
    let mut altered = Altered {
        how: name,
        differences: Vec::new(),
        lost: 0,
    };
    for (which, expected) in expected.iter().enumerate().skip(1) {
        let Some(found) = found.map(|found| found[which]).filter(Quantity::observable) else {
            altered.lost += usize::from(expected.observable());
            continue;
        };
        if expected.observable() {
            let sigmas = [expected.sigma, found.sigma];
            let value = found.value - expected.value;
            let difference = Difference::new(COMPARED[which].0, value, sigmas, 0.0);
            altered.differences.push(difference);
        }
    }
    altered
}

impl Effect {
    /// Expected estimates, from those of the unaltered log.
    fn on(self, unaltered: &[Quantity; 8]) -> [Quantity; 8] {
        let mut expected = *unaltered;
        match self {
            Self::Nothing => {}
            Self::LatencyS(seconds) => expected[7].value += 1e3 * seconds,
            Self::Biases => {
                for axis in 0..3 {
                    expected[1 + axis].value += ACCEL_MPS2[axis] / MG_MPS2;
                    expected[4 + axis].value += GYRO_RADPS[axis] / DEG_H_RADPS;
                }
            }
            Self::Turned => {
                for first in [1, 4] {
                    turn_three(&mut expected, first);
                }
            }
        }
        expected
    }
}

/// Rotates three components from `first` on into the axes of the turned unit; observable if all are.
fn turn_three(quantities: &mut [Quantity; 8], first: usize) {
    let [x, y, z] = [first, first + 1, first + 2].map(|which| quantities[which]);
    let turned = mount() * Vector3::new(x.value, y.value, z.value);
    let squares = mount().component_mul(&mount());
    let sigmas = Vector3::new(x.sigma, y.sigma, z.sigma);
    let variances = squares * sigmas.component_mul(&sigmas);
    let unobservable = [x, y, z].into_iter().find(|one| !one.observable());
    for axis in 0..3 {
        quantities[first + axis] = Quantity {
            value: turned[axis],
            sigma: libm::sqrt(variances[axis]),
            observability: unobservable.unwrap_or(x).observability,
        };
    }
}

fn mount() -> Matrix3<f64> {
    let [roll, pitch, yaw] = [30.0_f64, -20.0, 70.0].map(f64::to_radians);
    *Rotation3::from_euler_angles(roll, pitch, yaw).matrix()
}

fn stamp(log: &mut Log, seconds: f64) {
    each_fix(log, |fix| fix.time = fix.time.plus_seconds(seconds));
}

fn each_fix(log: &mut Log, change: impl Fn(&mut GnssFix)) {
    log.gnss.iter_mut().for_each(change);
}

fn each_sample(log: &mut Log, change: impl FnMut(&mut ImuSample)) {
    let mut samples: Vec<_> = log.imu.iter().collect();
    samples.iter_mut().for_each(change);
    log.imu = samples.into();
}

fn add_biases(log: &mut Log) {
    let (gyro, accel) = (Vector3::from(GYRO_RADPS), Vector3::from(ACCEL_MPS2));
    let output = log.meta.imu;
    let mut last = None;
    each_sample(log, |sample| {
        // The interval of the first sample is not known.
        let last = last.replace(sample.time).unwrap_or(sample.time);
        let factor = output.per_rate(sample.time.seconds_since(last));
        sample.gyro += factor * gyro;
        sample.accel += factor * accel;
    });
}

fn turn(log: &mut Log) {
    log.meta.initial_heading_deg = None;
    let mount = mount();
    each_sample(log, |sample| {
        sample.gyro = mount * sample.gyro;
        sample.accel = mount * sample.accel;
    });
}

/// Increments are added in pairs: the rotation between the two is negligible, a millionth.
fn halve_sample_rate(log: &mut Log) {
    let samples: Vec<_> = log.imu.iter().collect();
    let increments = log.meta.imu == ImuOutput::Increments;
    let halved = samples
        .chunks_exact(2)
        .map(|pair| match (increments, pair) {
            (true, [first, second]) => ImuSample {
                time: second.time,
                gyro: first.gyro + second.gyro,
                accel: first.accel + second.accel,
            },
            _ => pair[1],
        });
    log.imu = halved.collect::<Vec<_>>().into();
}

/// Rotates positions and velocities about the first position by 90 deg clockwise: east becomes south.
fn turn_trajectory(log: &mut Log) {
    log.meta.initial_heading_deg = None;
    let turned = |v: Vector2<f64>| Vector2::new(v.y, -v.x);
    each_fix(log, |fix| {
        fix.velocity_en_mps = fix.velocity_en_mps.map(turned);
    });
    let Some(first) = log.gnss.iter().find_map(|fix| fix.position) else {
        return;
    };
    let origin = at(first, 0.0);
    each_fix(log, |fix| {
        fix.position = fix.position.map(|position| {
            let offset_m = turned(at(position, 0.0).enu_from(&origin).xy());
            displaced(&origin, &Vector3::new(offset_m.x, offset_m.y, 0.0)).lat_lon()
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{DriveConfig, simulate};

    fn end(log: &Log) -> tracks::Point {
        let config = configure::config(log, Grade::Mems);
        let found = identify(log, config, &ProgressBar::hidden()).unwrap();
        tracks::points(&found.history, &found.end).pop().unwrap()
    }

    #[test]
    fn estimates_follow_the_alterations_of_a_log() {
        let drive = simulate(&DriveConfig::new(3, Grade::Mems, 12.0));
        let log = drive.into_log(BodyAxes::Rfu, ImuOutput::Rates);
        let end = end(&log);
        let altered = test(&log, Grade::Mems, &end).unwrap();
        for altered in &altered {
            assert_eq!(
                (altered.lost, altered.differences.len()),
                (0, 7),
                "{}",
                altered.how
            );
            for difference in &altered.differences {
                let Difference { name, sigmas, .. } = difference;
                assert!(sigmas.abs() < 3.0, "{}: {name} {sigmas}", altered.how);
            }
        }
        // The comparison detects estimates that do not follow.
        let mut late = log;
        stamp(&mut late, 0.15);
        let [unaltered, found] = [end, self::end(&late)].map(|end| columns(BodyAxes::Rfu, &end));
        assert!(compare("", &unaltered, Some(&found)).differences[6].sigmas > 10.0);
    }
}

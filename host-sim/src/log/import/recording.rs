//! Contents of a recording, its conversion to a log, and functions common to the formats.

use clap::Args;
use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};

use ins_core::{BaroHeight, FixSigma, GnssFix, ImuOutput, ImuSample, Solution, Time};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use tempfile::NamedTempFile;

use crate::log::order::{in_order, outside_samples};
pub(super) use crate::log::read::from_degrees;
use crate::log::{self, BodyAxes, Log, LogError, Meta, table};

/// Which of several sensors and receivers, counted from one; that with the most samples if none is
/// named.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct Choice {
    /// Which of several inertial sensors, counted from 1.
    #[arg(long, value_name = "N")]
    pub imu: Option<usize>,
    /// Which of several receivers, counted from 1.
    #[arg(long, value_name = "N")]
    pub gnss: Option<usize>,
}

#[derive(Default)]
pub(super) struct Recording {
    pub(super) imus: Vec<Imu>,
    pub(super) receivers: Vec<Receiver>,
    pub(super) baro: Vec<BaroHeight>,
    /// Reference motion, attitude in the declared axes of the samples.
    pub(super) truth: Vec<Solution>,
    /// Metadata of the recording itself.
    pub(super) meta: Option<Meta>,
    /// Parameters of the autopilot.
    pub(super) parameters: BTreeMap<String, f64>,
    pub(super) notes: Vec<LogError>,
}

pub(super) struct Imu {
    pub(super) path: PathBuf,
    pub(super) name: String,
    /// Axes of the source; the samples are right-forward-up.
    pub(super) axes: BodyAxes,
    pub(super) output: ImuOutput,
    pub(super) samples: Vec<ImuSample>,
}

pub(super) struct Receiver {
    pub(super) path: PathBuf,
    name: String,
    pub(super) fixes: Vec<GnssFix>,
}

/// A file's bytes, decompressed if it is gzip.
pub(super) fn decompressed(path: &Path) -> Result<Box<dyn BufRead>, LogError> {
    table::decompressed(path).map_err(|e| unreadable(path, &e))
}

/// The same in a temporary file, for parsers that open a path; none if the file is not gzip.
pub(super) fn decompressed_file(path: &Path) -> Result<Option<NamedTempFile>, LogError> {
    let copy = || {
        if !table::is_gzip(path)? {
            return Ok(None);
        }
        let mut file = NamedTempFile::new()?;
        std::io::copy(&mut table::decompressed(path)?, &mut file)?;
        Ok(Some(file))
    };
    copy().map_err(|e| unreadable(path, &e))
}

pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, LogError> {
    let mut bytes = Vec::new();
    let read = decompressed(path)?.read_to_end(&mut bytes);
    read.map_err(|e| unreadable(path, &e))?;
    Ok(bytes)
}

pub(super) fn unreadable(path: &Path, error: &std::io::Error) -> LogError {
    let cause = match error.kind() {
        std::io::ErrorKind::NotFound => "a wrong folder or a misspelt name",
        std::io::ErrorKind::UnexpectedEof => {
            "a copy or a download broke off: `zcat` unpacks what is whole, which can be given in its place"
        }
        _ => "permissions, the disk, or a damaged file",
    };
    LogError::file(path, "a readable file", error.to_string(), cause)
}

impl Recording {
    /// Adds an inertial sensor with rates.
    pub(super) fn add_imu(
        &mut self,
        path: &Path,
        name: impl Into<String>,
        axes: BodyAxes,
        samples: Vec<ImuSample>,
    ) {
        self.imus.push(Imu {
            path: path.to_owned(),
            name: name.into(),
            axes,
            output: ImuOutput::Rates,
            samples,
        });
    }

    pub(super) fn add_receiver(
        &mut self,
        path: &Path,
        name: impl Into<String>,
        fixes: Vec<GnssFix>,
    ) {
        self.receivers.push(Receiver {
            path: path.to_owned(),
            name: name.into(),
            fixes,
        });
    }

    /// Adds the heights of a barometer; the first is used.
    pub(super) fn add_baro(&mut self, heights: impl Iterator<Item = (Time, f64)>) {
        if self.baro.is_empty() {
            self.baro.extend(heights.map(|(time, height_m)| BaroHeight {
                time,
                height_m,
                sigma_m: log::barometer::SIGMA_M,
            }));
        }
    }

    /// Numbers of the inertial sensors, except the default.
    pub(super) fn other_imus(&self) -> Vec<usize> {
        let counts = self.imus.iter().map(|imu| imu.samples.len());
        let counts: Vec<usize> = counts.filter(|count| *count > 0).collect();
        let used = most_samples(&counts).map(|index| index + 1);
        let all = 1..=counts.len();
        all.filter(|number| Some(*number) != used).collect()
    }

    pub(super) fn log(
        mut self,
        path: &Path,
        choice: Choice,
    ) -> Result<(Log, Vec<LogError>), LogError> {
        let without_fix = self.receivers.first().map(|receiver| receiver.path.clone());
        self.imus.retain(|imu| !imu.samples.is_empty());
        self.receivers.retain(|receiver| !receiver.fixes.is_empty());
        let mut warnings = self.notes;
        let damage = warnings.first().map(LogError::in_a_line);
        let with_damage = |error: LogError| match &damage {
            Some(note) => LogError {
                cause: format!("{}; {note}", error.cause).into(),
                ..error
            },
            None => error,
        };
        let listed = self.imus.iter().map(|imu| (&imu.name, imu.samples.len()));
        let from = self.imus.first().map_or(path, |imu| &imu.path);
        let imu = chosen("imu", listed, choice.imu, from, &mut warnings).map_err(with_damage)?;
        let listed = (self.receivers.iter()).map(|from| (&from.name, from.fixes.len()));
        let from = without_fix.as_deref().unwrap_or(path);
        let from = (self.receivers.first()).map_or(from, |receiver| &receiver.path);
        let gnss = chosen("gnss", listed, choice.gnss, from, &mut warnings).map_err(with_damage)?;
        let (imu, gnss) = (self.imus.swap_remove(imu), self.receivers.swap_remove(gnss));
        let samples = in_order(
            imu.samples,
            (&imu.path, &imu.name),
            |s| s.time,
            |s, time| ImuSample { time, ..s },
            |s| s.gyro.iter().chain(&s.accel).all(|x| x.is_finite()),
            &mut warnings,
        )?;
        let before = warnings.len();
        let samples = turned_upright(samples, &imu.path, &mut warnings);
        let turned = warnings.len() > before;
        let plain = || Meta::new(imu.axes, imu.output);
        let mut meta = self.meta.unwrap_or_else(plain);
        if turned {
            drop_stated_in_axes(&mut meta, &mut self.truth, path, &mut warnings);
        }
        if let Some(name) = path.file_stem().and_then(|name| name.to_str()) {
            let entry = meta.document.entry("name");
            entry.or_insert(name.into());
        }
        let source = format!("{} and {}", imu.name, gnss.name);
        meta.document.insert("source".into(), source.into());
        meta.document.insert("turned_upright".into(), turned.into());
        if !self.parameters.is_empty() {
            let set = self.parameters.into_iter();
            let table: toml::Table = set.map(|(name, value)| (name, value.into())).collect();
            meta.document.insert("parameters".into(), table.into());
        }
        let warned = &mut warnings;
        let mut log = Log {
            meta,
            imu: samples.into(),
            gnss: in_order(
                gnss.fixes,
                (&gnss.path, &gnss.name),
                |f| f.time,
                |f, time| GnssFix { time, ..f },
                is_finite,
                warned,
            )?,
            baro: in_order(
                self.baro,
                (path, "barometer"),
                |h| h.time,
                |h, time| BaroHeight { time, ..h },
                |h| h.height_m.is_finite(),
                warned,
            )?,
            truth: self.truth,
        };
        log::check::check(&mut log, &imu.path, &gnss.path, &mut warnings)?;
        log::barometer::check(&mut log, path, &mut warnings);
        let outside = outside_samples(path, "a reference", &log.truth, |row| row.time, &log);
        warnings.extend(outside);
        Ok((log, warnings))
    }
}

/// Rotates a sensor mounted on its side or upside down by quarter turns until up is up. The direction of
/// forward is then arbitrary: heading is found from motion.
fn turned_upright(
    mut samples: Vec<ImuSample>,
    path: &Path,
    warnings: &mut Vec<LogError>,
) -> Vec<ImuSample> {
    let median = |axis: usize| log::median(samples.iter().map(|sample| sample.accel[axis]));
    let up = Vector3::new(median(0), median(1), median(2));
    // As in the check of a log's axes: within 60 deg the mount is tilted.
    if up.z > 0.5 * up.norm() {
        return samples;
    }
    let axis = up.iamax();
    let direction = Vector3::ith(axis, up[axis].signum());
    let turn = match axis {
        2 => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI),
        _ => UnitQuaternion::rotation_between(&direction, &Vector3::z()).unwrap_or_default(),
    };
    for sample in &mut samples {
        sample.gyro = turn * sample.gyro;
        sample.accel = turn * sample.accel;
    }
    let names = [["left", "right"], ["backward", "forward"], ["down", "up"]];
    let found = names[axis][usize::from(up[axis] > 0.0)];
    let found = format!("gravity's reaction towards what should be {found}");
    let cause = "mounted on its side or upside down: both sensors are turned by quarter turns \
                 until it is up";
    let expected = "gravity's reaction towards up";
    warnings.push(LogError::file(path, expected, found, cause));
    samples
}

/// Drops metadata and truth that were stated in axes that have been rotated.
fn drop_stated_in_axes(
    meta: &mut Meta,
    truth: &mut Vec<Solution>,
    path: &Path,
    warnings: &mut Vec<LogError>,
) {
    let heading = meta
        .initial_heading_deg
        .take()
        .map(|_| "initial_heading_deg");
    let arm = meta.lever_arm_rfu_m.take().map(|_| "lever_arm_m");
    let truth = (!std::mem::take(truth).is_empty()).then_some("truth.csv");
    for found in heading.into_iter().chain(arm).chain(truth) {
        let expected = "axes of which z is the vertical one";
        let cause = "stated in axes that had to be turned: not used; turn the columns instead";
        warnings.push(LogError::file(path, expected, found, cause));
    }
}

/// Index of the chosen source, or else of that with the most samples.
fn chosen<'a>(
    option: &str,
    listed: impl Iterator<Item = (&'a String, usize)>,
    number: Option<usize>,
    path: &Path,
    warnings: &mut Vec<LogError>,
) -> Result<usize, LogError> {
    let (names, counts): (Vec<&String>, Vec<usize>) = listed.unzip();
    let listed = (1..).zip(&names).zip(&counts);
    let all: Vec<String> = listed
        .map(|((number, name), count)| format!("{number} {name} ({count})"))
        .collect();
    let all = all.join(", ");
    let (expected, what, none) = match option {
        "imu" => (
            "inertial samples",
            "another inertial sensor",
            "none were logged: `import` takes a second file that has them",
        ),
        _ => (
            "GNSS fixes",
            "another receiver",
            "no receiver, or never a fix: `import` takes a second file that has them",
        ),
    };
    let Some(default) = most_samples(&counts) else {
        return Err(LogError::file(path, expected, "none", none));
    };
    let Some(number) = number else {
        if counts.len() > 1 {
            let cause = format!(
                "{} is used; --{option} N of `import` and `tune` chooses {what}",
                default + 1
            );
            let expected = format!("one source of {expected}");
            warnings.push(LogError::file(path, expected, all, cause));
        }
        return Ok(default);
    };
    let index = number.checked_sub(1).filter(|index| *index < counts.len());
    index.ok_or_else(|| {
        let expected = format!("--{option} from 1 to {}", counts.len());
        LogError::file(path, expected, number.to_string(), all)
    })
}

/// Index of the source with the most samples, the first of equals.
fn most_samples(counts: &[usize]) -> Option<usize> {
    let most = counts.iter().max();
    counts.iter().position(|count| Some(count) == most)
}

/// A vector at a time.
pub(super) type Stamped = (Time, Vector3<f64>);

/// Samples at the times of the gyros, with specific force interpolated.
pub(super) fn joined(gyro: &[Stamped], accel: &[Stamped], axes: BodyAxes) -> Vec<ImuSample> {
    let mut next = 0;
    let mut samples = Vec::new();
    for &(time, rate) in gyro {
        while accel.get(next).is_some_and(|(stamp, _)| *stamp < time) {
            next += 1;
        }
        let (Some(after), Some(before)) = (accel.get(next), accel.get(next.saturating_sub(1)))
        else {
            continue;
        };
        let interval_s = after.0.seconds_since(before.0);
        let since_s = time.seconds_since(before.0);
        // Not across a gap of the accelerometers.
        if since_s < 0.0 || interval_s > 0.2 {
            continue;
        }
        let share = if interval_s > 0.0 {
            since_s / interval_s
        } else {
            0.0
        };
        samples.push(axes.sample(time, rate, before.1.lerp(&after.1, share)));
    }
    samples
}

/// Fixes of a receiver that sends their parts in separate messages, merged by time.
pub(super) fn merged(mut fixes: Vec<GnssFix>) -> Vec<GnssFix> {
    fixes.sort_by_key(|fix| fix.time);
    let mut epochs: Vec<GnssFix> = Vec::new();
    for fix in fixes {
        match epochs.last_mut() {
            Some(last) if fix.time.seconds_since(last.time) < 1e-3 => *last = combined(last, &fix),
            _ => epochs.push(fix),
        }
    }
    epochs
}

fn combined(one: &GnssFix, other: &GnssFix) -> GnssFix {
    let (a, b) = (one.sigma, other.sigma);
    GnssFix {
        time: one.time,
        position: one.position.or(other.position),
        height_m: one.height_m.or(other.height_m),
        velocity_en_mps: one.velocity_en_mps.or(other.velocity_en_mps),
        velocity_up_mps: one.velocity_up_mps.or(other.velocity_up_mps),
        sigma: FixSigma {
            position_m: a.position_m.or(b.position_m),
            height_m: a.height_m.or(b.height_m),
            velocity_mps: a.velocity_mps.or(b.velocity_mps),
            velocity_up_mps: a.velocity_up_mps.or(b.velocity_up_mps),
        },
    }
}

/// Of height and velocity; positions and sigmas are finite as read.
fn is_finite(fix: &GnssFix) -> bool {
    let velocity = fix.velocity_en_mps.iter().flatten();
    let others = fix.height_m.iter().chain(&fix.velocity_up_mps);
    velocity.chain(others).all(|x| x.is_finite())
}

pub(super) fn east_north((east, north): (f64, f64)) -> Vector2<f64> {
    Vector2::new(east, north)
}

pub(super) fn from_course((speed_mps, course_deg): (f64, f64)) -> Vector2<f64> {
    let (sin, cos) = course_deg.to_radians().sin_cos();
    Vector2::new(speed_mps * sin, speed_mps * cos)
}

/// Sigmas of position, height, velocity and vertical velocity; receivers state zero or less for unknown ones.
pub(super) fn fix_sigma(sigmas: [Option<f64>; 4]) -> FixSigma {
    let known = |sigma: Option<f64>| sigma.filter(|s| *s > 0.0 && s.is_finite());
    let [position_m, height_m, velocity_mps, velocity_up_mps] = sigmas.map(known);
    FixSigma {
        position_m,
        height_m,
        velocity_mps,
        velocity_up_mps,
    }
}

/// Sigma per horizontal axis, the root mean square of two.
pub(super) fn horizontal_sigma((a, b): (f64, f64)) -> f64 {
    (0.5 * (a * a + b * b)).sqrt()
}

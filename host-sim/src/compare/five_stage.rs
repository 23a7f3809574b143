//! The thesis's post-processing of a drive in five stages: azimuth, level accelerometers, level
//! gyros, vertical channel, latency.
//!
//! Each stage aligns anew and runs the log corrected by all that earlier stages have found: azimuth in the
//! given heading, biases in the readings, latency in the stamps of fixes. The estimators are the core's
//! literal ones, (7) to (11); a stage uses only its own estimate of its run.
//!
//! The latency comes last, as published, and until then disturbs the level gyros: the tilt by a late fix
//! when the vehicle starts is cancelled at the next stop, but in other body axes if the vehicle has turned
//! meanwhile. With 0.1 s that is 10 deg/h. So the stages can be repeated, each then finding the residual.

use indicatif::ProgressBar;
use ins_core::attitude::matrix;
use ins_core::config::{Feedback, Form, HeadingSource};
use ins_core::{
    Config, ConfigError, Estimate, Estimates, GnssFix, ImuSample, Manoeuvre, Navigator,
    Observability, Phase, Time,
};
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::identify::row::Row;
use crate::identify::run::record;
use crate::log::Log;

/// One round, as published.
pub const PUBLISHED: usize = 1;
/// Rounds until the next would change nothing by more than a sigma, for latencies of up to 0.3 s.
pub const REPEATED: usize = 3;

/// Bandwidth of the last run, rad/s: with small residual errors it may pass less GNSS noise than a loop
/// that has to settle between manoeuvres.
const LAST_BANDWIDTH_RADPS: f64 = 0.2;
/// Shortest interval, s. In longer ones vehicles turn, and a bias constant in body axes matches the
/// platform's drift only at the ends: with 30 s a free INS has ten times the velocity error.
const INTERVAL_S: f64 = 10.0;
/// Least root of the determinant of the mean attitude at the end of an interval: over a whole circle the
/// effect of a bias cancels.
const LEAST_MEAN_ATTITUDE: f64 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// (7): azimuth error at the start.
    Azimuth,
    /// (8): right and forward accelerometers.
    LevelAccels,
    /// (9): right and forward gyros.
    LevelGyros,
    /// (10): up accelerometer and gyro.
    Vertical,
    /// (11): latency of GNSS.
    Latency,
}

impl Stage {
    pub const ALL: [Self; 5] = [
        Self::Azimuth,
        Self::LevelAccels,
        Self::LevelGyros,
        Self::Vertical,
        Self::Latency,
    ];

    pub const fn title(self) -> &'static str {
        match self {
            Self::Azimuth => "azimuth",
            Self::LevelAccels => "level accelerometers",
            Self::LevelGyros => "level gyros",
            Self::Vertical => "vertical channel",
            Self::Latency => "GNSS latency",
        }
    }

    /// Whether the quantity is observable in a manoeuvre.
    fn is_observable_in(self, manoeuvre: Manoeuvre) -> bool {
        match self {
            Self::Azimuth | Self::Latency => {
                matches!(manoeuvre, Manoeuvre::Accelerating | Manoeuvre::Braking)
            }
            Self::LevelAccels => manoeuvre == Manoeuvre::Turning,
            Self::LevelGyros | Self::Vertical => true,
        }
    }

    /// The intervals of a run in which the quantity was observable.
    pub fn intervals(self, history: &[Row]) -> Vec<(Time, Time)> {
        let mut intervals: Vec<(Time, Time)> = Vec::new();
        for pair in history.windows(2) {
            let (row, until) = (&pair[0], pair[1].time);
            if row.phase != Phase::Navigating || !self.is_observable_in(row.manoeuvre) {
                continue;
            }
            match intervals.last_mut() {
                Some((_, end)) if *end == row.time => *end = until,
                _ => intervals.push((row.time, until)),
            }
        }
        intervals
    }

    /// Open: no estimate may act on the run that finds it; except that the azimuth has to be damped for its
    /// loop to show the vertical gyro, and for the heading not to drift away during (7).
    fn feedback(self) -> Feedback {
        match self {
            Self::Azimuth | Self::Vertical => Feedback::Closed,
            Self::LevelAccels | Self::LevelGyros | Self::Latency => Feedback::Open,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct FiveStage {
    /// The five estimates; the azimuth is that of the heading at the start.
    pub estimates: Estimates,
    /// When each was observable, in the order of [`Stage::ALL`].
    pub intervals: [Vec<(Time, Time)>; 5],
    /// The level gyros over time, from the run with all corrections.
    pub gyros: GyroHistory,
    /// That run: an INS damped with low bandwidth, its azimuth too.
    pub history: Vec<Row>,
    pub end: Row,
}

/// Runs a log through all stages, `rounds` times.
///
/// # Errors
/// If the core cannot use the configuration.
pub fn run(log: &Log, config: Config, rounds: usize) -> Result<FiveStage, ConfigError> {
    let config = Config {
        form: Form::Literal,
        ..config
    };
    let mut correction = Correction::default();
    let mut estimates = Estimates::default();
    let mut intervals: [Vec<(Time, Time)>; 5] = Default::default();
    for _ in 0..rounds {
        if !matches!(config.heading, HeadingSource::Given(_)) {
            // Every run finds its own heading.
            correction.azimuth_rad = 0.0;
        }
        for (stage, intervals) in Stage::ALL.into_iter().zip(&mut intervals) {
            let feedback = stage.feedback();
            let config = correction.config(Config { feedback, ..config });
            let (log, hidden) = (correction.log(log), ProgressBar::hidden());
            let (run, end) = record(&log, config, &hidden, |_, _| {})?;
            *intervals = stage.intervals(&run.history);
            add_found(stage, &run.history, &end, &mut correction, &mut estimates);
        }
    }
    let mut gyros = GyroHistory {
        constant_radps: correction.gyro_radps,
        ..GyroHistory::default()
    };
    let mut last_config = Config {
        feedback: Feedback::Closed,
        ..correction.config(config)
    };
    last_config.damping.horizontal.bandwidth_radps = LAST_BANDWIDTH_RADPS;
    let (run, end) = record(
        &correction.log(log),
        last_config,
        &ProgressBar::hidden(),
        |navigator, time| gyros.on_sample(navigator, time),
    )?;
    Ok(FiveStage {
        estimates,
        intervals,
        gyros,
        history: run.history,
        end,
    })
}

/// Adds a stage's estimates to the corrections.
fn add_found(
    stage: Stage,
    history: &[Row],
    end: &Row,
    correction: &mut Correction,
    estimates: &mut Estimates,
) {
    let found = &end.estimates;
    let accel = |axis: usize| {
        let corrected = &mut correction.accel_mps2[axis];
        estimates.accel_bias_mps2[axis] = add(&found.accel_bias_mps2[axis], corrected);
    };
    let gyro = |axis: usize| {
        let corrected = &mut correction.gyro_radps[axis];
        estimates.gyro_bias_radps[axis] = add(&found.gyro_bias_radps[axis], corrected);
    };
    match stage {
        Stage::Azimuth => {
            let residual = Estimate {
                value: start_azimuth(history).unwrap_or_default(),
                ..found.azimuth_error_rad
            };
            estimates.azimuth_error_rad = add(&residual, &mut correction.azimuth_rad);
        }
        Stage::LevelAccels => (0..2).for_each(accel),
        Stage::LevelGyros => (0..2).for_each(gyro),
        Stage::Vertical => {
            (2..3).for_each(accel);
            (2..3).for_each(gyro);
        }
        Stage::Latency => {
            estimates.gnss_latency_s = add(&found.gnss_latency_s, &mut correction.latency_s);
            estimates.gnss_latency_now_s = estimates.gnss_latency_s;
        }
    }
}

/// Adds a residual, zero where nothing was observed, to the correction; the total as an estimate.
fn add(residual: &Estimate, corrected: &mut f64) -> Estimate {
    *corrected += residual.value;
    Estimate {
        value: *corrected,
        ..*residual
    }
}

/// The azimuth error of the heading at the start, rad.
///
/// The loop that damps it is the one whose signal is the vertical gyro in (10), so the core's azimuth
/// contains the damping. Azimuth error minus gyro bias times time is that of an undamped INS, linear in
/// time: a straight line is fitted, and its value at the start taken.
fn start_azimuth(history: &[Row]) -> Option<f64> {
    let navigating = || history.iter().filter(|row| row.phase == Phase::Navigating);
    let start = navigating().next()?.time;
    let (mut squares, mut products) = (Matrix2::zeros(), Vector2::zeros());
    for row in navigating() {
        let Estimates {
            azimuth_error_rad: azimuth,
            gyro_bias_radps: [_, _, gyro],
            ..
        } = &row.estimates;
        if azimuth.observability != Observability::Observable {
            continue;
        }
        let since_s = row.time.seconds_since(start);
        let at = Vector2::new(1.0, since_s);
        squares += at * at.transpose();
        products += at * (azimuth.value - gyro.value * since_s);
    }
    squares.try_inverse().map(|inverse| (inverse * products).x)
}

/// Errors to correct, SI units, body axes right-forward-up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Correction {
    azimuth_rad: f64,
    accel_mps2: Vector3<f64>,
    gyro_radps: Vector3<f64>,
    latency_s: f64,
}

impl Correction {
    /// The log, corrected.
    fn log(&self, log: &Log) -> Log {
        let fix = |fix: &GnssFix| GnssFix {
            time: fix.time.plus_seconds(-self.latency_s),
            ..*fix
        };
        Log {
            meta: log.meta.clone(),
            imu: self.samples(log).into(),
            gnss: log.gnss.iter().map(fix).collect(),
            baro: Vec::new(),
            truth: Vec::new(),
        }
    }

    /// The corrected given heading. One from motion is found anew in every run.
    fn config(&self, mut config: Config) -> Config {
        if let HeadingSource::Given(heading) = &mut config.heading {
            *heading -= self.azimuth_rad;
        }
        config
    }

    fn samples(&self, log: &Log) -> Vec<ImuSample> {
        // The interval of the first sample is unknown: that of the second is used.
        let second = log.imu.get(1);
        let mut last = second.zip(log.imu.first()).map(|(second, first)| {
            let interval_s = second.time.seconds_since(first.time);
            first.time.plus_seconds(-interval_s)
        });
        let corrected = log.imu.iter().map(|sample| {
            let interval_s = last.map_or(0.0, |last| sample.time.seconds_since(last));
            last = Some(sample.time);
            let per_sample = log.meta.imu.per_rate(interval_s);
            ImuSample {
                time: sample.time,
                gyro: sample.gyro - per_sample * self.gyro_radps,
                accel: sample.accel - per_sample * self.accel_mps2,
            }
        });
        corrected.collect()
    }
}

/// Piecewise constant biases in body axes with the same integral as the control `w^C`, over every interval:
/// `INT C dw = INT w^C`. Means of (9) itself do not have it where the vehicle has turned meanwhile. Angle
/// random walk is included, as far as GNSS shows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GyroHistory {
    /// Already corrected in the readings.
    constant_radps: Vector3<f64>,
    /// End of each interval, and residual biases of right and forward gyro, rad/s.
    biases: Vec<(Time, Vector2<f64>)>,
    /// The current interval.
    seconds: f64,
    attitude_s: Matrix2<f64>,
    turned_rad: Vector2<f64>,
    /// Last sample; attitude and control from then on.
    last: Option<(Time, Matrix2<f64>, Vector2<f64>)>,
}

impl GyroHistory {
    /// After an inertial sample; the control is that of the next.
    fn on_sample(&mut self, navigator: &Navigator, time: Time) {
        let Some(ins) = navigator.mechanization() else {
            return;
        };
        if let Some((since, attitude, control)) = self.last {
            let seconds = time.seconds_since(since);
            self.seconds += seconds;
            self.attitude_s += seconds * attitude;
            self.turned_rad += seconds * control;
        }
        let attitude = matrix(&ins.attitude).fixed_view::<2, 2>(0, 0).into_owned();
        let control = navigator.damping_signals().rate_enu_radps.xy();
        self.last = Some((time, attitude, control));
        let mean = self.attitude_s / self.seconds.max(1e-9);
        if self.seconds >= INTERVAL_S
            && mean.determinant() > LEAST_MEAN_ATTITUDE * LEAST_MEAN_ATTITUDE
        {
            if let Some(inverse) = self.attitude_s.try_inverse() {
                self.biases.push((time, inverse * self.turned_rad));
            }
            self.seconds = 0.0;
            self.attitude_s = Matrix2::zeros();
            self.turned_rad = Vector2::zeros();
        }
    }

    /// Biases at a time; constant after the last interval.
    pub fn at(&self, time: Time) -> Vector3<f64> {
        let which = self.biases.partition_point(|(end, _)| *end < time);
        let level = self
            .biases
            .get(which)
            .map_or(Vector2::zeros(), |bias| bias.1);
        self.constant_radps + Vector3::new(level.x, level.y, 0.0)
    }
}

//! The thesis's post-processing of a drive in five stages: azimuth, level accelerometers, level
//! gyros, vertical channel, latency.
//!
//! Each stage aligns anew and runs the log with all that earlier stages have found taken out:
//! azimuth out of the heading given, biases out of readings, latency out of the stamps of fixes.
//! The estimators are the core's literal ones, (7) to (11); of its run a stage takes its own
//! estimate only.
//!
//! The latency comes last, as published, and until then disturbs the level gyros: what a late fix
//! does to the platform at a start is undone at the next stop, but in other body axes if the
//! vehicle has turned meanwhile. With 0.1 s that is 10 deg/h. So the stages can be repeated, each
//! then finding what is left.

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

/// Once through, as published.
pub const PUBLISHED: usize = 1;
/// Until the next time would change no more than the spreads, for latencies of up to 0.3 s.
pub const REPEATED: usize = 3;

/// Bandwidth of the last run, rad/s: little is left to be damped, so it may pass less of the noise
/// of GNSS than a loop that has to settle between manoeuvres.
const SLOW_RADPS: f64 = 0.2;
/// Shortest interval, s. In longer ones vehicles turn, and a bias in body axes then follows the
/// platform at its ends only: at 30 s a free INS keeps ten times the velocity error.
const INTERVAL_S: f64 = 10.0;
/// An interval lasts until this much of the attitude's mean is left: after a whole circle a bias
/// has done nothing that could be seen.
const LEAST_MEAN: f64 = 0.5;

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

    /// Whether the quantity shows itself while the vehicle does this.
    fn shows_in(self, manoeuvre: Manoeuvre) -> bool {
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
            if row.phase != Phase::Navigating || !self.shows_in(row.manoeuvre) {
                continue;
            }
            match intervals.last_mut() {
                Some((_, end)) if *end == row.time => *end = until,
                _ => intervals.push((row.time, until)),
            }
        }
        intervals
    }

    /// Nothing found may act on the run that finds it; except that the azimuth has to be damped
    /// for its loop to show the vertical gyro, and for the heading not to run away from (7).
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
    /// The level gyros over time, as the run with everything taken out shows them.
    pub gyros: GyroHistory,
    /// That run: an INS damped slowly, its azimuth too.
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
            // Found by every run anew.
            correction.azimuth_rad = 0.0;
        }
        for (stage, intervals) in Stage::ALL.into_iter().zip(&mut intervals) {
            let feedback = stage.feedback();
            let config = correction.config(Config { feedback, ..config });
            let (log, hidden) = (correction.log(log), ProgressBar::hidden());
            let (run, end) = record(&log, config, &hidden, |_, _| {})?;
            *intervals = stage.intervals(&run.history);
            take(stage, &run.history, &end, &mut correction, &mut estimates);
        }
    }
    let mut gyros = GyroHistory {
        constant_radps: correction.gyro_radps,
        ..GyroHistory::default()
    };
    let mut slow = Config {
        feedback: Feedback::Closed,
        ..correction.config(config)
    };
    slow.damping.horizontal.bandwidth_radps = SLOW_RADPS;
    let (run, end) = record(
        &correction.log(log),
        slow,
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

/// Adds what a stage's run has found to what is known.
fn take(
    stage: Stage,
    history: &[Row],
    end: &Row,
    correction: &mut Correction,
    estimates: &mut Estimates,
) {
    let found = &end.estimates;
    let accel = |axis: usize| {
        let taken_out = &mut correction.accel_mps2[axis];
        estimates.accel_bias_mps2[axis] = add(&found.accel_bias_mps2[axis], taken_out);
    };
    let gyro = |axis: usize| {
        let taken_out = &mut correction.gyro_radps[axis];
        estimates.gyro_bias_radps[axis] = add(&found.gyro_bias_radps[axis], taken_out);
    };
    match stage {
        Stage::Azimuth => {
            let left = Estimate {
                value: start_azimuth(history).unwrap_or_default(),
                ..found.azimuth_error_rad
            };
            estimates.azimuth_error_rad = add(&left, &mut correction.azimuth_rad);
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

/// The whole error, of which a part was taken out before; and takes out the rest, which is zero
/// where nothing was seen.
fn add(left: &Estimate, taken_out: &mut f64) -> Estimate {
    *taken_out += left.value;
    Estimate {
        value: *taken_out,
        ..*left
    }
}

/// The azimuth error of the heading at the start, rad.
///
/// The loop that takes it out is the one that (10) reads the vertical gyro from: what the core
/// makes of a run is wrong by as much. Together the two say what an INS that had kept its heading
/// would be off by; that walks along a line, with the gyro, from the error at the start.
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

/// Errors to take out, SI units, body axes right-forward-up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Correction {
    azimuth_rad: f64,
    accel_mps2: Vector3<f64>,
    gyro_radps: Vector3<f64>,
    latency_s: f64,
}

impl Correction {
    /// A log as better sensors and a receiver without latency would have written it.
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

    /// The heading to start with. One that is found from motion is found anew in every run.
    fn config(&self, mut config: Config) -> Config {
        if let HeadingSource::Given(heading) = &mut config.heading {
            *heading -= self.azimuth_rad;
        }
        config
    }

    fn samples(&self, log: &Log) -> Vec<ImuSample> {
        // The interval of the first sample is not known: that of the second will do.
        let second = log.imu.get(1);
        let mut last = second.zip(log.imu.first()).map(|(second, first)| {
            let interval_s = second.time.seconds_since(first.time);
            first.time.plus_seconds(-interval_s)
        });
        let corrected = log.imu.iter().map(|sample| {
            let interval_s = last.map_or(0.0, |last| sample.time.seconds_since(last));
            last = Some(sample.time);
            let held = log.meta.imu.per_rate(interval_s);
            ImuSample {
                time: sample.time,
                gyro: sample.gyro - held * self.gyro_radps,
                accel: sample.accel - held * self.accel_mps2,
            }
        });
        corrected.collect()
    }
}

/// Piecewise constant biases in body axes that turn a platform as `w^C` did, over every interval:
/// `INT C dw = INT w^C`. Means of (9) itself would not, where the vehicle has turned meanwhile. The
/// walk of the angle is part of them, as far as GNSS shows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GyroHistory {
    /// Taken out of the readings before.
    constant_radps: Vector3<f64>,
    /// End of each interval, and what is left of right and forward gyro, rad/s.
    biases: Vec<(Time, Vector2<f64>)>,
    /// The interval going on.
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
        if self.seconds >= INTERVAL_S && mean.determinant() > LEAST_MEAN * LEAST_MEAN {
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

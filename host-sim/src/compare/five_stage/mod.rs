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

mod correction;
mod gyro_history;
mod stage;

use indicatif::ProgressBar;
use ins_core::config::{Feedback, Form, HeadingSource};
use ins_core::{Config, ConfigError, Estimate, Estimates, Observability, Phase, Time};
use nalgebra::{Matrix2, Vector2};

use crate::identify::row::Row;

use crate::identify::run::record;
use crate::log::Log;
use correction::Correction;
pub use gyro_history::GyroHistory;
pub use stage::Stage;

/// Once through, as published.
pub const PUBLISHED: usize = 1;
/// Until the next time would change no more than the spreads, for latencies of up to 0.3 s.
pub const REPEATED: usize = 3;

/// Bandwidth of the last run, rad/s: little is left to be damped, so it may pass less of the noise
/// of GNSS than a loop that has to settle between manoeuvres.
const SLOW_RADPS: f64 = 0.2;

/// What the stages found.
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
            let (run, end) = record(
                &correction.log(log),
                Config {
                    feedback: stage.feedback(),
                    ..correction.config(config)
                },
                &ProgressBar::hidden(),
                |_, _| {},
            )?;
            *intervals = stage.intervals(&run.history);
            take(stage, &run.history, &end, &mut correction, &mut estimates);
        }
    }
    let mut gyros = GyroHistory::new(correction.gyro_radps);
    let mut slow = Config {
        feedback: Feedback::Closed,
        ..correction.config(config)
    };
    slow.damping.horizontal.bandwidth_radps = SLOW_RADPS;
    let (run, _) = record(
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

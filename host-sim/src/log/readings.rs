//! Signs, order and unit of the sensors' channels, tried against the motion that GNSS shows.
//!
//! However the unit is mounted, and whatever moves it: a wrong sign makes of the sensors' axes a
//! left-handed frame, in which no mount explains what was seen.

use super::Log;
use super::clock::{Clocks, Shift};
use super::error::LogError;
use super::findings::Findings;
use super::rates::{Rate, Rates};
use super::turns::gyro_units;

/// Evidence that readings are others than they are said to be: so much more of it, in all, and
/// beyond what chance adds to a motion of a minute.
const TIMES: f64 = 1.05;
const MORE: f64 = 20.0;
/// Ten times the offset of a consumer gyro, rad/s.
const NO_OFFSET_RADPS: f64 = 0.1;
/// As much of a log as tells, s.
const TRIED_S: f64 = 1800.0;

/// Readings as they might be meant.
struct Guess {
    cause: String,
    column: &'static str,
    /// Whether they cannot be used as they are.
    refused: bool,
    read: Box<dyn Fn(&mut Rate)>,
}

impl Guess {
    fn new(column: &'static str, cause: String, read: impl Fn(&mut Rate) + 'static) -> Self {
        Self {
            cause,
            column,
            refused: false,
            read: Box::new(read),
        }
    }
}

/// Says so where other readings of the channels would explain the motion far better.
pub(super) fn check_readings(
    log: &Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let tried = rates.until(TRIED_S);
    let mut clocks = Clocks::new(log, &tried);
    let as_it_is = clocks.finer(clocks.at(0.0));
    let mut best: Option<(Shift, Guess)> = None;
    for guess in guesses(log, rates) {
        clocks.read_anew(&tried.read_as(&guess.read));
        let rough = clocks.at(as_it_is.s);
        if rough.evidence < as_it_is.evidence {
            continue;
        }
        let shift = clocks.finer(rough);
        if guess.refused && !(shift.decides_over(&as_it_is) && clocks.explained_by(&shift)) {
            continue;
        }
        if best
            .as_ref()
            .is_none_or(|(best, _)| shift.evidence > best.evidence)
        {
            best = Some((shift, guess));
        }
    }
    let least = TIMES * as_it_is.evidence.max(0.0) + MORE;
    let Some((shift, guess)) = best.filter(|(shift, _)| shift.evidence > least) else {
        return Ok(());
    };
    let expected = "sensors that feel the motion that GNSS shows";
    let found = format!(
        "other readings that explain it far better (evidence {:.0} against {:.0})",
        shift.evidence, as_it_is.evidence
    );
    let defect = findings
        .imu(expected, found, guess.cause)
        .in_column(guess.column);
    if guess.refused {
        return Err(defect);
    }
    findings.warn(defect);
    Ok(())
}

fn guesses(log: &Log, rates: &Rates) -> Vec<Guess> {
    let axes = log.meta.body_axes;
    let name = |component: usize| {
        let own = (0..3).find(|&axis| axes.rfu_component(axis).0 == component);
        ["x", "y", "z"][own.unwrap_or(component)]
    };
    let all = "all gyros have the wrong sign".to_owned();
    let mut guesses = vec![Guess::new("gyro", all, |rate| rate.gyro_radps *= -1.0)];
    for axis in 0..3 {
        let sign = format!("gyro_{} has the wrong sign", name(axis));
        let turned = move |rate: &mut Rate| rate.gyro_radps[axis] *= -1.0;
        guesses.push(Guess::new("gyro", sign, turned));
        let next = (axis + 1) % 3;
        let swap = format!("gyro_{} and gyro_{} are swapped", name(axis), name(next));
        let swapped = move |rate: &mut Rate| rate.gyro_radps.swap_rows(axis, next);
        guesses.push(Guess::new("gyro", swap, swapped));
    }
    for axis in 0..2 {
        let sign = format!("accel_{} has the wrong sign", name(axis));
        let turned = move |rate: &mut Rate| rate.accel_mps2[axis] *= -1.0;
        guesses.push(Guess::new("accel", sign, turned));
    }
    let swap = format!("accel_{} and accel_{} are swapped", name(0), name(1));
    let swapped = |rate: &mut Rate| rate.accel_mps2.swap_rows(0, 1);
    guesses.push(Guess::new("accel", swap, swapped));
    let offset = rates.typical.gyro_radps;
    if offset.norm() > NO_OFFSET_RADPS {
        let cause = format!(
            "gyro offsets of {:.1} deg/s, beyond any class",
            offset.norm().to_degrees()
        );
        let less = move |rate: &mut Rate| rate.gyro_radps -= offset;
        guesses.push(Guess::new("gyro", cause, less));
    }
    guesses.extend(gyro_units(rates).map(|(times, cause)| Guess {
        refused: true,
        ..Guess::new("gyro", cause, move |rate| rate.gyro_radps /= times)
    }));
    guesses
}

//! Fixed-interval smoother of Rauch, Tung and Striebel over a filtered log.
//!
//! The filter takes out what it finds, so it is errors of its solution that are smoothed: `s` of
//! the corrected and `s + found` of the predicted one at the same fix.

use ins_core::{Estimates, Time};

use super::filter::{Correction, Filter};
use super::{Known, Layout, Noise, StateMatrix, States, propagated, times};

/// The filter just after a correction, kept for the way back.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Stamp.
    pub time: Time,
    known: Known,
    layout: Layout,
    run_s: f64,
    correction: Correction,
}

/// What all data say of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// Stamp.
    pub time: Time,
    /// The INS and its sensors.
    pub known: Known,
    /// Covariance of the errors that are left.
    pub covariance: StateMatrix,
    layout: Layout,
    run_s: f64,
}

impl Smoothed {
    /// In the core's terms.
    pub fn estimates(&self, noise: &Noise) -> Estimates {
        self.known
            .estimates(&self.covariance, self.run_s, &self.layout, noise)
    }
}

impl Record {
    /// Of a filter that has just been corrected.
    pub fn new(filter: &Filter, correction: Correction) -> Self {
        Self {
            time: filter.time,
            known: filter.known,
            layout: filter.layout,
            run_s: filter.run_s(),
            correction,
        }
    }

    fn less(&self, errors: &States, covariance: &StateMatrix) -> Smoothed {
        Smoothed {
            time: self.time,
            known: self.known.less(errors, &self.layout),
            covariance: covariance.clone(),
            layout: self.layout,
            run_s: self.run_s,
        }
    }
}

/// Goes back over the records, which must follow one another without a new alignment between.
pub fn smooth(records: &[Record]) -> Vec<Smoothed> {
    let Some(last) = records.last() else {
        return Vec::new();
    };
    let mut errors = States::zeros(last.layout.size);
    let mut covariance = last.correction.corrected.clone();
    let mut smoothed = vec![last.less(&errors, &covariance)];
    for pair in records.windows(2).rev() {
        let (record, next) = (&pair[0], &pair[1].correction);
        let Some(gain) = gain(&record.correction.corrected, next) else {
            break;
        };
        errors = &gain * (errors + &next.errors);
        let change = propagated(&gain, &(covariance - &next.predicted));
        covariance = &record.correction.corrected + change;
        smoothed.push(record.less(&errors, &covariance));
    }
    smoothed.reverse();
    smoothed
}

/// `P F^T P'^-1`; `None` if the prediction is singular.
fn gain(corrected: &StateMatrix, next: &Correction) -> Option<StateMatrix> {
    // Scaled to correlations first: variances of radians and metres are decades apart.
    let scale = next
        .predicted
        .diagonal()
        .map(|v| 1.0 / v.max(1e-300).sqrt());
    let scaled = |matrix: &StateMatrix| {
        let (rows, columns) = matrix.shape();
        StateMatrix::from_fn(rows, columns, |row, column| {
            matrix[(row, column)] * scale[row] * scale[column]
        })
    };
    let inverse = scaled(&next.predicted).cholesky()?.inverse();
    let cross = times(&next.transition, corrected).transpose();
    Some(times(&cross, &scaled(&inverse)))
}

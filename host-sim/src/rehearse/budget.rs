//! With what errors a flight is flown: those found, others that the drives allow, and each alone or
//! taken away.

use serde::{Deserialize, Serialize};

use crate::sim::errors::{ErrorModel, GnssModel, SensorModel};

/// The errors of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Case {
    /// The model that the drives show.
    Found,
    /// The same, recorded noise in place of white.
    Recorded,
    /// A model drawn from what the drives leave open.
    Drawn(u32),
    /// One source of errors alone, of [`SOURCES`].
    Only(usize),
    /// All but one.
    Without(usize),
}

/// A source of errors: its name, and how it is copied from one model into another.
pub type Source = (&'static str, fn(&ErrorModel, &mut ErrorModel));

/// All of them: together they are the model.
pub const SOURCES: [Source; 12] = [
    ("gyro noise", |from, to| {
        noise(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro bias, run to run", |from, to| {
        constant(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro bias, in the run", |from, to| {
        moving(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro scale and misalignment", |from, to| {
        proportional(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("accelerometer noise", |from, to| {
        noise(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("accelerometer bias, run to run", |from, to| {
        constant(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("accelerometer bias, in the run", |from, to| {
        moving(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("accelerometer scale and misalignment", |from, to| {
        proportional(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("GNSS velocity noise", |from, to| {
        to.gnss.velocity_sigma_mps = from.gnss.velocity_sigma_mps;
        to.gnss.habits.velocity = from.gnss.habits.velocity;
    }),
    ("GNSS position noise", |from, to| {
        to.gnss.horizontal_sigma_m = from.gnss.horizontal_sigma_m;
        to.gnss.vertical_sigma_m = from.gnss.vertical_sigma_m;
        to.gnss.habits.horizontal = from.gnss.habits.horizontal;
        to.gnss.habits.vertical = from.gnss.habits.vertical;
    }),
    ("GNSS latency and other habits", |from, to| {
        habits(&from.gnss, &mut to.gnss);
    }),
    ("heading at the start", |from, to| {
        to.given_heading_sigma_deg = from.given_heading_sigma_deg;
    }),
];

fn noise(from: &SensorModel, to: &mut SensorModel) {
    to.white_noise = from.white_noise;
    to.noise_times = from.noise_times;
}

fn constant(from: &SensorModel, to: &mut SensorModel) {
    to.bias.set_initial_sigma(from.bias.initial_sigma());
}

fn moving(from: &SensorModel, to: &mut SensorModel) {
    let initial_sigma = to.bias.initial_sigma();
    to.bias = from.bias.clone();
    to.bias.set_initial_sigma(initial_sigma);
}

fn proportional(from: &SensorModel, to: &mut SensorModel) {
    to.scale_sigma = from.scale_sigma;
    to.misalignment_sigma = from.misalignment_sigma;
}

/// All but noise, rate and outages.
fn habits(from: &GnssModel, to: &mut GnssModel) {
    let before = to.habits.clone();
    to.latency_s = from.latency_s;
    to.habits = from.habits.clone();
    to.habits.velocity = before.velocity;
    to.habits.horizontal = before.horizontal;
    to.habits.vertical = before.vertical;
}

/// A model without errors: the unit's output and range, the receiver's rate and outages. A heading
/// is given as far as the model gives one.
fn quiet(model: &ErrorModel) -> ErrorModel {
    let mut quiet = model.clone();
    let mut none = ErrorModel::ideal();
    none.given_heading_sigma_deg = model.given_heading_sigma_deg.map(|_| 0.0);
    for (_, copy) in SOURCES {
        copy(&none, &mut quiet);
    }
    quiet
}

/// The model with one source alone, and with all but it; none where there is nothing of it.
pub fn apart(model: &ErrorModel, source: usize) -> Option<[ErrorModel; 2]> {
    let (_, copy) = SOURCES[source];
    let none = quiet(model);
    let (mut only, mut without) = (none.clone(), model.clone());
    copy(model, &mut only);
    copy(&none, &mut without);
    (only != none).then_some([only, without])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every error of the model belongs to a source: all copied into a quiet one give it back.
    #[test]
    fn sources_together_are_the_model() {
        let mut model = ErrorModel::mems();
        model.given_heading_sigma_deg = Some(3.0);
        model.gyro_deg_h.misalignment_sigma = 0.002;
        model.gnss.habits.velocity.sigma = 0.05;
        model.gnss.habits.smoothing_s = 0.2;
        let mut again = quiet(&model);
        assert_ne!(again, model);
        for (_, copy) in SOURCES {
            copy(&model, &mut again);
        }
        assert_eq!(again, model);
    }

    #[test]
    fn a_source_that_is_not_there_is_not_flown() {
        let model = ErrorModel::hg1700();
        let there = (0..SOURCES.len()).filter(|source| apart(&model, *source).is_some());
        let names: Vec<&str> = there.map(|source| SOURCES[source].0).collect();
        assert!(names.contains(&"gyro noise") && names.contains(&"heading at the start"));
        assert!(!names.contains(&"gyro scale and misalignment"), "{names:?}");
    }
}

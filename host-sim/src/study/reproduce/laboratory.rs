//! The argument of Table 1: drives predict the errors of a flight, a laboratory does not.

use indicatif::ProgressBar;
use ins_core::attitude::matrix;
use ins_core::earth::LocalEarth;
use miette::{Result, miette};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::drive::{Velocities, log_of};
use super::part::{Part, Settings, here};
use super::velocity::{flown, free, rms_velocity, vehicles};
use crate::identify::error_model::{Identified, Record};
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::run::identify;
use crate::log::Grade;
use crate::sim::errors::BiasModel;
use crate::sim::noise::Random;
use crate::sim::{ErrorModel, SimulatedDrive};
use crate::statistics::rms;
use crate::study::flights::route::Route;

/// Sigmas of the vibration rectification in the aircraft and of the final bias by warming up, deg/h; time
/// constant of the latter, s.
const RECTIFIED_DEG_H: f64 = 1.5;
const WARMED_DEG_H: f64 = 1.0;
const WARMING_S: f64 = 1200.0;

/// RMS vibration and warming up in the laboratory, in the car and in the aircraft, relative to the aircraft.
const ENVIRONMENTS: [[f64; 2]; 3] = [[0.0, 0.0], [0.9, 1.0], [1.0, 1.0]];

/// A unit at rest, driven and flown.
struct Unit {
    errors: [Velocities; 3],
    /// Mean gyro reading in the laboratory less Earth rate.
    in_laboratory_deg_h: Vector3<f64>,
    drive: Record,
}

pub(super) fn argument(settings: &Settings, route: &Route) -> Result<Part> {
    let seeds = || settings.seeds(settings.units).into_par_iter();
    let minutes = settings.unit_minutes;
    let units = seeds()
        .map(|seed| Unit::new(seed, minutes, route))
        .collect::<Result<Vec<Unit>>>()?;
    let predicted = |model: &ErrorModel| {
        let fly = |seed| Ok(free(&flown(seed, minutes, route, model)?));
        let flights = seeds().map(fly).collect::<Result<Vec<Velocities>>>()?;
        Ok::<_, miette::Report>(rms_velocity(flights.iter()))
    };
    let models = models(&units);
    let [rest, drives] = [predicted(&models[0])?, predicted(&models[1])?];
    let [laboratory, car, aircraft] =
        [0, 1, 2].map(|which| rms_velocity(units.iter().map(|unit| &unit.errors[which])));
    let numbers = [
        ("in the laboratory, m/s RMS", laboratory),
        ("in the car, m/s RMS", car),
        ("in the aircraft, m/s RMS", aircraft),
        (
            "in the aircraft, predicted from the laboratory, m/s RMS",
            rest,
        ),
        (
            "in the aircraft, predicted from the drives, m/s RMS",
            drives,
        ),
        ("predicted from the laboratory / true", rest / aircraft),
        ("predicted from the drives / true", drives / aircraft),
    ];
    let mut csv = "what,value\n".to_owned();
    csv.extend((numbers.iter()).map(|(what, value)| format!("\"{what}\",{value:.6}\n")));
    Ok(Part {
        name: "table-1-argument",
        title:
            "Table 1, its argument: free velocity error predicted from a laboratory and from drives"
                .to_owned(),
        how: format!(
            "{} units of 0.1 deg/h and 0.01 deg/sqrt(h) at rest, whose gyros answer to vibration \
             (rectified to {RECTIFIED_DEG_H} deg/h, one sigma, in the aircraft; with the square of \
             the vibration, which the car has {} of) and to warming up ({WARMED_DEG_H} deg/h over \
             {:.0} min). These sizes are assumed. Horizontal velocity error over {minutes:.0} min, \
             from an error-free start. The laboratory's model has what the gyros read at rest; that \
             of the drives is what `identify` makes of them, which has no term for either. Both \
             models then fly in sensors that answer to nothing.",
            units.len(),
            ENVIRONMENTS[1][0],
            WARMING_S / 60.0
        ),
        numbers: numbers.map(|(what, value)| here(what, value)).into(),
        svg: None,
        csv,
    })
}

impl Unit {
    fn new(seed: u64, minutes: f64, route: &Route) -> Result<Self> {
        let mut runs = vehicles(seed, minutes, route, &calibrated())?;
        let random_bias = |stream| Vector3::from(Random::stream(seed, stream).normal3());
        let [rectified, warm_up] = [
            RECTIFIED_DEG_H * random_bias("rectification"),
            WARMED_DEG_H * random_bias("temperature"),
        ]
        .map(|bias| DEG_H_RADPS * bias);
        for (run, [vibration, temperature]) in runs.iter_mut().zip(ENVIRONMENTS) {
            add_biases(
                run,
                &(vibration * vibration * rectified),
                &(temperature * warm_up),
            );
        }
        let errors = runs.each_ref().map(free);
        let [rest, drive, _] = runs;
        let in_laboratory_deg_h = laboratory_bias_deg_h(&rest);
        let (log, config) = log_of(drive);
        let found =
            identify(&log, config, &ProgressBar::hidden()).map_err(|error| miette!("{}", error))?;
        Ok(Self {
            errors,
            in_laboratory_deg_h,
            drive: Record::new(&log, &found),
        })
    }
}

/// Units that are accurate at rest.
fn calibrated() -> ErrorModel {
    let mut errors = ErrorModel::hg1700();
    errors.gyro_deg_h.bias = BiasModel::constant(0.1);
    errors.gyro_deg_h.white_noise = 0.01 * 60.0;
    errors.accel_mps2.bias = BiasModel::constant(0.001);
    errors
}

/// Adds the biases by vibration and temperature, rad/s, to the gyro increments.
fn add_biases(run: &mut SimulatedDrive, rectified: &Vector3<f64>, warm_up: &Vector3<f64>) {
    // The truth begins one interval before the samples.
    for (sample, before) in run.imu.iter_mut().zip(&run.truth) {
        let part = 1.0 - libm::exp(-sample.time.as_seconds() / WARMING_S);
        sample.gyro += sample.time.seconds_since(before.time) * (rectified + part * warm_up);
    }
}

/// From the mean reading at rest, with Earth rate at the known attitude subtracted.
fn laboratory_bias_deg_h(rest: &SimulatedDrive) -> Vector3<f64> {
    let (first, last) = (&rest.truth[0], &rest.truth[rest.truth.len() - 1]);
    let earth = LocalEarth::at(first.position.latitude_rad, first.position.height_m).earth_rate();
    let sum: Vector3<f64> = rest.imu.iter().map(|sample| sample.gyro).sum();
    let rate = sum / last.time.seconds_since(first.time);
    (rate - matrix(&first.attitude).tr_mul(&earth)) / DEG_H_RADPS
}

/// From the laboratory and from the drives.
fn models(units: &[Unit]) -> [ErrorModel; 2] {
    let mut laboratory = calibrated();
    let biases = units
        .iter()
        .flat_map(|unit| unit.in_laboratory_deg_h.iter());
    laboratory.gyro_deg_h.bias = BiasModel::constant(rms(biases.copied()));
    let drives: Vec<Record> = units.iter().map(|unit| unit.drive.clone()).collect();
    [
        laboratory,
        Identified::new(&drives, Grade::Hg1700, None).model(),
    ]
}

//! Time of whole passes over the log, all methods in turn in one run, so that ratios are comparable on any
//! machine.

use std::hint::black_box;
use std::time::{Duration, Instant};

use ins_core::config::Form;
use ins_core::{Config, ConfigError, Navigator};
use serde::Serialize;

use crate::compare::kalman::{Noise, Record, Run, smooth};
use crate::identify::run::in_order_of_time;
use crate::log::Log;

/// Passes of each method; the fastest counts.
const PASSES: usize = 5;
/// No pass starts after this time, on long logs.
const TIME_LIMIT: Duration = Duration::from_secs(5);

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    pub method: &'static str,
    /// Per inertial sample with its share of the fixes, ns.
    pub sample_ns: f64,
    /// In units of the compensation in its exact form.
    pub ratio: f64,
}

type Pass<'a> = (&'static str, &'a dyn Fn() -> Result<(), ConfigError>);

pub fn measure(log: &Log, config: Config, noise: Noise) -> Result<Vec<Cost>, ConfigError> {
    let imu = log.imu.all();
    let run = || Run::new(&imu, &log.gnss, config, noise);
    let filter = |mut run: Run| {
        run.finish();
        black_box(run.filter());
        Ok(())
    };
    let passes: [Pass; 5] = [
        ("compensation, exact", &|| {
            navigate(log, config, Form::Exact)
        }),
        ("compensation, literal", &|| {
            navigate(log, config, Form::Literal)
        }),
        ("Kalman, covariance ten times a second", &|| filter(run()?)),
        ("Kalman, covariance at every sample", &|| {
            filter(run()?.with_covariance_at_every_sample())
        }),
        ("Kalman and smoother", &|| {
            let mut run = run()?;
            let mut records = Vec::new();
            let record = &mut |filter: &_, correction| {
                records.push(Record::new(filter, correction));
            };
            while run.step(record).is_some() {}
            black_box(smooth(&records, &noise));
            Ok(())
        }),
    ];
    let mut fastest = [Duration::MAX; 5];
    let started = Instant::now();
    for _ in (0..PASSES).take_while(|_| started.elapsed() < TIME_LIMIT) {
        for ((_, pass), fastest) in passes.iter().zip(&mut fastest) {
            let start = Instant::now();
            pass()?;
            *fastest = start.elapsed().min(*fastest);
        }
    }
    let ours = fastest[0].as_secs_f64();
    let costs = passes.iter().zip(fastest).map(|((method, _), took)| Cost {
        method,
        sample_ns: 1e9 * took.as_secs_f64() / log.imu.len() as f64,
        ratio: took.as_secs_f64() / ours,
    });
    Ok(costs.collect())
}

fn navigate(log: &Log, config: Config, form: Form) -> Result<(), ConfigError> {
    let mut navigator = Navigator::new(Config { form, ..config })?;
    for event in in_order_of_time(log.imu.iter(), &log.gnss) {
        black_box(event.give_to(&mut navigator));
    }
    black_box(navigator.estimates());
    Ok(())
}

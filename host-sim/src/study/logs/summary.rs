//! Statistics over the logs.

use serde::Serialize;

use super::log_study::{LogStudy, OPTIONAL, Outages, Role};
use crate::identify::halves::Difference;
use crate::statistics::{geometric_mean, rms_of_any};

/// Of differences in sigmas.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    pub count: usize,
    /// RMS, sigmas; one if these are consistent.
    pub rms: Option<f64>,
    /// The same without allowances.
    pub rms_plain: Option<f64>,
    pub beyond_3: usize,
    pub beyond_4: usize,
}

impl Statistics {
    /// Of any number of differences.
    #[allow(clippy::needless_pass_by_value)] // An iterator that is used several times.
    pub fn of<'a>(differences: impl Iterator<Item = &'a Difference> + Clone) -> Self {
        let beyond = |limit: f64| {
            let is_beyond = |d: &&Difference| d.sigmas.abs() > limit;
            differences.clone().filter(is_beyond).count()
        };
        Self {
            count: differences.clone().count(),
            rms: rms_of_any(differences.clone().map(|d| d.sigmas)),
            rms_plain: rms_of_any(differences.clone().map(|d| d.plain_sigmas)),
            beyond_3: beyond(3.0),
            beyond_4: beyond(4.0),
        }
    }
}

/// All logs, and their statistics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    pub logs: Vec<LogStudy>,
    /// Of development logs and of judges.
    pub summaries: [Summary; 2],
}

impl Study {
    pub fn new(logs: Vec<LogStudy>) -> Self {
        let summaries = Role::ALL.map(|role| Summary::of(role, &logs));
        Self { logs, summaries }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub role: Role,
    pub logs: usize,
    pub halves: Statistics,
    /// The core against each other method.
    pub methods: Vec<(String, Statistics)>,
    pub altered: Statistics,
    pub outages: OutageSummary,
    /// Logs whose free INS is better with the estimates, of those where anything is observable.
    pub free_better: [usize; 2],
    /// The core without each optional parameter.
    pub without: Vec<WithoutSummary>,
}

/// Drift over many logs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutageSummary {
    /// Logs with outages.
    pub logs: usize,
    /// Of them, those where the core drifts no more than the better of the others.
    pub best: usize,
    /// Core over Kalman filter, geometric mean.
    pub core_over_kalman: Option<f64>,
    /// Core over the better of the others, geometric mean.
    pub core_over_better: Option<f64>,
}

/// One parameter held at zero over many logs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WithoutSummary {
    pub parameter: &'static str,
    /// The core against itself without it.
    pub agreement: Statistics,
    pub halves: Statistics,
    /// Drift without it over drift with it, geometric mean.
    pub outage_ratio: Option<f64>,
}

impl Summary {
    pub fn of(role: Role, logs: &[LogStudy]) -> Self {
        let logs: Vec<&LogStudy> = logs.iter().filter(|log| log.role == role).collect();
        let observable = || (logs.iter()).filter_map(|log| log.free.filter(|free| free.observable));
        let better = observable().filter(|free| free.after_mps < free.before_mps);
        Self {
            role,
            logs: logs.len(),
            halves: Statistics::of(logs.iter().flat_map(|log| log.halves.iter().flatten())),
            methods: methods(&logs),
            altered: Statistics::of(logs.iter().flat_map(|log| log.altered_differences())),
            outages: outages(&logs),
            free_better: [better.count(), observable().count()],
            without: without(&logs),
        }
    }
}

fn methods(logs: &[&LogStudy]) -> Vec<(String, Statistics)> {
    let mut by_name: Vec<(String, Vec<&Difference>)> = Vec::new();
    for agreement in logs.iter().flat_map(|log| &log.methods) {
        let differences = &agreement.differences;
        match by_name.iter_mut().find(|(name, _)| *name == agreement.with) {
            Some((_, all)) => all.extend(differences),
            None => by_name.push((agreement.with.clone(), differences.iter().collect())),
        }
    }
    let statistics =
        |(name, all): (String, Vec<&Difference>)| (name, Statistics::of(all.into_iter()));
    by_name.into_iter().map(statistics).collect()
}

fn outages(logs: &[&LogStudy]) -> OutageSummary {
    let all = || logs.iter().filter_map(|log| log.outages.as_ref());
    OutageSummary {
        logs: all().count(),
        best: all().filter(|o| o.core_m <= o.better_m()).count(),
        core_over_kalman: geometric_mean(all().map(|o| o.core_m / o.kalman_m)),
        core_over_better: geometric_mean(all().map(|o| o.core_m / o.better_m())),
    }
}

impl Outages {
    /// The better of the others.
    pub fn better_m(&self) -> f64 {
        self.kalman_m
            .min(self.fusion_nav_m.unwrap_or(f64::INFINITY))
    }
}

fn without(logs: &[&LogStudy]) -> Vec<WithoutSummary> {
    let summary = |parameter: &'static str| {
        let rows: Vec<_> = logs
            .iter()
            .flat_map(|log| log.without.iter().map(move |row| (log, row)))
            .filter(|(_, row)| row.parameter == parameter)
            .collect();
        let ratio = rows
            .iter()
            .filter_map(|(log, row)| Some(row.outage_m? / log.outages.as_ref()?.core_m));
        WithoutSummary {
            parameter,
            agreement: Statistics::of(rows.iter().flat_map(|(_, row)| &row.agreement.differences)),
            halves: Statistics::of(rows.iter().flat_map(|(_, row)| row.halves.iter().flatten())),
            outage_ratio: geometric_mean(ratio),
        }
    };
    OPTIONAL
        .iter()
        .map(|(parameter, _)| summary(parameter))
        .filter(|summary| summary.agreement.count > 0)
        .collect()
}

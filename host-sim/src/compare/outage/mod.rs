//! GNSS outages placed all along a log: how far an INS drifts that has to do without.

mod drift;
#[cfg(feature = "peers")]
mod peer;
mod reference;
mod runs;

use ins_core::{Config, ConfigError, Navigator, Time};
use serde::Serialize;

use crate::compare::kalman::Noise;
use crate::log::Log;
use crate::page::brief;
use crate::page::table::{Table, heads};
pub use drift::{Drift, Drifts, OUTAGE_S};
use drift::{FRESH_S, STRIDE_S};
use reference::Reference;

/// What the drifts are measured against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Against {
    /// The true motion of a simulation.
    Truth,
    /// The fixes that were kept from the navigators.
    Gnss,
}

/// All navigators through the same outages.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutageTest {
    /// Measured against.
    pub against: Against,
    /// Root mean square of the drifts of each.
    pub navigators: Vec<Drifts>,
}

/// Places outages all along a log, and takes every navigator through them; `None` where none fits.
pub fn test(
    log: &Log,
    simulated: bool,
    config: Config,
    noise: Noise,
) -> Result<Option<OutageTest>, ConfigError> {
    let Some(course) = Course::new(log, simulated, config)? else {
        return Ok(None);
    };
    #[allow(unused_mut, reason = "peers are a feature")]
    let mut navigators = vec![course.core(config)?, course.kalman(config, noise)?];
    #[cfg(feature = "peers")]
    navigators.push(course.peer(config, noise)?);
    Ok(Some(OutageTest {
        against: if simulated {
            Against::Truth
        } else {
            Against::Gnss
        },
        navigators,
    }))
}

/// The outages of a log, and what to measure drifts against.
#[derive(Clone, Debug)]
pub(crate) struct Course<'a> {
    log: &'a Log,
    #[cfg(feature = "peers")]
    survey: runs::Survey,
    starts: Vec<Time>,
    reference: Reference,
}

impl<'a> Course<'a> {
    /// From where the core has settled and, if it ever does, observes the azimuth; `None` where
    /// no outage fits.
    ///
    /// Recorded logs have no truth to trust: there the fixes that are kept from the navigators are
    /// what they are compared with, at the moments that the latency found by the core gives them.
    pub(crate) fn new(
        log: &'a Log,
        simulated: bool,
        config: Config,
    ) -> Result<Option<Self>, ConfigError> {
        let survey = runs::survey(log, config)?;
        let reference = if simulated {
            Reference::of_truth(log)
        } else {
            Reference::of_fixes(log, survey.latency_s)
        };
        let starts = starts(log, &survey, &reference);
        Ok((!starts.is_empty()).then_some(Self {
            log,
            #[cfg(feature = "peers")]
            survey,
            starts,
            reference,
        }))
    }

    /// The core through them.
    pub(crate) fn core(&self, config: Config) -> Result<Drifts, ConfigError> {
        let core = Navigator::new(config)?;
        let drifts = runs::through(self.log, core, &self.starts, &self.reference);
        Ok(Drifts::new("compensation", drifts))
    }

    /// The Kalman filter through them.
    pub(crate) fn kalman(&self, config: Config, noise: Noise) -> Result<Drifts, ConfigError> {
        let drifts = runs::kalman(self.log, config, noise, &self.starts, &self.reference)?;
        Ok(Drifts::new("Kalman", drifts))
    }

    /// The published filter through them.
    #[cfg(feature = "peers")]
    pub(crate) fn peer(&self, config: Config, noise: Noise) -> Result<Drifts, ConfigError> {
        let (starts, reference) = (&self.starts, &self.reference);
        let drifts = peer::drifts(self.log, config, noise, &self.survey, starts, reference)?;
        Ok(Drifts::new("fusion-nav", drifts))
    }
}

impl OutageTest {
    /// A row for each navigator.
    pub(crate) fn table(&self) -> Table {
        let against = match self.against {
            Against::Truth => "the truth",
            Against::Gnss => "the fixes kept from the navigators",
        };
        let title = format!(
            "Horizontal drift over {OUTAGE_S:.0} s without GNSS, against {against}; one outage \
             every {STRIDE_S:.0} s"
        );
        let header = heads("| outages | RMS, m | largest, m | RMS, m/s | largest, m/s");
        let row = |drifts: &Drifts| {
            let numbers = [
                drifts.position_rms_m,
                drifts.position_max_m,
                drifts.velocity_rms_mps,
                drifts.velocity_max_mps,
            ];
            let mut cells = vec![drifts.navigator.to_owned(), drifts.count.to_string()];
            cells.extend(numbers.map(brief));
            cells
        };
        Table::of(title, header, self.navigators.iter().map(row))
    }
}

/// Beginnings of outages at whole strides, with GNSS before and a reference to the end.
fn starts(log: &Log, survey: &runs::Survey, reference: &Reference) -> Vec<Time> {
    let Some(first) = survey.first else {
        return Vec::new();
    };
    let fresh = |start: Time| {
        let next = log.gnss.partition_point(|fix| fix.time < start);
        let last = log.gnss[..next]
            .iter()
            .rev()
            .find(|f| f.velocity_en_mps.is_some());
        last.is_some_and(|fix| start.seconds_since(fix.time) < FRESH_S)
    };
    let last = log.imu.last().map_or(first, |sample| sample.time);
    let next = |start: &Time| Some(start.plus_seconds(STRIDE_S));
    std::iter::successors(Some(first), next)
        .take_while(|start| start.plus_seconds(OUTAGE_S) <= last)
        .filter(|start| fresh(*start) && reference.reaches(start.plus_seconds(OUTAGE_S)))
        .collect()
}

//! What a rehearsal does: everything that its figures depend on.

use serde::Serialize;

use super::budget::{Case, SOURCES, apart};
use super::subject::Subject;
use crate::identify::error_model::Identified;
use crate::sim::ErrorModel;
use crate::sim::errors::ErrorModelError;
use crate::sim::noise::Random;
use crate::sim::recorded::RecordedNoise;

/// Flights of which each drawn model flies the first ones.
const FLIGHTS_OF_A_DRAW: u32 = 5;

/// All choices; as text it tells whether a folder belongs to this rehearsal.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Version of this program: another one may come to other figures.
    pub version: &'static str,
    /// Fixes every random number.
    pub seed: u64,
    /// Names of the drives.
    pub drives: Vec<String>,
    /// Flights with the model that was found.
    pub flights: u32,
    /// Models drawn from what the drives leave open.
    pub models: u32,
    /// Flights for each line of the budget.
    pub budget: u32,
    /// Length of a flight, s.
    pub duration_s: f64,
    /// Its last part without GNSS, s.
    pub free_s: f64,
    /// Inertial samples per second.
    pub imu_hz: u32,
    /// Time limit of an answer, s.
    pub limit_s: f64,
    /// Algorithms under test, as given.
    pub with: Vec<String>,
    /// Log of the recorded noise.
    pub noise_from: Option<String>,
    /// Error of the heading given at the start, deg; none: none is given.
    pub heading_sigma_deg: Option<f64>,
    /// Keys of the error model that the user sets himself.
    pub set: toml::Table,
    /// The model as identified, with heading and keys as above.
    pub model: ErrorModel,
    /// Aircraft and plan as they stand in their files.
    pub aircraft: Option<String>,
    /// See above.
    pub plan: String,
}

/// All that flies: the settings and what stands behind them.
#[derive(Debug)]
pub struct Rehearsal {
    pub settings: Settings,
    pub found: Identified,
    pub noise: Option<RecordedNoise>,
    pub subjects: Vec<Subject>,
}

impl Settings {
    /// A model with this rehearsal's heading and keys.
    pub fn applied(&self, model: ErrorModel) -> Result<ErrorModel, ErrorModelError> {
        let heading = ErrorModel {
            given_heading_sigma_deg: self.heading_sigma_deg,
            ..model
        };
        heading.with(&self.set)
    }

    /// Seed of a flight: the same whatever errors it is flown with.
    pub fn flight_seed(&self, flight: u32) -> u64 {
        Random::stream(self.seed, &format!("flight {flight}")).whole()
    }
}

impl Rehearsal {
    /// Every flight with its model, the most telling first.
    pub fn jobs(&self) -> Vec<(Case, u32)> {
        let settings = &self.settings;
        let flights = |case, count: u32| (0..count).map(move |flight| (case, flight));
        let mut jobs: Vec<(Case, u32)> = flights(Case::Found, settings.flights).collect();
        if self.noise.is_some() {
            jobs.extend(flights(Case::Recorded, settings.flights));
        }
        let few = settings.flights.min(FLIGHTS_OF_A_DRAW);
        for draw in 0..settings.models {
            jobs.extend(flights(Case::Drawn(draw), few));
        }
        let there = |source: &usize| apart(&settings.model, *source).is_some();
        for source in (0..SOURCES.len()).filter(there) {
            let count = settings.flights.min(settings.budget);
            jobs.extend(flights(Case::Only(source), count));
            jobs.extend(flights(Case::Without(source), count));
        }
        jobs
    }

    /// The model of a case.
    pub fn model(&self, case: Case) -> Result<ErrorModel, ErrorModelError> {
        let settings = &self.settings;
        let part = |source, which: usize| {
            apart(&settings.model, source)
                .map_or_else(|| settings.model.clone(), |both| both[which].clone())
        };
        Ok(match case {
            Case::Found | Case::Recorded => settings.model.clone(),
            Case::Drawn(draw) => {
                let mut random = Random::stream(settings.seed, &format!("model {draw}"));
                settings.applied(self.found.drawn(&mut random).model())?
            }
            Case::Only(source) => part(source, 0),
            Case::Without(source) => part(source, 1),
        })
    }

    /// Algorithms that fly a case: what is asked of the model is asked of the first alone.
    pub fn subjects_of(&self, case: Case) -> &[Subject] {
        match case {
            Case::Found | Case::Recorded => &self.subjects,
            _ => &self.subjects[..1],
        }
    }
}

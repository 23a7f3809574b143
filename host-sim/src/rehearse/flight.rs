//! One seeded flight with its sensors, a priori data for the algorithm under test, and its solutions.

use std::time::Duration;

use ins_core::Solution;
use ins_core::attitude::{Euler, from_euler};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::flight::{Flight, FlightError};
use crate::aircraft::plan::Plan;
use crate::identify::run::{Event, merged_by_time};
use crate::log::Grade;
use crate::sim::drive::Recording;
use crate::sim::errors::Outage;
use crate::sim::ideal::displaced;
use crate::sim::noise::Random;
use crate::sim::recorded::RecordedNoise;
use crate::sim::{ErrorModel, SimulatedDrive, record_with};

/// Errors of the initial solution given to the algorithm, one sigma each; the heading's is the model's.
pub const START_POSITION_M: f64 = 5.0;
pub const START_VELOCITY_MPS: f64 = 0.5;
pub const START_LEVEL_DEG: f64 = 1.0;

/// The aircraft, its plan, and how flights of it are recorded.
#[derive(Clone, Debug)]
pub struct Scenario {
    dynamics: Dynamics,
    plan: Plan,
    /// Of every flight, s.
    pub duration_s: f64,
    /// The last part of it is without GNSS, s.
    pub free_s: f64,
    pub imu_hz: u32,
}

#[derive(Clone, Debug)]
pub struct FlightData {
    /// Readings, fixes, and the truth at the start and whenever a solution is asked for.
    pub run: SimulatedDrive,
    /// Initial solution given to the algorithm; the heading is `run.given_heading_rad`.
    pub start: Solution,
}

impl Scenario {
    /// Flies the plan once: all flights last as long as this one.
    pub fn new(
        dynamics: Dynamics,
        plan: Plan,
        free_s: f64,
        imu_hz: u32,
    ) -> Result<Self, FlightError> {
        let duration_s = Flight::new(&dynamics, &plan, 0)?.duration_s()?;
        Ok(Self {
            dynamics,
            plan,
            duration_s,
            free_s,
            imu_hz,
        })
    }

    pub fn aided_s(&self) -> f64 {
        self.duration_s - self.free_s
    }

    /// Flight `seed` with sensors of a model, and recorded noise in place of white if there is any.
    pub fn fly(
        &self,
        seed: u64,
        model: &ErrorModel,
        noise: Option<&RecordedNoise>,
    ) -> Result<FlightData, FlightError> {
        let flight = Flight::new(&self.dynamics, &self.plan, seed)?;
        // Flown once without sensors: a flight that cannot be flown must not give a result.
        flight.check_duration(self.duration_s)?;
        let mut errors = model.clone();
        errors.gnss.outages.push(Outage {
            start_s: self.aided_s(),
            duration_s: self.duration_s,
        });
        let loses = errors.imu.dropped_fraction > 0.0 || !errors.imu.holes.is_empty();
        let recording = Recording {
            seed,
            duration_s: self.duration_s,
            imu_hz: f64::from(self.imu_hz),
            truth_every: if loses { 1 } else { self.imu_hz },
            origin: self.plan.start.position,
            errors,
        };
        let mut run = record_with(flight, &recording, noise);
        if loses {
            run.truth = truth_at_asks(&run, self.imu_hz as usize);
        }
        Ok(FlightData {
            start: initial_solution(&run.truth[0], run.given_heading_rad, seed),
            run,
        })
    }
}

/// Of a truth for every sample the first, and one for each second: at the stamp of the last sample by then,
/// or of the first of all.
fn truth_at_asks(run: &SimulatedDrive, every: usize) -> Vec<Solution> {
    let SimulatedDrive { imu, truth, .. } = run;
    let kept = |of_second: &Solution| {
        let by_then = imu.partition_point(|sample| sample.time <= of_second.time);
        let time = imu.get(by_then.saturating_sub(1))?.time;
        let at = truth.binary_search_by_key(&time, |truth| truth.time);
        at.ok().map(|at| truth[at])
    };
    let seconds = truth.iter().step_by(every).skip(1);
    (truth.first().copied().into_iter())
        .chain(seconds.filter_map(kept))
        .collect()
}

/// The true start with the errors of an alignment before it.
fn initial_solution(truth: &Solution, heading_rad: Option<f64>, seed: u64) -> Solution {
    let mut random = Random::stream(seed, "told start");
    let mut draw = |sigma: f64| sigma * Vector3::from(random.normal3());
    let [moved, speed] = [START_POSITION_M, START_VELOCITY_MPS].map(&mut draw);
    let tilt = draw(START_LEVEL_DEG.to_radians());
    let angles = truth.euler();
    Solution {
        position: displaced(&truth.position, &moved),
        velocity_enu_mps: truth.velocity_enu_mps + speed,
        attitude: from_euler(&Euler {
            roll_rad: angles.roll_rad + tilt.x,
            pitch_rad: angles.pitch_rad + tilt.y,
            heading_rad: heading_rad.unwrap_or(0.0),
        }),
        ..*truth
    }
}

impl FlightData {
    /// Samples and fixes as they arrive; a fix comes after the sample of its own stamp.
    pub fn events(&self) -> impl Iterator<Item = Event<'_>> {
        let arrivals = self.run.arrivals.iter().copied();
        merged_by_time(&self.run.imu, arrivals.zip(&self.run.gnss))
    }

    /// The truth at the samples after which a solution is asked for, once a second.
    pub fn asks(&self) -> &[Solution] {
        &self.run.truth[1..]
    }
}

// --- a priori data and answers ---

/// A priori data on unit and receiver for every algorithm under test: the identified model, whatever
/// model is simulated.
#[derive(Clone, Debug)]
pub struct Apriori {
    /// Preset of the core.
    pub grade: Grade,
    pub model: ErrorModel,
    /// Time limit for an answer of a program.
    pub limit: Duration,
}

/// Results of one flight: a solution for each time asked, where there is one.
#[derive(Clone, Debug)]
pub struct Answers {
    /// In the order of [`FlightData::asks`].
    pub solutions: Result<Vec<Option<Solution>>, Failure>,
    pub took: Duration,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    pub fault: Fault,
    /// Time in the flight, s.
    pub at_s: f64,
    pub cause: String,
}

impl Failure {
    pub(super) fn new(fault: Fault, at_s: f64, cause: impl Into<String>) -> Self {
        let cause = cause.into();
        Self { fault, at_s, cause }
    }
}

/// Failures of programs and boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fault {
    /// It cannot be run, or not with this protocol.
    Unusable,
    Crashed,
    Hung,
    Late,
    /// The answer does not match the request.
    Wrong,
    /// A message to or from a board was lost.
    Lost,
}

impl Fault {
    /// Name in tables.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Unusable => "unusable",
            Self::Crashed => "crashed",
            Self::Hung => "hung",
            Self::Late => "late",
            Self::Wrong => "wrong answer",
            Self::Lost => "lost on the link",
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::aircraft::cessna172;
    use crate::aircraft::plan::{Path2d, at};
    use crate::sim::record;

    /// A round of six kilometres by three that ends at its first waypoint.
    const ROUND: &str = "
        start = { latitude_deg = 56, longitude_deg = 40, height_m = 600, heading_deg = 0, airspeed_mps = 50 }
        air = { turbulence = \"light\" }
        leg = [
            { latitude_deg = 56.03, longitude_deg = 40.0 },
            { latitude_deg = 56.03, longitude_deg = 40.1 },
            { latitude_deg = 56.06, longitude_deg = 40.1 },
            { latitude_deg = 56.03, longitude_deg = 40.0 },
        ]";

    /// A gap of more than a whole second, one at the end, and many lost samples between them.
    #[test]
    fn where_samples_are_lost_the_truth_is_that_of_those_asked_for() {
        let dynamics = Dynamics::new(&cessna172());
        let plan = Plan::parse(Path::new("round.toml"), ROUND, &dynamics).unwrap();
        let scenario = Scenario::new(dynamics, plan, 60.0, 50).unwrap();
        let ideal = ErrorModel::ideal();
        let mut model = ideal.clone();
        model.imu.dropped_fraction = 0.2;
        let ends_s = scenario.duration_s - 0.1;
        for start_s in [19.9, ends_s] {
            let duration_s = 2.5;
            model.imu.holes.push(Outage {
                start_s,
                duration_s,
            });
        }
        let flown = scenario.fly(3, &model, None).unwrap();
        let samples = &flown.run.imu;
        assert_eq!(
            flown.asks().len(),
            crate::statistics::whole(scenario.duration_s)
        );
        assert_eq!(flown.asks()[19].time, flown.asks()[21].time);
        let recording = Recording {
            seed: 3,
            duration_s: scenario.duration_s,
            imu_hz: 50.0,
            truth_every: 1,
            origin: scenario.plan.start.position,
            errors: ideal,
        };
        let flight = Flight::new(&scenario.dynamics, &scenario.plan, 3).unwrap();
        let truth = record(flight, &recording).truth;
        for (second, ask) in (1_i64..).zip(flown.asks()) {
            let by_then = |time: ins_core::Time| time.as_micros() <= 1_000_000 * second;
            let sample = samples.iter().rfind(|sample| by_then(sample.time));
            assert_eq!(Some(ask.time), sample.map(|sample| sample.time));
            assert!(truth.contains(ask), "{ask:?}");
        }
    }

    /// It ends where the plan ends, and does not start again.
    #[test]
    fn a_rehearsed_flight_is_that_of_its_plan() {
        let dynamics = Dynamics::new(&cessna172());
        let plan = Plan::parse(Path::new("round.toml"), ROUND, &dynamics).unwrap();
        let scenario = Scenario::new(dynamics.clone(), plan.clone(), 60.0, 50).unwrap();
        for seed in [0, 1] {
            let model = ErrorModel::ideal();
            let flown = scenario.fly(seed, &model, None).unwrap();
            let recording = Recording {
                seed,
                duration_s: scenario.duration_s,
                imu_hz: 50.0,
                truth_every: 50,
                origin: plan.start.position,
                errors: model,
            };
            let alone = record(Flight::new(&dynamics, &plan, seed).unwrap(), &recording);
            assert_eq!(flown.run.truth, alone.truth);
            let end = flown.run.truth.last().unwrap();
            let Path2d::To(last) = plan.legs[3].path else {
                unreachable!()
            };
            // Some way before or behind: no other flight is as long as the first.
            let off = end.position.enu_from(&at(last, 600.0)).xy();
            assert!(off.norm() < 500.0, "{off}");
        }
    }
}

//! One seed of one kind: simulated, run, compared with the truth.

use clap::Args;
use ins_core::{Solution, SolutionSigma, Time};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::quantities::{QUANTITIES, index};
use super::truth::Truth;
use super::{Kind, Scenario, apriori};
use crate::log::Grade;
use crate::sim::SimulatedDrive;
use crate::statistics::root_mean;
use crate::study::estimator::{self, Core, Estimator, Kalman, Parameter, Parameters};

/// One estimate against its truth, in the unit of the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Index into [`QUANTITIES`].
    pub quantity: usize,
    /// Estimate minus truth.
    pub error: f64,
    pub sigma: Option<f64>,
    pub observable: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Time of the first solution, s.
    pub first_solution_s: Option<f64>,
    /// Fraction of the second half without a solution.
    pub without_solution: f64,
    /// Of the estimates at the end, if there is a solution, and of the errors over the second half.
    pub checks: Vec<Check>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct TrialRuns {
    pub core: Run,
    pub kalman: Option<Run>,
}

/// Options of a run.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct Trial {
    /// Beside the core, a Kalman filter that is told the true noise.
    #[arg(long)]
    pub with_kalman: bool,
    /// Tell the core too how noisy the receiver is, and where it does not smooth, that it does not.
    #[arg(long)]
    pub receiver_known: bool,
}

impl Trial {
    /// Simulates and runs one seed.
    ///
    /// # Panics
    /// If the core refuses its own presets.
    pub fn run(self, kind: &Kind, class: Grade, seed: u64) -> TrialRuns {
        let scenario = kind.scenario(class, seed);
        let drive = scenario.simulate();
        let truth = Truth::new(&scenario, &drive);
        let mut config = apriori::config(&scenario, &drive);
        if self.receiver_known {
            config = apriori::with_receiver_noise(&scenario, config);
        }
        let refused = "presets are valid";
        let core = Core::new(config, &drive).expect(refused);
        let kalman = || {
            let fixes = apriori::corrected_fixes(&scenario, &drive);
            let noise = apriori::noise(&scenario, &config);
            let kalman = Kalman::new(&drive.imu, &fixes, config, noise, &truth.up).expect(refused);
            run_estimator(kalman, &scenario, &drive, &truth)
        };
        TrialRuns {
            core: run_estimator(core, &scenario, &drive, &truth),
            // It has no barometer.
            kalman: (self.with_kalman && drive.baro.is_empty()).then(kalman),
        }
    }
}

fn run_estimator<S: Estimator>(
    mut estimator: S,
    scenario: &Scenario,
    drive: &SimulatedDrive,
    truth: &Truth,
) -> Run {
    let half = Time::default().plus_seconds(30.0 * scenario.minutes);
    let mut second_half = SecondHalf::default();
    let (mut first_solution_s, mut end) = (None, None);
    estimator::run(
        &mut estimator,
        &drive.truth,
        |estimator, time, truth_now| {
            // A missing sample has a truth and no solution.
            let solution = estimator.solution().filter(|_| truth_now.time == time);
            end = solution.map(|solution| (solution, *truth_now));
            if solution.is_some() && first_solution_s.is_none() {
                first_solution_s = Some(time.as_seconds());
            }
            if time >= half && truth_now.time == time {
                let errors =
                    solution.map(|solution| Errors::new(&solution, truth_now, estimator.sigma()));
                second_half.add(errors, scenario.errors.gnss.is_out(time.as_seconds()));
            }
        },
    );
    let mut checks = Vec::new();
    if let (Some(estimates), Some((solution, true_end))) = (estimator.parameters(), end) {
        let error = rotation_between(&true_end.attitude, &solution.attitude);
        let sigma = estimator.sigma().map(|sigma| sigma.attitude_rad);
        check_parameters(&estimates, &error, sigma.as_ref(), truth, &mut checks);
    }
    checks.extend(second_half.checks());
    Run {
        first_solution_s,
        without_solution: second_half.without_solution(),
        checks,
    }
}

/// With the error of the attitude, ENU, and its sigma.
fn check_parameters(
    estimates: &Parameters,
    attitude_error: &Vector3<f64>,
    sigma_rad: Option<&Vector3<f64>>,
    truth: &Truth,
    checks: &mut Vec<Check>,
) {
    let mut add = |quantity: usize, error: f64, estimate: &Parameter| {
        let si = QUANTITIES[quantity].si;
        checks.push(Check {
            quantity,
            error: error / si,
            sigma: estimate.sigma.map(|sigma| sigma / si),
            observable: estimate.observable,
        });
    };
    add(index::HEADING, attitude_error.z, &estimates.heading);
    // On a straight road only one of roll and pitch is observable.
    for axis in 0..2 {
        let sigma_rad = sigma_rad.map(|sigma| sigma[axis]);
        add(
            index::TILT,
            attitude_error[axis],
            &Parameter::observed(0.0, sigma_rad),
        );
    }
    let accels = estimates.accel_bias_mps2.map(Some);
    let gyros = estimates.gyro_bias_radps.map(Some);
    for (first, estimates, truth) in [
        (index::ACCEL, accels, truth.accel_bias_mps2(&estimates.up)),
        (index::GYRO, gyros, truth.gyro_bias_radps(&estimates.up)),
        (index::LEVER, estimates.lever_arm_m, truth.lever_arm_m),
    ] {
        for (axis, estimate) in estimates.iter().enumerate() {
            if let Some(estimate) = estimate {
                add(first + axis, estimate.value - truth[axis], estimate);
            }
        }
    }
    let latency = estimates.latency_s;
    let [least, most] = truth.latency_s;
    let nearest = latency.value.clamp(least, most);
    add(index::LATENCY, latency.value - nearest, &latency);
}

/// Rotation vector from one attitude to another, ENU.
fn rotation_between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    (to * from.inverse()).scaled_axis()
}

/// Squared errors at one time, and over their stated variances (NEES): level position, height, level and
/// vertical velocity, tilt, heading.
#[derive(Clone, Copy, Debug)]
struct Errors {
    squared: [f64; 6],
    nees: Option<[f64; 6]>,
}

impl Errors {
    fn new(solution: &Solution, truth: &Solution, sigma: Option<SolutionSigma>) -> Self {
        let squares =
            |position: &Vector3<f64>, velocity: &Vector3<f64>, attitude: &Vector3<f64>| {
                let three = [position, velocity, attitude];
                let split = three.map(|v| [0.5 * v.xy().norm_squared(), v.z * v.z]);
                core::array::from_fn(|which| split[which / 2][which % 2])
            };
        let squared = squares(
            &solution.position.enu_from(&truth.position),
            &(solution.velocity_enu_mps - truth.velocity_enu_mps),
            &rotation_between(&truth.attitude, &solution.attitude),
        );
        let nees = sigma.map(|s| {
            let variances = squares(&s.position_m, &s.velocity_mps, &s.attitude_rad);
            core::array::from_fn(|which| squared[which] / variances[which])
        });
        Self { squared, nees }
    }
}

/// Errors in the second half of a run.
#[derive(Clone, Debug, Default)]
struct SecondHalf {
    without_solution: usize,
    aided: Vec<Errors>,
    coasting: Vec<Errors>,
}

impl SecondHalf {
    fn add(&mut self, epoch: Option<Errors>, in_outage: bool) {
        match epoch {
            None => self.without_solution += 1,
            Some(epoch) if in_outage => self.coasting.push(epoch),
            Some(epoch) => self.aided.push(epoch),
        }
    }

    /// Fraction of it; all if there are no epochs.
    fn without_solution(&self) -> f64 {
        match self.without_solution + self.aided.len() + self.coasting.len() {
            0 => 1.0,
            epochs => self.without_solution as f64 / epochs as f64,
        }
    }

    /// With GNSS, tilt and heading are checked only at the end.
    fn checks(&self) -> impl Iterator<Item = Check> {
        let aided = checks(&self.aided, index::AIDED, 4);
        aided.chain(checks(&self.coasting, index::COASTING, 6))
    }
}

/// The first `count` errors, as quantities from `first` on. Error over sigma is the RMS of the normalized
/// errors: an epoch with a large sigma does not compensate for others.
fn checks(epochs: &[Errors], first: usize, count: usize) -> impl Iterator<Item = Check> {
    let check = move |which: usize| {
        let quantity = first + which;
        let error = root_mean(epochs.iter().map(|epoch| epoch.squared[which]));
        let error = error / QUANTITIES[quantity].si;
        let nees = epochs.iter().filter_map(|epoch| Some(epoch.nees?[which]));
        let has_sigma = epochs.iter().any(|epoch| epoch.nees.is_some());
        Check {
            quantity,
            error,
            sigma: has_sigma.then(|| error / root_mean(nees)),
            observable: true,
        }
    };
    (0..count).filter(|_| !epochs.is_empty()).map(check)
}

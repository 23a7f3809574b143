//! One seed of one kind: simulated, run, held against the truth.

use clap::Args;
use ins_core::{Solution, SolutionSigma, Time};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::quantities::{QUANTITIES, index};
use super::truth::Truth;
use super::{Kind, World, told};
use crate::log::Grade;
use crate::sim::SimulatedDrive;
use crate::statistics::root_mean;
use crate::study::subject::{self, Claim, Claims, Core, Kalman, Subject};

/// One claim against its truth, in the unit of the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Place in [`QUANTITIES`].
    pub quantity: usize,
    /// Claimed minus true.
    pub error: f64,
    pub sigma: Option<f64>,
    pub observable: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// When there was a solution first, s.
    pub first_solution_s: Option<f64>,
    /// Part of the second half without a solution.
    pub without_solution: f64,
    /// All claims at the end; none without a solution there.
    pub checks: Vec<Check>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    pub core: Run,
    pub kalman: Option<Run>,
}

/// What is done on a seed.
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
    pub fn run(self, kind: &Kind, class: Grade, seed: u64) -> Tried {
        let world = kind.world(class, seed);
        let drive = world.simulate();
        let truth = Truth::new(&world, &drive);
        let mut config = told::config(&world, &drive);
        if self.receiver_known {
            config = told::of_receiver(&world, config);
        }
        let refused = "presets are valid";
        let core = Core::new(config, &drive).expect(refused);
        let kalman = || {
            let (fixes, noise) = (told::fixes(&world, &drive), told::noise(&world, &config));
            let kalman = Kalman::new(&drive.imu, &fixes, config, noise, &truth.up).expect(refused);
            try_on(kalman, &world, &drive, &truth)
        };
        Tried {
            core: try_on(core, &world, &drive, &truth),
            // It knows no barometer.
            kalman: (self.with_kalman && drive.baro.is_empty()).then(kalman),
        }
    }
}

fn try_on<S: Subject>(mut subject: S, world: &World, drive: &SimulatedDrive, truth: &Truth) -> Run {
    let half = Time::default().plus_seconds(30.0 * world.minutes);
    let mut second_half = SecondHalf::default();
    let (mut first_solution_s, mut end) = (None, None);
    subject::drive(&mut subject, &drive.truth, |subject, time, true_now| {
        // A sample that is missing has a truth and no solution.
        let solution = subject.solution().filter(|_| true_now.time == time);
        end = solution.map(|solution| (solution, *true_now));
        if solution.is_some() && first_solution_s.is_none() {
            first_solution_s = Some(time.as_seconds());
        }
        if time >= half && true_now.time == time {
            let now = solution.map(|solution| Look::new(&solution, true_now, subject.sigma()));
            second_half.add(now, world.errors.gnss.is_out(time.as_seconds()));
        }
    });
    let mut checks = Vec::new();
    if let (Some(claims), Some((solution, true_end))) = (subject.claims(), end) {
        let off = rotation_between(&true_end.attitude, &solution.attitude);
        let sigma = subject.sigma().map(|sigma| sigma.attitude_rad);
        check_end(&claims, &off, sigma.as_ref(), truth, &mut checks);
    }
    checks.extend(second_half.checks());
    Run {
        first_solution_s,
        without_solution: second_half.without_solution(),
        checks,
    }
}

/// With an attitude that is off by this, ENU, and known to that.
fn check_end(
    claims: &Claims,
    off: &Vector3<f64>,
    sigma_rad: Option<&Vector3<f64>>,
    truth: &Truth,
    checks: &mut Vec<Check>,
) {
    let mut add = |quantity: usize, error: f64, claim: &Claim| {
        let si = QUANTITIES[quantity].si;
        checks.push(Check {
            quantity,
            error: error / si,
            sigma: claim.sigma.map(|sigma| sigma / si),
            observable: claim.observable,
        });
    };
    add(index::HEADING, off.z, &claims.heading);
    // A road that runs straight shows one of roll and pitch alone.
    for axis in 0..2 {
        let sigma_rad = sigma_rad.map(|sigma| sigma[axis]);
        add(index::TILT, off[axis], &Claim::sure(0.0, sigma_rad));
    }
    let accels = claims.accel_bias_mps2.map(Some);
    let gyros = claims.gyro_bias_radps.map(Some);
    for (first, claims, truth) in [
        (index::ACCEL, accels, truth.accel_bias_mps2(&claims.up)),
        (index::GYRO, gyros, truth.sensors.gyro_bias_radps.into()),
        (index::LEVER, claims.lever_arm_m, truth.lever_arm_m),
    ] {
        for (axis, claim) in claims.iter().enumerate() {
            if let Some(claim) = claim {
                add(first + axis, claim.value - truth[axis], claim);
            }
        }
    }
    let latency = claims.latency_s;
    let [least, most] = truth.latency_s;
    let nearest = latency.value.clamp(least, most);
    add(index::LATENCY, latency.value - nearest, &latency);
}

/// The rotation vector, ENU, that turns one attitude into another.
fn rotation_between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    (to * from.inverse()).scaled_axis()
}

/// Squares of errors at one time, and in their stated variances: position, height, level and
/// vertical velocity, tilt, heading.
#[derive(Clone, Copy, Debug)]
struct Look {
    errors2: [f64; 6],
    ratios2: Option<[f64; 6]>,
}

impl Look {
    fn new(solution: &Solution, truth: &Solution, sigma: Option<SolutionSigma>) -> Self {
        let squares =
            |position: &Vector3<f64>, velocity: &Vector3<f64>, attitude: &Vector3<f64>| {
                let three = [position, velocity, attitude];
                let split = three.map(|v| [0.5 * v.xy().norm_squared(), v.z * v.z]);
                core::array::from_fn(|which| split[which / 2][which % 2])
            };
        let errors2 = squares(
            &solution.position.enu_from(&truth.position),
            &(solution.velocity_enu_mps - truth.velocity_enu_mps),
            &rotation_between(&truth.attitude, &solution.attitude),
        );
        let ratios2 = sigma.map(|s| {
            let sigmas2 = squares(&s.position_m, &s.velocity_mps, &s.attitude_rad);
            core::array::from_fn(|which| errors2[which] / sigmas2[which])
        });
        Self { errors2, ratios2 }
    }
}

/// What was seen in the second half of a run.
#[derive(Clone, Debug, Default)]
struct SecondHalf {
    without_solution: usize,
    aided: Vec<Look>,
    coasting: Vec<Look>,
}

impl SecondHalf {
    fn add(&mut self, look: Option<Look>, in_outage: bool) {
        match look {
            None => self.without_solution += 1,
            Some(look) if in_outage => self.coasting.push(look),
            Some(look) => self.aided.push(look),
        }
    }

    /// Part of it; all where nothing was looked at.
    fn without_solution(&self) -> f64 {
        match self.without_solution + self.aided.len() + self.coasting.len() {
            0 => 1.0,
            looks => self.without_solution as f64 / looks as f64,
        }
    }

    /// Tilt and heading while fixes come are looked at in the end.
    fn checks(&self) -> impl Iterator<Item = Check> {
        let aided = checks(&self.aided, index::AIDED, 4);
        aided.chain(checks(&self.coasting, index::COASTING, 6))
    }
}

/// The first so many errors, as quantities from a place on. The sigma, stated always or never, is the
/// one that errs as often: a moment of not knowing does not excuse the others.
fn checks(looks: &[Look], first: usize, count: usize) -> impl Iterator<Item = Check> {
    let check = move |which: usize| {
        let quantity = first + which;
        let error = root_mean(looks.iter().map(|look| look.errors2[which]));
        let error = error / QUANTITIES[quantity].si;
        let ratios2 = looks.iter().filter_map(|look| Some(look.ratios2?[which]));
        let is_stated = looks.iter().any(|look| look.ratios2.is_some());
        Check {
            quantity,
            error,
            sigma: is_stated.then(|| error / root_mean(ratios2)),
            observable: true,
        }
    };
    (0..count).filter(|_| !looks.is_empty()).map(check)
}

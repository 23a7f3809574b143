//! One seed of one kind: simulated, run, held against the truth.

use clap::Args;
use ins_core::{Solution, SolutionSigma, Time};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::quantities::{QUANTITIES, index};
use super::truth::Truth;
use super::{Kind, World, told};
use crate::sim::{Grade, SimulatedDrive};
use crate::study::subject::{Claim, Claims, Core, Kalman, Subject};

/// One claim against its truth, in the unit of the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Place in [`QUANTITIES`].
    pub quantity: usize,
    /// Claimed minus true.
    pub error: f64,
    /// One sigma, if stated.
    pub sigma: Option<f64>,
    /// Whether it is said to stand on data.
    pub observable: bool,
}

/// One run of somebody.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// When there was a solution first, s.
    pub first_solution_s: Option<f64>,
    /// Part of the second half without a solution.
    pub without_solution: f64,
    /// All claims at the end; none without a solution there.
    pub checks: Vec<Check>,
}

/// Both who were tried on one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    /// The core.
    pub core: Run,
    /// The Kalman filter, if asked for.
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
            kalman: self.with_kalman.then(kalman),
        }
    }
}

fn try_on<S: Subject>(mut subject: S, world: &World, drive: &SimulatedDrive, truth: &Truth) -> Run {
    let half = Time::default().plus_seconds(30.0 * world.minutes);
    let mut truths = drive.truth.iter().peekable();
    let mut second_half = SecondHalf::default();
    let (mut first_solution_s, mut end) = (None, None);
    while let Some(time) = subject.step() {
        while let Some(true_now) = truths.next_if(|true_now| true_now.time <= time) {
            // A sample that is missing has a truth and no solution.
            let solution = subject.solution().filter(|_| true_now.time == time);
            end = solution.map(|solution| (solution, *true_now));
            if solution.is_some() && first_solution_s.is_none() {
                first_solution_s = Some(time.as_seconds());
            }
            if time >= half && true_now.time == time {
                let now = solution.map(|solution| Look::new(&solution, true_now, subject.sigma()));
                second_half.add(now, world.is_out(time));
            }
        }
    }
    let mut checks = Vec::new();
    if let (Some(claims), Some((solution, true_end))) = (subject.claims(), end) {
        check_end(&claims, &solution, &true_end, truth, &mut checks);
    }
    checks.extend(second_half.checks());
    Run {
        first_solution_s,
        without_solution: second_half.without_solution(),
        checks,
    }
}

fn check_end(
    claims: &Claims,
    solution: &Solution,
    true_end: &Solution,
    truth: &Truth,
    checks: &mut Vec<Check>,
) {
    let off = rotation_between(&true_end.attitude, &solution.attitude);
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
    add(index::TILT, off.x, &claims.tilt);
    add(index::TILT, off.y, &claims.tilt);
    for axis in 0..3 {
        let (accel, gyro) = (claims.accel_bias_mps2[axis], claims.gyro_bias_radps[axis]);
        let true_accel = truth.accel_bias_mps2[axis];
        let true_gyro = truth.gyro_bias_radps[axis];
        add(index::ACCEL + axis, accel.value - true_accel, &accel);
        add(index::GYRO + axis, gyro.value - true_gyro, &gyro);
        if let Some(arm) = claims.lever_arm_m[axis] {
            add(
                index::LEVER + axis,
                arm.value - truth.lever_arm_m[axis],
                &arm,
            );
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

/// Sums of looks.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    looks: f64,
    errors2: [f64; 6],
    /// Stated always or never.
    ratios2: Option<[f64; 6]>,
}

impl Sums {
    fn add(&mut self, look: &Look) {
        let add = |sums: &mut [f64; 6], squares: &[f64; 6]| {
            for (sum, square) in sums.iter_mut().zip(squares) {
                *sum += square;
            }
        };
        self.looks += 1.0;
        add(&mut self.errors2, &look.errors2);
        if let Some(ratios2) = &look.ratios2 {
            add(self.ratios2.get_or_insert_default(), ratios2);
        }
    }

    /// The first so many, as quantities from a place on. The sigma is the one that errs as often: a
    /// moment of not knowing does not excuse the others.
    fn checks(self, first: usize, count: usize) -> impl Iterator<Item = Check> {
        let check = move |which: usize| {
            let quantity = first + which;
            let rms = |sum2: f64| (sum2 / self.looks).sqrt();
            let error = rms(self.errors2[which]) / QUANTITIES[quantity].si;
            Check {
                quantity,
                error,
                sigma: self.ratios2.map(|ratios2| error / rms(ratios2[which])),
                observable: true,
            }
        };
        (0..count).filter(move |_| self.looks > 0.0).map(check)
    }
}

/// Sums over the second half.
#[derive(Clone, Copy, Debug, Default)]
struct SecondHalf {
    without_solution: f64,
    aided: Sums,
    coasting: Sums,
}

impl SecondHalf {
    fn add(&mut self, look: Option<Look>, in_outage: bool) {
        match look {
            None => self.without_solution += 1.0,
            Some(look) if in_outage => self.coasting.add(&look),
            Some(look) => self.aided.add(&look),
        }
    }

    fn without_solution(&self) -> f64 {
        let looks = self.without_solution + self.aided.looks + self.coasting.looks;
        if looks > 0.0 {
            self.without_solution / looks
        } else {
            1.0
        }
    }

    /// Tilt and heading while fixes come are looked at in the end.
    fn checks(&self) -> impl Iterator<Item = Check> {
        let aided = self.aided.checks(index::AIDED, 4);
        aided.chain(self.coasting.checks(index::COASTING, 6))
    }
}

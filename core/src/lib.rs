//! Strapdown INS aided by GNSS through damping loops. It estimates its own sensor errors.
//!
//! One type owns all state: [`Navigator`]. Give it samples and fixes as they arrive; the solution and
//! the [`Estimates`] are available at any time. SI units; body axes right-forward-up, navigation
//! frame east-north-up, heading clockwise from north. No allocation, no clock, no panic.
//!
//! ```
//! use ins_core::{
//!     Calibration, Config, ConfigError, GnssFix, Health, ImuSample, Navigator, Phase, Solution,
//!     SolutionSigma,
//! };
//!
//! /// Your drivers. Body axes are right, forward, up; from forward-right-down pass y, x, -z.
//! trait Board {
//!     /// Waits for the next sample; `None` ends the run.
//!     fn wait_for_sample(&mut self) -> Option<ImuSample>;
//!     /// A fix that has arrived since.
//!     fn fix(&mut self) -> Option<GnssFix>;
//!     /// The calibration that the last run has stored.
//!     fn recall(&mut self) -> Option<Calibration>;
//!     fn keep(&mut self, calibration: &Calibration);
//!     fn show(&mut self, solution: &Solution, sigma: &SolutionSigma, health: &Health);
//! }
//!
//! fn navigate(board: &mut impl Board) -> Result<(), ConfigError> {
//!     let config = Config::mems();
//!     let mut navigator = match board.recall() {
//!         // Turn-on repeatability of the data sheet: 0.1 deg/s and 2 mg.
//!         Some(kept) => Navigator::warm(config, &kept.after_turn_on(1.7e-3, 0.02))?,
//!         None => Navigator::new(config)?,
//!     };
//!     while let Some(sample) = board.wait_for_sample() {
//!         while let Some(fix) = board.fix() {
//!             let _ = navigator.on_gnss(&fix); // `Health` counts the outcomes.
//!         }
//!         let _ = navigator.on_imu(&sample);
//!         if let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) {
//!             board.show(&solution, &sigma, &navigator.health());
//!         }
//!     }
//!     if navigator.phase() == Phase::Navigating {
//!         board.keep(&navigator.calibration());
//!     }
//!     Ok(())
//! }
//! # // A car that stands for ten seconds, starts northward, cruises and brakes.
//! # use ins_core::{Time, earth::Geodetic};
//! # struct Car { count: i64, fix: Option<GnssFix>, heading_rad: f64, kept: Option<Calibration> }
//! # impl Board for Car {
//! #     fn wait_for_sample(&mut self) -> Option<ImuSample> {
//! #         self.count += 1;
//! #         let count = self.count;
//! #         let time = Time::from_micros(10_000 * count);
//! #         let at = |start: i64, end: i64| (count.clamp(start, end) - start) as f64 * 0.02;
//! #         let speed = at(1_000, 1_500) - at(2_500, 3_000);
//! #         let accel = match count { 1_001..=1_500 => 2.0, 2_501..=3_000 => -2.0, _ => 0.0 };
//! #         self.fix = (count % 10 == 0).then(|| GnssFix {
//! #             time: Time::from_micros(10_000 * (count - 1)),
//! #             velocity_en_mps: Some([0.0, speed].into()),
//! #             ..GnssFix::default()
//! #         }.at(&Geodetic { latitude_rad: 0.8, ..Geodetic::default() }));
//! #         let sample = ImuSample { time, gyro: [0.0; 3].into(), accel: [0.0, accel, 9.8].into() };
//! #         (count <= 4_000).then_some(sample)
//! #     }
//! #     fn fix(&mut self) -> Option<GnssFix> { self.fix.take() }
//! #     fn recall(&mut self) -> Option<Calibration> { self.kept }
//! #     fn keep(&mut self, calibration: &Calibration) { self.kept = Some(*calibration) }
//! #     fn show(&mut self, solution: &Solution, _: &SolutionSigma, health: &Health) {
//! #         self.heading_rad = solution.euler().heading_rad;
//! #         assert_eq!(health.fixes.outlier, 0);
//! #     }
//! # }
//! # let mut car = Car { count: 0, fix: None, heading_rad: 9.0, kept: None };
//! # for _ in 0..2 {
//! #     car.count = 0;
//! #     navigate(&mut car).unwrap();
//! #     assert!(car.heading_rad.abs() < 0.1 && car.kept.is_some());
//! # }
//! ```
#![no_std]

#[cfg(test)]
extern crate std;

mod aided;
mod alignment;
pub mod attitude;
mod calibration;
mod channel;
pub mod config;
pub mod damping;
#[cfg(test)]
#[path = "../tests/unit/deviates.rs"]
mod deviates;
pub mod earth;
mod error_model;
mod estimate;
mod health;
mod history;
pub mod increments;
mod innovations;
mod least_squares;
#[cfg(feature = "literal")]
pub mod literal;
mod manoeuvre;
mod math;
mod measurement;
pub mod mechanization;
mod navigator;
mod observer;
mod outcome;
mod parameters;
mod ring;
mod samples;
mod solution;
mod time;

pub use alignment::rest;
pub use calibration::{Calibration, Known};
pub use config::{Config, ConfigError};
pub use estimate::{Estimate, Estimates, Observability};
pub use health::{FixCounts, FixReport, Health, SampleCounts};
pub use manoeuvre::Manoeuvre;
/// The version whose vectors and quaternions the interface takes and gives.
pub use nalgebra;
pub use navigator::{Navigator, RING_MOMENTS};
pub use outcome::{GnssOutcome, ImuOutcome};
pub use samples::{BaroHeight, FixSigma, GnssFix, Heading, ImuOutput, ImuSample};
pub use solution::{BodyMotion, Phase, Solution, SolutionSigma};
pub use time::Time;

//! Strapdown inertial navigation damped by GNSS velocity, which finds its own sensor errors.
//!
//! One type owns everything: [`Navigator`]. Samples and fixes go in as they come; the solution and
//! the [`Estimates`] can be asked for at any time. SI units; body axes right-forward-up, navigation
//! frame east-north-up, heading clockwise from north. No allocation, no clock, no panic.
//!
//! ```
//! use ins_core::{Config, ConfigError, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Navigator, Observability};
//!
//! /// What the drivers deliver, in order of time. Axes of a unit mounted forward-right-down:
//! /// right, forward, up = y, x, -z.
//! enum Input {
//!     Imu(ImuSample),
//!     Gnss(GnssFix),
//! }
//!
//! fn navigate(inputs: impl Iterator<Item = Input>) -> Result<Navigator, ConfigError> {
//!     let mut navigator = Navigator::new(Config::mems())?;
//!     for input in inputs {
//!         match input {
//!             Input::Imu(sample) => match navigator.on_imu(&sample) {
//!                 ImuOutcome::Accepted | ImuOutcome::Bridged => {}
//!                 refused => println!("sample: {refused:?}"),
//!             },
//!             Input::Gnss(fix) => match navigator.on_gnss(&fix) {
//!                 GnssOutcome::Accepted | GnssOutcome::Queued => {}
//!                 refused => println!("fix: {refused:?}"),
//!             },
//!         }
//!         if let Some(solution) = navigator.solution() {
//!             println!("heading {} rad", solution.euler().heading_rad);
//!         }
//!         let latency = navigator.estimates().gnss_latency_s;
//!         if latency.observability == Observability::Observable {
//!             println!("latency {} +- {} s", latency.value, latency.sigma);
//!         }
//!     }
//!     Ok(navigator)
//! }
//! # // A car that stands for ten seconds, starts northward, cruises and brakes.
//! # use ins_core::{Phase, Time, earth::Geodetic};
//! # let inputs = (1..=4_000).flat_map(|count| {
//! #     let time = Time::from_micros(10_000 * count);
//! #     let at = |start: i64, end: i64| (count.clamp(start, end) - start) as f64 * 0.02;
//! #     let speed = at(1_000, 1_500) - at(2_500, 3_000);
//! #     let accel = match count { 1_001..=1_500 => 2.0, 2_501..=3_000 => -2.0, _ => 0.0 };
//! #     let sample = ImuSample { time, gyro: [0.0; 3].into(), accel: [0.0, accel, 9.8].into() };
//! #     let fix = GnssFix {
//! #         time,
//! #         velocity_en_mps: Some([0.0, speed].into()),
//! #         ..GnssFix::default()
//! #     }
//! #     .at(&Geodetic::default());
//! #     [Some(Input::Imu(sample)), (count % 10 == 0).then_some(Input::Gnss(fix))]
//! # });
//! # let navigator = navigate(inputs.flatten()).unwrap();
//! # assert_eq!(navigator.phase(), Phase::Navigating);
//! # assert!(navigator.solution().unwrap().euler().heading_rad.abs() < 0.1);
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
pub mod earth;
mod error_model;
mod estimate;
mod estimator;
mod health;
mod history;
pub mod increments;
mod innovations;
mod least_squares;
#[cfg(feature = "literal")]
pub mod literal;
mod manoeuvre;
mod math;
pub mod mechanization;
mod navigator;
mod noise_trial;
mod observer;
mod outcome;
mod parameters;
mod ring;
mod samples;
mod solution;
mod time;
mod vertical_sign;

pub use alignment::rest;
pub use calibration::{Calibration, Known};
pub use config::{Config, ConfigError};
pub use estimate::{Estimate, Estimates, Observability};
pub use health::{FixCounts, FixReport, Health, SampleCounts};
pub use manoeuvre::Manoeuvre;
pub use navigator::{Navigator, RING_MOMENTS};
pub use noise_trial::Assumed;
pub use outcome::{GnssOutcome, ImuOutcome};
pub use samples::{FixSigma, GnssFix, Heading, ImuOutput, ImuSample};
pub use solution::{BodyMotion, Phase, Solution, SolutionSigma};
pub use time::Time;

//! The tests of this folder as one program, linked once: `cargo test -p host-sim --test all import::`
//! runs those of one file.

mod aircraft_dynamics;
mod aircraft_files;
mod aircraft_flight;
mod clock_offsets;
mod command_line;
mod corrupted;
mod error_models;
mod five_stage;
mod flight_log;
mod flights;
mod identify_logs;
mod import;
mod kalman;
mod layers;
mod log_defects;
mod log_round_trip;
mod long_logs;
mod motions;
mod mutations;
mod outages;
mod plan_drive;
mod real_logs;
mod receivers;
mod rehearse;
mod report;
mod reproduce;
mod slurm;
mod statistics;
mod tune;

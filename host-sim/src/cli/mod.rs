//! The command line: a file for each command, or group of commands.

mod aircraft;
mod campaign;
mod compare;
mod hil;
mod identify;
mod import;
mod options;
mod plan_drive;
mod rehearse;
mod reproduce;
mod simulate;
mod study;
mod tune;

use std::fs;
use std::path::PathBuf;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use miette::Result;

use crate::page::output::{self, OutputError};
use crate::rehearse::program;
pub use campaign::summary as campaign_summary;

const NAME: &str = "host-sim";

/// Finds the errors of inertial sensors and GNSS from a recorded or simulated drive.
#[derive(Debug, Parser)]
#[command(version)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Commands for use, then for studies.
#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate a drive, identify it, and compare with the truth.
    Demo(simulate::Demo),
    /// Simulate a car drive and write its log.
    Drive(simulate::Drive),
    /// Fly a plan in a simulated aircraft and write its log.
    Fly(simulate::Fly),
    /// Make a log of a recording of another program: PX4, ArduPilot, ROS, UBX, NMEA, phones.
    Import(import::Import),
    /// Find the sensor errors of logs and their error model; write summaries, tables and reports.
    Identify(identify::Identify),
    /// Find delay, antenna offset, mount, offsets and noise in a log, as parameters of PX4, ArduPilot and others.
    Tune(tune::Tune),
    /// Compare compensation with a Kalman filter on a log, in navigation and through outages.
    Compare(compare::Compare),
    /// Run a log through firmware on a board, and compare with the host bit for bit.
    Hil(hil::Hil),
    /// Find the drive that shows what is wanted, or what to add to one that was driven.
    PlanDrive(plan_drive::PlanDrive),
    /// Rehearse flights: recorded drives of a unit to the accuracy of any algorithm in the air.
    Rehearse(rehearse::Rehearse),
    /// Print the performance and the natural motions of an aircraft.
    Aircraft(aircraft::Aircraft),
    /// Run many and say how good and how honest the results are.
    #[command(subcommand)]
    Study(study::Study),
    /// Identify many units from drives, fly them, and compare with the predicted accuracy.
    Campaign(campaign::Campaign),
    /// Add up the shards of a campaign.
    Merge(campaign::Merge),
    /// Regenerate the thesis's figures and tables from simulation, its numbers beside ours.
    ReproduceThesis(reproduce::Reproduce),
    /// Print completions of the command line for a shell.
    Completions {
        /// bash, zsh, fish and others.
        shell: Shell,
    },
    /// Write the manual pages.
    Man {
        /// Folder for them.
        #[arg(long)]
        out: PathBuf,
    },
}

/// On a stop, removes incomplete results and kills programs under test.
pub fn clean_up_when_stopped() {
    output::clean_up_when_stopped(program::kill_all);
}

impl Cli {
    /// The command line; numbers may be negative.
    pub fn read() -> Self {
        let negative = |c: clap::Command| c.allow_negative_numbers(true);
        let command = Self::command().mut_subcommands(|c| negative(c).mut_subcommands(negative));
        Self::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
    }
}

pub fn run(cli: &Cli) -> Result<()> {
    match &cli.command {
        Command::Demo(options) => simulate::demo(options),
        Command::Drive(options) => simulate::drive(options),
        Command::Fly(options) => simulate::fly(options),
        Command::Import(options) => import::import(options),
        Command::Identify(options) => identify::identify(options),
        Command::Tune(options) => tune::tune(options),
        Command::Compare(options) => compare::compare(options),
        Command::Hil(options) => hil::hil(options),
        Command::PlanDrive(options) => plan_drive::plan_drive(options),
        Command::Rehearse(options) => rehearse::rehearse(options),
        Command::Aircraft(options) => aircraft::aircraft(options),
        Command::Study(study) => study.run(),
        Command::Campaign(options) => campaign::campaign(options),
        Command::Merge(options) => campaign::merge(options),
        Command::ReproduceThesis(options) => reproduce::reproduce(options),
        Command::Completions { shell } => {
            // Into memory, since the generator panics on write errors.
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), NAME, &mut text);
            options::print(&String::from_utf8_lossy(&text))
        }
        Command::Man { out } => {
            fs::create_dir_all(out).map_err(|e| OutputError::io(out, e))?;
            let pages = clap_mangen::generate_to(Cli::command().name(NAME), out);
            Ok(pages.map_err(|e| OutputError::io(out, e))?)
        }
    }
}

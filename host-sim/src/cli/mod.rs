//! The command line: a file for each command.

mod accuracy;
mod aircraft;
mod campaign;
mod compare;
mod conditions;
mod demo;
mod drive;
mod figures;
mod flights;
mod fly;
mod hil;
mod identify;
mod import;
mod logs;
mod options;
mod plan_drive;
mod proof;
mod recordings;
mod recovery;
mod rehearse;
mod reproduce;
mod study;
mod tune;

use std::fs;
use std::io;
use std::path::PathBuf;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use miette::Result;

use crate::page::output::OutputError;
pub use crate::page::output::clean_up_when_stopped;

/// Name of the program.
const NAME: &str = "host-sim";

/// Finds the errors of inertial sensors and GNSS from a recorded or simulated drive.
#[derive(Debug, Parser)]
#[command(version)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print the summary as JSON.
    #[arg(long, global = true)]
    json: bool,
    /// Replace what an earlier run wrote.
    #[arg(long, global = true)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate a car drive and write its log.
    Drive(drive::Drive),
    /// Find the sensor errors of logs and their error model; write summaries, tables and reports.
    Identify(identify::Identify),
    /// Find delay, antenna offset, mount, offsets and noise in a log, as parameters of PX4, ArduPilot and others.
    Tune(tune::Tune),
    /// Make a log of a recording of another program: PX4, ArduPilot, ROS, UBX, NMEA, phones.
    Import(import::Import),
    /// Run a log through firmware on a board, and compare with the host bit for bit.
    Hil(hil::Hil),
    /// Compare compensation with a Kalman filter on a log, in navigation and through outages.
    Compare(compare::Compare),
    /// Identify many simulated units and say how well their error models are found.
    Recovery(recovery::Recovery),
    /// Fly a plan in a simulated aircraft and write its log.
    Fly(fly::Fly),
    /// Print the performance and the natural motions of an aircraft.
    Aircraft(aircraft::Aircraft),
    /// Fly many flights, damped and then free, and report what the estimates are worth.
    Flights(flights::Flights),
    /// Run many simulated drives and say how good the estimates are.
    Accuracy(accuracy::Accuracy),
    /// Identify many units from drives, fly them, and compare with the accuracy foretold.
    Campaign(campaign::Campaign),
    /// Find the drive that shows what is wanted, or what to add to one that was driven.
    PlanDrive(plan_drive::command::PlanDrive),
    /// Rehearse flights: recorded drives of a unit to the accuracy of any algorithm in the air.
    Rehearse(rehearse::Rehearse),
    /// Add up the shards of a campaign.
    Merge(campaign::Merge),
    /// Regenerate the thesis's figures and tables from simulation, its numbers beside ours.
    Reproduce(reproduce::Reproduce),
    /// Measure the figures of the README and of docs/ anew and write them there.
    Figures(figures::Figures),
    /// Run many and say how good and how honest the results are.
    #[command(subcommand)]
    Study(study::Study),
    /// Simulate a drive, identify it, and compare with the truth.
    Demo(demo::Demo),
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

impl Cli {
    /// The command line; numbers may be negative.
    pub fn read() -> Self {
        let command = Self::command().mut_subcommands(|c| c.allow_negative_numbers(true));
        Self::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
    }

    /// Whether it runs programs of the user's.
    pub fn runs_programs(&self) -> bool {
        matches!(self.command, Command::Rehearse(_))
    }
}

/// Runs a command.
pub fn run(cli: &Cli) -> Result<()> {
    match &cli.command {
        Command::Drive(options) => drive::drive(options, cli.json, cli.force),
        Command::Identify(options) => identify::identify(options, cli.json, cli.force),
        Command::Recovery(options) => recovery::recovery(options, cli.json, cli.force),
        Command::Tune(options) => tune::tune(options, cli.json),
        Command::Import(options) => import::import(options, cli.json, cli.force),
        Command::Hil(options) => hil::hil(options, cli.json, cli.force),
        Command::Compare(options) => compare::compare(options, cli.json, cli.force),
        Command::Fly(options) => fly::fly(options, cli.json, cli.force),
        Command::Aircraft(options) => aircraft::aircraft(options, cli.json, cli.force),
        Command::Flights(options) => flights::flights(options, cli.json, cli.force),
        Command::Accuracy(options) => accuracy::accuracy(options, cli.json, cli.force),
        Command::Campaign(options) => campaign::campaign(options, cli.json, cli.force),
        Command::PlanDrive(options) => {
            plan_drive::command::plan_drive(options, cli.json, cli.force)
        }
        Command::Rehearse(options) => rehearse::rehearse(options, cli.json, cli.force),
        Command::Merge(options) => campaign::merge(options, cli.json),
        Command::Reproduce(options) => reproduce::reproduce(options, cli.json, cli.force),
        Command::Figures(options) => figures::write(options),
        Command::Study(study) => study::study(study, cli.json),
        Command::Demo(options) => demo::demo(options, cli.json),
        Command::Completions { shell } => {
            clap_complete::generate(*shell, &mut Cli::command(), NAME, &mut io::stdout());
            Ok(())
        }
        Command::Man { out } => {
            fs::create_dir_all(out).map_err(|e| OutputError::io(out, e))?;
            let pages = clap_mangen::generate_to(Cli::command().name(NAME), out);
            Ok(pages.map_err(|e| OutputError::io(out, e))?)
        }
    }
}

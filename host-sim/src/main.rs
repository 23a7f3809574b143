//! `host-sim`: simulates drives and finds the errors of their sensors.

use clap::Parser;
use host_sim::cli::{Cli, run};

fn main() -> miette::Result<()> {
    let cli = Cli::parse();
    // Into `head` and the like, without a panic; but a program that we write to may end before us.
    if !cli.runs_programs() {
        sigpipe::reset();
    }
    run(&cli)
}

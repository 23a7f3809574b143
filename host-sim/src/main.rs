//! `host-sim`: simulates drives and finds the errors of their sensors.

use clap::Parser;
use host_sim::cli::{Cli, run};

fn main() -> miette::Result<()> {
    // Into `head` and the like, without a panic.
    sigpipe::reset();
    run(&Cli::parse())
}

//! `host-sim`: simulates drives and finds the errors of their sensors.

use std::panic;
use std::process::exit;

use miette::MietteHandlerOpts;

use host_sim::{Cli, clean_up_when_stopped, run};

fn main() -> miette::Result<()> {
    let cli = Cli::read();
    // Into `head` and the like, without a panic; but a program that we write to may end before us.
    if !cli.runs_programs() {
        sigpipe::reset();
    }
    explain_full_output();
    say_errors_plainly();
    clean_up_when_stopped();
    run(&cli)
}

/// Once, for each message has its cause in it, and in lines that are not broken: they are copied from
/// and searched.
fn say_errors_plainly() {
    let plain = MietteHandlerOpts::new()
        .without_cause_chain()
        .wrap_lines(false);
    let hook = miette::set_hook(Box::new(move |_| Box::new(plain.clone().build())));
    hook.expect("the first");
}

/// A full disk behind the standard output is no defect of the program.
fn explain_full_output() {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |info| match info.payload_as_str() {
        Some(text) if text.starts_with("failed printing to stdout") => {
            eprintln!("Error: {text}");
            exit(1);
        }
        _ => usual(info),
    }));
}

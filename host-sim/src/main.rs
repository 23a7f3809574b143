//! `host-sim`: simulates drives and finds the errors of their sensors.

use miette::MietteHandlerOpts;

use host_sim::{Cli, clean_up_when_stopped, run};

fn main() -> miette::Result<()> {
    let cli = Cli::read();
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

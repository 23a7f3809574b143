//! The command `hil`.

use std::path::PathBuf;

use clap::Args;
use miette::{Result, miette};
use serde::Serialize;

use crate::cli::identify::text_of;
use crate::cli::options::{Class, Output, read, refuse_same};
use crate::hil::bench::{Bench, ESTIMATES_EVERY, requests};
use crate::hil::board::Target;
use crate::hil::board_log::{self, BoardLog};
use crate::hil::report::{Hardware, View};
use crate::hil::session::{Event, Rate};
use crate::identify::analysis::{Analysis, Input, SUMMARY};
use crate::identify::summary::Summary;
use crate::page::progress::bar;
use crate::page::{self, output};
use crate::report;

#[derive(Debug, Args)]
pub struct Hil {
    /// Folder of a log, or a recording of a known format.
    log: PathBuf,
    #[command(flatten)]
    target: Target,
    /// When samples are sent.
    #[arg(long, value_enum, default_value_t = Rate::Max)]
    rate: Rate,
    #[command(flatten)]
    class: Class,
    #[command(flatten)]
    output: Output,
}

/// What `hil --json` prints.
#[derive(Serialize)]
struct Printed<'a> {
    summary: &'a Summary,
    hardware: &'a Hardware,
}

/// Runs a log through a board, writes the results of the board, and fails unless every answer equals that of
/// the host.
pub fn hil(options: &Hil) -> Result<()> {
    options.output.check(SUMMARY)?;
    refuse_same(&options.log, &options.output.out)?;
    let image = options.target.image()?;
    let table = image.as_deref().map(board_log::table).transpose()?;
    let mut log = table.as_ref().map(BoardLog::new);
    let input = read(&options.log, options.class.grade, &bar())?;

    let (hardware, analysis) = run(input, options, log.as_mut())?;

    options.output.fill(SUMMARY, |folder| {
        report::write(&analysis, None, folder)?;
        output::write(folder, "hil.json", page::json(&hardware)?)?;
        if let Some(log) = log {
            output::write(folder, "log.txt", log.text)?;
        }
        Ok(())
    })?;
    let printed = Printed {
        summary: &analysis.summary,
        hardware: &hardware,
    };
    options.output.print.result(&printed, || {
        let found = text_of(&analysis, None, &options.output.out);
        format!("{found}\n{hardware}")
    })?;
    hardware.verdict()
}

fn run(
    mut input: Input,
    options: &Hil,
    mut log: Option<&mut BoardLog>,
) -> Result<(Hardware, Analysis)> {
    let config = input.config;
    if !input.log.baro.is_empty() {
        eprintln!("warning: baro.csv is left out: the link carries samples and fixes");
        input.log.baro.clear();
    }
    let mut bench = Bench::new(config).map_err(|error| miette!("{}", error))?;
    let mut session = options.target.open()?;
    // The board counts lost lines of its log since its reset.
    let lost_before = session.status()?.log_lines_lost;
    let started = session.start(config, ESTIMATES_EVERY)?;
    let length = input.log.imu.len() + input.log.gnss.len();
    let first = input.log.start();
    let mut view = View::new(bar(), length, first, input.log.meta.clone());
    let status = session.stream(
        requests(input.log.imu.iter(), &input.log.gnss),
        options.rate,
        |event| match event {
            Event::Answer {
                request,
                reply,
                waiting,
            } => {
                bench.take(&request, reply.as_ref());
                view.show(&bench, waiting);
            }
            Event::Log(piece) => {
                if let Some(log) = &mut log {
                    log.take(&piece, |line| view.bar.suspend(|| eprintln!("{line}")));
                }
            }
        },
    )?;
    let seconds = view.seconds();
    view.bar.finish_and_clear();

    // Only if ticks are clocks of the processor.
    let counts_clocks = session.hello.clocks_per_tick == 1;
    let hardware = Hardware {
        board: options.target.in_words(),
        bit_for_bit: bench.comparison.is_exact(),
        comparison: bench.comparison.clone(),
        seconds,
        times_real_time: input.log.duration_s() / seconds,
        sample_clocks: counts_clocks
            .then(|| bench.sample_ticks.summary())
            .flatten(),
        fix_clocks: counts_clocks.then(|| bench.fix_ticks.summary()).flatten(),
        state_bytes: started.state_bytes,
        stack_bytes: status.stack_bytes,
        requests_lost: status.link.skipped,
        bytes_lost: status.bytes_lost,
        frames_lost: session.counters().skipped,
        log_lines_lost: status.log_lines_lost.saturating_sub(lost_before),
        log_lines_garbled: log.map(|log| log.garbled),
    };
    let found = bench.finish(&input.log, config);
    Ok((hardware, input.with(found)?))
}

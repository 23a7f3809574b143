//! Cost of the navigator on a microcontroller compared with published filters and its goals, counted in the
//! emulator: a table in Markdown.
//!
//! `cargo run --release -p ins-tests --bin footprint`

use std::process::ExitCode;

use host_sim::hil::Board;
use host_sim::log::Grade;
use host_sim::page::table::markdown;
use ins_tests::firmware::FOR_SIZE;
use ins_tests::footprint::{Footprint, goal, ours, peer};

/// A figure, and its goal on the Cortex-M7 if any.
type Row = (&'static str, fn(&Footprint) -> u64, Option<u64>);

const ROWS: [Row; 8] = [
    (
        "instructions per IMU sample, GNSS amortised",
        Footprint::amortised,
        Some(goal::AMORTISED),
    ),
    (
        "instructions of an IMU sample alone",
        |f| f.samples.mean(),
        None,
    ),
    ("instructions of a GNSS fix alone", |f| f.fixes.mean(), None),
    ("worst IMU sample", |f| f.samples.worst, Some(goal::WORST)),
    ("worst GNSS fix", |f| f.fixes.worst, Some(goal::WORST)),
    ("bytes of state", |f| f.state_bytes, Some(goal::STATE_BYTES)),
    (
        "peak stack of one call, bytes",
        |f| f.stack_bytes,
        Some(goal::STACK_BYTES),
    ),
    ("flash, bytes", |f| f.flash_bytes, Some(goal::FLASH_BYTES)),
];

const REMARKS: &str = "\
10 parameters are what the preset of ring lasers estimates, 24 that of MEMS. Built for size is cargo's
opt-level \"s\" in place of 3.
Flash is that of the calls this takes. Ours takes position and velocity, and finds its heading; the
peers take velocity, and are told the heading at the start and the latency.
Instructions are not cycles: those need a board (firmware-example/README.md).";

fn main() -> ExitCode {
    match table() {
        Ok(table) => println!("{table}\n{REMARKS}"),
        Err(error) => {
            eprintln!("footprint: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn table() -> Result<String, Box<dyn std::error::Error>> {
    let footprints = [
        ours(Board::CortexM7, Grade::Hg1700, &[])?,
        ours(Board::CortexM7, Grade::Mems, &[])?,
        ours(Board::CortexM7, Grade::Hg1700, &FOR_SIZE)?,
        ours(Board::CortexM4, Grade::Hg1700, &[])?,
        peer("fusion_nav")?,
        peer("kinavis_ins")?,
    ];
    let header = [
        "IMU at 100 Hz, GNSS at 10 Hz",
        "Cortex-M7, 10 parameters",
        "24 parameters",
        "goal",
        "10, built for size",
        "10 on Cortex-M4F (f64 in software)",
        "fusion-nav on M7",
        "kinavis-ins on M7",
    ];
    let rows = ROWS.map(|(name, value, goal)| {
        let [m7, all, others @ ..] = footprints.each_ref().map(|f| value(f).to_string());
        let goal = goal.map_or(String::new(), |goal| goal.to_string());
        let row = [name.to_owned(), m7, all, goal];
        row.into_iter().chain(others).collect()
    });
    Ok(markdown(&header.map(str::to_owned), &rows))
}

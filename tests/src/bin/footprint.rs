//! What the navigator costs on a microcontroller, counted in the emulator: a table in Markdown.
//!
//! `cargo run --release -p ins-tests --bin footprint`

use host_sim::hil::Board;
use host_sim::hil::emulator::{Pace, replay};
use host_sim::sim::{DriveConfig, Grade, simulate};
use ins_core::{Config, Phase};
use ins_link::{Reply, Request};
use ins_tests::firmware::{flash_bytes, image};
use ins_tests::requests::{decode, encode_all, requests};

type Failure = Box<dyn std::error::Error>;

/// A minute of rest for the gyrocompass and three minutes of driving, of which the last two count.
const REST_S: f64 = 62.0;
const MINUTES: f64 = 4.0;
const COUNTED_FROM_S: f64 = 120.0;

#[derive(Default)]
struct Footprint {
    instructions_per_tick: u64,
    samples: u32,
    fixes: u32,
    sample_instructions: u64,
    fix_instructions: u64,
    worst_sample: u64,
    worst_fix: u64,
    state_bytes: u32,
    stack_bytes: u32,
    flash_bytes: u64,
}

fn main() -> Result<(), Failure> {
    let footprints = [measure(Board::CortexM7)?, measure(Board::CortexM4)?];
    println!("| IMU at 100 Hz, GNSS at 10 Hz | Cortex-M7 | Cortex-M4F (f64 in software) |");
    println!("|---|---|---|");
    let row = |name: &str, value: fn(&Footprint) -> u64| {
        println!(
            "| {name} | {} | {} |",
            value(&footprints[0]),
            value(&footprints[1])
        );
    };
    row("instructions per IMU sample, GNSS amortised", |f| {
        (f.sample_instructions + f.fix_instructions) / u64::from(f.samples)
    });
    row("instructions of an IMU sample alone", |f| {
        f.sample_instructions / u64::from(f.samples)
    });
    row("instructions of a GNSS fix alone", |f| {
        f.fix_instructions / u64::from(f.fixes)
    });
    row("worst IMU sample", |f| f.worst_sample);
    row("worst GNSS fix", |f| f.worst_fix);
    row("bytes of state", |f| f.state_bytes.into());
    row("peak stack of the core, bytes", |f| f.stack_bytes.into());
    row("flash of the core's whole interface, bytes", |f| {
        f.flash_bytes
    });
    println!("\nInstructions are not cycles: those need a board (firmware-example/README.md).");
    Ok(())
}

fn measure(board: Board) -> Result<Footprint, Failure> {
    let drive = DriveConfig {
        initial_rest_s: Some([REST_S, REST_S + 1.0]),
        ..DriveConfig::new(3, Grade::Hg1700, MINUTES)
    };
    let config = Config {
        imu_output: drive.recording.errors.imu.output,
        ..Config::hg1700()
    };
    let mut all = vec![
        Request::Hello { session: 1 },
        Request::Start {
            config,
            estimates_every: 0,
        },
        // Paints the stack anew: what starting took is not asked.
        Request::Status,
    ];
    all.extend(requests(&simulate(&drive)));
    all.push(Request::Status);

    let image_path = image(board, "replay")?;
    let replies = decode(&replay(
        board,
        &image_path,
        Pace::Counting,
        &encode_all(&all),
    )?);
    if replies.len() != all.len() {
        return Err(format!("{} replies to {} requests", replies.len(), all.len()).into());
    }
    let mut footprint = Footprint {
        flash_bytes: flash_bytes(&image(board, "core_only")?)?,
        ..Footprint::default()
    };
    for (request, reply) in all.iter().zip(&replies) {
        footprint.take(request, reply)?;
    }
    Ok(footprint)
}

impl Footprint {
    fn take(&mut self, request: &Request, reply: &Reply) -> Result<(), Failure> {
        match (request, reply) {
            (_, Reply::Hello(hello)) => self.instructions_per_tick = hello.clocks_per_tick.into(),
            (_, Reply::Start(Ok(started))) => self.state_bytes = started.state_bytes,
            (_, Reply::Status(status)) => {
                self.stack_bytes = status.stack_bytes - status.stack_at_call_bytes;
            }
            (Request::Imu(sample), Reply::Imu(Ok(reply))) => {
                if sample.time.as_seconds() < COUNTED_FROM_S {
                    return Ok(());
                }
                if reply.phase != Phase::Navigating {
                    return Err("the navigator is not up when counting begins".into());
                }
                let instructions = u64::from(reply.ticks) * self.instructions_per_tick;
                self.samples += 1;
                self.sample_instructions += instructions;
                self.worst_sample = self.worst_sample.max(instructions);
            }
            (Request::Gnss(fix), Reply::Gnss(Ok(reply))) => {
                if fix.time.as_seconds() < COUNTED_FROM_S {
                    return Ok(());
                }
                let instructions = u64::from(reply.ticks) * self.instructions_per_tick;
                self.fixes += 1;
                self.fix_instructions += instructions;
                self.worst_fix = self.worst_fix.max(instructions);
            }
            _ => return Err(format!("{reply:?} to {request:?}").into()),
        }
        Ok(())
    }
}

//! What the navigator costs on a microcontroller, counted in the emulator: a table in Markdown.
//!
//! `cargo run --release -p ins-tests --bin footprint`

use host_sim::hil::Board;
use host_sim::hil::bench::requests;
use host_sim::hil::emulator::Pace;
use host_sim::hil::session::{Event, Rate};
use host_sim::sim::{DriveConfig, Grade, simulate};
use ins_core::{Config, Phase};
use ins_link::{Reply, Request};
use ins_tests::firmware::{flash_bytes, image, session};

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
    let drive = simulate(&drive);
    let mut session = session(board, Pace::Counting)?;
    let started = session.start(config, 0)?;
    // Paints the stack anew: what starting took is not asked.
    session.status()?;
    let mut footprint = Footprint {
        instructions_per_tick: session.hello.clocks_per_tick.into(),
        state_bytes: started.state_bytes,
        flash_bytes: flash_bytes(&image(board, "core_only")?)?,
        ..Footprint::default()
    };
    let mut failure = Ok(());
    let status = session.stream(
        requests(&drive.imu, &drive.gnss),
        Rate::Max,
        |event| match event {
            Event::Answer { request, reply, .. } if failure.is_ok() => {
                failure = footprint.take(&request, reply.as_ref());
            }
            _ => {}
        },
    )?;
    failure?;
    footprint.stack_bytes = status.stack_bytes - status.stack_at_call_bytes;
    Ok(footprint)
}

impl Footprint {
    fn take(&mut self, request: &Request, reply: Option<&Reply>) -> Result<(), Failure> {
        match (request, reply) {
            (Request::Imu(sample), Some(Reply::Imu(Ok(reply)))) => {
                if sample.time.as_seconds() < COUNTED_FROM_S {
                    return Ok(());
                }
                if reply.report.phase != Phase::Navigating {
                    return Err("the navigator is not up when counting begins".into());
                }
                let instructions = u64::from(reply.ticks) * self.instructions_per_tick;
                self.samples += 1;
                self.sample_instructions += instructions;
                self.worst_sample = self.worst_sample.max(instructions);
            }
            (Request::Gnss(fix), Some(Reply::Gnss(Ok(reply)))) => {
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

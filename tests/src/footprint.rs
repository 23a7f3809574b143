//! Cost of a navigator on a microcontroller, counted in the emulator.

use std::path::Path;

use host_sim::hil::Board;
use host_sim::hil::bench::requests;
use host_sim::hil::board::Pace;
use host_sim::hil::session::{Event, Rate};
use host_sim::log::Grade;
use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use ins_core::config::HeadingSource;
use ins_core::{Config, GnssOutcome, ImuOutcome, Phase, Time};
use ins_link::{Reply, Request};

use crate::firmware::{flash_bytes, image_with, peer_image, session};

type Failure = Box<dyn std::error::Error>;

/// A minute of rest for gyrocompassing and three minutes of driving, of which the last two are counted. Heading is
/// also known with MEMS by then.
const REST_S: f64 = 62.0;
const MINUTES: f64 = 4.0;
const COUNTED_FROM_S: f64 = 120.0;

/// Goals on the Cortex-M7.
pub mod goal {
    /// Instructions per inertial sample with its share of fixes.
    pub const AMORTISED: u64 = 3000;
    /// Instructions of the longest call.
    pub const WORST: u64 = 12_000;
    /// RAM of the navigator.
    pub const STATE_BYTES: u64 = 6 * 1024;
    /// Stack of one call.
    pub const STACK_BYTES: u64 = 2048;
    /// Code and constants.
    pub const FLASH_BYTES: u64 = 48 * 1024;
}

/// Instructions of calls of one kind.
#[derive(Clone, Copy, Debug, Default)]
pub struct Calls {
    count: u64,
    sum: u64,
    rejected: u64,
    /// Instructions of the longest call.
    pub worst: u64,
}

impl Calls {
    fn add(&mut self, instructions: u64, accepted: bool) {
        self.count += 1;
        self.sum += instructions;
        self.rejected += u64::from(!accepted);
        self.worst = self.worst.max(instructions);
    }

    /// Mean instructions of a call.
    pub fn mean(&self) -> u64 {
        self.sum / self.count
    }
}

/// Inertial samples at 100 Hz and GNSS fixes at 10 Hz, on a drive with starts, turns and stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Footprint {
    /// Calls with an inertial sample.
    pub samples: Calls,
    /// Calls with a fix.
    pub fixes: Calls,
    /// RAM of the navigator.
    pub state_bytes: u64,
    /// Deepest stack of a call.
    pub stack_bytes: u64,
    /// Code and constants of a program that only calls it.
    pub flash_bytes: u64,
}

impl Footprint {
    /// Instructions per inertial sample with its share of fixes.
    pub fn amortised(&self) -> u64 {
        (self.samples.sum + self.fixes.sum) / self.samples.count
    }

    /// Instructions of the longest call of any kind.
    pub fn worst(&self) -> u64 {
        self.samples.worst.max(self.fixes.worst)
    }
}

/// Footprint of `ins-core` with the parameters that its preset for a class of sensors estimates: ten for ring lasers,
/// all for MEMS. `arguments` are additional arguments to cargo.
pub fn ours(board: Board, class: Grade, arguments: &[&str]) -> Result<Footprint, Failure> {
    let (drive, config) = drive(class);
    let only = image_with(board, "core_only", arguments)?;
    let counting = [&["--features", "call-stack"], arguments].concat();
    let image = image_with(board, "console", &counting)?;
    let requests = requests(&drive.imu, &drive.gnss);
    measure(board, &image, &only, config, requests)
}

/// Footprint of a program of `tests/peers` on the Cortex-M7. The peers are given what the core estimates: the initial
/// heading, and the latency by corrected time stamps.
pub fn peer(program: &str) -> Result<Footprint, Failure> {
    let (drive, config) = drive(Grade::Hg1700);
    let config = Config {
        heading: HeadingSource::Given(drive.truth[0].euler().heading_rad),
        ..config
    };
    let latency_s = drive.errors.gnss_latency_s;
    let requests = requests(&drive.imu, &drive.gnss).map(|mut request| {
        if let Request::Gnss(fix) = &mut request {
            fix.time = fix.time.plus_seconds(-latency_s);
        }
        request
    });
    let only = peer_image(&format!("{program}_only"))?;
    let image = peer_image(program)?;
    measure(Board::CortexM7, &image, &only, config, requests)
}

fn drive(class: Grade) -> (SimulatedDrive, Config) {
    let drive = DriveConfig {
        initial_rest_s: Some([REST_S, REST_S + 1.0]),
        ..DriveConfig::new(3, class, MINUTES)
    };
    let preset = match class {
        Grade::Hg1700 => Config::hg1700(),
        Grade::Mems => Config::mems(),
    };
    let config = Config {
        imu_output: drive.recording.errors.imu.output,
        ..preset
    };
    (simulate(&drive), config)
}

/// Runs `image`; `only` is the program with the calls alone.
fn measure(
    board: Board,
    image: &Path,
    only: &Path,
    config: Config,
    requests: impl Iterator<Item = Request>,
) -> Result<Footprint, Failure> {
    let mut session = session(board, image, Pace::Counting)?;
    let started = session.start(config, 0)?;
    let instructions_per_tick = session.hello.clocks_per_tick.into();
    let mut footprint = Footprint {
        state_bytes: started.state_bytes.into(),
        flash_bytes: flash_bytes(only)?,
        ..Footprint::default()
    };
    let mut result = Ok(());
    let status = session.stream(requests, Rate::Max, |event| match event {
        Event::Answer { request, reply, .. } if result.is_ok() => {
            result = footprint.take(&request, reply.as_ref(), instructions_per_tick);
        }
        _ => {}
    })?;
    result?;
    // A filter may reject one fix in a hundred as improbable.
    let Footprint { samples, fixes, .. } = &footprint;
    if samples.rejected > 0 || fixes.rejected * 100 > fixes.count {
        return Err(format!("too many rejected: {footprint:?}").into());
    }
    footprint.stack_bytes = status.call_stack_bytes.into();
    Ok(footprint)
}

impl Footprint {
    fn take(
        &mut self,
        request: &Request,
        reply: Option<&Reply>,
        instructions_per_tick: u64,
    ) -> Result<(), Failure> {
        let (calls, time, ticks, accepted, phase) = match (request, reply) {
            (Request::Imu(sample), Some(Reply::Imu(Ok(reply)))) => (
                &mut self.samples,
                sample.time,
                reply.ticks,
                reply.outcome == ImuOutcome::Accepted,
                reply.report.phase,
            ),
            (Request::Gnss(fix), Some(Reply::Gnss(Ok(reply)))) => (
                &mut self.fixes,
                fix.time,
                reply.ticks,
                matches!(reply.outcome, GnssOutcome::Accepted | GnssOutcome::Queued),
                reply.report.phase,
            ),
            _ => return Err(format!("{reply:?} to {request:?}").into()),
        };
        if time < Time::default().plus_seconds(COUNTED_FROM_S) {
            return Ok(());
        }
        if phase != Phase::Navigating {
            return Err("not navigating when counting begins".into());
        }
        calls.add(u64::from(ticks) * instructions_per_tick, accepted);
        Ok(())
    }
}

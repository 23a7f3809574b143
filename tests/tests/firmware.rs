//! The firmware on emulated processors computes what the host computes, bit for bit.

use std::net::TcpStream;
use std::time::Duration;

use host_sim::hil::emulator::Pace;
use host_sim::hil::twin::same_bits;
use host_sim::hil::{Board, Emulator, HilError, Session, Twin};
use host_sim::sim::{DriveConfig, Grade, simulate};
use ins_core::{Config, Phase};
use ins_link::Reply;
use ins_tests::firmware::image;
use ins_tests::requests::requests;

type Failure = Box<dyn std::error::Error>;

/// A board in the emulator with a fresh image.
struct Bench {
    session: Session<TcpStream>,
    _emulator: Emulator,
    _log: tempfile::TempDir,
}

impl Bench {
    fn new(board: Board) -> Result<Self, Failure> {
        let image = image(board, "ins-firmware")?;
        let log = tempfile::tempdir()?;
        let emulator = Emulator::boot(board, &image, Pace::Fast, &log.path().join("defmt.bin"))?;
        let uart = emulator.uart.try_clone()?;
        uart.set_read_timeout(Some(Duration::from_secs(20)))?;
        Ok(Self {
            session: Session::open(uart, 1)?,
            _emulator: emulator,
            _log: log,
        })
    }
}

/// Four minutes of driving: rest, gyrocompassing, navigation with its estimators running.
fn every_bit(board: Board) -> Result<(), Failure> {
    let drive = DriveConfig::new(3, Grade::Hg1700, 4.0);
    let config = Config {
        imu_output: drive.recording.errors.imu.output,
        ..Config::hg1700()
    };
    let requests = requests(&simulate(&drive));
    let mut bench = Bench::new(board)?;
    bench.session.start(config, 1)?;

    let mut twin = Twin::start(config, 1).map_err(|error| error.0)?;
    let expected: Vec<Reply> = requests
        .iter()
        .filter_map(|request| twin.answer(request))
        .collect();
    let mut answered = expected.iter();
    let mut navigating = 0;
    let mut check = |reply: Reply| {
        let expected = answered.next().expect("one answer for a request");
        if !same_bits(&reply, expected) {
            let text = format!("the board says {reply:?}\nthe host says {expected:?}");
            return Err(HilError::Confused(text));
        }
        if let Reply::Imu(Ok(sample)) = reply {
            navigating += u32::from(sample.phase == Phase::Navigating);
        }
        Ok(())
    };
    for request in &requests {
        bench.session.send(request, &mut check)?;
    }
    bench.session.finish(&mut check)?;

    assert_eq!(answered.len(), 0);
    assert!(
        navigating > 6000,
        "only {navigating} samples were navigated: the test shows little"
    );
    let status = bench.session.status()?;
    assert_eq!(status.bytes_lost, 0);
    assert_eq!(status.link.accepted as usize, requests.len() + 3);
    assert_eq!(bench.session.counters().skipped, 0);
    Ok(())
}

#[test]
fn every_bit_on_cortex_m7() -> Result<(), Failure> {
    every_bit(Board::CortexM7)
}

#[test]
fn every_bit_on_cortex_m4() -> Result<(), Failure> {
    every_bit(Board::CortexM4)
}

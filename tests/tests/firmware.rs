//! The firmware on emulated processors computes what the host computes, bit for bit.

use std::io::{Read, Write};
use std::time::Duration;

use host_sim::hil::emulator::Pace;
use host_sim::hil::twin::same_bits;
use host_sim::hil::{Board, Emulator, HilError, Session, Twin};
use host_sim::sim::{DriveConfig, Grade, simulate};
use ins_core::{Config, Phase};
use ins_link::{Decoder, Reply, Request, encode};
use ins_tests::firmware::image;
use ins_tests::requests::requests;

type Failure = Box<dyn std::error::Error>;

/// A board in the emulator with a fresh image.
struct Bench {
    session: Session<Emulator>,
    _log: tempfile::TempDir,
}

impl Bench {
    fn new(board: Board) -> Result<Self, Failure> {
        let image = image(board, "ins-firmware")?;
        let log = tempfile::tempdir()?;
        let emulator = Emulator::boot(board, &image, Pace::Fast, &log.path().join("defmt.bin"))?;
        Ok(Self {
            session: Session::open(emulator, 1)?,
            _log: log,
        })
    }
}

/// A drive: a minute of rest for the gyrocompass, then starts and turns with everything running.
fn every_bit(board: Board) -> Result<(), Failure> {
    let drive = DriveConfig {
        initial_rest_s: Some([62.0, 63.0]),
        ..DriveConfig::new(3, Grade::Hg1700, 2.5)
    };
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

/// Far more requests at once than the board's queue holds, the last one broken off.
#[test]
fn a_flood_is_survived_and_accounted_for() -> Result<(), Failure> {
    const REQUESTS: u32 = 3_000;
    let image = image(Board::CortexM7, "ins-firmware")?;
    let log = tempfile::tempdir()?;
    let log = log.path().join("defmt.bin");
    let mut emulator = Emulator::boot(Board::CortexM7, &image, Pace::Fast, &log)?;
    let frame = |sequence, request: &Request| encode(sequence, request).expect("short");
    emulator.write_all(&frame(0, &Request::Hello { session: 1 }))?;
    let flood: Vec<u8> = (1..=REQUESTS)
        .flat_map(|sequence| frame(sequence, &Request::Status))
        .collect();
    emulator.write_all(&flood)?;
    emulator.write_all(&flood[..5])?;

    let mut decoder = Decoder::new();
    let mut latest = None;
    for sequence in REQUESTS + 1.. {
        // Asked now and then until one of these is answered.
        emulator.write_all(&frame(sequence, &Request::Status))?;
        let mut buffer = [0; 4096];
        let length = emulator.read(&mut buffer)?;
        let replies = buffer[..length]
            .iter()
            .filter_map(|byte| decoder.push::<Reply>(*byte));
        latest = replies.last().or(latest);
        if latest
            .as_ref()
            .is_some_and(|(sequence, _)| *sequence > REQUESTS)
        {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let Some((sequence, Reply::Status(status))) = latest else {
        return Err("no status".into());
    };
    // The broken one took the next with it, whatever else was lost.
    assert!(
        status.link.corrupt >= 1 && status.link.skipped >= 1,
        "{status:?}"
    );
    assert_eq!(
        status.link.accepted + status.link.skipped,
        sequence + 1,
        "{status:?}"
    );
    assert_eq!(
        decoder.counters.accepted, status.link.accepted,
        "the board answers what it takes"
    );
    Ok(())
}

//! The firmware on emulated processors computes what the host computes, bit for bit.

use std::io::{Read, Write};
use std::time::Duration;

use host_sim::hil::emulator::{Pace, replay};
use host_sim::hil::twin::same_bits;
use host_sim::hil::{Board, Emulator, HilError, Session, Twin};
use host_sim::sim::{DriveConfig, Grade, simulate};
use ins_core::{Config, Phase};
use ins_link::{Decoder, Reply, Request, SampleReply, encode};
use ins_tests::firmware::{image, image_with};
use ins_tests::requests::{decode, encode_all, requests};

type Failure = Box<dyn std::error::Error>;

/// A drive: rest, a minute where a gyrocompass wants it, then starts and turns with everything
/// running.
fn drive(grade: Grade, minutes: f64) -> (Config, Vec<Request>) {
    let (config, rest_s) = match grade {
        Grade::Mems => (Config::mems(), 12.0),
        Grade::Hg1700 | Grade::Ideal => (Config::hg1700(), 62.0),
    };
    let drive = DriveConfig {
        initial_rest_s: Some([rest_s, rest_s + 1.0]),
        ..DriveConfig::new(3, grade, minutes)
    };
    let imu_output = drive.recording.errors.imu.output;
    (
        Config {
            imu_output,
            ..config
        },
        requests(&simulate(&drive)),
    )
}

/// The host's answers; the drive must have had enough of everything to show something.
fn expected(config: Config, requests: &[Request]) -> Result<Vec<Reply>, Failure> {
    let mut twin = Twin::start(config, 1).map_err(|error| error.0)?;
    let replies: Vec<Reply> = requests
        .iter()
        .filter_map(|request| twin.answer(request))
        .collect();
    let navigated = |reply: &&Reply| {
        matches!(
            reply,
            Reply::Imu(Ok(SampleReply {
                phase: Phase::Navigating,
                ..
            }))
        )
    };
    let estimated = |reply: &&Reply| {
        matches!(
            reply,
            Reply::Imu(Ok(SampleReply {
                estimates: Some(_),
                ..
            }))
        )
    };
    let navigated = replies.iter().filter(navigated).count();
    let estimated = replies.iter().filter(estimated).count();
    assert!(
        navigated > requests.len() / 4,
        "only {navigated} samples were navigated"
    );
    assert!(
        estimated > 20,
        "the estimates changed only {estimated} times"
    );
    Ok(replies)
}

fn compare(replies: &[Reply], expected: &[Reply]) -> Result<(), HilError> {
    for (index, (reply, expected)) in replies.iter().zip(expected).enumerate() {
        if !same_bits(reply, expected) {
            let text = format!("{index}: the board says {reply:?}\nthe host says {expected:?}");
            return Err(HilError::Confused(text));
        }
    }
    assert_eq!(replies.len(), expected.len(), "one answer for a request");
    Ok(())
}

/// Every solution after every sample, every estimate whenever it changes, every damping signal.
fn every_bit(board: Board, grade: Grade, minutes: f64) -> Result<(), Failure> {
    let (config, samples) = drive(grade, minutes);
    let expected = expected(config, &samples)?;
    let mut all = vec![
        Request::Hello { session: 1 },
        Request::Start {
            config,
            estimates_every: 1,
        },
    ];
    all.extend(samples);
    let image = image(board, "replay")?;
    let replies = decode(&replay(board, &image, Pace::Fast, &encode_all(&all))?);
    compare(&replies[2..], &expected)?;
    Ok(())
}

#[test]
fn every_bit_on_cortex_m7() -> Result<(), Failure> {
    every_bit(Board::CortexM7, Grade::Hg1700, 10.0)
}

#[test]
fn every_bit_on_cortex_m7_with_poor_sensors() -> Result<(), Failure> {
    every_bit(Board::CortexM7, Grade::Mems, 10.0)
}

#[test]
fn every_bit_on_cortex_m4() -> Result<(), Failure> {
    every_bit(Board::CortexM4, Grade::Hg1700, 4.0)
}

/// The same through the real way in and out: interrupt, queue, UART.
#[test]
fn every_bit_over_the_uart() -> Result<(), Failure> {
    let (config, requests) = drive(Grade::Mems, 1.0);
    let expected = expected(config, &requests)?;
    let image = image(Board::CortexM7, "ins-firmware")?;
    let log = tempfile::tempdir()?;
    let log = log.path().join("defmt.bin");
    let emulator = Emulator::boot(Board::CortexM7, &image, Pace::Fast, &log)?;
    let mut session = Session::open(emulator, 1)?;
    session.start(config, 1)?;
    let mut replies = Vec::new();
    let mut keep = |reply| {
        replies.push(reply);
        Ok(())
    };
    for request in &requests {
        session.send(request, &mut keep)?;
    }
    session.finish(&mut keep)?;
    compare(&replies, &expected)?;

    let status = session.status()?;
    assert_eq!(status.bytes_lost, 0);
    assert_eq!(status.link.accepted as usize, requests.len() + 3);
    assert_eq!(session.counters().skipped, 0);
    Ok(())
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

#[test]
fn the_core_cannot_panic() -> Result<(), Failure> {
    for board in [Board::CortexM7, Board::CortexM4] {
        image_with(board, "core_only", "panic-never")?;
    }
    Ok(())
}

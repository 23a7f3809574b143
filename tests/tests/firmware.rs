//! Results of the firmware on emulated processors equal those of the host, bit for bit.

use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

use host_sim::hil::bench::{Bench, ESTIMATES_EVERY, requests};
use host_sim::hil::board::{Pace, Transport};
use host_sim::hil::session::{Event, Rate};
use host_sim::hil::{Board, Emulator};
use host_sim::identify::analysis::Input;
use host_sim::log::{Grade, Log};
use indicatif::ProgressBar;
use ins_core::{Config, Phase};
use ins_link::{Decoder, FromBoard, Reply, Report, Request, encode};
use ins_tests::drives::{drive, flight, recorded_log};
use ins_tests::firmware::{FOR_SIZE, image, image_with, session};

type Failure = Box<dyn std::error::Error>;

/// Compares every solution, estimate and damping signal after every sample and fix; the run must contain enough of
/// each.
fn assert_bits_equal(board: Board, case: &(Config, Log)) -> Result<(), Failure> {
    assert_bits_equal_of(&image(board, "console")?, board, case)
}

fn assert_bits_equal_of(
    image: &Path,
    board: Board,
    (config, log): &(Config, Log),
) -> Result<(), Failure> {
    let mut session = session(board, image, Pace::Fast)?;
    session.start(*config, ESTIMATES_EVERY)?;
    let mut bench = Bench::new(*config)?;
    let (mut navigated, mut estimated) = (0, 0);
    let status = session.stream(requests(log.imu.iter(), &log.gnss), Rate::Max, |event| {
        let Event::Answer { request, reply, .. } = event else {
            return;
        };
        bench.take(&request, reply.as_ref());
        if let Some(report) = reply.as_ref().and_then(report) {
            navigated += usize::from(report.phase == Phase::Navigating);
            estimated += usize::from(report.estimates.is_some());
        }
    })?;
    assert!(bench.comparison.is_exact(), "{:?}", bench.comparison);
    let all = log.imu.len() + log.gnss.len();
    assert_eq!(bench.comparison.answers, all as u64);
    assert_eq!(status.link.skipped, 0, "{status:?}");
    assert!(navigated > all / 4, "{navigated} of {all} navigated");
    assert!(estimated > all / 4, "{estimated} of {all} with estimates");
    Ok(())
}

fn report(reply: &Reply) -> Option<&Report> {
    match reply {
        Reply::Imu(Ok(reply)) => Some(&reply.report),
        Reply::Gnss(Ok(reply)) => Some(&reply.report),
        _ => None,
    }
}

#[test]
fn a_drive_on_cortex_m7() -> Result<(), Failure> {
    assert_bits_equal(Board::CortexM7, &drive(Grade::Hg1700, 10.0))
}

/// Such an image uses more stack, which is not guarded.
#[test]
fn a_drive_of_an_image_built_for_size() -> Result<(), Failure> {
    let board = Board::CortexM7;
    let image = image_with(board, "console", &FOR_SIZE)?;
    assert_bits_equal_of(&image, board, &drive(Grade::Hg1700, 10.0))
}

#[test]
fn a_drive_with_poor_sensors_on_cortex_m7() -> Result<(), Failure> {
    assert_bits_equal(Board::CortexM7, &drive(Grade::Mems, 10.0))
}

#[test]
fn a_drive_on_cortex_m4() -> Result<(), Failure> {
    assert_bits_equal(Board::CortexM4, &drive(Grade::Hg1700, 4.0))
}

#[test]
fn a_flight_on_cortex_m7() -> Result<(), Failure> {
    assert_bits_equal(Board::CortexM7, &flight(10.0)?)
}

#[test]
fn a_flight_on_cortex_m4() -> Result<(), Failure> {
    assert_bits_equal(Board::CortexM4, &flight(4.0)?)
}

#[test]
fn a_recorded_drive_on_both() -> Result<(), Failure> {
    let Some(folder) = recorded_log("rtklibexplorer_drive_0708") else {
        return Ok(());
    };
    let input = Input::read(&folder, None, &ProgressBar::hidden()).map_err(|e| e.to_string())?;
    let input = (input.config, input.log);
    assert_bits_equal(Board::CortexM7, &input)?;
    assert_bits_equal(Board::CortexM4, &input)
}

/// Far more requests at once than the board's queue holds, the last one incomplete.
#[test]
fn queue_overflow_is_counted_and_logged() -> Result<(), Failure> {
    const REQUESTS: u32 = 3_000;
    let image = image(Board::CortexM7, "ins-firmware")?;
    let mut emulator = Emulator::boot(Board::CortexM7, &image, Transport::Uart, Pace::Fast)?;
    let frame = |sequence, request: &Request| encode(sequence, request).expect("short");
    emulator.write_all(&frame(0, &Request::Hello { session: 1 }))?;
    let flood: Vec<u8> = (1..=REQUESTS)
        .flat_map(|sequence| frame(sequence, &Request::Status))
        .collect();
    emulator.write_all(&flood)?;
    emulator.write_all(&flood[..5])?;

    let mut decoder = Decoder::new();
    let (mut replies, mut latest, mut log) = (0, None, 0);
    for sequence in REQUESTS + 1..2 * REQUESTS {
        // Repeated until one of these is answered and the log was received.
        emulator.write_all(&frame(sequence, &Request::Status))?;
        std::thread::sleep(Duration::from_millis(10));
        let mut buffer = vec![0; 65_536];
        let length = emulator.read(&mut buffer).unwrap_or(0);
        for (_, message) in buffer[..length].iter().filter_map(|b| decoder.push(*b)) {
            match message {
                FromBoard::Reply { to, reply } => {
                    replies += 1;
                    latest = Some((to, reply));
                }
                FromBoard::Log(piece) => log += piece.len(),
            }
        }
        if log > 0 && latest.as_ref().is_some_and(|(to, _)| *to > REQUESTS) {
            break;
        }
    }
    let Some((sequence, Reply::Status(status))) = latest else {
        return Err("no status".into());
    };
    // The incomplete frame also corrupts the next one.
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
        replies, status.link.accepted,
        "the board replies to every accepted request"
    );
    assert!(log > 0, "the loss is logged");
    Ok(())
}

//! Command `hil`: with a simulated board on a pseudo-terminal, with the firmware in an emulator there, and with
//! the emulator directly; and boards as algorithm under test of `rehearse`.
#![cfg(unix)]

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread;

use clap::Parser;
use host_sim::hil::session::POLL;
use host_sim::hil::{Board, Session};
use host_sim::log::{self, Compression, Grade};
use host_sim::{Cli, run};
use ins_link::{Decoder, FromBoard, Hello, Reply, Request, Responder, Started, Status, encode};
use ins_tests::cargo::cargo;
use ins_tests::drives::drive;
use ins_tests::firmware::image;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;
use tempfile::TempDir;

type Failure = Box<dyn std::error::Error>;

/// Files written by both `identify` and `hil`. The link does not transmit sigmas of the solution, so the report
/// has fewer curves.
const FILES: [&str; 3] = ["summary.json", "estimates.csv", "solution.csv"];

/// Runs a command; the error is its message.
fn host_sim(arguments: &[&str]) -> Result<(), String> {
    let all = ["host-sim"].iter().chain(arguments);
    let cli = Cli::try_parse_from(all).map_err(|error| error.to_string())?;
    run(&cli).map_err(|error| {
        let help = error.help().map(|help| help.to_string());
        format!("{error}\n{}", help.unwrap_or_default())
    })
}

/// A folder with the log of a drive with a short rest.
fn with_log(minutes: f64) -> Result<(TempDir, String), Failure> {
    let home = tempfile::tempdir()?;
    let folder = home.path().join("log");
    fs::create_dir(&folder)?;
    let (_, log) = drive(Grade::Mems, minutes);
    log::write(&log, &folder, Compression::Gzip)?;
    let name = folder.display().to_string();
    Ok((home, name))
}

fn path(home: &TempDir, name: &str) -> String {
    home.path().join(name).display().to_string()
}

/// Asserts that `hil` and `identify` write the same files.
fn assert_same_files(home: &TempDir, log: &str) -> Result<(), Failure> {
    host_sim(&["identify", log, "--out", &path(home, "identified")])?;
    for name in FILES {
        let read = |folder| fs::read(home.path().join(folder).join(name));
        assert!(read("out")? == read("identified")?, "{name} differs");
    }
    let report = fs::read_to_string(home.path().join("out/report.html"))?;
    assert!(report.contains("Estimates as they converge"));
    Ok(())
}

fn hil_json(home: &TempDir) -> Result<Value, Failure> {
    let text = fs::read_to_string(home.path().join("out/hil.json"))?;
    Ok(serde_json::from_str(&text)?)
}

// --- a simulated board ---

/// A pseudo-terminal: its controlling end, and the name of the other.
fn terminal() -> Result<(File, String), Failure> {
    let pty = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
    grantpt(&pty)?;
    unlockpt(&pty)?;
    let name = ptsname(&pty, Vec::new())?.into_string()?;
    Ok((pty.into(), name))
}

/// Replies like the firmware, at the controlling end of a terminal; `modify` may change or drop the reply to the
/// sample or fix of a number.
fn serve(mut line: File, modify: impl Fn(usize, Reply) -> Option<Reply>) {
    let (mut decoder, mut responder) = (Decoder::new(), None);
    let (mut count, mut sequence) = (0, 0);
    let mut buffer = [0; 4096];
    // An error means that the other end was closed.
    while let Ok(length) = line.read(&mut buffer) {
        let requests: Vec<(u32, Request)> = buffer[..length]
            .iter()
            .filter_map(|byte| decoder.push(*byte))
            .collect();
        for (to, request) in requests {
            let reply = match request {
                Request::Hello { session } => Some(Reply::Hello(Hello {
                    session,
                    window_bytes: 2048,
                    clocks_per_tick: 1,
                })),
                Request::Start {
                    config,
                    estimates_every,
                } => {
                    responder = Responder::start(config, estimates_every).ok();
                    Some(Reply::Start(Ok(Started { state_bytes: 1 })))
                }
                Request::Status => Some(Reply::Status(Status {
                    link: decoder.counters,
                    ..Status::default()
                })),
                Request::Imu(_) | Request::Gnss(_) => {
                    count += 1;
                    let reply = responder
                        .as_mut()
                        .and_then(|responder| responder.answer(&request));
                    reply.and_then(|reply| modify(count, reply))
                }
            };
            let Some(reply) = reply else { continue };
            let frame = encode(sequence, &FromBoard::Reply { to, reply }).expect("short");
            sequence += 1;
            line.write_all(&frame).expect("the far end is open");
        }
    }
}

/// Runs `hil` against a simulated board.
fn on_simulated_board(
    home: &TempDir,
    log: &str,
    modify: impl Fn(usize, Reply) -> Option<Reply> + Send + 'static,
) -> Result<(), Failure> {
    let (pty, port) = terminal()?;
    thread::spawn(move || serve(pty, modify));
    let out = path(home, "out");
    Ok(host_sim(&["hil", log, "--port", &port, "--out", &out])?)
}

#[test]
fn hil_writes_the_same_files_as_identify() -> Result<(), Failure> {
    let (home, log) = with_log(3.0)?;
    on_simulated_board(&home, &log, |_, reply| Some(reply))?;
    assert_same_files(&home, &log)?;
    let report = hil_json(&home)?;
    assert_eq!(report["bit_for_bit"], true);
    // The board reports single clocks, so they are in the report.
    assert_eq!(report["sample_clocks"]["worst"], 0);

    let again = on_simulated_board(&home, &log, |_, reply| Some(reply));
    assert!(again.unwrap_err().to_string().contains("exists already"));
    Ok(())
}

#[test]
fn a_single_wrong_bit_is_detected() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    let modify = |number, mut reply| {
        if let (8_000, Reply::Imu(Ok(sample))) = (number, &mut reply) {
            let solution = sample.report.solution.as_mut().expect("navigating");
            let east = &mut solution.velocity_enu_mps.x;
            *east = f64::from_bits(east.to_bits() ^ 1);
        }
        Some(reply)
    };
    let error = on_simulated_board(&home, &log, modify).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("1 differ, 0 are missing"), "{error}");
    assert!(error.contains("solution"), "{error}");
    let report = hil_json(&home)?;
    assert_eq!(report["bit_for_bit"], false);
    assert_eq!(report["different"], 1);
    Ok(())
}

#[test]
fn lost_replies_are_counted() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    // One alone, and more in a row than can be in transit at once.
    let modify = |number, reply| {
        let lost = number == 3_000 || (6_000..6_020).contains(&number);
        (!lost).then_some(reply)
    };
    let error = on_simulated_board(&home, &log, modify).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("0 differ, 21 are missing"), "{error}");
    assert_eq!(hil_json(&home)?["missing"], 21);
    Ok(())
}

#[test]
fn a_silent_board_is_an_error_without_output() -> Result<(), Failure> {
    let (home, log) = with_log(1.0)?;
    let (_near, port) = terminal()?;
    let out = path(&home, "out");
    let error = host_sim(&["hil", &log, "--port", &port, "--out", &out]).unwrap_err();
    assert!(error.contains("does not answer"), "{error}");
    assert!(!Path::new(&out).exists());
    Ok(())
}

/// Another device at the port, such as a receiver.
struct Chatter;

impl Read for Chatter {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        thread::sleep(POLL);
        buffer.fill(b'$');
        Ok(buffer.len())
    }
}

impl Write for Chatter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_continuous_sender_is_not_a_board() {
    let error = Session::open(Chatter, 1)
        .err()
        .map(|error| error.to_string());
    assert!(error.is_some_and(|error| error.contains("does not answer")));
}

#[test]
fn a_missing_port_is_reported() -> Result<(), Failure> {
    let (home, log) = with_log(1.0)?;
    let out = path(&home, "out");
    let error = host_sim(&["hil", &log, "--port", "/dev/ttyNONE", "--out", &out]).unwrap_err();
    assert!(error.contains("/dev/ttyNONE"), "{error}");
    Ok(())
}

// --- as algorithm under test of a rehearsal ---

const PLAN: &str = include_str!("../../host-sim/tests/turns.toml");

/// Runs the core on the host and on a board; outcomes of both for each flight.
fn rehearsal_outcomes(home: &TempDir, log: &str, board: &str) -> Result<Vec<[Value; 2]>, Failure> {
    let (plan, out) = (path(home, "plan.toml"), path(home, "rehearsed"));
    fs::write(&plan, PLAN.replace("duration_s = 150", "duration_s = 90"))?;
    let arguments = ["rehearse", log, "--plan", &plan, "--out", &out];
    let short = ["--flights", "3", "--minutes-free", "0.5"];
    let plain = ["--models", "0", "--budget", "0"];
    let with = ["--with", "core", "--with", board];
    host_sim(&[&arguments[..], &short, &plain, &with].concat())?;
    let lines = fs::read_to_string(Path::new(&out).join("runs.jsonl"))?;
    let outcomes = |line| -> Result<[Value; 2], Failure> {
        let line: Value = serde_json::from_str(line)?;
        Ok([0, 1].map(|subject| line["outcomes"][subject].clone()))
    };
    lines.lines().map(outcomes).collect()
}

/// Number of flights with identical results on board and host; failures of the others.
fn count_identical(flights: &[[Value; 2]]) -> (usize, Vec<String>) {
    let mut failures = Vec::new();
    for [core, board] in flights {
        if board["failure"].is_null() {
            let errors = core["errors"].as_array().expect("a list");
            assert!(errors.iter().any(|moment| !moment.is_null()));
            assert_eq!(core["errors"], board["errors"]);
        } else {
            failures.push(board["failure"].to_string());
        }
    }
    (flights.len() - failures.len(), failures)
}

#[test]
fn flights_share_a_port_and_lost_replies_are_reported() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    let (pty, port) = terminal()?;
    // Keeps the terminal open between flights.
    let _far = OpenOptions::new().read(true).write(true).open(&port)?;
    // With about 10 000 replies per flight, one of the second is lost.
    thread::spawn(move || serve(pty, |number, reply| (number != 13_000).then_some(reply)));
    let flights = rehearsal_outcomes(&home, &log, &format!("hil --port {port}"))?;
    let (good, failures) = count_identical(&flights);
    assert_eq!((good, failures.len()), (2, 1), "{failures:?}");
    assert!(failures[0].contains("did not get through"), "{failures:?}");
    Ok(())
}

#[test]
fn a_missing_board_is_reported_as_a_row() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    let flights = rehearsal_outcomes(&home, &log, "hil --port /dev/ttyNONE")?;
    let (good, failures) = count_identical(&flights);
    assert_eq!((good, failures.len()), (0, 3));
    assert!(failures[0].contains("unusable") && failures[0].contains("/dev/ttyNONE"));
    let error = rehearsal_outcomes(&home, &log, "hil --qmu")
        .unwrap_err()
        .to_string();
    assert!(error.contains("--qmu"), "{error}");
    Ok(())
}

// --- the firmware in an emulator ---

/// Runs `hil` with an image and further arguments, and checks its files.
fn on_firmware(minutes: f64, image: &Path, arguments: &[&str]) -> Result<(), Failure> {
    let (home, log) = with_log(minutes)?;
    let (out, image) = (path(&home, "out"), image.display().to_string());
    let always = ["hil", &log, "--image", &image, "--out", &out];
    host_sim(&[&always, arguments].concat())?;
    assert_same_files(&home, &log)?;
    let report = hil_json(&home)?;
    assert_eq!(report["bit_for_bit"], true);
    assert_eq!(report["log_lines_garbled"], 0);
    let board_log = fs::read_to_string(home.path().join("out/log.txt"))?;
    for line in [
        "info  navigator of",
        "info  levelled",
        "info  aligned",
        "info  observable: GNSS latency",
        "debug manoeuvre: Accelerating",
    ] {
        assert!(board_log.contains(line), "no '{line}' in\n{board_log}");
    }
    Ok(())
}

#[test]
fn hil_on_the_emulated_board() -> Result<(), Failure> {
    let image = image(Board::CortexM7, "console")?;
    on_firmware(3.0, &image, &["--qemu"])
}

#[test]
fn results_on_the_emulated_board_are_those_of_the_core() -> Result<(), Failure> {
    let image = image(Board::CortexM7, "console")?;
    let (home, log) = with_log(2.0)?;
    let board = format!("hil --qemu --image '{}'", image.display());
    assert_eq!(
        count_identical(&rehearsal_outcomes(&home, &log, &board)?),
        (3, Vec::new())
    );
    Ok(())
}

#[test]
fn a_missing_image_is_reported_with_the_build_command() -> Result<(), Failure> {
    let (home, log) = with_log(1.0)?;
    let out = path(&home, "out");
    let m4f = ["hil", &log, "--qemu", "--board", "m4f", "--out", &out];
    let error = host_sim(&m4f).unwrap_err();
    assert!(
        error.contains("cargo build --release --config cortex-m4.toml"),
        "{error}"
    );
    Ok(())
}

/// Killed when dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The firmware as `cargo run` starts it: interrupt, queue and UART, on a terminal.
#[test]
fn hil_over_the_uart() -> Result<(), Failure> {
    let config = Board::CortexM7.cargo_config();
    let image = image(Board::CortexM7, "ins-firmware")?;
    let mut command = cargo("firmware-example", config);
    command.args(["run", "--release", "--locked", "--config", config]);
    // Cargo is replaced by the emulator.
    let mut emulator = Running(command.stdout(Stdio::piped()).spawn()?);
    let stdout = emulator.0.stdout.take().ok_or("no output")?;
    let mut line = String::new();
    BufReader::new(stdout).read_line(&mut line)?;
    // "char device redirected to /dev/pts/3 (label serial0)"
    let port = line
        .split_whitespace()
        .find(|word| word.starts_with("/dev/"))
        .ok_or_else(|| format!("no terminal in '{line}'"))?;
    on_firmware(1.0, &image, &["--port", port])
}

//! `host-sim hil` from the command line to its files: on a pseudo-terminal with a simulated board
//! at its other end, with the firmware in an emulator there, and on the emulator directly; and boards
//! as the algorithm under test of `rehearse`.
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

/// What `identify` writes, and `hil` too. The link carries no spreads of the solution, so the report
/// has fewer curves.
const FILES: [&str; 3] = ["summary.json", "estimates.csv", "solution.csv"];

/// Runs the program; the error is what it says.
fn host_sim(arguments: &[&str]) -> Result<(), String> {
    let all = ["host-sim"].iter().chain(arguments);
    let cli = Cli::try_parse_from(all).map_err(|error| error.to_string())?;
    run(&cli).map_err(|error| {
        let help = error.help().map(|help| help.to_string());
        format!("{error}\n{}", help.unwrap_or_default())
    })
}

/// A folder with the log of a drive that starts soon.
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

/// What `hil` wrote is what `identify` writes.
fn same_files(home: &TempDir, log: &str) -> Result<(), Failure> {
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

/// A pseudo-terminal: its near end, and the name of its far one.
fn terminal() -> Result<(File, String), Failure> {
    let near = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
    grantpt(&near)?;
    unlockpt(&near)?;
    let name = ptsname(&near, Vec::new())?.into_string()?;
    Ok((near.into(), name))
}

/// Answers as the firmware does, at the near end of a terminal; `spoil` may change the answer to
/// the sample or fix of a number, or drop it.
fn serve(mut line: File, spoil: impl Fn(usize, Reply) -> Option<Reply>) {
    let (mut decoder, mut responder) = (Decoder::new(), None);
    let (mut answered, mut sequence) = (0, 0);
    let mut buffer = [0; 4096];
    // An error is the far end closing.
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
                    answered += 1;
                    let reply = responder
                        .as_mut()
                        .and_then(|responder| responder.answer(&request));
                    reply.and_then(|reply| spoil(answered, reply))
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
    spoil: impl Fn(usize, Reply) -> Option<Reply> + Send + 'static,
) -> Result<(), Failure> {
    let (near, port) = terminal()?;
    thread::spawn(move || serve(near, spoil));
    let out = path(home, "out");
    Ok(host_sim(&["hil", log, "--port", &port, "--out", &out])?)
}

#[test]
fn the_same_files_as_identify() -> Result<(), Failure> {
    let (home, log) = with_log(3.0)?;
    on_simulated_board(&home, &log, |_, reply| Some(reply))?;
    same_files(&home, &log)?;
    let report = hil_json(&home)?;
    assert_eq!(report["bit_for_bit"], true);
    // Its clock counts single clocks, so they are told.
    assert_eq!(report["sample_clocks"]["worst"], 0);

    let again = on_simulated_board(&home, &log, |_, reply| Some(reply));
    assert!(again.unwrap_err().to_string().contains("exists already"));
    Ok(())
}

#[test]
fn one_wrong_bit_is_seen() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    let spoil = |number, mut reply| {
        if let (8_000, Reply::Imu(Ok(sample))) = (number, &mut reply) {
            let solution = sample.report.solution.as_mut().expect("navigating");
            let east = &mut solution.velocity_enu_mps.x;
            *east = f64::from_bits(east.to_bits() ^ 1);
        }
        Some(reply)
    };
    let refusal = on_simulated_board(&home, &log, spoil).unwrap_err();
    let refusal = refusal.to_string();
    assert!(refusal.contains("1 differ, 0 are missing"), "{refusal}");
    assert!(refusal.contains("solution"), "{refusal}");
    let report = hil_json(&home)?;
    assert_eq!(report["bit_for_bit"], false);
    assert_eq!(report["different"], 1);
    Ok(())
}

#[test]
fn lost_answers_are_counted() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    // One alone, and more in a row than can be on their way at once.
    let spoil = |number, reply| {
        let lost = number == 3_000 || (6_000..6_020).contains(&number);
        (!lost).then_some(reply)
    };
    let refusal = on_simulated_board(&home, &log, spoil).unwrap_err();
    let refusal = refusal.to_string();
    assert!(refusal.contains("0 differ, 21 are missing"), "{refusal}");
    assert_eq!(hil_json(&home)?["missing"], 21);
    Ok(())
}

#[test]
fn silence_is_an_error_and_leaves_nothing() -> Result<(), Failure> {
    let (home, log) = with_log(1.0)?;
    let (_near, port) = terminal()?;
    let out = path(&home, "out");
    let refusal = host_sim(&["hil", &log, "--port", &port, "--out", &out]).unwrap_err();
    assert!(refusal.contains("does not answer"), "{refusal}");
    assert!(!Path::new(&out).exists());
    Ok(())
}

/// A receiver, say, at the port that was named.
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
fn who_never_stops_talking_is_no_board() {
    let refusal = Session::open(Chatter, 1).err().map(|why| why.to_string());
    assert!(refusal.is_some_and(|why| why.contains("does not answer")));
}

#[test]
fn a_port_that_is_not_there_is_named() -> Result<(), Failure> {
    let (home, log) = with_log(1.0)?;
    let out = path(&home, "out");
    let refusal = host_sim(&["hil", &log, "--port", "/dev/ttyNONE", "--out", &out]).unwrap_err();
    assert!(refusal.contains("/dev/ttyNONE"), "{refusal}");
    Ok(())
}

// --- as the algorithm under test of a rehearsal ---

const PLAN: &str = include_str!("../../host-sim/tests/turns.toml");

/// Flies the core here and on a board: of each flight, what came of both.
fn rehearsed(home: &TempDir, log: &str, board: &str) -> Result<Vec<[Value; 2]>, Failure> {
    let (plan, out) = (path(home, "plan.toml"), path(home, "rehearsed"));
    fs::write(&plan, PLAN.replace("duration_s = 150", "duration_s = 90"))?;
    let place = ["rehearse", log, "--plan", &plan, "--out", &out];
    let short = ["--flights", "3", "--minutes-free", "0.5"];
    let plain = ["--models", "0", "--budget", "0"];
    let with = ["--with", "core", "--with", board];
    host_sim(&[&place[..], &short, &plain, &with].concat())?;
    let lines = fs::read_to_string(Path::new(&out).join("runs.jsonl"))?;
    let outcomes = |line| -> Result<[Value; 2], Failure> {
        let line: Value = serde_json::from_str(line)?;
        Ok([0, 1].map(|subject| line["outcomes"][subject].clone()))
    };
    lines.lines().map(outcomes).collect()
}

/// How many flights the board flew as the core did here; what became of the others.
fn alike(flights: &[[Value; 2]]) -> (usize, Vec<String>) {
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
fn flights_take_turns_at_a_port_and_what_is_lost_there_is_told() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    let (near, port) = terminal()?;
    // Between two flights nobody else holds it.
    let _far = OpenOptions::new().read(true).write(true).open(&port)?;
    // Of about 10 000 answers a flight, one of the second is lost.
    thread::spawn(move || serve(near, |number, reply| (number != 13_000).then_some(reply)));
    let flights = rehearsed(&home, &log, &format!("hil --port {port}"))?;
    let (good, failures) = alike(&flights);
    assert_eq!((good, failures.len()), (2, 1), "{failures:?}");
    assert!(failures[0].contains("did not get through"), "{failures:?}");
    Ok(())
}

#[test]
fn a_board_that_is_not_there_is_a_row() -> Result<(), Failure> {
    let (home, log) = with_log(2.0)?;
    let flights = rehearsed(&home, &log, "hil --port /dev/ttyNONE")?;
    let (good, failures) = alike(&flights);
    assert_eq!((good, failures.len()), (0, 3));
    assert!(failures[0].contains("unusable") && failures[0].contains("/dev/ttyNONE"));
    let refusal = rehearsed(&home, &log, "hil --qmu").unwrap_err().to_string();
    assert!(refusal.contains("--qmu"), "{refusal}");
    Ok(())
}

// --- the firmware in an emulator ---

/// Runs `hil` with the image of `program` and further arguments, and looks at all it writes.
fn on_firmware(minutes: f64, image: &Path, arguments: &[&str]) -> Result<(), Failure> {
    let (home, log) = with_log(minutes)?;
    let (out, image) = (path(&home, "out"), image.display().to_string());
    let always = ["hil", &log, "--image", &image, "--out", &out];
    host_sim(&[&always, arguments].concat())?;
    same_files(&home, &log)?;
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
fn on_the_emulated_board() -> Result<(), Failure> {
    let image = image(Board::CortexM7, "console")?;
    on_firmware(3.0, &image, &["--qemu"])
}

#[test]
fn the_emulated_board_flies_as_the_core_does() -> Result<(), Failure> {
    let image = image(Board::CortexM7, "console")?;
    let (home, log) = with_log(2.0)?;
    let board = format!("hil --qemu --image '{}'", image.display());
    assert_eq!(alike(&rehearsed(&home, &log, &board)?), (3, Vec::new()));
    Ok(())
}

#[test]
fn without_an_image_it_says_how_to_make_one() -> Result<(), Failure> {
    let (home, log) = with_log(1.0)?;
    let out = path(&home, "out");
    let m4f = ["hil", &log, "--qemu", "--board", "m4f", "--out", &out];
    let refusal = host_sim(&m4f).unwrap_err();
    assert!(
        refusal.contains("cargo build --release --config cortex-m4.toml"),
        "{refusal}"
    );
    Ok(())
}

/// Ends with this value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Nothing can be done about a process that is gone already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The firmware as `cargo run` starts it: interrupt, queue and UART, on a terminal.
#[test]
fn over_the_uart() -> Result<(), Failure> {
    let config = Board::CortexM7.cargo_config();
    let image = image(Board::CortexM7, "ins-firmware")?;
    let mut command = cargo("firmware-example", config);
    command.args(["run", "--release", "--locked", "--config", config]);
    // Cargo becomes the emulator.
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

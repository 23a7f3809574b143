//! A board emulated by QEMU.

use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;

use clap::ValueEnum;

use super::session::POLL;

/// The boards that the firmware is built for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// Cortex-M7 with f64 in hardware: MPS2 with image AN500.
    #[value(name = "m7")]
    CortexM7,
    /// Cortex-M4F, f64 in software: MPS2 with image AN386.
    #[value(name = "m4f")]
    CortexM4,
}

impl Board {
    /// QEMU's name.
    pub fn machine(self) -> &'static str {
        match self {
            Self::CortexM7 => "mps2-an500",
            Self::CortexM4 => "mps2-an386",
        }
    }

    /// Short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::CortexM7 => "m7",
            Self::CortexM4 => "m4f",
        }
    }

    /// The cargo configuration of the firmware that builds for it.
    pub fn cargo_config(self) -> &'static str {
        match self {
            Self::CortexM7 => "cortex-m7.toml",
            Self::CortexM4 => "cortex-m4.toml",
        }
    }
}

/// How the emulated time runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As fast as it goes; ticks in replies mean nothing.
    Fast,
    /// Ticks count instructions, the same at every run; several times slower.
    Counting,
}

/// The way into the board and out of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Its UART, for the program `ins-firmware`. QEMU emulates that byte by byte: some 200 samples
    /// a second.
    Uart,
    /// The debugger's console, for the program `console`: many times faster.
    Console,
}

/// A running QEMU; it ends with this value.
#[derive(Debug)]
pub struct Emulator {
    process: Child,
    to_board: ChildStdin,
    from_board: Receiver<Vec<u8>>,
    received: Vec<u8>,
}

impl Emulator {
    /// Boots `image`.
    pub fn boot(board: Board, image: &Path, way: Way, pace: Pace) -> io::Result<Self> {
        let mut process = qemu(board, image, way, pace).spawn().map_err(explain)?;
        let (Some(to_board), Some(stdout)) = (process.stdin.take(), process.stdout.take()) else {
            unreachable!("both are piped")
        };
        let (sender, from_board) = sync_channel(1024);
        thread::spawn(move || forward(stdout, &sender));
        Ok(Self {
            process,
            to_board,
            from_board,
            received: Vec::new(),
        })
    }
}

fn qemu(board: Board, image: &Path, way: Way, pace: Pace) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", board.machine()])
        .args(["-display", "none", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    let uart = match way {
        Way::Uart => "stdio",
        Way::Console => "none",
    };
    command.args(["-serial", uart]);
    if pace == Pace::Counting {
        // An instruction takes 2^3 ns of the emulated time.
        command.args(["-icount", "shift=3"]);
    }
    command
}

fn explain(error: io::Error) -> io::Error {
    match error.kind() {
        io::ErrorKind::NotFound => io::Error::new(
            io::ErrorKind::NotFound,
            "qemu-system-arm is missing: run .ci/install or install QEMU 7.2 or later",
        ),
        _ => error,
    }
}

/// A pipe has no timeout, a channel has.
fn forward(mut stdout: ChildStdout, sender: &SyncSender<Vec<u8>>) {
    let mut buffer = vec![0; 65_536];
    while let Ok(length @ 1..) = stdout.read(&mut buffer) {
        if sender.send(buffer[..length].to_vec()).is_err() {
            return;
        }
    }
}

/// Times out as a serial port does.
impl Read for Emulator {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.received.is_empty() {
            match self.from_board.recv_timeout(POLL) {
                Ok(bytes) => self.received = bytes,
                Err(RecvTimeoutError::Timeout) => return Err(io::ErrorKind::TimedOut.into()),
                // QEMU has ended.
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let length = buffer.len().min(self.received.len());
        buffer[..length].copy_from_slice(&self.received[..length]);
        self.received.drain(..length);
        Ok(length)
    }
}

impl Write for Emulator {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.to_board.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to_board.flush()
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // Nothing can be done about a process that is gone already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

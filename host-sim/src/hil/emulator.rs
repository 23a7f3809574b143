//! A board emulated by QEMU, its UART on a loopback socket.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The boards that the firmware is built for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    /// Cortex-M7 with f64 in hardware: MPS2 with image AN500.
    CortexM7,
    /// Cortex-M4F, f64 in software: MPS2 with image AN386.
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

/// Longest that an answer may take, on a busy computer.
const SILENCE: Duration = Duration::from_secs(20);

/// A running QEMU; it ends with this value.
#[derive(Debug)]
pub struct Emulator {
    process: Child,
    uart: TcpStream,
}

/// QEMU with `image` on a board. What the firmware logs by defmt goes, encoded, to the file `log`.
fn qemu(board: Board, image: &Path, pace: Pace, log: &Path) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args([
            "-machine",
            board.machine(),
            "-display",
            "none",
            "-monitor",
            "none",
        ])
        .arg("-chardev")
        // A comma in a file name is written twice.
        .arg(format!(
            "file,id=log,path={}",
            log.display().to_string().replace(',', ",,")
        ))
        .args(["-semihosting-config", "enable=on,target=native,chardev=log"])
        .arg("-kernel")
        .arg(image)
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    if pace == Pace::Counting {
        // An instruction takes 2^3 ns of the emulated time.
        command.args(["-icount", "shift=3"]);
    }
    command
}

fn spawn(command: &mut Command) -> io::Result<Child> {
    command.spawn().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => io::Error::new(
            io::ErrorKind::NotFound,
            "qemu-system-arm is missing: run .ci/install or install QEMU 7.2 or later",
        ),
        _ => error,
    })
}

/// Runs the firmware's program `replay` (in `image`) over the frames of requests and returns those
/// of replies: the whole firmware but its UART, much faster.
pub fn replay(board: Board, image: &Path, pace: Pace, requests: &[u8]) -> io::Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("requests.bin"), requests)?;
    let mut command = qemu(board, image, pace, &folder.path().join("defmt.bin"));
    let status = spawn(command.current_dir(folder.path()).args(["-serial", "none"]))?.wait()?;
    if !status.success() {
        return Err(io::Error::other(format!("the firmware gave up: {status}")));
    }
    std::fs::read(folder.path().join("replies.bin"))
}

impl Emulator {
    /// Boots `image`. What the firmware logs by defmt goes, encoded, to the file `log`.
    pub fn boot(board: Board, image: &Path, pace: Pace, log: &Path) -> io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let port = listener.local_addr()?.port();
        let mut command = qemu(board, image, pace, log);
        let mut process = spawn(command.arg("-serial").arg(format!("tcp:127.0.0.1:{port}")))?;
        match accept(&listener, &mut process) {
            Ok(uart) => Ok(Self { process, uart }),
            Err(error) => {
                let _ = process.kill();
                let _ = process.wait();
                Err(error)
            }
        }
    }
}

/// Waits for QEMU's call, but not if it has died.
fn accept(listener: &TcpListener, process: &mut Child) -> io::Result<TcpStream> {
    listener.set_nonblocking(true)?;
    let deadline = Instant::now() + SILENCE;
    loop {
        match listener.accept() {
            Ok((uart, _)) => {
                uart.set_nonblocking(false)?;
                uart.set_nodelay(true)?;
                uart.set_read_timeout(Some(SILENCE))?;
                return Ok(uart);
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        if let Some(status) = process.try_wait()? {
            return Err(io::Error::other(format!(
                "qemu-system-arm ended at once: {status}"
            )));
        }
        if Instant::now() > deadline {
            return Err(io::Error::new(
                io::ErrorKind::TimedOut,
                "qemu-system-arm opens no UART",
            ));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The board's UART.
impl Read for Emulator {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // QEMU hands over byte by byte; some are let gather, or every byte costs two switches
        // between processes.
        std::thread::sleep(Duration::from_micros(300));
        self.uart.read(buffer)
    }
}

impl Write for Emulator {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.uart.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.uart.flush()
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // Nothing can be done about a process that is gone already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

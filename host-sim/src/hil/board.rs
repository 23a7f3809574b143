//! Boards, real and emulated, and their connections.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread;
use std::time::{SystemTime, UNIX_EPOCH};

use clap::{ArgGroup, Args, Parser, ValueEnum};
use serial2::SerialPort;

use super::session::{HilError, POLL, Session};

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
    /// Name on the command line, of the machine in QEMU, and of the cargo configuration of the firmware.
    fn names(self) -> [&'static str; 3] {
        match self {
            Self::CortexM7 => ["m7", "mps2-an500", "cortex-m7.toml"],
            Self::CortexM4 => ["m4f", "mps2-an386", "cortex-m4.toml"],
        }
    }

    pub fn name(self) -> &'static str {
        self.names()[0]
    }

    pub fn machine(self) -> &'static str {
        self.names()[1]
    }

    pub fn cargo_config(self) -> &'static str {
        self.names()[2]
    }
}

/// A byte stream to a board and back.
pub trait Port: Read + Write {}

impl<T: Read + Write> Port for T {}

/// A board at a port, or an emulated one.
#[derive(Args, Clone, Debug, PartialEq, Eq)]
#[command(group(ArgGroup::new("where").required(true).args(["port", "qemu"])))]
pub struct Target {
    /// Serial port of the board, say /dev/ttyACM0 or COM3.
    #[arg(long)]
    pub port: Option<String>,
    /// Bits per second of the port.
    #[arg(long, default_value_t = 921_600)]
    pub baud: u32,
    /// An emulated board instead.
    #[arg(long)]
    pub qemu: bool,
    /// The emulated board.
    #[arg(long, value_enum, default_value_t = Board::CortexM7)]
    pub board: Board,
    /// ELF file that the board runs; needed with --port only to read the board's log.
    #[arg(long)]
    pub image: Option<PathBuf>,
}

impl Target {
    /// From the options of the command `hil`.
    pub fn of(options: &[String]) -> Result<Self, String> {
        #[derive(Parser)]
        #[command(no_binary_name = true, disable_help_flag = true)]
        struct Options {
            #[command(flatten)]
            target: Target,
        }
        let options = Options::try_parse_from(options).map_err(|error| error.to_string())?;
        Ok(options.target)
    }

    /// The image to emulate or, if given, to decode the log of a board with.
    pub fn image(&self) -> Result<Option<PathBuf>, HilError> {
        match &self.port {
            Some(_) => Ok(self.image.clone()),
            None => self.emulated().map(Some),
        }
    }

    fn emulated(&self) -> Result<PathBuf, HilError> {
        let name = self.board.name();
        let folder = Path::new("firmware-example/target").join(name);
        let built = folder.join("thumbv7em-none-eabihf/release/console");
        let image = self.image.clone().unwrap_or(built);
        if image.is_file() {
            return Ok(image);
        }
        Err(HilError::NoImage {
            image,
            name,
            config: self.board.cargo_config(),
        })
    }

    /// Opens a session with it; boots an emulated board.
    pub fn open(&self) -> Result<Session<Box<dyn Port>>, HilError> {
        let port: Box<dyn Port> = if let Some(name) = &self.port {
            Box::new(serial(name, self.baud)?)
        } else {
            let (image, transport) = (self.emulated()?, Transport::Console);
            Box::new(Emulator::boot(self.board, &image, transport, Pace::Fast)?)
        };
        Session::open(port, session_number())
    }

    pub fn in_words(&self) -> String {
        match &self.port {
            Some(port) => format!("{port}, {} baud", self.baud),
            None => format!("{} in QEMU", self.board.machine()),
        }
    }
}

/// A number that differs from that of the last session.
fn session_number() -> u32 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.subsec_nanos())
}

/// Opens a port: 8 bits, no parity, one stop bit, no flow control.
fn serial(name: &str, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(name, baud).map_err(|error| refused(name, &error))?;
    port.set_read_timeout(POLL)?;
    // Discards what a board has sent before.
    port.discard_buffers()?;
    Ok(port)
}

fn refused(name: &str, error: &io::Error) -> io::Error {
    let ports = SerialPort::available_ports().unwrap_or_default();
    let ports: Vec<String> = ports
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let ports = match ports.as_slice() {
        [] => "there is no serial port here".to_owned(),
        ports => format!("ports here: {}", ports.join(", ")),
    };
    io::Error::new(error.kind(), format!("{name}: {error}; {ports}"))
}

// --- emulated by QEMU ---

/// Mode of the emulated time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As fast as possible; ticks in replies are meaningless.
    Fast,
    /// Ticks count instructions, reproducibly; several times slower.
    Counting,
}

/// Transport of bytes to and from the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Its UART, for the program `ins-firmware`. QEMU emulates it byte by byte: about 200 samples a second.
    Uart,
    /// The semihosting console, for the program `console`: many times faster.
    Console,
}

/// A running QEMU, which is killed on drop.
#[derive(Debug)]
pub struct Emulator {
    process: Child,
    to_board: Sender<Vec<u8>>,
    from_board: Receiver<Vec<u8>>,
    received: Vec<u8>,
}

impl Emulator {
    /// Boots `image`.
    pub fn boot(board: Board, image: &Path, transport: Transport, pace: Pace) -> io::Result<Self> {
        Self::of(&mut qemu(board, image, transport, pace))
    }

    fn of(command: &mut Command) -> io::Result<Self> {
        let pipes = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = pipes.spawn().map_err(explain)?;
        let (Some(stdin), Some(stdout)) = (process.stdin.take(), process.stdout.take()) else {
            unreachable!("both are piped")
        };
        let (sender, from_board) = sync_channel(1024);
        thread::spawn(move || forward(stdout, &sender));
        Ok(Self {
            process,
            to_board: writer_thread(stdin),
            from_board,
            received: Vec::new(),
        })
    }
}

fn qemu(board: Board, image: &Path, transport: Transport, pace: Pace) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", board.machine()])
        .args(["-display", "none", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image);
    let uart = match transport {
        Transport::Uart => "stdio",
        Transport::Console => "none",
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

/// A thread that writes what is sent to it: a program that does not read must not block the host, and is detected
/// by a timeout.
pub(crate) fn writer_thread<T: AsRef<[u8]> + Send + 'static>(mut stdin: ChildStdin) -> Sender<T> {
    let (sender, pieces) = channel::<T>();
    thread::spawn(move || (pieces.iter()).try_for_each(|piece| stdin.write_all(piece.as_ref())));
    sender
}

/// Forwards a pipe, which has no timeout, to a channel, which has.
fn forward(mut stdout: ChildStdout, sender: &SyncSender<Vec<u8>>) {
    let mut buffer = vec![0; 65_536];
    while let Ok(length @ 1..) = stdout.read(&mut buffer) {
        if sender.send(buffer[..length].to_vec()).is_err() {
            return;
        }
    }
}

/// Times out like a serial port.
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
        let sent = self.to_board.send(bytes.to_vec());
        sent.map_err(|_| io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // Fails only if the process has already ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_emulator_that_does_not_read_does_not_block() {
        let mut emulator = Emulator::of(Command::new("sleep").arg("600")).unwrap();
        // More than a pipe holds.
        emulator.write_all(&vec![0; 1 << 20]).unwrap();
        let error = emulator.read(&mut [0]).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }
}

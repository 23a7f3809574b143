//! Which board, and how it is reached.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use clap::{ArgGroup, Args, Parser};
use serial2::SerialPort;

use super::emulator::{Board, Emulator, Pace, Way};
use super::session::{HilError, POLL, Session};

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
    /// Of the options that the command `hil` has for it.
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

    /// The image to emulate, or to read the log of a board with, if one was named for that.
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

    /// Opens a session with it; an emulated board boots for that.
    pub fn open(&self) -> Result<Session<Box<dyn Port>>, HilError> {
        let port: Box<dyn Port> = if let Some(name) = &self.port {
            Box::new(serial(name, self.baud)?)
        } else {
            let (image, way) = (self.emulated()?, Way::Console);
            Box::new(Emulator::boot(self.board, &image, way, Pace::Fast)?)
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

/// Any number that the last session did not have.
fn session_number() -> u32 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.subsec_nanos())
}

/// Opens a port: 8 bits, no parity, one stop bit, no flow control.
fn serial(name: &str, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(name, baud).map_err(|error| explain(name, &error))?;
    port.set_read_timeout(POLL)?;
    // What a board has sent before is to nobody.
    port.discard_buffers()?;
    Ok(port)
}

fn explain(name: &str, error: &io::Error) -> io::Error {
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

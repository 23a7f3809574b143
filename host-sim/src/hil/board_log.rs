//! The defmt log of the firmware as text.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use defmt_decoder::{DecodeError, Frame, StreamDecoder, Table};
use miette::{Result, miette};

/// Reads the texts of the log from the image that the board runs.
pub fn table(image: &Path) -> Result<Table> {
    let refuse = |what: &dyn std::fmt::Display| {
        miette!(
            help = "the ELF file that cargo has built is wanted, with its defmt section",
            "{}: {what}",
            image.display()
        )
    };
    let elf = fs::read(image).map_err(|error| refuse(&error))?;
    Table::parse(&elf)
        .map_err(|error| refuse(&error))?
        .ok_or_else(|| refuse(&"no defmt log in it"))
}

/// The log so far.
pub struct BoardLog<'t> {
    decoder: Box<dyn StreamDecoder + Send + Sync + 't>,
    pub text: String,
    /// Pieces that cannot be decoded: the board runs another image, or some were lost.
    pub garbled: u32,
}

impl<'t> BoardLog<'t> {
    /// A log with the texts of `table`.
    pub fn new(table: &'t Table) -> Self {
        Self {
            decoder: table.new_stream_decoder(),
            text: String::new(),
            garbled: 0,
        }
    }

    /// Takes the next piece, and passes the lines that it completes to `show`, except debug and trace.
    pub fn take(&mut self, piece: &[u8], mut show: impl FnMut(&str)) {
        self.decoder.received(piece);
        loop {
            match self.decoder.decode() {
                Ok(frame) => {
                    let line = line(&frame);
                    self.text.push_str(&line);
                    self.text.push('\n');
                    if is_shown(&frame) {
                        show(&line);
                    }
                }
                Err(DecodeError::UnexpectedEof) => return,
                Err(DecodeError::Malformed) => self.garbled += 1,
            }
        }
    }
}

fn is_shown(frame: &Frame) -> bool {
    frame
        .level()
        .is_none_or(|level| !matches!(level.as_str(), "trace" | "debug"))
}

fn line(frame: &Frame) -> String {
    let mut line = String::new();
    if let Some(time) = frame.display_timestamp() {
        // Writing into a string cannot fail.
        let _ = write!(line, "{:>14} ", time.to_string());
    }
    let level = frame.level().map_or("", |level| level.as_str());
    let _ = write!(line, "{level:<5} {}", frame.display_message());
    line
}

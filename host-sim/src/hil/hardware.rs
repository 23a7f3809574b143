//! What a board did, for `hil.json` and for people.

use std::fmt;

use miette::{Result, bail};
use serde::Serialize;

use super::bench::{Comparison, Duration};

/// A board's run over a log.
#[derive(Debug, Serialize)]
pub struct Hardware {
    /// Which, and how it was reached.
    pub board: String,
    /// Whether every answer has come and is the host's in every bit.
    pub bit_for_bit: bool,
    #[serde(flatten)]
    pub comparison: Comparison,
    /// How long it took.
    pub seconds: f64,
    pub times_real_time: f64,
    /// Processor clocks of the core's calls, if the board counts them.
    pub sample_clocks: Option<Duration>,
    pub fix_clocks: Option<Duration>,
    /// RAM of the navigator.
    pub state_bytes: u32,
    /// Deepest stack of the whole program.
    pub stack_bytes: u32,
    /// Requests that did not reach the board, and bytes for which it had no room.
    pub requests_lost: u32,
    pub bytes_lost: u32,
    /// Frames of the board that did not reach the host.
    pub frames_lost: u32,
    /// Lines of the log that the board had no room for.
    pub log_lines_lost: u32,
    /// Lines that cannot be read; nothing if none was to be.
    pub log_lines_garbled: Option<u32>,
}

impl Hardware {
    /// An error unless the board did what the host does.
    pub fn verdict(&self) -> Result<()> {
        let Comparison {
            answers,
            different,
            missing,
            first,
        } = &self.comparison;
        if self.bit_for_bit {
            return Ok(());
        }
        bail!(
            help = "answers are missing if the link loses frames, or if the board is too slow \
                    (--rate max waits for it); they differ after a missing one, and if the board \
                    runs another version of the core",
            "the board does not compute what the host does: of {answers} answers {different} \
             differ, {missing} are missing{}{}",
            if first.is_some() { "; the first: " } else { "" },
            first.as_deref().unwrap_or_default()
        );
    }
}

impl fmt::Display for Hardware {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "Board: {}; {} answers in {:.1} s, {:.1} times real time",
            self.board, self.comparison.answers, self.seconds, self.times_real_time
        )?;
        writeln!(
            f,
            "Memory: navigator {} bytes, deepest stack of the program {} bytes",
            self.state_bytes, self.stack_bytes
        )?;
        let calls = [("a sample", self.sample_clocks), ("a fix", self.fix_clocks)];
        for (name, clocks) in calls {
            if let Some(Duration { mean, worst }) = clocks {
                writeln!(
                    f,
                    "Processor clocks of {name}: {mean} on average, {worst} at most"
                )?;
            }
        }
        let lost = [
            ("requests", self.requests_lost),
            ("bytes at the board", self.bytes_lost),
            ("frames from the board", self.frames_lost),
            ("lines of its log", self.log_lines_lost),
        ];
        for (name, count) in lost.iter().filter(|(_, count)| *count > 0) {
            writeln!(f, "Lost: {count} {name}")?;
        }
        match self.log_lines_garbled {
            None => writeln!(f, "Its log was not read: that takes --image")?,
            Some(0) => {}
            Some(lines) => writeln!(
                f,
                "{lines} lines of its log cannot be read: is --image what it runs?"
            )?,
        }
        if self.bit_for_bit {
            writeln!(f, "Every answer is the host's, bit for bit.")?;
        }
        Ok(())
    }
}

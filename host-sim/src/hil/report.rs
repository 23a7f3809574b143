//! Progress of a board while it runs; its results, for `hil.json` and as text.

use std::fmt;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use ins_core::Time;
use miette::{Result, bail};
use serde::Serialize;

use super::bench::{Bench, Comparison, Took};
use crate::identify::quantities::{Axes, Quantities, Quantity};
use crate::identify::words::with_sigma;
use crate::log::Meta;

const REFRESH: Duration = Duration::from_millis(200);

/// A progress bar with some lines about the board.
pub struct View {
    /// Also for printing permanent lines.
    pub bar: ProgressBar,
    meta: Meta,
    first: Time,
    start: Instant,
    shown: Instant,
}

impl View {
    /// Of a log that begins at `first`, with `length` samples and fixes.
    pub fn new(bar: ProgressBar, length: usize, first: Time, meta: Meta) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {eta}\n{msg}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.set_length(length as u64);
        bar.set_message("");
        let now = Instant::now();
        Self {
            bar,
            meta,
            first,
            start: now,
            shown: now,
        }
    }

    pub fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Updates the display a few times a second.
    pub fn show(&mut self, bench: &Bench, waiting: usize) {
        if self.shown.elapsed() < REFRESH {
            return;
        }
        self.shown = Instant::now();
        let done = bench.comparison.answers + bench.comparison.missing;
        self.bar.set_position(done);
        self.bar.set_message(self.lines(bench, done, waiting));
    }

    fn lines(&self, bench: &Bench, done: u64, waiting: usize) -> String {
        let (latest, comparison) = (&bench.latest, &bench.comparison);
        let seconds = self.seconds();
        let rate = done as f64 / seconds;
        let times = latest.time.seconds_since(self.first) / seconds;
        let q = Quantities::of_log(&latest.estimates, &self.meta);
        format!(
            "{rate:.0} samples and fixes/s, {times:.1} times real time; \
             {waiting} waiting, {} dropped, {} different\n\
             {:?}, {:?}; azimuth {} deg, latency {} ms\n\
             accelerometers {} mg; gyros {} deg/h",
            comparison.missing,
            comparison.different,
            latest.phase,
            latest.manoeuvre,
            known(&q.azimuth_error_deg),
            known(&q.gnss_latency_ms),
            axes(&q.accel_bias_mg),
            axes(&q.gyro_bias_deg_h),
        )
    }
}

fn axes(Axes { x, y, z }: &Axes) -> String {
    format!("x {}, y {}, z {}", known(x), known(y), known(z))
}

fn known(quantity: &Quantity) -> String {
    if quantity.observable() {
        with_sigma(quantity)
    } else {
        "?".to_owned()
    }
}

/// A board's run over a log.
#[derive(Debug, Serialize)]
pub struct Hardware {
    /// Board and connection.
    pub board: String,
    /// Whether no answer is missing, and all are equal to the host's bit for bit.
    pub bit_for_bit: bool,
    #[serde(flatten)]
    pub comparison: Comparison,
    pub seconds: f64,
    pub times_real_time: f64,
    /// Processor clocks of the core's calls, if the board counts them.
    pub sample_clocks: Option<Took>,
    pub fix_clocks: Option<Took>,
    /// RAM of the navigator.
    pub state_bytes: u32,
    /// Largest stack use of the whole program.
    pub stack_bytes: u32,
    /// Requests that did not reach the board, and bytes for which it had no room.
    pub requests_lost: u32,
    pub bytes_lost: u32,
    /// Frames of the board that did not reach the host.
    pub frames_lost: u32,
    /// Lines of this run's log that the board had no room for.
    pub log_lines_lost: u32,
    /// Lines that cannot be decoded; none if the log is not read.
    pub log_lines_garbled: Option<u32>,
}

impl Hardware {
    /// An error unless the board computes the same as the host.
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
            if let Some(Took { mean, worst }) = clocks {
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

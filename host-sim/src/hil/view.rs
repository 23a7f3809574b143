//! The run in the terminal, while it lasts.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use ins_core::Time;

use super::bench::Bench;
use crate::identify::quantities::{Axes, Quantities, Quantity};
use crate::identify::words::with_sigma;
use crate::log::BodyAxes;

const REFRESH: Duration = Duration::from_millis(200);

/// A bar with some lines about the board.
pub struct View {
    /// For lines that stay.
    pub bar: ProgressBar,
    axes: BodyAxes,
    first: Time,
    start: Instant,
    shown: Instant,
}

impl View {
    /// Of a log that begins at `first` and has so many samples and fixes.
    pub fn new(bar: ProgressBar, length: usize, first: Time, axes: BodyAxes) -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {eta}\n{msg}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.set_length(length as u64);
        bar.set_message("");
        let now = Instant::now();
        Self {
            bar,
            axes,
            first,
            start: now,
            shown: now,
        }
    }

    /// Time since the start, s.
    pub fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Shows how things stand, a few times a second.
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
        let q = Quantities::new(&latest.estimates, self.axes);
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

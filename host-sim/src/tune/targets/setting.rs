//! A parameter of one number or three, and files of them.

use crate::log::BodyAxes;
use crate::tune::found::{Found, along};
use crate::tune::tuning::Tuning;

/// A parameter of one number or three.
pub(super) struct Setting {
    pub(super) name: String,
    pub(super) unit: &'static str,
    pub(super) found: Vec<Found>,
    pub(super) takes: [f64; 2],
    pub(super) whole: bool,
    /// Why it is not to be set as it stands.
    pub(super) hold: Option<&'static str>,
    pub(super) note: Option<String>,
}

impl Setting {
    pub(super) fn new(name: &str, unit: &'static str, found: &[Found]) -> Self {
        Self {
            name: name.to_owned(),
            unit,
            found: found.to_vec(),
            takes: [f64::NEG_INFINITY, f64::INFINITY],
            whole: false,
            hold: None,
            note: None,
        }
    }

    /// One of each axis, whose letter is where the name has an `@`.
    pub(super) fn each(name: &str, unit: &'static str, found: &[Found]) -> Vec<Self> {
        let named = |(axis, found)| Self::new(&name.replace('@', axis), unit, &[found]);
        let axes = ["X", "Y", "Z"].into_iter();
        axes.zip(found.iter().copied()).map(named).collect()
    }

    pub(super) fn takes(self, least: f64, most: f64) -> Self {
        Self {
            takes: [least, most],
            ..self
        }
    }

    pub(super) fn note(self, note: String) -> Self {
        Self {
            note: Some(note),
            ..self
        }
    }

    /// One that has acted on the readings already: what is found adds to what was set.
    pub(super) fn on_top(mut self, tuning: &Tuning, hold: Option<&'static str>) -> Self {
        match tuning.parameters.get(&self.name) {
            Some(set) if hold.is_none() => {
                self.found
                    .iter_mut()
                    .for_each(|found| *found = found.plus(*set));
            }
            _ => self.hold = hold.or(Some("to be added to what was, which the recording lacks")),
        }
        self
    }

    fn digits(&self) -> Vec<String> {
        let one = |found: &Found| {
            if self.whole {
                format!("{:.0}", found.value)
            } else {
                found.digits()
            }
        };
        self.found.iter().map(one).collect()
    }

    /// What is found as a comment, then the line if it may be set.
    pub(super) fn print(&self, text: &mut String, comment: &str, write: Write) {
        let mut line = |line: &str| {
            text.push_str(line);
            text.push('\n');
        };
        let told = |found: &Found| {
            found.missing.map_or_else(
                || format!("{} {}", found.with_sigma(), self.unit),
                |missing| format!("not known; {missing}"),
            )
        };
        let mut shown: Vec<String> = self.found.iter().map(told).collect();
        shown.dedup();
        line(&format!("{comment} {}: {}", self.name, shown.join(" | ")));
        if !self.found.iter().all(Found::is_known) {
            return;
        }
        let (digits, [least, most]) = (self.digits(), self.takes);
        let within = |found: &Found| (least..=most).contains(&found.value);
        if let Some(hold) = self.hold {
            line(&format!("{comment} not set: {hold}"));
        } else if !self.found.iter().all(within) {
            line(&format!("{comment} not set: it takes {least} to {most}"));
        } else {
            line(&write(&self.name, &digits));
            if let Some(note) = &self.note {
                line(&format!("{comment} {note}"));
            }
        }
    }
}

/// A line from a name and its values.
type Write = fn(&str, &[String]) -> String;

/// A file of parameters, the verdict on top.
pub(super) fn file(
    t: &Tuning,
    title: &str,
    comment: &str,
    write: Write,
    settings: &[Setting],
) -> String {
    let turned = t.turned_upright.then(|| TURNED.to_owned());
    let head = [title.to_owned()].into_iter().chain(t.verdict.lines());
    let head: Vec<String> = head
        .chain(turned)
        .map(|line| format!("{comment} {line}\n"))
        .collect();
    let mut text = head.concat();
    for setting in settings {
        setting.print(&mut text, comment, write);
    }
    text
}

pub(super) const TURNED: &str =
    "The sensor was turned upright when it was read: these axes are not its own.";

pub(super) const ROTATED: &str =
    "the board is rotated: sensors, board and vehicle have different axes";

/// Of noises of the autopilots' filters.
const LEAST: &str =
    "white noise alone, so the least; the default also covers scale errors and vibration";

/// Standard deviation a step that lets a variance grow as white noise of a density does, for
/// filters that add `(sigma dt)^2` at each step.
pub fn a_step(density: Found, step_s: f64) -> Found {
    density.scaled(1.0 / step_s.sqrt())
}

/// Offset of readings that are `(reading - offset) * scale`, forward, right, down.
pub(super) fn unscaled(bias: &[Found; 3], scale: [f64; 3]) -> [Found; 3] {
    let bias = along(BodyAxes::Frd, bias);
    [0, 1, 2].map(|axis| bias[axis].scaled(1.0 / scale[axis]))
}

/// A noise of an autopilot's filter that steps every `step_s`: never set, for it is the least.
pub(super) fn noise(
    name: &str,
    unit: &'static str,
    density: Found,
    takes: [f64; 2],
    step_s: f64,
) -> Setting {
    Setting {
        hold: Some(LEAST),
        takes,
        ..Setting::new(name, unit, &[a_step(density, step_s)])
    }
}

/// Three numbers between brackets, or one three times.
pub(super) fn bracketed(values: &[String]) -> String {
    match values {
        [one] => format!("[{one}, {one}, {one}]"),
        all => format!("[{}]", all.join(", ")),
    }
}

//! Parameters of one or three numbers, and files of them.

use crate::tune::found::Found;
use crate::tune::tuning::Tuning;

pub(super) const TURNED: &str =
    "The sensor was turned upright when it was read: these axes are not its own.";

pub(super) struct Setting {
    pub(super) name: String,
    pub(super) unit: &'static str,
    pub(super) found: Vec<Found>,
    pub(super) range: [f64; 2],
    pub(super) integer: bool,
    /// Why it must not be set.
    pub(super) hold: Option<&'static str>,
    pub(super) note: Option<String>,
}

impl Setting {
    pub(super) fn new(name: &str, unit: &'static str, found: &[Found]) -> Self {
        Self {
            name: name.to_owned(),
            unit,
            found: found.to_vec(),
            range: [f64::NEG_INFINITY, f64::INFINITY],
            integer: false,
            hold: None,
            note: None,
        }
    }

    /// One for each axis, with its letter in place of `@` in the name.
    pub(super) fn each(name: &str, unit: &'static str, found: &[Found]) -> Vec<Self> {
        let axes = ["X", "Y", "Z"].into_iter().zip(found);
        axes.map(|(axis, found)| Self::new(&name.replace('@', axis), unit, &[*found]))
            .collect()
    }

    pub(super) fn range(self, range: [f64; 2]) -> Self {
        Self { range, ..self }
    }

    pub(super) fn hold(self, hold: Option<&'static str>) -> Self {
        Self { hold, ..self }
    }

    pub(super) fn note(self, note: impl Into<String>) -> Self {
        let note = Some(note.into());
        Self { note, ..self }
    }

    /// One that was already applied to the readings: the result is added to the value that was set.
    pub(super) fn incremental(mut self, tuning: &Tuning, hold: Option<&'static str>) -> Self {
        match tuning.parameters.get(&self.name) {
            Some(set) if hold.is_none() => {
                for found in &mut self.found {
                    *found = found.plus(*set);
                }
            }
            _ => self.hold = hold.or(Some("to be added to what was, which the recording lacks")),
        }
        self
    }

    /// The result as a comment, then the line if it may be set.
    pub(super) fn print(&self, text: &mut String, comment: &str, write: Write) {
        let mut line = |line: &str| {
            text.push_str(line);
            text.push('\n');
        };
        let text_of = |found: &Found| match found.missing {
            None => format!("{} {}", found.with_sigma(), self.unit),
            Some(missing) => format!("not known; {missing}"),
        };
        let mut shown: Vec<String> = self.found.iter().map(text_of).collect();
        shown.dedup();
        line(&format!("{comment} {}: {}", self.name, shown.join(" | ")));
        if !self.found.iter().all(Found::is_known) {
            return;
        }
        let [least, most] = self.range;
        let within = |found: &Found| (least..=most).contains(&found.value);
        if let Some(hold) = self.hold {
            line(&format!("{comment} not set: {hold}"));
        } else if !self.found.iter().all(within) {
            line(&format!("{comment} not set: it takes {least} to {most}"));
        } else {
            let digits = |found: &Found| {
                if self.integer {
                    format!("{:.0}", found.value)
                } else {
                    found.digits()
                }
            };
            let digits: Vec<String> = self.found.iter().map(digits).collect();
            line(&write(&self.name, &digits));
            if let Some(note) = &self.note {
                line(&format!("{comment} {note}"));
            }
        }
    }
}

/// A line from a name and its values.
type Write = fn(&str, &[String]) -> String;

/// A file of parameters, with the verdict at its head.
pub(super) fn file(
    t: &Tuning,
    title: &str,
    comment: &str,
    write: Write,
    settings: &[Setting],
) -> String {
    let turned = t.turned_upright.then(|| TURNED.to_owned());
    let head = [title.to_owned()].into_iter().chain(t.verdict.lines());
    let head = head.chain(turned).chain(t.clock_note());
    let head = head.map(|line| format!("{comment} {line}\n"));
    let mut text: String = head.collect();
    for setting in settings {
        setting.print(&mut text, comment, write);
    }
    text
}

/// Three numbers in brackets, or one repeated.
pub(super) fn bracketed(values: &[String]) -> String {
    match values {
        [one] => format!("[{one}, {one}, {one}]"),
        all => format!("[{}]", all.join(", ")),
    }
}

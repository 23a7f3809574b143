//! Files that the user writes: aircraft, plans, error models.

use std::path::{Path, PathBuf};

use miette::{Report, Result, miette};
use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use super::dynamics::Dynamics;
use super::parameters::Parameters;
use crate::sim::ErrorModel;
use crate::sim::errors::ErrorModelError;

/// Error in a user's file: what is wrong and where, what was expected, the likely cause.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, miette::Diagnostic)]
#[error("{}{}: {message}", file.display(), line.map_or(String::new(), |line| format!(", line {line}")))]
pub struct InputError {
    pub file: PathBuf,
    pub line: Option<usize>,
    pub message: String,
}

/// Text and name of a file, for the locations of errors.
pub(crate) struct Source<'a> {
    pub file: &'a Path,
    pub text: &'a str,
}

impl Source<'_> {
    /// An error at a byte of the text.
    pub fn error(&self, offset: usize, message: String) -> InputError {
        let before = self.text.get(..offset).unwrap_or(self.text);
        let line = 1 + before.matches('\n').count();
        InputError {
            file: self.file.to_owned(),
            line: Some(line),
            message,
        }
    }

    /// Offset at which a key is set: comments may contain it before.
    pub fn key(&self, key: &str) -> usize {
        let mut start = 0;
        for line in self.text.split_inclusive('\n') {
            let set = line.split_once('=').map(|(name, _)| name.trim());
            if set.is_some_and(|name| name.rsplit('.').next() == Some(key)) {
                return start;
            }
            start += line.len();
        }
        self.text.find(key).unwrap_or(0)
    }

    /// Parses the text as TOML; `example` names a complete file for messages.
    pub fn parse<T: DeserializeOwned>(&self, example: &str) -> Result<T, InputError> {
        toml::from_str(self.text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            let message = error.message().trim_end();
            self.error(
                offset,
                format!("{message}; {example} is a complete example"),
            )
        })
    }

    /// Refuses the first value that is not within the bounds of its key.
    pub fn all_within(&self, values: &[(&str, f64, [f64; 2])]) -> Result<(), InputError> {
        let beyond = values
            .iter()
            .find(|(_, value, [low, high])| !(*low..=*high).contains(value));
        beyond.map_or(Ok(()), |(key, value, [low, high])| {
            let message = format!("`{key} = {value}`: expected {low} to {high}");
            Err(self.error(self.key(key), message))
        })
    }

    /// What is wrong with the error model that the text is, or sets keys of; where, if it is seen.
    pub fn in_model(&self, error: &ErrorModelError) -> Report {
        let (place, message) = match error {
            ErrorModelError::Syntax(error) => match error.span() {
                Some(span) => (Some(span.start), error.message().to_owned()),
                None => (self.value(&key_of(error)), error.to_string()),
            },
            ErrorModelError::Value { key, .. } => (self.value(key), error.to_string()),
            ErrorModelError::Unwritable(_) => (None, error.to_string()),
        };
        let message = message.trim_end().replace('\n', " ");
        let error = self.error(place.unwrap_or(0), message);
        let line = error.line.filter(|_| place.is_some());
        let error = InputError { line, ..error };
        miette!(
            help = "host-sim/errors/wave.toml is a complete error model",
            "{error}"
        )
    }

    /// Where the value under a dotted path begins, or that of the last of its tables that is there.
    pub fn value(&self, path: &str) -> Option<usize> {
        let text = DeTable::parse(self.text).ok()?;
        let (mut table, mut place) = (text.get_ref(), None);
        for key in path.split('.') {
            let key = key.split('[').next().unwrap_or(key);
            let Some(value) = table.get(key) else { break };
            place = Some(value.span().start);
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                _ => break,
            }
        }
        place
    }
}

/// The dotted path in the message of an error without a location.
fn key_of(error: &toml::de::Error) -> String {
    let told = error.to_string();
    let named = |before: &str| Some(told.split_once(before)?.1.split_once('`')?.0);
    let parts = [named("\nin `"), named("unknown field `")];
    parts.into_iter().flatten().collect::<Vec<_>>().join(".")
}

/// The text of a file; `what` describes it in the message if it cannot be read.
pub fn read_text(file: &Path, what: &str) -> Result<String, InputError> {
    std::fs::read_to_string(file).map_err(|error| InputError {
        file: file.to_owned(),
        line: None,
        message: format!("cannot be read ({error}); expected {what} in TOML"),
    })
}

/// The error model of a preset by its name, or of a file.
pub(crate) fn error_model(name: &str) -> Result<ErrorModel> {
    match name {
        "ideal" => Ok(ErrorModel::ideal()),
        "hg1700" => Ok(ErrorModel::hg1700()),
        "mems" => Ok(ErrorModel::mems()),
        file => {
            let path = Path::new(file);
            let text = read_text(path, "ideal, hg1700, mems or an error model")?;
            let source = Source {
                file: path,
                text: &text,
            };
            ErrorModel::from_toml(&text).map_err(|error| source.in_model(&error))
        }
    }
}

pub fn read_aircraft(file: &Path) -> Result<Dynamics, InputError> {
    let text = read_text(file, "an aircraft")?;
    let source = Source { file, text: &text };
    let parameters: Parameters = source.parse("host-sim/aircraft/cessna172.toml")?;
    for (key, value) in parameters.must_be_positive() {
        if value.is_nan() || value <= 0.0 || value.is_infinite() {
            return Err(source.error(
                source.key(key),
                format!("`{key} = {value}`: expected a positive number"),
            ));
        }
    }
    let table = source.parse("host-sim/aircraft/cessna172.toml")?;
    let numbers = not_finite("", &toml::Value::Table(table));
    let numbers = numbers.map(|(key, value)| (key, value, "a number"));
    let mut others = parameters.must_hold().into_iter();
    let other = others.find(|(_, _, holds, _)| !holds);
    let other = other.map(|(key, value, _, expected)| (key.to_owned(), value, expected));
    match numbers.or(other) {
        Some((key, value, expected)) => Err(source.error(
            source.value(&key).unwrap_or(0),
            format!("`{key} = {value}`: expected {expected}"),
        )),
        None => Ok(Dynamics::new(&parameters)),
    }
}

/// The first number that is not finite, and its dotted path.
fn not_finite(path: &str, value: &toml::Value) -> Option<(String, f64)> {
    match value {
        toml::Value::Float(number) if !number.is_finite() => Some((path.to_owned(), *number)),
        toml::Value::Array(all) => all.iter().find_map(|value| not_finite(path, value)),
        toml::Value::Table(table) => table.iter().find_map(|(key, value)| {
            let dot = if path.is_empty() { "" } else { "." };
            not_finite(&format!("{path}{dot}{key}"), value)
        }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_with_an_error_model_has_its_line() {
        let wave = include_str!("../../errors/wave.toml");
        let not_a_number = "invalid type: string \"5\", expected f64";
        for (good, bad, message) in [
            (
                "5e-4",
                "-7.5",
                "accel_mps2.white_noise = -7.5: expected zero",
            ),
            ("rate_hz = 10.0", "rate = 10.0", "unknown field `rate`"),
            ("rate_hz = 10.0", "rate_hz = \"5\"", not_a_number),
        ] {
            let text = wave.replacen(good, bad, 1);
            let error = ErrorModel::from_toml(&text).unwrap_err();
            let file = Path::new("unit.toml");
            let told = Source { file, text: &text }.in_model(&error).to_string();
            let before = wave.split_once(good).unwrap().0;
            let line = 1 + before.matches('\n').count();
            let place = format!("unit.toml, line {line}: {message}");
            assert!(told.starts_with(&place), "{told}");
            assert!(!told.contains('\n'), "{told}");
        }
    }

    #[test]
    fn what_is_wrong_with_keys_of_an_error_model_has_its_line() {
        for (key, message) in [
            ("gnss.rate = 5", "unknown field `rate`"),
            (
                "gnss.rate_hz = \"5\"",
                "invalid type: string \"5\", expected f64",
            ),
            (
                "gnss.rate_hz = -5",
                "gnss.rate_hz = -5: expected more than zero",
            ),
            (
                "gnss = { latency_s = [0.3, 0.1] }",
                "gnss.latency_s[1] = 0.1",
            ),
            ("gyro = 1", "unknown field `gyro`"),
        ] {
            let text = format!("imu.dropped_fraction = 0.1\n{key}\n");
            let error = ErrorModel::mems().with(&text.parse().unwrap()).unwrap_err();
            let file = Path::new("keys.toml");
            let told = Source { file, text: &text }.in_model(&error).to_string();
            let place = format!("keys.toml, line 2: {message}");
            assert!(told.starts_with(&place) && !told.contains('\n'), "{told}");
        }
    }
}

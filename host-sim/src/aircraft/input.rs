//! Files that the user writes: aircraft, plans, error models.

use std::path::{Path, PathBuf};

use miette::{Result, miette};
use serde::de::DeserializeOwned;

use super::dynamics::Dynamics;
use super::parameters::Parameters;
use crate::sim::ErrorModel;

/// A file that cannot be read or used: what is wrong where, what was expected, the likely cause.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, miette::Diagnostic)]
#[error("{}{}: {message}", file.display(), line.map_or(String::new(), |line| format!(", line {line}")))]
pub struct InputError {
    pub file: PathBuf,
    pub line: Option<usize>,
    pub message: String,
}

/// Text with its name, to point into.
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

    /// Where a key is set: comments may name it before.
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

    /// The text as TOML; `example` says where a complete one is found.
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
}

/// The text of a file; `what` it should be is said if it cannot be read.
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
            ErrorModel::from_toml(&text).map_err(|error| {
                miette!(
                    help = "host-sim/errors/wave.toml is a complete example",
                    "{file}: {error}"
                )
            })
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
    Ok(Dynamics::new(&parameters))
}

//! Defects of a log, and where they are.

use std::io;
use std::path::Path;

use miette::Diagnostic;
use thiserror::Error;

/// A defect of a log: where it is, what was expected, what was found, and the likely cause.
///
/// Also a warning, where a log only looks suspicious.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
#[error("{}{}: expected {expected}, found {found}", path.display(), place(*line, *character, name.as_deref()))]
pub struct LogError {
    /// File or folder.
    pub path: Box<Path>,
    /// Line, counted from one.
    pub line: Option<u64>,
    /// Character in the line, counted from one.
    pub character: Option<u64>,
    /// Name of the column or key.
    pub name: Option<Box<str>>,
    pub expected: Box<str>,
    pub found: Box<str>,
    /// Most likely cause, and what to do.
    #[help]
    pub cause: Box<str>,
    /// Whether it puts the results in doubt although the log is used.
    pub doubt: bool,
}

impl LogError {
    /// On one line.
    pub(crate) fn in_a_line(&self) -> String {
        format!("{self} ({})", self.cause)
    }

    /// A defect of a whole file.
    pub(crate) fn file(
        path: &Path,
        expected: impl Into<Box<str>>,
        found: impl Into<Box<str>>,
        cause: impl Into<Box<str>>,
    ) -> Self {
        Self {
            path: path.into(),
            line: None,
            character: None,
            name: None,
            expected: expected.into(),
            found: found.into(),
            cause: cause.into(),
            doubt: false,
        }
    }

    /// The temporary file for samples cannot be written.
    pub(super) fn no_room(error: &io::Error) -> Self {
        let cause = "a long log needs a temporary file, 56 bytes per sample, and there is no room for \
                     it: set TMPDIR to another folder";
        let (folder, expected) = (std::env::temp_dir(), "room for a temporary file");
        Self::file(&folder, expected, error.to_string(), cause)
    }

    /// An error of the TOML parser, with its line and character.
    pub(crate) fn toml(path: &Path, text: &str, error: &toml::de::Error, cause: &str) -> Self {
        let message = error.message().lines().next().unwrap_or_default();
        let defect = Self::file(path, "a valid entry", message, cause);
        let Some(before) = error.span().and_then(|span| text.get(..span.start)) else {
            return defect;
        };
        let line = before.matches('\n').count() + 1;
        let character = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
        defect.at_line(line as u64).at_character(character as u64)
    }

    /// The same defect, at a line.
    pub(super) fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// The same defect, in a named column or key; an empty name stands for all.
    pub(super) fn in_column(mut self, name: &str) -> Self {
        self.name = (!name.is_empty()).then(|| name.into());
        self
    }

    /// The same defect, at a character of its line.
    pub(super) fn at_character(mut self, character: u64) -> Self {
        self.character = Some(character);
        self
    }
}

fn place(line: Option<u64>, character: Option<u64>, name: Option<&str>) -> String {
    let number = |number: Option<u64>| number.map_or(String::new(), |n| format!(":{n}"));
    let name = name.map_or(String::new(), |name| format!(" ({name})"));
    number(line) + &number(character) + &name
}

/// Paths of the tables of a log, and the warnings about them so far.
pub(super) struct Findings<'a> {
    pub(super) imu: &'a Path,
    pub(super) gnss: &'a Path,
    pub(super) warnings: &'a mut Vec<LogError>,
}

impl Findings<'_> {
    /// A defect of some columns of the inertial samples.
    pub(super) fn imu(
        &self,
        columns: &str,
        expected: impl Into<Box<str>>,
        found: impl Into<Box<str>>,
        cause: impl Into<Box<str>>,
    ) -> LogError {
        LogError::file(self.imu, expected, found, cause).in_column(columns)
    }

    /// A defect of some columns of the fixes.
    pub(super) fn gnss(
        &self,
        columns: &str,
        expected: impl Into<Box<str>>,
        found: impl Into<Box<str>>,
        cause: impl Into<Box<str>>,
    ) -> LogError {
        LogError::file(self.gnss, expected, found, cause).in_column(columns)
    }

    pub(super) fn warn(&mut self, defect: LogError) {
        self.warnings.push(defect);
    }
}

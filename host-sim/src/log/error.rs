//! What is wrong with a log, and where.

use std::path::Path;
use std::{fmt, io};

use miette::Diagnostic;
use thiserror::Error;

/// A place inside a file, counted from one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// Line.
    pub line: Option<u64>,
    /// Character in the line.
    pub character: Option<u64>,
    /// Name of the column or key.
    pub name: Option<Box<str>>,
}

/// A defect of a log: where it is, what was expected, what was found, and the likely cause.
///
/// The same type carries a warning, where a log only looks suspicious.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
#[error("{}{cell}: expected {expected}, found {found}", path.display())]
pub struct LogError {
    /// File or folder.
    pub path: Box<Path>,
    /// Place inside it.
    pub cell: Cell,
    /// What should be there.
    pub expected: Box<str>,
    /// What is there.
    pub found: Box<str>,
    /// Why it most likely came about, and what to do.
    #[help]
    pub cause: Box<str>,
}

impl LogError {
    /// To the standard error, what is no reason to stop.
    pub(crate) fn tell(warnings: &[Self]) {
        for warning in warnings {
            eprintln!("warning: {warning}\n  {}", warning.cause);
        }
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
            cell: Cell::default(),
            expected: expected.into(),
            found: found.into(),
            cause: cause.into(),
        }
    }

    /// That samples found no room beside memory.
    pub(super) fn no_room(error: &io::Error) -> Self {
        let cause = "a long log is kept in a file that is removed by itself, 56 bytes a sample, and \
                     there is no room for it: TMPDIR names another folder";
        let folder = std::env::temp_dir();
        Self::file(
            &folder,
            "room for a temporary file",
            error.to_string(),
            cause,
        )
    }

    /// What a TOML parser found, at its place.
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
        self.cell.line = Some(line);
        self
    }

    /// The same defect, in a named column or key.
    pub(super) fn in_column(mut self, name: &str) -> Self {
        self.cell.name = Some(name.into());
        self
    }

    /// The same defect, at a character of its line.
    pub(super) fn at_character(mut self, character: u64) -> Self {
        self.cell.character = Some(character);
        self
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some(character) = self.character {
            write!(f, ":{character}")?;
        }
        match &self.name {
            Some(name) => write!(f, " ({name})"),
            None => Ok(()),
        }
    }
}

//! Tables of numbers as other programs write them.

use std::path::Path;

use super::recording::bytes;
use crate::log::LogError;

/// Named columns of numbers; not a number where a cell holds none.
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a file; the first line names the columns if it holds a letter.
    pub(super) fn read(path: &Path) -> Result<Self, LogError> {
        Ok(Self::parse(&content(path)?))
    }

    pub(super) fn parse(text: &str) -> Self {
        let mut lines = text
            .lines()
            .filter(|line| !line.trim().is_empty())
            .peekable();
        let names = lines
            .next_if(|line| cells(line).iter().any(|cell| number(cell).is_nan()))
            .map(|line| cells(line.trim_start_matches(['#', '%', '\u{feff}'])))
            .unwrap_or_default();
        let row = |line: &str| cells(line).iter().map(|cell| number(cell)).collect();
        Self {
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            rows: lines.map(row).collect(),
        }
    }

    /// Index of a column.
    pub(super) fn column(&self, name: &str) -> Option<usize> {
        self.names
            .iter()
            .position(|own| own.eq_ignore_ascii_case(name))
    }

    /// Index of a column that must be there.
    pub(super) fn required(&self, name: &str, path: &Path) -> Result<usize, LogError> {
        self.column(name).ok_or_else(|| {
            let found = format!("columns {}", self.names.join(", "));
            let cause = "another version of the program, or another file";
            LogError::file(path, format!("a column `{name}`"), found, cause)
        })
    }
}

/// A text whatever its encoding: what is no UTF-8 is no number either.
pub(super) fn content(path: &Path) -> Result<String, LogError> {
    Ok(String::from_utf8_lossy(&bytes(path)?).into_owned())
}

/// Cells between commas, semicolons or tabs, or else between blanks.
pub(super) fn cells(line: &str) -> Vec<&str> {
    let line = line.trim();
    let quotes: &[char] = &['"', ' '];
    match [',', ';', '\t']
        .into_iter()
        .find(|separator| line.contains(*separator))
    {
        Some(separator) => line
            .split(separator)
            .map(|cell| cell.trim_matches(quotes))
            .collect(),
        None => line.split_whitespace().collect(),
    }
}

pub(super) fn number(cell: &str) -> f64 {
    cell.parse().unwrap_or(f64::NAN)
}

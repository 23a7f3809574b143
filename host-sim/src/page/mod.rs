//! What is printed and written: tables, plots, pages, folders. Knows nothing of navigation.

pub(crate) mod chart;
pub(crate) mod html;
pub(crate) mod number;
pub(crate) mod output;
pub(crate) mod plot;
pub(crate) mod progress;
pub(crate) mod sheet;
pub mod table;

use miette::{IntoDiagnostic, Result};
use serde::Serialize;

pub use number::{brief, to_second_digit_of as digits};

/// A value for programs.
pub(crate) fn json(value: &impl Serialize) -> Result<String> {
    Ok(serde_json::to_string_pretty(value).into_diagnostic()? + "\n")
}

/// Rows for programs, under names with commas between them.
pub(crate) fn csv<R>(names: &str, rows: impl IntoIterator<Item = R>) -> Result<String>
where
    R: IntoIterator<Item: AsRef<[u8]>>,
{
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(names.split(',')).into_diagnostic()?;
    for row in rows {
        table.write_record(row).into_diagnostic()?;
    }
    let text = table.into_inner().into_diagnostic()?;
    String::from_utf8(text).into_diagnostic()
}

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

pub(crate) use number::to_second_digit_of as digits;

/// A value for programs.
pub(crate) fn json(value: &impl Serialize) -> Result<String> {
    Ok(serde_json::to_string_pretty(value).into_diagnostic()? + "\n")
}

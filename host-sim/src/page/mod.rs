//! Output: tables, plots, pages, folders. Independent of navigation.

pub(crate) mod chart;
pub(crate) mod html;
pub(crate) mod output;
pub(crate) mod plot;
pub(crate) mod progress;
pub(crate) mod sheet;
pub mod table;

use std::io;

use miette::{IntoDiagnostic, Result};
use serde::Serialize;

/// A value as JSON.
pub(crate) fn json(value: &impl Serialize) -> Result<String> {
    Ok(serde_json::to_string_pretty(value).into_diagnostic()? + "\n")
}

/// Rows as CSV, under comma-separated names.
pub(crate) fn csv<R>(names: &str, rows: impl IntoIterator<Item = R>) -> Result<String>
where
    R: IntoIterator<Item: AsRef<[u8]>>,
{
    let text = write_csv(Vec::new(), names, rows).into_diagnostic()?;
    String::from_utf8(text).into_diagnostic()
}

/// The same, row by row into a writer.
pub(crate) fn write_csv<W, R>(
    to: W,
    names: &str,
    rows: impl IntoIterator<Item = R>,
) -> io::Result<W>
where
    W: io::Write,
    R: IntoIterator<Item: AsRef<[u8]>>,
{
    let mut table = csv::Writer::from_writer(to);
    table.write_record(names.split(','))?;
    for row in rows {
        table.write_record(row)?;
    }
    table.into_inner().map_err(csv::IntoInnerError::into_error)
}

/// A number down to the second digit of `scale`.
pub fn digits(scale: f64, value: f64) -> String {
    let mut decimals = 0;
    let mut unit = 10.0;
    let nothing = scale == 0.0 && value == 0.0;
    while unit > scale.abs() && decimals < 9 && !nothing {
        decimals += 1;
        unit /= 10.0;
    }
    fixed(decimals, value)
}

/// A number with fixed decimals, without the sign of a zero.
pub(crate) fn fixed(decimals: usize, value: f64) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(size) if size.chars().all(|c| matches!(c, '0' | '.')) => size.to_owned(),
        _ => text,
    }
}

/// A number down to its own second digit.
pub fn brief(value: f64) -> String {
    digits(value, value)
}

/// A number rounded to significant digits.
pub(crate) fn significant(digits: usize, value: f64) -> f64 {
    let decimals = digits.saturating_sub(1);
    // Through text, so that it is written with no more digits. A zero loses its sign.
    format!("{value:.decimals$e}").parse().unwrap_or(value) + 0.0
}

#[cfg(test)]
mod tests {
    use super::{digits, significant};

    #[test]
    fn decimals_follow_the_scale() {
        let shown = [31.0, 2.0, 0.1, 0.034].map(|scale| digits(scale, 1234.56789));
        assert_eq!(shown, ["1235", "1234.6", "1234.57", "1234.568"]);
        assert_eq!(digits(0.0, 0.0), "0");
    }

    #[test]
    fn no_zero_has_a_sign() {
        let shown = [-0.0, -0.004, -0.006, 0.004].map(|value| digits(0.15, value));
        assert_eq!(shown, ["0.00", "0.00", "-0.01", "0.00"]);
        assert!(significant(5, -0.0).is_sign_positive());
        assert_eq!(digits(1.0, f64::NEG_INFINITY), "-inf");
    }

    #[test]
    fn numbers_in_drawings_have_few_digits() {
        let rounded = [1_234.567_89, -0.000_123_456_7, 0.0].map(|v| significant(5, v).to_string());
        assert_eq!(rounded, ["1234.6", "-0.00012346", "0"]);
        assert!(significant(5, f64::NAN).is_nan());
    }
}

//! What values of an error model may be.

use thiserror::Error;

#[derive(Debug, Error)]
pub enum ErrorModelError {
    /// Not TOML, or not these keys; the message shows the place.
    #[error("{0}")]
    Syntax(#[from] toml::de::Error),
    /// A number that TOML does not have.
    #[error("{0}")]
    Unwritable(#[from] toml::ser::Error),
    /// A value that no sensor has.
    #[error("{key} = {value}: expected {expected}")]
    Value {
        /// Dotted path of the key.
        key: String,
        value: f64,
        expected: &'static str,
    },
}

pub(super) fn ensure(
    holds: bool,
    key: &str,
    value: f64,
    expected: &'static str,
) -> Result<(), ErrorModelError> {
    if holds {
        Ok(())
    } else {
        Err(ErrorModelError::Value {
            key: key.to_owned(),
            value,
            expected,
        })
    }
}

pub(super) fn in_order(key: &str, [least, most]: [f64; 2]) -> Result<(), ErrorModelError> {
    ensure(least <= most, key, most, "no less than the first bound")
}

pub(super) fn spread(key: &str, value: f64) -> Result<(), ErrorModelError> {
    let holds = value >= 0.0 && value.is_finite();
    ensure(holds, key, value, "zero or more")
}

pub(super) fn positive(key: &str, value: f64) -> Result<(), ErrorModelError> {
    let holds = value > 0.0 && value.is_finite();
    ensure(holds, key, value, "more than zero")
}

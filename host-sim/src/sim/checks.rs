//! Checks of the values of an error model.

use serde::Serialize;
use thiserror::Error;
use toml::Value;

#[derive(Debug, Error)]
pub enum ErrorModelError {
    /// Not TOML, or not these keys; the message shows the place.
    #[error("{0}")]
    Syntax(#[from] toml::de::Error),
    /// A number that TOML cannot represent.
    #[error("{0}")]
    Unwritable(#[from] toml::ser::Error),
    /// An impossible value.
    #[error("{key} = {value}: expected {expected}")]
    Value {
        /// Dotted path of the key.
        key: String,
        value: f64,
        expected: &'static str,
    },
}

/// Checks every number of an error model, by its key in the file.
pub(super) fn check(model: &impl Serialize) -> Result<(), ErrorModelError> {
    walk("", &Value::try_from(model)?)
}

fn walk(path: &str, value: &Value) -> Result<(), ErrorModelError> {
    match value {
        Value::Table(table) => (table.iter()).try_for_each(|(key, value)| match path {
            "" => walk(key, value),
            _ => walk(&format!("{path}.{key}"), value),
        }),
        Value::Array(all) => {
            (all.iter().enumerate()).try_for_each(|(place, value)| match value {
                Value::Table(_) => walk(path, value),
                _ => walk(&format!("{path}[{place}]"), value),
            })?;
            // Two numbers are bounds.
            match all[..] {
                [Value::Float(least), Value::Float(most)] => {
                    let key = format!("{path}[1]");
                    ensure(least <= most, &key, most, "no less than the first bound")
                }
                _ => Ok(()),
            }
        }
        Value::Float(number) => check_number(path, *number),
        Value::Integer(number) => check_number(path, *number as f64),
        _ => Ok(()),
    }
}

/// Most are sigmas and durations: zero or more.
fn check_number(path: &str, value: f64) -> Result<(), ErrorModelError> {
    let mut names = path
        .rsplit('.')
        .map(|name| name.split('[').next().unwrap_or(name));
    let [name, table] = [names.next(), names.next()].map(Option::unwrap_or_default);
    let (is_valid, expected) = match name {
        "jump_mean" | "float" => (value.is_finite(), "a number"),
        "velocity_mps" | "position_m" if table == "off" => (value.is_finite(), "a number"),
        "lever_arm_m" => (value.abs() <= 100.0, "100 m at most"),
        "clock_drift" => (value.abs() <= 0.01, "s/s, 0.01 at most"),
        "dropped_fraction" => ((0.0..1.0).contains(&value), "0 to below 1"),
        "fraction" => ((0.0..=1.0).contains(&value), "0 to 1"),
        "latency_s" => (value.abs() <= 10.0, "10 s at most"),
        "rate_hz" if value > 1000.0 && value.is_finite() => (false, "1000 at most"),
        "rate_hz" | "gyro_range_deg_s" | "accel_range_mps2" | "warming_s" | "interval_s"
        | "correlation_time_s" | "time_s" | "logged_times" => {
            (value > 0.0 && value.is_finite(), "more than zero")
        }
        _ => (value >= 0.0 && value.is_finite(), "zero or more"),
    };
    ensure(is_valid, path, value, expected)
}

fn ensure(
    is_valid: bool,
    key: &str,
    value: f64,
    expected: &'static str,
) -> Result<(), ErrorModelError> {
    if is_valid {
        Ok(())
    } else {
        Err(ErrorModelError::Value {
            key: key.to_owned(),
            value,
            expected,
        })
    }
}

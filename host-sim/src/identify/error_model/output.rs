//! `error-model.toml`, `error-model.json` and `allan.csv`.

use std::fmt::Write as _;
use std::path::Path;

use miette::{IntoDiagnostic, Result};
use serde::Serialize;

use super::allan::AtRest;
use super::identified::{Identified, Parameter};
use super::interval::Interval;
use crate::page::table::{Table, heads};
use crate::page::{self, digits, output};

/// Name of the model file; marks a folder of several logs as ours.
pub const MODEL: &str = "error-model.toml";
const JSON: &str = "error-model.json";

/// Error model and Allan deviations of the sensors.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<'a> {
    pub model: &'a Identified,
    pub at_rest: &'a AtRest,
}

#[derive(Serialize)]
struct Json {
    drives: usize,
    parameters: Vec<Parameter>,
    gyro_noise_at_rest_deg_h: Option<Interval>,
}

pub fn write(sensors: Sensors, folder: &Path) -> Result<()> {
    let found = sensors.model;
    let json = Json {
        drives: found.drives,
        parameters: found.parameters(),
        gyro_noise_at_rest_deg_h: found.gyro_noise_at_rest(),
    };
    output::write(folder, MODEL, toml(found)?)?;
    output::write(folder, JSON, page::json(&json)?)?;
    sensors.at_rest.write(folder)
}

/// The model, under a comment with the interval of each value.
pub fn toml(found: &Identified) -> Result<String> {
    let mut text = format!(
        "# Error model identified from {} drive{}, for `fly --errors` and `drive --errors`.\n\
         # Value and 95 % interval; then what the drives do not show, and what stands here instead.\n\
         # noise_times are those at rest; below, gyros have that of motion, which adds alike on all axes.\n#\n",
        found.drives,
        if found.drives == 1 { "" } else { "s" },
    );
    let assumed = found.assumed();
    let assumed = assumed.iter().map(|part| part.cells().to_vec());
    let assumed = Table::of("", heads("not shown | assumed |"), assumed);
    let tables = [found.table().plain(), assumed.plain()];
    for line in tables.join("\n").lines() {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "# {line}");
    }
    let model = toml::to_string(&found.model()).into_diagnostic()?;
    Ok(text + "\n" + &model)
}

impl Identified {
    pub fn table(&self) -> Table {
        let row = |parameter: Parameter| {
            let shown = parameter.found.map(|found| {
                let width = 0.3 * (found.high - found.low);
                let scale = if width.is_finite() {
                    width
                } else {
                    0.1 * found.value
                };
                found.each().map(|v| digits(scale, v))
            });
            let [mut value, low, high] = shown.unwrap_or_default();
            if !parameter.observable {
                "-".clone_into(&mut value);
            }
            let texts = [parameter.name, parameter.unit, parameter.why];
            let [name, unit, why] = texts.map(str::to_owned);
            vec![name, value, low, high, unit, why]
        };
        let header = heads("| value | from | to | unit |");
        Table::of("", header, self.parameters().into_iter().map(row))
    }
}

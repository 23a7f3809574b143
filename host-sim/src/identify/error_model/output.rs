//! `error-model.toml`, `error-model.json` and `allan.csv`.

use std::fmt::Write as _;
use std::path::Path;

use miette::{IntoDiagnostic, Result};
use serde::Serialize;

use super::allan::AtRest;
use super::identified::{Identified, Parameter};
use super::interval::Interval;
use crate::page::number::to_second_digit_of;
use crate::page::table::{Table, cells};
use crate::page::{self, output};

/// Name of the model file; marks a folder of several logs as ours.
pub const MODEL: &str = "error-model.toml";
const JSON: &str = "error-model.json";

/// What drives say of their sensors.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<'a> {
    /// The error model.
    pub model: &'a Identified,
    /// Readings at rest.
    pub at_rest: &'a AtRest,
}

#[derive(Serialize)]
struct Json {
    drives: usize,
    parameters: Vec<Parameter>,
    gyro_noise_at_rest_deg_h: Option<Interval>,
}

/// Writes all files into a folder.
pub fn write(sensors: Sensors, folder: &Path) -> Result<()> {
    let Sensors {
        model: found,
        at_rest,
    } = sensors;
    let json = Json {
        drives: found.drives,
        parameters: found.parameters(),
        gyro_noise_at_rest_deg_h: found.gyro_noise_at_rest(),
    };
    output::write(folder, MODEL, toml(found)?)?;
    output::write(folder, JSON, page::json(&json)?)?;
    (at_rest.write(output::create(folder, "allan.csv")?)).into_diagnostic()
}

/// The model, under a comment with what each value stands on.
pub fn toml(found: &Identified) -> Result<String> {
    let mut text = format!(
        "# Error model identified from {} drive{}, for `fly --errors` and `drive --errors`.\n\
         # Value and 95 % interval; then what the drives do not show, and what stands here instead.\n#\n",
        found.drives,
        if found.drives == 1 { "" } else { "s" },
    );
    let assumed = found.assumed();
    let assumed = assumed.iter().map(|part| part.cells().to_vec()).collect();
    let assumed = Table::new("", cells(["not shown", "assumed", ""]), assumed);
    let tables = [found.table().plain(), assumed.plain()];
    for line in tables.join("\n").lines() {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "# {line}");
    }
    let model = toml::to_string(&found.model()).into_diagnostic()?;
    Ok(text + "\n" + &model)
}

impl Identified {
    /// For people.
    pub fn table(&self) -> Table {
        let header = cells(["", "value", "from", "to", "unit", ""]);
        let row = |parameter: Parameter| {
            let cells = parameter.found.map_or_else(Default::default, |found| {
                let width = 0.3 * (found.high - found.low);
                let scale = if width.is_finite() {
                    width
                } else {
                    0.1 * found.value
                };
                [found.value, found.low, found.high].map(|v| to_second_digit_of(scale, v))
            });
            let [value, low, high] = cells;
            let value = if parameter.observable {
                value
            } else {
                "-".to_owned()
            };
            let name = parameter.name.to_owned();
            vec![
                name,
                value,
                low,
                high,
                parameter.unit.to_owned(),
                parameter.why.to_owned(),
            ]
        };
        Table::new("", header, self.parameters().into_iter().map(row).collect())
    }
}

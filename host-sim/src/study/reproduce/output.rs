//! `reproduce.json`, `report.html`, a drawing and a table of data for each part.

use std::path::Path;

use miette::{IntoDiagnostic, Result};
use serde::Serialize;

use super::{Number, Part, Reproduction};
use crate::page::digits;
use crate::page::html::fill;
use crate::page::output;
use crate::page::table::{Table, heads};

/// Name of the file that marks the folder as ours.
pub const JSON: &str = "reproduce.json";

/// A part as the page shows it.
#[derive(Serialize)]
struct Shown<'a> {
    name: &'a str,
    title: &'a str,
    how: &'a str,
    svg: Option<&'a str>,
    rows: Vec<[String; 4]>,
}

impl<'a> Shown<'a> {
    fn new(part: &'a Part) -> Self {
        Self {
            name: part.name,
            title: &part.title,
            how: &part.how,
            svg: part.svg.as_deref(),
            rows: part.numbers.iter().map(row).collect(),
        }
    }
}

impl Reproduction {
    /// Writes all files into a folder.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let json = serde_json::to_string_pretty(self).into_diagnostic()?;
        let mut files = vec![
            (JSON.to_owned(), json + "\n"),
            ("report.html".to_owned(), self.html().into_diagnostic()?),
        ];
        for part in &self.parts {
            files.push((format!("{}.csv", part.name), part.csv.clone()));
            files.extend(
                part.svg
                    .clone()
                    .map(|svg| (format!("{}.svg", part.name), svg)),
            );
        }
        for (name, text) in files {
            output::write(folder, &name, text)?;
        }
        Ok(())
    }

    fn html(&self) -> Result<String, minijinja::Error> {
        #[derive(Serialize)]
        struct Page<'a> {
            reproduction: &'a Reproduction,
            parts: Vec<Shown<'a>>,
        }
        let page = Page {
            reproduction: self,
            parts: self.parts.iter().map(Shown::new).collect(),
        };
        fill(include_str!("report.html"), &page)
    }

    /// All numbers.
    fn table(&self) -> Table {
        let rows = self.parts.iter().flat_map(|part| {
            let source = part.title.split(':').next().unwrap_or_default();
            part.numbers.iter().map(move |number| {
                let mut cells = vec![source.to_owned()];
                cells.extend(row(number));
                cells
            })
        });
        let header = heads("of the thesis | what | thesis | ours | ratio");
        Table::new("", header, rows.collect())
    }
}

fn row(number: &Number) -> [String; 4] {
    let shown = |value: Option<f64>| value.map_or(String::new(), |value| digits(value, value));
    [
        number.what.clone(),
        number
            .thesis
            .map_or(String::new(), |value| value.to_string()),
        shown(Some(number.ours)),
        shown(number.ratio),
    ]
}

/// For docs/thesis.md.
pub fn markdown(reproduction: &Reproduction) -> String {
    reproduction.table().markdown()
}

/// For a terminal.
pub(crate) fn plain(reproduction: &Reproduction) -> String {
    let mut text = reproduction.table().plain();
    text.extend(
        (reproduction.not_reproduced.iter())
            .map(|missing| format!("\nNot reproduced: {}: {}.\n", missing.what, missing.why)),
    );
    text
}

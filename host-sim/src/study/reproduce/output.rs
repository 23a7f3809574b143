//! `reproduce.json`, `report.html`, a drawing and a table of data for each part.

use std::path::Path;

use miette::{IntoDiagnostic, Result};
use serde::Serialize;

use super::{Number, Part, Reproduction};
use crate::page::html::fill;
use crate::page::table::{Table, heads};
use crate::page::{self, brief, output};

/// Name of the file that marks the folder as ours.
pub const JSON: &str = "reproduce.json";

/// A part as the page shows it.
#[derive(Serialize)]
struct Shown<'a> {
    #[serde(flatten)]
    part: &'a Part,
    svg: Option<&'a str>,
    rows: Vec<[String; 4]>,
}

impl Reproduction {
    /// Writes all files into a folder.
    pub fn write(&self, folder: &Path) -> Result<()> {
        output::write(folder, JSON, page::json(self)?)?;
        output::write(folder, "report.html", self.html().into_diagnostic()?)?;
        for Part { name, csv, svg, .. } in &self.parts {
            output::write(folder, &format!("{name}.csv"), csv)?;
            if let Some(svg) = svg {
                output::write(folder, &format!("{name}.svg"), svg)?;
            }
        }
        Ok(())
    }

    fn html(&self) -> Result<String, minijinja::Error> {
        #[derive(Serialize)]
        struct Page<'a> {
            reproduction: &'a Reproduction,
            parts: Vec<Shown<'a>>,
        }
        let parts = self.parts.iter().map(|part| Shown {
            part,
            svg: part.svg.as_deref(),
            rows: part.numbers.iter().map(row).collect(),
        });
        let page = Page {
            reproduction: self,
            parts: parts.collect(),
        };
        fill(include_str!("report.html"), &page)
    }

    /// All numbers.
    fn table(&self) -> Table {
        let rows = self.parts.iter().flat_map(|part| {
            let source = part.title.split(':').next().unwrap_or_default();
            let cells = |number| [&[source.to_owned()][..], &row(number)].concat();
            part.numbers.iter().map(cells)
        });
        let header = heads("of the thesis | what | thesis | ours | ratio");
        Table::of("", header, rows)
    }
}

fn row(number: &Number) -> [String; 4] {
    let thesis = number.thesis.map(|value| value.to_string());
    [
        number.what.clone(),
        thesis.unwrap_or_default(),
        brief(number.ours),
        number.ratio.map_or(String::new(), brief),
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

//! One self-contained page that works without a network.

use std::error::Error as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use miette::{IntoDiagnostic, Result};
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;

use super::chart::{Figure, SCRIPT};
use super::output::OutputError;
use super::table::Table;

/// File name of a page in a folder of results.
pub(crate) const REPORT: &str = "report.html";

const TEMPLATE: &str = include_str!("report.html");
const STYLE: &str = include_str!("style.css");

/// What a page shows: first what is to be known before all, then numbers, then plots.
#[derive(Default, Serialize)]
pub(crate) struct Page {
    pub(crate) title: String,
    pub(crate) facts: String,
    pub(crate) verdicts: Vec<String>,
    pub(crate) tables: Vec<Table>,
    pub(crate) sections: Vec<Section>,
}

#[derive(Serialize)]
pub(crate) struct Section {
    pub(crate) title: &'static str,
    pub(crate) note: &'static str,
    pub(crate) figures: Vec<Figure>,
}

impl Page {
    /// What the template is filled with: its plots are megabytes, which are not held more often than they must
    /// be.
    fn context(self) -> Value {
        let page = Value::from(Serde(&self));
        context! { page, script => SCRIPT.as_str() }
    }

    pub(crate) fn html(self) -> Result<String> {
        fill(TEMPLATE, self.context())
    }

    /// Writes it into a folder, piece by piece.
    pub(crate) fn write(self, folder: &Path) -> Result<()> {
        let path = folder.join(REPORT);
        let failed = |e| OutputError::io(&path, e);
        let mut file = BufWriter::new(File::create(&path).map_err(failed)?);
        let environment = environment()?;
        let template = environment.template_from_str(TEMPLATE).into_diagnostic()?;
        // What fails of our own template is the file.
        let cause = |e: &minijinja::Error| e.source().map_or(e.to_string(), ToString::to_string);
        template
            .render_captured_to(self.context(), &mut file)
            .map_err(|e| failed(io::Error::other(cause(&e))))?;
        Ok(file.flush().map_err(failed)?)
    }
}

fn environment() -> Result<Environment<'static>> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    (environment.add_template("style", STYLE)).into_diagnostic()?;
    Ok(environment)
}

/// A template that may include the style, filled.
pub(crate) fn fill(template: &str, with: Value) -> Result<String> {
    environment()?.render_str(template, with).into_diagnostic()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk is told with the file, as of any other result.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_told_with_the_file() {
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("/dev/full", folder.path().join(REPORT)).unwrap();
        let error = Page::default()
            .write(folder.path())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(REPORT) && error.contains("No space left"),
            "{error}"
        );
    }
}

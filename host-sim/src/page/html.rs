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

/// Contents of a page: facts and verdicts, then tables, then plots.
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
    /// Context of the template. Its plots are megabytes, so copies are avoided.
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
        // The template is valid: only the file can fail.
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

/// Renders a template, which may include the style.
pub(crate) fn fill(template: &str, with: Value) -> Result<String> {
    environment()?.render_str(template, with).into_diagnostic()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error of a full disk names the file.
    #[cfg(target_os = "linux")]
    #[test]
    fn the_error_of_a_full_disk_names_the_file() {
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

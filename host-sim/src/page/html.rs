//! One self-contained page that works without a network.

use miette::{IntoDiagnostic, Result};
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;

use super::chart::{Figure, SCRIPT};
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
    pub(crate) fn html(&self) -> Result<String> {
        let page = Value::from(Serde(self));
        fill(TEMPLATE, context! { page, script => SCRIPT.as_str() })
    }
}

/// A template that may include the style, filled.
pub(crate) fn fill(template: &str, with: Value) -> Result<String> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    (environment.add_template("style", STYLE))
        .and_then(|()| environment.render_str(template, with))
        .into_diagnostic()
}

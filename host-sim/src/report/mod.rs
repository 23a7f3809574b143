//! `report.html`: one self-contained page that works without a network.

pub(crate) mod chart;
pub(crate) mod charts;
pub(crate) mod number;
pub(crate) mod plot;
pub(crate) mod results;
pub(crate) mod sheet;
mod together;
pub(crate) mod words;

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment};
use serde::Serialize;

pub(crate) use number::to_second_digit_of as digits;
pub(crate) use words::{in_words, unaligned, with_sigma};

use self::chart::Figure;
use self::results::Table;
use crate::analysis::Analysis;
use crate::error_model::Identified;
use crate::error_model::allan::AtRest;
use crate::summary::Summary;

const TEMPLATE: &str = include_str!("report.html");
/// How pages look.
pub(crate) const STYLE: &str = include_str!("style.css");

/// What drives say of their sensors.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<'a> {
    /// The error model.
    pub model: &'a Identified,
    /// Readings at rest.
    pub at_rest: &'a AtRest,
}

/// What a page shows: first what is to be known before all, then numbers, then plots.
#[derive(Default, Serialize)]
pub(crate) struct Page {
    pub(crate) title: String,
    pub(crate) facts: String,
    pub(crate) verdicts: Vec<String>,
    pub(crate) tables: Vec<Table>,
    pub(crate) sections: Vec<Section>,
}

/// Plots of one kind.
#[derive(Serialize)]
pub(crate) struct Section {
    pub(crate) title: &'static str,
    pub(crate) note: &'static str,
    pub(crate) figures: Vec<Figure>,
}

impl Page {
    /// The page, as text.
    pub(crate) fn html(&self) -> Result<String, minijinja::Error> {
        #[derive(Serialize)]
        struct Filled<'a> {
            page: &'a Page,
            script: &'a str,
        }
        let mut environment = Environment::new();
        environment.set_auto_escape_callback(|_| AutoEscape::Html);
        environment.add_template("style", STYLE)?;
        environment.add_template("report", TEMPLATE)?;
        let template = environment.get_template("report")?;
        template.render(Serde(&Filled {
            page: self,
            script: &chart::SCRIPT,
        }))
    }
}

/// The report of a log.
pub fn html(analysis: &Analysis, sensors: Option<&Sensors>) -> Result<String, minijinja::Error> {
    let summary = &analysis.summary;
    let page = Page {
        title: summary.log.clone(),
        facts: format!(
            "{:.1} min \u{b7} body axes {} \u{b7} sensor class {} \u{b7} {} inertial samples, {} \
             fixes used \u{b7} host-sim {}",
            summary.duration_s / 60.0,
            summary.body_axes,
            summary.grade.name(),
            summary.imu.accepted,
            summary.gnss.accepted,
            summary.version
        ),
        verdicts: results::verdicts(analysis),
        tables: results::tables(analysis, sensors),
        sections: charts::sections(analysis, sensors),
    };
    page.html()
}

/// The report of several logs of one unit.
pub fn html_of_all(logs: &[Summary], sensors: &Sensors) -> Result<String, minijinja::Error> {
    together::page(logs, sensors).html()
}

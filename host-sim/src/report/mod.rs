//! `report.html`: one self-contained page that works without a network.

pub(crate) mod number;
pub(crate) mod panels;
pub(crate) mod plot;
mod sentences;
pub(crate) mod sheet;

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment};
use serde::Serialize;

pub(crate) use number::to_second_digit_of as digits;
pub use sentences::sentences;
pub(crate) use sentences::{in_words, unaligned, with_sigma};

use self::panels::Panel;
use crate::identify::Identification;
use crate::log::Log;
use crate::summary::Summary;
use crate::truth::Truth;

const TEMPLATE: &str = include_str!("report.html");
/// Parts that pages share.
pub(crate) const STYLE: &str = include_str!("style.css");
pub(crate) const PANEL: &str = include_str!("panel.html");

/// What the template shows.
#[derive(Serialize)]
struct Page<'a> {
    summary: &'a Summary,
    minutes: String,
    sentences: Vec<String>,
    verdict: String,
    estimates: Vec<Panel>,
    velocity: Option<Panel>,
    against_truth: Vec<Panel>,
    truth_verdict: Option<String>,
    track: Option<Panel>,
    damping: Vec<Panel>,
}

/// The page, as text.
pub fn html(
    log: &Log,
    found: &Identification,
    summary: &Summary,
    truth: Option<&Truth>,
) -> Result<String, minijinja::Error> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template("style", STYLE)?;
    environment.add_template("panel", PANEL)?;
    environment.add_template("report", TEMPLATE)?;
    let page = Page {
        summary,
        minutes: format!("{:.1}", summary.duration_s / 60.0),
        sentences: sentences(summary, found),
        verdict: sentences::verdict(summary),
        estimates: panels::estimates(log, found, truth, panels::SMALL),
        velocity: panels::velocity_error(found),
        against_truth: panels::against_truth(found),
        truth_verdict: summary.against_truth.as_ref().map(sentences::against_truth),
        track: panels::track(log, found),
        damping: panels::damping(found),
    };
    environment.get_template("report")?.render(Serde(&page))
}

/// The estimates converging, as one drawing.
pub fn estimates_svg(log: &Log, found: &Identification, truth: Option<&Truth>) -> String {
    sheet::svg(&panels::estimates(log, found, truth, sheet::CELL))
}

//! The command `identify`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{Result, bail};

use super::options::{Class, Output, build, identified, refuse_same, report_line};
use crate::identify::analysis::{Analysis, DistinctLogs, SUMMARY};
use crate::identify::error_model::allan::AtRest;
use crate::identify::error_model::{self, Identified, Record, Sensors};
use crate::identify::summary::Summary;
use crate::log::Grade;
use crate::page::output::{self, OutputError};
use crate::page::progress::spinner;
use crate::report;
use crate::sim::errors::Law;

#[derive(Debug, Args)]
pub(super) struct Identify {
    /// Folder of a log, or a recording of a known format. Several: drives of one kind of unit, for one error model of all.
    #[arg(required = true)]
    log: Vec<PathBuf>,
    #[command(flatten)]
    class: Class,
    /// How gyro biases move; else the likelier of the two.
    #[arg(long, value_enum)]
    bias_model: Option<Law>,
    #[command(flatten)]
    output: Output,
}

/// Identifies a log, or several.
pub(super) fn identify(options: &Identify) -> Result<()> {
    let (grade, law) = (options.class.grade, options.bias_model);
    if let [log] = options.log.as_slice() {
        let Output { out, print, force } = &options.output;
        let (analysis, model) = identify_log(log, out, grade, law, *force)?;
        let text = || text_of(&analysis, Some(&model), out);
        print.result(&analysis.summary, text)
    } else {
        identify_logs(options, grade, law)
    }
}

/// File that marks a folder of results as ours: of one log, or of several.
fn mark(out: &Path) -> &'static str {
    let of_one = out.join(SUMMARY).is_file();
    if of_one { SUMMARY } else { error_model::MODEL }
}

pub(super) fn identify_log(
    folder: &Path,
    out: &Path,
    grade: Option<Grade>,
    law: Option<Law>,
    force: bool,
) -> Result<(Analysis, Identified)> {
    output::check_free(out, mark(out), force)?;
    refuse_same(folder, out)?;
    let analysis = identified(folder, grade)?;
    let records = [Record::new(&analysis.log, &analysis.found)];
    let model = error_model_of(&records, analysis.summary.grade, law);
    build(out, mark(out), force, |folder| {
        write(&analysis, &records, &model, folder)
    })?;
    Ok((analysis, model))
}

/// The report of a log, and its error model.
fn write(analysis: &Analysis, records: &[Record], model: &Identified, folder: &Path) -> Result<()> {
    let at_rest = &AtRest::new(records);
    let sensors = Sensors { model, at_rest };
    report::write(analysis, Some(&sensors), folder)?;
    error_model::write(sensors, folder)
}

pub(super) fn error_model_of(records: &[Record], grade: Grade, law: Option<Law>) -> Identified {
    let progress = spinner("fitting the error model");
    let model = Identified::new(records, grade, law);
    progress.finish_and_clear();
    model
}

/// A folder for each log, and the error model of all beside them.
fn identify_logs(options: &Identify, grade: Option<Grade>, law: Option<Law>) -> Result<()> {
    let (out, print) = (&options.output.out, options.output.print);
    options.output.check(mark(out))?;
    for log in &options.log {
        refuse_same(log, out)?;
    }
    let fill = |folder: &Path| -> Result<(Identified, Vec<Summary>)> {
        let (mut records, mut summaries, mut class) = (Vec::new(), Vec::new(), grade);
        let mut given = DistinctLogs::default();
        for (number, log) in (1..).zip(&options.log) {
            // One log at a time: only the record for the error model is kept.
            let analysis = identified(log, grade)?;
            let this = analysis.summary.grade;
            if *class.get_or_insert(this) != this {
                bail!(
                    help = "identify them apart, or say --grade",
                    "{}: another class of sensors than the logs before",
                    log.display()
                );
            }
            given.take(log, &analysis.log)?;
            let record = Record::new(&analysis.log, &analysis.found);
            let name = analysis.summary.log.replace(['/', '\\'], "-");
            let nested = folder.join(format!("{number}-{name}"));
            fs::create_dir(&nested).map_err(|e| OutputError::io(&nested, e))?;
            let own = [record];
            write(&analysis, &own, &error_model_of(&own, this, law), &nested)?;
            records.extend(own);
            summaries.push(analysis.summary);
        }
        let found = error_model_of(&records, class.unwrap_or(Grade::Mems), law);
        let sensors = Sensors {
            model: &found,
            at_rest: &AtRest::new(&records),
        };
        error_model::write(sensors, folder)?;
        let page = report::together::page(&summaries, &sensors);
        page.write(folder)?;
        Ok((found, summaries))
    };
    let (model, summaries) = options.output.fill(mark(out), fill)?;
    print.result(&summaries, || {
        let text = (summaries.iter()).flat_map(|one| one.verdict.lines_of(&one.log));
        let text = text.collect::<Vec<_>>().join("\n");
        format!(
            "{text}\n\n{}{}",
            model_in_words(&model, out),
            report_line(out)
        )
    })
}

fn model_in_words(model: &Identified, out: &Path) -> String {
    let file = out.join(error_model::MODEL);
    format!(
        "{}\nError model: {}\n",
        model.table().plain(),
        file.display()
    )
}

/// Results as text, and where they are written.
pub(super) fn text_of(analysis: &Analysis, model: Option<&Identified>, out: &Path) -> String {
    let summary = &analysis.summary;
    let error = &summary.velocity_error_mps;
    let free = error.before.zip(error.after).map(|(before, after)| {
        format!(
            "\nFree-inertial velocity error over a minute: {before:.3} m/s before, {after:.3} m/s after\n"
        )
    });
    let model = model.map(|model| format!("\n{}", model_in_words(model, out)));
    [
        summary.verdict.lines().join("\n") + "\n\n",
        analysis.table().plain(),
        free.unwrap_or_default(),
        model.unwrap_or_default(),
        report_line(out),
    ]
    .concat()
}

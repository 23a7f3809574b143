//! Tables of many seeded drives.

use std::path::Path;

use ins_core::config::Form;
use miette::{Result, miette};

use crate::page::brief;
use crate::page::progress::bar;
use crate::page::table::{Table, heads};
use crate::sim::Grade;
use crate::study::accuracy::{Results, Spared, Study, picture};

fn results(study: Study) -> Result<Results> {
    study
        .results(&bar().with_message("driving"))
        .map_err(|error| miette!("the study cannot be run: {}", error))
}

/// Ring-laser class, with the picture of RMS error and sigma over time.
pub(super) fn hg1700(root: &Path, runs: u64) -> Result<String> {
    let results = results(Study::new(Grade::Hg1700, runs))?;
    super::pages::picture(root, "accuracy.svg", &picture(&results))?;
    Ok(of_all(&results))
}

/// Consumer MEMS.
pub(super) fn mems(runs: u64) -> Result<String> {
    results(Study::new(Grade::Mems, runs)).map(|results| of_all(&results))
}

fn of_all(results: &Results) -> String {
    let study = &results.study;
    let mut table = results.table();
    if !study.has_limits() {
        // Limit and goal stand last.
        let rows = table.rows.iter_mut();
        rows.chain([&mut table.header])
            .for_each(|row| row.truncate(5));
    }
    format!(
        "{}\n{} drives of {} min; {} converged. Of honest errors {:.0} +- {:.0} % lie within one \
         sigma (95 times out of 100).\n",
        table.markdown(),
        study.runs,
        study.minutes,
        results.converged,
        68,
        results.coverage_spread_percent(),
    )
}

/// RMS errors of both forms over the bandwidth of the horizontal loop.
pub(super) fn forms(runs: u64) -> Result<String> {
    let exact = [0.15, 0.3, 0.5, 1.0, 1.2].as_slice();
    let forms = [
        ("exact", Spared::Nothing, exact),
        ("literal", Spared::Nothing, &[0.3, 0.5, 1.0]),
        ("literal, gyros without biases", Spared::GyroBiases, &[0.5]),
        (
            "... nor accelerometers, nor latency",
            Spared::Biases,
            &[0.5],
        ),
        (
            "... and a hundredth of the velocity noise",
            Spared::VelocityNoise,
            &[0.5],
        ),
    ];
    let mut rows = Vec::new();
    let mut header = heads("form | w0, rad/s | converged");
    for (name, spared, bandwidths) in forms {
        let form = if name == "exact" {
            Form::Exact
        } else {
            Form::Literal
        };
        for bandwidth in bandwidths {
            let results = results(Study {
                form,
                spared,
                bandwidth_radps: Some(*bandwidth),
                ..Study::new(Grade::Hg1700, runs)
            })?;
            let of = format!("{} of {runs}", results.converged);
            let mut row = vec![name.to_owned(), bandwidth.to_string(), of];
            row.extend((results.quantities.iter()).map(|row| brief(row.rms_error)));
            rows.push(row);
            if header.len() < rows[0].len() {
                header.extend(results.quantities.iter().map(|row| row.quantity.head()));
            }
        }
    }
    Ok(Table::of("", header, rows).markdown())
}

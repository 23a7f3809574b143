//! Recorded logs.

use std::env;
use std::path::{Path, PathBuf};

use miette::Result;

use crate::identify::analysis::Analysis;
use crate::identify::quantities::Quantity;
use crate::identify::words::with_sigma;
use crate::page::brief;
use crate::page::progress::bar;
use crate::page::table::{Table, heads};
use crate::study;

/// What every recorded log gives; `None` if there are none.
pub(super) fn part(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    let logs = found(root, folder);
    if logs.is_empty() {
        return Ok(None);
    }
    let row = |log: &PathBuf| Ok(row(&Analysis::of_log(log, None, &bar())?));
    let rows: Vec<_> = logs.iter().map(row).collect::<Result<_>>()?;
    let header = heads(
        "log | length, s | azimuth error, deg | accelerometer x, mg | accelerometer y, mg \
         | gyro z, deg/h | latency, ms | before, m/s | after, m/s | times less",
    );
    Ok(Some(Table::of("", header, rows).markdown()))
}

/// What is found in every recording of another program, and in every recorded log, without a
/// hand's help; `None` without recordings.
pub(super) fn recordings(
    root: &Path,
    folder: Option<&Path>,
    logs: Option<&Path>,
) -> Option<String> {
    let folder = folder.map_or_else(|| root.join("../shared/formats"), Path::to_owned);
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    if paths.is_empty() {
        eprintln!(
            "no recordings in {}: their table stays as it was (--recordings)",
            folder.display()
        );
        return None;
    }
    paths.sort();
    paths.extend(found(root, logs));
    let rows: Vec<_> = (paths.iter())
        .flat_map(|path| study::recordings::recordings(path, None))
        .collect();
    Some(study::recordings::table(&rows).markdown())
}

/// The recorded logs, in order of their names; says so if there are none.
pub(super) fn found(root: &Path, folder: Option<&Path>) -> Vec<PathBuf> {
    let default = || env::var_os("INS_LOGS").map_or(root.join("../shared/data"), PathBuf::from);
    let folder = folder.map_or_else(default, Path::to_owned);
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut logs: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.join("meta.toml").is_file())
        .collect();
    logs.sort();
    if logs.is_empty() {
        eprintln!(
            "no recorded logs in {}: their table stays as it was (--logs, INS_LOGS)",
            folder.display()
        );
    }
    logs
}

fn row(analysis: &Analysis) -> Vec<String> {
    let summary = &analysis.summary;
    let quantities = &summary.quantities;
    let known = |quantity: &Quantity| {
        if quantity.observable() {
            with_sigma(quantity)
        } else {
            "not observable".to_owned()
        }
    };
    let error = &summary.velocity_error_mps;
    let number = |value: Option<f64>| value.map_or("-".to_owned(), brief);
    let both = error.before.zip(error.after);
    let less = both.map(|(before, after)| before / after);
    vec![
        summary.log.clone(),
        format!("{:.0}", summary.duration_s),
        known(&quantities.azimuth_error_deg),
        known(&quantities.accel_bias_mg.x),
        known(&quantities.accel_bias_mg.y),
        known(&quantities.gyro_bias_deg_h.z),
        known(&quantities.gnss_latency_ms),
        number(error.before),
        number(error.after),
        number(less),
    ]
}

//! The command `import`.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, Result};
use serde::Serialize;

use super::options::{Output, print_warnings};
use crate::log::import::{Choice, read};
use crate::log::{Compression, LogError, write};
use crate::page::output;

/// File that marks a folder as ours.
const MARK: &str = "import.toml";

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder of the log")))]
pub struct Import {
    /// A recording, or one of inertial sensors and one of GNSS.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    output: Output,
}

/// Summary of the import, as printed and written beside the log.
#[derive(Serialize)]
struct Imported<'a> {
    files: &'a [PathBuf],
    source: Option<&'a str>,
    duration_s: f64,
    imu_samples: usize,
    gnss_fixes: usize,
    warnings: Vec<String>,
}

pub fn import(options: &Import) -> Result<()> {
    options.output.check(MARK)?;
    let (log, warnings) = read(&options.files, options.choice)?;
    print_warnings(&warnings);
    let source = log.meta.document.get("source");
    let imported = Imported {
        files: &options.files,
        source: source.and_then(toml::Value::as_str),
        duration_s: log.duration_s(),
        imu_samples: log.imu.len(),
        gnss_fixes: log.gnss.len(),
        warnings: warnings.iter().map(LogError::in_a_line).collect(),
    };
    let text = toml::to_string(&imported).into_diagnostic()?;
    options.output.fill(MARK, |folder| {
        write(&log, folder, Compression::Gzip)?;
        Ok(output::write(folder, MARK, text)?)
    })?;
    options.output.print.result(&imported, || {
        format!(
            "Log of {:.1} s, {} samples and {} fixes written to {}\n",
            imported.duration_s,
            imported.imu_samples,
            imported.gnss_fixes,
            options.output.out.display()
        )
    })
}

//! The command `study noise`.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, Result, miette};
use serde::Serialize;

use super::logs::role::name_of;
use crate::cli::spinner;
use crate::configure;
use crate::kalman::Noise;
use crate::log;
use crate::noise_fit::{Found, PARAMETERS, fit};
use crate::report::digits;
use crate::table::{self, cells};

/// Options of `study noise`.
#[derive(Debug, Args)]
pub struct Noises {
    /// Folders of recorded logs.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
}

#[derive(Serialize)]
struct LogNoise {
    log: String,
    /// Logarithm of how much likelier the log is than under the noise told.
    gain: f64,
    found: Vec<Found>,
}

/// Finds the noise of one log after the other; each takes all cores.
pub fn noises(options: &Noises, json: bool) -> Result<()> {
    let mut all = Vec::new();
    for folder in &options.logs {
        let progress = spinner("finding the noise");
        let (log, _) = log::read(folder)?;
        let config = configure::config(&log, configure::grade(&log, None));
        let fit = fit(&log, config, Noise::of_config(&config), &PARAMETERS)
            .map_err(|error| miette!("cannot be used: {}", error.0))?;
        progress.finish_and_clear();
        let found = LogNoise {
            log: name_of(folder),
            gain: fit.gain,
            found: fit.found,
        };
        if !json {
            println!("{}", plain(&found));
        }
        all.push(found);
    }
    if json {
        println!("{}", serde_json::to_string_pretty(&all).into_diagnostic()?);
    }
    Ok(())
}

fn plain(log: &LogNoise) -> String {
    let header = cells(["", "told", "found", "+- %"]);
    let rows: Vec<Vec<String>> = log
        .found
        .iter()
        .map(|found| {
            let spread = if found.log_sigma.is_finite() {
                format!("{:.0}", 100.0 * found.log_sigma)
            } else {
                "not told by this log".to_owned()
            };
            vec![
                found.name.to_owned(),
                digits(0.1 * found.told, found.told),
                digits(0.1 * found.value, found.value),
                spread,
            ]
        })
        .collect();
    let title = format!("{}: log-likelihood +{:.0}", log.log, log.gain);
    format!("{title}\n{}", table::plain(&header, &rows))
}

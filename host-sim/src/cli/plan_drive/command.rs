//! The command `plan-drive`.

use std::path::{Path, PathBuf};

use clap::Args;
use ins_core::Navigator;
use miette::{Result, WrapErr, miette};

use super::output::{PLAN, Report};
use super::{Bench, Driver, Plan, Search, Target, UNITS};
use crate::cli::identify::error_model_of;
use crate::cli::options::{Out, refuse_same, show};
use crate::identify::analysis::{Analysis, unusable};
use crate::identify::error_model::Record;
use crate::identify::run::in_order_of_time;
use crate::log::BodyAxes;
use crate::page::progress::{bar, spinner};
use crate::rehearse::settings::rate_hz;

/// Options of `plan-drive`.
#[derive(Debug, Args)]
pub struct PlanDrive {
    /// What is wanted, of which unit, and what the site allows, TOML.
    #[arg(long)]
    target: PathBuf,
    /// A drive: folder of a log, or a recording of a known format. What it lacks is added to it.
    log: Option<PathBuf>,
    /// Folder for the plan as text, page, drawn route and JSON.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Fixes the noise of the simulated drive.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Plans a drive, or what to add to one.
pub fn plan_drive(options: &PlanDrive, json: bool, force: bool) -> Result<()> {
    let out = Out::new(options.out.as_deref(), PLAN, force)?;
    let target = Target::read(&options.target)?;
    let (plan, log) = match &options.log {
        None => (target.plan(options.seed)?, None),
        Some(log) => {
            if let Some(out) = &options.out {
                refuse_same(log, out)?;
            }
            let (plan, about) = target.added_to(log, options.seed)?;
            (plan, Some(about))
        }
    };
    let report = Report::new(&plan, &target.site, log);
    out.fill(|folder| report.write(folder))?;
    show(json, &report, || {
        let page = options.out.as_ref().map(|out| out.join("report.html"));
        let written = page.map(|page| format!("\nReport: {}\n", page.display()));
        report.readable() + &written.unwrap_or_default()
    })
}

impl Target {
    /// The drive from the start.
    pub fn plan(&self, seed: u64) -> Result<Plan> {
        let model = self.error_model()?;
        let config = self.config(&model)?;
        let start = drives(seed, |seed, driver| {
            Bench::switched_on(self, &model, config, seed, driver)
        })?;
        let search = self.search(self.unit.body_axes);
        Ok(search.plan(start, &spinner("planning")))
    }

    fn search(&self, axes: BodyAxes) -> Search<'_> {
        Search {
            goals: &self.goals,
            site: &self.site,
            axes,
        }
    }

    /// What a log lacks; its name, and what speaks against it.
    fn added_to(&self, path: &Path, seed: u64) -> Result<(Plan, (String, Vec<String>))> {
        let analysis = Analysis::of_log(path, self.unit.class, &bar())?;
        let log = &analysis.log;
        let config = self.with_config(&analysis.found.config)?;
        let mut navigator = Navigator::new(config).map_err(unusable)?;
        for event in in_order_of_time(&log.imu, &log.gnss) {
            event.give_to(&mut navigator);
        }
        let records = [Record::new(log, &analysis.found)];
        let mut model = error_model_of(&records, analysis.summary.grade, None).model();
        model.imu.output = log.meta.imu;
        let model = self
            .with_errors(&model)
            .map_err(|error| miette!("[errors]: {error}"))?;
        let start = drives(seed, |seed, driver| {
            Bench::after(
                (navigator.clone(), log.duration_s()),
                &model,
                rate_hz(log),
                seed,
                driver,
            )
        });
        let start = start.wrap_err_with(|| path.display().to_string())?;
        let search = self.search(log.meta.body_axes);
        let plan = search.plan(start, &spinner("planning"));
        let name = analysis.summary.log.clone();
        Ok((plan, (name, analysis.summary.verdict.lines())))
    }
}

/// One that drives exactly, and others.
fn drives(seed: u64, drive: impl Fn(u64, Driver) -> Result<Bench>) -> Result<Vec<Bench>> {
    let driver = |unit| match unit {
        0 => Driver::exact(),
        _ => Driver::human(seed.wrapping_add(unit)),
    };
    let units = 0..UNITS;
    units
        .map(|unit| drive(seed.wrapping_add(unit), driver(unit)))
        .collect()
}

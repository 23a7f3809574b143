//! Where a plan begins: switched on, or at the end of a log.

use indicatif::ProgressBar;
use ins_core::Navigator;
use miette::Result;

use super::{Bench, Driver, Plan, Search, Target, UNITS};
use crate::identify::analysis::{Analysis, unusable};
use crate::identify::run::in_order_of_time;
use crate::log::{BodyAxes, Log};
use crate::sim::ErrorModel;

impl Target {
    /// The drive from the start.
    pub fn plan(&self, seed: u64, progress: &ProgressBar) -> Result<Plan> {
        let model = self.error_model()?;
        let config = self.config(&model)?;
        let start = drives(seed, |seed, driver| {
            Bench::switched_on(self, &model, config, seed, driver)
        })?;
        Ok(self.search(self.unit.body_axes).plan(start, progress))
    }

    fn search(&self, axes: BodyAxes) -> Search<'_> {
        Search {
            goals: &self.goals,
            site: &self.site,
            axes,
        }
    }

    /// The core at the end of a log, with what `[config]` says.
    pub fn navigator_after(&self, analysis: &Analysis) -> Result<Navigator> {
        let config = self.with_config(&analysis.found.config)?;
        let mut navigator = Navigator::new(config).map_err(unusable)?;
        for event in in_order_of_time(analysis.log.imu.iter(), &analysis.log.gnss) {
            event.give_to(&mut navigator);
        }
        Ok(navigator)
    }

    /// What a log lacks at whose end the core is, of a unit of that model.
    pub fn added_to(
        &self,
        log: &Log,
        navigator: &Navigator,
        model: &ErrorModel,
        seed: u64,
        progress: &ProgressBar,
    ) -> Result<Plan> {
        let (duration_s, imu_hz) = (log.duration_s(), log.imu_rate_hz());
        let start = drives(seed, |seed, driver| {
            let so_far = (navigator.clone(), duration_s);
            Bench::after(so_far, model, imu_hz, seed, driver)
        })?;
        Ok(self.search(log.meta.body_axes).plan(start, progress))
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

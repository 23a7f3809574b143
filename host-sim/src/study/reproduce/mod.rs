//! The thesis's figures and tables from simulation, with its numbers and ours.

mod against_kalman;
mod drive;
mod flight;
mod laboratory;
mod observable;
mod part;
mod velocity;

use miette::{Result, miette};
use rayon::prelude::*;

use crate::sim::ErrorModel;
use crate::study::flights::route::Route;
pub use against_kalman::Recorded;
use drive::Drive;
pub use flight::{PerformanceRow, performance};
use part::NOT_REPRODUCED;
pub use part::{JSON, Number, Part, Reproduction, Settings};

/// Simulates and evaluates everything, and the figures that a recorded drive permits, if given; the results
/// do not depend on the number of threads.
pub fn reproduce(settings: Settings, recorded: Option<&Recorded>) -> Result<Reproduction> {
    // First, since it may be unusable, and the rest takes minutes.
    let on_recorded = recorded.map(against_kalman::recorded).transpose()?;
    let unusable = |error: ins_core::ConfigError| miette!("{}", error);
    let drives = (settings.seeds(settings.drives).into_par_iter())
        .map(|seed| Drive::new(seed, settings.minutes))
        .collect::<Result<Vec<Drive>, _>>()
        .map_err(unusable)?;
    let Some(first) = drives.first() else {
        return Err(miette!("at least one drive"));
    };
    let route = Route::cessna172()?;
    let mut parts = vec![
        observable::figure_1(first),
        against_kalman::figures_3_and_4(&drives).map_err(unusable)?,
        velocity::figure_5(&drives)?,
        against_kalman::figures_6_and_7(&settings).map_err(unusable)?,
        velocity::figure_8(&drives)?,
        velocity::figure_9(&settings, &drives, &route)?,
        velocity::table_1(&settings, &route)?,
        laboratory::argument(&settings, &route)?,
        flight::table_2()?,
        flight::hour(&settings, &route, &ErrorModel::hg1700())?,
    ];
    parts.extend(on_recorded.into_iter().flatten());
    Ok(Reproduction {
        version: env!("CARGO_PKG_VERSION"),
        settings,
        parts,
        not_reproduced: NOT_REPRODUCED,
    })
}

//! The thesis's figures and tables from simulation, its numbers beside ours.

mod beside;
mod cross_channel;
mod drive;
mod flight;
mod flight_velocity;
mod free_velocity;
mod laboratory;
mod observable;
pub(crate) mod output;
mod part;
pub mod performance;
mod spans;
mod velocity_plot;

use miette::{Result, miette};
use rayon::prelude::*;
use serde::Serialize;

use crate::sim::ErrorModel;
use crate::study::flights::route::Route;
pub use beside::Recorded;
use drive::Drive;
pub use output::{JSON, markdown};
pub use part::{Number, Part, Settings};

/// All that is reproduced, and what is not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reproduction {
    /// Version of this program.
    pub version: &'static str,
    /// What was simulated.
    pub settings: Settings,
    /// In the order of the page.
    pub parts: Vec<Part>,
    /// Numbers of the thesis that have nothing here.
    pub not_reproduced: [NotReproduced; 1],
}

/// Something of the thesis that is not here.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NotReproduced {
    /// Which.
    pub what: &'static str,
    /// Why.
    pub why: &'static str,
}

const NOT_REPRODUCED: [NotReproduced; 1] = [NotReproduced {
    what: "the recordings behind Figures 1 and 3 to 8 and Table 1",
    why: "they are not public: a simulated unit of the same class stands in for the thesis's",
}];

/// Simulates and measures everything, and draws on a recorded drive too what can be drawn there;
/// what comes out does not depend on the number of threads.
pub fn reproduce(settings: Settings, recorded: Option<&Recorded>) -> Result<Reproduction> {
    // First: it may be unusable, and all else takes minutes.
    let on_recorded = recorded.map(beside::recorded).transpose()?;
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
        beside::figures_3_and_4(&drives).map_err(unusable)?,
        cross_channel::figure_5(&drives),
        beside::figures_6_and_7(&settings).map_err(unusable)?,
        free_velocity::figure_8(&drives),
        flight_velocity::figure_9(&settings, &drives, &route)?,
        spans::table_1(&settings, &route)?,
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

//! Figure 1: when each error shows itself.

use indicatif::ProgressBar;
use ins_core::navigator::ConfigError;

use super::drive::Drive;
use super::{Number, Part};
use crate::five_stage::Stage;
use crate::identify::identify;
use crate::report::estimates_svg;
use crate::truth::Truth;

pub(super) fn figure_1(drive: &Drive) -> Result<Part, ConfigError> {
    let log = &drive.log;
    let found = identify(log, drive.config, &ProgressBar::hidden())?;
    let truth = Truth::new(&drive.errors, None, log.meta.body_axes);
    let mut csv = "quantity,from_s,to_s\n".to_owned();
    let mut numbers = Vec::new();
    for (stage, intervals) in Stage::ALL.into_iter().zip(&drive.stages.intervals) {
        let mut seconds = 0.0;
        for (from, to) in intervals {
            seconds += to.seconds_since(*from);
            let (from, to) = (drive.since(*from), drive.since(*to));
            csv += &format!("{},{from:.2},{to:.2}\n", stage.title());
        }
        let part = 100.0 * seconds / log.duration_s();
        let what = format!("{} observable, % of the drive", stage.title());
        numbers.push(Number::new(what, None, part));
    }
    Ok(Part {
        name: "figure-1",
        title: "Figure 1: intervals in which each error is observable",
        how: format!(
            "A drive of {:.0} min, running estimates. Shaded: straight starts and brakings for \
             azimuth and latency, turns for level accelerometers; gyros and vertical channel show \
             all the time.",
            log.duration_s() / 60.0
        ),
        numbers,
        svg: Some(estimates_svg(log, &found, Some(&truth))),
        csv,
    })
}

//! All flights of a rehearsal, or of a shard of it, that are not flown yet.

use std::collections::HashSet;
use std::path::Path;

use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use rayon::prelude::*;

use super::answers::Told;
use super::budget::Case;
use super::flight::World;
use super::score::{Line, Outcome, moments};
use super::settings::Rehearsal;
use super::subject::Subject;
use crate::campaign::ledger::{Ledger, read_folder};
use crate::campaign::run::Shard;
use crate::identify::analysis::unusable;

/// Flies what is missing. Which thread does what leaves no trace in the results.
pub fn run(
    rehearsal: &Rehearsal,
    world: &World,
    told: &Told,
    shard: Shard,
    folder: &Path,
    progress: &ProgressBar,
) -> Result<()> {
    let flown_elsewhere = lines(folder)?;
    let mut flown: HashSet<(Case, u32)> = (flown_elsewhere.iter())
        .map(|line| (line.case, line.flight))
        .collect();
    let ledger = Ledger::open(&folder.join(shard.file()), |line: Line| {
        flown.insert((line.case, line.flight));
    })?;
    let mut jobs = rehearsal.jobs();
    let mut number = 0;
    jobs.retain(|job| {
        number += 1;
        shard.has(number - 1) && !flown.contains(job)
    });
    let moments = moments(world);
    progress.set_message("flying");
    progress.set_length(jobs.len() as u64);
    jobs.into_par_iter()
        .with_max_len(1)
        .try_for_each(|(case, flight)| -> Result<()> {
            let line = fly(rehearsal, world, told, case, flight, &moments)?;
            progress.inc(1);
            Ok(ledger.add(&line)?)
        })?;
    Ok(())
}

fn fly(
    rehearsal: &Rehearsal,
    world: &World,
    told: &Told,
    case: Case,
    flight: u32,
    moments: &[(usize, bool)],
) -> Result<Line> {
    let seed = rehearsal.settings.flight_seed(flight);
    let noise = rehearsal.noise.as_ref().filter(|_| case == Case::Recorded);
    let model = rehearsal.model(case).into_diagnostic()?;
    let (outcomes, why) = match world.fly(seed, &model, noise) {
        Ok(flown) => {
            let outcome = |subject: &Subject| {
                let answers = subject.fly(&flown, told).map_err(unusable)?;
                Ok(Outcome::new(answers, &flown, moments))
            };
            let all: Result<_> = rehearsal.subjects_of(case).iter().map(outcome).collect();
            (all?, None)
        }
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    Ok(Line {
        case,
        flight,
        outcomes,
        why,
    })
}

/// All flights in the files of a folder, each once, in an order that does not depend on who flew.
pub fn lines(folder: &Path) -> Result<Vec<Line>> {
    let mut all: Vec<Line> = Vec::new();
    read_folder(folder, |line| all.push(line))?;
    all.sort_by_key(|line| (line.case, line.flight));
    all.dedup_by_key(|line| (line.case, line.flight));
    Ok(all)
}

//! The kinds of conditions there are.

mod develop;
mod judge;
mod shakes;

use super::World;
use crate::sim::Grade;

const BOTH: &[Grade] = &[Grade::Mems, Grade::Hg1700];
const MEMS: &[Grade] = &[Grade::Mems];

/// Conditions that one seed differs in by chance alone.
#[derive(Debug)]
pub struct Kind {
    /// Name on the command line.
    pub name: &'static str,
    /// In one line.
    pub what: &'static str,
    /// Classes of sensors it is tried with.
    pub classes: &'static [Grade],
    /// Whether it judges; else it is there to develop on.
    pub judge: bool,
    /// Length of a run.
    pub minutes: f64,
    /// What makes it out of a plain world.
    make: fn(&mut World),
}

impl Kind {
    /// One seed of it.
    pub fn world(&self, class: Grade, seed: u64) -> World {
        let mut world = World::plain(class, seed, self.minutes, self.name);
        (self.make)(&mut world);
        world
    }
}

/// Every kind: those to develop on, then those that judge.
pub fn all() -> impl Iterator<Item = &'static Kind> {
    develop::KINDS.iter().chain(judge::KINDS.iter())
}

const fn develop(
    name: &'static str,
    classes: &'static [Grade],
    minutes: f64,
    what: &'static str,
    make: fn(&mut World),
) -> Kind {
    Kind {
        name,
        what,
        classes,
        judge: false,
        minutes,
        make,
    }
}

const fn judge(
    name: &'static str,
    classes: &'static [Grade],
    minutes: f64,
    what: &'static str,
    make: fn(&mut World),
) -> Kind {
    Kind {
        judge: true,
        ..develop(name, classes, minutes, what, make)
    }
}

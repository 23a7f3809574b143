//! What a kind of conditions is.

use crate::sim::Grade;
use crate::study::conditions::world::World;

pub(super) const BOTH: &[Grade] = &[Grade::Mems, Grade::Hg1700];
pub(super) const MEMS: &[Grade] = &[Grade::Mems];

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

pub(super) const fn develop(
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

pub(super) const fn judge(
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

//! The kinds of conditions there are.

mod anything;
pub mod develop;
pub mod judge;
mod shakes;

use crate::log::Grade;
use crate::study::conditions::world::World;

pub(super) const BOTH: &[Grade] = &[Grade::Mems, Grade::Hg1700];
pub(super) const MEMS: &[Grade] = &[Grade::Mems];

/// Conditions that one seed differs in by chance alone.
#[derive(Debug)]
pub struct Kind {
    pub name: &'static str,
    pub what: &'static str,
    /// Classes of sensors it is tried with.
    pub classes: &'static [Grade],
    /// Whether it judges; else it is there to develop on.
    pub judge: bool,
    pub minutes: f64,
    /// What makes it out of a plain world.
    pub(super) make: fn(&mut World),
}

impl Kind {
    pub fn world(&self, class: Grade, seed: u64) -> World {
        let mut world = World::plain(class, seed, self.minutes, self.name);
        (self.make)(&mut world);
        world
    }
}

/// Kinds, each with its name, classes, minutes, what it is and what makes it out of a plain world.
macro_rules! kinds {
    (judge: $judge:literal,
     $($name:literal, $classes:expr, $minutes:literal, $what:literal => $make:expr;)*) => {
        pub static KINDS: &[Kind] = &[$(Kind {
            name: $name,
            what: $what,
            classes: $classes,
            judge: $judge,
            minutes: $minutes,
            make: $make,
        }),*];
    };
}
pub(super) use kinds;

/// Two kinds of a class at once, of all but the last two, which are drawn: what both change is as the second
/// has it.
pub(super) fn in_company(world: &mut World, kinds: &[Kind]) {
    let others = kinds.iter().take(kinds.len() - 2);
    let of_class: Vec<_> = others
        .filter(|kind| kind.classes.contains(&world.class))
        .collect();
    for _ in 0..2 {
        let kind = *world.random.one_of(&of_class);
        (kind.make)(world);
    }
}

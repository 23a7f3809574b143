//! Kinds of conditions.

mod anything;
pub mod develop;
pub mod judge;
mod vibration;

use crate::log::Grade;
use crate::study::conditions::scenario::Scenario;

pub(super) const BOTH: &[Grade] = &[Grade::Mems, Grade::Hg1700];
pub(super) const MEMS: &[Grade] = &[Grade::Mems];

/// Conditions that differ from seed to seed only by random draws.
#[derive(Debug)]
pub struct Kind {
    pub name: &'static str,
    pub what: &'static str,
    /// Classes of sensors it is run with.
    pub classes: &'static [Grade],
    /// Whether it is a judge; else for development.
    pub judge: bool,
    pub minutes: f64,
    /// Makes it from a plain scenario.
    pub(super) modify: fn(&mut Scenario),
}

impl Kind {
    pub fn scenario(&self, class: Grade, seed: u64) -> Scenario {
        let mut scenario = Scenario::plain(class, seed, self.minutes, self.name);
        (self.modify)(&mut scenario);
        scenario
    }
}

/// Kinds, each with its name, classes, minutes, description and modification of a plain scenario.
macro_rules! kinds {
    (judge: $judge:literal,
     $($name:literal, $classes:expr, $minutes:literal, $what:literal => $modify:expr;)*) => {
        pub static KINDS: &[Kind] = &[$(Kind {
            name: $name,
            what: $what,
            classes: $classes,
            judge: $judge,
            minutes: $minutes,
            modify: $modify,
        }),*];
    };
}
pub(super) use kinds;

/// Two random kinds of a class combined, of all but the last two, which are random themselves; the second
/// overrides the first.
pub(super) fn combined(scenario: &mut Scenario, kinds: &[Kind]) {
    let others = kinds.iter().take(kinds.len() - 2);
    let of_class: Vec<_> = others
        .filter(|kind| kind.classes.contains(&scenario.class))
        .collect();
    for _ in 0..2 {
        let kind = *scenario.random.one_of(&of_class);
        (kind.modify)(scenario);
    }
}

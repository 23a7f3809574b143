//! The kinds of conditions there are.

mod develop;
mod judge;
mod kind;
mod shakes;

pub use kind::Kind;

/// Every kind: those to develop on, then those that judge.
pub fn all() -> impl Iterator<Item = &'static Kind> {
    develop::KINDS.iter().chain(judge::KINDS.iter())
}

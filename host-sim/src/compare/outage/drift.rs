//! How far an INS drifts without GNSS.

use serde::Serialize;

use crate::statistics::rms;

/// Length of an outage, and from start to start, s.
pub const OUTAGE_S: f64 = 30.0;
pub(super) const STRIDE_S: f64 = 10.0;
/// Navigation before the first outage, s: as much GNSS as is then taken away.
pub(super) const SETTLE_S: f64 = OUTAGE_S;
/// Age of the last fix at which an outage may begin, s; older, there already is one.
pub(super) const FRESH_S: f64 = 1.5;

/// Horizontal errors in one outage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Drift {
    /// Start, since the first sample, s.
    pub start_s: f64,
    /// Position at the end, m.
    pub position_end_m: f64,
    /// Velocity at the end, m/s.
    pub velocity_end_mps: f64,
    /// Largest of the position, m.
    pub position_max_m: f64,
    /// Largest of the velocity, m/s.
    pub velocity_max_mps: f64,
}

/// One navigator through all outages.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drifts {
    /// Which.
    pub navigator: &'static str,
    /// Outages.
    pub count: usize,
    /// Root mean square at the end, m.
    pub position_rms_m: f64,
    /// Largest in any outage, m.
    pub position_max_m: f64,
    /// Root mean square at the end, m/s.
    pub velocity_rms_mps: f64,
    /// Largest in any outage, m/s.
    pub velocity_max_mps: f64,
    /// The outages themselves.
    #[serde(skip)]
    pub outages: Vec<Drift>,
}

impl Drifts {
    pub(super) fn new(navigator: &'static str, outages: Vec<Drift>) -> Self {
        let rms = |value: fn(&Drift) -> f64| rms(outages.iter().map(value));
        let most = |value: fn(&Drift) -> f64| outages.iter().map(value).fold(0.0, f64::max);
        Self {
            navigator,
            count: outages.len(),
            position_rms_m: rms(|drift| drift.position_end_m),
            position_max_m: most(|drift| drift.position_max_m),
            velocity_rms_mps: rms(|drift| drift.velocity_end_mps),
            velocity_max_mps: most(|drift| drift.velocity_max_mps),
            outages,
        }
    }
}

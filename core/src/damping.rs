//! Damping loops: controls of the INS by GNSS differences.

use nalgebra::{Vector2, Vector3};

use crate::config::{DampingConfig, SecondOrder};
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::math;
use crate::mechanization::Controls;
use crate::time::Time;

/// Largest product of a loop's bandwidth and its lag: fixes show the past, and controls are held from fix
/// to fix; beyond this the lag destabilizes the loop.
const LAGGED_BANDWIDTH: f64 = 0.5;

/// The last comparison with a fix, and the present controls.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DampingSignals {
    /// Stamp of the fix.
    pub time: Time,
    /// Velocity of the INS minus that of the fix, ENU, m/s.
    pub difference_enu_mps: Vector3<f64>,
    /// f^C: correction into the velocity block, ENU, m/s^2.
    pub accel_enu_mps2: Vector3<f64>,
    /// omega^C: correction into the attitude block, ENU, rad/s.
    pub rate_enu_radps: Vector3<f64>,
}

/// INS minus GNSS at one time, ENU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Differences {
    /// dV, m/s; None where the fix has no such component.
    pub velocity_en_mps: Option<Vector2<f64>>,
    /// `dV_UP`, m/s.
    pub velocity_up_mps: Option<f64>,
    /// East and north, m.
    pub position_en_m: Option<Vector2<f64>>,
    /// dh, m.
    pub height_m: Option<f64>,
    /// `Phi_UP` as estimated, rad, if it is to be taken out.
    pub azimuth_rad: Option<f64>,
}

/// Coefficients of `s^2 + 2 zeta w0 s + w0^2`, with a lower bandwidth where fixes are rare or late; the
/// first is a rate as well.
fn second_order(loop_config: &SecondOrder, lag_s: f64) -> (f64, f64) {
    let fastest = LAGGED_BANDWIDTH / lag_s;
    let w0 = math::min(loop_config.bandwidth_radps, fastest);
    let damping = loop_config.damping_ratio * w0;
    (2.0 * math::min(damping, fastest), w0 * w0)
}

/// Controls until the next fix; `lag_s` is the time from that of this fix until then.
///
/// Horizontal: `f^C = -K1 dV`, `w_E^C = -K2 dV_N`, `w_N^C = K2 dV_E`, with `K1 = 2 zeta w0` and
/// `K2 = w0^2 / g`. Vertical: `V_UP^C = -C1 dh`, `f_UP^C = -C2 dh`; a measured vertical velocity provides
/// the damping instead of C1. Azimuth: `w_UP^C = -K3 Phi_UP`.
pub fn controls(differences: &Differences, lag_s: f64, config: &DampingConfig) -> Controls {
    let mut controls = Controls::default();
    let slow = |rate: f64| math::min(rate, LAGGED_BANDWIDTH / lag_s);
    if let Some(dv) = differences.velocity_en_mps {
        let (k1, w2) = second_order(&config.horizontal, lag_s);
        let k2 = w2 / GRAVITY_EQUATOR_MPS2;
        controls.accel_mps2.x = -k1 * dv.x;
        controls.accel_mps2.y = -k1 * dv.y;
        controls.rate_radps.x = -k2 * dv.y;
        controls.rate_radps.y = k2 * dv.x;
    }
    let (c1, c2) = second_order(&config.vertical, lag_s);
    let position = slow(config.position_radps);
    if let Some(dv_up) = differences.velocity_up_mps {
        controls.accel_mps2.z = -c1 * dv_up;
    }
    if let Some(dp) = differences.position_en_m {
        controls.velocity_mps.x = -position * dp.x;
        controls.velocity_mps.y = -position * dp.y;
    }
    if let Some(dh) = differences.height_m {
        if differences.velocity_up_mps.is_some() {
            controls.velocity_mps.z = -position * dh;
            controls.accel_mps2.z -= position * position * dh;
        } else {
            controls.velocity_mps.z = -c1 * dh;
            controls.accel_mps2.z = -c2 * dh;
        }
    }
    if let Some(azimuth) = differences.azimuth_rad {
        controls.rate_radps.z = -slow(config.azimuth_radps) * azimuth;
    }
    controls
}

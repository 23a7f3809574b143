//! A filter's start, prediction and velocity update alone, like the firmware's program `core_only` for the core.

use core::hint::black_box;

use ins_core::earth::Geodetic;
use ins_core::{FixSigma, GnssFix, ImuSample, Time};
use nalgebra::{Vector2, Vector3};

use crate::filters::{AtRest, Peer};

/// Calls everything once.
pub fn only<P: Peer>() -> ! {
    let sample = black_box(ImuSample {
        time: Time::from_micros(1),
        gyro: Vector3::zeros(),
        accel: Vector3::zeros(),
    });
    let fix = black_box(
        GnssFix {
            time: Time::from_micros(1),
            velocity_en_mps: Some(Vector2::zeros()),
            velocity_up_mps: Some(0.0),
            sigma: FixSigma {
                velocity_mps: Some(0.1),
                ..FixSigma::default()
            },
            ..GnssFix::default()
        }
        .at(&Geodetic::default()),
    );
    let peer = AtRest::new(&sample, &fix, black_box(0.0)).and_then(|start| P::new(&start));
    if let (Some(mut peer), Some(sample), Some(fix)) = (peer, P::sample(&sample), P::fix(&fix)) {
        black_box(peer.on_imu(black_box(sample)));
        black_box(peer.on_gnss(black_box(fix)));
        black_box(&peer);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

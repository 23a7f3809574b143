//! The core alone, to measure its size. With the feature `panic-never` it calls the whole public interface, and links
//! only if no panic can be reached.
#![no_std]
#![no_main]

use core::hint::black_box;

use ins_core::earth::Geodetic;
use ins_core::{Config, FixSigma, GnssFix, ImuSample, Navigator, Time};
#[cfg(feature = "panic-never")]
use panic_never as _;

#[cfg(not(feature = "panic-never"))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        cortex_m::asm::bkpt();
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Ok(mut navigator) = Navigator::new(black_box(Config::hg1700())) {
        navigate(&mut navigator);
        #[cfg(feature = "panic-never")]
        call_rest_of_interface(&mut navigator);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

fn navigate(navigator: &mut Navigator) {
    let vector = nalgebra::Vector3::zeros();
    let sample = ImuSample {
        time: Time::from_micros(1),
        gyro: vector,
        accel: vector,
    };
    let fix = GnssFix {
        time: Time::from_micros(1),
        velocity_en_mps: Some(nalgebra::Vector2::zeros()),
        velocity_up_mps: Some(0.0),
        sigma: FixSigma {
            velocity_mps: Some(0.1),
            ..FixSigma::default()
        },
        ..GnssFix::default()
    }
    .at(&Geodetic::default());
    let _ = black_box(navigator.on_imu(&black_box(sample)));
    let _ = black_box(navigator.on_gnss(&black_box(fix)));
    black_box(navigator.phase());
    black_box(navigator.solution());
    black_box(navigator.estimates());
}

#[cfg(feature = "panic-never")]
fn call_rest_of_interface(navigator: &mut Navigator) {
    use ins_core::{BaroHeight, Heading, attitude, earth};

    let _ = black_box(navigator.on_heading(&black_box(Heading {
        time: Time::from_micros(1),
        heading_rad: 0.1,
        sigma_rad: 0.01,
    })));
    let _ = black_box(navigator.on_baro(&black_box(BaroHeight {
        time: Time::from_micros(1),
        height_m: 100.0,
        sigma_m: 0.3,
    })));
    let calibration =
        black_box(navigator.calibration()).after_turn_on(black_box(1e-3), black_box(1e-2));
    if let Ok(warm) = Navigator::warm(black_box(Config::mems()), &calibration) {
        black_box(warm);
    }
    black_box(navigator.body_motion());
    black_box(navigator.health());
    black_box(navigator.sigma());
    black_box(navigator.velocity_noise());
    black_box(navigator.tilt_sigma_rad());
    black_box(navigator.config());
    black_box(navigator.azimuth_left_rad());
    black_box(navigator.manoeuvre());
    black_box(navigator.damping_signals());
    black_box(navigator.mechanization());
    if let Some(solution) = navigator.solution() {
        black_box(solution.euler());
    }
    let snapshot = navigator.clone();
    black_box(snapshot == *black_box(navigator));
    let time = Time::from_seconds(black_box(1.0)).unwrap_or_default();
    black_box(time.plus_seconds(black_box(0.5)).seconds_since(time));
    black_box((time.as_micros(), time.as_seconds()));
    let euler: attitude::Euler = black_box(attitude::Euler::default());
    let rotation = attitude::from_euler(&euler);
    black_box(attitude::matrix(&rotation));
    let here = black_box(Geodetic::default());
    black_box(here.enu_from(&here));
    let local = earth::LocalEarth::at(here.latitude_rad, here.height_m);
    black_box((
        local.earth_rate(),
        local.transport_rate(&nalgebra::Vector3::zeros()),
    ));
    black_box(earth::wrap_pi(black_box(4.0)));
}

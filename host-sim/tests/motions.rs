//! Kinematic consistency of every vehicle, and the properties of each.

use host_sim::sim::Motion;
use host_sim::sim::car::{Car, RouteBounds};
use host_sim::sim::motion::{Envelope, Harmonic, Kinematics, Mounted, Oscillating};
use host_sim::sim::vehicles::{Anchored, Begin, Boat, Plane, Quadrotor, Walker};
use nalgebra::{UnitQuaternion, Vector3};

const DURATION_S: f64 = 600.0;

fn boat() -> Boat {
    let anchored = Anchored {
        until_s: 200.0,
        period_s: 120.0,
        peak_radps: 0.005,
    };
    Boat::new(5, DURATION_S, anchored)
}

fn vehicles() -> Vec<(&'static str, Box<dyn Motion>)> {
    let oscillation = [Harmonic {
        hz: 2.0,
        velocity_mps: [0.1, 0.2, 0.3],
        rotation_rad: [0.05, 0.08, 0.02],
    }];
    let mount = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -1.2, 2.0));
    let (air, ground) = (Begin::InFlight, Begin::OnGround);
    let walker = || Walker::new(7, DURATION_S, 20.0);
    let route = RouteBounds {
        stop_s: Some([5.0, 10.0]),
        roll_rad_per_mps2: RouteBounds::BALANCED,
        steep: 3.0,
        ..RouteBounds::ROAD
    };
    let car = || Car::new(3, DURATION_S, Some([30.0, 60.0])).leaning(2.0);
    vec![
        ("boat", Box::new(boat())),
        (
            "plane",
            Box::new(Plane::new(1, DURATION_S, [0.6, 1.05], air)),
        ),
        (
            "departure",
            Box::new(Plane::new(2, DURATION_S, [0.6, 1.05], ground)),
        ),
        (
            "quadrotor",
            Box::new(Quadrotor::new(3, DURATION_S, Some(20.0))),
        ),
        (
            "walker",
            Box::new(Oscillating::new(
                walker(),
                &oscillation,
                Envelope::Moving(0.4),
                1,
            )),
        ),
        (
            "car",
            Box::new(Oscillating::new(
                car(),
                &oscillation,
                Envelope::Standing(3.0),
                2,
            )),
        ),
        ("leaning", Box::new(car())),
        ("way", Box::new(Car::on_route(4, DURATION_S, &route))),
        (
            "mounted",
            Box::new(Mounted::new(
                Oscillating::new(boat(), &oscillation, Envelope::Always, 3),
                mount,
            )),
        ),
    ]
}

#[test]
fn rates_are_the_derivatives_of_velocity_and_attitude() {
    // Central differences over 1 ms: h^2/6 of the third derivative, and rounding of 1e-13 / h. Oscillation
    // at 2 Hz and quintic pieces of 0.3 s have 500 m/s^4, wheeled vehicles alone a fifth.
    const H: f64 = 5e-4;
    for (name, mut vehicle) in vehicles() {
        let wheels = ["leaning", "way"].contains(&name);
        let bound = if wheels { 2e-5 } else { 1e-4 };
        for t in (1..1600).map(|k| 0.37 * f64::from(k)) {
            let [before, now, after] = [t - H, t, t + H].map(|t| vehicle.kinematics(t));
            let acceleration = (after.velocity_enu_mps - before.velocity_enu_mps) / (2.0 * H);
            let rate = (before.attitude.inverse() * after.attitude).scaled_axis() / (2.0 * H);
            let error = (acceleration - now.acceleration_enu_mps2).norm();
            assert!(error < bound, "{name}: acceleration error {error} at {t} s");
            let error = (rate - now.angular_rate_lb_b_radps).norm();
            assert!(error < bound, "{name}: angular rate error {error} at {t} s");
        }
    }
}

#[test]
fn a_mounted_unit_senses_the_motion_of_its_vehicle() {
    let mount = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -1.2, 2.0));
    let mut vehicle = boat();
    let mut unit = Mounted::new(boat(), mount);
    for t in (0..600).map(f64::from) {
        let (vehicle, unit) = (vehicle.kinematics(t), unit.kinematics(t));
        let rates = mount * unit.angular_rate_lb_b_radps - vehicle.angular_rate_lb_b_radps;
        assert!(rates.norm() < 1e-15);
        let force = Vector3::new(0.3, 0.2, 9.8) + vehicle.acceleration_enu_mps2;
        let force_in_vehicle = mount * (unit.attitude.inverse() * force);
        assert!((force_in_vehicle - vehicle.attitude.inverse() * force).norm() < 1e-13);
    }
}

#[test]
fn vehicles_reach_their_configured_motion() {
    let times = || (0..6000).map(|k| 0.1 * f64::from(k));
    let mut plane = Plane::new(1, DURATION_S, [0.9, 1.0], Begin::InFlight);
    let mut quadrotor = Quadrotor::new(3, DURATION_S, Some(20.0));
    let mut boat = boat();
    let (mut bank, mut tilt, mut peak_radps) = (0.0_f64, 0.0_f64, 0.0_f64);
    for t in times() {
        let tilt_of = |k: &Kinematics| (k.attitude * Vector3::z()).z.acos();
        bank = bank.max(tilt_of(&plane.kinematics(t)));
        let k = quadrotor.kinematics(t);
        tilt = tilt.max(tilt_of(&k));
        // Thrust is along the up axis, apart from drag.
        let force =
            k.acceleration_enu_mps2 + 0.3 * k.velocity_enu_mps + Vector3::new(0.0, 0.0, 9.81);
        assert!((k.attitude.inverse() * force).xy().norm() < 1e-12);
        if t < 20.0 {
            assert!(k.velocity_enu_mps.norm() == 0.0 && k.angular_rate_lb_b_radps.norm() == 0.0);
        }
        if t < 200.0 {
            peak_radps = peak_radps.max(boat.kinematics(t).angular_rate_lb_b_radps.z.abs());
        }
    }
    assert!((0.85..1.05).contains(&bank), "{bank}");
    assert!((0.2..0.6).contains(&tilt), "{tilt}");
    assert!((0.0045..0.0051).contains(&peak_radps), "{peak_radps}");
}

const HOUR_S: f64 = 3600.0;

fn times(step_s: f64) -> impl Iterator<Item = f64> {
    (1..)
        .map(move |k| f64::from(k) * step_s)
        .take_while(|t| *t < HOUR_S)
}

#[test]
fn angular_rate_is_continuous() {
    // 1 ms apart: an angular acceleration of 1 rad/s^2 at most.
    let mut car = Car::new(3, HOUR_S, None);
    let mut last = car.kinematics(0.0).angular_rate_lb_b_radps;
    for t in times(1e-3).take_while(|t| *t < 600.0) {
        let rate = car.kinematics(t).angular_rate_lb_b_radps;
        assert!((rate - last).norm() < 1e-3, "jump at {t} s");
        last = rate;
    }
}

#[test]
fn driving_is_within_human_limits() {
    for seed in 0..20 {
        let mut car = Car::new(seed, HOUR_S, Some([30.0, 120.0]));
        assert!(times(0.1).take_while(|t| *t < 30.0).all(|t| {
            let k = car.kinematics(t);
            k.velocity_enu_mps.norm() == 0.0 && k.angular_rate_lb_b_radps.norm() == 0.0
        }));
        let (mut stops, mut turned_rad, mut fastest) = (0, 0.0, 0.0_f64);
        let mut was_moving = false;
        for t in times(0.1) {
            let k = car.kinematics(t);
            let speed = k.velocity_enu_mps.norm();
            let up = Vector3::z();
            let forward = k.attitude * Vector3::y();
            let forward_mps2 = k.acceleration_enu_mps2.dot(&forward);
            let lateral_mps2 = k.acceleration_enu_mps2.cross(&forward).dot(&up);
            assert!(
                forward_mps2.abs() < 2.8,
                "seed {seed}: {forward_mps2} m/s^2 forward at {t} s"
            );
            assert!(
                lateral_mps2.abs() < 4.0,
                "seed {seed}: {lateral_mps2} m/s^2 lateral at {t} s"
            );
            assert!(k.velocity_enu_mps.z.abs() <= 0.05 * speed);
            stops += u32::from(was_moving && speed == 0.0);
            was_moving = speed > 0.0;
            turned_rad += k.angular_rate_lb_b_radps.z.abs() * 0.1;
            fastest = fastest.max(speed);
        }
        assert!((15..80).contains(&stops), "seed {seed}: {stops} stops");
        assert!(turned_rad > 50.0, "seed {seed}: {turned_rad} rad");
        assert!(
            (15.0..25.5).contains(&fastest),
            "seed {seed}: {fastest} m/s"
        );
    }
}

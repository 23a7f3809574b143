//! Logs round-trip through files.

use host_sim::log::{BodyAxes, Compression, Grade, Log, Meta, read, write};
use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::Geodetic;
use ins_core::{BaroHeight, FixSigma, GnssFix, ImuOutput, ImuSample, Solution, Time};
use nalgebra::{Vector2, Vector3};
use proptest::option::of;
use proptest::prelude::*;

/// Any value within a sensor's range, and small or zero ones.
fn reading(limit: f64) -> impl Strategy<Value = f64> {
    prop_oneof![-limit..limit, Just(0.0), Just(-0.0), -1e-300..1e-300_f64]
}

fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
    (reading(limit), reading(limit), reading(limit)).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

fn position() -> impl Strategy<Value = Geodetic> {
    (-1.5..1.5, -3.1..3.1, -500.0..9000.0).prop_map(|(latitude_rad, longitude_rad, height_m)| {
        Geodetic {
            latitude_rad,
            longitude_rad,
            height_m,
        }
    })
}

fn fix() -> impl Strategy<Value = GnssFix> {
    let position = of(position().prop_map(|origin| origin.lat_lon()));
    let velocity = of((-40.0..40.0, -40.0..40.0).prop_map(|(e, n)| Vector2::new(e, n)));
    let up = of(-9.0..9.0);
    (position, of(-500.0..9000.0), velocity, up, fix_sigma()).prop_map(
        |(position, height_m, velocity_en_mps, velocity_up_mps, sigma)| GnssFix {
            time: Time::default(),
            position,
            height_m,
            velocity_en_mps,
            velocity_up_mps,
            sigma,
        },
    )
}

fn fix_sigma() -> impl Strategy<Value = FixSigma> {
    let sigma = || of(0.001..20.0);
    (sigma(), sigma(), sigma(), sigma()).prop_map(
        |(position_m, height_m, velocity_mps, velocity_up_mps)| FixSigma {
            position_m,
            height_m,
            velocity_mps,
            velocity_up_mps,
        },
    )
}

fn truth() -> impl Strategy<Value = Solution> {
    (position(), vector(40.0), -3.0..3.0, -1.5..1.5, -3.1..3.1).prop_map(
        |(position, velocity_enu_mps, roll_rad, pitch_rad, heading_rad)| Solution {
            time: Time::default(),
            position,
            velocity_enu_mps,
            attitude: from_euler(&Euler {
                roll_rad,
                pitch_rad,
                heading_rad,
            }),
        },
    )
}

fn height() -> impl Strategy<Value = BaroHeight> {
    (-400.0..9000.0, 0.01..10.0).prop_map(|(height_m, sigma_m)| BaroHeight {
        time: Time::default(),
        height_m,
        sigma_m,
    })
}

fn meta() -> impl Strategy<Value = Meta> {
    let axes = prop::sample::select(BodyAxes::ALL.to_vec());
    let heading = of(-360.0..360.0);
    let grade = of(prop_oneof![Just(Grade::Hg1700), Just(Grade::Mems)]);
    let arm = of(vector(5.0));
    (axes, heading, grade, arm).prop_map(|(axes, initial_heading_deg, grade, lever_arm_rfu_m)| {
        Meta {
            initial_heading_deg,
            grade,
            lever_arm_rfu_m,
            document: toml::from_str("name = \"a\"\nnote = [1, 2.5]\n[log]\nown = { x = 1 }\n")
                .unwrap(),
            ..Meta::new(axes, ImuOutput::Rates)
        }
    })
}

prop_compose! {
    /// A log that passes the checks: 100 Hz, gravity on the up axis, a position, time stamps of any scale.
    fn log()(
        meta in meta(),
        start in -1_000_000_000_000_000_i64..1_000_000_000_000_000,
        sensors in prop::collection::vec((vector(3.0), vector(1.0)), 20..40),
        mut gnss in prop::collection::vec(fix(), 1..8),
        origin in position(),
        mut truth in prop::collection::vec(truth(), 0..8),
        mut baro in prop::collection::vec(height(), 0..8),
    ) -> Log {
        let stamp = |index: usize, step: i64| {
            Time::from_micros(start + step * i64::try_from(index).unwrap())
        };
        let gravity = Vector3::new(0.0, 0.0, 9.81);
        let imu = sensors.iter().enumerate().map(|(index, (gyro, accel))| {
            ImuSample { time: stamp(index, 10_001), gyro: *gyro, accel: accel + gravity }
        }).collect::<Vec<_>>().into();
        gnss[0].position = Some(origin.lat_lon());
        for (index, fix) in gnss.iter_mut().enumerate() {
            fix.time = stamp(index, 100_003);
        }
        for (index, row) in truth.iter_mut().enumerate() {
            row.time = stamp(index, 70_007);
        }
        for (index, row) in baro.iter_mut().enumerate() {
            row.time = stamp(index, 50_001);
        }
        Log { meta, imu, gnss, baro, truth }
    }
}

/// Conversion from radians to degrees and back rounds twice.
fn same_angle(a: f64, b: f64) -> bool {
    (a - b).abs() <= 4.0 * f64::EPSILON * a.abs()
}

fn same_position(a: &Geodetic, b: &Geodetic) -> bool {
    same_angle(a.latitude_rad, b.latitude_rad)
        && same_angle(a.longitude_rad, b.longitude_rad)
        && a.height_m.to_bits() == b.height_m.to_bits()
}

fn same_truth(a: &Solution, b: &Solution) -> bool {
    a.time == b.time
        && same_position(&a.position, &b.position)
        && a.velocity_enu_mps == b.velocity_enu_mps
        // Through Euler angles with pitch up to 86 degrees: 1/cos(pitch) roundings of 1e-16.
        && a.attitude.angle_to(&b.attitude) < 1e-7
        && (a.attitude.to_rotation_matrix().matrix() - b.attitude.to_rotation_matrix().matrix())
            .amax() < 1e-13
}

fn same_fix(a: &GnssFix, b: &GnssFix) -> bool {
    let position = match (&a.position, &b.position) {
        (Some(a), Some(b)) => {
            same_angle(a.latitude_rad, b.latitude_rad)
                && same_angle(a.longitude_rad, b.longitude_rad)
        }
        (a, b) => a.is_none() && b.is_none(),
    };
    position
        && a.time == b.time
        && a.height_m == b.height_m
        && a.sigma == b.sigma
        && a.velocity_en_mps == b.velocity_en_mps
        && a.velocity_up_mps == b.velocity_up_mps
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn logs_round_trip(log in log(), gzip: bool) {
        let folder = tempfile::tempdir().unwrap();
        let compression = if gzip { Compression::Gzip } else { Compression::Plain };
        write(&log, folder.path(), compression).unwrap();
        let (back, _) = read(folder.path()).unwrap();
        prop_assert_eq!(&back.imu, &log.imu);
        prop_assert!(back.gnss.len() == log.gnss.len());
        for (a, b) in log.gnss.iter().zip(&back.gnss) {
            prop_assert!(same_fix(a, b), "{:?} {:?}", a, b);
        }
        prop_assert_eq!(&back.baro, &log.baro);
        prop_assert!(back.truth.len() == log.truth.len());
        for (a, b) in log.truth.iter().zip(&back.truth) {
            prop_assert!(same_truth(a, b), "{:?} {:?}", a, b);
        }
        let (meta, written) = (&back.meta, &log.meta);
        prop_assert_eq!(meta.body_axes, written.body_axes);
        prop_assert_eq!(meta.initial_heading_deg, written.initial_heading_deg);
        prop_assert_eq!(meta.grade, written.grade);
        prop_assert_eq!(meta.lever_arm_rfu_m, written.lever_arm_rfu_m);
        prop_assert_eq!(meta.document.get("note"), written.document.get("note"));
        prop_assert_eq!(meta.document["log"].get("own"), written.document["log"].get("own"));
    }
}

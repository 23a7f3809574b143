//! Input sequences found by a fuzzer, which once led to infinite numbers, and random variations of them.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::unwrap_used, clippy::indexing_slicing, clippy::eq_op)]

use ins_core::config::{Feedback, HeadingSource};
use ins_core::earth::LatLon;
use ins_core::{
    BaroHeight, Config, Estimate, FixSigma, GnssFix, Heading, ImuOutput, ImuSample, Navigator, Time,
};
use proptest::prelude::*;

/// Bytes decoded as inputs of any kind, in any order.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn i16_at(&self, at: usize) -> i16 {
        i16::from_le_bytes([self.0[at], self.0[at + 1]])
    }

    fn eight_bytes(&self, at: usize) -> [u8; 8] {
        self.0[at..at + 8].try_into().unwrap()
    }

    /// Any number at all, or one of a credible size.
    fn number_at(&self, at: usize) -> f64 {
        match self.0[at] % 4 {
            0 => f64::from_le_bytes(self.eight_bytes(at + 1)),
            1 => f64::from(self.i16_at(at + 1)) / 1000.0,
            2 => f64::from(self.i16_at(at + 1)) / 10.0,
            _ => f64::from(self.0[at + 1].cast_signed()),
        }
    }

    fn bit(&self, at: usize, bit: u8) -> bool {
        self.0[at] >> bit & 1 != 0
    }

    /// A number that is present if its bit is clear.
    fn optional(&self, bit: u8, at: usize) -> Option<f64> {
        (!self.bit(9, bit)).then(|| self.number_at(at))
    }

    fn config(&self) -> Config {
        let mut config = if self.bit(0, 0) {
            Config::hg1700()
        } else {
            Config::mems()
        };
        #[cfg(feature = "literal")]
        if self.bit(0, 1) {
            config.form = ins_core::config::Form::Literal;
        }
        if self.bit(0, 2) {
            config.feedback = Feedback::Open;
        }
        if self.bit(0, 3) {
            config.imu_output = ImuOutput::Increments;
        }
        if self.bit(0, 4) {
            config.heading = HeadingSource::Given(0.3);
        }
        config
    }

    fn sample(&self, time: Time) -> ImuSample {
        let [gx, gy, gz, ax, ay, az] = [3, 7, 9, 11, 13, 15].map(|at| self.number_at(at));
        ImuSample {
            time,
            gyro: [gx, gy, gz].into(),
            accel: [ax, ay, 9.8 + az].into(),
        }
    }

    fn fix(&self, time: Time) -> GnssFix {
        let has_position = !self.bit(9, 0);
        GnssFix {
            time,
            position: has_position.then(|| LatLon {
                latitude_rad: self.number_at(10),
                longitude_rad: self.number_at(12),
            }),
            height_m: has_position.then(|| self.number_at(14)),
            velocity_en_mps: (!self.bit(9, 1))
                .then(|| [self.number_at(16), self.number_at(18)].into()),
            velocity_up_mps: self.optional(2, 19),
            sigma: FixSigma {
                velocity_mps: self.optional(3, 20),
                ..FixSigma::default()
            },
        }
    }

    /// Microseconds since the last time stamp: backward, forward, none, far forward, or the sampling interval.
    fn step(&self) -> i64 {
        let unsigned = i64::from(self.i16_at(1).cast_unsigned());
        match self.0[0] % 8 {
            0 => -1000 * i64::from(self.i16_at(1)),
            1 => 100 * unsigned,
            2 => 0,
            3 => 100_000 * unsigned,
            _ => 10_000,
        }
    }
}

fn assert_finite(navigator: &Navigator) {
    // False if there is a NaN.
    assert!(navigator == navigator);
    let health = navigator.health();
    assert!(health == health, "{health:?}");
    if let Some(motion) = navigator.body_motion() {
        let numbers = motion.rate_radps.iter().chain(motion.force_mps2.iter());
        assert!(numbers.clone().all(|x| x.is_finite()), "{motion:?}");
    }
    let calibration = navigator.calibration();
    let warm = Navigator::warm(*navigator.config(), &calibration);
    assert!(warm.is_ok(), "{calibration:?}");
    if let Some(solution) = navigator.solution() {
        let position = solution.position;
        let numbers = [
            position.latitude_rad,
            position.longitude_rad,
            position.height_m,
        ];
        assert!(numbers.iter().all(|x| x.is_finite()), "{solution:?}");
        assert!(position.latitude_rad.abs() <= core::f64::consts::FRAC_PI_2);
        let velocity = solution.velocity_enu_mps;
        assert!(velocity.iter().all(|v| v.is_finite()), "{solution:?}");
        assert!((solution.attitude.norm() - 1.0).abs() < 1e-6);
    }
    let sigma = navigator.sigma();
    let spreads = sigma.map(|s| [s.position_m, s.velocity_mps, s.attitude_rad]);
    for spread in spreads.iter().flatten().flat_map(|s| s.iter()) {
        assert!(spread.is_finite() && *spread >= 0.0, "{sigma:?}");
    }
    let e = navigator.estimates();
    let single = [
        e.azimuth_error_rad,
        e.gnss_latency_s,
        e.gnss_latency_now_s,
        e.clock_drift,
        e.turn_scale,
    ];
    let three = [
        e.accel_bias_mps2,
        e.gyro_bias_radps,
        e.accel_scale,
        e.gyro_scale,
        e.gyro_misalignment_rad,
        e.lever_arm_m,
    ];
    let sound = |e: &Estimate| e.value.is_finite() && e.sigma.is_finite() && e.sigma >= 0.0;
    assert!(
        single.iter().chain(three.iter().flatten()).all(sound),
        "{e:?}"
    );
}

/// The first byte selects the configuration; each 32 that follow are a fix or a sample, repeated.
fn run(bytes: &[u8]) {
    let mut navigator = Navigator::new(Bytes(bytes).config()).unwrap();
    let mut micros = 0_i64;
    for chunk in bytes[1..].chunks_exact(32) {
        let (kind, rest) = (chunk[0], Bytes(&chunk[1..]));
        micros = micros.saturating_add(rest.step());
        let stamp = if rest.0[0] == 255 {
            i64::from_le_bytes(rest.eight_bytes(1))
        } else {
            micros
        };
        let time = Time::from_micros(stamp);
        if kind.is_multiple_of(5) {
            let _ = navigator.on_heading(&Heading {
                time,
                heading_rad: rest.number_at(10),
                sigma_rad: rest.number_at(12),
            });
        }
        if kind.is_multiple_of(7) {
            let _ = navigator.on_baro(&BaroHeight {
                time,
                height_m: rest.number_at(10),
                sigma_m: rest.number_at(12),
            });
        }
        if kind.is_multiple_of(3) {
            let _ = navigator.on_gnss(&rest.fix(time));
        } else {
            let sample = rest.sample(time);
            let _ = navigator.on_imu(&sample);
            for _ in 0..kind / 4 {
                micros = micros.saturating_add(10_000);
                let time = Time::from_micros(micros);
                let _ = navigator.on_imu(&ImuSample { time, ..sample });
            }
        }
        assert_finite(&navigator);
    }
}

const LATENCY: &[u8] = include_bytes!("fuzzed/latency_not_finite.bin");

#[test]
fn latency_stays_finite() {
    run(LATENCY);
}

/// Half a minute at rest: ten fixes a second and a hundred samples, all of them zero.
fn at_rest() -> Vec<u8> {
    let mut bytes = vec![0];
    for _ in 0..300 {
        // No time step; all components but the sigma.
        let mut fix = [0; 32];
        (fix[1], fix[10]) = (2, 8);
        for (at, kind) in [(10, 3), (12, 3), (14, 3), (16, 3), (18, 1), (19, 3)] {
            fix[at + 1] = kind;
        }
        bytes.extend(fix);
        let mut sample = [0; 32];
        (sample[0], sample[1]) = (4 * 9 + 1, 4);
        for at in [3, 7, 9, 11, 13, 15] {
            sample[at + 1] = 3;
        }
        bytes.extend(sample);
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Random changes of single bytes and of whole inputs.
    #[test]
    fn no_input_leads_to_infinite_numbers(
        config in any::<u8>(),
        fuzzed in any::<bool>(),
        bytes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..60),
        inputs in prop::collection::vec((any::<prop::sample::Index>(), any::<[u8; 32]>()), 0..20),
    ) {
        let mut sequence = if fuzzed { LATENCY.to_vec() } else { at_rest() };
        sequence[0] = config;
        let count = sequence.len() / 32;
        for (index, input) in inputs {
            let at = 1 + 32 * index.index(count);
            sequence[at..at + 32].copy_from_slice(&input);
        }
        for (index, byte) in bytes {
            let at = index.index(sequence.len());
            sequence[at] = byte;
        }
        run(&sequence);
    }
}

//! Detection of parameter jumps from innovations along their partials, not by noise or wrong fixes.
#![allow(clippy::disallowed_methods)]

use super::{AZIMUTH, INITIAL_LATENCY, Jump, JumpTest, LATENCY};
use crate::deviates::Deviates;

/// Ten fixes a second, of this standard deviation.
const FIX_S: f64 = 0.1;
const SIGMA: f64 = 0.05;
/// Variance of the azimuth, rad^2.
const VARIANCE: f64 = 1e-6;

/// Partial of a fix by azimuth, in manoeuvres that change direction.
fn partial(fix: u32) -> [f64; 2] {
    let phase = 0.02 * f64::from(fix);
    [phase.cos(), (1.7 * phase).sin()].map(|partial| 5.0 * partial)
}

/// Fixes until a jump is detected, tested once a second, and its square.
fn detected(fixes: u32, mut signal: impl FnMut(u32) -> [f64; 2]) -> Option<(u32, f64)> {
    let (mut jump, mut deviates) = (Jump::default(), Deviates(7));
    (0..fixes).find_map(|fix| {
        let innovation = signal(fix).map(|signal| signal + SIGMA * f64::from(deviates.next()));
        jump.add(
            &innovation.into(),
            &partial(fix).into(),
            SIGMA * SIGMA,
            FIX_S,
            &AZIMUTH,
        );
        let is_due = fix % 10 == 9;
        let square = is_due
            .then(|| jump.detect(VARIANCE, 1.0, &AZIMUTH))
            .flatten();
        square.map(|square| (fix, square))
    })
}

#[test]
fn a_jump_is_detected_within_seconds_with_its_size() {
    for size in [0.03, -0.3] {
        let innovation_of_jump = |fix| {
            let after = if fix < 600 { 0.0 } else { size };
            partial(fix).map(|partial| after * partial)
        };
        let (fix, square) = detected(2000, innovation_of_jump).unwrap_or_default();
        // The least time is thirty fixes, more if the interval includes some before the jump.
        assert!((629..700).contains(&fix), "{fix}");
        // Up to twice the size, and less if so.
        let stated = square.sqrt() / f64::abs(size);
        assert!((0.5..2.1).contains(&stated), "{stated}");
    }
}

#[test]
fn a_jump_is_detected_in_noise_of_its_own_size() {
    let innovation_of_jump = |fix| {
        let after = if fix < 600 { 0.0 } else { 0.01 };
        partial(fix).map(|partial| after * partial)
    };
    let (fix, _) = detected(2000, innovation_of_jump).unwrap_or_default();
    assert!((629..700).contains(&fix), "{fix}");
}

/// Ten hours: no false alarm at five sigmas and three seconds of agreement.
#[test]
fn noise_triggers_no_jump() {
    assert_eq!(detected(360_000, |_| [0.0; 2]), None);
}

/// A burst of a second is large but too short to follow the partials.
#[test]
fn wrong_fixes_trigger_no_jump() {
    let one = |fix| [if fix == 700 { 50.0 } else { 0.0 }; 2];
    assert_eq!(detected(2000, one), None);
    let second = |fix| [if (700..710).contains(&fix) { 2.0 } else { 0.0 }; 2];
    assert_eq!(detected(2000, second), None);
    // Many bursts of different directions.
    let many = |fix: u32| {
        let angle = f64::from(fix / 10 * 10);
        if fix % 100 < 10 {
            [2.0 * angle.cos(), 2.0 * angle.sin()]
        } else {
            [0.0; 2]
        }
    };
    assert_eq!(detected(20_000, many), None);
}

/// A tilted platform causes a constant innovation, as a latency jump does in a constant acceleration. With an
/// estimated offset only changes count.
#[test]
fn a_constant_offset_is_no_latency_jump() {
    let detect_jump = |with_offset: bool, signal: f64| {
        let (mut jump, mut deviates) = (Jump::default(), Deviates(3));
        let test = JumpTest {
            with_offset,
            ..AZIMUTH
        };
        (0..400).any(|fix| {
            let oscillation = 0.3 * (0.05 * f64::from(fix)).sin();
            let partial = [2.0 + oscillation, -1.0];
            let innovation = [0.4 + signal * oscillation, -0.2].map(|mean| {
                let noise = f64::from(deviates.next());
                mean + SIGMA * noise
            });
            jump.add(
                &innovation.into(),
                &partial.into(),
                SIGMA * SIGMA,
                FIX_S,
                &test,
            );
            jump.detect(VARIANCE, 1.0, &test).is_some()
        })
    };
    assert!(detect_jump(false, 0.0));
    assert!(!detect_jump(true, 0.0));
    assert!(detect_jump(true, 0.3));
}

/// A latency error of whole gait cycles is consistent with all steps but not with bends, one in twenty seconds.
/// Accelerations of a walk, forward in a bend and sideways in a step, m/s^2.
#[test]
fn a_latency_error_of_whole_gait_cycles_is_detected_in_bends() {
    let detect_jump = |test: &JumpTest, error_s: f64| {
        let (mut jump, mut deviates) = (Jump::default(), Deviates(5));
        (0..3000).find(|fix| {
            let time_s = FIX_S * f64::from(*fix);
            let forward = if time_s % 20.0 < 2.0 { 1.0 } else { 0.0 };
            let side = 1.3 * (7.5 * time_s).sin();
            let noise = [0, 1].map(|_| SIGMA * f64::from(deviates.next()));
            let innovation = [error_s * forward + noise[0], noise[1]];
            let partial = [forward, side];
            jump.add(
                &innovation.into(),
                &partial.into(),
                SIGMA * SIGMA,
                FIX_S,
                test,
            );
            fix % 10 == 9 && jump.detect(VARIANCE, 1.0, test).is_some()
        })
    };
    // Three bends, averaged, are the least time of detection.
    let detected = detect_jump(&INITIAL_LATENCY, 0.4);
    assert!(
        detected.is_some_and(|fix| (400..1000).contains(&fix)),
        "{detected:?}"
    );
    assert_eq!(detect_jump(&INITIAL_LATENCY, 0.0), None);
    // Not detectable among steps that are consistent with it.
    assert_eq!(detect_jump(&LATENCY, 0.4), None);
}

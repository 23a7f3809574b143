//! A jump shows in innovations that point where it would; noise and wrong fixes do not.
#![allow(clippy::disallowed_methods)]

use super::{AZIMUTH, INITIAL_LATENCY, Jump, JumpTest, LATENCY};
use crate::deviates::Deviates;

/// Ten fixes a second, of this standard deviation.
const FIX_S: f64 = 0.1;
const SIGMA: f64 = 0.05;
/// What is known of the azimuth, rad^2.
const KNOWN: f64 = 1e-6;

/// What a unit of azimuth adds to a fix: manoeuvres that change direction.
fn by(fix: u32) -> [f64; 2] {
    let phase = 0.02 * f64::from(fix);
    [phase.cos(), (1.7 * phase).sin()].map(|by| 5.0 * by)
}

/// Fixes until a jump is found, looked for once a second, and its square.
fn found(fixes: u32, mut wrong: impl FnMut(u32) -> [f64; 2]) -> Option<(u32, f64)> {
    let (mut jump, mut deviates) = (Jump::default(), Deviates(7));
    (0..fixes).find_map(|fix| {
        let innovation = wrong(fix).map(|wrong| wrong + SIGMA * f64::from(deviates.next()));
        jump.add(
            &innovation.into(),
            &by(fix).into(),
            SIGMA * SIGMA,
            FIX_S,
            &AZIMUTH,
        );
        let look = fix % 10 == 9;
        let square = look.then(|| jump.detect(KNOWN, 1.0, &AZIMUTH)).flatten();
        square.map(|square| (fix, square))
    })
}

#[test]
fn a_jump_is_found_within_seconds_and_as_large_as_it_is() {
    for size in [0.03, -0.3] {
        let shown = |fix| {
            let after = if fix < 600 { 0.0 } else { size };
            by(fix).map(|by| after * by)
        };
        let (fix, square) = found(2000, shown).unwrap_or_default();
        // The least time, thirty fixes, and more where noise had made it look back before the jump.
        assert!((629..700).contains(&fix), "{fix}");
        // Twice the size, thinned by that.
        let stated = square.sqrt() / f64::abs(size);
        assert!((0.5..2.1).contains(&stated), "{stated}");
    }
}

/// Of innovations that are twice what they should be half is noise, whatever the other half is.
#[test]
fn a_jump_is_found_in_noise_of_its_own_size() {
    let shown = |fix| {
        let after = if fix < 600 { 0.0 } else { 0.01 };
        by(fix).map(|by| after * by)
    };
    let (fix, _) = found(2000, shown).unwrap_or_default();
    assert!((629..700).contains(&fix), "{fix}");
}

/// Ten hours: at five sigmas, and three seconds of agreement, chance has no say.
#[test]
fn noise_is_no_jump() {
    assert_eq!(found(360_000, |_| [0.0; 2]), None);
}

/// A burst of a second is large in its sigmas, and too short to point where a jump does.
#[test]
fn wrong_fixes_are_no_jump() {
    let one = |fix| [if fix == 700 { 50.0 } else { 0.0 }; 2];
    assert_eq!(found(2000, one), None);
    let second = |fix| [if (700..710).contains(&fix) { 2.0 } else { 0.0 }; 2];
    assert_eq!(found(2000, second), None);
    // And many, each elsewhere.
    let many = |fix: u32| {
        let angle = f64::from(fix / 10 * 10);
        if fix % 100 < 10 {
            [2.0 * angle.cos(), 2.0 * angle.sin()]
        } else {
            [0.0; 2]
        }
    };
    assert_eq!(found(20_000, many), None);
}

/// A platform that was tipped leans on what it feels: that goes on the same way, as a latency's jump does
/// while a vehicle gathers speed. Beside such a pull only what changes counts.
#[test]
fn what_stays_as_it_is_is_no_jump_of_a_latency() {
    let looked = |with_offset: bool, wrong: f64| {
        let (mut jump, mut deviates) = (Jump::default(), Deviates(3));
        let test = JumpTest {
            with_offset,
            ..AZIMUTH
        };
        (0..400).any(|fix| {
            let swing = 0.3 * (0.05 * f64::from(fix)).sin();
            let by = [2.0 + swing, -1.0];
            let innovation = [0.4 + wrong * swing, -0.2].map(|shown| {
                let noise = f64::from(deviates.next());
                shown + SIGMA * noise
            });
            jump.add(&innovation.into(), &by.into(), SIGMA * SIGMA, FIX_S, &test);
            jump.detect(KNOWN, 1.0, &test).is_some()
        })
    };
    assert!(looked(false, 0.0));
    assert!(!looked(true, 0.0));
    assert!(looked(true, 0.3));
}

/// A latency that is whole steps off explains all steps, and no bend, of which there is one in twenty seconds:
/// accelerations of a walk, a bend's forward and a step's to the side, m/s^2.
#[test]
fn a_latency_that_is_whole_steps_off_is_found_by_bends() {
    let looked = |test: &JumpTest, off_s: f64| {
        let (mut jump, mut deviates) = (Jump::default(), Deviates(5));
        (0..3000).find(|fix| {
            let time_s = FIX_S * f64::from(*fix);
            let bend = if time_s % 20.0 < 2.0 { 1.0 } else { 0.0 };
            let step = 1.3 * (7.5 * time_s).sin();
            let noise = [0, 1].map(|_| SIGMA * f64::from(deviates.next()));
            let innovation = [off_s * bend + noise[0], noise[1]];
            let by = [bend, step];
            jump.add(&innovation.into(), &by.into(), SIGMA * SIGMA, FIX_S, test);
            fix % 10 == 9 && jump.detect(KNOWN, 1.0, test).is_some()
        })
    };
    // Three bends and what is left of each in the mean make the least time in which it is seen.
    let found = looked(&INITIAL_LATENCY, 0.4);
    assert!(
        found.is_some_and(|fix| (400..1000).contains(&fix)),
        "{found:?}"
    );
    assert_eq!(looked(&INITIAL_LATENCY, 0.0), None);
    // Among steps that it explains it is lost.
    assert_eq!(looked(&LATENCY, 0.4), None);
}

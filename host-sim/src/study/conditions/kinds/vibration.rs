//! Vibration and oscillation superposed on the motion of a vehicle.

use crate::sim::motion::{Envelope, Harmonic};

type Vibration = (Envelope, Vec<Harmonic>);

fn harmonic(hz: f64, velocity_mps: [f64; 3], rotation_rad: [f64; 3]) -> Harmonic {
    Harmonic {
        hz,
        velocity_mps,
        rotation_rad,
    }
}

/// A velocity oscillation of one frequency, larger along the track than across.
pub fn velocity_oscillation(hz: f64, amplitude_mps: f64) -> Vibration {
    let amplitudes = [0.3, 1.0, 0.5].map(|part| part * amplitude_mps);
    (Envelope::Always, vec![harmonic(hz, amplitudes, [0.0; 3])])
}

/// An engine, at a frequency and half of it: amplitudes of acceleration, m/s^2, and angular rate, rad/s.
pub fn engine(envelope: Envelope, hz: f64, accel_mps2: f64, rate_radps: f64) -> Vibration {
    let line = |hz: f64, part: f64| {
        let omega = core::f64::consts::TAU * hz;
        let velocity = part * accel_mps2 / omega;
        let rotation = part * rate_radps / omega;
        harmonic(
            hz,
            [0.7 * velocity, 0.4 * velocity, velocity],
            [0.6 * rotation, rotation, 0.3 * rotation],
        )
    };
    (envelope, vec![line(hz, 1.0), line(0.5 * hz, 0.5)])
}

/// A cab on its suspension: slow sway, deg, only at low speed.
pub fn sway(hz: f64, degrees: f64) -> Vibration {
    let angle = degrees.to_radians();
    let harmonics = vec![harmonic(hz, [0.0; 3], [0.6 * angle, angle, 0.1 * angle])];
    (Envelope::Standing(3.0), harmonics)
}

/// Waves: roll and pitch, deg, heave, m/s; two frequencies that beat.
pub fn waves(period_s: f64, roll_deg: f64, heave_mps: f64) -> Vibration {
    let roll = roll_deg.to_radians();
    let line = |hz: f64, part: f64| {
        harmonic(
            hz,
            [
                0.3 * part * heave_mps,
                0.2 * part * heave_mps,
                part * heave_mps,
            ],
            [0.5 * part * roll, part * roll, 0.2 * part * roll],
        )
    };
    let hz = 1.0 / period_s;
    (Envelope::Always, vec![line(hz, 0.7), line(1.3 * hz, 0.4)])
}

/// Steps of a walker: heave at the step frequency, sway and turns at half of it.
pub fn steps(steps_hz: f64, heave_mps: f64, turn_deg: f64) -> Vibration {
    let turn = turn_deg.to_radians();
    let harmonics = vec![
        harmonic(
            steps_hz,
            [0.0, 0.4 * heave_mps, heave_mps],
            [0.5 * turn, 0.0, 0.0],
        ),
        harmonic(
            0.5 * steps_hz,
            [0.5 * heave_mps, 0.0, 0.0],
            [0.0, 0.7 * turn, turn],
        ),
    ];
    (Envelope::Moving(0.4), harmonics)
}

//! Gains of the observer: the Riccati recursion of one channel.

/// Variances of `dV' = g phi`, `phi' = white`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channel {
    /// Of dV, (m/s)^2.
    pub velocity: f64,
    cross: f64,
    /// Of phi, rad^2.
    pub tilt: f64,
}

impl Channel {
    /// Starts with a variance of the tilt, rad^2.
    pub fn new(tilt: f64) -> Self {
        Self {
            // A metre per second: what a first fix may be wrong by, latency included.
            velocity: 1.0,
            cross: 0.0,
            tilt,
        }
    }

    /// Carries it over a span: specific force up, m/s, and the noise of each part.
    pub fn propagate(&mut self, force_up: f64, dt: f64, velocity_noise: f64, tilt_noise: f64) {
        self.velocity += force_up * (2.0 * self.cross + force_up * self.tilt)
            + velocity_noise * dt
            + tilt_noise * dt * force_up * force_up / 3.0;
        self.cross += force_up * (self.tilt + 0.5 * tilt_noise * dt);
        self.tilt += tilt_noise * dt;
    }

    /// More may be wrong by these variances.
    pub fn doubt(&mut self, velocity: f64, tilt: f64) {
        self.velocity += velocity;
        self.tilt += tilt;
    }

    /// Takes in one fix; returns the gains on velocity and tilt.
    pub fn update(&mut self, noise: f64) -> (f64, f64) {
        let total = self.velocity + noise;
        let (gain_velocity, gain_tilt) = (self.velocity / total, self.cross / total);
        self.tilt -= gain_tilt * self.cross;
        self.velocity *= 1.0 - gain_velocity;
        self.cross *= 1.0 - gain_velocity;
        (gain_velocity, gain_tilt)
    }
}

//! A GNSS receiver with errors, thesis equation (5).

use ins_core::{FixSigma, GnssFix, Time};
use nalgebra::Vector3;

use super::errors::GnssModel;
use super::ideal::{TrueState, displaced};
use super::lever::Antenna;
use super::noise::Random;
use super::receiver::{Correlated, Habits, Stated, Up, Wrong};
use ins_core::earth::Geodetic;

/// The receiver of one run.
#[derive(Clone, Debug)]
pub struct Gnss {
    model: GnssModel,
    latency_s: f64,
    next: u32,
    velocity_noise: Random,
    position_noise: Random,
    velocity_memory: [Memory; 3],
    position_memory: [Memory; 3],
    outliers: Random,
    smoothed: Option<Smoothed>,
    last_good: Option<GnssFix>,
}

/// What a smoothing receiver remembers of the last epoch.
#[derive(Clone, Copy, Debug)]
struct Smoothed {
    position: Geodetic,
    velocity_mps: Vector3<f64>,
}

impl Gnss {
    /// Draws the errors of run `seed`.
    pub fn new(model: &GnssModel, seed: u64) -> Self {
        let habits = &model.habits;
        let period_s = 1.0 / model.rate_hz;
        let memory = |noise: &Correlated, name: &str| {
            Memory::new(noise, period_s, Random::stream(seed, name))
        };
        let (v, h, z) = (&habits.velocity, &habits.horizontal, &habits.vertical);
        Self {
            latency_s: Random::stream(seed, "gnss latency").uniform(model.latency_s),
            next: 0,
            velocity_noise: Random::stream(seed, "gnss velocity"),
            position_noise: Random::stream(seed, "gnss position"),
            velocity_memory: [
                memory(v, "gnss velocity east"),
                memory(v, "gnss velocity north"),
                memory(v, "gnss velocity up"),
            ],
            position_memory: [
                memory(h, "gnss position east"),
                memory(h, "gnss position north"),
                memory(z, "gnss height"),
            ],
            outliers: Random::stream(seed, "gnss outliers"),
            smoothed: None,
            last_good: None,
            model: model.clone(),
        }
    }

    /// The latency of this run at its start.
    pub fn latency_s(&self) -> f64 {
        self.latency_s
    }

    /// The latency at a stamp, with what the clock has gained by then and what smoothing lags
    /// behind a steady change.
    pub fn latency_at_s(&self, stamp_s: f64) -> f64 {
        let keep = self.smoothing_keep();
        let lag_s = keep / ((1.0 - keep) * self.model.rate_hz);
        self.latency_s + self.model.habits.clock_drift * stamp_s + lag_s
    }

    /// Part of the last epoch that a smoothed one keeps.
    fn smoothing_keep(&self) -> f64 {
        let time_s = self.model.habits.smoothing_s;
        if time_s > 0.0 {
            libm::exp(-1.0 / (self.model.rate_hz * time_s))
        } else {
            0.0
        }
    }

    /// Adds the fixes that show the motion between two states.
    pub fn observe(&mut self, from: &TrueState, to: &TrueState, fixes: &mut Vec<GnssFix>) {
        loop {
            let stamp_s = f64::from(self.next) / self.model.rate_hz;
            let shown_s = stamp_s - self.latency_s - self.model.habits.clock_drift * stamp_s;
            if shown_s >= to.solution.time.as_seconds() {
                return;
            }
            self.next += 1;
            // Drawn whether the fix appears or not: an outage leaves the rest as it was.
            let noise = self.noise(stamp_s);
            let outlier = self.outlier();
            if shown_s < from.solution.time.as_seconds() {
                continue;
            }
            let antenna = Antenna::between(from, to, shown_s, &self.model.habits.lever_arm_m);
            let seen = self.smooth(
                displaced(&antenna.position, &noise.position_m),
                antenna.velocity_enu_mps + noise.velocity_mps,
            );
            if !self.is_out(stamp_s) {
                let position = displaced(&seen.position, &outlier.position_m);
                let velocity = seen.velocity_mps + outlier.velocity_mps;
                self.log(stamp_s, &position, &velocity, fixes);
            }
        }
    }

    /// White and correlated noise of the next epoch.
    fn noise(&mut self, stamp_s: f64) -> Errors {
        let velocity_noise = Vector3::from(self.velocity_noise.normal3());
        let position_noise = Vector3::from(self.position_noise.normal3());
        let GnssModel {
            horizontal_sigma_m,
            vertical_sigma_m,
            velocity_sigma_mps,
            ..
        } = self.model;
        let sigmas = Vector3::new(horizontal_sigma_m, horizontal_sigma_m, vertical_sigma_m);
        let remembered =
            |memory: &mut [Memory; 3]| Vector3::from(memory.each_mut().map(Memory::step));
        let times = self.noise_times(stamp_s);
        Errors {
            velocity_mps: times
                * (velocity_sigma_mps * velocity_noise + remembered(&mut self.velocity_memory)),
            position_m: times
                * (sigmas.component_mul(&position_noise) + remembered(&mut self.position_memory)),
        }
    }

    fn noise_times(&self, stamp_s: f64) -> f64 {
        let troubles = self.model.habits.troubles.iter();
        troubles
            .filter(|trouble| trouble.holds(stamp_s))
            .find_map(|trouble| match trouble.wrong {
                Wrong::Noisy(times) => Some(times),
                _ => None,
            })
            .unwrap_or(1.0)
    }

    fn outlier(&mut self) -> Errors {
        let outliers = self.model.habits.outliers;
        if outliers.fraction > 0.0 && self.outliers.chance(outliers.fraction) {
            Errors {
                velocity_mps: outliers.velocity_mps * Vector3::from(self.outliers.normal3()),
                position_m: outliers.position_m * Vector3::from(self.outliers.normal3()),
            }
        } else {
            Errors::default()
        }
    }

    fn smooth(&mut self, position: Geodetic, velocity_mps: Vector3<f64>) -> Smoothed {
        let keep = self.smoothing_keep();
        let now = match self.smoothed {
            Some(last) if keep > 0.0 => Smoothed {
                position: displaced(&position, &(keep * last.position.enu_from(&position))),
                velocity_mps: velocity_mps + keep * (last.velocity_mps - velocity_mps),
            },
            _ => Smoothed {
                position,
                velocity_mps,
            },
        };
        self.smoothed = Some(now);
        now
    }

    /// Adds what the log has of one epoch.
    fn log(
        &mut self,
        stamp_s: f64,
        position: &Geodetic,
        velocity: &Vector3<f64>,
        fixes: &mut Vec<GnssFix>,
    ) {
        let time = Time::default().plus_seconds(stamp_s);
        let good = self.fix(time, position, velocity);
        let habits = &self.model.habits;
        let trouble = habits.troubles.iter().find(|trouble| {
            trouble.holds(stamp_s) && !matches!(trouble.wrong, Wrong::Noisy(_))
        });
        let fix = match trouble {
            None => {
                self.last_good = Some(good);
                good
            }
            Some(trouble) => {
                let since_s = stamp_s - trouble.start_s;
                match trouble.wrong {
                    Wrong::ZeroVelocity => self.fix(time, position, &Vector3::zeros()),
                    Wrong::Off {
                        velocity_mps,
                        position_m,
                    } => {
                        let off = Vector3::from(velocity_mps);
                        let away = Vector3::from(position_m) + since_s * off;
                        self.fix(time, &displaced(position, &away), &(velocity + off))
                    }
                    Wrong::Zeros => self.fix(time, &Geodetic::default(), &Vector3::zeros()),
                    Wrong::Stuck => GnssFix {
                        time,
                        ..self.last_good.unwrap_or(good)
                    },
                    Wrong::Noisy(_) => good,
                }
            }
        };
        let times = self.model.habits.logged_times;
        fixes.extend((0..times).map(|copy| {
            let later_s = f64::from(copy) / (f64::from(times) * self.model.rate_hz);
            GnssFix {
                time: Time::default().plus_seconds(stamp_s + later_s),
                ..fix
            }
        }));
    }

    /// What is measured, less what this receiver does not give.
    fn fix(&self, time: Time, position: &Geodetic, velocity: &Vector3<f64>) -> GnssFix {
        let habits = &self.model.habits;
        let gives_up = habits.gives_velocity && habits.up != Up::Missing;
        let up_mps = match habits.up {
            Up::Given | Up::Missing => velocity.z,
            Up::Zero => 0.0,
            Up::Down => -velocity.z,
        };
        let stated = self.stated_sigma();
        GnssFix {
            time,
            position: habits.gives_position.then(|| position.lat_lon()),
            height_m: habits.gives_height.then_some(position.height_m),
            velocity_en_mps: habits.gives_velocity.then(|| velocity.xy()),
            velocity_up_mps: gives_up.then_some(up_mps),
            sigma: FixSigma {
                position_m: stated.position_m.filter(|_| habits.gives_position),
                height_m: stated.height_m.filter(|_| habits.gives_height),
                velocity_mps: stated.velocity_mps.filter(|_| habits.gives_velocity),
                velocity_up_mps: stated.velocity_up_mps.filter(|_| gives_up),
            },
        }
    }

    fn stated_sigma(&self) -> FixSigma {
        let habits = &self.model.habits;
        let stated = |white: f64, correlated: &Correlated| {
            let sigma = match habits.stated {
                Stated::Nothing => 0.0,
                Stated::LevelVelocity | Stated::White => white,
                Stated::All => libm::hypot(white, correlated.sigma),
            };
            (sigma > 0.0).then_some(sigma)
        };
        let velocity_mps = stated(self.model.velocity_sigma_mps, &habits.velocity);
        if habits.stated == Stated::LevelVelocity {
            return FixSigma {
                velocity_mps,
                ..FixSigma::default()
            };
        }
        FixSigma {
            position_m: stated(self.model.horizontal_sigma_m, &habits.horizontal),
            height_m: stated(self.model.vertical_sigma_m, &habits.vertical),
            velocity_mps,
            velocity_up_mps: velocity_mps,
        }
    }

    fn is_out(&self, time_s: f64) -> bool {
        self.model.outages.iter().any(|out| out.holds(time_s))
    }
}

/// Errors of one epoch, ENU.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    velocity_mps: Vector3<f64>,
    position_m: Vector3<f64>,
}

/// A Gauss-Markov process, stationary from the start.
#[derive(Clone, Debug)]
struct Memory {
    value: f64,
    keep: f64,
    sigma: f64,
    random: Random,
}

impl Memory {
    fn new(noise: &Correlated, step_s: f64, mut random: Random) -> Self {
        Self {
            value: noise.sigma * random.normal(),
            keep: libm::exp(-step_s / noise.time_s),
            sigma: noise.sigma,
            random,
        }
    }

    /// The value now; then one step on.
    fn step(&mut self) -> f64 {
        let now = self.value;
        if self.sigma > 0.0 {
            let fresh = (1.0 - self.keep * self.keep).sqrt();
            self.value = self.keep * now + self.sigma * fresh * self.random.normal();
        }
        now
    }
}

/// When each fix arrives: later than its stamp by the receiver's delay. None overtakes another.
pub fn arrivals(fixes: &[GnssFix], habits: &Habits, seed: u64) -> Vec<Time> {
    let mut delays = Random::stream(seed, "gnss delay");
    let mut last: Option<Time> = None;
    let arrival = |fix: &GnssFix| {
        let due = fix.time.plus_seconds(delays.uniform(habits.delay_s));
        let at = last.map_or(due, |last| last.max(due));
        last = Some(at);
        at
    };
    fixes.iter().map(arrival).collect()
}

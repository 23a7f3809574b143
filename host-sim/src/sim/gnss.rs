//! A GNSS receiver with errors, thesis equation (5).

use ins_core::earth::Geodetic;
use ins_core::{FixSigma, GnssFix, Time};
use nalgebra::Vector3;

use super::errors::GnssModel;
use super::ideal::{Antenna, TrueState, displaced};
use super::noise::{GaussMarkov, Random};
use super::receiver::{Correlated, Habits, Stated, Up, Wrong};

#[derive(Clone, Debug)]
pub struct Gnss {
    model: GnssModel,
    /// The latency of this run at its start.
    pub latency_s: f64,
    next: u32,
    velocity_noise: Random,
    position_noise: Random,
    velocity_correlated: [GaussMarkov; 3],
    position_correlated: [GaussMarkov; 3],
    outliers: Random,
    /// Last epoch of a smoothing receiver.
    smoothed: Option<Antenna>,
    /// Last position, for velocity by differences.
    last_position: Option<Geodetic>,
    /// Position hold.
    held_position: Option<Geodetic>,
    /// Last epoch without a fault.
    last_valid: Option<(Time, Antenna)>,
}

impl Gnss {
    pub fn new(model: &GnssModel, seed: u64) -> Self {
        let habits = &model.habits;
        let period_s = 1.0 / model.rate_hz;
        let correlated = |noise: &Correlated, jumps: bool, name: &str| {
            GaussMarkov::new(noise, period_s, jumps, Random::stream(seed, name))
        };
        let (level, up) = (&habits.horizontal, &habits.vertical);
        Self {
            latency_s: Random::stream(seed, "gnss latency").uniform(model.latency_s),
            next: 0,
            velocity_noise: Random::stream(seed, "gnss velocity"),
            position_noise: Random::stream(seed, "gnss position"),
            velocity_correlated: ["east", "north", "up"]
                .map(|axis| correlated(&habits.velocity, false, &format!("gnss velocity {axis}"))),
            position_correlated: [
                (level, "gnss position east"),
                (level, "gnss position north"),
                (up, "gnss height"),
            ]
            .map(|(noise, name)| correlated(noise, habits.position_jumps, name)),
            outliers: Random::stream(seed, "gnss outliers"),
            smoothed: None,
            last_position: None,
            held_position: None,
            last_valid: None,
            model: model.clone(),
        }
    }

    /// The latency at a stamp, with clock drift.
    pub fn latency_at_s(&self, stamp_s: f64) -> f64 {
        self.latency_s + self.model.habits.clock_drift * stamp_s
    }

    /// Largest lag of its fixes beyond the latency: at a constant rate, by smoothing or by differencing,
    /// and at the last stamp of a fix that is logged several times.
    pub fn lag_s(&self) -> f64 {
        let habits = &self.model.habits;
        let times = f64::from(habits.logged_times);
        let half = if habits.velocity_by_differences {
            0.5
        } else {
            0.0
        };
        (self.model.smoothing_epochs() + 1.0 - 1.0 / times + half) / self.model.rate_hz
    }

    /// Adds the fixes that measure the motion between two states.
    pub fn observe(&mut self, from: &TrueState, to: &TrueState, fixes: &mut Vec<GnssFix>) {
        loop {
            let stamp_s = f64::from(self.next) / self.model.rate_hz;
            let shown_s = stamp_s - self.latency_at_s(stamp_s);
            if shown_s >= to.solution.time.as_seconds() {
                return;
            }
            self.next += 1;
            // Drawn in outages as well, which thereby leave other fixes unchanged.
            let noise = self.noise(stamp_s);
            let outlier = self.outlier();
            if shown_s < from.solution.time.as_seconds() {
                continue;
            }
            let antenna = Antenna::between(from, to, shown_s, &self.model.habits.lever_arm_m);
            let differenced = self.differenced(noise.added_to(&antenna));
            let smoothed = self.smooth(differenced);
            // In an outage as well: motion meanwhile ends the hold.
            let seen = self.hold(outlier.added_to(&smoothed));
            if !self.model.outages.iter().any(|out| out.contains(stamp_s)) {
                let fix = self.logged(stamp_s, &seen);
                let times = f64::from(self.model.habits.logged_times);
                fixes.extend((0..self.model.habits.logged_times).map(|copy| {
                    let later_s = f64::from(copy) / (times * self.model.rate_hz);
                    GnssFix {
                        time: Time::default().plus_seconds(stamp_s + later_s),
                        ..fix
                    }
                }));
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
        let correlated_step = |correlated: &mut [GaussMarkov; 3]| {
            Vector3::from(correlated.each_mut().map(GaussMarkov::step))
        };
        let times = self.noise_times(stamp_s);
        Errors {
            velocity_mps: times
                * (velocity_sigma_mps * velocity_noise
                    + correlated_step(&mut self.velocity_correlated)),
            position_m: times
                * (sigmas.component_mul(&position_noise)
                    + correlated_step(&mut self.position_correlated)),
        }
    }

    fn noise_times(&self, stamp_s: f64) -> f64 {
        let mut troubles = self.model.habits.troubles.iter();
        let noisy = troubles.find_map(|trouble| match trouble.wrong {
            Wrong::Noisy(times) if trouble.contains(stamp_s) => Some(times),
            _ => None,
        });
        noisy.unwrap_or(1.0)
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

    fn smooth(&mut self, seen: Antenna) -> Antenna {
        let factor = self.model.smoothing_factor();
        let last = self.smoothed.filter(|_| factor > 0.0);
        let now = last.map_or(seen, |last| {
            let off = Errors {
                velocity_mps: factor * (last.velocity_enu_mps - seen.velocity_enu_mps),
                position_m: if self.model.habits.smooths_position {
                    factor * last.position.enu_from(&seen.position)
                } else {
                    Vector3::zeros()
                },
            };
            off.added_to(&seen)
        });
        self.smoothed = Some(now);
        now
    }

    fn differenced(&mut self, seen: Antenna) -> Antenna {
        let last = self.last_position.replace(seen.position);
        match last.filter(|_| self.model.habits.velocity_by_differences) {
            Some(last) => Antenna {
                velocity_enu_mps: self.model.rate_hz * seen.position.enu_from(&last),
                ..seen
            },
            None => seen,
        }
    }

    fn hold(&mut self, seen: Antenna) -> Antenna {
        if seen.velocity_enu_mps.norm() >= self.model.habits.holds_below_mps {
            self.held_position = None;
            return seen;
        }
        Antenna {
            position: *self.held_position.get_or_insert(seen.position),
            velocity_enu_mps: Vector3::zeros(),
        }
    }

    fn logged(&mut self, stamp_s: f64, seen: &Antenna) -> GnssFix {
        let time = Time::default().plus_seconds(stamp_s);
        let (position, velocity) = (&seen.position, &seen.velocity_enu_mps);
        let good = self.fix(time, position, velocity);
        let mut troubles = self.model.habits.troubles.iter();
        let trouble = troubles
            .find(|trouble| trouble.contains(stamp_s) && !matches!(trouble.wrong, Wrong::Noisy(_)));
        let Some(trouble) = trouble else {
            self.last_valid = Some((time, *seen));
            return good;
        };
        let (last_time, last) = self.last_valid.unwrap_or((time, *seen));
        match trouble.wrong {
            Wrong::ZeroVelocity => self.fix(time, position, &Vector3::zeros()),
            Wrong::Off {
                velocity_mps,
                position_m,
            } => {
                let off = Vector3::from(velocity_mps);
                let away = Vector3::from(position_m) + (stamp_s - trouble.start_s) * off;
                self.fix(time, &displaced(position, &away), &(velocity + off))
            }
            Wrong::Zeros => self.fix(time, &Geodetic::default(), &Vector3::zeros()),
            Wrong::Stuck => self.fix(time, &last.position, &last.velocity_enu_mps),
            Wrong::NoPosition => GnssFix {
                position: None,
                height_m: None,
                ..good
            },
            Wrong::Coasting => {
                let way = time.seconds_since(last_time) * last.velocity_enu_mps;
                let place = displaced(&last.position, &way);
                self.fix(time, &place, &last.velocity_enu_mps)
            }
            Wrong::Float(position_m) => {
                let off = Vector3::from(position_m);
                let mut fix = self.fix(time, &displaced(position, &off), velocity);
                for sigma in [&mut fix.sigma.position_m, &mut fix.sigma.height_m] {
                    *sigma = sigma.map(|fixed| fixed.hypot(off.norm()));
                }
                fix
            }
            Wrong::Noisy(_) => good,
        }
    }

    /// A fix with the components that this receiver has.
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
}

/// Errors of one epoch, ENU.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    velocity_mps: Vector3<f64>,
    position_m: Vector3<f64>,
}

impl Errors {
    fn added_to(&self, seen: &Antenna) -> Antenna {
        Antenna {
            position: displaced(&seen.position, &self.position_m),
            velocity_enu_mps: seen.velocity_enu_mps + self.velocity_mps,
        }
    }
}

/// Arrival times: stamps plus the receiver's delay. The order is kept.
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

//! A GNSS receiver with errors, thesis equation (5).

use ins_core::earth::Geodetic;
use ins_core::{FixSigma, GnssFix, Time};
use nalgebra::Vector3;

use super::errors::GnssModel;
use super::ideal::{Antenna, TrueState, displaced};
use super::noise::{Memory, Random};
use super::receiver::{Correlated, Habits, Stated, Up, Wrong};

/// The receiver of one run.
#[derive(Clone, Debug)]
pub struct Gnss {
    model: GnssModel,
    /// The latency of this run at its start.
    pub latency_s: f64,
    next: u32,
    velocity_noise: Random,
    position_noise: Random,
    velocity_memory: [Memory; 3],
    position_memory: [Memory; 3],
    outliers: Random,
    /// What a smoothing receiver remembers of the last epoch.
    smoothed: Option<Antenna>,
    /// What one that takes differences does.
    last_place: Option<Geodetic>,
    /// Where one that holds still does so.
    held: Option<Geodetic>,
    last_good: Option<GnssFix>,
}

impl Gnss {
    /// Draws the errors of run `seed`.
    pub fn new(model: &GnssModel, seed: u64) -> Self {
        let habits = &model.habits;
        let period_s = 1.0 / model.rate_hz;
        let memory = |noise: &Correlated, jumps: bool, name: &str| {
            Memory::new(noise, period_s, jumps, Random::stream(seed, name))
        };
        let (level, up) = (&habits.horizontal, &habits.vertical);
        Self {
            latency_s: Random::stream(seed, "gnss latency").uniform(model.latency_s),
            next: 0,
            velocity_noise: Random::stream(seed, "gnss velocity"),
            position_noise: Random::stream(seed, "gnss position"),
            velocity_memory: ["east", "north", "up"]
                .map(|axis| memory(&habits.velocity, false, &format!("gnss velocity {axis}"))),
            position_memory: [
                (level, "gnss position east"),
                (level, "gnss position north"),
                (up, "gnss height"),
            ]
            .map(|(noise, name)| memory(noise, habits.position_jumps, name)),
            outliers: Random::stream(seed, "gnss outliers"),
            smoothed: None,
            last_place: None,
            held: None,
            last_good: None,
            model: model.clone(),
        }
    }

    /// The latency at a stamp, with what the clock has gained by then.
    pub fn latency_at_s(&self, stamp_s: f64) -> f64 {
        self.latency_s + self.model.habits.clock_drift * stamp_s
    }

    /// What the fixes of this receiver lag behind at most, beyond the latency: behind a steady
    /// change by smoothing or by the mean of a difference, and under the last stamp of a fix that is
    /// logged several times.
    pub fn lag_s(&self) -> f64 {
        let keep = self.smoothing_keep();
        let habits = &self.model.habits;
        let times = f64::from(habits.logged_times);
        let half = if habits.velocity_by_differences {
            0.5
        } else {
            0.0
        };
        (keep / (1.0 - keep) + 1.0 - 1.0 / times + half) / self.model.rate_hz
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
            let shown_s = stamp_s - self.latency_at_s(stamp_s);
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
            let differenced = self.differenced(noise.on(&antenna));
            let seen = self.smooth(differenced);
            if !self.model.outages.iter().any(|out| out.holds(stamp_s)) {
                let seen = self.hold(outlier.on(&seen));
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
        let mut troubles = self.model.habits.troubles.iter();
        let noisy = troubles.find_map(|trouble| match trouble.wrong {
            Wrong::Noisy(times) if trouble.holds(stamp_s) => Some(times),
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
        let keep = self.smoothing_keep();
        let last = self.smoothed.filter(|_| keep > 0.0);
        let now = last.map_or(seen, |last| {
            let off = Errors {
                velocity_mps: keep * (last.velocity_enu_mps - seen.velocity_enu_mps),
                position_m: if self.model.habits.smooths_position {
                    keep * last.position.enu_from(&seen.position)
                } else {
                    Vector3::zeros()
                },
            };
            off.on(&seen)
        });
        self.smoothed = Some(now);
        now
    }

    fn differenced(&mut self, seen: Antenna) -> Antenna {
        let last = self.last_place.replace(seen.position);
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
            self.held = None;
            return seen;
        }
        Antenna {
            position: *self.held.get_or_insert(seen.position),
            velocity_enu_mps: Vector3::zeros(),
        }
    }

    /// What is logged of one epoch.
    fn logged(&mut self, stamp_s: f64, seen: &Antenna) -> GnssFix {
        let time = Time::default().plus_seconds(stamp_s);
        let (position, velocity) = (&seen.position, &seen.velocity_enu_mps);
        let good = self.fix(time, position, velocity);
        let mut troubles = self.model.habits.troubles.iter();
        let trouble = troubles
            .find(|trouble| trouble.holds(stamp_s) && !matches!(trouble.wrong, Wrong::Noisy(_)));
        let Some(trouble) = trouble else {
            self.last_good = Some(good);
            return good;
        };
        let last = self.last_good;
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
            Wrong::Stuck => GnssFix {
                time,
                ..last.unwrap_or(good)
            },
            Wrong::NoPosition => GnssFix {
                position: None,
                height_m: None,
                ..good
            },
            Wrong::Coasting => last.map_or(good, |last| self.coasted(&last, &good)),
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

    /// The last fix, as far on as it has come by the time of another; that one where it had no place.
    fn coasted(&self, last: &GnssFix, now: &GnssFix) -> GnssFix {
        let velocity = last.velocity_enu_mps();
        let way = now.time.seconds_since(last.time) * velocity;
        last.geodetic_or(0.0).map_or(*now, |place| {
            self.fix(now.time, &displaced(&place, &way), &velocity)
        })
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
}

/// Errors of one epoch, ENU.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    velocity_mps: Vector3<f64>,
    position_m: Vector3<f64>,
}

impl Errors {
    fn on(&self, seen: &Antenna) -> Antenna {
        Antenna {
            position: displaced(&seen.position, &self.position_m),
            velocity_enu_mps: seen.velocity_enu_mps + self.velocity_mps,
        }
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

#[cfg(test)]
mod tests {
    use super::super::drive::{DriveConfig, Grade, SimulatedDrive, simulate};
    use super::super::noise::statistics::{assert_mean, assert_sigma};
    use super::super::receiver::{Outliers, Trouble};
    use super::*;

    const RATE_HZ: f64 = 10.0;

    /// Three minutes in a car with error-free sensors and receiver, but for these habits.
    fn with(change: impl Fn(&mut GnssModel)) -> SimulatedDrive {
        let mut config = DriveConfig::new(8, Grade::Ideal, 3.0);
        config.initial_rest_s = None;
        change(&mut config.recording.errors.gnss);
        simulate(&config)
    }

    fn trouble(start_s: f64, duration_s: f64, wrong: Wrong) -> Trouble {
        Trouble {
            start_s,
            duration_s,
            wrong,
        }
    }

    #[test]
    fn white_and_correlated_parts_add_up() {
        let exact = with(|_| {});
        let noisy = with(|gnss| {
            gnss.velocity_sigma_mps = 0.03;
            // Forgotten from fix to fix: samples are independent.
            gnss.habits.velocity = Correlated {
                sigma: 0.04,
                time_s: 1e-3,
            };
            gnss.habits.stated = Stated::All;
        });
        let off: Vec<f64> = noisy
            .gnss
            .iter()
            .zip(&exact.gnss)
            .map(|(n, e)| n.velocity_up_mps.unwrap() - e.velocity_up_mps.unwrap())
            .collect();
        assert_sigma(&off, 0.05);
        assert!((noisy.gnss[0].sigma.velocity_mps.unwrap() - 0.05).abs() < 1e-12);
        assert_eq!(noisy.imu, exact.imu);
    }

    #[test]
    fn smoothing_lags_as_far_as_the_latency_says() {
        let drive = with(|gnss| gnss.habits.smoothing_s = 0.3);
        let lag_s = drive.errors.gnss_lag_s;
        // A sampled low-pass lags T e / (1 - e), a little less than its time constant.
        assert!((0.25..0.3).contains(&lag_s), "{lag_s}");
        let mut car = super::super::car::Car::new(8, 180.0, None);
        let mut worst = [0.0_f64; 2];
        for fix in drive.gnss.iter().skip(50) {
            use super::super::motion::Motion;
            let stamp_s = fix.time.as_seconds();
            for (worst, back_s) in worst.iter_mut().zip([lag_s, 0.0]) {
                let shown = car.kinematics(stamp_s - back_s).velocity_enu_mps;
                *worst = worst.max((fix.velocity_enu_mps() - shown).norm());
            }
        }
        assert!(worst[0] < 0.5 * worst[1], "{worst:?}");
    }

    #[test]
    fn receivers_hold_still_and_take_differences() {
        let exact = with(|_| {});
        let holds = with(|gnss| gnss.habits.holds_below_mps = 8.0);
        let mut held = None;
        let mut count = 0;
        for (exact, fix) in exact.gnss.iter().zip(&holds.gnss) {
            if exact.velocity_enu_mps().norm() >= 8.0 {
                assert_eq!(exact, fix);
                held = None;
            } else {
                assert_eq!(fix.velocity_enu_mps(), Vector3::zeros());
                assert_eq!(fix.position, *held.get_or_insert(exact.position));
                count += 1;
            }
        }
        assert!(count > 100);
        let differences = with(|gnss| gnss.habits.velocity_by_differences = true);
        assert!((differences.errors.gnss_lag_s - 0.5 / RATE_HZ).abs() < 1e-12);
        for pair in differences.gnss.windows(2) {
            let [from, to] = [0, 1].map(|at| pair[at].geodetic_or(0.0).unwrap());
            let off = RATE_HZ * to.enu_from(&from) - pair[1].velocity_enu_mps();
            assert!(off.norm() < 1e-6, "{off}");
        }
    }

    #[test]
    fn receivers_coast_and_float() {
        let wrong = with(|gnss| {
            gnss.horizontal_sigma_m = 0.4;
            gnss.habits.stated = Stated::White;
            gnss.habits.troubles = vec![
                trouble(20.0, 5.0, Wrong::Coasting),
                trouble(60.0, 5.0, Wrong::Float([0.0, 0.3, 0.0])),
            ];
        });
        let (last, coasted) = (&wrong.gnss[199], &wrong.gnss[249]);
        assert_eq!(coasted.velocity_en_mps, last.velocity_en_mps);
        let [from, to] = [last, coasted].map(|fix| fix.geodetic_or(0.0).unwrap());
        let off = to.enu_from(&from) - 5.0 * last.velocity_enu_mps();
        assert!(off.norm() < 0.01, "{off}");
        let stated = |at: usize| wrong.gnss[at].sigma.position_m.unwrap();
        assert!((stated(620) - 0.5).abs() < 1e-12 && (stated(700) - 0.4).abs() < 1e-12);
    }

    #[test]
    fn clocks_drift_apart() {
        let drive = with(|gnss| gnss.habits.clock_drift = 1e-3);
        let gained_s = drive.errors.gnss_latency_end_s - drive.errors.gnss_latency_s;
        assert!((gained_s - 0.18).abs() < 1e-9);
        let exact = with(|_| {});
        // 100 s into the run a fix shows what the one 0.1 s before shows without drift.
        let find = |drive: &SimulatedDrive, stamp_s: f64| {
            let time = Time::default().plus_seconds(stamp_s);
            *drive.gnss.iter().find(|fix| fix.time == time).unwrap()
        };
        let off = find(&drive, 100.0).velocity_enu_mps() - find(&exact, 99.9).velocity_enu_mps();
        assert!(off.norm() < 1e-6);
    }

    #[test]
    fn the_antenna_is_where_it_is_said_to_be() {
        let arm_m = [1.5, -2.0, 2.5];
        let drive = with(|gnss| gnss.habits.lever_arm_m = arm_m);
        let mut moved_mps = 0.0_f64;
        for (fix, truth) in drive.gnss.iter().zip(&drive.truth) {
            assert_eq!(fix.time, truth.time);
            let place = fix.geodetic_or(0.0).unwrap();
            let reach = truth.attitude * Vector3::from(arm_m);
            let off = place.enu_from(&truth.position) - reach;
            // Metres along the curved frame, to one part in 10^6.
            assert!(off.norm() < 1e-5, "{off}");
            moved_mps = moved_mps.max((fix.velocity_enu_mps() - truth.velocity_enu_mps).norm());
        }
        assert!(moved_mps > 0.5);
        // Between samples velocity is the derivative of the position.
        for pair in drive.gnss.windows(3) {
            let places = [0, 2].map(|at| pair[at].geodetic_or(0.0).unwrap());
            let mean = places[1].enu_from(&places[0]) / (2.0 / RATE_HZ);
            // h^2/6 of the second derivative of a velocity that swings at 3 m/s^2 in half a second.
            let off = (mean - pair[1].velocity_enu_mps()).norm();
            assert!(off < 0.05, "{off}");
        }
    }

    #[test]
    fn fixes_have_the_parts_a_receiver_gives() {
        let drive = with(|gnss| {
            gnss.habits.gives_height = false;
            gnss.habits.up = Up::Missing;
            gnss.velocity_sigma_mps = 0.1;
            gnss.vertical_sigma_m = 1.0;
            gnss.habits.stated = Stated::White;
        });
        for fix in &drive.gnss {
            assert!(fix.position.is_some() && fix.velocity_en_mps.is_some());
            assert!(fix.height_m.is_none() && fix.velocity_up_mps.is_none());
            assert!(fix.sigma.height_m.is_none() && fix.sigma.velocity_up_mps.is_none());
            assert!(fix.sigma.velocity_mps.is_some());
        }
        let exact = with(|_| {});
        let down = with(|gnss| gnss.habits.up = Up::Down);
        let zero = with(|gnss| gnss.habits.up = Up::Zero);
        for ((exact, down), zero) in exact.gnss.iter().zip(&down.gnss).zip(&zero.gnss) {
            assert_eq!(down.velocity_up_mps, exact.velocity_up_mps.map(|up| -up));
            assert_eq!(zero.velocity_up_mps, Some(0.0));
        }
    }

    #[test]
    fn troubles_come_when_they_should_and_change_nothing_else() {
        let exact = with(|_| {});
        let off = Wrong::Off {
            velocity_mps: [3.0, 0.0, 0.0],
            position_m: [0.0, 40.0, 0.0],
        };
        let wrong = with(|gnss| {
            gnss.habits.troubles = vec![
                trouble(20.0, 1.2, Wrong::ZeroVelocity),
                trouble(40.0, 1.0, off),
                trouble(60.0, 2.0, Wrong::Zeros),
                trouble(80.0, 5.0, Wrong::Stuck),
            ];
        });
        assert_eq!(exact.gnss.len(), wrong.gnss.len());
        let differ = |from_s: f64, to_s: f64| {
            let pairs = exact.gnss.iter().zip(&wrong.gnss);
            pairs
                .filter(|(e, _)| (from_s..to_s).contains(&e.time.as_seconds()))
                .filter(|(e, w)| e != w)
                .count()
        };
        assert_eq!(differ(20.0, 21.2), 12);
        assert_eq!(differ(40.0, 41.0), 10);
        assert_eq!(differ(60.0, 62.0), 20);
        assert_eq!(differ(80.0, 85.0), 50);
        assert_eq!(differ(0.0, 180.0), 92);
        let (good, bad) = (&exact.gnss[405], &wrong.gnss[405]);
        assert!((bad.velocity_enu_mps().x - good.velocity_enu_mps().x - 3.0).abs() < 1e-12);
        let away = bad.geodetic_or(0.0).unwrap();
        let away = away.enu_from(&good.geodetic_or(0.0).unwrap());
        assert!((away - Vector3::new(1.5, 40.0, 0.0)).norm() < 1e-3);
        let stuck = &wrong.gnss[849];
        assert_eq!(stuck.position, exact.gnss[799].position);
        assert_eq!(stuck.time, exact.gnss[849].time);
        assert_eq!(wrong.gnss[610].velocity_en_mps, Some([0.0; 2].into()));
    }

    #[test]
    fn outliers_come_as_often_as_told() {
        let exact = with(|_| {});
        let wild = with(|gnss| {
            gnss.habits.outliers = Outliers {
                fraction: 0.1,
                velocity_mps: 5.0,
                position_m: 0.0,
            };
        });
        let hits: Vec<f64> = exact
            .gnss
            .iter()
            .zip(&wild.gnss)
            .map(|(e, w)| f64::from(u8::from(e != w)))
            .collect();
        assert_mean(&hits, 0.1, 0.3);
    }

    #[test]
    fn fixes_are_logged_as_often_and_as_late_as_told() {
        let drive = with(|gnss| {
            gnss.rate_hz = 5.0;
            gnss.habits.logged_times = 4;
            gnss.habits.delay_s = [0.2, 0.7];
        });
        assert_eq!(drive.arrivals.len(), drive.gnss.len());
        for (fixes, arrivals) in drive
            .gnss
            .chunks_exact(4)
            .zip(drive.arrivals.chunks_exact(4))
        {
            for (fix, arrival) in fixes.iter().zip(arrivals) {
                assert_eq!(fix.velocity_en_mps, fixes[0].velocity_en_mps);
                let delay_s = arrival.seconds_since(fix.time);
                assert!((0.2..0.7).contains(&delay_s), "{delay_s}");
            }
            let apart_s = fixes[1].time.seconds_since(fixes[0].time);
            assert!((apart_s - 0.05).abs() < 1e-9);
        }
        assert!(drive.arrivals.is_sorted());
        assert!(drive.gnss.is_sorted_by_key(|fix| fix.time));
        assert_eq!(with(|_| {}).arrivals.len(), with(|_| {}).gnss.len());
    }
}

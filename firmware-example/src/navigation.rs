//! The navigator behind the link. Nothing here knows the board.

use core::fmt::Write as _;

use ins_core::manoeuvre::Manoeuvre;
use ins_core::{Estimates, GnssOutcome, Navigator, Observability, Phase};
use ins_link::{FixReply, NotStarted, SampleReply, StartError, Started};

/// Measures how long its argument takes.
pub trait Timer {
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32);
}

/// One navigator, told what to do by the link.
pub struct Navigation {
    running: Option<Running>,
}

struct Running {
    navigator: Navigator,
    estimates_every: u32,
    samples: u32,
    log: Log,
}

impl Navigation {
    pub const fn new() -> Self {
        Self { running: None }
    }

    /// A new navigator.
    pub fn start(
        &mut self,
        config: ins_core::Config,
        estimates_every: u32,
    ) -> Result<Started, StartError> {
        let navigator = Navigator::new(config).map_err(|error| {
            let mut text = heapless::String::new();
            // A longer reason is cut off.
            let _ = text.write_str(error.0);
            StartError(text)
        })?;
        self.running =
            Some(Running { navigator, estimates_every, samples: 0, log: Log::default() });
        Ok(Started { state_bytes: size_of::<Navigator>() as u32 })
    }

    /// An inertial sample.
    pub fn on_imu(
        &mut self,
        sample: &ins_core::ImuSample,
        timer: &impl Timer,
    ) -> Result<SampleReply, NotStarted> {
        let running = self.running.as_mut().ok_or(NotStarted)?;
        let navigator = &mut running.navigator;
        let (outcome, ticks) = timer.time(|| navigator.on_imu(sample));
        running.samples = running.samples.wrapping_add(1);
        let wanted = running.samples.checked_rem(running.estimates_every) == Some(0);
        let reply = SampleReply::of(navigator, outcome, wanted, ticks);
        running.log.on_sample(&reply);
        Ok(reply)
    }

    /// A GNSS fix.
    pub fn on_gnss(
        &mut self,
        fix: &ins_core::GnssFix,
        timer: &impl Timer,
    ) -> Result<FixReply, NotStarted> {
        let running = self.running.as_mut().ok_or(NotStarted)?;
        let navigator = &mut running.navigator;
        let (outcome, ticks) = timer.time(|| navigator.on_gnss(fix));
        if !matches!(outcome, GnssOutcome::Accepted | GnssOutcome::Queued) {
            defmt::warn!("fix at {} us: {}", fix.time.as_micros(), outcome);
        }
        Ok(FixReply::of(navigator, outcome, ticks))
    }
}

/// Says what changed.
#[derive(Default)]
struct Log {
    phase: Phase,
    manoeuvre: Manoeuvre,
    /// One bit for each estimate that is observable.
    observable: u16,
}

impl Log {
    fn on_sample(&mut self, reply: &SampleReply) {
        if reply.phase != self.phase {
            defmt::info!("alignment: {}", reply.phase);
            self.phase = reply.phase;
        }
        if reply.manoeuvre != self.manoeuvre {
            defmt::debug!("manoeuvre: {}", reply.manoeuvre);
            self.manoeuvre = reply.manoeuvre;
        }
        if let Some(estimates) = &reply.estimates {
            self.on_estimates(estimates);
        }
    }

    fn on_estimates(&mut self, e: &Estimates) {
        let [ax, ay, az] = e.accel_bias_mps2;
        let [gx, gy, gz] = e.gyro_bias_radps;
        let [right, forward] = e.lever_arm_m;
        let named = [
            ("azimuth error", e.azimuth_error_rad),
            ("accelerometer bias x", ax),
            ("accelerometer bias y", ay),
            ("accelerometer bias z", az),
            ("gyro bias x", gx),
            ("gyro bias y", gy),
            ("gyro bias z", gz),
            ("GNSS latency", e.gnss_latency_s),
            ("antenna right", right),
            ("antenna forward", forward),
        ];
        let mut observable = 0;
        for (bit, (name, estimate)) in named.iter().enumerate() {
            let now = u16::from(estimate.observability == Observability::Observable) << bit;
            observable |= now;
            if now & !self.observable != 0 {
                defmt::info!("observable: {=str} {} +- {}", name, estimate.value, estimate.sigma);
            }
        }
        self.observable = observable;
    }
}

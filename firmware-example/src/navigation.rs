//! The navigator behind the link, independent of the board.

use core::cell::Cell;
use core::fmt::Write as _;

use critical_section::Mutex;
use ins_core::{
    Config, Estimate, Estimates, FixReport, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Manoeuvre,
    Navigator, Observability, Phase, Solution, Time,
};
use ins_link::{Answer, NotStarted, Report, Responder, StartError, Started, Timer};

use crate::service::Navigates;

/// Time stamp of the last inertial sample, us, which is the time in the log.
static NOW: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

defmt::timestamp!(
    "{=u64:us}",
    critical_section::with(|cs| NOW.borrow(cs).get())
);

/// A navigator controlled by requests, and its log.
pub struct Navigation {
    running: Option<(Responder, Log)>,
}

impl Navigation {
    pub const fn new() -> Self {
        Self { running: None }
    }
}

impl Navigates for Navigation {
    fn start(&mut self, config: Config, estimates_every: u32) -> Result<Started, StartError> {
        let responder = Responder::start(config, estimates_every).map_err(|error| {
            let mut text = heapless::String::new();
            // A longer message is truncated.
            let _ = write!(text, "{error}");
            StartError(text)
        })?;
        self.running = Some((responder, Log::default()));
        defmt::info!("navigator of {} bytes started", size_of::<Navigator>());
        Ok(Started {
            state_bytes: size_of::<Navigator>() as u32,
        })
    }

    fn on_imu(
        &mut self,
        sample: &ImuSample,
        timer: &impl Timer,
    ) -> Result<Answer<ImuOutcome>, NotStarted> {
        let (responder, log) = self.running.as_mut().ok_or(NotStarted)?;
        set_now(sample.time);
        let answer = responder.on_imu(sample, timer);
        log.on_sample(sample.time, answer.outcome);
        log.on_report(&answer.report);
        Ok(answer)
    }

    fn on_gnss(
        &mut self,
        fix: &GnssFix,
        timer: &impl Timer,
    ) -> Result<Answer<GnssOutcome>, NotStarted> {
        let (responder, log) = self.running.as_mut().ok_or(NotStarted)?;
        let answer = responder.on_gnss(fix, timer);
        log.on_report(&answer.report);
        Ok(answer)
    }
}

fn set_now(time: Time) {
    critical_section::with(|cs| NOW.borrow(cs).set(micros(time)));
}

/// For the log, which has no negative times.
fn micros(time: Time) -> u64 {
    time.as_micros().max(0).cast_unsigned()
}

/// Logs changes.
#[derive(Default)]
struct Log {
    phase: Phase,
    manoeuvre: Manoeuvre,
    rejected_sample: Option<ImuOutcome>,
    rejected_fix: Option<GnssOutcome>,
    /// One bit for each estimate that is observable.
    observable: u16,
}

impl Log {
    /// Consecutive samples rejected for the same reason get one line.
    fn on_sample(&mut self, time: Time, outcome: ImuOutcome) {
        if outcome == ImuOutcome::Bridged {
            defmt::debug!("missing samples bridged");
        }
        let accepted = matches!(outcome, ImuOutcome::Accepted | ImuOutcome::Bridged);
        let rejected = (!accepted).then_some(outcome);
        if rejected != self.rejected_sample && !accepted {
            defmt::warn!("sample of {=u64:us} s refused: {}", micros(time), outcome);
        }
        self.rejected_sample = rejected;
    }

    /// Also for fixes that were queued first.
    fn on_fix(&mut self, fix: &FixReport) {
        let accepted = fix.outcome == GnssOutcome::Accepted;
        let rejected = (!accepted).then_some(fix.outcome);
        if rejected != self.rejected_fix && !accepted {
            defmt::warn!(
                "fix of {=u64:us} s refused: {}",
                micros(fix.time),
                fix.outcome
            );
        }
        self.rejected_fix = rejected;
    }

    fn on_report(&mut self, report: &Report) {
        if report.phase != self.phase {
            on_phase(report.phase, report.solution.as_ref());
            self.phase = report.phase;
        }
        if report.manoeuvre != self.manoeuvre {
            defmt::debug!("manoeuvre: {}", report.manoeuvre);
            self.manoeuvre = report.manoeuvre;
        }
        if let Some(fix) = &report.settled {
            self.on_fix(fix);
        }
        if let Some(estimates) = &report.estimates {
            self.on_estimates(estimates);
        }
    }

    fn on_estimates(&mut self, estimates: &Estimates) {
        let mut observable = 0;
        for (bit, (name, unit, estimate)) in named(estimates).iter().enumerate() {
            let now = u16::from(estimate.observability == Observability::Observable) << bit;
            observable |= now;
            match (now, self.observable & 1 << bit) {
                (1.., 0) => defmt::info!(
                    "observable: {=str} {} +- {} {=str}",
                    name,
                    estimate.value as f32,
                    estimate.sigma as f32,
                    unit
                ),
                (0, 1..) => defmt::info!("no longer observable: {=str}", name),
                _ => {}
            }
        }
        self.observable = observable;
    }
}

fn on_phase(phase: Phase, solution: Option<&Solution>) {
    match (phase, solution) {
        (Phase::Levelling, _) => defmt::warn!("aligning again"),
        (Phase::FindingHeading, _) => defmt::info!("levelled, heading to be found from motion"),
        (Phase::Navigating, None) => defmt::info!("aligned"),
        (Phase::Navigating, Some(solution)) => {
            let angles = solution.euler();
            defmt::info!(
                "aligned: roll {}, pitch {}, heading {} deg",
                angles.roll_rad.to_degrees() as f32,
                angles.pitch_rad.to_degrees() as f32,
                angles.heading_rad.to_degrees() as f32
            );
        }
    }
}

/// Names, units, estimates.
fn named(e: &Estimates) -> [(&'static str, &'static str, Estimate); 11] {
    let [ax, ay, az] = e.accel_bias_mps2;
    let [gx, gy, gz] = e.gyro_bias_radps;
    let [right, forward, up] = e.lever_arm_m;
    [
        ("azimuth error", "rad", e.azimuth_error_rad),
        ("accelerometer bias x", "m/s^2", ax),
        ("accelerometer bias y", "m/s^2", ay),
        ("accelerometer bias z", "m/s^2", az),
        ("gyro bias x", "rad/s", gx),
        ("gyro bias y", "rad/s", gy),
        ("gyro bias z", "rad/s", gz),
        ("GNSS latency", "s", e.gnss_latency_s),
        ("antenna right", "m", right),
        ("antenna forward", "m", forward),
        ("antenna up", "m", up),
    ]
}

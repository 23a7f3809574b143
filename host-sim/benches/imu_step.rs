//! Cost of one inertial sample and of one velocity fix, beside the peers, in one run.
//!
//! Every estimator gets the same simulated drive: 10 min to be warm, then a minute that is timed
//! again and again, with its starts, turns and stops. `cargo bench -p host-sim --bench imu_step`
//! prints a table of medians and ratios.

#[allow(clippy::cast_possible_truncation, reason = "fusion-nav takes f32")]
#[allow(dead_code, reason = "here nothing has to be levelled")]
#[path = "../../tests/peers/src/filters/mod.rs"]
mod filters;

use std::hint::black_box;
use std::time::{Duration, Instant};

use host_sim::page::table::markdown;
use host_sim::sim::{DriveConfig, Grade, SimulatedDrive, simulate};
use ins_core::{Config, GnssFix, GnssOutcome, ImuOutcome, ImuOutput, ImuSample, Navigator, Time};

use filters::{AtRest, FusionNav, KinavisIns, Peer};

const WARM_MIN: f64 = 10.0;
const TIMED_MIN: f64 = 1.0;
/// Times that the timed minute is run.
const RUNS: usize = 200;

/// Ours, as shipped for the class of the simulated sensors; it aligns itself.
impl Peer for Navigator {
    type Sample = ImuSample;
    type Fix = GnssFix;

    fn new(_: &AtRest) -> Option<Self> {
        let config = Config {
            imu_output: ImuOutput::Increments,
            ..Config::hg1700()
        };
        Self::new(config).ok()
    }

    fn sample(sample: &ImuSample) -> Option<ImuSample> {
        Some(*sample)
    }

    fn fix(fix: &GnssFix) -> Option<GnssFix> {
        Some(*fix)
    }

    fn on_imu(&mut self, sample: ImuSample) -> bool {
        Self::on_imu(self, &sample) == ImuOutcome::Accepted
    }

    fn on_gnss(&mut self, fix: GnssFix) -> bool {
        matches!(
            Self::on_gnss(self, &fix),
            GnssOutcome::Accepted | GnssOutcome::Queued
        )
    }
}

/// Inertial samples up to a fix, and the fix; converted before anything is timed.
struct Epoch<P: Peer> {
    samples: Vec<P::Sample>,
    fix: P::Fix,
}

/// Epochs before a moment of the drive, and those after it.
fn epochs<P: Peer>(drive: &SimulatedDrive, told_latency_s: f64) -> [Vec<Epoch<P>>; 2] {
    let timed_from = Time::default().plus_seconds(60.0 * WARM_MIN);
    let mut imu = drive.imu.iter().peekable();
    let [mut warming, mut timed] = [Vec::new(), Vec::new()];
    for fix in &drive.gnss {
        let mut samples = Vec::new();
        while let Some(sample) = imu.next_if(|sample| sample.time <= fix.time) {
            samples.push(P::sample(sample).expect("the simulation is finite"));
        }
        let true_at = fix.time.plus_seconds(-told_latency_s);
        let told = P::fix(&GnssFix {
            time: true_at,
            ..*fix
        });
        let part = if fix.time <= timed_from {
            &mut warming
        } else {
            &mut timed
        };
        part.push(Epoch {
            samples,
            fix: told.expect("the simulation is finite"),
        });
    }
    [warming, timed]
}

/// Time that all samples took, and all fixes.
fn run<P: Peer>(mut filter: P, epochs: &[Epoch<P>]) -> [Duration; 2] {
    let [mut imu, mut gnss] = [Duration::ZERO; 2];
    for epoch in epochs {
        let start = Instant::now();
        for sample in &epoch.samples {
            black_box(filter.on_imu(black_box(*sample)));
        }
        let middle = Instant::now();
        black_box(filter.on_gnss(black_box(epoch.fix)));
        imu += middle - start;
        gnss += middle.elapsed();
    }
    [imu, gnss]
}

/// Takes the filter through the first minutes; it must be up and take what it gets.
fn warm<P: Peer>(mut filter: P, epochs: &[Epoch<P>]) -> P {
    let name = std::any::type_name::<P>();
    let half = epochs.len() / 2;
    let mut refused = 0;
    for (count, epoch) in epochs.iter().enumerate() {
        for sample in &epoch.samples {
            let taken = filter.on_imu(*sample);
            assert!(taken || count < half, "{name} refused a sample");
        }
        refused += usize::from(!filter.on_gnss(epoch.fix) && count >= half);
    }
    assert!(
        refused * 50 < half,
        "{name} refused {refused} of {half} fixes"
    );
    filter
}

/// Medians of a sample, of a fix, and of a sample with its share of fixes, ns.
fn medians_ns<P: Peer>(drive: &SimulatedDrive, told_latency_s: f64) -> [f64; 3] {
    let truth = drive.truth[0].euler();
    let start = AtRest {
        time: drive.truth[0].time,
        position: drive.truth[0].position,
        roll_rad: truth.roll_rad,
        pitch_rad: truth.pitch_rad,
        heading_rad: truth.heading_rad,
    };
    let [warming, timed] = epochs::<P>(drive, told_latency_s);
    let filter = warm(P::new(&start).expect("a finite start"), &warming);
    let runs: Vec<[Duration; 2]> = (0..RUNS).map(|_| run(filter.clone(), &timed)).collect();
    let samples: usize = timed.iter().map(|epoch| epoch.samples.len()).sum();
    let median_ns = |of: fn(&[Duration; 2]) -> Duration, calls: usize| {
        let mut all: Vec<Duration> = runs.iter().map(of).collect();
        all.sort();
        all[RUNS / 2].as_secs_f64() * 1e9 / calls as f64
    };
    [
        median_ns(|[imu, _]| *imu, samples),
        median_ns(|[_, gnss]| *gnss, timed.len()),
        median_ns(|[imu, gnss]| *imu + *gnss, samples),
    ]
}

fn main() {
    let drive = simulate(&DriveConfig::new(7, Grade::Hg1700, WARM_MIN + TIMED_MIN));
    // Ours finds the latency.
    let latency_s = drive.errors.gnss_latency_s;
    let ours = medians_ns::<Navigator>(&drive, 0.0);
    let all = [
        ("ins-core", ours),
        ("fusion-nav", medians_ns::<FusionNav>(&drive, latency_s)),
        ("kinavis-ins", medians_ns::<KinavisIns>(&drive, latency_s)),
    ];
    let header = [
        "",
        "IMU sample, ns",
        "ratio",
        "velocity fix, ns",
        "ratio",
        "sample with its share of fixes, ns",
        "ratio",
    ];
    let rows = all.map(|(name, its)| {
        let mut cells = vec![name.to_owned()];
        for (its, ours) in its.into_iter().zip(ours) {
            cells.extend([format!("{its:.0}"), format!("{:.1}", its / ours)]);
        }
        cells
    });
    println!("{}", markdown(&header.map(str::to_owned), &rows));
}

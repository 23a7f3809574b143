//! Cost of one inertial sample and of one velocity fix, beside the peers, in one run.
//!
//! Every estimator gets the same simulated drive: 10 min to be warm, then a minute that is timed
//! again and again, with its starts, turns and stops. `cargo bench -p host-sim --bench imu_step`
//! prints a table of medians and ratios at its end.

#[allow(clippy::cast_possible_truncation, reason = "fusion-nav takes f32")]
#[allow(dead_code, reason = "here nothing has to be levelled")]
#[path = "../../tests/peers/src/filters/mod.rs"]
mod filters;

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, SamplingMode};
use host_sim::log::Grade;
use host_sim::page::table::markdown;
use host_sim::sim::{DriveConfig, SimulatedDrive, simulate};
use ins_core::{Config, GnssFix, GnssOutcome, ImuOutcome, ImuOutput, ImuSample, Navigator, Time};

use filters::{AtRest, FusionNav, KinavisIns, Peer};

const WARM_MIN: f64 = 10.0;
const TIMED_MIN: f64 = 1.0;

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

/// A part of what an epoch takes, and calls of it in the timed minute.
type Part = (&'static str, fn([Duration; 2]) -> Duration, usize);

/// Times the filter over the minute; medians of each part's call, ns, none where criterion was told
/// to leave it out.
fn measure<P: Peer>(
    criterion: &mut Criterion,
    name: &str,
    drive: &SimulatedDrive,
    told_latency_s: f64,
) -> [Option<f64>; 3] {
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
    let samples = timed.iter().map(|epoch| epoch.samples.len()).sum();
    let parts: [Part; 3] = [
        ("imu", |[imu, _]| imu, samples),
        ("gnss", |[_, gnss]| gnss, timed.len()),
        ("both", |[imu, gnss]| imu + gnss, samples),
    ];
    let mut group = criterion.benchmark_group("minute");
    group.sampling_mode(SamplingMode::Flat);
    for (what, part, _) in parts {
        group.bench_function(BenchmarkId::new(name, what), |bencher| {
            bencher.iter_custom(|minutes| {
                (0..minutes)
                    .map(|_| part(run(filter.clone(), &timed)))
                    .sum()
            });
        });
    }
    group.finish();
    parts.map(|(what, _, calls)| Some(median_ns(name, what)? / calls as f64))
}

/// Median of a benchmark of this run, ns for the whole minute.
fn median_ns(name: &str, what: &str) -> Option<f64> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target"),
        PathBuf::from,
    );
    let file = target.join(format!("criterion/minute/{name}/{what}/new/estimates.json"));
    let estimates: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
    estimates["median"]["point_estimate"].as_f64()
}

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(3))
        .sample_size(20)
        .configure_from_args();
    let c = &mut criterion;
    let drive = simulate(&DriveConfig::new(7, Grade::Hg1700, WARM_MIN + TIMED_MIN));
    // Ours finds the latency.
    let told_s = drive.errors.gnss_latency_s;
    let ours = measure::<Navigator>(c, "ins-core", &drive, 0.0);
    let fusion_nav = measure::<FusionNav>(c, "fusion-nav", &drive, told_s);
    let kinavis_ins = measure::<KinavisIns>(c, "kinavis-ins", &drive, told_s);
    criterion.final_summary();
    let header = [
        "",
        "IMU sample, ns",
        "ratio",
        "velocity fix, ns",
        "ratio",
        "sample with its share of fixes, ns",
        "ratio",
    ];
    let row = |name: &str, its: [Option<f64>; 3]| -> Option<Vec<String>> {
        let mut cells = vec![name.to_owned()];
        for (its, ours) in its.into_iter().zip(ours) {
            cells.extend([format!("{:.0}", its?), format!("{:.1}", its? / ours?)]);
        }
        Some(cells)
    };
    let rows: Option<Vec<_>> = [
        row("ins-core", ours),
        row("fusion-nav", fusion_nav),
        row("kinavis-ins", kinavis_ins),
    ]
    .into_iter()
    .collect();
    if let Some(rows) = rows {
        println!("\n{}", markdown(&header.map(str::to_owned), &rows));
    }
}

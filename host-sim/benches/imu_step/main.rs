//! Cost of one inertial sample and of one velocity fix, beside the peers, in one run.
//!
//! Every estimator gets the same simulated drive: 10 min to be warm, then a minute that is timed
//! again and again, with its starts, turns and stops. `cargo bench -p host-sim --bench imu_step`
//! prints a table of medians and ratios at its end.

mod peers;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, SamplingMode};
use host_sim::sim::{DriveConfig, Grade, simulate};
use ins_core::{Config, ImuOutput, Time};

use peers::{Estimator, Fix, Sample};

const WARM_MIN: f64 = 10.0;
const TIMED_MIN: f64 = 1.0;
const IMU_HZ: f64 = 100.0;

/// Inertial samples up to a fix, and the fix.
struct Epoch {
    samples: Vec<Sample>,
    fix: Fix,
}

/// What the timed minute took.
#[derive(Clone, Copy, Default)]
struct Cost {
    imu: Duration,
    gnss: Duration,
}

/// A part of the cost that is told apart.
type Part = (&'static str, fn(&Cost) -> Duration);

const PARTS: [Part; 3] = [
    ("imu", |cost| cost.imu),
    ("gnss", |cost| cost.gnss),
    ("both", |cost| cost.imu + cost.gnss),
];

fn run<E: Estimator>(estimator: &mut E, epochs: &[Epoch]) -> Cost {
    let mut cost = Cost::default();
    for epoch in epochs {
        let start = Instant::now();
        for sample in &epoch.samples {
            std::hint::black_box(estimator.on_imu(sample));
        }
        let middle = Instant::now();
        std::hint::black_box(estimator.on_gnss(&epoch.fix));
        cost.imu += middle - start;
        cost.gnss += middle.elapsed();
    }
    cost
}

/// Takes the estimator through the first minutes; it must be up and take what it gets.
fn warm<E: Estimator>(mut estimator: E, epochs: &[Epoch]) -> E {
    let half = epochs.len() / 2;
    run(&mut estimator, &epochs[..half]);
    let mut refused = [0, 0];
    for epoch in &epochs[half..] {
        for sample in &epoch.samples {
            refused[0] += u32::from(!estimator.on_imu(sample));
        }
        refused[1] += u32::from(!estimator.on_gnss(&epoch.fix));
    }
    let [samples, fixes] = refused;
    assert_eq!(samples, 0, "{} refused inertial samples", E::NAME);
    assert!(
        fixes as usize * 50 < half,
        "{} refused {fixes} of {half} fixes",
        E::NAME
    );
    estimator
}

fn measure<E: Estimator>(criterion: &mut Criterion, start: E, warming: &[Epoch], timed: &[Epoch]) {
    let estimator = warm(start, warming);
    let mut group = criterion.benchmark_group("minute");
    group.sampling_mode(SamplingMode::Flat);
    for (what, part) in PARTS {
        group.bench_function(BenchmarkId::new(E::NAME, what), |bencher| {
            bencher.iter_custom(|minutes| {
                (0..minutes)
                    .map(|_| part(&run(&mut estimator.clone(), timed)))
                    .sum()
            });
        });
    }
    group.finish();
}

fn drive() -> (Vec<Epoch>, ins_core::Solution, ImuOutput) {
    let config = DriveConfig::new(7, Grade::Hg1700, WARM_MIN + TIMED_MIN);
    let output = config.recording.errors.imu.output;
    assert_eq!(
        output,
        ImuOutput::Increments,
        "the peers' samples are made from increments"
    );
    let run = simulate(&config);
    let mut imu = run.imu.iter().peekable();
    let epochs = run.gnss.iter().map(|fix| {
        let mut samples = Vec::new();
        while let Some(sample) = imu.next_if(|sample| sample.time <= fix.time) {
            samples.push(Sample::new(*sample, 1.0 / IMU_HZ));
        }
        Epoch {
            samples,
            fix: Fix::new(*fix, run.errors.gnss_latency_s),
        }
    });
    (epochs.collect(), run.truth[0], output)
}

/// Median of a benchmark of this run, ns for the whole minute.
fn median_ns(estimator: &str, what: &str) -> Option<f64> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target"),
        PathBuf::from,
    );
    let file = target
        .join("criterion/minute")
        .join(estimator)
        .join(what)
        .join("new/estimates.json");
    let estimates: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
    estimates["median"]["point_estimate"].as_f64()
}

/// Medians per call, and how many times ours each is. `None` if a part was filtered out.
fn table(samples: f64, fixes: f64) -> Option<String> {
    let calls = [samples, fixes, samples];
    let mut table = String::from(
        "| | IMU sample, ns | ratio | velocity fix, ns | ratio \
         | sample with its share of fixes, ns | ratio |\n|---|---|---|---|---|---|---|\n",
    );
    for name in ["ins-core", "fusion-nav", "kinavis-ins"] {
        write!(table, "| {name} |").ok()?;
        for ((what, _), calls) in PARTS.iter().zip(calls) {
            let (its, ours) = (median_ns(name, what)?, median_ns("ins-core", what)?);
            write!(table, " {:.0} | {:.1} |", its / calls, its / ours).ok()?;
        }
        table.push('\n');
    }
    Some(table)
}

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(3))
        .sample_size(20)
        .configure_from_args();
    let (epochs, start, imu_output) = drive();
    let timed_from = Time::default().plus_seconds(60.0 * WARM_MIN);
    let split = epochs.partition_point(|epoch| epoch.fix.time() <= timed_from);
    let (warming, timed) = epochs.split_at(split);

    let config = Config {
        imu_output,
        ..Config::hg1700()
    };
    measure(&mut criterion, peers::ours(config), warming, timed);
    measure(&mut criterion, peers::fusion_nav(&start), warming, timed);
    measure(&mut criterion, peers::kinavis_ins(&start), warming, timed);
    criterion.final_summary();
    let samples: usize = timed.iter().map(|epoch| epoch.samples.len()).sum();
    if let Some(table) = table(samples as f64, timed.len() as f64) {
        println!("\n{table}");
    }
}

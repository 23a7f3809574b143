//! Results of the core on a host are identical to the bit for all builds: every solution, estimate and damping
//! signal after every sample and fix.

use std::io::Write;
use std::process::{Command, Stdio};
use std::sync::Mutex;

use host_sim::hil::bench::{ESTIMATES_EVERY, requests};
use host_sim::log::{Grade, Log};
use ins_core::Config;
use ins_link::{FromBoard, Reply, Request, Responder, encode};
use ins_tests::cargo::{build_folder, cargo, succeed, with_altered_core};
use ins_tests::drives::{drive, flight};

type Failure = Box<dyn std::error::Error>;

/// Limited, as builds without optimization are slow.
const MINUTES: f64 = 5.0;

/// One run: frames of the requests, and of the replies of this build.
struct Run {
    requests: Vec<u8>,
    replies: Vec<u8>,
}

impl Run {
    fn new((config, log): &(Config, Log)) -> Result<Self, Failure> {
        let start = Request::Start {
            config: *config,
            estimates_every: ESTIMATES_EVERY,
        };
        let mut responder = Responder::start(*config, ESTIMATES_EVERY)?;
        let mut run = Self {
            requests: encode(0, &start).expect("short").to_vec(),
            replies: Vec::new(),
        };
        let mut is_navigating = false;
        for (to, request) in (1..).zip(requests(log.imu.iter(), &log.gnss)) {
            run.requests.extend(encode(to, &request).expect("short"));
            let reply = responder.answer(&request).ok_or("no answer")?;
            if let Reply::Imu(Ok(reply)) = &reply {
                is_navigating = reply.report.solution.is_some();
            }
            let message = FromBoard::Reply { to, reply };
            run.replies.extend(encode(to, &message).expect("short"));
        }
        assert!(is_navigating, "at the end of the run");
        Ok(run)
    }
}

/// Number of frames that differ.
fn difference(one: &[u8], other: &[u8]) -> usize {
    let frames = |bytes: &[u8]| bytes.split(|byte| *byte == 0).count();
    let pairs = one
        .split(|byte| *byte == 0)
        .zip(other.split(|byte| *byte == 0));
    pairs.filter(|(one, other)| one != other).count() + frames(one).abs_diff(frames(other))
}

/// Builds with different features have the same path.
static PROGRAM: Mutex<()> = Mutex::new(());

/// Number of different replies of another build, for each run.
fn differences(
    runs: &[Run],
    profile: &str,
    modify_build: impl FnOnce(&mut Command) -> Result<(), String>,
) -> Result<Vec<usize>, Failure> {
    let _program = PROGRAM.lock();
    let mut build = cargo(".", "replay");
    build
        .args(["build", "--package=ins-replay", "--locked"])
        .args(["--profile", profile])
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0");
    modify_build(&mut build)?;
    succeed(&mut build)?;
    let folder = if profile == "dev" { "debug" } else { profile };
    let program = build_folder("replay").join(folder).join("ins-replay");
    runs.iter()
        .map(|run| {
            let mut replay = Command::new(&program)
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                .spawn()?;
            let mut stdin = replay.stdin.take().ok_or("piped")?;
            stdin.write_all(&run.requests)?;
            drop(stdin);
            let output = replay.wait_with_output()?;
            assert!(output.status.success());
            Ok(difference(&output.stdout, &run.replies))
        })
        .collect()
}

#[test]
fn bits_are_independent_of_optimization_and_features() -> Result<(), Failure> {
    let runs = [
        Run::new(&drive(Grade::Hg1700, MINUTES))?,
        Run::new(&drive(Grade::Mems, MINUTES))?,
        Run::new(&flight(MINUTES)?)?,
    ];
    let plain = differences(&runs, "dev", |_| Ok(()))?;
    assert_eq!(plain, [0, 0, 0], "not optimized");
    let with_std = differences(&runs, "release", |build| {
        build.args(["--features", "std"]);
        Ok(())
    })?;
    assert_eq!(with_std, [0, 0, 0], "optimized, std");
    Ok(())
}

/// GNU's C library rounds some angles differently than `libm`: the comparison detects that.
#[cfg(target_env = "gnu")]
#[test]
fn sines_of_std_change_bits() -> Result<(), Failure> {
    let exchange = (
        "src/math.rs",
        "(libm::sin(angle_rad), libm::cos(angle_rad))",
        "extern crate std;
        (angle_rad.sin(), angle_rad.cos())",
    );
    // Used for the latitude, which changes most in a flight.
    let runs = [
        Run::new(&flight(MINUTES)?)?,
        Run::new(&drive(Grade::Hg1700, MINUTES))?,
    ];
    let different = differences(&runs, "release", |build| {
        build.args(["--features", "std"]);
        with_altered_core(build, "std_sines", exchange)
    })?;
    assert!(different.iter().any(|frames| *frames > 0), "{different:?}");
    Ok(())
}

//! Command `rehearse`: faulty programs under test, interruptions, and recorded noise.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// A folder with a plan and a drive of a unit.
fn home() -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("plan.toml"), include_str!("turns.toml")).unwrap();
    let drive = ["drive", "--minutes", "6", "--seed", "2", "--out", "drive"];
    succeed(host_sim(home.path()).args(drive));
    home
}

fn succeed(command: &mut Command) {
    assert!(command.status().unwrap().success(), "{command:?}");
}

fn host_sim(home: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.current_dir(home).stdout(Stdio::null());
    command
}

fn rehearse(home: &Path, out: &str, flights: &str, options: &[&str]) -> Command {
    let mut command = host_sim(home);
    command
        .args(["rehearse", "drive", "--plan", "plan.toml"])
        .args(["--minutes-free", "1", "--out", out, "--flights", flights])
        .args(options);
    command
}

fn summary(home: &Path, out: &str) -> Value {
    serde_json::from_slice(&fs::read(home.join(out).join("rehearsal.json")).unwrap()).unwrap()
}

/// RMS of the level position, with GNSS and at the end without.
fn position_rms(tested: &Value) -> [f64; 2] {
    let rows = tested["rows"].as_array().unwrap();
    [Value::Null, Value::from(60.0)].map(|since| {
        let wanted =
            |row: &&Value| row["quantity"] == "level position" && row["without_gnss_s"] == since;
        rows.iter().find(wanted).unwrap()["rms"].as_f64().unwrap()
    })
}

/// A program with a valid greeting that gives `ANSWER` to every request.
const ANSWERING: &str = "
import sys, time
for line in sys.stdin:
    fields = line.strip().split(',')
    if fields[0] == 'start':
        print('ready,1', flush=True)
    if fields[0] == 'ask':
        t = fields[1]
        good = f'none,{t}'
        ANSWER
        print(good, flush=True)
";

/// Writes much to standard error, beyond the file size limit, and does not end; started by a script.
const STAYS: &str = "
import os, sys, time
open('stays.pid', 'w').write(str(os.getpid()))
print('all is well\\n' * 100_000, file=sys.stderr, flush=True)
print('ready,1', flush=True)
time.sleep(600)
";

#[test]
fn every_program_failure_is_reported_with_its_cause() {
    let home = home();
    let home = home.path();
    let with = |name: &str, answer: &str| {
        let text = ANSWERING.replace("ANSWER", answer);
        fs::write(home.join(format!("{name}.py")), text).unwrap();
        format!("{name}=python3 {name}.py")
    };
    let late = "if float(t) > 40: time.sleep(1.0)";
    let cases = [
        (
            with(
                "crash",
                "if float(t) > 20: raise ValueError('no filter after 20 s')",
            ),
            "crashed",
            "no filter after 20 s",
        ),
        (
            with("hang", "if float(t) > 30: time.sleep(60)"),
            "hung",
            "no answer in 1.50 s",
        ),
        (with("late", late), "late", "the limit is 0.50 s"),
        (
            with("nonsense", "good = 'forty\x1b[2Jtwo'"),
            "wrong",
            "answered `forty [2Jtwo`: expected `solution,1,` and 9 numbers, or `none,1`",
        ),
        (
            with("not-finite", "good = f'solution,{t},56,40,nan,0,0,0,0,0,0'"),
            "wrong",
            "expected finite numbers, found NaN",
        ),
        (
            with("behind", "good = f'none,{float(t) - 1}'"),
            "wrong",
            "expected an answer for 1 s, this is for 0 s",
        ),
        (
            with("silent", "import os; os.close(1); time.sleep(60)"),
            "crashed",
            "goes on",
        ),
        (
            "leaves=python3 leaves.py".to_owned(),
            "crashed",
            "exit status: 0",
        ),
        ("deaf=sleep 60".to_owned(), "hung", "no answer in 45.00 s"),
        (
            "stays=sh -c 'ulimit -f 1; python3 stays.py; true'".to_owned(),
            "hung",
            "no answer in 1.50 s",
        ),
        (
            "heir=sh -c 'echo ready,1; sleep 600 & exit 7'".to_owned(),
            "crashed",
            "exit status: 7",
        ),
        (
            "gone=./no-such-program".to_owned(),
            "unusable",
            "cannot be run",
        ),
        (
            "other=echo hello".to_owned(),
            "unusable",
            "answered `hello`: expected `ready,1`",
        ),
    ];
    // Exits while megabytes are written to it.
    let leaves = "import sys\nsys.stdin.readline()\nprint('ready,1,after', flush=True)\n";
    fs::write(home.join("leaves.py"), leaves).unwrap();
    fs::write(home.join("stays.py"), STAYS).unwrap();
    let good = with("none", "pass");
    let mut options = vec!["--time-limit", "0.5", "--models", "0", "--budget", "0"];
    options.extend(["--with", "core", "--with", &good]);
    options.extend(
        cases
            .iter()
            .flat_map(|(with, ..)| ["--with", with.as_str()]),
    );
    let start = Instant::now();
    succeed(&mut rehearse(home, "out", "1", &options));
    assert!(start.elapsed() < Duration::from_mins(5));
    let summary = summary(home, "out");
    let tested = summary["tested"].as_array().unwrap();
    // Other programs are not affected.
    assert!(position_rms(&tested[0])[0] < 20.0, "{}", tested[0]);
    assert!(tested[1]["failures"].as_array().unwrap().is_empty());
    assert!(tested[1]["rows"].as_array().unwrap().is_empty());
    let overview = fs::read_to_string(home.join("out/overview.md")).unwrap();
    assert!(overview.contains("| none | 0 of 1 |"), "{overview}");
    for ((with, fault, cause), tested) in cases.iter().zip(&tested[2..]) {
        let failures = tested["failures"].as_array().unwrap();
        assert_eq!(failures.len(), 1, "{with}: {tested}");
        assert_eq!(failures[0]["fault"], *fault, "{with}: {tested}");
        let reported = failures[0]["cause"].as_str().unwrap();
        assert!(reported.contains(cause), "{with}: {reported}");
        assert_eq!(tested["flights"], 0);
    }
    assert!(has_ended(&home.join("stays.pid")));
}

#[test]
#[cfg(unix)]
fn a_changed_program_is_another_rehearsal() {
    let home = home();
    let home = home.path();
    let run = |more: &[&str]| {
        let options = ["--models", "0", "--budget", "0", "--with", "./mine"];
        let mut command = rehearse(home, "out", "1", &options);
        let output = command.args(more).output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    let write_program = |answer: &str| {
        let text = ANSWERING.replace("ANSWER", answer);
        let file = home.join("mine");
        fs::write(&file, format!("#!/usr/bin/env python3{text}")).unwrap();
        succeed(Command::new("chmod").arg("+x").arg(file));
    };
    let fault = || summary(home, "out")["tested"][0]["failures"][0]["fault"].clone();
    run(&[]);
    assert_eq!(fault(), "unusable");
    // A program that was missing is run once it exists.
    write_program("pass");
    run(&[]);
    assert_eq!(fault(), Value::Null);
    let stderr = run(&[]);
    let taken = "out: flights taken from before: 1, left to fly: 0";
    assert!(stderr.contains(taken), "{stderr}");
    write_program("good = 'nonsense'");
    let stderr = run(&[]);
    assert!(
        stderr.contains("with other settings: programs\n"),
        "{stderr}"
    );
    run(&["--force"]);
    assert_eq!(fault(), "wrong");
    // Also the script of an interpreter that is a local file.
    let with = |more: &[&str]| {
        let options = ["--models", "0", "--budget", "0", "--with"];
        let mut command = rehearse(home, "script", "1", &options);
        command.arg("x=./interpreter mine").args(more);
        String::from_utf8(command.output().unwrap().stderr).unwrap()
    };
    let interpreter = "#!/bin/sh\nexec python3 \"$@\"\n";
    fs::write(home.join("interpreter"), interpreter).unwrap();
    succeed(
        Command::new("chmod")
            .arg("+x")
            .arg(home.join("interpreter")),
    );
    with(&[]);
    write_program("pass");
    let stderr = with(&[]);
    assert!(
        stderr.contains("with other settings: programs\n"),
        "{stderr}"
    );
}

/// Whether the process whose id is in a file has ended.
fn has_ended(file: &Path) -> bool {
    let pid = fs::read_to_string(file).unwrap();
    let state = fs::read_to_string(Path::new("/proc").join(pid).join("stat")).unwrap_or_default();
    state.is_empty() || state.contains(") Z ")
}

/// Runs forever and ignores signals.
const COMPUTING: &str = "
import os, signal
for number in [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]:
    signal.signal(number, signal.SIG_IGN)
print('ready,1', flush=True)
open('computes.new', 'w').write(str(os.getpid()))
os.rename('computes.new', 'computes.pid')
while True:
    pass
";

#[test]
fn programs_end_when_the_rehearsal_is_stopped() {
    let home = home();
    let home = home.path();
    fs::write(home.join("computes.py"), COMPUTING).unwrap();
    let with = ["--with", "python3 computes.py", "--time-limit", "600"];
    let mut stopped = rehearse(home, "out", "1", &with).spawn().unwrap();
    let number = home.join("computes.pid");
    wait_until(|| number.exists());
    succeed(Command::new("kill").arg(stopped.id().to_string()));
    assert_eq!(stopped.wait().unwrap().code(), Some(130));
    wait_until(|| has_ended(&number));
}

fn wait_until(done: impl Fn() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_mins(5), "too late");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn answers_after_the_end_have_the_total_time_limit() {
    let home = home();
    let home = home.path();
    let stops = "
import sys, time
first = None
for line in sys.stdin:
    fields = line.strip().split(',')
    if fields[0] == 'start':
        print('ready,1,after', flush=True)
    if fields[0] == 'ask':
        first = first or fields[1]
    if fields[0] == 'end':
        print(f'none,{first}', flush=True)
        time.sleep(600)
";
    fs::write(home.join("stops.py"), stops).unwrap();
    let mut options = vec!["--time-limit", "0.1", "--models", "0", "--budget", "0"];
    options.extend(["--with", "stops=python3 stops.py"]);
    // There is no result.
    let status = rehearse(home, "out", "1", &options).status().unwrap();
    assert_eq!(status.code(), Some(1));
    let failure = &summary(home, "out")["tested"][0]["failures"][0];
    assert_eq!(failure["fault"], "hung", "{failure}");
    let cause = failure["cause"].as_str().unwrap();
    let seconds: Vec<f64> = (cause.split(' '))
        .filter_map(|word| word.parse().ok())
        .collect();
    // Waiting time, and the limit.
    assert!((seconds[0] - seconds[1]).abs() < 1e-9, "{cause}");
}

/// Lines of finished flights without the computing time, which varies.
fn flights(file: &Path) -> Vec<String> {
    let text = fs::read_to_string(file).unwrap();
    let mut lines: Vec<String> = (text.lines())
        .map(|line| {
            let mut line: Value = serde_json::from_str(line).unwrap();
            for outcome in line["outcomes"].as_array_mut().unwrap() {
                outcome["took_ms"] = Value::Null;
            }
            line.to_string()
        })
        .collect();
    lines.sort();
    lines
}

#[test]
fn results_are_independent_of_threads_interruptions_and_shards() {
    let home = home();
    let home = home.path();
    let options = [
        "--models", "2", "--budget", "1", "--with", "core", "--with", "kalman",
    ];
    let run = |threads: &str, out: &str, more: &[&str]| {
        let mut command = rehearse(home, out, "3", &options);
        command.args(more).env("RAYON_NUM_THREADS", threads);
        command
    };
    succeed(&mut run("1", "one", &[]));
    let text = |out: &str, name: &str| fs::read_to_string(home.join(out).join(name)).unwrap();
    let whole = flights(&home.join("one/runs.jsonl"));

    let mut killed = run("2", "killed", &[]).spawn().unwrap();
    let runs = home.join("killed/runs.jsonl");
    let done = || fs::read_to_string(&runs).map_or(0, |text| text.matches('\n').count());
    wait_until(|| done() >= 3);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(done() < whole.len(), "too late for this test");
    let truncated = fs::read_to_string(&runs).unwrap() + "{\"case\":\"fou";
    fs::write(&runs, truncated).unwrap();
    succeed(&mut run("2", "killed", &[]));
    assert_eq!(flights(&runs), whole);

    // One shard, and the rest by a run without shards.
    succeed(&mut run("2", "parts", &["--shard", "2/3"]));
    assert!(!home.join("parts/rehearsal.json").exists());
    succeed(&mut run("2", "parts", &[]));

    // The Slurm script with plain processes; task 0 merges.
    succeed(&mut run("1", "an array", &["--slurm", "2", "--force"]));
    assert!(!home.join("an array/runs-1-of-2.jsonl").exists());
    for task in ["1", "2", "0"] {
        assert!(!home.join("an array/rehearsal.json").exists());
        let mut job = Command::new("bash");
        job.arg(home.join("an array/rehearse.sbatch"))
            .env("HOST_SIM", env!("CARGO_BIN_EXE_host-sim"))
            .env("SLURM_ARRAY_TASK_ID", task)
            .stdout(Stdio::null());
        succeed(&mut job);
    }
    // All flights are in the shards.
    assert_eq!(text("an array", "runs.jsonl"), "");

    for name in ["rehearsal.json", "errors.csv", "error-model.toml"] {
        for out in ["killed", "parts", "an array"] {
            assert_eq!(text(out, name), text("one", name), "{out}: {name}");
        }
    }
    // Two models have no interval.
    let row = &summary(home, "one")["tested"][0]["rows"][0];
    assert_eq!(row["model_95"], Value::Null);
    assert!(text("one", "overview.md").contains("takes 5 models drawn"));
    let page = text("one", "report.html");
    assert!(page.contains("What each error costs core") && page.contains("do not show"));

    // A rehearsal with other settings does not resume there.
    let mut other = run("1", "one", &["--seed", "5"]);
    let other = other.output().unwrap();
    let stderr = String::from_utf8(other.stderr).unwrap();
    assert!(
        !other.status.success() && stderr.contains("with other settings: seed\n"),
        "{stderr}"
    );
}

#[test]
fn untrusted_drives_are_reported_first() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    fs::write(home.join("plan.toml"), include_str!("turns.toml")).unwrap();
    let drive = ["drive", "--minutes", "6", "--errors", "mems"];
    succeed(host_sim(home).args(drive).args(["--out", "drive"]));
    let mut options = vec!["--models", "0", "--budget", "0", "--with", "core"];
    // Sensors are much worse than this class.
    options.extend(["--grade", "hg1700"]);
    let output = rehearse(home, "out", "1", &options)
        .stdout(Stdio::piped())
        .output()
        .unwrap();
    assert!(output.status.success());
    let verdict = "simulated drive, seed 1: Verdict: do NOT trust these estimates as they stand.";
    let stderr = String::from_utf8(output.stdout).unwrap();
    assert!(stderr.starts_with(verdict), "{stderr}");
    let summary = summary(home, "out");
    assert_eq!(summary["verdicts"][0]["trusted"], false);
    assert!(!summary["verdicts"][0]["against"][0].is_null());
    let page = fs::read_to_string(home.join("out/report.html")).unwrap();
    assert!(page.contains(verdict));

    let study = ["study", "rehearse", "drive", "--against", "drive"];
    let output = host_sim(home)
        .args(study)
        .args(["--seeds", "2", "--grade", "hg1700"])
        .stdout(Stdio::piped())
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stdout).unwrap();
    assert_eq!(stderr.matches(verdict).count(), 2, "{stderr}");
}

/// Barometers are not simulated, and zero noise cannot be configured.
#[test]
fn keys_without_effect_or_not_configurable_are_rejected() {
    let home = home();
    let home = home.path();
    let barometer = "gnss.rate_hz = 5.0\n[barometer]\nnoise_m = 0.2\n";
    for (keys, message) in [
        (barometer, "keys.toml, line 2: no algorithm is given"),
        ("imu.stamp_jitter_s = 0.006", "keys.toml, line 1: imu.stamp"),
        (
            "gnss.rate_hz = 5.0\ngyro_deg_h.white_noise = 0.0\n",
            "keys.toml, line 2: `gyro_deg_h.white_noise = 0.0`: the configuration cannot be used",
        ),
        (
            "given_heading_sigma_deg = 1.0\n",
            "by --heading-sigma and, in --set, by given_heading_sigma_deg",
        ),
    ] {
        fs::write(home.join("keys.toml"), keys).unwrap();
        let mut command = rehearse(home, "out", "1", &["--set", "keys.toml"]);
        if keys.starts_with("given") {
            command.args(["--heading-sigma", "3"]);
        }
        let stderr = String::from_utf8(command.output().unwrap().stderr).unwrap();
        let stderr = stderr.replace("\n  \u{2502} ", " ");
        assert!(stderr.contains(message), "{stderr}");
    }
    assert!(!home.join("out").exists());
}

/// The noise of this unit is white: noise recorded at rest has the same effect.
#[test]
fn recorded_white_noise_has_the_effect_of_white_noise() {
    let home = home();
    let home = home.path();
    let options = ["--models", "0", "--budget", "0", "--noise-from", "drive"];
    succeed(&mut rehearse(home, "out", "8", &options));
    let summary = summary(home, "out");
    let tested = summary["tested"].as_array().unwrap();
    assert_eq!(tested[1]["recorded_noise"], true);
    let [white, recorded] = [0, 1].map(|which| position_rms(&tested[which]));
    for (white, recorded) in white.into_iter().zip(recorded) {
        assert!((white - recorded).abs() > 1e-9);
        // Eight flights that differ in noise only.
        let ratio = recorded / white;
        assert!((0.6..1.67).contains(&ratio), "{white} m, {recorded} m");
    }
    // The same recording at another path resumes; another recording does not.
    fs::rename(home.join("drive"), home.join("rest")).unwrap();
    let again = ["drive", "--minutes", "6", "--seed", "2", "--out", "drive"];
    succeed(host_sim(home).args(again));
    let options = ["--models", "0", "--budget", "0", "--noise-from", "rest"];
    succeed(&mut rehearse(home, "out", "8", &options));
    let other = ["drive", "--minutes", "6", "--seed", "3", "--out", "rest"];
    succeed(host_sim(home).args(other).arg("--force"));
    let output = rehearse(home, "out", "8", &options).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        stderr.contains("with other settings: noise_from"),
        "{stderr}"
    );
    // Using a drive twice would understate the uncertainty of the model.
    let output = rehearse(home, "twice", "1", &["./drive"]).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("the same recording as drive"), "{stderr}");
}

#[test]
fn templates_in_python_c_and_rust_are_equivalent() {
    let home = home();
    let home = home.path();
    let adaptors = Path::new(env!("CARGO_MANIFEST_DIR")).join("adaptors");
    let compile = |compiler: &str, options: &str, file: &str| {
        let mut command = Command::new(compiler);
        command.current_dir(home).arg(adaptors.join(file));
        succeed(command.args(options.split(' ')));
    };
    let warnings = "-Wall -Wextra -Werror";
    compile(
        "cc",
        &format!("-O2 {warnings} -o c-filter -lm"),
        "template.c",
    );
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    compile(&rustc, "--edition=2024 -O -o rust-filter", "template.rs");
    let python = format!("python3 '{}'", adaptors.join("template.py").display());
    let options = ["--models", "0", "--budget", "0", "--with", &python];
    let programs = ["--with", "./c-filter", "--with", "./rust-filter"];
    let all = [&options[..], &programs].concat();
    succeed(&mut rehearse(home, "out", "1", &all));
    let summary = summary(home, "out");
    let [python, c, rust] = [0, 1, 2].map(|which| position_rms(&summary["tested"][which]));
    // With ten fixes a second it is as accurate as the receiver.
    assert!(python[0] < 20.0, "{python:?}");
    for other in [c, rust] {
        for (mine, its) in python.iter().zip(other) {
            assert!((mine - its).abs() < 0.01, "{python:?} {other:?}");
        }
    }
}

/// An outage, lost samples, and another key.
#[test]
fn set_keys_are_simulated_and_reported() {
    let home = home();
    let home = home.path();
    let keys = "gnss.outages = [{ start_s = 50, duration_s = 30 }]\n\
                imu.holes = [{ start_s = 149.9, duration_s = 1 }]\n\
                accel_mps2.misalignment_sigma = 0.002\n";
    fs::write(home.join("keys.toml"), keys).unwrap();
    let options = ["--models", "0", "--budget", "0", "--set", "keys.toml"];
    succeed(&mut rehearse(home, "out", "2", &options));
    let summary = summary(home, "out");
    let assumed = |name: &str| {
        let mut all = summary["assumed"].as_array().unwrap().iter();
        all.find(|part| part["name"] == name).unwrap()
    };
    let misalignment = assumed("accel_mps2.misalignment_sigma");
    assert_eq!(misalignment["value"], 0.002);
    assert_eq!(misalignment["why"], "set by --set");
    assert_eq!(assumed("gyro_deg_h.misalignment_sigma")["value"], 0.0);
    let set = summary["set"].as_array().unwrap();
    let names: Vec<&Value> = set.iter().map(|key| &key["name"]).collect();
    assert_eq!(
        names,
        ["accel_mps2.misalignment_sigma", "gnss.outages", "imu.holes"]
    );
    // There are answers where samples are lost at the end, and the outage is not evaluated as aided.
    let [aided, free] = position_rms(&summary["tested"][0]);
    assert!(aided < 2.0, "{aided}");
    assert!(free > 5.0, "{free}");
    let table = fs::read_to_string(home.join("out/errors.csv")).unwrap();
    for (second, gnss) in [(45, 1), (51, 0), (78, 0), (87, 1), (91, 0)] {
        assert!(
            table.contains(&format!("core,white,{second},{gnss},")),
            "{table}"
        );
    }
}

/// In an outage of about a second, fractions of it end at the same second.
#[test]
fn rows_are_labelled_by_their_times() {
    let home = home();
    let home = home.path();
    let mut command = host_sim(home);
    command
        .args(["rehearse", "drive", "--plan", "plan.toml", "--out", "out"])
        .args(["--flights", "1", "--models", "0", "--budget", "0"])
        .args(["--minutes-free", "0.02"]);
    succeed(&mut command);
    let summary = summary(home, "out");
    let rows = summary["tested"][0]["rows"].as_array().unwrap();
    let labels: Vec<&Value> = rows.iter().map(|row| &row["without_gnss_s"]).collect();
    assert_eq!(
        labels[..4],
        [&Value::Null, &0.2.into(), &1.2.into(), &Value::Null]
    );
}

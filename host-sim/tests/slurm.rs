//! Campaigns by command line: results do not depend on threads, interruptions and shards. The shards are those
//! of the job array that `campaign --slurm` writes, under Slurm: a controller and a node on this machine,
//! stopped at the end. Needs Slurm and munge: `.ci/install`.
#![cfg(target_os = "linux")]

use std::env;
use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const HOST_SIM: &str = env!("CARGO_BIN_EXE_host-sim");

const PLAN: &str = "
    seed = 3
    units = 2
    drives = 1
    drive_minutes = 6
    flights = 4
    minutes_aided = 6
    minutes_free = 4
    unit_spread = 0.3
";
/// A model, and the flights of a unit with each of its models.
const RUNS_OF_A_UNIT: usize = 1 + 2 * 4;

/// One of each package.
const PROGRAMS: [&str; 4] = ["munged", "slurmctld", "slurmd", "sbatch"];

/// Runs the daemons until the test closes its end of the pipe or dies. A job outlives the daemons, so it is
/// stopped first.
const DAEMONS: &str = "
    mungekey --create --keyfile=$PWD/munge.key
    munged --foreground --force --key-file=$PWD/munge.key --socket=$PWD/munge.socket \\
        --pid-file=$PWD/munged.pid --seed-file=$PWD/munge.seed 2>munged.log &
    for _ in {1..100}; do [ -S munge.socket ] && break; sleep 0.1; done
    slurmctld -D 2>slurmctld.log &
    slurmd -D 2>slurmd.log &
    read -r
    timeout 10 scancel --partition=test
    for _ in {1..100}; do [ \"$(timeout 10 squeue --noheader)\" ] || break; sleep 0.1; done
    kill $(jobs -p)
    wait
";

/// Slurm with its files in one folder.
struct Cluster {
    home: PathBuf,
    daemons: Child,
}

impl Cluster {
    fn start(home: PathBuf) -> Self {
        for program in PROGRAMS {
            assert!(
                env::split_paths(&path()).any(|folder| folder.join(program).is_file()),
                "{program} is missing: run .ci/install or install Slurm (slurmctld, slurmd, \
                 slurm-client) and munge"
            );
        }
        for folder in ["state", "spool"] {
            fs::create_dir_all(home.join(folder)).unwrap();
        }
        fs::write(home.join("slurm.conf"), configuration(&home)).unwrap();
        // In its own session: Ctrl-C must only stop the test.
        let daemons = command(&home, "setsid")
            .args(["bash", "-c", DAEMONS])
            .current_dir(&home)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let cluster = Self { home, daemons };
        cluster.wait_for("the node to be idle", || {
            let mut sinfo = command(&cluster.home, "sinfo");
            let output = sinfo.args(["--noheader", "--format=%T"]).output().unwrap();
            output.stdout == b"idle\n"
        });
        cluster
    }

    /// Runs a command and returns its output.
    fn run(&self, program: &str, arguments: &[&str]) -> String {
        let output = command(&self.home, program)
            .args(arguments)
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success(),
            "{program} {arguments:?}: {errors}\n{}",
            self.logs()
        );
        String::from_utf8(output.stdout).unwrap()
    }

    /// Submits by the commands in the script's header; ids of the job array and of the merging job.
    fn submit(&self, script: &Path) -> [String; 2] {
        let text = fs::read_to_string(script).unwrap();
        // Output of jobs goes to the logs.
        fs::copy(script, self.home.join(script.file_name().unwrap())).unwrap();
        let submit_lines = text.lines().filter_map(|line| line.strip_prefix("#   "));
        let commands: Vec<&str> = submit_lines.chain(["echo $job"]).collect();
        let output = (command(&self.home, "bash").args(["-euc", &commands.join("\n")]))
            .current_dir(&self.home)
            .env("HOST_SIM", HOST_SIM)
            .output()
            .unwrap();
        let stdout = String::from_utf8(output.stdout).unwrap();
        let words: Vec<&str> = stdout.split_whitespace().collect();
        let ["Submitted", "batch", "job", sum, array] = words[..] else {
            panic!("{stdout}{}", String::from_utf8_lossy(&output.stderr));
        };
        [array, sum].map(str::to_owned)
    }

    /// A field of a job, as `squeue --Format` names it.
    fn field(&self, job: &str, field: &str) -> String {
        let options = [
            "--noheader",
            "--states=all",
            &format!("--jobs={job}"),
            &format!("--Format={field}"),
        ];
        self.run("squeue", &options).trim().to_owned()
    }

    fn wait_for_state(&self, job: &str, state: &str) {
        self.wait_for(&format!("job {job} to be {state}"), || {
            self.field(job, "State") == state
        });
    }

    fn wait_for(&self, what: &str, happened: impl Fn() -> bool) {
        let start = Instant::now();
        while !happened() {
            assert!(
                start.elapsed() < Duration::from_mins(2),
                "timeout waiting for {what}\n{}",
                self.logs()
            );
            sleep(Duration::from_millis(20));
        }
    }

    fn logs(&self) -> String {
        text_of(&self.home, "log") + &text_of(&self.home, "out")
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // `wait` closes the pipe first.
        let _ = self.daemons.wait();
    }
}

fn configuration(home: &Path) -> String {
    let user = fs::metadata(home).unwrap().uid();
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let host = host.trim().split('.').next().unwrap();
    // Bound at the same time, so that they differ.
    let ports = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    let [controller, node] = ports.map(|port| port.local_addr().unwrap().port());
    let home = home.display();
    format!(
        "
        ClusterName=test
        SlurmctldHost={host}(127.0.0.1)
        SlurmctldPort={controller}
        SlurmdPort={node}
        CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
        SlurmUser={user}
        SlurmdUser={user}
        AuthType=auth/munge
        AuthInfo=socket={home}/munge.socket
        StateSaveLocation={home}/state
        SlurmdSpoolDir={home}/spool
        SlurmctldPidFile={home}/slurmctld.pid
        SlurmdPidFile={home}/slurmd.pid
        ProctrackType=proctrack/linuxproc
        TaskPlugin=task/none
        JobAcctGatherType=jobacct_gather/none
        SelectType=select/cons_tres
        SelectTypeParameters=CR_CPU
        # Two, whatever the machine has.
        SlurmdParameters=config_overrides
        NodeName={host} NodeAddr=127.0.0.1 CPUs=2
        PartitionName=test Nodes={host} Default=YES
        "
    )
}

/// Daemons may be in directories that are not in a user's path.
fn path() -> String {
    env::var("PATH").unwrap_or_default() + ":/usr/sbin"
}

fn command(home: &Path, program: &str) -> Command {
    let mut command = Command::new(program);
    command
        .env("PATH", path())
        .env("SLURM_CONF", home.join("slurm.conf"));
    command
}

/// On two threads, where a job has one. The error is the message.
fn host_sim(home: &Path, arguments: &str) -> Result<(), String> {
    let mut command = Command::new(HOST_SIM);
    command.current_dir(home).args(arguments.split_whitespace());
    command.env("RAYON_NUM_THREADS", "2");
    let output = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    output.status.success().then_some(()).ok_or(stderr)
}

/// Concatenated text of all files in a folder with an extension.
fn text_of(folder: &Path, extension: &str) -> String {
    let files = fs::read_dir(folder).unwrap();
    let files = files.map(|entry| entry.unwrap().path());
    files
        .filter(|file| file.extension().is_some_and(|end| end == extension))
        .map(|file| fs::read_to_string(file).unwrap())
        .collect()
}

fn sorted_runs(folder: &Path) -> Vec<String> {
    let text = text_of(folder, "jsonl");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

#[test]
fn results_are_unchanged_by_a_requeued_shard() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    fs::write(home.join("plan.toml"), PLAN).unwrap();
    let cluster = Cluster::start(home.join("slurm"));
    host_sim(home, "campaign plan.toml --out one").unwrap();
    host_sim(home, "campaign plan.toml --out array --slurm 2").unwrap();
    let [array, sum] = cluster.submit(&home.join("array/campaign.sbatch"));
    let [stopped, other, sum] =
        [(&array, 1), (&array, 2), (&sum, 0)].map(|(job, task)| format!("{job}_{task}"));
    let file = home.join("array/runs-1-of-2.jsonl");
    let runs = || fs::read_to_string(&file).unwrap_or_default();
    cluster.wait_for("a flight", || runs().matches('\n').count() > 1);
    cluster.run("scontrol", &["requeuehold", &stopped]);
    cluster.wait_for_state(&stopped, "PENDING");
    let before = runs();
    let done = before.matches('\n').count();
    assert!(done < RUNS_OF_A_UNIT, "too late for this test");
    // Reversed, so that repeated runs would show, and cut within a line.
    let mut before: Vec<&str> = before.split_inclusive('\n').take(done).collect();
    before.reverse();
    let before = before.concat();
    fs::write(&file, before.clone() + "{\"run\":\"fli").unwrap();

    // Merging waits for all shards, and fails without.
    cluster.wait_for_state(&other, "COMPLETED");
    assert_eq!(cluster.field(&sum, "State"), "PENDING");
    let unfinished = host_sim(home, "merge array").unwrap_err();
    assert!(unfinished.contains("flights are missing"), "{unfinished}");

    // At once, instead of minutes later.
    let job = format!("JobId={stopped}");
    cluster.run("scontrol", &["update", &job, "StartTime=now"]);
    cluster.run("scontrol", &["release", &stopped]);
    cluster.wait_for_state(&sum, "COMPLETED");
    assert_eq!(cluster.field(&stopped, "RestartCnt"), "1");
    assert!(runs().starts_with(&before), "finished runs were repeated");

    let [one, array] = ["one", "array"].map(|folder| home.join(folder));
    assert_eq!(sorted_runs(&one).len(), 2 * RUNS_OF_A_UNIT);
    assert_eq!(sorted_runs(&array), sorted_runs(&one));
    for file in ["plan.toml", "campaign.json"] {
        let [array, one] = [&array, &one].map(|folder| fs::read(folder.join(file)).unwrap());
        assert!(array == one, "{file} differs");
    }

    let other = PLAN.replace("seed = 3", "seed = 4");
    fs::write(home.join("other.toml"), other).unwrap();
    let message = host_sim(home, "campaign other.toml --out one").unwrap_err();
    assert!(message.contains("a campaign of another plan"), "{message}");
}

#[test]
fn a_campaign_resumes_from_a_finished_shard() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    fs::write(home.join("plan.toml"), PLAN).unwrap();
    host_sim(home, "campaign plan.toml --out one --shard 1/2").unwrap();
    host_sim(home, "campaign plan.toml --out one").unwrap();
    assert_eq!(sorted_runs(&home.join("one")).len(), 2 * RUNS_OF_A_UNIT);
}

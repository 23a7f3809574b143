//! The job array that `campaign --slurm` writes, under Slurm: a controller and a node of its own on
//! this machine, stopped at the end. Needs Slurm and munge: `.ci/install`.
#![cfg(target_os = "linux")]

use std::env;
use std::fs::{self, File};
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

/// Of their packages one each, those of the clients together.
const PROGRAMS: [&str; 5] = ["munged", "mungekey", "slurmctld", "slurmd", "sbatch"];

/// Slurm with its files in one folder.
struct Cluster {
    home: PathBuf,
    daemons: Vec<Child>,
}

impl Cluster {
    fn start(home: PathBuf) -> Self {
        let mut cluster = Self {
            home,
            daemons: Vec::new(),
        };
        for program in PROGRAMS {
            let there = path()
                .split(':')
                .any(|at| Path::new(at).join(program).is_file());
            assert!(
                there,
                "{program} is missing: run .ci/install or install Slurm (slurmctld, slurmd, \
                 slurm-client) and munge"
            );
        }
        for folder in ["state", "spool"] {
            fs::create_dir_all(cluster.home.join(folder)).unwrap();
        }
        fs::write(cluster.home.join("slurm.conf"), cluster.configuration()).unwrap();
        cluster.start_munge();
        cluster.start_daemon("slurmctld", &["-D"]);
        cluster.start_daemon("slurmd", &["-D"]);
        cluster.wait_for("the node to be idle", || {
            cluster.run("sinfo", &["--noheader", "--format=%T"]).trim() == "idle"
        });
        cluster
    }

    fn configuration(&self) -> String {
        let home = self.home.display();
        let user = fs::metadata(&self.home).unwrap().uid();
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        let host = host.trim().split('.').next().unwrap();
        // Both at once: two that are free.
        let ports = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        let [controller, node] = ports.map(|port| port.local_addr().unwrap().port());
        format!(
            "ClusterName=test\n\
             SlurmctldHost={host}(127.0.0.1)\n\
             SlurmctldPort={controller}\n\
             SlurmdPort={node}\n\
             CommunicationParameters=NoInAddrAny,NoCtldInAddrAny\n\
             SlurmUser={user}\n\
             SlurmdUser={user}\n\
             AuthType=auth/munge\n\
             AuthInfo=socket={home}/munge.socket\n\
             StateSaveLocation={home}/state\n\
             SlurmdSpoolDir={home}/spool\n\
             SlurmctldPidFile={home}/slurmctld.pid\n\
             SlurmdPidFile={home}/slurmd.pid\n\
             ProctrackType=proctrack/linuxproc\n\
             TaskPlugin=task/none\n\
             JobAcctGatherType=jobacct_gather/none\n\
             SelectType=select/cons_tres\n\
             SelectTypeParameters=CR_CPU\n\
             # Two, whatever the machine has.\n\
             SlurmdParameters=config_overrides\n\
             NodeName={host} NodeAddr=127.0.0.1 CPUs=2\n\
             PartitionName=test Nodes={host} Default=YES\n"
        )
    }

    fn start_munge(&mut self) {
        let file = |name: &str| self.home.join(name).display().to_string();
        let (key, socket) = (file("munge.key"), file("munge.socket"));
        self.run("mungekey", &["--create", "--keyfile", &key]);
        let options = [
            "--foreground",
            // The folder is private, but so is the cluster.
            "--force",
            &format!("--key-file={key}"),
            &format!("--socket={socket}"),
            &format!("--pid-file={}", file("munged.pid")),
            &format!("--seed-file={}", file("munge.seed")),
        ];
        self.start_daemon("munged", &options);
        self.wait_for("munge", || Path::new(&socket).exists());
    }

    fn start_daemon(&mut self, program: &str, arguments: &[&str]) {
        let log = File::create(self.home.join(format!("{program}.log"))).unwrap();
        let mut command = self.command(program);
        command.args(arguments).stdout(Stdio::null()).stderr(log);
        self.daemons.push(command.spawn().unwrap());
    }

    /// Ends with the test, even if that is killed.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new("setpriv");
        command
            .args(["--pdeathsig", "TERM", program])
            .env("PATH", path())
            .env("SLURM_CONF", self.home.join("slurm.conf"));
        command
    }

    /// What it says once it is done.
    fn run(&self, program: &str, arguments: &[&str]) -> String {
        let output = self.command(program).args(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success(),
            "{program} {arguments:?}: {errors}\n{}",
            self.logs()
        );
        String::from_utf8(output.stdout).unwrap()
    }

    /// Does as the script says. Returns the numbers of the array and of the job that adds up.
    fn submit(&self, script: &Path) -> [String; 2] {
        let text = fs::read_to_string(script).unwrap();
        let told = text.lines().filter_map(|line| line.strip_prefix("#   "));
        let commands: Vec<&str> = told.chain(["echo $job"]).collect();
        let output = (self.command("bash").args(["-euc", &commands.join("\n")]))
            .current_dir(script.parent().unwrap())
            .env("HOST_SIM", HOST_SIM)
            .output()
            .unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        let words: Vec<&str> = said.split_whitespace().collect();
        let ["Submitted", "batch", "job", sum, array] = words[..] else {
            panic!("{said}{}", String::from_utf8_lossy(&output.stderr));
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
                "waited in vain for {what}\n{}",
                self.logs()
            );
            sleep(Duration::from_millis(20));
        }
    }

    fn logs(&self) -> String {
        let files = ["munged.log", "slurmctld.log", "slurmd.log"];
        let logs = files.map(|file| fs::read_to_string(self.home.join(file)).unwrap_or_default());
        logs.concat()
    }
}

/// Daemons are where a user need not have them in the path.
fn path() -> String {
    env::var("PATH").unwrap_or_default() + ":/usr/sbin"
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // A job that runs outlives the daemons.
        let _ = self.command("scancel").arg("--partition=test").status();
        let mut left = self.command("squeue");
        left.arg("--noheader");
        let start = Instant::now();
        while (left.output()).is_ok_and(|left| !left.stdout.is_empty())
            && start.elapsed() < Duration::from_secs(20)
        {
            sleep(Duration::from_millis(100));
        }
        for daemon in self.daemons.iter_mut().rev() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

fn host_sim(home: &Path, arguments: &[&str]) -> bool {
    let mut command = Command::new(HOST_SIM);
    command.current_dir(home).args(arguments);
    let output = command.output().unwrap();
    output.status.success()
}

/// Of all files of runs.
fn sorted_runs(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let runs = files.filter(|file| file.extension().is_some_and(|end| end == "jsonl"));
    let text: String = runs.map(|file| fs::read_to_string(file).unwrap()).collect();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

#[test]
fn a_shard_that_is_stopped_and_runs_again_leaves_no_trace() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    fs::write(home.join("plan.toml"), PLAN).unwrap();
    let campaign = ["campaign", "plan.toml", "--out"];
    assert!(host_sim(home, &[&campaign[..], &["one"]].concat()));
    assert!(host_sim(
        home,
        &[&campaign[..], &["array", "--slurm", "2"]].concat()
    ));

    let cluster = Cluster::start(home.join("slurm"));
    let [array, sum] = cluster.submit(&home.join("array/campaign.sbatch"));
    let [stopped, other, sum] =
        [(&array, 1), (&array, 2), (&sum, 0)].map(|(job, task)| format!("{job}_{task}"));
    let runs = || fs::read_to_string(home.join("array/runs-1-of-2.jsonl")).unwrap_or_default();
    cluster.wait_for("a flight", || runs().matches('\n').count() > 1);
    cluster.run("scontrol", &["requeuehold", &stopped]);
    cluster.wait_for_state(&stopped, "PENDING");
    let before = runs();
    let before = &before[..=before.rfind('\n').unwrap()];
    assert!(
        before.lines().count() < RUNS_OF_A_UNIT,
        "too late for this test"
    );

    // With one shard done and one not, Slurm does not add up, and could not.
    cluster.wait_for_state(&other, "COMPLETED");
    assert_eq!(cluster.field(&sum, "State"), "PENDING");
    assert!(!host_sim(home, &["merge", "array"]));

    // Not minutes later, as Slurm would.
    let job = format!("JobId={stopped}");
    cluster.run("scontrol", &["update", &job, "StartTime=now"]);
    cluster.run("scontrol", &["release", &stopped]);
    cluster.wait_for_state(&sum, "COMPLETED");
    assert_eq!(cluster.field(&stopped, "RestartCnt"), "1");
    assert!(runs().starts_with(before), "what was done is done again");

    let [one, array] = ["one", "array"].map(|folder| home.join(folder));
    assert_eq!(sorted_runs(&one).len(), 2 * RUNS_OF_A_UNIT);
    assert_eq!(sorted_runs(&array), sorted_runs(&one));
    for file in ["plan.toml", "campaign.json"] {
        let [array, one] = [&array, &one].map(|folder| fs::read(folder.join(file)).unwrap());
        assert!(array == one, "{file} differs");
    }
}

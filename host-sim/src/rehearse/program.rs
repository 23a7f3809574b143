//! Any program as the algorithm under test, through lines on its standard input and output, as
//! specified in docs/rehearse.md.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read};
#[cfg(unix)]
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::str::FromStr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::Geodetic;
use ins_core::increments::{Increments, Interval};
use ins_core::{GnssFix, ImuSample, Solution, Time};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::flight::{
    Answers, Apriori, Failure, Fault, FlightData, START_LEVEL_DEG, START_POSITION_M,
    START_VELOCITY_MPS,
};
use crate::compare::kalman::Noise;
use crate::compare::kalman::noise::total;
use crate::hil::board::writer_thread;
use crate::identify::run::Event;

const VERSION: u32 = 1;
/// Time for the first line, in limits: interpreters and libraries are slow to load.
const START_LIMITS: u32 = 30;
/// Time after which a late answer is no longer waited for, in limits.
const LATE_LIMITS: u32 = 3;
/// Longer lines are cut, and are no answers.
const LONGEST_LINE: usize = 4096;
/// Capacity of the queue of lines read.
const LINES_AHEAD: usize = 64;
/// Time for a program that closed its output to end.
const EXIT_LIMIT: Duration = Duration::from_secs(1);

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Name in tables.
    pub name: String,
    pub command: Vec<String>,
}

impl FromStr for Program {
    type Err = String;

    /// `NAME=COMMAND`, or a command, named by its program. Quotes as in a shell.
    fn from_str(text: &str) -> Result<Self, String> {
        let in_names = |c: char| c.is_alphanumeric() || "-_".contains(c);
        let named = text.split_once('=');
        let named = named.filter(|(name, _)| name.chars().all(in_names));
        let (name, command) = named.unwrap_or(("", text));
        let command = shlex::split(command).ok_or("a quote is not closed")?;
        let program =
            (command.first().filter(|program| !program.is_empty())).ok_or("no program is named")?;
        let name = match Path::new(program).file_stem() {
            _ if !name.is_empty() => name.to_owned(),
            Some(stem) => stem.to_string_lossy().into_owned(),
            None => program.clone(),
        };
        Ok(Self { name, command })
    }
}

impl Program {
    /// Runs it over a flight, which ends whatever the program does.
    pub fn fly(&self, flown: &FlightData, apriori: &Apriori) -> Answers {
        let mut took = Duration::ZERO;
        let solutions = Session::begin(self, flown, apriori)
            .and_then(|session| session.fly(flown, apriori, &mut took));
        Answers { solutions, took }
    }
}

/// Process numbers of the programs that run.
static RUNNING: Mutex<Vec<u32>> = Mutex::new(Vec::new());

fn running() -> MutexGuard<'static, Vec<u32>> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Kills all programs that run, when this process is about to end: one in an endless computation would
/// not notice that its input is closed.
pub fn kill_all() {
    let running = running();
    running.iter().copied().for_each(kill_group);
    // The lock stays held: no other program is started.
    std::mem::forget(running);
}

/// Kills a program with all that it has started.
fn kill_group(number: u32) {
    #[cfg(unix)]
    if let Some(group) = i32::try_from(number)
        .ok()
        .and_then(rustix::process::Pid::from_raw)
    {
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
    #[cfg(not(unix))]
    let _ = number;
}

/// A program that runs. It is killed on drop with all that it has started: it may be a script.
struct Session {
    child: Child,
    errors: StderrTail,
    requests: Sender<String>,
    lines: Receiver<String>,
    limit: Duration,
    /// All answers come after the end: the program processes the flight as a whole (a smoother).
    after: bool,
    now_s: f64,
}

impl Drop for Session {
    fn drop(&mut self) {
        let number = self.child.id();
        let mut running = running();
        running.retain(|other| *other != number);
        kill_group(number);
        drop(running);
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn unusable(cause: impl Into<String>) -> Failure {
    Failure::new(Fault::Unusable, 0.0, cause)
}

impl Session {
    fn begin(program: &Program, flown: &FlightData, apriori: &Apriori) -> Result<Self, Failure> {
        let mut command = Command::new(&program.command[0]);
        command
            .args(&program.command[1..])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        #[cfg(unix)]
        command.process_group(0);
        let mut running = running();
        let mut child = command
            .spawn()
            .map_err(|error| unusable(format!("{} cannot be run: {error}", program.command[0])))?;
        running.push(child.id());
        drop(running);
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(stdin), Some(stdout), Some(stderr)) = pipes else {
            return Err(unusable("no pipes"));
        };
        let mut session = Self {
            child,
            errors: StderrTail::read_from(stderr),
            requests: writer_thread(stdin),
            lines: read_from(stdout),
            limit: apriori.limit,
            after: false,
            now_s: 0.0,
        };
        session.send(preamble(flown, apriori));
        let limit = START_LIMITS * apriori.limit;
        let line = session.line(limit, LATE_LIMITS * limit)?;
        session.after = match *line.split(',').collect::<Vec<_>>() {
            ["ready", "1"] => false,
            ["ready", "1", "after"] => true,
            _ => {
                return Err(unusable(format!(
                    "answered `{}`: expected `ready,{VERSION}` or `ready,{VERSION},after`",
                    shown(&line)
                )));
            }
        };
        Ok(session)
    }

    fn fly(
        mut self,
        flown: &FlightData,
        apriori: &Apriori,
        took: &mut Duration,
    ) -> Result<Vec<Option<Solution>>, Failure> {
        let mut increments = None;
        let mut asks = flown.asks().iter().peekable();
        let mut asked = Vec::with_capacity(asks.len());
        let mut solutions = Vec::with_capacity(asks.len());
        let mut text = String::new();
        let begin = Instant::now();
        for event in flown.events() {
            let sample = match event {
                Event::Imu(sample) => sample,
                Event::Gnss(fix) => {
                    write_fix(&mut text, fix);
                    continue;
                }
            };
            let (last, increments) = increments.get_or_insert_with(|| {
                let increments = Increments::new(apriori.model.imu.output, &sample);
                (flown.start.time, increments)
            });
            let seconds = sample.time.seconds_since(*last);
            if seconds > 0.0 {
                write_sample(&mut text, &sample, &increments.interval(&sample, seconds));
                *last = sample.time;
            }
            // Several where samples were lost for long.
            while asks.next_if(|ask| ask.time <= sample.time).is_some() {
                asked.push(sample.time);
                self.now_s = sample.time.as_seconds();
                // Writing into a string cannot fail.
                let _ = writeln!(text, "ask,{}", self.now_s);
                self.send(core::mem::take(&mut text));
                if !self.after {
                    let start = Instant::now();
                    let longest = LATE_LIMITS * self.limit;
                    solutions.push(self.answer(sample.time, self.limit, longest)?);
                    *took += start.elapsed();
                }
            }
        }
        self.send("end\n".to_owned());
        if self.after {
            // Here the limits of all answers apply to all of them together, without an extra time for
            // late ones: they may be an hour already.
            let count = u32::try_from(asked.len()).unwrap_or(u32::MAX);
            let end = begin + count * self.limit;
            for time in asked {
                self.now_s = time.as_seconds();
                let left = end.saturating_duration_since(Instant::now());
                solutions.push(self.answer(time, left, left)?);
            }
            *took = begin.elapsed();
        }
        Ok(solutions)
    }

    fn send(&self, text: String) {
        // A program that has stopped reading is noticed by its missing answers.
        let _ = self.requests.send(text);
    }

    fn failure(&self, fault: Fault, cause: String) -> Failure {
        Failure::new(fault, self.now_s, cause)
    }

    /// The next line of the program, if it comes within `limit`; a late one is waited for up to `longest`.
    fn line(&mut self, limit: Duration, longest: Duration) -> Result<String, Failure> {
        let start = Instant::now();
        let answer = self.lines.recv_timeout(longest);
        // Its output may be held open by a child that still runs.
        if answer.is_err() && matches!(self.child.try_wait(), Ok(Some(_))) {
            return Err(self.ended());
        }
        let late = |fault, what: &str, waited: Duration| {
            let [waited, limit] = [waited, limit].map(|time| time.as_secs_f64());
            let cause = format!("{what} {waited:.2} s, the limit is {limit:.2} s");
            self.failure(fault, cause)
        };
        match answer {
            Ok(line) if start.elapsed() <= limit => Ok(line),
            Ok(_) => Err(late(Fault::Late, "answered after", start.elapsed())),
            Err(RecvTimeoutError::Timeout) => Err(late(Fault::Hung, "no answer in", longest)),
            Err(RecvTimeoutError::Disconnected) => Err(self.ended()),
        }
    }

    /// Its output is closed.
    fn ended(&mut self) -> Failure {
        let start = Instant::now();
        let status = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break Some(status),
                Ok(None) if start.elapsed() < EXIT_LIMIT => {
                    thread::sleep(Duration::from_millis(5));
                }
                _ => break None,
            }
        };
        let how = status.map_or_else(
            || "closed its output and goes on".to_owned(),
            |status| format!("ended: {status}"),
        );
        let said = self.errors.last_line();
        self.failure(
            Fault::Crashed,
            if said.is_empty() {
                how
            } else {
                format!("{how}: {said}")
            },
        )
    }

    fn answer(
        &mut self,
        asked: Time,
        limit: Duration,
        longest: Duration,
    ) -> Result<Option<Solution>, Failure> {
        let line = self.line(limit, longest)?;
        parse(&line, asked).map_err(|expected| {
            let cause = format!("answered `{}`: {expected}", shown(&line));
            self.failure(Fault::Wrong, cause)
        })
    }
}

/// The last output of a program on standard error, read on a thread of its own. The rest is not kept: an
/// endless one must not fill a disk.
struct StderrTail {
    last: Arc<Mutex<Vec<u8>>>,
    /// Nothing is sent; it is closed when all is read.
    all: Receiver<()>,
}

impl StderrTail {
    fn read_from(mut stderr: ChildStderr) -> Self {
        let last = Arc::<Mutex<Vec<u8>>>::default();
        let (reading, all) = channel();
        let kept = Arc::clone(&last);
        thread::spawn(move || {
            let _reading = reading;
            let mut bytes = [0; LONGEST_LINE];
            while let Ok(length @ 1..) = stderr.read(&mut bytes) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&bytes[..length]);
                let surplus = kept.len().saturating_sub(LONGEST_LINE);
                kept.drain(..surplus);
            }
        });
        Self { last, all }
    }

    /// The last line that is not empty, once the program has ended.
    fn last_line(&self) -> String {
        let _ = self.all.recv_timeout(EXIT_LIMIT);
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&last);
        let line = text.lines().rfind(|line| !line.trim().is_empty());
        printable(line.unwrap_or_default())
    }
}

/// Reads lines on a thread of its own: a program that does not write must not block.
fn read_from(stdout: ChildStdout) -> Receiver<String> {
    let (sender, lines) = sync_channel(LINES_AHEAD);
    thread::spawn(move || {
        let mut reader = BufReader::new(stdout);
        loop {
            let mut line = Vec::new();
            let length = reader
                .by_ref()
                .take(LONGEST_LINE as u64)
                .read_until(b'\n', &mut line);
            if !length.is_ok_and(|length| length > 0) {
                return;
            }
            let text = printable(&String::from_utf8_lossy(&line));
            if sender.send(text).is_err() {
                return;
            }
        }
    });
    lines
}

/// Without control characters, which would move the cursor or change colours in a terminal.
fn printable(text: &str) -> String {
    text.trim().replace(char::is_control, " ")
}

/// The beginning of a line, for messages.
fn shown(line: &str) -> String {
    line.chars().take(80).collect()
}

// --- lines to the program ---

/// Right-forward-up to forward-right-down, east-north-up to north-east-down, and back.
fn frd_or_ned(v: &Vector3<f64>) -> [f64; 3] {
    [v.y, v.x, -v.z]
}

fn joined<const N: usize>(values: [f64; N]) -> String {
    values.map(|value| value.to_string()).join(",")
}

/// Lines sent before the flight.
fn preamble(flown: &FlightData, apriori: &Apriori) -> String {
    let noise = Noise::of_model(&apriori.model);
    let (sensors, gnss) = (&noise.sensors, &noise.gnss);
    let [least, most] = apriori.model.gnss.latency_s;
    let unit = [
        Vector3::from(sensors.gyro_noise).mean(),
        sensors.gyro_bias_radps,
        sensors.gyro_bias_walk,
        Vector3::from(sensors.accel_noise).mean(),
        sensors.accel_bias_mps2,
        sensors.accel_bias_walk,
        total(&gnss.velocity_mps),
        total(&gnss.position_m),
        total(&gnss.height_m),
        0.5 * (least + most),
    ];
    let start = &flown.start;
    let angles = start.euler();
    let known = flown.run.given_heading_rad;
    let heading = |deg: f64| known.map_or(String::new(), |_| deg.to_string());
    format!(
        "rehearse,{VERSION},{}\nunit,{}\nstart,{},{},{},{},{},{}\n",
        apriori.limit.as_secs_f64(),
        joined(unit),
        joined([
            start.time.as_seconds(),
            start.position.latitude_rad.to_degrees(),
            start.position.longitude_rad.to_degrees(),
            start.position.height_m,
        ]),
        joined(frd_or_ned(&start.velocity_enu_mps)),
        joined([angles.roll_rad.to_degrees(), angles.pitch_rad.to_degrees()]),
        heading(angles.heading_rad.to_degrees()),
        joined([START_POSITION_M, START_VELOCITY_MPS, START_LEVEL_DEG]),
        heading(noise.heading_sigma_rad.to_degrees()),
    )
}

fn write_sample(text: &mut String, sample: &ImuSample, interval: &Interval) {
    let _ = writeln!(
        text,
        "imu,{},{},{},{}",
        sample.time.as_seconds(),
        interval.seconds,
        joined(frd_or_ned(&interval.angle_rad)),
        joined(frd_or_ned(&interval.force_mps)),
    );
}

/// Fields that a fix does not have are empty.
fn write_fix(text: &mut String, fix: &GnssFix) {
    let cell = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let cells = [
        fix.position.map(|place| place.latitude_rad.to_degrees()),
        fix.position.map(|place| place.longitude_rad.to_degrees()),
        fix.height_m,
        fix.velocity_en_mps.map(|velocity| velocity.y),
        fix.velocity_en_mps.map(|velocity| velocity.x),
        fix.velocity_up_mps.map(|up| -up),
    ];
    let _ = writeln!(
        text,
        "gnss,{},{}",
        fix.time.as_seconds(),
        cells.map(cell).join(",")
    );
}

// --- lines of the program ---

/// A solution or `none`; the error says what was expected.
fn parse(line: &str, asked: Time) -> Result<Option<Solution>, String> {
    let asked_s = asked.as_seconds();
    let is_asked = |time: f64| (time - asked_s).abs() < 1e-6;
    let mut fields = line.split(',');
    let kind = fields.next().unwrap_or_default();
    let numbers: Option<Vec<f64>> = fields.map(|field| field.trim().parse().ok()).collect();
    match (kind, numbers.as_deref()) {
        ("none", Some(&[time])) if is_asked(time) => Ok(None),
        ("solution", Some(&[time, ref values @ ..])) if is_asked(time) => {
            let values: &[f64; 9] = (values.try_into()).map_err(|_| {
                format!("expected 9 numbers after the time, found {}", values.len())
            })?;
            solution(values, asked).map(Some)
        }
        ("none" | "solution", Some([time, ..])) => Err(format!(
            "expected an answer for {asked_s} s, this is for {time} s"
        )),
        _ => Err(format!(
            "expected `solution,{asked_s},` and 9 numbers, or `none,{asked_s}`"
        )),
    }
}

fn solution(values: &[f64; 9], time: Time) -> Result<Solution, String> {
    let [latitude_deg, longitude_deg, height_m, ref others @ ..] = *values;
    let [north, east, down, roll, pitch, heading] = *others;
    if let Some(value) = values.iter().find(|value| !value.is_finite()) {
        return Err(format!("expected finite numbers, found {value}"));
    }
    for (name, value, most) in [
        ("a latitude", latitude_deg, 90.0),
        ("a longitude", longitude_deg, 360.0),
        ("a pitch", pitch, 90.0),
    ] {
        if value.abs() > most {
            return Err(format!(
                "expected {name} of at most {most} deg, found {value}"
            ));
        }
    }
    Ok(Solution {
        time,
        position: Geodetic {
            latitude_rad: latitude_deg.to_radians(),
            longitude_rad: longitude_deg.to_radians(),
            height_m,
        },
        velocity_enu_mps: frd_or_ned(&Vector3::new(north, east, down)).into(),
        attitude: from_euler(&Euler {
            roll_rad: roll.to_radians(),
            pitch_rad: pitch.to_radians(),
            heading_rad: heading.to_radians(),
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_read_and_others_are_told_what_was_expected() {
        let at = Time::from_micros(2_500_000);
        assert_eq!(parse("none,2.5", at), Ok(None));
        let good = parse("solution,2.5,56,40,600,1,2,-3,4,5,6", at)
            .unwrap()
            .unwrap();
        assert_eq!(good.velocity_enu_mps, Vector3::new(2.0, 1.0, 3.0));
        assert!((good.euler().heading_rad.to_degrees() - 6.0).abs() < 1e-9);
        for (line, message) in [
            ("", "expected `solution,2.5,`"),
            (
                "solution,2.5,56,40",
                "expected 9 numbers after the time, found 2",
            ),
            (
                "solution,2.5,56,40,600,1,2,-3,4,5,north",
                "expected `solution,2.5,`",
            ),
            (
                "solution,1.5,56,40,600,1,2,-3,4,5,6",
                "expected an answer for 2.5 s, this is for 1.5 s",
            ),
            (
                "solution,2.5,56,40,NaN,1,2,-3,4,5,6",
                "expected finite numbers, found NaN",
            ),
            (
                "solution,2.5,560,40,600,1,2,-3,4,5,6",
                "expected a latitude of at most 90 deg, found 560",
            ),
        ] {
            let error = parse(line, at).unwrap_err();
            assert!(error.contains(message), "{line}: {error}");
        }
    }

    #[test]
    fn commands_have_names_and_quotes() {
        let program: Program = "my_own-1=python3 'my filter.py' --fast".parse().unwrap();
        assert_eq!(program.name, "my_own-1");
        assert_eq!(program.command, ["python3", "my filter.py", "--fast"]);
        let program: Program = "./a/filter.bin --gain=2".parse().unwrap();
        assert_eq!(program.name, "filter");
        assert_eq!("=cat".parse::<Program>().unwrap().name, "cat");
        for none in ["x='", "x=", "''"] {
            assert!(none.parse::<Program>().is_err(), "{none}");
        }
    }
}

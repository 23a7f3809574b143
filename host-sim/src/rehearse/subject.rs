//! The algorithm under test: those built in, firmware on a board, and any program.

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use ins_core::config::{Feedback, Form};
use ins_core::{Config, ConfigError, Navigator, Phase, Solution};
use ins_link::{Reply, Request};
use nalgebra::Vector3;

use super::flight::{Answers, Apriori, Failure, Fault, FlightData};
use super::program::Program;
use crate::compare::kalman::Noise;
use crate::compare::kalman::noise::config_of_model;
use crate::hil::bench;
use crate::hil::board::Target;
use crate::hil::session::{Event, HilError, Rate};
use crate::identify::configure::config_of;
use crate::sim::SimulatedDrive;
use crate::sim::noise::fnv1a;
use crate::study::estimator::{Core, Estimator, Kalman};

#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// The core, configured by the model, and by the preset of the class for the rest.
    Core(Form, Feedback),
    /// The Kalman filter that the core is compared with, configured by the model.
    Kalman,
    /// Firmware on a board, with its name in tables: the core over the link.
    Board(String, Target),
    /// Anything that speaks the protocol.
    Program(Program),
}

pub const BUILT_IN: [(&str, Subject); 4] = [
    ("core", Subject::Core(Form::Exact, Feedback::Closed)),
    (
        "core-literal",
        Subject::Core(Form::Literal, Feedback::Closed),
    ),
    ("core-open", Subject::Core(Form::Exact, Feedback::Open)),
    ("kalman", Subject::Kalman),
];

/// The command whose options specify the board.
const BOARD: &str = "hil";

impl FromStr for Subject {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, subject)) = BUILT_IN.iter().find(|(name, _)| *name == text) {
            return Ok(subject.clone());
        }
        let program: Program = text.parse()?;
        let built_in = |word: &String| BUILT_IN.iter().any(|(name, _)| name == word);
        match program.command.split_first() {
            Some((word, [])) if built_in(word) => Err(format!("{word} goes by its own name alone")),
            Some((word, options)) if word == BOARD => {
                Target::of(options).map(|target| Self::Board(program.name, target))
            }
            // Else the error would come only after the identification of all drives.
            Some((word, [])) if word == text && is_missing(word) => Err(format!(
                "expected {}, hil, or a program that is there",
                BUILT_IN.map(|(name, _)| name).join(", ")
            )),
            _ => Ok(Self::Program(program)),
        }
    }
}

/// Whether this is the name of a program that is not in `PATH`.
fn is_missing(program: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let mut folders = std::env::split_paths(&folders);
    !program.contains('/') && !folders.any(|folder| folder.join(program).is_file())
}

impl Subject {
    /// Name in tables.
    pub fn name(&self) -> String {
        match self {
            Self::Program(Program { name, .. }) | Self::Board(name, _) => name.clone(),
            _ => (BUILT_IN.iter())
                .find(|(_, subject)| subject == self)
                .map_or_else(String::new, |(name, _)| (*name).to_owned()),
        }
    }

    /// Hash of all files named in a program's command: itself, the script of an interpreter, files of
    /// options; of a board, that of its image.
    pub fn hash(&self) -> Option<u64> {
        let words: Vec<&Path> = match self {
            Self::Program(Program { command, .. }) => command.iter().map(Path::new).collect(),
            Self::Board(_, target) => target.image.as_deref().into_iter().collect(),
            Self::Core(..) | Self::Kalman => Vec::new(),
        };
        let files = words.into_iter().filter(|word| word.is_file());
        let texts: Vec<Vec<u8>> = files.filter_map(|file| fs::read(file).ok()).collect();
        (!texts.is_empty()).then(|| fnv1a(&texts.concat()))
    }

    /// Checks that the core, if used, can be configured by the model.
    pub fn check(&self, apriori: &Apriori) -> Result<(), ConfigError> {
        match self {
            Self::Program(_) => Ok(()),
            _ => Navigator::new(config(apriori, None)).map(|_| ()),
        }
    }

    pub fn fly(&self, flown: &FlightData, apriori: &Apriori) -> Result<Answers, ConfigError> {
        let one_at_a_time = || PORT.lock().unwrap_or_else(PoisonError::into_inner);
        let is_at_a_port = matches!(self, Self::Board(_, target) if target.port.is_some());
        let _port = is_at_a_port.then(one_at_a_time);
        let start = Instant::now();
        let mut config = config(apriori, flown.run.given_heading_rad);
        let solutions = match self {
            Self::Core(form, feedback) => {
                (config.form, config.feedback) = (*form, *feedback);
                Ok(run_over(Core::new(config, &flown.run)?, flown))
            }
            Self::Kalman => {
                let (SimulatedDrive { imu, gnss, .. }, up) = (&flown.run, Vector3::z());
                let noise = Noise::of_model(&apriori.model);
                Ok(run_over(Kalman::new(imu, gnss, config, noise, &up)?, flown))
            }
            Self::Board(_, target) => on_board(target, config, flown),
            Self::Program(program) => return Ok(program.fly(flown, apriori)),
        };
        Ok(Answers {
            solutions,
            took: start.elapsed(),
        })
    }
}

/// Configuration of the core by the model, and by the class for the rest.
fn config(apriori: &Apriori, heading_rad: Option<f64>) -> Config {
    let model = &apriori.model;
    // An error may be more than a turn.
    let heading_rad = heading_rad.map(|heading| heading % TAU);
    let preset = config_of(apriori.grade, model.imu.output, heading_rad);
    let mut config = config_of_model(model, preset);
    config.sensors.cross_axis = model.gyro_deg_h.misalignment_sigma;
    config
}

/// Solutions of an algorithm at the times asked.
fn run_over(mut estimator: impl Estimator, flown: &FlightData) -> Vec<Option<Solution>> {
    let mut asks = flown.asks().iter().peekable();
    let mut solutions = Vec::with_capacity(asks.len());
    while let Some(time) = estimator.step() {
        // Several where samples were lost for long.
        while asks.next_if(|ask| ask.time <= time).is_some() {
            solutions.push(estimator.solution());
        }
    }
    solutions
}

// --- on a board ---

/// There may be only one real board: one flight at a time.
static PORT: Mutex<()> = Mutex::new(());

/// Runs a board over a flight, which ends whatever the board does.
fn on_board(
    target: &Target,
    config: Config,
    flown: &FlightData,
) -> Result<Vec<Option<Solution>>, Failure> {
    let unusable = |error: HilError| Failure::new(Fault::Unusable, 0.0, error.to_string());
    let mut session = target.open().map_err(unusable)?;
    // Estimates are not used: the board need not send them.
    session.start(config, 0).map_err(unusable)?;
    let replies = RefCell::new(BoardReplies {
        asks: flown.asks(),
        ..BoardReplies::default()
    });
    let is_well = |_: &Request| replies.borrow().failure.is_none();
    let requests = flown.events().map(bench::request).take_while(is_well);
    let ended = session.stream(requests, Rate::Max, |event| {
        if let Event::Answer { request, reply, .. } = event {
            replies.borrow_mut().take(&request, reply.as_ref());
        }
    });
    replies.into_inner().finish(ended.err())
}

/// Replies of the board so far.
#[derive(Default)]
struct BoardReplies<'a> {
    /// Solutions asked for and not answered yet.
    asks: &'a [Solution],
    solutions: Vec<Option<Solution>>,
    failure: Option<Failure>,
    now_s: f64,
}

impl BoardReplies<'_> {
    fn take(&mut self, request: &Request, reply: Option<&Reply>) {
        if let Request::Imu(sample) = request {
            self.now_s = sample.time.as_seconds();
        }
        let (fault, cause) = match (request, reply) {
            (Request::Imu(_), Some(Reply::Imu(Ok(reply)))) => {
                let navigates = reply.report.phase == Phase::Navigating;
                self.record(reply.report.solution.filter(|_| navigates));
                return;
            }
            (Request::Gnss(_), Some(Reply::Gnss(Ok(_)))) => return,
            (_, None) => (Fault::Lost, "a request or its answer did not get through"),
            (_, Some(Reply::Imu(Err(_)) | Reply::Gnss(Err(_)))) => (
                Fault::Crashed,
                "it has no navigator any more: has it restarted?",
            ),
            _ => (Fault::Wrong, "an answer to something else"),
        };
        (self.failure).get_or_insert(Failure::new(fault, self.now_s, cause));
    }

    fn record(&mut self, solution: Option<Solution>) {
        while let Some((ask, later)) = self.asks.split_first()
            && ask.time.as_seconds() <= self.now_s
        {
            self.solutions.push(solution);
            self.asks = later;
        }
    }

    fn finish(self, ended: Option<HilError>) -> Result<Vec<Option<Solution>>, Failure> {
        let cut_off = |error: HilError| {
            let fault = match error {
                HilError::Silent(_) => Fault::Hung,
                _ => Fault::Crashed,
            };
            Failure::new(fault, self.now_s, error.to_string())
        };
        match ended.map(cut_off).or(self.failure) {
            Some(failure) => Err(failure),
            None => Ok(self.solutions),
        }
    }
}

//! Firmware on a board, real or emulated, as the algorithm under test.

use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use ins_core::{Config, Phase, Solution};
use ins_link::{Reply, Request};

use super::answers::{Answers, Failure, Fault};
use super::flight::Flown;
use crate::hil::bench;
use crate::hil::session::{Event, HilError, Rate};
use crate::hil::target::Target;

/// There may be only one real board: it flies one flight at a time.
static PORT: Mutex<()> = Mutex::new(());

/// Flies it; whatever the board does, the flight ends.
pub fn fly(target: &Target, config: Config, flown: &Flown) -> Answers {
    let _port =
        (target.port.is_some()).then(|| PORT.lock().unwrap_or_else(PoisonError::into_inner));
    let start = Instant::now();
    let solutions = stream(target, config, flown);
    Answers {
        solutions,
        took: start.elapsed(),
    }
}

fn stream(
    target: &Target,
    config: Config,
    flown: &Flown,
) -> Result<Vec<Option<Solution>>, Failure> {
    let unusable = |error: HilError| Failure::new(Fault::Unusable, 0.0, error.to_string());
    let mut session = target.open().map_err(unusable)?;
    // Estimates are not looked at: they need not come.
    session.start(config, 0).map_err(unusable)?;
    let heard = RefCell::new(Heard::new(flown));
    let requests = (flown.events().map(bench::request)).take_while(|_| heard.borrow().is_well());
    let ended = session.stream(requests, Rate::Max, |event| {
        if let Event::Answer { request, reply, .. } = event {
            heard.borrow_mut().take(&request, reply.as_ref());
        }
    });
    heard.into_inner().finish(ended.err())
}

/// What has come from the board.
struct Heard<'a> {
    /// Solutions asked for and not answered yet.
    asks: &'a [Solution],
    solutions: Vec<Option<Solution>>,
    failure: Option<Failure>,
    now_s: f64,
}

impl<'a> Heard<'a> {
    fn new(flown: &'a Flown) -> Self {
        Self {
            asks: flown.asks(),
            solutions: Vec::new(),
            failure: None,
            now_s: 0.0,
        }
    }

    fn is_well(&self) -> bool {
        self.failure.is_none()
    }

    fn take(&mut self, request: &Request, reply: Option<&Reply>) {
        if let Request::Imu(sample) = request {
            self.now_s = sample.time.as_seconds();
        }
        let (fault, cause) = match (request, reply) {
            (Request::Imu(_), Some(Reply::Imu(Ok(reply)))) => {
                let navigates = reply.report.phase == Phase::Navigating;
                self.note(reply.report.solution.filter(|_| navigates));
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

    fn note(&mut self, solution: Option<Solution>) {
        if let Some((ask, later)) = self.asks.split_first()
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

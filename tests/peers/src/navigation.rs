//! A published filter instead of the navigator behind the link.

use core::hint::black_box;

use ins_core::config::HeadingSource;
use ins_core::{Config, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Manoeuvre, Phase};
use ins_firmware::board::Board;
use ins_firmware::console;
use ins_firmware::service::{Navigates, Service};
use ins_link::{Answer, NotStarted, Report, StartError, Started, Timer};

use crate::filters::{AtRest, Peer};

/// Serves until the console closes.
pub fn serve<P: Peer>() -> ! {
    let Some(Board { clock, .. }) = Board::take() else {
        unreachable!()
    };
    let navigation = Navigation::<P> {
        heading_rad: 0.0,
        first: None,
        peer: None,
    };
    console::run(&mut Service::new(navigation, clock))
}

struct Navigation<P> {
    heading_rad: f64,
    first: Option<ImuSample>,
    /// None until the first fix.
    peer: Option<P>,
}

impl<P: Peer> Navigates for Navigation<P> {
    fn start(&mut self, config: Config, _estimates_every: u32) -> Result<Started, StartError> {
        if let HeadingSource::Given(heading_rad) = config.heading {
            self.heading_rad = heading_rad;
        }
        Ok(Started {
            state_bytes: size_of::<P>() as u32,
        })
    }

    fn on_imu(
        &mut self,
        sample: &ImuSample,
        timer: &impl Timer,
    ) -> Result<Answer<ImuOutcome>, NotStarted> {
        self.first.get_or_insert(*sample);
        let (mut accepted, mut ticks) = (true, 0);
        if let Some(peer) = &mut self.peer
            && let Some(sample) = black_box(P::sample(sample))
        {
            (accepted, ticks) = timer.time(|| black_box(P::on_imu)(peer, sample));
        }
        let outcome = if accepted {
            ImuOutcome::Accepted
        } else {
            ImuOutcome::NotFinite
        };
        Ok(self.answer(outcome, ticks))
    }

    fn on_gnss(
        &mut self,
        fix: &GnssFix,
        timer: &impl Timer,
    ) -> Result<Answer<GnssOutcome>, NotStarted> {
        let (mut accepted, mut ticks) = (true, 0);
        match (&mut self.peer, &self.first) {
            (Some(peer), _) => {
                if let Some(fix) = black_box(P::fix(fix)) {
                    (accepted, ticks) = timer.time(|| black_box(P::on_gnss)(peer, fix));
                }
            }
            (peer, Some(first)) => {
                *peer = AtRest::new(first, fix, self.heading_rad).and_then(|start| P::new(&start));
            }
            (None, None) => {}
        }
        let outcome = if accepted {
            GnssOutcome::Accepted
        } else {
            GnssOutcome::Outlier
        };
        Ok(self.answer(outcome, ticks))
    }
}

impl<P> Navigation<P> {
    fn answer<O>(&self, outcome: O, ticks: u32) -> Answer<O> {
        let phase = match self.peer {
            Some(_) => Phase::Navigating,
            None => Phase::Levelling,
        };
        let report = Report {
            phase,
            manoeuvre: Manoeuvre::default(),
            solution: None,
            estimates: None,
            signals: None,
            settled: None,
        };
        Answer {
            outcome,
            report,
            ticks,
        }
    }
}

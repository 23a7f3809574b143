//! Answers on the debugger's console, as the firmware's program `console` does.

use core::hint::black_box;

use ins_core::config::HeadingSource;
use ins_core::{GnssFix, GnssOutcome, ImuOutcome, ImuSample, Manoeuvre, Phase};
use ins_firmware::board::{self, Board, Clock};
use ins_link::{
    Decoder, FixReply, FromBoard, Hello, Reply, Report, Request, SampleReply, Started, Status,
};
use semihosting::io::{self, Read as _, Write as _};
use semihosting::process;

use crate::{AtRest, Peer};

const CHUNK: usize = 4096;

/// Serves until the console closes.
pub fn serve<P: Peer>() -> ! {
    let Some(Board { clock, .. }) = Board::take() else {
        unreachable!()
    };
    let service = Service::<P> {
        clock,
        heading_rad: 0.0,
        first: None,
        peer: None,
        call_stack_bytes: 0,
    };
    match service.run() {
        Ok(()) => process::exit(0),
        Err(error) => {
            semihosting::eprintln!("peer: {error:?}");
            process::exit(1)
        }
    }
}

struct Service<P> {
    clock: Clock,
    heading_rad: f64,
    first: Option<ImuSample>,
    /// None until the first fix.
    peer: Option<P>,
    call_stack_bytes: u32,
}

impl<P: Peer> Service<P> {
    fn run(mut self) -> io::Result<()> {
        let (mut requests, mut replies) = (io::stdin()?, io::stdout()?);
        let (mut decoder, mut sequence) = (Decoder::new(), 0);
        let mut bytes = [0; CHUNK];
        loop {
            let length = requests.read(&mut bytes)?;
            if length == 0 {
                return Ok(());
            }
            for byte in bytes.iter().take(length) {
                let Some((to, request)) = decoder.push(*byte) else {
                    continue;
                };
                let reply = self.answer(&request);
                let message = FromBoard::Reply { to, reply };
                if let Ok(frame) = ins_link::encode(sequence, &message) {
                    replies.write_all(&frame)?;
                }
                sequence += 1;
            }
        }
    }

    fn answer(&mut self, request: &Request) -> Reply {
        match request {
            Request::Hello { session } => Reply::Hello(Hello {
                session: *session,
                window_bytes: board::QUEUE_BYTES as u32,
                clocks_per_tick: board::CLOCKS_PER_TICK,
            }),
            Request::Start { config, .. } => {
                if let HeadingSource::Given(heading_rad) = config.heading {
                    self.heading_rad = heading_rad;
                }
                Reply::Start(Ok(Started {
                    state_bytes: size_of::<P>() as u32,
                }))
            }
            Request::Imu(sample) => self.on_imu(sample),
            Request::Gnss(fix) => self.on_gnss(fix),
            Request::Status => Reply::Status(Status {
                stack_bytes: board::take_deepest_stack_bytes(),
                call_stack_bytes: self.call_stack_bytes,
                ..Status::default()
            }),
        }
    }

    fn on_imu(&mut self, sample: &ImuSample) -> Reply {
        self.first.get_or_insert(*sample);
        let (mut taken, mut ticks) = (true, 0);
        if let Some(peer) = &mut self.peer
            && let Some(sample) = black_box(P::sample(sample))
        {
            let call = || self.clock.time(|| black_box(P::on_imu)(peer, sample));
            let timed = board::stack_of_call(call);
            (taken, ticks) = timed.0;
            self.call_stack_bytes = self.call_stack_bytes.max(timed.1);
        }
        Reply::Imu(Ok(SampleReply {
            outcome: if taken {
                ImuOutcome::Accepted
            } else {
                ImuOutcome::NotFinite
            },
            report: self.report(),
            ticks,
        }))
    }

    fn on_gnss(&mut self, fix: &GnssFix) -> Reply {
        let (mut taken, mut ticks) = (true, 0);
        match (&mut self.peer, &self.first) {
            (Some(peer), _) => {
                if let Some(fix) = black_box(P::fix(fix)) {
                    let call = || self.clock.time(|| black_box(P::on_gnss)(peer, fix));
                    let timed = board::stack_of_call(call);
                    (taken, ticks) = timed.0;
                    self.call_stack_bytes = self.call_stack_bytes.max(timed.1);
                }
            }
            (peer, Some(first)) => {
                *peer = AtRest::new(first, fix, self.heading_rad).and_then(|start| P::new(&start));
            }
            (None, None) => {}
        }
        Reply::Gnss(Ok(FixReply {
            outcome: if taken {
                GnssOutcome::Accepted
            } else {
                GnssOutcome::Outlier
            },
            report: self.report(),
            ticks,
        }))
    }

    fn report(&self) -> Report {
        Report {
            phase: if self.peer.is_some() {
                Phase::Navigating
            } else {
                Phase::Levelling
            },
            manoeuvre: Manoeuvre::default(),
            solution: None,
            estimates: None,
            signals: None,
        }
    }
}

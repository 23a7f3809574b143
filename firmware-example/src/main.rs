//! `ins-core` on a microcontroller: inertial samples and GNSS fixes come in over a UART, solutions
//! and estimates go out.
//!
//! The board is in `board/`, the navigator in `navigation.rs`; this file joins them.
#![no_std]
#![no_main]

mod board;
mod navigation;

use core::cell::Cell;

use board::{Board, Clock, Uart};
use ins_link::{Decoder, Hello, Reply, Request, Status};
use navigation::{Navigation, Timer};

/// Looks at a call from outside: what time it takes, and how much stack is in use at its beginning.
struct Gauge {
    clock: Clock,
    stack_bytes: Cell<u32>,
}

impl Timer for Gauge {
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        self.stack_bytes.set(board::stack_bytes());
        self.clock.time(work)
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    // In static memory, so that the stack holds calls only.
    let (Some(Board { mut uart, clock }), Some(navigation), Some(decoder)) = (
        Board::take(),
        cortex_m::singleton!(: Navigation = Navigation::new()),
        cortex_m::singleton!(: Decoder = Decoder::new()),
    ) else {
        unreachable!("this is the only caller")
    };
    let gauge = Gauge {
        clock,
        stack_bytes: Cell::new(0),
    };
    let mut bytes_lost = 0_u32;
    loop {
        let Some(byte) = uart.receive() else { continue };
        let Some((sequence, request)) = decoder.push(byte) else {
            continue;
        };
        bytes_lost = bytes_lost.saturating_add(uart.take_lost());
        let reply = match request {
            Request::Hello { session } => {
                bytes_lost = 0;
                Reply::Hello(Hello {
                    session,
                    window_bytes: board::QUEUE_BYTES as u32,
                    clocks_per_tick: board::CLOCKS_PER_TICK,
                })
            }
            Request::Start {
                config,
                estimates_every,
            } => Reply::Start(navigation.start(config, estimates_every)),
            Request::Imu(sample) => Reply::Imu(navigation.on_imu(&sample, &gauge)),
            Request::Gnss(fix) => Reply::Gnss(navigation.on_gnss(&fix, &gauge)),
            Request::Status => Reply::Status(Status {
                link: decoder.counters,
                bytes_lost,
                stack_bytes: board::take_deepest_stack_bytes(),
                stack_at_call_bytes: gauge.stack_bytes.get(),
            }),
        };
        send(&mut uart, sequence, &reply);
    }
}

fn send(uart: &mut Uart, sequence: u32, reply: &Reply) {
    match ins_link::encode(sequence, reply) {
        Ok(frame) => uart.send(&frame),
        Err(_) => defmt::error!("a reply is longer than a frame"),
    }
}

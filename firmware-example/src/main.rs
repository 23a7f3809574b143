//! `ins-core` on a microcontroller: inertial samples and GNSS fixes come in over a UART, solutions
//! and estimates go out.
//!
//! The board is in `board/`, the navigator in `navigation.rs`; this file joins them.
#![no_std]
#![no_main]

mod board;
mod navigation;

use board::{Board, Clock, Uart};
use ins_link::{Decoder, Hello, Reply, Request, Status};
use navigation::{Navigation, Timer};

impl Timer for Clock {
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        Self::time(self, work)
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut board) = Board::take() else { unreachable!() };
    let mut navigation = Navigation::new();
    let mut decoder = Decoder::new();
    let mut bytes_lost = 0_u32;
    loop {
        let Some(byte) = board.uart.receive() else { continue };
        let Some((sequence, request)) = decoder.push(byte) else { continue };
        bytes_lost = bytes_lost.saturating_add(board.uart.take_lost());
        let reply = match request {
            Request::Hello { session } => {
                bytes_lost = 0;
                Reply::Hello(Hello {
                    session,
                    window_bytes: board::QUEUE_BYTES as u32,
                    clocks_per_tick: board::CLOCKS_PER_TICK,
                })
            }
            Request::Start { config, estimates_every } => {
                Reply::Start(navigation.start(config, estimates_every))
            }
            Request::Imu(sample) => Reply::Imu(navigation.on_imu(&sample, &board.clock)),
            Request::Gnss(fix) => Reply::Gnss(navigation.on_gnss(&fix, &board.clock)),
            Request::Status => Reply::Status(Status {
                link: decoder.counters,
                bytes_lost,
                stack_bytes: board::deepest_stack_bytes(),
                stack_at_call_bytes: board::stack_bytes(),
            }),
        };
        send(&mut board.uart, sequence, &reply);
    }
}

fn send(uart: &mut Uart, sequence: u32, reply: &Reply) {
    match ins_link::encode(sequence, reply) {
        Ok(frame) => uart.send(&frame),
        Err(_) => defmt::error!("a reply is longer than a frame"),
    }
}

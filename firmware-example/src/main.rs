//! `ins-core` on a microcontroller: inertial samples and GNSS fixes are received over a UART, solutions and estimates
//! are sent.
//!
//! The board is in `board/`; `service.rs` and `navigation.rs` do not depend on it.
#![no_std]
#![no_main]

use ins_firmware::board::Board;
use ins_firmware::navigation::Navigation;
use ins_firmware::service::Service;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(Board { mut uart, clock }) = Board::take() else {
        unreachable!()
    };
    // In static memory instead of on the stack.
    let Some(service) = cortex_m::singleton!(: Option<Service<Navigation>> = None) else {
        unreachable!()
    };
    let service = Service::place(service, Navigation::new, clock);
    loop {
        let Some(byte) = uart.receive() else { continue };
        service.on_lost(uart.take_lost());
        service.on_byte(byte, |frame| uart.send(frame));
    }
}

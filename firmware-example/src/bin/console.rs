//! The firmware with the debugger's console as transport.
#![no_std]
#![no_main]

use ins_firmware::board::Board;
use ins_firmware::console;
use ins_firmware::navigation::Navigation;
use ins_firmware::service::Service;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(Board { clock, .. }) = Board::take() else {
        unreachable!()
    };
    let Some(service) = cortex_m::singleton!(: Option<Service<Navigation>> = None) else {
        unreachable!()
    };
    console::run(Service::place(service, Navigation::new, clock))
}

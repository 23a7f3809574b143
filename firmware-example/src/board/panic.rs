//! What happens when the program has a bug: it says so and stops, so that a watchdog bites.

use core::panic::PanicInfo;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    defmt::error!("panic: {}", defmt::Display2Format(info));
    loop {
        cortex_m::asm::bkpt();
    }
}

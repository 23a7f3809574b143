//! Panic handler: prints to the debugger and ends the program. On a vehicle reset the board instead; the host
//! detects the restart.

use core::panic::PanicInfo;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    semihosting::eprintln!("{info}");
    semihosting::process::abort()
}

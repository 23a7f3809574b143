//! What happens when the program has a bug: the debugger is told, and the program ends. On a
//! vehicle, reset the board instead; the host then sees that it has restarted.

use core::panic::PanicInfo;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    semihosting::eprintln!("{info}");
    semihosting::process::abort()
}

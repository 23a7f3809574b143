//! Board-specific code: ARM's MPS2 with image AN500 (Cortex-M7) or AN386 (Cortex-M4F), as
//! QEMU emulates it. For another board, replace these files and keep the functions.

mod clock;
mod log;
mod panic;
mod stack;
mod uart;

pub use clock::{CLOCKS_PER_TICK, Clock};
pub use log::{lines_lost as log_lines_lost, take as take_log};
pub use stack::{of_call as stack_of_call, take_deepest_bytes as take_deepest_stack_bytes};
pub use uart::{QUEUE_BYTES, Uart};

/// Peripherals of the board.
pub struct Board {
    pub uart: Uart,
    pub clock: Clock,
}

impl Board {
    /// Sets the board up; `None` the second time.
    pub fn take() -> Option<Self> {
        let mut core = cortex_m::Peripherals::take()?;
        Some(Self {
            clock: Clock::new(core.SYST, &mut core.DCB, core.DWT),
            uart: Uart::new(&mut core.NVIC)?,
        })
    }
}

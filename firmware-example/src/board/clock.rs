//! Measurement of execution time.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{DCB, DWT, SYST};

/// The emulator has no cycle counter. With `-icount shift=3` an instruction takes 8 ns of emulated time, and a system
/// tick is 40 ns: 5 instructions.
pub const CLOCKS_PER_TICK: u32 = if cfg!(feature = "cycle-counter") {
    1
} else {
    5
};

const SYST_BITS: u32 = 0x00ff_ffff;

#[derive(Debug)]
pub struct Clock;

impl Clock {
    pub fn new(mut syst: SYST, dcb: &mut DCB, mut dwt: DWT) -> Self {
        if cfg!(feature = "cycle-counter") {
            dcb.enable_trace();
            // On Cortex-M7 the unit has to be unlocked.
            DWT::unlock();
            dwt.enable_cycle_counter();
        } else {
            syst.set_clock_source(SystClkSource::Core);
            syst.set_reload(SYST_BITS);
            syst.clear_current();
            syst.enable_counter();
        }
        Self
    }

    /// Ticks of `work`; they wrap at 2^24 system ticks (0.6 s).
    pub fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        let start = now();
        let result = work();
        (result, since(start))
    }
}

#[cfg(feature = "cycle-counter")]
fn now() -> u32 {
    DWT::cycle_count()
}

#[cfg(feature = "cycle-counter")]
fn since(start: u32) -> u32 {
    now().wrapping_sub(start)
}

#[cfg(not(feature = "cycle-counter"))]
fn now() -> u32 {
    SYST::get_current()
}

// The system timer counts down.
#[cfg(not(feature = "cycle-counter"))]
fn since(start: u32) -> u32 {
    start.wrapping_sub(now()) & SYST_BITS
}

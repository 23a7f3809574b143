//! Stack usage. cortex-m-rt paints the stack at reset.
#![allow(unsafe_code, reason = "reads the stack's own memory")]

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes from the top of the stack to the deepest word written since reset or the last call. Repaints the
/// stack.
pub fn take_deepest_bytes() -> u32 {
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    let mut word = end;
    // SAFETY: every word from `end` to `start` is RAM of the stack, and reading has no effect.
    while word < start && unsafe { word.read_volatile() } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    let deepest = depth(word.addr());
    // An interrupt in between has finished with its stack when painting continues.
    let below_this_call = cortex_m::register::msp::read() as usize - OWN_FRAME_BYTES;
    while word.addr() < below_this_call {
        // SAFETY: below the stack pointer, which is unused.
        unsafe { word.cast_mut().write_volatile(STACK_PAINT_VALUE) };
        word = word.wrapping_add(1);
    }
    deepest
}

/// Makes a call and returns its stack usage in bytes, up to [`WINDOW_BYTES`]. Paints them first, which takes
/// thousands of cycles.
#[inline(never)]
pub fn of_call<T>(call: impl FnOnce() -> T) -> (T, u32) {
    let here = cortex_m::register::msp::read() as usize;
    let end = (&raw const _stack_end).addr();
    let bottom = end.max(here.saturating_sub(WINDOW_BYTES)) as *mut u32;
    let mut word = bottom;
    while word.addr() < here - OWN_FRAME_BYTES {
        // SAFETY: RAM of the stack, below the stack pointer, which is unused.
        unsafe { word.write_volatile(STACK_PAINT_VALUE) };
        word = word.wrapping_add(1);
    }
    let result = call();
    let mut word = bottom;
    // SAFETY: RAM of the stack, and reading has no effect.
    while word.addr() < here && unsafe { word.read_volatile() } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    (result, (here - word.addr()) as u32)
}

/// Deepest call that [`of_call`] can measure.
const WINDOW_BYTES: usize = 16 * 1024;
/// More than a function here may have below the stack pointer it reads.
const OWN_FRAME_BYTES: usize = 64;

fn depth(address: usize) -> u32 {
    ((&raw const _stack_start).addr() - address) as u32
}

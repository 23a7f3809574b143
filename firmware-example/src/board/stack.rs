//! How deep the stack has been. cortex-m-rt paints it at reset.
#![allow(unsafe_code, reason = "reads the stack's own memory")]

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes from the top of the stack to the deepest word written since reset.
pub fn deepest_bytes() -> u32 {
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    let mut word = end;
    // SAFETY: every word from `end` to `start` is RAM of the stack, and reading has no effect.
    while word < start && unsafe { word.read_volatile() } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    (start.addr() - word.addr()) as u32
}

/// Bytes in use by the caller.
pub fn now_bytes() -> u32 {
    (&raw const _stack_start).addr() as u32 - cortex_m::register::msp::read()
}

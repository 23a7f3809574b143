//! How deep the stack has been. cortex-m-rt paints it at reset.
#![allow(unsafe_code, reason = "reads the stack's own memory")]

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes from the top of the stack to the deepest word written since reset or since the last call,
/// which paints the stack anew.
pub fn take_deepest_bytes() -> u32 {
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    let mut word = end;
    // SAFETY: every word from `end` to `start` is RAM of the stack, and reading has no effect.
    while word < start && unsafe { word.read_volatile() } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    let deepest = depth(word.addr());
    // What an interrupt writes meanwhile it has done with when painting goes on.
    let below_this_call = cortex_m::register::msp::read() as usize - OWN_FRAME_BYTES;
    while word.addr() < below_this_call {
        // SAFETY: below the stack pointer, where nothing lives.
        unsafe { word.cast_mut().write_volatile(STACK_PAINT_VALUE) };
        word = word.wrapping_add(1);
    }
    deepest
}

/// Bytes in use by the caller.
pub fn used_bytes() -> u32 {
    depth(cortex_m::register::msp::read() as usize)
}

/// More than [`take_deepest_bytes`] itself may have below the stack pointer it reads.
const OWN_FRAME_BYTES: usize = 64;

fn depth(address: usize) -> u32 {
    ((&raw const _stack_start).addr() - address) as u32
}

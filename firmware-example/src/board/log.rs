//! Sink of defmt logs: a buffer, which is sent over the link between replies. This never halts the processor, and
//! needs no debugger.
#![allow(unsafe_code, reason = "defmt's logger")]

use core::cell::RefCell;

use critical_section::{CriticalSection, Mutex, RestoreState};
use defmt::Encoder;
use heapless::{Deque, Vec};
use ins_link::LOG_BYTES;

const BUFFER_BYTES: usize = 1024;

struct Buffer {
    encoder: Encoder,
    bytes: Deque<u8, BUFFER_BYTES>,
    /// Length of the buffer before the current line.
    before: usize,
    /// The current line does not fit.
    too_long: bool,
    lines_lost: u32,
    restore: RestoreState,
}

static BUFFER: Mutex<RefCell<Buffer>> = Mutex::new(RefCell::new(Buffer {
    encoder: Encoder::new(),
    bytes: Deque::new(),
    before: 0,
    too_long: false,
    lines_lost: 0,
    restore: RestoreState::invalid(),
}));

/// The next piece of the log, or empty.
pub fn take() -> Vec<u8, LOG_BYTES> {
    // Separate critical sections, so that received bytes are not delayed.
    let next = || critical_section::with(|cs| BUFFER.borrow_ref_mut(cs).bytes.pop_front());
    (0..LOG_BYTES).map_while(|_| next()).collect()
}

/// Lines lost because the buffer was full, since reset.
pub fn lines_lost() -> u32 {
    critical_section::with(|cs| BUFFER.borrow_ref(cs).lines_lost)
}

impl Buffer {
    /// Runs one step of the encoder.
    fn encode(&mut self, step: impl FnOnce(&mut Encoder, &mut dyn FnMut(&[u8]))) {
        let Self {
            encoder,
            bytes,
            too_long,
            ..
        } = self;
        step(encoder, &mut |encoded| {
            for byte in encoded {
                *too_long |= bytes.push_back(*byte).is_err();
            }
        });
    }

    /// Removes an incomplete line.
    fn end_line(&mut self) {
        if core::mem::take(&mut self.too_long) {
            self.bytes.truncate(self.before);
            self.lines_lost = self.lines_lost.saturating_add(1);
        }
    }
}

#[defmt::global_logger]
struct Logger;

// SAFETY: nothing else runs between `acquire`, which enters a critical section, and `release`,
// which leaves it.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: `release` follows.
        let restore = unsafe { critical_section::acquire() };
        with_buffer(|buffer| {
            buffer.restore = restore;
            buffer.before = buffer.bytes.len();
            buffer.encode(|encoder, write| encoder.start_frame(write));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        let restore = with_buffer(|buffer| {
            buffer.encode(|encoder, write| encoder.end_frame(write));
            buffer.end_line();
            buffer.restore
        });
        // SAFETY: follows `acquire`.
        unsafe { critical_section::release(restore) };
    }

    unsafe fn write(bytes: &[u8]) {
        with_buffer(|buffer| buffer.encode(|encoder, write| encoder.write(bytes, write)));
    }
}

fn with_buffer<T>(work: impl FnOnce(&mut Buffer) -> T) -> T {
    // SAFETY: called between `acquire` and `release` only.
    let cs = unsafe { CriticalSection::new() };
    work(&mut BUFFER.borrow_ref_mut(cs))
}

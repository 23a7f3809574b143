//! Where defmt logs go: into a buffer, and from there over the link between replies. That stops the
//! processor for nobody, and needs no debugger.
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
    /// Length of the buffer before the line that is being written.
    before: usize,
    /// That line does not fit.
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

/// The next piece of the log; empty if there is nothing to tell.
pub fn take() -> Vec<u8, LOG_BYTES> {
    // One by one: bytes of the link come in between.
    let next = || critical_section::with(|cs| BUFFER.borrow_ref_mut(cs).bytes.pop_front());
    (0..LOG_BYTES).map_while(|_| next()).collect()
}

/// Lines that found the buffer full, since reset.
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

    /// A line that did not fit goes as a whole.
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
        inside(|buffer| {
            buffer.restore = restore;
            buffer.before = buffer.bytes.len();
            buffer.encode(|encoder, write| encoder.start_frame(write));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        let restore = inside(|buffer| {
            buffer.encode(|encoder, write| encoder.end_frame(write));
            buffer.end_line();
            buffer.restore
        });
        // SAFETY: follows `acquire`.
        unsafe { critical_section::release(restore) };
    }

    unsafe fn write(bytes: &[u8]) {
        inside(|buffer| buffer.encode(|encoder, write| encoder.write(bytes, write)));
    }
}

fn inside<T>(work: impl FnOnce(&mut Buffer) -> T) -> T {
    // SAFETY: called between `acquire` and `release` only.
    let cs = unsafe { CriticalSection::new() };
    work(&mut BUFFER.borrow_ref_mut(cs))
}

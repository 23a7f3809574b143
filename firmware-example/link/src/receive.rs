//! Between the interrupt that receives and the loop that decodes.

use heapless::spsc::Producer;

/// Where an interrupt puts bytes; what does not fit is counted.
#[allow(missing_debug_implementations, reason = "heapless queues have none")]
pub struct Receiver<'q> {
    queue: Producer<'q, u8>,
    lost: u32,
}

impl<'q> Receiver<'q> {
    /// The sending end of `queue`.
    pub const fn new(queue: Producer<'q, u8>) -> Self {
        Self { queue, lost: 0 }
    }

    /// A byte has come.
    pub fn on_byte(&mut self, byte: u8) {
        if self.queue.enqueue(byte).is_err() {
            self.on_overrun();
        }
    }

    /// The device has lost a byte.
    pub fn on_overrun(&mut self) {
        self.lost = self.lost.saturating_add(1);
    }

    /// Bytes lost since the last call.
    pub fn take_lost(&mut self) -> u32 {
        core::mem::take(&mut self.lost)
    }
}

//! Queue between the receive interrupt and the decoding loop.

use heapless::spsc::Producer;

/// Interrupt side of the queue; bytes that do not fit are counted.
#[allow(missing_debug_implementations, reason = "heapless queues have none")]
pub struct Receiver<'q> {
    queue: Producer<'q, u8>,
    lost: u32,
}

impl<'q> Receiver<'q> {
    /// With the producer of the queue.
    pub const fn new(queue: Producer<'q, u8>) -> Self {
        Self { queue, lost: 0 }
    }

    /// A byte was received.
    pub fn on_byte(&mut self, byte: u8) {
        if self.queue.enqueue(byte).is_err() {
            self.on_overrun();
        }
    }

    /// A byte was lost by the device.
    pub fn on_overrun(&mut self) {
        self.lost = self.lost.saturating_add(1);
    }

    /// Bytes lost since the last call.
    pub fn take_lost(&mut self) -> u32 {
        core::mem::take(&mut self.lost)
    }
}

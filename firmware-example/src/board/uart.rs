//! UART 0, a CMSDK APB UART: bytes come in by interrupt through a queue, and go out by polling.
#![allow(unsafe_code, reason = "device registers and the interrupt")]

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use critical_section::Mutex;
use heapless::spsc::{Consumer, Producer, Queue};

/// Bytes that can wait for the main loop.
pub const QUEUE_BYTES: usize = 2048;

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const INTERRUPT_CLEAR: *mut u32 = 0x4000_400c as *mut u32;
const BAUD_DIVIDER: *mut u32 = 0x4000_4010 as *mut u32;

const STATE_TRANSMIT_FULL: u32 = 1 << 0;
const STATE_RECEIVE_FULL: u32 = 1 << 1;
const STATE_RECEIVE_OVERRUN: u32 = 1 << 3;
const CONTROL_TRANSMIT: u32 = 1 << 0;
const CONTROL_RECEIVE: u32 = 1 << 1;
const CONTROL_RECEIVE_INTERRUPT: u32 = 1 << 3;
const INTERRUPT_RECEIVE: u32 = 1 << 1;
/// 25 MHz / 27 = 926 kbaud: 921 600 within 0.5 %. A solution and the estimates with each of 100
/// samples a second need half of it.
const DIVIDER: u32 = 27;

static LOST: AtomicU32 = AtomicU32::new(0);
static RECEIVED: Mutex<RefCell<Option<Producer<'static, u8>>>> = Mutex::new(RefCell::new(None));

#[derive(Clone, Copy)]
struct ReceiveInterrupt;

// SAFETY: the board's interrupt 0 is UART 0's receiver.
unsafe impl InterruptNumber for ReceiveInterrupt {
    fn number(self) -> u16 {
        0
    }
}

pub struct Uart {
    received: Consumer<'static, u8>,
}

impl Uart {
    pub fn new(nvic: &mut NVIC) -> Option<Self> {
        let queue = cortex_m::singleton!(: Queue<u8, { QUEUE_BYTES + 1 }> = Queue::new())?;
        let (producer, received) = queue.split();
        critical_section::with(|cs| RECEIVED.replace(cs, Some(producer)));
        write(BAUD_DIVIDER, DIVIDER);
        write(CONTROL, CONTROL_TRANSMIT | CONTROL_RECEIVE | CONTROL_RECEIVE_INTERRUPT);
        // SAFETY: what the interrupt uses is in place.
        unsafe {
            nvic.set_priority(ReceiveInterrupt, 0);
            NVIC::unmask(ReceiveInterrupt);
        }
        Some(Self { received })
    }

    /// The next byte, or sleep until something happens.
    pub fn receive(&mut self) -> Option<u8> {
        // An interrupt between the look and the sleep still ends the sleep, as it stays pending.
        cortex_m::interrupt::free(|_| {
            if !self.received.ready() {
                cortex_m::asm::wfi();
            }
        });
        self.received.dequeue()
    }

    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            while read(STATE) & STATE_TRANSMIT_FULL != 0 {}
            write(DATA, u32::from(*byte));
        }
    }

    /// Bytes that came and found no room, since the last call.
    pub fn take_lost(&mut self) -> u32 {
        LOST.swap(0, Ordering::Relaxed)
    }
}

/// All interrupts land here, as no device crate names them; only the receiver's is enabled.
#[exception]
unsafe fn DefaultHandler(_number: i16) {
    critical_section::with(|cs| {
        let mut received = RECEIVED.borrow_ref_mut(cs);
        let state = read(STATE);
        if state & STATE_RECEIVE_OVERRUN != 0 {
            write(STATE, STATE_RECEIVE_OVERRUN);
            LOST.fetch_add(1, Ordering::Relaxed);
        }
        write(INTERRUPT_CLEAR, INTERRUPT_RECEIVE);
        if state & STATE_RECEIVE_FULL != 0 {
            let byte = (read(DATA) & 0xff) as u8;
            let kept = received.as_mut().is_some_and(|queue| queue.enqueue(byte).is_ok());
            LOST.fetch_add(u32::from(!kept), Ordering::Relaxed);
        }
    });
}

fn read(register: *mut u32) -> u32 {
    // SAFETY: only this file's register addresses come here; reading them is always allowed.
    unsafe { register.read_volatile() }
}

fn write(register: *mut u32, value: u32) {
    // SAFETY: only this file's register addresses come here.
    unsafe { register.write_volatile(value) }
}

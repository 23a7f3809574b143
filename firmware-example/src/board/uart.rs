//! UART 0, a CMSDK APB UART: reception by interrupt through a queue, transmission by polling.
#![allow(unsafe_code, reason = "device registers and the interrupt")]

use core::cell::RefCell;

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use critical_section::Mutex;
use heapless::spsc::{Consumer, Queue};
use ins_link::Receiver;

/// Capacity of the queue to the main loop.
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
/// 25 MHz / 27 = 926 kbaud: 921 600 within 0.5 %. Solution and estimates with each sample at 100 Hz need half of
/// it.
const DIVIDER: u32 = 27;

static RECEIVER: Mutex<RefCell<Option<Receiver<'static>>>> = Mutex::new(RefCell::new(None));

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
        critical_section::with(|cs| RECEIVER.replace(cs, Some(Receiver::new(producer))));
        write(BAUD_DIVIDER, DIVIDER);
        write(
            CONTROL,
            CONTROL_TRANSMIT | CONTROL_RECEIVE | CONTROL_RECEIVE_INTERRUPT,
        );
        // SAFETY: everything used by the interrupt is initialized.
        unsafe {
            nvic.set_priority(ReceiveInterrupt, 0);
            NVIC::unmask(ReceiveInterrupt);
        }
        Some(Self { received })
    }

    /// The next byte; sleeps until an interrupt if there is none.
    pub fn receive(&mut self) -> Option<u8> {
        // An interrupt between the check and the sleep stays pending, and ends the sleep.
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

    /// Bytes lost because the queue was full, since the last call.
    pub fn take_lost(&mut self) -> u32 {
        critical_section::with(|cs| {
            RECEIVER
                .borrow_ref_mut(cs)
                .as_mut()
                .map_or(0, Receiver::take_lost)
        })
    }
}

/// Handler of all interrupts, as there is no device crate; only the receiver's is enabled.
#[exception]
unsafe fn DefaultHandler(_number: i16) {
    critical_section::with(|cs| {
        let mut receiver = RECEIVER.borrow_ref_mut(cs);
        let Some(receiver) = receiver.as_mut() else {
            return;
        };
        let state = read(STATE);
        if state & STATE_RECEIVE_OVERRUN != 0 {
            write(STATE, STATE_RECEIVE_OVERRUN);
            receiver.on_overrun();
        }
        write(INTERRUPT_CLEAR, INTERRUPT_RECEIVE);
        if state & STATE_RECEIVE_FULL != 0 {
            receiver.on_byte((read(DATA) & 0xff) as u8);
        }
    });
}

fn read(register: *mut u32) -> u32 {
    // SAFETY: only called with this file's register addresses; reading them is always allowed.
    unsafe { register.read_volatile() }
}

fn write(register: *mut u32, value: u32) {
    // SAFETY: only called with this file's register addresses.
    unsafe { register.write_volatile(value) }
}

//! The firmware fed from a file instead of the UART: for the emulator, where this is much faster
//! and no interrupt falls into what is measured. `requests.bin` in QEMU's working folder comes in,
//! `replies.bin` goes out.
#![no_std]
#![no_main]

use ins_firmware::board::Board;
use ins_firmware::service::Service;
use semihosting::fs::File;
use semihosting::io::{self, Read as _, Write as _};
use semihosting::process;

/// Semihosting calls are slow, so they are few.
const CHUNK: usize = 4096;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(Board { clock, .. }) = Board::take() else {
        unreachable!()
    };
    let Some(service) = cortex_m::singleton!(: Option<Service> = None) else {
        unreachable!()
    };
    match replay(service.insert(Service::new(clock))) {
        Ok(()) => process::exit(0),
        Err(error) => {
            defmt::error!("file: {}", defmt::Debug2Format(&error));
            process::exit(1)
        }
    }
}

fn replay(service: &mut Service) -> io::Result<()> {
    let mut requests = File::open(c"requests.bin")?;
    let mut replies = File::create(c"replies.bin")?;
    let mut bytes = [0; CHUNK];
    let mut out = heapless::Vec::<u8, CHUNK>::new();
    loop {
        let length = requests.read(&mut bytes)?;
        if length == 0 {
            return replies.write_all(&out);
        }
        for byte in bytes.iter().take(length) {
            let Some(frame) = service.on_byte(*byte) else {
                continue;
            };
            if out.extend_from_slice(&frame).is_err() {
                replies.write_all(&out)?;
                out.clear();
                // An empty buffer has room for a frame.
                let _ = out.extend_from_slice(&frame);
            }
        }
    }
}

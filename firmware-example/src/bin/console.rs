//! The firmware behind the debugger's console instead of the UART: for the emulator, where this is
//! much faster and no interrupt falls into what is measured.
#![no_std]
#![no_main]

use ins_firmware::board::Board;
use ins_firmware::service::Service;
use semihosting::io::{self, Read as _, Write as _};
use semihosting::process;

/// Console calls are slow, so they are few: one takes in many requests.
const CHUNK: usize = 4096;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(Board { clock, .. }) = Board::take() else {
        unreachable!()
    };
    let Some(service) = cortex_m::singleton!(: Option<Service> = None) else {
        unreachable!()
    };
    match serve(service.insert(Service::new(clock))) {
        Ok(()) => process::exit(0),
        Err(error) => {
            semihosting::eprintln!("console: {error:?}");
            process::exit(1)
        }
    }
}

fn serve(service: &mut Service) -> io::Result<()> {
    let (mut requests, mut replies) = (io::stdin()?, io::stdout()?);
    let mut bytes = [0; CHUNK];
    loop {
        let length = requests.read(&mut bytes)?;
        if length == 0 {
            return Ok(());
        }
        for byte in bytes.iter().take(length) {
            service.on_byte(*byte, |frame| {
                if replies.write_all(frame).is_err() {
                    process::exit(1)
                }
            });
        }
    }
}

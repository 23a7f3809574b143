//! The debugger's console instead of the UART: for the emulator, where it is much faster and no interrupt disturbs
//! the measurement.

use semihosting::io::{self, Read as _, Write as _};
use semihosting::process;

use crate::service::{Navigates, Service};

/// Console calls are slow, so each reads many requests.
const CHUNK: usize = 4096;

/// Serves until the console closes.
pub fn run<N: Navigates>(service: &mut Service<N>) -> ! {
    match serve(service) {
        Ok(()) => process::exit(0),
        Err(error) => {
            semihosting::eprintln!("console: {error:?}");
            process::exit(1)
        }
    }
}

fn serve<N: Navigates>(service: &mut Service<N>) -> io::Result<()> {
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

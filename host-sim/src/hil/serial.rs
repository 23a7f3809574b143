//! A serial port.

use std::io;

use serial2::SerialPort;

use super::session::POLL;

/// Opens a port: 8 bits, no parity, one stop bit, no flow control.
pub fn open(name: &str, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(name, baud).map_err(|error| explain(name, &error))?;
    port.set_read_timeout(POLL)?;
    // What a board has sent before is to nobody.
    port.discard_buffers()?;
    Ok(port)
}

fn explain(name: &str, error: &io::Error) -> io::Error {
    let ports = SerialPort::available_ports().unwrap_or_default();
    let ports: Vec<String> = ports
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let ports = match ports.as_slice() {
        [] => "there is no serial port here".to_owned(),
        ports => format!("ports here: {}", ports.join(", ")),
    };
    io::Error::new(error.kind(), format!("{name}: {error}; {ports}"))
}

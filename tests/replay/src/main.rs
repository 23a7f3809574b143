//! Replies to requests like the firmware: frames on standard input and output.

use std::error::Error;
use std::io::{BufWriter, Read, Write, stdin, stdout};

use ins_link::{Decoder, FromBoard, Request, Responder, encode};

fn main() -> Result<(), Box<dyn Error>> {
    let mut bytes = Vec::new();
    stdin().read_to_end(&mut bytes)?;
    let mut decoder = Decoder::new();
    let mut replies = BufWriter::new(stdout().lock());
    let mut running = None;
    for (to, request) in bytes.iter().filter_map(|byte| decoder.push(*byte)) {
        if let Request::Start {
            config,
            estimates_every,
        } = request
        {
            running = Some(Responder::start(config, estimates_every)?);
            continue;
        }
        let responder = running.as_mut().ok_or("not started")?;
        let reply =
            (responder.answer(&request)).ok_or_else(|| format!("unexpected {request:?}"))?;
        let frame = encode(to, &FromBoard::Reply { to, reply }).map_err(|_| "too long")?;
        replies.write_all(&frame)?;
    }
    replies.flush()?;
    Ok(())
}

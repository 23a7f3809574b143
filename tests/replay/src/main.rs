//! Answers requests as the firmware does: frames in on the standard input, frames out.

use std::error::Error;
use std::io::{BufWriter, Read, Write, stdin, stdout};

use ins_core::Navigator;
use ins_link::{Decoder, FixReply, FromBoard, Reply, Reporter, Request, SampleReply, encode};

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
            let navigator = Navigator::new(config)?;
            running = Some((navigator, Reporter::new(estimates_every)));
            continue;
        }
        let (navigator, reporter) = running.as_mut().ok_or("not started")?;
        let reply = match request {
            Request::Imu(sample) => Reply::Imu(Ok(SampleReply {
                outcome: navigator.on_imu(&sample),
                report: reporter.after_sample(navigator),
                ticks: 0,
            })),
            Request::Gnss(fix) => Reply::Gnss(Ok(FixReply {
                outcome: navigator.on_gnss(&fix),
                report: reporter.after_fix(navigator),
                ticks: 0,
            })),
            other => return Err(format!("unexpected {other:?}").into()),
        };
        let frame = encode(to, &FromBoard::Reply { to, reply }).map_err(|_| "too long")?;
        replies.write_all(&frame)?;
    }
    replies.flush()?;
    Ok(())
}

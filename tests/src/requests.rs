//! A run as the requests that the firmware gets.

use host_sim::sim::SimulatedDrive;
use ins_link::{Decoder, Reply, Request, encode};

/// Samples and fixes in order of time, a fix after the sample of its moment.
pub fn requests(run: &SimulatedDrive) -> Vec<Request> {
    let mut fixes = run.gnss.iter().peekable();
    let mut all = Vec::with_capacity(run.imu.len() + run.gnss.len());
    for sample in &run.imu {
        while let Some(fix) = fixes.next_if(|fix| fix.time < sample.time) {
            all.push(Request::Gnss(*fix));
        }
        all.push(Request::Imu(*sample));
    }
    all.extend(fixes.copied().map(Request::Gnss));
    all
}

/// The frames of requests, numbered from 0.
///
/// # Panics
/// If a request is longer than a frame, which none is.
pub fn encode_all(requests: &[Request]) -> Vec<u8> {
    let frame = |(sequence, request)| encode(sequence, request).expect("requests are short");
    (0..).zip(requests).flat_map(frame).collect()
}

/// The replies in a stream of frames.
pub fn decode(bytes: &[u8]) -> Vec<Reply> {
    let mut decoder = Decoder::new();
    bytes
        .iter()
        .filter_map(|byte| decoder.push(*byte))
        .map(|(_, reply)| reply)
        .collect()
}

//! A run as the requests that the firmware gets.

use host_sim::sim::SimulatedDrive;
use ins_link::Request;

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

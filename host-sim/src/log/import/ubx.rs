//! u-blox UBX: NAV-PVT with the inertial sensors' ESF-RAW or ESF-MEAS.
//!
//! The two have clocks of their own. Time tags of the sensors are laid onto the time of week by the
//! order in which messages were sent: as early as the fixes that came before them allow.

use std::path::Path;

use ins_core::{GnssFix, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Recording, Stamped, bytes, from_degrees, joined, stated};
use crate::log::{BodyAxes, LogError};

/// What every frame begins with.
const MAGIC: &[u8] = &[0xb5, 0x62];

pub(super) fn recognised(_: &Path, start: &[u8]) -> bool {
    (0..1024).any(|at| start.get(at..).and_then(frame).is_some())
}

const NAV_PVT: [u8; 2] = [0x01, 0x07];
const ESF_MEAS: [u8; 2] = [0x10, 0x02];
const ESF_RAW: [u8; 2] = [0x10, 0x03];

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let bytes = bytes(path)?;
    let mut log = Ubx::default();
    for (message, payload) in frames(&bytes) {
        match message {
            NAV_PVT => log.fix(payload),
            ESF_MEAS => log.measurements(payload),
            ESF_RAW => log.raw(payload),
            _ => {}
        }
    }
    Ok(log.recording(path))
}

/// Message and payload of every frame that is whole.
fn frames(bytes: &[u8]) -> Vec<([u8; 2], &[u8])> {
    let mut frames = Vec::new();
    let mut at = 0;
    while let Some(rest) = bytes.get(at..).filter(|rest| rest.len() >= 8) {
        let frame = frame(rest);
        at += frame.map_or(1, |(_, payload)| 8 + payload.len());
        frames.extend(frame);
    }
    frames
}

/// The frame that bytes begin with. The magic alone is in one of a hundred files of other kinds.
fn frame(bytes: &[u8]) -> Option<([u8; 2], &[u8])> {
    let (head, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<4>()?;
    let length = usize::from(u16::from_le_bytes([head[2], head[3]]));
    let sums = rest.get(length..length + 2)?;
    let whole = checksum(&bytes[2..6 + length]) == sums;
    whole.then(|| ([head[0], head[1]], &rest[..length]))
}

fn checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b], byte| {
        let a: u8 = byte.wrapping_add(a);
        [a, a.wrapping_add(b)]
    })
}

/// Channels in the order of axes: identifier of the value, by which it is multiplied.
const GYROS: [u32; 3] = [14, 13, 5];
const ACCELS: [u32; 3] = [16, 17, 18];
const GYRO_RADPS: f64 = 0.017_453_292_519_943_295 / 4096.0;
const ACCEL_MPS2: f64 = 1.0 / 1024.0;
/// Units of time tags: of ESF-MEAS, and of ESF-RAW.
const MEAS_TAG_S: f64 = 1e-3;
const RAW_TAG_S: f64 = 1.0 / 25_600.0;

#[derive(Default)]
struct Ubx {
    fixes: Vec<GnssFix>,
    meas: Tags,
    raw: Tags,
}

/// A vector at the seconds of a time tag.
type Tagged = (f64, Vector3<f64>);

/// Values of the sensors by their time tags, from each start of the receiver.
#[derive(Default)]
struct Tags {
    done: Vec<Run>,
    run: Run,
    last: Option<u32>,
}

#[derive(Default)]
struct Run {
    gyro: Vec<Tagged>,
    accel: Vec<Tagged>,
    /// Parts of vectors that are not yet whole.
    parts: [Option<f64>; 6],
    turns: f64,
    /// The last fix before it, which tells nothing of its time tags.
    former: Option<Time>,
    /// Least difference from a time tag to the fix that had come before.
    behind_s: Option<f64>,
}

impl Ubx {
    fn fix(&mut self, payload: &[u8]) {
        let Some(payload) = payload.first_chunk::<84>() else {
            return;
        };
        let int = |at: usize| {
            let bytes = payload[at..].first_chunk().expect("within the payload");
            f64::from(i32::from_le_bytes(*bytes))
        };
        let (kind, fixed) = (payload[20], payload[21] & 1 == 1);
        let week_s = 1e-3 * int(0);
        // Of three dimensions, also with dead reckoning: two dimensions have no height.
        if !fixed || !matches!(kind, 3 | 4) {
            return;
        }
        let Some(time) = Time::from_seconds(week_s) else {
            return;
        };
        self.fixes.push(GnssFix {
            time,
            position: from_degrees((1e-7 * int(28), 1e-7 * int(24))),
            height_m: Some(1e-3 * int(32)),
            velocity_en_mps: Some(Vector2::new(1e-3 * int(52), 1e-3 * int(48))),
            velocity_up_mps: Some(-1e-3 * int(56)),
            sigma: stated([Some(40), Some(44), Some(68), None].map(|at| Some(1e-3 * int(at?)))),
        });
    }

    fn measurements(&mut self, payload: &[u8]) {
        let Some((head, rest)) = payload.split_first_chunk::<8>() else {
            return;
        };
        let tag = u32::from_le_bytes([head[0], head[1], head[2], head[3]]);
        let count = usize::from(head[5] >> 3);
        let last = self.fixes.last().map(|fix| fix.time);
        for value in rest.chunks_exact(4).take(count) {
            let value = u32::from_le_bytes([value[0], value[1], value[2], value[3]]);
            self.meas.take(tag, MEAS_TAG_S, value & 0x3fff_ffff, last);
        }
    }

    fn raw(&mut self, payload: &[u8]) {
        let last = self.fixes.last().map(|fix| fix.time);
        for block in payload.get(4..).unwrap_or_default().chunks_exact(8) {
            let value = u32::from_le_bytes([block[0], block[1], block[2], block[3]]);
            let tag = u32::from_le_bytes([block[4], block[5], block[6], block[7]]);
            self.raw.take(tag, RAW_TAG_S, value, last);
        }
    }

    fn recording(self, path: &Path) -> Recording {
        let mut recording = Recording::default();
        for (name, tags) in [("ESF-RAW", self.raw), ("ESF-MEAS", self.meas)] {
            let (gyro, accel) = (
                tags.stamped(|run| &run.gyro),
                tags.stamped(|run| &run.accel),
            );
            let samples = joined(&gyro, &accel, BodyAxes::Frd);
            recording.add_imu(path, name, BodyAxes::Frd, samples);
        }
        recording.add_receiver(path, "NAV-PVT", self.fixes);
        recording
    }
}

/// Further back than any block of a message, s: the receiver was started anew.
const RESTART_S: f64 = 1.0;

impl Tags {
    fn take(&mut self, tag: u32, tag_s: f64, value: u32, last_fix: Option<Time>) {
        let back = self.last.map_or(0, |last| last.saturating_sub(tag));
        self.last = Some(tag);
        // Tags of 32 bits begin anew.
        let rolled_over = back > u32::MAX / 2;
        if !rolled_over && tag_s * f64::from(back) > RESTART_S {
            self.done.push(std::mem::take(&mut self.run));
            self.run.former = last_fix;
        }
        let run = &mut self.run;
        if rolled_over {
            run.turns += f64::from(u32::MAX) + 1.0;
        }
        let time_s = tag_s * (run.turns + f64::from(tag));
        run.take(time_s, value, last_fix);
    }

    /// Runs without a fix have no place in time, unless there is nothing else.
    fn stamped(&self, of: fn(&Run) -> &[Tagged]) -> Vec<Stamped> {
        let runs = || self.done.iter().chain([&self.run]);
        let placed = runs().any(|run| run.behind_s.is_some());
        let mut all = Vec::new();
        for run in runs().filter(|run| run.behind_s.is_some() == placed) {
            let behind_s = run.behind_s.unwrap_or(0.0);
            let stamp =
                |(time_s, value): &Tagged| Some((Time::from_seconds(time_s + behind_s)?, *value));
            all.extend(of(run).iter().filter_map(stamp));
        }
        all
    }
}

impl Run {
    fn take(&mut self, time_s: f64, value: u32, last_fix: Option<Time>) {
        if let Some(fix) = last_fix.filter(|_| last_fix != self.former) {
            let behind_s = fix.as_seconds() - time_s;
            self.behind_s = Some(self.behind_s.map_or(behind_s, |least| least.max(behind_s)));
        }
        let kind = (value >> 24) & 0x3f;
        // 24 bits with a sign.
        let number = f64::from((value << 8).cast_signed() >> 8);
        let channels = GYROS.iter().chain(&ACCELS);
        let Some(channel) = channels.clone().position(|known| *known == kind) else {
            return;
        };
        let scale = if channel < 3 { GYRO_RADPS } else { ACCEL_MPS2 };
        self.parts[channel] = Some(scale * number);
        for (whole, parts) in [(&mut self.gyro, 0..3), (&mut self.accel, 3..6)] {
            if let [Some(x), Some(y), Some(z)] = self.parts[parts.clone()] {
                whole.push((time_s, Vector3::new(x, y, z)));
                self.parts[parts].fill(None);
            }
        }
    }
}

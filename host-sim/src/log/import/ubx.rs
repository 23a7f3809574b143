//! u-blox UBX: NAV-PVT with the inertial sensors' ESF-RAW or ESF-MEAS.
//!
//! Their clocks differ. The offset from time tags of the sensors to the time of week is from the order of
//! the messages: the least for which no sample precedes a fix sent before it.

use std::path::Path;

use ins_core::{GnssFix, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Recording, Stamped, bytes, fix_sigma, from_degrees, joined};
use crate::log::{BodyAxes, LogError};

/// Sync characters of a frame.
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

/// Class, ID and payload of all complete frames.
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

/// The frame at the start of bytes, with a right checksum: sync characters alone also occur in other files.
fn frame(bytes: &[u8]) -> Option<([u8; 2], &[u8])> {
    let (head, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<4>()?;
    let length = usize::from(u16::from_le_bytes([head[2], head[3]]));
    let sums = rest.get(length..length + 2)?;
    let complete = checksum(&bytes[2..6 + length]) == sums;
    complete.then(|| ([head[0], head[1]], &rest[..length]))
}

fn checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b], byte| {
        let a: u8 = byte.wrapping_add(a);
        [a, a.wrapping_add(b)]
    })
}

/// Data types of the axes x, y, z, and their scale factors.
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
    meas: Stream,
    raw: Stream,
}

/// A time tag, s, and the vector.
type Tagged = (f64, Vector3<f64>);

/// Sensor values by time tag, in a session for each start of the receiver.
#[derive(Default)]
struct Stream {
    done: Vec<Session>,
    session: Session,
    last: Option<u32>,
}

#[derive(Default)]
struct Session {
    gyro: Vec<Tagged>,
    accel: Vec<Tagged>,
    /// Components of incomplete vectors.
    parts: [Option<f64>; 6],
    rollovers: f64,
    /// The last fix before the session, which does not bound its offset.
    fix_before: Option<Time>,
    /// Offset from time tags to time of week, if there was a fix.
    offset_s: Option<f64>,
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
        // 3D, or with dead reckoning: a 2D fix has no height.
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
            sigma: fix_sigma([Some(40), Some(44), Some(68), None].map(|at| Some(1e-3 * int(at?)))),
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
                tags.stamped(|session| &session.gyro),
                tags.stamped(|session| &session.accel),
            );
            let samples = joined(&gyro, &accel, BodyAxes::Frd);
            recording.add_imu(path, name, BodyAxes::Frd, samples);
        }
        recording.add_receiver(path, "NAV-PVT", self.fixes);
        recording
    }
}

/// Least step back of time tags that is a restart of the receiver, s: blocks of a message step less.
const RESTART_S: f64 = 1.0;

impl Stream {
    fn take(&mut self, tag: u32, tag_s: f64, value: u32, last_fix: Option<Time>) {
        let back = self.last.map_or(0, |last| last.saturating_sub(tag));
        self.last = Some(tag);
        // Rollover of 32 bits.
        let rolled_over = back > u32::MAX / 2;
        if !rolled_over && tag_s * f64::from(back) > RESTART_S {
            self.done.push(std::mem::take(&mut self.session));
            self.session.fix_before = last_fix;
        }
        let session = &mut self.session;
        if rolled_over {
            session.rollovers += f64::from(u32::MAX) + 1.0;
        }
        let time_s = tag_s * (session.rollovers + f64::from(tag));
        session.take(time_s, value, last_fix);
    }

    /// Samples by time; sessions without a fix have none, and are used only if all are such.
    fn stamped(&self, of: fn(&Session) -> &[Tagged]) -> Vec<Stamped> {
        let sessions = || self.done.iter().chain([&self.session]);
        let aligned = sessions().any(|session| session.offset_s.is_some());
        let mut all = Vec::new();
        for session in sessions().filter(|session| session.offset_s.is_some() == aligned) {
            let offset_s = session.offset_s.unwrap_or(0.0);
            let stamp =
                |(time_s, value): &Tagged| Some((Time::from_seconds(time_s + offset_s)?, *value));
            all.extend(of(session).iter().filter_map(stamp));
        }
        all
    }
}

impl Session {
    fn take(&mut self, time_s: f64, value: u32, last_fix: Option<Time>) {
        if let Some(fix) = last_fix.filter(|_| last_fix != self.fix_before) {
            let offset_s = fix.as_seconds() - time_s;
            self.offset_s = Some(self.offset_s.map_or(offset_s, |least| least.max(offset_s)));
        }
        let kind = (value >> 24) & 0x3f;
        // Signed, 24 bits.
        let number = f64::from((value << 8).cast_signed() >> 8);
        let channels = GYROS.iter().chain(&ACCELS);
        let Some(channel) = channels.clone().position(|known| *known == kind) else {
            return;
        };
        let scale = if channel < 3 { GYRO_RADPS } else { ACCEL_MPS2 };
        self.parts[channel] = Some(scale * number);
        for (complete, parts) in [(&mut self.gyro, 0..3), (&mut self.accel, 3..6)] {
            if let [Some(x), Some(y), Some(z)] = self.parts[parts.clone()] {
                complete.push((time_s, Vector3::new(x, y, z)));
                self.parts[parts].fill(None);
            }
        }
    }
}

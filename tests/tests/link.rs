//! The link's decoder: every valid frame is decoded, nothing else is, and losses are counted.

use ins_core::damping::DampingSignals;
use ins_core::earth::{Geodetic, LatLon};
use ins_core::{
    Config, Estimates, FixReport, FixSigma, GnssFix, GnssOutcome, ImuSample, Solution, Time,
};
use ins_link::{
    Answer, Decoder, FromBoard, LOG_BYTES, MAX_FRAME, Receiver, Reply, Report, Request, VERSION,
    encode,
};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;

fn any_f64() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits)
}

fn any_vector() -> impl Strategy<Value = Vector3<f64>> {
    [any_f64(), any_f64(), any_f64()].prop_map(Vector3::from)
}

fn any_request() -> impl Strategy<Value = Request> {
    let time = any::<i64>().prop_map(Time::from_micros);
    let imu = (time.clone(), any_vector(), any_vector())
        .prop_map(|(time, gyro, accel)| Request::Imu(ImuSample { time, gyro, accel }));
    let gnss =
        (time, any_vector(), any_vector(), any::<bool>()).prop_map(|(time, a, b, present)| {
            Request::Gnss(GnssFix {
                time,
                position: present.then_some(LatLon {
                    latitude_rad: a.x,
                    longitude_rad: a.y,
                }),
                height_m: (!present).then_some(a.z),
                velocity_en_mps: (!present).then_some(Vector2::new(b.x, b.y)),
                velocity_up_mps: present.then_some(b.z),
                sigma: FixSigma {
                    velocity_mps: present.then_some(b.x),
                    ..FixSigma::default()
                },
            })
        });
    let start = any::<u32>().prop_map(|estimates_every| Request::Start {
        config: Config::mems(),
        estimates_every,
    });
    prop_oneof![imu, gnss, start, Just(Request::Status)]
}

fn frames(requests: &[Request]) -> Vec<Vec<u8>> {
    (0..)
        .zip(requests)
        .map(|(sequence, request)| encode(sequence, request).unwrap().to_vec())
        .collect()
}

fn feed<'b>(decoder: &mut Decoder, bytes: impl IntoIterator<Item = &'b u8>) -> Vec<(u32, Request)> {
    bytes
        .into_iter()
        .filter_map(|byte| decoder.push(*byte))
        .collect()
}

/// Bits, since NaN is not equal to itself.
fn bits(request: &Request) -> Vec<u8> {
    encode(0, request).unwrap().to_vec()
}

proptest! {
    #[test]
    fn messages_round_trip_bit_for_bit(
        requests in prop::collection::vec(any_request(), 1..20)
    ) {
        let mut decoder = Decoder::new();
        let out = feed(&mut decoder, frames(&requests).iter().flatten());
        prop_assert_eq!(out.len(), requests.len());
        for ((expected, request), (sequence, got)) in (0..).zip(&requests).zip(&out) {
            prop_assert_eq!(expected, *sequence);
            prop_assert_eq!(bits(request), bits(got));
        }
        prop_assert_eq!(decoder.counters.accepted as usize, requests.len());
    }

    #[test]
    fn noise_is_never_decoded(bytes in prop::collection::vec(any::<u8>(), 0..3000)) {
        let mut decoder = Decoder::new();
        // A 32-bit checksum accepts one of 4e9 random frames.
        prop_assert!(feed(&mut decoder, &bytes).is_empty());
        let frames = bytes.split(|byte| *byte == 0);
        // The last piece is not complete yet.
        let complete = frames.clone().count() - 1;
        let counted = decoder.counters;
        let empty = frames.take(complete).filter(|frame| frame.is_empty()).count();
        prop_assert_eq!((counted.corrupt + counted.other_version) as usize, complete - empty);
    }

    #[test]
    fn decoding_resumes_at_the_second_frame_after_noise(
        noise in prop::collection::vec(any::<u8>(), 0..2000),
        request in any_request(),
    ) {
        let mut decoder = Decoder::new();
        feed(&mut decoder, &noise);
        let first = encode(7, &request).unwrap();
        let second = encode(8, &request).unwrap();
        feed(&mut decoder, &first);
        let out = feed(&mut decoder, &second);
        prop_assert_eq!(out.len(), 1);
        prop_assert_eq!(out[0].0, 8);
    }

    #[test]
    fn a_corrupt_byte_affects_its_frame_only(
        requests in prop::collection::vec(any_request(), 3..10),
        at in any::<prop::sample::Index>(),
        flip in 1..=255_u8,
    ) {
        let mut sent = frames(&requests);
        let which = at.index(requests.len() - 1);
        let byte = at.index(sent[which].len() - 1);
        sent[which][byte] ^= flip;
        let mut decoder = Decoder::new();
        let out = feed(&mut decoder, sent.iter().flatten());
        let got: Vec<usize> = out.iter().map(|(sequence, _)| *sequence as usize).collect();
        let expected: Vec<usize> = (0..requests.len()).filter(|index| *index != which).collect();
        prop_assert_eq!(got, expected);
        prop_assert!(decoder.counters.corrupt >= 1);
        // A loss of the very first frame is not detectable.
        prop_assert_eq!(decoder.counters.skipped, u32::from(which > 0));
    }

    #[test]
    fn lost_truncated_repeated_and_late_frames_are_counted(
        requests in prop::collection::vec(any_request(), 12..13),
        lost in 1..4_usize,
        cut in any::<prop::sample::Index>(),
    ) {
        let sent = frames(&requests);
        let (early, late) = (&sent[5], &sent[6]);
        let mut wire: Vec<u8> = sent[0].clone();
        // 1 to `lost` are lost, 4 is repeated, 6 precedes 5, 7 is truncated.
        wire.extend(sent[1 + lost..5].iter().flatten());
        wire.extend(&sent[4]);
        wire.extend(late.iter().chain(early));
        wire.extend(&sent[7][..cut.index(sent[7].len() - 1)]);
        // A frame without its end corrupts the next one only.
        wire.extend(sent[8..].iter().flatten());
        let mut decoder = Decoder::new();
        let out = feed(&mut decoder, &wire);
        let got: Vec<u32> = out.iter().map(|(sequence, _)| *sequence).collect();
        prop_assert!(got.is_sorted_by(|a, b| a < b), "{:?}", got);
        prop_assert!(got.contains(&6) && !got.contains(&5) && !got.contains(&7));
        prop_assert!(got.ends_with(&[9, 10, 11]));
        // With 1 to 3 lost, 4 is still received twice.
        prop_assert_eq!(decoder.counters.out_of_order, 2);
        prop_assert_eq!(decoder.counters.accepted as usize, got.len());
        // All other frames count as skipped.
        prop_assert_eq!(decoder.counters.skipped as usize, 12 - got.len());
    }
}

#[test]
fn the_longest_messages_fit() {
    let solution = Solution {
        time: Time::from_micros(i64::MIN),
        position: Geodetic::default(),
        velocity_enu_mps: Vector3::zeros(),
        attitude: UnitQuaternion::identity(),
    };
    let signals = DampingSignals {
        time: Time::from_micros(i64::MIN),
        ..DampingSignals::default()
    };
    let reply = Reply::Imu(Ok(Answer {
        outcome: ins_core::ImuOutcome::OutOfRange,
        report: Report {
            phase: ins_core::Phase::Navigating,
            manoeuvre: ins_core::Manoeuvre::Turning,
            solution: Some(solution),
            estimates: Some(Estimates::default()),
            signals: Some(signals),
            settled: Some(FixReport {
                time: Time::from_micros(i64::MIN),
                fixes: u8::MAX,
                outcome: GnssOutcome::Outlier,
            }),
        },
        ticks: u32::MAX,
    }));
    let reply = FromBoard::Reply {
        to: u32::MAX,
        reply,
    };
    let log = FromBoard::Log([0xff; LOG_BYTES].iter().copied().collect());
    let start = Request::Start {
        config: Config::mems(),
        estimates_every: u32::MAX,
    };
    for length in [
        encode(u32::MAX, &reply).unwrap().len(),
        encode(u32::MAX, &log).unwrap().len(),
        encode(u32::MAX, &start).unwrap().len(),
    ] {
        // Reserve for later additions.
        assert!(length < MAX_FRAME * 9 / 10, "{length}");
    }
}

#[test]
fn frames_of_another_version_are_counted_separately() {
    let frame = encode(0, &Request::Status).unwrap();
    let mut content = frame[..frame.len() - 1].to_vec();
    let length = cobs::decode_in_place(&mut content).unwrap();
    content.truncate(length - 4);
    content[0] = VERSION + 1;
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&content);
    content.extend(checksum.to_le_bytes());
    let mut frame_of_other_version = cobs::encode_vec(&content);
    frame_of_other_version.push(0);
    let mut decoder = Decoder::new();
    assert!(feed(&mut decoder, &frame_of_other_version).is_empty());
    assert_eq!(decoder.counters.other_version, 1);
    assert_eq!(decoder.counters.corrupt, 0);
}

#[test]
fn a_new_session_resets_the_decoder_but_a_repeated_hello_does_not() {
    let mut decoder = Decoder::new();
    let frame = |sequence, request: &Request| encode(sequence, request).unwrap();
    let hello = |session| Request::Hello { session };
    assert_eq!(feed(&mut decoder, &frame(900, &hello(1))).len(), 1);
    assert_eq!(feed(&mut decoder, &frame(901, &Request::Status)).len(), 1);
    assert_eq!(
        feed(&mut decoder, &frame(900, &hello(1))).len(),
        0,
        "a repeated hello"
    );
    assert_eq!(feed(&mut decoder, &frame(0, &hello(2))).len(), 1);
    assert_eq!(feed(&mut decoder, &frame(1, &Request::Status)).len(), 1);
    assert_eq!(decoder.counters.accepted, 2);
    assert_eq!(decoder.counters.skipped, 0);
}

#[test]
fn queue_overflow_is_counted_and_decoding_resumes() {
    let mut queue = heapless::spsc::Queue::<u8, 257>::new();
    let (sender, mut consumer) = queue.split();
    let mut receiver = Receiver::new(sender);
    let sent = frames(&vec![Request::Status; 100]);
    let bytes: Vec<u8> = sent.iter().flatten().copied().collect();
    for byte in &bytes {
        receiver.on_byte(*byte);
    }
    let mut decoder = Decoder::new();
    let got = std::iter::from_fn(|| consumer.dequeue())
        .filter_map(|byte| decoder.push::<Request>(byte))
        .count();
    assert_eq!(receiver.take_lost() as usize, bytes.len() - 256);
    assert_eq!(receiver.take_lost(), 0);
    // The frame truncated by the full queue corrupts one more.
    for (sequence, expected) in [(100, 0), (101, 1)] {
        for byte in encode(sequence, &Request::Status).unwrap() {
            receiver.on_byte(byte);
        }
        let out = std::iter::from_fn(|| consumer.dequeue())
            .filter_map(|byte| decoder.push::<Request>(byte));
        assert_eq!(out.count(), expected);
    }
    let counters = decoder.counters;
    assert_eq!(counters.accepted as usize, got + 1);
    assert_eq!(counters.accepted + counters.skipped, 102);
    assert_eq!(counters.corrupt, 1);
}

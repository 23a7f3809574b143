//! Recorded noise of a unit at rest in place of white noise: a block bootstrap, which preserves spectrum,
//! vibration and the correlation of all six sensors.

use nalgebra::Vector3;

use super::noise::Random;
use crate::statistics::{rms, whole};

/// Readings at rest less their mean, rad/s and m/s^2, body axes right-forward-up.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedNoise {
    /// Segments at rest, sample by sample: gyros, accelerometers.
    segments: Vec<Vec<[Vector3<f64>; 2]>>,
    block: usize,
}

impl RecordedNoise {
    /// From segments at rest, of which at least one is as long as a block.
    pub fn new(mut segments: Vec<Vec<[Vector3<f64>; 2]>>, block: usize) -> Option<Self> {
        segments.retain(|segment| segment.len() >= block);
        for segment in &mut segments {
            let count = segment.len() as f64;
            let means = [0, 1].map(|kind| {
                let sum: Vector3<f64> = segment.iter().map(|reading| reading[kind]).sum();
                sum / count
            });
            for reading in segment {
                for (value, mean) in reading.iter_mut().zip(means) {
                    *value -= mean;
                }
            }
        }
        (block > 0 && !segments.is_empty()).then_some(Self { segments, block })
    }

    /// RMS of gyros and accelerometers, which identify the recording.
    pub fn rms(&self) -> [f64; 2] {
        let all = || self.segments.iter().flatten();
        [0, 1].map(|kind| rms(all().map(|reading| reading[kind].norm())))
    }
}

/// The noise of one run: blocks of the recording in a random order.
#[derive(Clone, Debug)]
pub struct Resampled {
    from: RecordedNoise,
    random: Random,
    segment: usize,
    at: usize,
    remaining: usize,
}

impl Resampled {
    pub fn new(from: &RecordedNoise, seed: u64) -> Self {
        Self {
            from: from.clone(),
            random: Random::stream(seed, "recorded noise"),
            segment: 0,
            at: 0,
            remaining: 0,
        }
    }

    /// The next reading's noise: gyros, accelerometers.
    pub fn step(&mut self) -> [Vector3<f64>; 2] {
        if self.remaining == 0 {
            self.begin_block();
        }
        let noise = self.from.segments[self.segment][self.at];
        self.at += 1;
        self.remaining -= 1;
        noise
    }

    /// Uniform over all blocks of all segments.
    fn begin_block(&mut self) {
        let block = self.from.block;
        let starts = |segment: &Vec<_>| segment.len() + 1 - block;
        let all: usize = self.from.segments.iter().map(starts).sum();
        let mut start = whole(self.random.unit() * all as f64);
        self.segment = 0;
        while start >= starts(&self.from.segments[self.segment]) {
            start -= starts(&self.from.segments[self.segment]);
            self.segment += 1;
        }
        (self.at, self.remaining) = (start, block);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square wave of ten samples keeps its period inside blocks, and its size everywhere.
    #[test]
    fn colour_and_size_stay_and_means_go() {
        let wave = |at: usize| {
            let value = if (at / 5).is_multiple_of(2) { 4.0 } else { 2.0 };
            [Vector3::repeat(value), Vector3::repeat(-value)]
        };
        let recording = RecordedNoise::new(vec![(0..200).map(wave).collect()], 50).unwrap();
        let mut noise = Resampled::new(&recording, 7);
        let drawn: Vec<[Vector3<f64>; 2]> = (0..5000).map(|_| noise.step()).collect();
        let sizes = drawn
            .iter()
            .map(|[g, a]| (g.x.abs() - 1.0).abs() + (g + a).norm());
        assert!(sizes.fold(0.0, f64::max) < 1e-12);
        let halfway: f64 = drawn.windows(6).map(|w| w[0][0].x * w[5][0].x).sum();
        assert!(halfway < -0.75 * 5000.0, "{halfway}");
        let again: Vec<_> = {
            let mut noise = Resampled::new(&recording, 7);
            (0..5000).map(|_| noise.step()).collect()
        };
        assert_eq!(drawn, again);
    }

    #[test]
    fn a_rest_shorter_than_a_block_is_none() {
        let short = vec![vec![[Vector3::zeros(); 2]; 49]];
        assert_eq!(RecordedNoise::new(short, 50), None);
    }
}

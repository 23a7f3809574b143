//! Inertial samples in order of time, of long logs in an unnamed temporary file.

use std::borrow::Cow;
use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use ins_core::{ImuSample, Time};
use nalgebra::Vector3;

/// Samples per write or read: some 20 s, less than half a megabyte.
const BLOCK: usize = 1 << 13;
/// Most samples in memory, 15 MB; more go to a file.
const IN_MEMORY: usize = 32 * BLOCK;
/// Time, gyro and accelerometer, of eight bytes.
const WORDS: usize = 7;
const BLOCK_BYTES: u64 = (BLOCK * WORDS * 8) as u64;

/// Inertial samples of a log, or a part of them.
#[derive(Clone)]
pub struct Samples {
    store: Arc<Store>,
    range: Range<usize>,
}

impl Samples {
    pub fn len(&self) -> usize {
        self.range.len()
    }

    pub fn is_empty(&self) -> bool {
        self.range.is_empty()
    }

    pub fn get(&self, index: usize) -> Option<ImuSample> {
        self.iter_range(index..self.len()).next()
    }

    pub fn first(&self) -> Option<ImuSample> {
        self.get(0)
    }

    pub fn last(&self) -> Option<ImuSample> {
        self.get(self.len().checked_sub(1)?)
    }

    pub fn iter(&self) -> impl ExactSizeIterator<Item = ImuSample> {
        self.iter_range(0..self.len())
    }

    /// Those at or after a time.
    pub fn since(&self, time: Time) -> impl Iterator<Item = ImuSample> {
        self.iter_range(self.position(time)..self.len())
    }

    /// Each with the one before it.
    pub fn pairs(&self) -> impl Iterator<Item = [ImuSample; 2]> {
        let mut last = None;
        self.iter()
            .filter_map(move |sample| Some([last.replace(sample)?, sample]))
    }

    pub fn times(&self) -> impl Iterator<Item = Time> {
        self.iter().map(|sample| sample.time)
    }

    /// Those from one time to before another.
    #[must_use]
    pub fn between(&self, from: Time, to: Time) -> Self {
        let from = self.position(from);
        let to = self.position(to).max(from);
        Self {
            store: Arc::clone(&self.store),
            range: self.range.start + from..self.range.start + to,
        }
    }

    pub(super) fn filtered(&self, mut keep: impl FnMut(&ImuSample) -> bool) -> io::Result<Self> {
        Store::of(self.iter().filter(|sample| keep(sample))).map(Self::from)
    }

    /// Index of the first at or after a time.
    fn position(&self, time: Time) -> usize {
        self.store
            .position(time)
            .clamp(self.range.start, self.range.end)
            - self.range.start
    }

    fn iter_range(&self, range: Range<usize>) -> impl ExactSizeIterator<Item = ImuSample> {
        let from = self.range.start;
        self.store.iter_range(from + range.start..from + range.end)
    }

    /// All in memory, for random access.
    pub fn all(&self) -> Cow<'_, [ImuSample]> {
        match self.store.spilled {
            None => Cow::Borrowed(&self.store.tail[self.range.clone()]),
            Some(_) => self.iter().collect(),
        }
    }
}

impl From<Vec<ImuSample>> for Samples {
    fn from(samples: Vec<ImuSample>) -> Self {
        Self::from(Store {
            spilled: None,
            tail: samples,
        })
    }
}

impl From<Store> for Samples {
    fn from(store: Store) -> Self {
        Self {
            range: 0..store.len(),
            store: Arc::new(store),
        }
    }
}

impl PartialEq for Samples {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().eq(other.iter())
    }
}

impl fmt::Debug for Samples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// Storage that samples are appended to.
#[derive(Debug, Default)]
pub(super) struct Store {
    spilled: Option<Spilled>,
    /// Samples not, or not yet, in the file.
    tail: Vec<ImuSample>,
}

/// Whole blocks in a file that is deleted when it is dropped.
#[derive(Debug)]
struct Spilled {
    file: Mutex<File>,
    /// Time of the first sample of each block.
    starts: Vec<Time>,
}

impl Store {
    pub(super) fn of(samples: impl Iterator<Item = ImuSample>) -> io::Result<Self> {
        let mut store = Self::default();
        for sample in samples {
            store.push(sample)?;
        }
        Ok(store)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = ImuSample> {
        self.iter_range(0..self.len())
    }

    fn iter_range(&self, range: Range<usize>) -> impl ExactSizeIterator<Item = ImuSample> {
        let (mut start, mut block) = (0, Cow::Borrowed(&[][..]));
        range.map(move |index| {
            if index >= start + block.len() {
                (start, block) = self.block_of(index);
            }
            block[index - start]
        })
    }

    fn len(&self) -> usize {
        self.in_file() + self.tail.len()
    }

    fn in_file(&self) -> usize {
        self.spilled.as_ref().map_or(0, |file| file.starts.len()) * BLOCK
    }

    pub(super) fn push(&mut self, sample: ImuSample) -> io::Result<()> {
        self.tail.push(sample);
        match self.spilled {
            None if self.tail.len() == IN_MEMORY => self.spill(),
            Some(_) if self.tail.len() == BLOCK => self.spill(),
            _ => Ok(()),
        }
    }

    fn spill(&mut self) -> io::Result<()> {
        let spilled = match &mut self.spilled {
            Some(spilled) => spilled,
            None => self.spilled.insert(Spilled {
                file: Mutex::new(tempfile::tempfile()?),
                starts: Vec::new(),
            }),
        };
        for block in self.tail.chunks(BLOCK) {
            spilled.write(block)?;
        }
        self.tail.clear();
        self.tail.shrink_to(BLOCK);
        Ok(())
    }

    /// The block with a sample, and the index of its first sample.
    fn block_of(&self, index: usize) -> (usize, Cow<'_, [ImuSample]>) {
        match &self.spilled {
            Some(spilled) if index < self.in_file() => {
                let block = index / BLOCK;
                (block * BLOCK, Cow::Owned(spilled.read(block)))
            }
            _ => (self.in_file(), Cow::Borrowed(&self.tail)),
        }
    }

    /// Index of the first sample at or after a time.
    fn position(&self, time: Time) -> usize {
        let in_file = self.spilled.iter().flat_map(|file| &file.starts);
        let starts = in_file.chain(self.tail.first().map(|sample| &sample.time));
        let started = starts.take_while(|start| **start < time).count();
        // It is in the last block that starts before the time, or is the first of the next.
        let (from, block) = self.block_of((started * BLOCK).saturating_sub(1));
        from + block.partition_point(|sample| sample.time < time)
    }
}

impl Spilled {
    fn write(&mut self, block: &[ImuSample]) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(block.len() * WORDS * 8);
        for sample in block {
            bytes.extend(sample.time.as_micros().to_le_bytes());
            for value in sample.gyro.iter().chain(&sample.accel) {
                bytes.extend(value.to_le_bytes());
            }
        }
        self.starts.extend(block.first().map(|sample| sample.time));
        let file = self.file.get_mut().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&bytes)
    }

    fn read(&self, block: usize) -> Vec<ImuSample> {
        let mut bytes = vec![0; BLOCK * WORDS * 8];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file
            .seek(SeekFrom::Start(block as u64 * BLOCK_BYTES))
            .and_then(|_| file.read_exact(&mut bytes));
        if let Err(error) = read {
            // Written by this program: the disk itself is failing.
            panic!("samples cannot be read back from the temporary folder: {error}");
        }
        drop(file);
        let words = bytes.as_chunks::<8>().0;
        let sample = |words: &[[u8; 8]; WORDS]| {
            let [time, gx, gy, gz, ax, ay, az] = *words;
            let vector = |x: [u8; 8], y, z| Vector3::new(x, y, z).map(f64::from_le_bytes);
            ImuSample {
                time: Time::from_micros(i64::from_le_bytes(time)),
                gyro: vector(gx, gy, gz),
                accel: vector(ax, ay, az),
            }
        };
        words.as_chunks::<WORDS>().0.iter().map(sample).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(index: usize) -> ImuSample {
        let value = index as f64;
        ImuSample {
            time: Time::from_micros(10 * i64::try_from(index).unwrap()),
            gyro: Vector3::new(value, -value, 0.1 * value),
            accel: Vector3::new(f64::MIN_POSITIVE, value.sqrt(), -0.0),
        }
    }

    fn spilled(count: usize) -> Samples {
        let mut store = Store::default();
        for index in 0..count {
            store.push(sample(index)).unwrap();
        }
        assert!(store.spilled.is_some() && store.tail.len() < BLOCK);
        store.into()
    }

    #[test]
    fn samples_from_file_equal_those_in_memory() {
        for count in [IN_MEMORY, IN_MEMORY + 3 * BLOCK + 7] {
            let all: Vec<_> = (0..count).map(sample).collect();
            let (file, memory) = (spilled(count), Samples::from(all));
            assert_eq!(file.len(), count);
            assert!(file == memory);
            let bits = |s: &ImuSample| s.accel.z.to_bits();
            assert!(file.iter().all(|s| bits(&s) == (-0.0_f64).to_bits()));
            assert_eq!(file.last(), memory.last());
            let block = i64::try_from(10 * BLOCK).unwrap();
            let ends = [block - 10, block - 5, block, block + 1];
            for micros in [-1, 0, 5, 40 * block, 1 << 50].into_iter().chain(ends) {
                let time = Time::from_micros(micros);
                assert!(file.since(time).eq(memory.since(time)), "{micros}");
                let (part, other) = [&file, &memory]
                    .map(|s| s.between(Time::from_micros(1000), time))
                    .into();
                assert!(part == other, "{micros}");
                let (part, other) = [&part, &other]
                    .map(|s| s.since(Time::from_micros(2000)))
                    .into();
                assert!(part.eq(other), "{micros}");
            }
        }
    }
}

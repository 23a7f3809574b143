//! Finished runs: a line each, in a file that only grows.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use miette::{Diagnostic, Result, bail};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::identify::held_ins::LevelError;
use crate::page::output::{OutputError, check_free, replace};
use crate::study::flights::run::Left;

/// Moments of the free part that are looked at, in quarters of it.
pub(super) const QUARTERS: u32 = 4;

/// One finished run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "run", rename_all = "lowercase")]
pub enum Line {
    /// A unit was identified.
    Model {
        /// Which.
        unit: u32,
        /// The model as TOML: its numbers come back bit for bit.
        model: String,
    },
    /// A flight was flown.
    Flight {
        /// Whose.
        unit: u32,
        /// With which of its models.
        with: With,
        /// Which.
        flight: u32,
        /// What came out; none if it could not be flown.
        flown: Option<Flown>,
        /// Why not.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        why: Option<String>,
    },
}

/// One flight: whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flown {
    /// Horizontal position error after each quarter of the free part, cm.
    pub position_cm: [u64; QUARTERS as usize],
    /// Horizontal velocity error then, mm/s.
    pub velocity_mmps: [u64; QUARTERS as usize],
    /// Azimuth error when GNSS went, thousandths of a degree, without its sign.
    pub azimuth_mdeg: u64,
}

impl Flown {
    /// Of what was left when GNSS went and the errors at every minute after that.
    pub fn new(left: &Left, minutes: &[LevelError]) -> Self {
        // Positive, and below the size of the Earth.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = |value: f64| value.abs().round() as u64;
        let at = |quarter: usize| {
            let minute = ((quarter + 1) * minutes.len()).div_ceil(QUARTERS as usize);
            minutes[minute - 1]
        };
        Self {
            position_cm: core::array::from_fn(|q| whole(1e2 * at(q).position_m)),
            velocity_mmps: core::array::from_fn(|q| whole(1e3 * at(q).velocity_mps)),
            azimuth_mdeg: whole(1e3 * left.azimuth_deg),
        }
    }

    /// All figures, in the order of the summary.
    pub(super) fn figures(&self) -> [u64; 9] {
        let ([a, b, c, d], [e, f, g, h]) = (self.position_cm, self.velocity_mmps);
        [self.azimuth_mdeg, a, b, c, d, e, f, g, h]
    }
}

/// Model of the sensors on a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum With {
    /// That the drives were made with.
    True,
    /// That was identified from them.
    Identified,
}

/// Runs cannot be kept or read.
#[derive(Debug, Error, Diagnostic)]
pub enum LedgerError {
    /// The system refuses.
    #[error("{}: {source}", .file.display())]
    #[diagnostic(help("permissions, or a full disk: nothing that is finished is lost"))]
    Io {
        /// The file.
        file: PathBuf,
        /// What it says.
        source: std::io::Error,
    },
    /// Somebody else writes to it.
    #[error("{} is in use", .0.display())]
    #[diagnostic(help("the same run, or the same shard of it, is going on already"))]
    Busy(PathBuf),
    /// Not a line of it.
    #[error("{}, line {line}: {message}", .file.display())]
    #[diagnostic(help("written by another version, or changed by hand: remove the line"))]
    Line {
        /// The file.
        file: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
}

/// The file of a campaign or a rehearsal, or of a shard of it, held by one process.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    file: Mutex<File>,
}

impl Ledger {
    /// Opens or makes the file, and tells of every line that is in it. A last line without its
    /// end is what a kill in the middle of writing leaves: it is cut off.
    pub fn open<L: DeserializeOwned>(
        path: &Path,
        mut known: impl FnMut(L),
    ) -> Result<Self, LedgerError> {
        let io = |source| io(path, source);
        let mut options = OpenOptions::new();
        let mut file = (options.read(true).write(true).create(true).truncate(false))
            .open(path)
            .map_err(io)?;
        file.try_lock().map_err(|error| match error {
            fs::TryLockError::WouldBlock => LedgerError::Busy(path.to_owned()),
            fs::TryLockError::Error(source) => io(source),
        })?;
        let whole = read(path, &file, &mut known)?;
        file.set_len(whole).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        Ok(Self {
            path: path.to_owned(),
            file: Mutex::new(file),
        })
    }

    /// Adds a run: on disk when this returns.
    pub fn add<L: Serialize>(&self, line: &L) -> Result<(), LedgerError> {
        let io = |source| io(&self.path, source);
        let text = serde_json::to_string(line).map_err(|error| io(error.into()))? + "\n";
        let mut file = self
            .file
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(text.as_bytes()).map_err(io)?;
        file.sync_data().map_err(io)
    }
}

/// Makes the folder of what is going to be run, with a text of it in the file `mark`; or finds that
/// it belongs to the same, so that runs go on there.
pub fn settle(
    out: &Path,
    mark: &str,
    text: &str,
    force: bool,
    same: impl FnOnce(&Path) -> Result<bool>,
    other: &str,
) -> Result<()> {
    let copy = out.join(mark);
    if copy.is_file() && !force {
        if same(&copy)? {
            return Ok(());
        }
        bail!(
            help = "choose another --out, or drop what is there with --force",
            "{} holds {other}",
            out.display()
        );
    }
    check_free(out, mark, force)?;
    if copy.is_file() {
        fs::remove_dir_all(out).map_err(|e| OutputError::io(out, e))?;
    }
    fs::create_dir_all(out).map_err(|e| OutputError::io(out, e))?;
    Ok(replace(&copy, text)?)
}

/// Tells of every whole line of the files in a folder, which nobody need hold.
pub fn read_folder<L: DeserializeOwned>(folder: &Path, mut known: impl FnMut(L)) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| OutputError::io(folder, e))? {
        let path = entry.map_err(|e| OutputError::io(folder, e))?.path();
        if path.extension().is_some_and(|end| end == "jsonl") {
            let file = File::open(&path).map_err(|error| io(&path, error))?;
            read(&path, &file, &mut known)?;
        }
    }
    Ok(())
}

fn io(file: &Path, source: std::io::Error) -> LedgerError {
    LedgerError::Io {
        file: file.to_owned(),
        source,
    }
}

/// Returns the length of all whole lines.
fn read<L: DeserializeOwned>(
    path: &Path,
    file: &File,
    known: &mut impl FnMut(L),
) -> Result<u64, LedgerError> {
    let mut reader = BufReader::new(file);
    let (mut whole, mut text) = (0, Vec::new());
    for line in 1.. {
        text.clear();
        let length = reader.read_until(b'\n', &mut text);
        let length = length.map_err(|error| io(path, error))?;
        if text.last() != Some(&b'\n') {
            break;
        }
        let finished = serde_json::from_slice(&text).map_err(|error| LedgerError::Line {
            file: path.to_owned(),
            line,
            message: error.to_string(),
        });
        known(finished?);
        whole += length as u64;
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(flight: u32) -> Line {
        Line::Flight {
            unit: 1,
            with: With::True,
            flight,
            flown: None,
            why: Some("a reason".to_owned()),
        }
    }

    fn lines(home: &Path) -> Result<Vec<Line>> {
        let mut all = Vec::new();
        read_folder(home, |line| all.push(line))?;
        Ok(all)
    }

    #[test]
    fn a_torn_line_is_cut_off_and_the_rest_stays() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("runs.jsonl");
        let ledger = Ledger::open(&path, |_: Line| panic!("there is none")).unwrap();
        for flight in 0..3 {
            ledger.add(&line(flight)).unwrap();
        }
        assert!(matches!(
            Ledger::open(&path, |_: Line| {}),
            Err(LedgerError::Busy(_))
        ));
        drop(ledger);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() - 7]).unwrap();
        let mut seen = 0;
        let ledger = Ledger::open(&path, |_: Line| seen += 1).unwrap();
        assert_eq!(seen, 2);
        ledger.add(&line(2)).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole);
        assert_eq!(lines(home.path()).unwrap(), [line(0), line(1), line(2)]);
    }

    #[test]
    fn a_damaged_line_is_named() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("runs.jsonl");
        let ledger = Ledger::open(&path, |_: Line| {}).unwrap();
        ledger.add(&line(0)).unwrap();
        drop(ledger);
        let text = fs::read_to_string(&path).unwrap() + "{\"run\":\"flight\"}\n";
        fs::write(&path, text).unwrap();
        let error = lines(home.path()).unwrap_err().to_string();
        assert!(error.contains("line 2: missing field"), "{error}");
    }
}

//! Finished runs of a campaign or a rehearsal: a line each, in an append-only file; and the shards
//! among which the runs are divided.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use indicatif::ProgressBar;
use miette::{Diagnostic, Result, bail};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use thiserror::Error;

use crate::page::output::{OutputError, check_free, replace, set_aside};

/// A part of all runs: every `of`th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Counted from 1.
    pub part: u32,
    pub of: u32,
}

impl Shard {
    pub const ALL: Self = Self { part: 1, of: 1 };

    pub fn has(self, run: u32) -> bool {
        run % self.of == self.part - 1
    }

    pub fn file(self) -> String {
        match self {
            Self::ALL => "runs.jsonl".to_owned(),
            Self { part, of } => format!("runs-{part}-of-{of}.jsonl"),
        }
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(part, of)| {
            Some(Self {
                part: part.parse().ok()?,
                of: of.parse().ok()?,
            })
        });
        numbers
            .filter(|shard| (1..=shard.of).contains(&shard.part))
            .ok_or_else(|| "K/N, the K-th of N, say 1/4".to_owned())
    }
}

#[derive(Debug, Error, Diagnostic)]
pub enum LedgerError {
    #[error("{}: {source}", .file.display())]
    #[diagnostic(help("permissions, or a full disk: nothing that is finished is lost"))]
    Io {
        file: PathBuf,
        source: std::io::Error,
    },
    #[error("{} is in use", .0.display())]
    #[diagnostic(help("the same run, or the same shard of it, is going on already"))]
    Busy(PathBuf),
    #[error("{}, line {line}: {message}", .file.display())]
    #[diagnostic(help("written by another version, or changed by hand: remove the line"))]
    Line {
        file: PathBuf,
        /// Counted from 1.
        line: usize,
        message: String,
    },
}

/// The file of a shard, held by one process.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    file: Mutex<File>,
}

impl Ledger {
    /// Opens or creates the file of a shard in a folder. An incomplete last line, left by a kill during
    /// writing, is cut off.
    pub fn open(folder: &Path, shard: Shard) -> Result<Self, LedgerError> {
        let path = folder.join(shard.file());
        let io = |source| io(&path, source);
        let mut options = OpenOptions::new();
        let mut file = (options.read(true).write(true).create(true).truncate(false))
            .open(&path)
            .map_err(io)?;
        file.try_lock().map_err(|error| match error {
            fs::TryLockError::WouldBlock => LedgerError::Busy(path.clone()),
            fs::TryLockError::Error(source) => io(source),
        })?;
        let whole = read(&path, &file, &mut |_: IgnoredAny| {})?;
        file.set_len(whole).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        let file = Mutex::new(file);
        Ok(Self { path, file })
    }

    /// Runs the jobs left on all threads, and adds a line for each. Only the order of the lines depends
    /// on the threads.
    pub fn fill<J: Send, L: Serialize>(
        &self,
        left: Vec<J>,
        progress: &ProgressBar,
        run: impl Fn(J) -> Result<L> + Sync,
    ) -> Result<()> {
        (left.into_par_iter().with_max_len(1)).try_for_each(|job| {
            let line = run(job)?;
            progress.inc(1);
            Ok(self.add(&line)?)
        })
    }

    /// Adds a run: on disk when this returns.
    pub fn add<L: Serialize>(&self, line: &L) -> Result<(), LedgerError> {
        let io = |source| io(&self.path, source);
        let text = serde_json::to_string(line).map_err(|error| io(error.into()))? + "\n";
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(text.as_bytes()).map_err(io)?;
        file.sync_data().map_err(io)
    }
}

/// Creates the output folder, with the text of the plan in the file `mark`; or finds that it is of the
/// same plan and can be resumed. By force an earlier folder is moved: returns where to.
pub fn prepare_folder(
    out: &Path,
    mark: &str,
    text: &str,
    force: bool,
    same: impl FnOnce(&Path) -> Result<bool>,
    other: &str,
) -> Result<Option<PathBuf>> {
    let copy = out.join(mark);
    if copy.is_file() && !force {
        if same(&copy)? {
            return Ok(None);
        }
        bail!(
            help = "choose another --out, or set what is there aside with --force",
            "{} holds {other}",
            out.display()
        );
    }
    check_free(out, mark, force)?;
    // It may have hours of runs, and notes of the user.
    let before = copy.is_file().then(|| set_aside(out)).transpose()?;
    fs::create_dir_all(out).map_err(|e| OutputError::io(out, e))?;
    replace(&copy, text)?;
    Ok(before)
}

/// Calls `known` with every complete line of the files in a folder.
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

/// Returns the length of all complete lines.
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
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Line {
        run: u32,
    }

    fn open(home: &Path) -> Result<Ledger, LedgerError> {
        Ledger::open(home, Shard::ALL)
    }

    fn lines(home: &Path) -> Result<Vec<u32>> {
        let mut all = Vec::new();
        read_folder(home, |line: Line| all.push(line.run))?;
        Ok(all)
    }

    #[test]
    fn a_torn_line_is_cut_off_and_the_rest_stays() {
        let home = tempfile::tempdir().unwrap();
        let home = home.path();
        let ledger = open(home).unwrap();
        assert!(lines(home).unwrap().is_empty());
        for run in 0..3 {
            ledger.add(&Line { run }).unwrap();
        }
        assert!(matches!(open(home), Err(LedgerError::Busy(_))));
        drop(ledger);
        let path = home.join("runs.jsonl");
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() - 7]).unwrap();
        let ledger = open(home).unwrap();
        assert_eq!(lines(home).unwrap(), [0, 1]);
        ledger.add(&Line { run: 2 }).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole);
        assert_eq!(lines(home).unwrap(), [0, 1, 2]);
    }

    #[test]
    fn by_force_what_was_there_is_set_aside() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let begin =
            |force| prepare_folder(&out, "plan.toml", "a plan", force, |_| Ok(false), "another");
        begin(false).unwrap();
        fs::write(out.join("notes.txt"), "mine").unwrap();
        let refused = begin(false).unwrap_err().to_string();
        assert!(refused.ends_with("holds another"), "{refused}");
        begin(true).unwrap();
        let names = |folder: &Path| fs::read_dir(folder).unwrap().count();
        assert_eq!(names(&out), 1);
        assert_eq!(names(&home.path().join("out.before-1")), 2);
    }

    #[test]
    fn a_damaged_line_is_named() {
        let home = tempfile::tempdir().unwrap();
        let home = home.path();
        fs::write(home.join("runs.jsonl"), "{\"run\":0}\n{\"rum\":1}\n").unwrap();
        let error = lines(home).unwrap_err().to_string();
        assert!(error.contains("line 2: missing field"), "{error}");
    }

    #[test]
    fn every_run_belongs_to_one_shard() {
        for run in 0..20 {
            let held = (1..=3).filter(|part| Shard { part: *part, of: 3 }.has(run));
            assert_eq!(held.count(), 1);
        }
        assert_eq!("2/3".parse(), Ok(Shard { part: 2, of: 3 }));
        for wrong in ["0/3", "4/3", "2", "a/b"] {
            assert!(wrong.parse::<Shard>().is_err());
        }
    }
}

//! Output folders that are either whole or not there.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::{Mutex, MutexGuard, PoisonError};

use miette::Diagnostic;
use thiserror::Error;

/// Folders that are being filled.
static BUILDING: Mutex<Vec<Building>> = Mutex::new(Vec::new());

struct Building {
    folder: PathBuf,
    /// Folders that were made for it to stand in, the innermost first.
    made: Vec<PathBuf>,
}

/// How often a folder is removed that is still being written into.
const REMOVALS: u32 = 100;
/// What a shell says of a program that was interrupted.
const INTERRUPTED: i32 = 130;

fn building() -> MutexGuard<'static, Vec<Building>> {
    BUILDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Leaves nothing half done behind when the user stops the program, or the system does, after ending
/// whatever else goes on.
pub fn clean_up_when_stopped(end_others: fn()) {
    // Without a handler nothing is missed but this.
    let _ = ctrlc::set_handler(move || {
        end_others();
        for Building { folder, made } in building().iter() {
            let _ = (0..REMOVALS).find(|_| fs::remove_dir_all(folder).is_ok());
            remove_empty(made);
        }
        exit(INTERRUPTED);
    });
}

#[derive(Debug, Error, Diagnostic)]
pub enum OutputError {
    /// It is there, and nobody said that it may go.
    #[error("{} exists already", .0.display())]
    #[diagnostic(help("choose another name, or replace it with --force"))]
    Exists(PathBuf),
    /// It is something else than a folder this program has written.
    #[error("{} is not a folder that this program has written", .0.display())]
    #[diagnostic(help(
        "--force replaces only simulated logs by logs and reports by reports: choose another --out"
    ))]
    Foreign(PathBuf),
    #[error("cannot write {}: {source}", .path.display())]
    #[diagnostic(help("permissions, a missing parent folder or a full disk"))]
    Io { path: PathBuf, source: io::Error },
}

impl OutputError {
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            source,
        }
    }
}

/// Refuses an existing folder early, before any work is done for it.
///
/// By force it may go if it holds the file `mark`, which only this program writes.
pub fn check_free(folder: &Path, mark: &str, force: bool) -> Result<(), OutputError> {
    let exists = folder.symlink_metadata().is_ok();
    if !exists || is_empty(folder) {
        return Ok(());
    }
    match (force, folder.join(mark).is_file()) {
        (false, _) => Err(OutputError::Exists(folder.to_owned())),
        (true, false) => Err(OutputError::Foreign(folder.to_owned())),
        (true, true) => Ok(()),
    }
}

/// The innermost first, as far as they are empty.
fn remove_empty(folders: &[PathBuf]) {
    let _ = folders.iter().all(|folder| fs::remove_dir(folder).is_ok());
}

/// Fills a hidden folder beside the wanted one, and gives it the name only when it is whole.
pub fn build<T, E: From<OutputError>>(
    folder: &Path,
    mark: &str,
    force: bool,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    check_free(folder, mark, force)?;
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let absent = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let made = parent.ancestors().take_while(absent);
    let made: Vec<PathBuf> = made.map(Path::to_owned).collect();
    fs::create_dir_all(parent).map_err(|e| OutputError::io(parent, e))?;
    let hidden = tempfile::Builder::new()
        .prefix(".building-")
        .tempdir_in(parent)
        .map_err(|e| OutputError::io(parent, e))?;
    building().push(Building {
        folder: hidden.path().to_owned(),
        made: made.clone(),
    });
    let filled = match fill(hidden.path()) {
        Ok(filled) => filled,
        Err(error) => {
            drop(hidden);
            remove_empty(&made);
            return Err(error);
        }
    };
    share(hidden.path()).map_err(|e| OutputError::io(hidden.path(), e))?;
    // Whoever stops the program now waits until the folder has its name.
    let mut building = building();
    if folder.is_dir() {
        fs::remove_dir_all(folder).map_err(|e| OutputError::io(folder, e))?;
    }
    let whole = hidden.keep();
    fs::rename(&whole, folder).map_err(|e| OutputError::io(folder, e))?;
    building.retain(|one| one.folder != whole);
    Ok(filled)
}

pub fn write(folder: &Path, name: &str, contents: impl AsRef<[u8]>) -> Result<(), OutputError> {
    let path = folder.join(name);
    fs::write(&path, contents).map_err(|e| OutputError::io(&path, e))
}

/// Refuses a file early that [`replace`] could not write, or that nobody said may go.
pub fn check_free_file(file: &Path, force: bool) -> Result<(), OutputError> {
    if file.is_dir() || (file.exists() && !force) {
        return Err(OutputError::Exists(file.to_owned()));
    }
    let new = beside(file);
    let tried = fs::write(&new, "").and_then(|()| fs::remove_file(&new));
    tried.map_err(|source| OutputError::io(file, source))
}

/// Where a file is written before it has its name.
fn beside(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".new");
    name.into()
}

/// Replaces a file by another text; a reader sees the old one or the new one, never half.
pub fn replace(file: &Path, text: &str) -> Result<(), OutputError> {
    let io = |source| OutputError::io(file, source);
    let new = beside(file);
    let written = fs::write(&new, text).and_then(|()| fs::rename(&new, file));
    written.map_err(|error| {
        let _ = fs::remove_file(&new);
        io(error)
    })
}

/// Temporary folders are private; results are as open as any new folder.
#[cfg(unix)]
fn share(folder: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn share(_: &Path) -> io::Result<()> {
    Ok(())
}

fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARK: &str = "summary.json";

    fn write(text: &'static str) -> impl FnOnce(&Path) -> Result<(), OutputError> {
        move |folder| fs::write(folder.join(MARK), text).map_err(|e| OutputError::io(folder, e))
    }

    #[test]
    fn a_folder_is_replaced_only_by_force_and_only_if_ours() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        build(&out, MARK, false, write("1")).unwrap();
        assert!(matches!(
            build(&out, MARK, false, write("2")),
            Err(OutputError::Exists(_))
        ));
        assert_eq!(fs::read_to_string(out.join(MARK)).unwrap(), "1");
        build(&out, MARK, true, write("2")).unwrap();
        assert_eq!(fs::read_to_string(out.join(MARK)).unwrap(), "2");
        fs::rename(out.join(MARK), out.join("thesis.tex")).unwrap();
        assert!(matches!(
            build(&out, MARK, true, write("3")),
            Err(OutputError::Foreign(_))
        ));
    }

    #[test]
    fn nothing_is_left_of_a_failure() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("results/out");
        let fail = |folder: &Path| {
            fs::write(folder.join(MARK), "half").unwrap();
            Err::<(), _>(OutputError::io(folder, io::Error::other("disk full")))
        };
        assert!(build(&out, MARK, false, fail).is_err());
        assert!(is_empty(home.path()));
    }
}

//! Output folders that are either complete or absent.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::{Mutex, MutexGuard, PoisonError};

use miette::Diagnostic;
use thiserror::Error;

/// Folders that are being written.
static BUILDING: Mutex<Vec<Building>> = Mutex::new(Vec::new());

struct Building {
    folder: PathBuf,
    /// Parent folders that were created for it, the innermost first.
    created: Vec<PathBuf>,
}

/// Attempts to remove a folder that is still being written to.
const REMOVALS: u32 = 100;
/// Exit status of an interrupted program, as in a shell.
const INTERRUPTED: i32 = 130;

fn building() -> MutexGuard<'static, Vec<Building>> {
    BUILDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes incomplete folders when the program is stopped by the user or the system, after `end_others`.
pub fn clean_up_when_stopped(end_others: fn()) {
    // Without the handler only this is lost.
    let _ = ctrlc::set_handler(move || {
        end_others();
        for Building { folder, created } in building().iter() {
            let _ = (0..REMOVALS).find(|_| fs::remove_dir_all(folder).is_ok());
            remove_empty(created);
        }
        exit(INTERRUPTED);
    });
}

#[derive(Debug, Error, Diagnostic)]
pub enum OutputError {
    /// It exists, and is not to be replaced.
    #[error("{} exists already", .0.display())]
    #[diagnostic(help("choose another name, or replace it with --force"))]
    Exists(PathBuf),
    /// It is not a folder that this program has written.
    #[error("{} is not a folder that this program has written", .0.display())]
    #[diagnostic(help(
        "--force replaces only simulated logs by logs and reports by reports: choose another --out"
    ))]
    Foreign(PathBuf),
    #[error("{}, line 1: expected `{head}`, as this program writes it", .file.display())]
    #[diagnostic(help(
        "it is another file: --force replaces only the table of an earlier run: choose another name"
    ))]
    ForeignFile { file: PathBuf, head: String },
    #[error("{} cannot be set aside: {source}", .path.display())]
    #[diagnostic(help(
        "it is mounted there, or its parent folder cannot be written: empty it, or choose another --out"
    ))]
    Fixed { path: PathBuf, source: io::Error },
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

/// Refuses an existing folder before any work is done for it.
///
/// With `force` it may be replaced if it has the file `mark`, which only this program writes.
pub fn check_free(folder: &Path, mark: &str, force: bool) -> Result<(), OutputError> {
    let exists = folder.symlink_metadata().is_ok();
    if !exists || is_empty(folder) {
        return Ok(());
    }
    match (force, folder.join(mark).is_file()) {
        (false, _) => Err(OutputError::Exists(folder.to_owned())),
        (true, false) => Err(OutputError::Foreign(folder.to_owned())),
        (true, true) => {
            let folder = with_name(folder)?;
            // Stopping the program now waits until it has its name again.
            let _building = building();
            let previous = set_aside(&folder)?;
            fs::rename(&previous, &folder).map_err(|e| OutputError::io(&previous, e))
        }
    }
}

/// A path with a file name, which `.` does not have.
fn with_name(folder: &Path) -> Result<PathBuf, OutputError> {
    match folder.file_name() {
        Some(_) => Ok(folder.to_owned()),
        None => (folder.canonicalize()).map_err(|e| OutputError::io(folder, e)),
    }
}

/// Removes folders, the innermost first, until one is not empty.
fn remove_empty(folders: &[PathBuf]) {
    let _ = folders.iter().all(|folder| fs::remove_dir(folder).is_ok());
}

/// Fills a hidden folder beside the target, and renames it when it is complete. Also returns the folder with
/// those files of an earlier one that were not replaced.
pub fn build<T, E: From<OutputError>>(
    folder: &Path,
    mark: &str,
    force: bool,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<(T, Option<PathBuf>), E> {
    check_free(folder, mark, force)?;
    let folder = &with_name(folder)?;
    // An existing empty folder is kept: it may be a mount point, which cannot be renamed.
    let keeps_folder = is_empty(folder);
    let parent = match folder.parent() {
        _ if keeps_folder => folder,
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let absent = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let created = parent.ancestors().take_while(absent);
    let created: Vec<PathBuf> = created.map(Path::to_owned).collect();
    fs::create_dir_all(parent).map_err(|e| OutputError::io(parent, e))?;
    let hidden = tempfile::Builder::new()
        .prefix(".building-")
        .tempdir_in(parent)
        .map_err(|e| OutputError::io(parent, e))?;
    building().push(Building {
        folder: hidden.path().to_owned(),
        created: created.clone(),
    });
    let filled = match fill(hidden.path()) {
        Ok(filled) => filled,
        Err(error) => {
            drop(hidden);
            remove_empty(&created);
            return Err(error);
        }
    };
    set_public(hidden.path()).map_err(|e| OutputError::io(hidden.path(), e))?;
    // Stopping the program now waits until the folder has its name.
    let mut building = building();
    let replaced = folder.is_dir() && !keeps_folder;
    let previous = replaced.then(|| set_aside(folder)).transpose()?;
    let complete = hidden.keep();
    let moved = if keeps_folder {
        move_contents(&complete, folder)
    } else {
        fs::rename(&complete, folder)
    };
    moved.map_err(|e| OutputError::io(folder, e))?;
    building.retain(|one| one.folder != complete);
    if let Some(previous) = &previous {
        remove_replaced(previous, folder).map_err(|e| OutputError::io(previous, e))?;
    }
    Ok((filled, previous.filter(|previous| previous.is_dir())))
}

/// Moves the contents of a folder into another one.
fn move_contents(from: &Path, to: &Path) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        fs::rename(entry.path(), to.join(entry.file_name()))?;
    }
    fs::remove_dir(from)
}

/// Renames a folder to an unused name beside it.
pub fn set_aside(folder: &Path) -> Result<PathBuf, OutputError> {
    let name = |number: u32| {
        let mut name = folder.components().as_path().as_os_str().to_owned();
        name.push(format!(".before-{number}"));
        PathBuf::from(name)
    };
    let is_free = |name: &PathBuf| name.symlink_metadata().is_err();
    let previous = (1..=u32::MAX).map(name).find(is_free).unwrap_or_default();
    fs::rename(folder, &previous).map_err(|source| OutputError::Fixed {
        path: folder.to_owned(),
        source,
    })?;
    Ok(previous)
}

/// Removes files that the new folder also has, and the folder if it is then empty: others may be the
/// user's.
fn remove_replaced(previous: &Path, new: &Path) -> io::Result<()> {
    if previous.is_symlink() {
        return fs::remove_file(previous);
    }
    for entry in fs::read_dir(previous)? {
        let entry = entry?;
        let (path, replacement) = (entry.path(), new.join(entry.file_name()));
        match (entry.file_type()?.is_dir(), replacement.is_dir()) {
            (true, true) => remove_replaced(&path, &replacement)?,
            (false, false) if replacement.exists() => fs::remove_file(path)?,
            _ => {}
        }
    }
    if is_empty(previous) {
        fs::remove_dir(previous)?;
    }
    Ok(())
}

pub fn write(folder: &Path, name: &str, contents: impl AsRef<[u8]>) -> Result<(), OutputError> {
    let path = folder.join(name);
    fs::write(&path, contents).map_err(|e| OutputError::io(&path, e))
}

pub fn read(file: &Path) -> Result<String, OutputError> {
    fs::read_to_string(file).map_err(|e| OutputError::io(file, e))
}

/// Refuses a file early that [`replace`] could not write, or that is not to be replaced.
///
/// With `force` it may be replaced if it is empty or begins with `head`, as only those of this program do.
pub fn check_free_file(file: &Path, head: &str, force: bool) -> Result<(), OutputError> {
    if file.is_dir() || (file.exists() && !force) {
        return Err(OutputError::Exists(file.to_owned()));
    }
    let previous = if file.exists() {
        fs::read(file).map_err(|source| OutputError::io(file, source))?
    } else {
        Vec::new()
    };
    if !previous.is_empty() && !previous.starts_with(head.as_bytes()) {
        return Err(OutputError::ForeignFile {
            file: file.to_owned(),
            head: head.to_owned(),
        });
    }
    let new = temporary_name(file);
    let test_write = fs::write(&new, "").and_then(|()| fs::remove_file(&new));
    test_write.map_err(|source| OutputError::io(file, source))
}

/// Temporary name of a file that is being written.
fn temporary_name(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".new");
    name.into()
}

/// Replaces the text of a file atomically.
pub fn replace(file: &Path, text: &str) -> Result<(), OutputError> {
    let io = |source| OutputError::io(file, source);
    let new = temporary_name(file);
    let written = fs::write(&new, text).and_then(|()| fs::rename(&new, file));
    written.map_err(|error| {
        let _ = fs::remove_file(&new);
        io(error)
    })
}

/// Temporary folders are private; results have the permissions of any new folder.
#[cfg(unix)]
fn set_public(folder: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn set_public(_: &Path) -> io::Result<()> {
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
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
        // Files of the user are kept.
        fs::write(out.join("notes.txt"), "mine").unwrap();
        let ((), kept) = build(&out, MARK, true, write("2")).unwrap();
        let kept = kept.unwrap();
        assert_eq!(kept, home.path().join("out.before-1"));
        assert_eq!(fs::read_to_string(kept.join("notes.txt")).unwrap(), "mine");
        assert_eq!(
            [&out, &kept].map(|of| fs::read_dir(of).unwrap().count()),
            [1, 1]
        );
        fs::rename(out.join(MARK), out.join("thesis.tex")).unwrap();
        assert!(matches!(
            build(&out, MARK, true, write("3")),
            Err(OutputError::Foreign(_))
        ));
    }

    /// A mount point cannot be replaced.
    #[cfg(unix)]
    #[test]
    fn an_empty_folder_is_kept() {
        use std::os::unix::fs::MetadataExt;
        let home = tempfile::tempdir().unwrap();
        let number = || fs::metadata(home.path()).unwrap().ino();
        let previous = number();
        let fail = |_: &Path| Err::<(), _>(OutputError::Exists(PathBuf::new()));
        assert!(build(home.path(), MARK, false, fail).is_err());
        assert!(is_empty(home.path()));
        build(home.path(), MARK, false, write("1")).unwrap();
        assert_eq!(number(), previous);
        assert_eq!(fs::read_to_string(home.path().join(MARK)).unwrap(), "1");
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_is_replaced_only_by_force_and_only_if_ours() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("table.csv");
        check_free_file(&file, "a,b", false).unwrap();
        fs::write(&file, "a,b\n1,2\n").unwrap();
        let may_go = |force| check_free_file(&file, "a,b", force);
        assert!(matches!(may_go(false), Err(OutputError::Exists(_))));
        may_go(true).unwrap();
        fs::write(&file, "t_s,lat_deg\n").unwrap();
        let refused = may_go(true).unwrap_err().to_string();
        assert!(refused.contains("line 1: expected `a,b`"), "{refused}");
    }

    #[test]
    fn a_failure_leaves_nothing_behind() {
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

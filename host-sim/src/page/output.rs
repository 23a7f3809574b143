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
        (true, true) => {
            let folder = named(folder)?;
            // Whoever stops the program now waits until it has its name again.
            let _building = building();
            let before = set_aside(&folder)?;
            fs::rename(&before, &folder).map_err(|e| OutputError::io(&before, e))
        }
    }
}

/// Where the program stands has a name to be replaced by only from above.
fn named(folder: &Path) -> Result<PathBuf, OutputError> {
    match folder.file_name() {
        Some(_) => Ok(folder.to_owned()),
        None => (folder.canonicalize()).map_err(|e| OutputError::io(folder, e)),
    }
}

/// The innermost first, as far as they are empty.
fn remove_empty(folders: &[PathBuf]) {
    let _ = folders.iter().all(|folder| fs::remove_dir(folder).is_ok());
}

/// Fills a hidden folder beside the wanted one, and gives it the name only when it is whole. Returns
/// where what it did not replace of an earlier folder is kept, too.
pub fn build<T, E: From<OutputError>>(
    folder: &Path,
    mark: &str,
    force: bool,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<(T, Option<PathBuf>), E> {
    check_free(folder, mark, force)?;
    let folder = &named(folder)?;
    // One that is there, and empty, stays: it may be mounted, so that no other can have its name.
    let stays = is_empty(folder);
    let parent = match folder.parent() {
        _ if stays => folder,
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
    let replaced = folder.is_dir() && !stays;
    let before = replaced.then(|| set_aside(folder)).transpose()?;
    let whole = hidden.keep();
    let given = if stays {
        give_all(&whole, folder)
    } else {
        fs::rename(&whole, folder)
    };
    given.map_err(|e| OutputError::io(folder, e))?;
    building.retain(|one| one.folder != whole);
    if let Some(before) = &before {
        remove_replaced(before, folder).map_err(|e| OutputError::io(before, e))?;
    }
    Ok((filled, before.filter(|before| before.is_dir())))
}

/// What is in a folder comes into another one.
fn give_all(from: &Path, to: &Path) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        fs::rename(entry.path(), to.join(entry.file_name()))?;
    }
    fs::remove_dir(from)
}

/// Gives a folder a name beside it that nothing has.
pub fn set_aside(folder: &Path) -> Result<PathBuf, OutputError> {
    let name = |number: u32| {
        let mut name = folder.components().as_path().as_os_str().to_owned();
        name.push(format!(".before-{number}"));
        PathBuf::from(name)
    };
    let is_free = |name: &PathBuf| name.symlink_metadata().is_err();
    let before = (1..=u32::MAX).map(name).find(is_free).unwrap_or_default();
    fs::rename(folder, &before).map_err(|source| OutputError::Fixed {
        path: folder.to_owned(),
        source,
    })?;
    Ok(before)
}

/// Removes what a new folder has again, and the folder if that was all: the rest may be somebody's
/// notes.
fn remove_replaced(before: &Path, new: &Path) -> io::Result<()> {
    if before.is_symlink() {
        return fs::remove_file(before);
    }
    for entry in fs::read_dir(before)? {
        let entry = entry?;
        let (path, again) = (entry.path(), new.join(entry.file_name()));
        match (entry.file_type()?.is_dir(), again.is_dir()) {
            (true, true) => remove_replaced(&path, &again)?,
            (false, false) if again.exists() => fs::remove_file(path)?,
            _ => {}
        }
    }
    if is_empty(before) {
        fs::remove_dir(before)?;
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

/// Refuses a file early that [`replace`] could not write, or that nobody said may go.
///
/// By force it may go if it begins with `head`, as only this program's do, or is empty.
pub fn check_free_file(file: &Path, head: &str, force: bool) -> Result<(), OutputError> {
    if file.is_dir() || (file.exists() && !force) {
        return Err(OutputError::Exists(file.to_owned()));
    }
    let before = if file.exists() {
        fs::read(file).map_err(|source| OutputError::io(file, source))?
    } else {
        Vec::new()
    };
    if !before.is_empty() && !before.starts_with(head.as_bytes()) {
        return Err(OutputError::ForeignFile {
            file: file.to_owned(),
            head: head.to_owned(),
        });
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
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
        // Of the user's there, none is lost.
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

    /// Nothing else can have the name of a mounted one.
    #[cfg(unix)]
    #[test]
    fn an_empty_folder_stays_the_same() {
        use std::os::unix::fs::MetadataExt;
        let home = tempfile::tempdir().unwrap();
        let number = || fs::metadata(home.path()).unwrap().ino();
        let before = number();
        let fail = |_: &Path| Err::<(), _>(OutputError::Exists(PathBuf::new()));
        assert!(build(home.path(), MARK, false, fail).is_err());
        assert!(is_empty(home.path()));
        build(home.path(), MARK, false, write("1")).unwrap();
        assert_eq!(number(), before);
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

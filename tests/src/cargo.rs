//! Runs cargo for another target or with other features than the tests themselves, or with a modification of the
//! core.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Top of the repository.
pub fn repository() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// A cargo command in `directory` of the repository, with its own target folder so that it never waits for the cargo
/// that runs the tests.
pub fn cargo(directory: &str, build_name: &str) -> Command {
    let mut command = Command::new(env!("CARGO"));
    command
        .current_dir(repository().join(directory))
        // Flags of the tests' own build must not apply.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env("CARGO_TARGET_DIR", build_folder(build_name));
    command
}

/// Where [`cargo`] puts the build called `build_name`.
///
/// # Panics
/// Outside cargo's target folder.
pub fn build_folder(build_name: &str) -> PathBuf {
    // Beside the tests' own output, wherever that is: <target>/<profile>/deps/<this executable>.
    let executable = std::env::current_exe().expect("the path of the running test is known");
    let target = executable
        .ancestors()
        // Cargo leaves CACHEDIR.TAG only in a folder that it made itself.
        .find(|folder| folder.join(".rustc_info.json").exists())
        .expect("tests run from cargo's target folder");
    target.join("other").join(build_name)
}

/// Runs `command`; the error contains its output.
pub fn succeed(command: &mut Command) -> Result<(), String> {
    let output = command
        .output()
        .map_err(|error| format!("{command:?} did not start: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    Err(format!(
        "{command:?} failed:\n{}",
        String::from_utf8_lossy(&output.stderr)
    ))
}

/// An error with instructions if the compiler lacks `target`.
pub fn require_target(target: &str) -> Result<(), String> {
    let output = Command::new("rustc")
        .current_dir(repository())
        .args(["--print", "target-libdir", "--target", target])
        .output()
        .map_err(|error| format!("rustc did not start: {error}"))?;
    let folder = PathBuf::from(String::from_utf8_lossy(&output.stdout).trim());
    if folder.is_dir() {
        return Ok(());
    }
    Err(format!(
        "the Rust target {target} is missing: run .ci/install (or rustup target add {target})"
    ))
}

/// Makes a cargo `command` build with a copy of `core/` in which `old` in `file` is replaced by `new`.
pub fn with_altered_core(
    command: &mut Command,
    name: &str,
    (file, old, new): (&str, &str, &str),
) -> Result<(), String> {
    let copy = copy_of_core(name).map_err(|error| format!("core cannot be copied: {error}"))?;
    let file = copy.join(file);
    let explain = |error: std::io::Error| format!("{}: {error}", file.display());
    let text = fs::read_to_string(&file).map_err(explain)?;
    if text.matches(old).count() != 1 {
        return Err(format!("{}: no single `{old}` to replace", file.display()));
    }
    fs::write(&file, text.replace(old, new)).map_err(explain)?;
    command.args(["--config", &format!("paths=[{:?}]", copy.display())]);
    Ok(())
}

/// Includes the workspace's manifest, which it inherits from.
fn copy_of_core(name: &str) -> std::io::Result<PathBuf> {
    let root = build_folder("altered").join(name);
    if root.exists() {
        fs::remove_dir_all(&root)?;
    }
    let core = root.join("core");
    copy_folder(&repository().join("core/src"), &core.join("src"))?;
    for manifest in ["Cargo.toml", "core/Cargo.toml"] {
        fs::copy(repository().join(manifest), root.join(manifest))?;
    }
    Ok(core)
}

fn copy_folder(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_folder(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

//! Copies of the core with one piece of code exchanged: what a check must find.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::cargo::{build_folder, repository};

/// Makes `command` of cargo build with a copy of `core/` in which `old` in `file` has become `new`.
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
        return Err(format!("{}: no single `{old}` to exchange", file.display()));
    }
    fs::write(&file, text.replace(old, new)).map_err(explain)?;
    command.args(["--config", &format!("paths=[{:?}]", copy.display())]);
    Ok(())
}

/// With the workspace's manifest above it, which it inherits from.
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

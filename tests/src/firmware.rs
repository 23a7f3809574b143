//! Builds the firmware's images as described in its README, and runs them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::{fs, io};

use host_sim::hil::board::{Pace, Transport};
use host_sim::hil::{Board, Emulator, HilError, Session};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};

use crate::cargo::{build_folder, cargo, require_target, succeed};

const TARGET: &str = "thumbv7em-none-eabihf";

/// Additional arguments to cargo: optimization for size instead of speed.
pub const FOR_SIZE: [&str; 2] = ["--config", "profile.release.opt-level='s'"];

/// Builds a program of the firmware for a board.
pub fn image(board: Board, program: &str) -> Result<PathBuf, String> {
    image_with(board, program, &[])
}

/// Builds a program of `peers/` for the Cortex-M7.
pub fn peer_image(program: &str) -> Result<PathBuf, String> {
    let manifest = ["--manifest-path", "../tests/peers/Cargo.toml"];
    image_with(Board::CortexM7, program, &manifest)
}

/// Images by their command: each is built once.
static IMAGES: Mutex<BTreeMap<String, PathBuf>> = Mutex::new(BTreeMap::new());

/// Builds a program of the firmware with additional arguments to cargo.
pub fn image_with(board: Board, program: &str, arguments: &[&str]) -> Result<PathBuf, String> {
    let mut images = IMAGES.lock().unwrap_or_else(PoisonError::into_inner);
    let mut command = build(board, program)?;
    command.args(arguments);
    let key = format!("{command:?}");
    if let Some(image) = images.get(&key) {
        return Ok(image.clone());
    }
    succeed(&mut command)?;
    let folder = build_folder(board.cargo_config());
    let built = folder.join(TARGET).join("release").join(program);
    let image = copy_image(&built, &folder.join("images"), arguments)
        .map_err(|error| format!("{}: {error}", built.display()))?;
    images.insert(key, image.clone());
    Ok(image)
}

/// Copies an image: builds with different features have the same path, and one may run while another is built.
fn copy_image(built: &Path, folder: &Path, arguments: &[&str]) -> io::Result<PathBuf> {
    let program = built.file_name().unwrap_or_default().to_string_lossy();
    let name = format!("{program}{}", arguments.concat()).replace('/', "_");
    fs::create_dir_all(folder)?;
    let copy = tempfile::NamedTempFile::new_in(folder)?;
    fs::copy(built, copy.path())?;
    let image = folder.join(name);
    copy.persist(&image)?;
    Ok(image)
}

/// The command that builds a program of the firmware.
pub fn build(board: Board, program: &str) -> Result<Command, String> {
    require_target(TARGET)?;
    let config = board.cargo_config();
    let mut command = cargo("firmware-example", config);
    command.args(["build", "--release", "--locked", "--config", config]);
    command.args(["--bin", program]);
    Ok(command)
}

/// A session with an image on an emulated board, over the debugger's console.
pub fn session(board: Board, image: &Path, pace: Pace) -> Result<Session<Emulator>, HilError> {
    Session::open(Emulator::boot(board, image, Transport::Console, pace)?, 1)
}

/// Bytes of code and constants in an image.
pub fn flash_bytes(image: &Path) -> Result<u64, String> {
    let flash = |section: &object::Section| matches!(section.name(), Ok(".text" | ".rodata"));
    inspect(image, |file| {
        let sections = file.sections().filter(flash);
        Ok(sections.map(|section| section.size()).sum())
    })
}

/// Names of all symbols of a program.
pub fn symbols(program: &Path) -> Result<Vec<String>, String> {
    inspect(program, |file| {
        let symbols = file.symbols().chain(file.dynamic_symbols());
        symbols
            .map(|symbol| symbol.name().map(str::to_owned))
            .collect()
    })
}

fn inspect<T>(
    program: &Path,
    read: impl FnOnce(&object::File) -> object::Result<T>,
) -> Result<T, String> {
    let explain = |error: &dyn std::fmt::Display| format!("{}: {error}", program.display());
    let bytes = fs::read(program).map_err(|error| explain(&error))?;
    object::File::parse(&*bytes)
        .and_then(|file| read(&file))
        .map_err(|error| explain(&error))
}

//! The firmware's images, built as its README says, and run.

use std::path::{Path, PathBuf};

use host_sim::hil::emulator::{Pace, Way};
use host_sim::hil::{Board, Emulator, Session};
use object::{Object as _, ObjectSection as _};

use crate::cargo::{build_folder, cargo, require_target, succeed};

const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds a program of the firmware for a board.
pub fn image(board: Board, program: &str) -> Result<PathBuf, String> {
    image_with(board, program, "")
}

/// Builds a program of the firmware with some of its features.
pub fn image_with(board: Board, program: &str, features: &str) -> Result<PathBuf, String> {
    build(board, program, &["--features", features])
}

/// Builds a program of `peers/` for the Cortex-M7.
pub fn peer_image(program: &str) -> Result<PathBuf, String> {
    let manifest = "../tests/peers/Cargo.toml";
    build(Board::CortexM7, program, &["--manifest-path", manifest])
}

fn build(board: Board, program: &str, arguments: &[&str]) -> Result<PathBuf, String> {
    require_target(TARGET)?;
    let config = board.cargo_config();
    let mut command = cargo("firmware-example", config);
    command.args(["build", "--release", "--locked", "--config", config]);
    succeed(command.args(["--bin", program]).args(arguments))?;
    Ok(build_folder(config)
        .join(TARGET)
        .join("release")
        .join(program))
}

/// The firmware on an emulated board, behind the debugger's console.
pub fn session(board: Board, pace: Pace) -> Result<Session<Emulator>, String> {
    let image = image(board, "console")?;
    let emulator = Emulator::boot(board, &image, Way::Console, pace);
    Session::open(emulator.map_err(|error| error.to_string())?, 1)
        .map_err(|error| error.to_string())
}

/// Bytes of code and constants in an image.
pub fn flash_bytes(image: &Path) -> Result<u64, String> {
    let explain = |error: &dyn std::fmt::Display| format!("{}: {error}", image.display());
    let bytes = std::fs::read(image).map_err(|error| explain(&error))?;
    let file = object::File::parse(&*bytes).map_err(|error| explain(&error))?;
    let flash = |section: &object::Section| matches!(section.name(), Ok(".text" | ".rodata"));
    Ok(file
        .sections()
        .filter(flash)
        .map(|section| section.size())
        .sum())
}

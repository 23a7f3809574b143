//! The firmware's images, built as its README says.

use std::path::PathBuf;

use host_sim::hil::Board;

use crate::cargo::{build_folder, cargo, require_target, succeed};

const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds a program of the firmware for a board.
pub fn image(board: Board, program: &str) -> Result<PathBuf, String> {
    require_target(TARGET)?;
    let config = board.cargo_config();
    succeed(cargo("firmware-example", config).args([
        "build",
        "--release",
        "--locked",
        "--config",
        config,
        "--bin",
        program,
    ]))?;
    Ok(build_folder(config)
        .join(TARGET)
        .join("release")
        .join(program))
}

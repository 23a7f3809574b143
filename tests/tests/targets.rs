//! The core compiles for every kind of microcontroller, and with each feature alone.

use ins_tests::cargo::{cargo, require_target, succeed};

/// Cortex-M4F and M7, M0, M33, and RISC-V.
const TARGETS: [&str; 4] = [
    "thumbv7em-none-eabihf",
    "thumbv6m-none-eabi",
    "thumbv8m.main-none-eabihf",
    "riscv32imac-unknown-none-elf",
];

fn compile(targets: &[&str], features: &str) -> Result<(), String> {
    // Checked, not linked: the firmware's image is built and run by other tests.
    let mut command = cargo(".", "targets");
    command.args([
        "check",
        "--package=ins-core",
        "--locked",
        "--features",
        features,
    ]);
    for target in targets {
        require_target(target)?;
        command.args(["--target", target]);
    }
    succeed(&mut command)
}

#[test]
fn core_compiles_for_every_target() -> Result<(), String> {
    compile(&TARGETS, "serde,defmt,literal")
}

#[test]
fn core_compiles_with_each_feature_alone() -> Result<(), String> {
    for features in ["", "serde", "defmt", "literal"] {
        compile(&TARGETS[..1], features)?;
    }
    Ok(())
}

/// The program of the porting page, in its own crate.
#[test]
fn the_documented_program_compiles() -> Result<(), String> {
    let page = include_str!("../../docs/porting.md");
    let (_, rest) = page.split_once("```rust\n").ok_or("no program")?;
    let (program, _) = rest.split_once("```").ok_or("no end of the program")?;
    let lines = program.lines().count();
    assert!(lines <= 40, "{lines} lines");
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let core = concat!(env!("CARGO_MANIFEST_DIR"), "/../core");
    let manifest = format!(
        "[package]\nname = \"port\"\nedition = \"2024\"\n[workspace]\n\
         [dependencies]\nins-core = {{ path = '{core}' }}\n"
    );
    let source = format!("#![no_std]\n#![allow(dead_code)]\n{program}");
    for (name, text) in [("Cargo.toml", manifest), ("src/lib.rs", source)] {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("in the folder"))
            .and_then(|()| std::fs::write(&path, text))
            .map_err(|error| error.to_string())?;
    }
    // The same versions as the other builds.
    std::fs::copy(
        concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../firmware-example/Cargo.lock"
        ),
        folder.path().join("Cargo.lock"),
    )
    .map_err(|error| error.to_string())?;
    require_target(TARGETS[0])?;
    let mut command = cargo(".", "targets");
    command.args(["check", "--target", TARGETS[0], "--manifest-path"]);
    command.arg(folder.path().join("Cargo.toml"));
    succeed(&mut command)
}

#[test]
fn a_missing_target_is_reported() {
    let sentence = require_target("armv4t-none-eabi").unwrap_err();
    assert!(
        sentence.contains("rustup target add armv4t-none-eabi"),
        "{sentence}"
    );
}

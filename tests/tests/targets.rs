//! Core compiles for every kind of microcontroller, and with each feature alone.

use ins_tests::cargo::{cargo, require_target, succeed};

/// Cortex-M4F and M7, M0, M33, and a core that is no Cortex at all.
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
fn every_target() -> Result<(), String> {
    compile(&TARGETS, "serde,defmt")
}

#[test]
fn each_feature_alone() -> Result<(), String> {
    for features in ["", "serde", "defmt"] {
        compile(&TARGETS[..1], features)?;
    }
    Ok(())
}

#[test]
fn a_missing_target_is_named() {
    let sentence = require_target("armv4t-none-eabi").unwrap_err();
    assert!(
        sentence.contains("rustup target add armv4t-none-eabi"),
        "{sentence}"
    );
}

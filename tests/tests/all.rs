//! The tests of this folder as one program, linked once: `cargo test -p ins-tests --test all links::`
//! runs those of one file.

mod accuracy;
mod aircraft;
mod bad_input;
mod barometer;
mod firmware;
mod footprint;
mod forms;
mod hil;
mod host_bits;
mod images;
mod independent_simulation;
mod interface;
mod link;
mod links;
mod locks;
mod mechanization;
mod mounting;
mod pages;
mod partial_fixes;
mod pyins;
mod rest;
mod targets;

use std::fs;

use ins_tests::cargo::repository;

/// A file that is not declared would not be run.
#[test]
fn every_file_is_included() {
    for folder in ["host-sim/tests", "tests/tests"] {
        let folder = repository().join(folder);
        let program = fs::read_to_string(folder.join("all.rs")).unwrap();
        let manifest = fs::read_to_string(folder.join("../Cargo.toml")).unwrap();
        let entries = fs::read_dir(&folder).unwrap();
        let files = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        for name in files.filter_map(|file| file.strip_suffix(".rs").map(str::to_owned)) {
            assert!(
                program.contains(&format!("\nmod {name};\n"))
                    || manifest.contains(&format!("[[test]]\nname = \"{name}\"\n")),
                "{}: {name}.rs",
                folder.display()
            );
        }
    }
}

//! Content of the firmware's images.

use std::path::Path;

use host_sim::hil::Board;
use ins_tests::cargo::{succeed, with_altered_core};
use ins_tests::firmware::{build, image, image_with, symbols};

/// With these features `core_only` links only if no panic can be reached.
const NO_PANIC: [&str; 2] = ["--features", "panic-never"];

#[test]
fn the_core_cannot_panic() -> Result<(), String> {
    for board in [Board::CortexM7, Board::CortexM4] {
        image_with(board, "core_only", &NO_PANIC)?;
    }
    Ok(())
}

/// The check above detects a single index that the compiler cannot prove.
#[test]
fn a_core_that_can_panic_does_not_link() -> Result<(), String> {
    let exchange = (
        "src/math.rs",
        "libm::sin(angle_rad)",
        "[libm::sin(angle_rad)][core::hint::black_box(0)]",
    );
    let mut command = build(Board::CortexM7, "core_only")?;
    with_altered_core(command.args(NO_PANIC), "index", exchange)?;
    let error = succeed(&mut command).expect_err("it links");
    assert!(error.contains("error(panic-never)"), "{error}");
    Ok(())
}

/// Allocator symbols of Rust and of a C library.
fn heap_symbols(program: &Path) -> Result<Vec<String>, String> {
    let mut symbols = symbols(program)?;
    symbols.retain(|symbol| {
        symbol.contains("__rust_alloc")
            || symbol.contains("__rust_realloc")
            || symbol.contains("__rust_dealloc")
            || ["malloc", "calloc", "realloc", "free", "sbrk", "_sbrk"].contains(&symbol.as_str())
    });
    Ok(symbols)
}

#[test]
fn no_image_has_a_heap() -> Result<(), String> {
    for board in [Board::CortexM7, Board::CortexM4] {
        for program in ["ins-firmware", "console", "core_only"] {
            let image = image(board, program)?;
            let all = symbols(&image)?;
            assert!(all.iter().any(|symbol| symbol == "Reset"), "{all:?}");
            assert_eq!(heap_symbols(&image)?, [""; 0], "{program}");
        }
    }
    Ok(())
}

/// This program has a heap, which must be detected.
#[cfg(target_os = "linux")]
#[test]
fn a_heap_is_detected() -> Result<(), String> {
    let this = std::env::current_exe().map_err(|error| error.to_string())?;
    assert!(heap_symbols(&this)?.len() > 1);
    Ok(())
}

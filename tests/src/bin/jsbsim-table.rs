//! Prints the comparison with `JSBSim`: `cargo run -p ins-tests --bin jsbsim-table`.

use ins_tests::jsbsim::{ours, ours_with_its_numbers, reference, table};

fn main() -> Result<(), String> {
    let reference = reference()?;
    println!("Our parameters:\n\n{}", table(&ours(), &reference));
    print!(
        "Our equations with JSBSim's inertia and pitching moment:\n\n{}",
        table(&ours_with_its_numbers(&reference), &reference)
    );
    Ok(())
}

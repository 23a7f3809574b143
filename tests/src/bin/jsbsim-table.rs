//! Prints the comparison with JSBSim: `cargo run -p ins-tests --bin jsbsim-table`.

fn main() -> Result<(), String> {
    let reference = ins_tests::jsbsim::reference()?;
    print!("{}", ins_tests::jsbsim::table(&reference));
    Ok(())
}

//! Prints the comparison with `JSBSim` and with published values:
//! `cargo run -p ins-tests --bin jsbsim-table`.

use host_sim::page::table::{markdown, plain};
use ins_tests::aircraft::{
    CESSNA_182_MODES, MODE_ROWS, cessna_182, ours, ours_with_jsbsim_parameters, reference, table,
};

fn main() -> Result<(), String> {
    let reference = reference()?;
    let (header, rows) = table(&ours(), &reference, true);
    println!("{}", markdown(&header, &rows));
    println!("{}", cessna_182_table()?);
    let (header, rows) = table(&ours_with_jsbsim_parameters(&reference), &reference, false);
    println!(
        "With JSBSim's inertia and pitching moment in our equations:\n\n{}",
        plain(&header, &rows)
    );
    Ok(())
}

fn cessna_182_table() -> Result<String, String> {
    let modes = cessna_182()?.modes.ok_or("a mode has degenerated")?;
    let row = |(name, digits, value): (&str, usize, fn(&_) -> f64)| {
        let mut cells = vec![name.to_owned()];
        cells.extend([&modes, &CESSNA_182_MODES].map(|m| format!("{:.digits$}", value(m))));
        cells
    };
    let header = [
        "Cessna 182, 67 m/s at 1524 m",
        "this model",
        "textbook equations",
    ]
    .map(str::to_owned);
    Ok(markdown(&header, &MODE_ROWS.map(row)))
}

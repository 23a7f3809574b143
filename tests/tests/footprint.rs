//! What the core costs on a microcontroller does not grow unseen.

use host_sim::hil::Board;
use ins_tests::footprint::{goal, ours};

/// All but the worst call not at their goals yet (`ins_tests::footprint::goal`): as measured, and a
/// fiftieth for a change of the compiler's mind.
const AMORTISED: u64 = 3_790;
const WORST: u64 = goal::WORST;
const STATE_BYTES: u64 = 13_260;
const STACK_BYTES: u64 = 2_640;
const FLASH_BYTES: u64 = 129_400;

#[test]
fn the_core_on_cortex_m7_is_within_its_budgets() -> Result<(), Box<dyn std::error::Error>> {
    let footprint = ours(Board::CortexM7)?;
    println!("{footprint:?}");
    let budgets = [
        ("instructions per sample", footprint.amortised(), AMORTISED),
        ("instructions of the worst call", footprint.worst(), WORST),
        ("bytes of state", footprint.state_bytes, STATE_BYTES),
        ("bytes of stack", footprint.stack_bytes, STACK_BYTES),
        ("bytes of flash", footprint.flash_bytes, FLASH_BYTES),
    ];
    for (what, measured, budget) in budgets {
        assert!(
            (1..=budget).contains(&measured),
            "{measured} {what}, budget {budget}"
        );
    }
    Ok(())
}

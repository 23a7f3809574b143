//! Limits of the core's cost on a microcontroller.

use host_sim::hil::Board;
use host_sim::log::Grade;
use ins_tests::footprint::{goal, ours};

/// Budgets where a goal is not reached yet (`ins_tests::footprint::goal`): as measured, rounded up. Fewest
/// parameters are estimated for ring lasers, all for MEMS.
const AMORTISED_OF_ALL: u64 = 3_750;
const STATE_BYTES: u64 = 16_424;
const FLASH_BYTES: u64 = 161_600;

#[test]
fn the_core_on_cortex_m7_is_within_its_budgets() -> Result<(), Box<dyn std::error::Error>> {
    for (class, amortised) in [
        (Grade::Hg1700, goal::AMORTISED),
        (Grade::Mems, AMORTISED_OF_ALL),
    ] {
        let footprint = ours(Board::CortexM7, class, &[])?;
        println!("{footprint:?}, {} a sample", footprint.amortised());
        let budgets = [
            ("instructions per sample", footprint.amortised(), amortised),
            (
                "instructions of the worst call",
                footprint.worst(),
                goal::WORST,
            ),
            ("bytes of state", footprint.state_bytes, STATE_BYTES),
            ("bytes of stack", footprint.stack_bytes, goal::STACK_BYTES),
            ("bytes of flash", footprint.flash_bytes, FLASH_BYTES),
        ];
        for (what, measured, budget) in budgets {
            assert!(
                (1..=budget).contains(&measured),
                "{measured} {what}, budget {budget} ({class:?})"
            );
        }
    }
    Ok(())
}

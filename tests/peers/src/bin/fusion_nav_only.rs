//! The filter alone, for its size.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    ins_peers::only::<ins_peers::filters::FusionNav>()
}

//! The filter, to be driven by the host.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    ins_peers::serve::<ins_peers::filters::FusionNav>()
}

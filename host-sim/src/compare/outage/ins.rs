//! Navigators under outage test.

use ins_core::{GnssFix, ImuSample, Navigator, Solution};

/// An aided INS, given samples and fixes in the order of their stamps.
pub(super) trait Ins: Clone {
    fn on_imu(&mut self, sample: &ImuSample);
    fn on_gnss(&mut self, fix: &GnssFix);
    fn solution(&self) -> Option<Solution>;
}

impl Ins for Navigator {
    fn on_imu(&mut self, sample: &ImuSample) {
        let _ = self.on_imu(sample);
    }

    fn on_gnss(&mut self, fix: &GnssFix) {
        let _ = self.on_gnss(fix);
    }

    fn solution(&self) -> Option<Solution> {
        self.solution()
    }
}

//! What is found in a log while it is checked.

use std::path::Path;

use super::error::LogError;

/// Where the tables came from, and what looks suspicious so far.
pub(super) struct Findings<'a> {
    pub(super) imu: &'a Path,
    pub(super) gnss: &'a Path,
    pub(super) warnings: &'a mut Vec<LogError>,
}

impl Findings<'_> {
    /// A defect of the inertial samples.
    pub(super) fn imu(
        &self,
        expected: impl Into<Box<str>>,
        found: impl Into<Box<str>>,
        cause: impl Into<Box<str>>,
    ) -> LogError {
        LogError::file(self.imu, expected, found, cause)
    }

    /// A defect of the fixes.
    pub(super) fn gnss(
        &self,
        expected: impl Into<Box<str>>,
        found: impl Into<Box<str>>,
        cause: impl Into<Box<str>>,
    ) -> LogError {
        LogError::file(self.gnss, expected, found, cause)
    }

    pub(super) fn warn(&mut self, defect: LogError) {
        self.warnings.push(defect);
    }
}

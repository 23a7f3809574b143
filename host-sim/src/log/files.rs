//! Where the tables of a log came from, for messages.

use std::path::PathBuf;

/// Where the tables came from, for messages.
pub(super) struct Files {
    pub(super) imu: PathBuf,
    pub(super) gnss: PathBuf,
}

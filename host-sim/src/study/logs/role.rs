//! Which logs the core is developed on, and which judge it.

use std::path::Path;

use serde::Serialize;

/// What a log is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Looked at while the core changes.
    Development,
    /// Looked at to see whether a change was right.
    Judge,
}

/// Folder names of the development logs: about half of those at hand, some of each kind of
/// vehicle, both recordings of one flight together. Any other log judges.
const DEVELOPMENT: [&str; 7] = [
    "instinct_vn310_static",
    "plane_px4",
    "quad_joey1",
    "quad_joey1_imu2",
    "rtklibexplorer_drive_0708",
    "yk_mixed_road_long_drive_nominal_001",
    "yk_urban_short_turn_loop_nominal_001",
];

impl Role {
    /// Both, in the order of the tables.
    pub const ALL: [Self; 2] = [Self::Development, Self::Judge];

    /// Of the log in a folder of this name.
    pub fn of(name: &str) -> Self {
        if DEVELOPMENT.contains(&name) {
            Self::Development
        } else {
            Self::Judge
        }
    }
}

/// Name of a log's folder.
pub fn name_of(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    whole
        .file_name()
        .map_or_else(|| "log".to_owned(), |name| name.to_string_lossy().into())
}

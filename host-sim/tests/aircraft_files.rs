//! Aircraft files that cannot be used, and what is said of them.

use host_sim::aircraft::CESSNA_172_TOML;
use host_sim::aircraft::input::read_aircraft;

#[test]
fn bad_files_are_refused_with_place_and_cause() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("aircraft.toml");
    for (good, bad, says) in [
        (
            "mass_kg = 1043.0",
            "mass_kg = -1043.0",
            "expected a positive number",
        ),
        ("mass_kg = 1043.0", "mass = 1043.0", "unknown field `mass`"),
        ("mass_kg = 1043.0", "", "missing field `mass_kg`"),
        (
            "wing_span_m = 10.912",
            "wing_span_m = nan",
            "expected a positive number",
        ),
        ("name = ", "name ", "complete example"),
    ] {
        let text = CESSNA_172_TOML.replacen(good, bad, 1);
        assert_ne!(text, CESSNA_172_TOML, "{good}");
        std::fs::write(&file, text).unwrap();
        let error = read_aircraft(&file).unwrap_err().to_string();
        assert!(error.contains("aircraft.toml, line "), "{bad}: {error}");
        assert!(error.contains(says), "{bad}: {error}");
    }
}

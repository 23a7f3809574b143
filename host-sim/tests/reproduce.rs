//! The thesis's figures from simulation.

use host_sim::study::reproduce::{Reproduction, Settings, reproduce};

/// One of everything.
fn small(threads: usize) -> Reproduction {
    let settings = Settings {
        drives: 1,
        minutes: 40.0,
        units: 1,
        unit_minutes: 5.0,
        flights: 1,
        flight_minutes: 120.0,
        ..Settings::new(3)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let run = || reproduce(settings, None).unwrap();
    pool.build().unwrap().install(run)
}

fn number(reproduction: &Reproduction, part: &str, what: &str) -> f64 {
    let part = reproduction.parts.iter().find(|p| p.name == part).unwrap();
    let number = part.numbers.iter().find(|n| n.what.starts_with(what));
    number.unwrap().ours
}

#[test]
fn shows_what_the_thesis_shows_on_any_number_of_threads() {
    let reproduction = small(1);
    assert_eq!(reproduction, small(2));
    let number = |part, what| number(&reproduction, part, what);
    // Figure 8: an order of magnitude.
    assert!(number("figure-8", "times less") > 10.0);
    // Figure 5: gone, that is less than a tenth is left.
    assert!(number("figure-5", "times less") > 10.0);
    // Table 2, within 2 % of the specification.
    assert!((number("table-2", "stall") / 87.0 - 1.0).abs() < 0.02);
    let folder = tempfile::tempdir().unwrap();
    reproduction.write(folder.path()).unwrap();
    for part in &reproduction.parts {
        let data = folder.path().join(format!("{}.csv", part.name));
        let lines = std::fs::read_to_string(data).unwrap().lines().count();
        assert!(lines > 3, "{}", part.name);
        assert_eq!(
            part.svg.is_some(),
            folder.path().join(format!("{}.svg", part.name)).exists()
        );
    }
}

//! Closure: what is simulated with a model is identified to a model whose intervals hold it, in a car
//! and in an aircraft, with both classes of sensors and both models of gyro biases.

use std::process::Command;

use serde_json::Value;

/// Of some 200 honest 95 % intervals at least this part holds the truth; those of a unit are not
/// independent.
const HELD: f64 = 0.88;

#[test]
fn models_come_back() {
    let study = ["--units", "2", "--drives", "2", "--minutes", "12"];
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["--json", "recovery", "--closure"])
        .args(study)
        .output()
        .unwrap();
    assert!(output.status.success());
    let results: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    // Two classes, two vehicles, two models.
    assert_eq!(results.len(), 8);
    let (mut held, mut all) = (0.0, 0.0);
    for results in &results {
        for row in results["rows"].as_array().unwrap() {
            let kind = format!(
                "{} {} {}",
                results["class"], results["vehicle"], row["name"]
            );
            let units = row["units"].as_f64().unwrap();
            assert!(units > 0.0, "{kind}: {row}");
            let percent = row["coverage_percent"].as_f64().unwrap();
            if percent < 100.0 {
                println!("{kind}: {percent} % of {units}, {row}");
            }
            held += 0.01 * percent * units;
            all += units;
        }
    }
    assert!(held / all >= HELD, "{held} of {all}");
}

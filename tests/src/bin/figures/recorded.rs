//! Recorded logs, and recordings of other programs.

use std::env;
use std::path::{Path, PathBuf};

use host_sim::compare::kalman::Noise;
use host_sim::compare::outage;
use host_sim::identify::analysis::{Analysis, log_name};
use host_sim::identify::configure;
use host_sim::identify::error_model::Identified;
use host_sim::identify::quantities::Quantity;
use host_sim::page::table::{heads, markdown};
use host_sim::page::{brief, digits};
use host_sim::proof::{compare_drift, overview, verdict};
use host_sim::study::logs::{Wander, wander_table};
use host_sim::{Drives, log, study};
use indicatif::ProgressBar;
use miette::{Result, miette};

/// Estimates of every recorded log; `None` if there are none.
pub fn logs(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    let logs = recorded_logs(root, folder);
    if logs.is_empty() {
        return Ok(None);
    }
    let row = |log: &PathBuf| Ok(row(&Analysis::of_log(log, None, &ProgressBar::hidden())?));
    let rows = logs.iter().map(row).collect::<Result<Vec<_>>>()?;
    let header = heads(
        "log | length, s | azimuth error, deg | accelerometer x, mg | accelerometer y, mg \
         | gyro z, deg/h | latency, ms | before, m/s | after, m/s | improvement factor",
    );
    Ok(Some(markdown(&header, &rows)))
}

/// Estimates from every recording of another program and every recorded log, without manual settings; `None` without
/// recordings.
pub fn recordings(root: &Path, folder: Option<&Path>, logs: Option<&Path>) -> Option<String> {
    let folder = folder.map_or_else(|| root.join("../shared/formats"), Path::to_owned);
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    if paths.is_empty() {
        eprintln!(
            "no recordings in {}: their table stays as it was (--recordings)",
            folder.display()
        );
        return None;
    }
    paths.sort();
    paths.extend(recorded_logs(root, logs));
    let rows: Vec<_> = (paths.iter())
        .flat_map(|path| study::recordings::recordings(path, None))
        .collect();
    Some(study::recordings::table(&rows).markdown())
}

/// Recorded logs sorted by name; prints a note if there are none.
fn recorded_logs(root: &Path, folder: Option<&Path>) -> Vec<PathBuf> {
    let default = || env::var_os("INS_LOGS").map_or(root.join("../shared/data"), PathBuf::from);
    let folder = folder.map_or_else(default, Path::to_owned);
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut logs: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.join("meta.toml").is_file())
        .collect();
    logs.sort();
    if logs.is_empty() {
        eprintln!(
            "no recorded logs in {}: their table stays as it was (--logs, INS_LOGS)",
            folder.display()
        );
    }
    logs
}

fn row(analysis: &Analysis) -> Vec<String> {
    let summary = &analysis.summary;
    let quantities = &summary.quantities;
    let known = |quantity: &Quantity| {
        if quantity.observable() {
            format!(
                "{} \u{b1} {}",
                digits(quantity.sigma, quantity.value),
                brief(quantity.sigma)
            )
        } else {
            "not observable".to_owned()
        }
    };
    let error = &summary.velocity_error_mps;
    let number = |value: Option<f64>| value.map_or("-".to_owned(), brief);
    let both = error.before.zip(error.after);
    let factor = both.map(|(before, after)| before / after);
    vec![
        summary.log.clone(),
        format!("{:.0}", summary.duration_s),
        known(&quantities.azimuth_error_deg),
        known(&quantities.accel_bias_mg.x),
        known(&quantities.accel_bias_mg.y),
        known(&quantities.gyro_bias_deg_h.z),
        known(&quantities.gnss_latency_ms),
        number(error.before),
        number(error.after),
        number(factor),
    ]
}

/// Drifts of every navigator in every recorded log; `None` if there are no logs, or no peer.
pub fn outages(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    if cfg!(not(feature = "peers")) {
        eprintln!("outages: the table stays as it was (build with --features peers)");
        return Ok(None);
    }
    let mut rows = Vec::new();
    for path in recorded_logs(root, folder) {
        let (log, _) = log::read(&path)?;
        let config = configure::config(&log, configure::grade(&log, None));
        let test = outage::test(&log, false, config, Noise::of_config(&config))
            .map_err(|error| miette!("cannot be run: {}", error))?;
        let Some(test) = test else { continue };
        let mut row = vec![log_name(&path, &log), test.navigators[0].count.to_string()];
        for drifts in &test.navigators {
            let metres = [drifts.position_rms_m, drifts.position_max_m].map(brief);
            row.push(metres.join(" / "));
            row.push(brief(drifts.velocity_rms_mps));
        }
        rows.push(row);
    }
    let header =
        heads("log | outages | compensation, m | m/s | Kalman, m | m/s | fusion-nav, m | m/s");
    Ok((!rows.is_empty()).then(|| markdown(&header, &rows)))
}

/// Correlated position noise of recorded receivers; `None` without logs.
pub fn wander(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    let mut rows = Vec::new();
    for path in recorded_logs(root, folder) {
        let (log, _) = log::read(&path)?;
        rows.extend(Wander::of(&log.gnss).map(|wander| (log_name(&path, &log), wander)));
    }
    Ok((!rows.is_empty()).then(|| wander_table(&rows).markdown()))
}

/// Drives of one unit with many turns, and long ones.
const TURNS: [&str; 3] = [
    "yk_urban_medium_turn_loop_nominal_001",
    "yk_urban_short_turn_loop_nominal_001",
    "yk_urban_stop_go_large_mount_001",
];
const LONG: [&str; 2] = [
    "yk_mixed_road_long_drive_nominal_001",
    "yk_urban_long_turn_loop_nominal_001",
];

/// Simulations of each drive in the comparison.
const SEEDS: u64 = 20;

/// Recorded drives of one unit for its model, and others for the comparison.
const TRIALS: [(&[&str], &[&str]); 4] = [
    (&TURNS, &LONG),
    (
        &[LONG[0], LONG[1], "yk_parking_lot_circle_turns_nominal_001"],
        &TURNS,
    ),
    (&["quad_joey1"], &["quad_joey1_imu2"]),
    (&["quad_joey1_imu2"], &["quad_joey1"]),
];

/// Drift predicted from recorded drives; `None` without them.
pub fn proof(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    let logs = recorded_logs(root, folder);
    if logs.is_empty() {
        return Ok(None);
    }
    let named = |names: &[&str]| -> Vec<PathBuf> {
        let is_named = |log: &&PathBuf| names.iter().any(|name| log.ends_with(name));
        logs.iter().filter(is_named).cloned().collect()
    };
    let mut rows = Vec::new();
    for (drives, against) in TRIALS {
        let drives = Drives::read(&named(drives), None)?;
        let mut model = Identified::new(&drives.records, drives.grade, None).model();
        model.imu.output = drives.output;
        for path in named(against) {
            let analysis = Analysis::of_log(&path, Some(drives.grade), &ProgressBar::hidden())?;
            rows.extend(compare_drift(&analysis, &model, SEEDS)?);
        }
    }
    let table = overview(&rows).markdown();
    Ok(Some(format!("{table}\n{}\n", verdict(&rows))))
}

//! The study as text: a table for each test, with development logs and judges separate.

use super::log_study::{ALLOWANCE, LogStudy, Role};
use super::summary::{Statistics, Study, Summary};
use super::wander;
use crate::compare::outage::OUTAGE_S;
use crate::identify::halves::{self, Difference};
use crate::page::table::{Table, cells, heads, titled};
use crate::page::{brief, digits};

pub fn plain(study: &Study) -> String {
    let parts = [
        halves_table(study),
        methods_table(study),
        altered_table(study),
        outages_table(study),
        free_table(study),
        without_table(study),
        wander_table(study),
    ];
    logs_without_results(study) + &titled(&parts, Table::plain) + "\n"
}

/// Names of the logs without any result, which are missing in the tables.
fn logs_without_results(study: &Study) -> String {
    let has_no_result = |log: &&LogStudy| {
        log.halves.is_none()
            && log.methods.iter().all(|row| row.differences.is_empty())
            && log.altered_differences().next().is_none()
            && log.outages.is_none()
            && log.free.is_none()
    };
    let names: Vec<&str> = (study.logs.iter().filter(has_no_result))
        .map(|log| log.log.as_str())
        .collect();
    if names.is_empty() {
        return String::new();
    }
    format!("No test says anything of {}.\n\n", names.join(", "))
}

const ALTERED: &str = "ALTERED: each log in ten ways whose effect is known (stamps, biases, mount, fewer \
    fixes or samples, no height,\nno vertical velocity, the world turned): latency and biases less what they \
    should be, in joint sigmas, of what is\nobservable in both. They share the noise of the log: well below 1 is \
    right. Lost: not observable any more.";

const FREE: &str = "FREE INS: horizontal velocity error over a minute, RMS, m/s, sensors as \
    logged and with the estimates.\nA summary counts the logs where it is better with them, of \
    those where anything is observable.";

const WITHOUT: &str = "PARAMETERS: the core with one held at zero: itself with it minus without \
    in joint sigmas (as METHODS),\nhalves without it, and drift without it over drift with it \
    (geometric mean). What does not pay here, on judges, goes.";

/// Rows of the logs of each role, then their summary.
fn by_role(
    study: &Study,
    log: impl Fn(&LogStudy) -> Option<Vec<String>>,
    total: impl Fn(&Summary) -> Vec<String>,
) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for summary in study.summaries.iter().filter(|summary| summary.logs > 0) {
        for study in study.logs.iter().filter(|log| log.role == summary.role) {
            if let Some(row) = log(study) {
                rows.push(with_name(&study.log, row));
            }
        }
        let name = format!("= {}", side(summary.role));
        rows.push(with_name(&name, total(summary)));
    }
    rows
}

fn side(role: Role) -> &'static str {
    match role {
        Role::Development => "development",
        Role::Judge => "judges",
    }
}

fn with_name(name: &str, mut row: Vec<String>) -> Vec<String> {
    row.insert(0, name.to_owned());
    row
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))
}

fn statistics_cells(all: &Statistics) -> Vec<String> {
    vec![
        all.count.to_string(),
        number(all.rms),
        number(all.rms_plain),
        all.beyond_3.to_string(),
        all.beyond_4.to_string(),
    ]
}

/// The difference, with its sigmas in brackets.
fn cell(difference: &Difference) -> String {
    let sigma = libm::hypot(difference.joint_sigma, difference.allowance);
    let (value, sigmas) = (difference.value, difference.sigmas);
    format!("{} ({sigmas:+.1})", digits(sigma, value))
}

fn halves_table(study: &Study) -> Table {
    let mut header = heads("| n | RMS | plain | >3 | >4");
    let names = heads(
        "latency_ms | accel_x_mg | accel_y_mg | accel_z_mg | lever_right_m | lever_forward_m \
         | lever_up_m",
    );
    header.extend(names.iter().cloned());
    let log = |log: &LogStudy| {
        let halves = log.halves.as_ref()?;
        let mut row = statistics_cells(&Statistics::of(halves.iter()));
        row.extend(names.iter().map(|name| {
            let found = halves.iter().find(|difference| difference.name == *name);
            found.map_or_else(|| "-".to_owned(), cell)
        }));
        Some(row)
    };
    let title = format!(
        "HALVES: second minus first half, in sigmas of what both state, of what is observable in \
         both.\nAllowed besides: {}.\nPlain: as found and as stated, nothing allowed, nothing \
         carried.",
        halves::ALLOWANCE
    );
    let rows = by_role(study, log, |summary| statistics_cells(&summary.halves));
    Table::of(title, header, rows)
}

fn methods_table(study: &Study) -> Table {
    let header = heads("| n | RMS | plain | >3 | >4 | beyond 3");
    let mut names: Vec<&String> = Vec::new();
    for (name, _) in study.summaries.iter().flat_map(|summary| &summary.methods) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut rows = Vec::new();
    for name in names {
        rows.push(vec![format!("-- {name}")]);
        let log = |log: &LogStudy| {
            let agreement = log.methods.iter().find(|row| row.with == *name)?;
            let mut row = statistics_cells(&Statistics::of(agreement.differences.iter()));
            row.push(large_differences(&agreement.differences));
            Some(row)
        };
        let total = |summary: &Summary| {
            let of_it = summary.methods.iter().find(|(with, _)| with == name);
            of_it.map_or_else(Vec::new, |(_, all)| statistics_cells(all))
        };
        rows.extend(by_role(study, log, total));
    }
    let title = format!(
        "METHODS: the core minus another at the end of the log, in joint sigmas, of what both \
         call observable.\nAllowed besides: {ALLOWANCE}."
    );
    Table::of(title, header, rows)
}

/// Differences beyond three sigmas.
fn large_differences(differences: &[Difference]) -> String {
    let large = differences.iter().filter(|d| d.sigmas.abs() > 3.0);
    let texts: Vec<String> = large.map(|d| format!("{} {}", d.name, cell(d))).collect();
    texts.join(", ")
}

fn altered_table(study: &Study) -> Table {
    let header = heads("| n | RMS | >3 | >4 | lost | largest");
    // There are no allowances.
    let cells_of = |all: &Statistics| {
        let mut cells = statistics_cells(all);
        cells.remove(2);
        cells
    };
    let log = |log: &LogStudy| {
        let all = (log.altered.iter())
            .flat_map(|altered| altered.differences.iter().map(move |d| (altered.how, d)));
        let largest = all.max_by(|a, b| a.1.sigmas.abs().total_cmp(&b.1.sigmas.abs()));
        let lost: usize = log.altered.iter().map(|altered| altered.lost).sum();
        let mut row = cells_of(&Statistics::of(log.altered_differences()));
        row.push(lost.to_string());
        row.push(largest.map_or_else(String::new, |(how, largest)| {
            format!("{} {}: {how}", largest.name, cell(largest))
        }));
        (largest.is_some() || lost > 0).then_some(row)
    };
    let total = |summary: &Summary| cells_of(&summary.altered);
    Table::of(ALTERED, header, by_role(study, log, total))
}

fn outages_table(study: &Study) -> Table {
    let header = heads("| outages | core | Kalman | fusion-nav | core/Kalman | core/better");
    let log = |log: &LogStudy| {
        let outages = log.outages.as_ref()?;
        Some(vec![
            outages.count.to_string(),
            brief(outages.core_m),
            brief(outages.kalman_m),
            outages.fusion_nav_m.map_or_else(|| "-".to_owned(), brief),
            number(Some(outages.core_m / outages.kalman_m)),
            number(Some(outages.core_m / outages.better_m())),
        ])
    };
    let total = |summary: &Summary| {
        let outages = &summary.outages;
        let mut row = vec![format!("best on {} of {}", outages.best, outages.logs)];
        row.extend([const { String::new() }; 3]);
        row.extend([outages.core_over_kalman, outages.core_over_better].map(number));
        row
    };
    let title = format!(
        "OUTAGES of {OUTAGE_S:.0} s: position at the end, RMS, m. A summary has the geometric means \
         of the ratios,\nand on how many logs the core drifts no more than the better of the others."
    );
    Table::of(title, header, by_role(study, log, total))
}

fn free_table(study: &Study) -> Table {
    let header = heads("| before | after |");
    let log = |log: &LogStudy| {
        let free = log.free?;
        let verdict = match (free.observable, free.after_mps < free.before_mps) {
            (false, _) => "nothing observable",
            (true, true) => "better",
            (true, false) => "NOT BETTER",
        };
        Some(cells([
            &brief(free.before_mps),
            &brief(free.after_mps),
            verdict,
        ]))
    };
    let total = |summary: &Summary| {
        let [better, of] = summary.free_better;
        cells(["", "", &format!("{better} of {of}")])
    };
    Table::of(FREE, header, by_role(study, log, total))
}

fn without_table(study: &Study) -> Table {
    let header = heads("| n | RMS | plain | >3 | >4 | halves RMS | plain | >3 | drift ratio");
    let mut rows = Vec::new();
    for summary in study.summaries.iter().filter(|summary| summary.logs > 0) {
        let role = side(summary.role);
        let halves = |halves: &Statistics| {
            vec![
                number(halves.rms),
                number(halves.rms_plain),
                halves.beyond_3.to_string(),
            ]
        };
        let mut all = vec![String::new(); 5];
        all.extend(halves(&summary.halves));
        all.push("1".to_owned());
        rows.push(with_name(&format!("{role}: with all"), all));
        for without in &summary.without {
            let mut row = statistics_cells(&without.agreement);
            row.extend(halves(&without.halves));
            row.push(number(without.outage_ratio));
            rows.push(with_name(&format!("{role}: no {}", without.parameter), row));
        }
    }
    Table::of(WITHOUT, header, rows)
}

fn wander_table(study: &Study) -> Table {
    let of_log = |log: &LogStudy| Some((log.log.clone(), log.wander?));
    let logs: Vec<_> = study.logs.iter().filter_map(of_log).collect();
    wander::table(&logs)
}

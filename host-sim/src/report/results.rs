//! The results as tables.

use ins_core::{Observability, Phase};

use crate::identify::analysis::Analysis;
use crate::identify::error_model::Sensors;
use crate::identify::quantities::{Quantity, in_axes};
use crate::identify::true_errors::Truth;
use crate::identify::{held_ins, words};
use crate::page::number::to_second_digit_of as digits;
use crate::page::table::{Table, heads};

/// Sigmas that an error may have.
const SURE: f64 = 4.5;
/// Sigmas that a value must have to be told from zero.
const DISTINCT: f64 = 2.0;

/// All tables of a log; those without rows are left out.
pub(super) fn tables(analysis: &Analysis, sensors: Option<&Sensors>) -> Vec<Table> {
    let mut tables = vec![results(analysis), free(analysis), against_truth(analysis)];
    if let Some(sensors) = sensors {
        tables.push(Table {
            title: "Error model of the sensors, 95 % interval".to_owned(),
            ..sensors.model.table()
        });
    }
    tables.push(not_used(analysis));
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// How far the navigator came, if not all the way, and what speaks against its estimates or the log.
pub(super) fn verdicts(analysis: &Analysis) -> Vec<String> {
    let phase = analysis.found.end.phase;
    let unaligned = (phase != Phase::Navigating).then(|| words::unaligned(phase).to_owned());
    let summary = &analysis.summary;
    let against = summary.verdict.against.iter().chain(&summary.warnings);
    unaligned.into_iter().chain(against.cloned()).collect()
}

fn results(analysis: &Analysis) -> Table {
    let (summary, axes) = (&analysis.summary, analysis.summary.body_axes);
    let truths = analysis
        .truth
        .as_ref()
        .map(Truth::columns)
        .unwrap_or_default();
    let told = in_axes(axes, &analysis.found.end.estimates.lever_arm_m, 1.0);
    let (q, bias) = (&summary.quantities, "subtract from readings");
    let mut rows = vec![
        Row::new(
            "Azimuth error, clockwise",
            q.azimuth_error_deg,
            "deg",
            "of the heading it started with, carried on",
        ),
        Row::new(
            "Heading at the end, from north",
            summary.heading_end_deg,
            "deg",
            "",
        ),
    ];
    rows[0].truth = truths[0];
    let kinds = [
        ("Accelerometer", &q.accel_bias_mg, "mg"),
        ("Gyro", &q.gyro_bias_deg_h, "deg/h"),
    ];
    for (first, (sensor, biases, unit)) in [1, 4].into_iter().zip(kinds) {
        for (axis, (name, quantity)) in biases.named().into_iter().enumerate() {
            let subject = format!("{sensor} bias {name}, {}", axes.direction(axis));
            let mut row = Row::new(&subject, *quantity, unit, bias);
            row.truth = truths[first + axis];
            rows.push(row);
        }
    }
    let latency = "a fix stamped t shows the motion at t minus this";
    rows.push(Row::new("GNSS latency", q.gnss_latency_ms, "ms", latency));
    rows[8].truth = truths[7];
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let subject = format!("Antenna {name}, {}", axes.direction(axis));
        rows.push(match &summary.lever_arm_m {
            Some(arm) => Row::new(
                &subject,
                *arm.named()[axis].1,
                "m",
                "from the inertial sensors",
            ),
            None => Row::configured(&subject, told.named()[axis].1.value),
        });
    }
    let known = analysis.truth.is_some();
    let mut header = heads("| estimate | unit");
    if known {
        header.extend(heads("truth | error | error / sigma"));
    }
    header.push("remark".to_owned());
    let rows = rows.iter().map(|row| row.cells(known)).collect();
    Table::new("Results", header, rows)
}

struct Row<'a> {
    subject: String,
    quantity: Quantity,
    unit: &'a str,
    truth: Option<f64>,
    remark: &'a str,
    estimated: bool,
}

impl<'a> Row<'a> {
    fn new(subject: &str, quantity: Quantity, unit: &'a str, remark: &'a str) -> Self {
        Self {
            subject: subject.to_owned(),
            quantity,
            unit,
            truth: None,
            remark,
            estimated: true,
        }
    }

    /// What the navigator was told, or took for granted.
    fn configured(subject: &str, value_m: f64) -> Self {
        let quantity = Quantity {
            value: value_m,
            sigma: 0.0,
            observability: Observability::Observable,
        };
        Self {
            estimated: false,
            ..Self::new(subject, quantity, "m", "as configured, not estimated")
        }
    }

    fn cells(&self, known: bool) -> Vec<String> {
        let q = &self.quantity;
        let estimate = match (self.estimated, q.observable()) {
            (false, _) => format!("{:.3}", q.value),
            (true, true) => words::with_sigma(q),
            (true, false) => "not observable".to_owned(),
        };
        let mut cells = vec![self.subject.clone(), estimate, self.unit.to_owned()];
        let error = self
            .truth
            .filter(|_| q.observable())
            .map(|truth| q.value - truth);
        if known {
            let shown = [self.truth, error].map(|v| v.map(|v| digits(q.sigma, v)));
            cells.extend(shown.map(Option::unwrap_or_default));
            cells.push(error.map_or_else(String::new, |e| format!("{:.1}", e / q.sigma)));
        }
        cells.push(self.remark(error).to_owned());
        cells
    }

    fn remark(&self, error: Option<f64>) -> &str {
        let q = &self.quantity;
        match error {
            _ if !q.observable() => q.observability.why(),
            Some(error) if error.abs() > SURE * q.sigma => "wrong by more than its sigma allows",
            _ if q.value.abs() < DISTINCT * q.sigma => "not distinct from zero",
            _ => self.remark,
        }
    }
}

/// A free INS over windows of a minute.
fn free(analysis: &Analysis) -> Table {
    let errors = &analysis.summary.velocity_error_mps;
    let row = |name: &str, value: f64| vec![name.to_owned(), digits(value, value)];
    let rows = match (errors.before, errors.after) {
        (Some(before), Some(after)) => vec![
            row("sensors as logged", before),
            row("estimates applied", after),
        ],
        _ => Vec::new(),
    };
    let title = format!(
        "Free INS: horizontal velocity error over a minute, RMS of {} windows",
        errors.windows
    );
    Table::new(&title, heads("| m/s"), rows)
}

fn against_truth(analysis: &Analysis) -> Table {
    let row = |name: &str, error: &held_ins::LevelError| {
        let numbers = [error.position_m, error.velocity_mps].map(|v| digits(v, v));
        let [position, velocity] = numbers;
        vec![name.to_owned(), position, velocity]
    };
    let rows = analysis.summary.against_truth.as_ref().map(|errors| {
        vec![
            row("damped by GNSS", &errors.damped),
            row("free, less the errors known by then", &errors.free),
            row("free, readings as logged", &errors.as_logged),
        ]
    });
    Table::new(
        "Against the truth of the log: horizontal errors over its second half, RMS, at true height",
        heads("| position, m | velocity, m/s"),
        rows.unwrap_or_default(),
    )
}

fn not_used(analysis: &Analysis) -> Table {
    let fixes = analysis.found.gnss_outcomes();
    let samples = (analysis.found.imu_outcomes.iter())
        .filter(|(outcome, _)| !words::is_integrated(*outcome))
        .map(|(outcome, count)| ("inertial samples", *count, words::of_sample(*outcome)));
    let fixes = (fixes.iter())
        .filter(|(outcome, _)| !words::is_used(*outcome))
        .map(|(outcome, count)| ("fixes", *count, words::of_fix(*outcome)));
    let rows = samples
        .chain(fixes)
        .map(|(what, count, why)| vec![what.to_owned(), count.to_string(), why.to_owned()]);
    let rows = rows.collect();
    Table::new("What was not used", heads("| number | why"), rows)
}

//! The results as tables.

use ins_core::Observability;

use crate::identify::analysis::Analysis;
use crate::identify::baro_aided_ins::HorizontalError;
use crate::identify::error_model::Sensors;
use crate::identify::quantities::{QUANTITIES, Quantity, axis_name, in_axes, title};
use crate::identify::true_errors::Truth;
use crate::identify::words;
use crate::page::table::{Table, heads};
use crate::page::{brief, digits, fixed};

/// Largest plausible error, sigmas.
const GROSS: f64 = 4.5;
/// Least value that is distinct from zero, sigmas.
const DISTINCT: f64 = 2.0;
/// Name of the row of the heading.
const HEADING: &str = "Heading at the end, from north";

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

fn results(analysis: &Analysis) -> Table {
    let (summary, axes) = (&analysis.summary, analysis.summary.body_axes);
    let truths = analysis
        .truth
        .as_ref()
        .map(Truth::columns)
        .unwrap_or_default();
    let mut rows = Vec::new();
    for (index, (_, quantity)) in (summary.quantities.columns().into_iter()).enumerate() {
        let (more, remark) = match index {
            0 => (", clockwise", "of the heading it started with, carried on"),
            7 => ("", "a fix stamped t shows the motion at t minus this"),
            _ => ("", "subtract from readings"),
        };
        let name = title(index, axes) + more;
        rows.push(Row {
            truth: truths[index],
            ..Row::new(name, quantity, QUANTITIES[index].2, remark)
        });
    }
    rows.insert(
        1,
        Row::new(HEADING.to_owned(), summary.heading_end_deg, "deg", ""),
    );
    let lever_arm = in_axes(axes, &analysis.found.end.estimates.lever_arm_m, 1.0);
    for axis in 0..3 {
        let name = format!("Antenna {}", axis_name(axis, axes));
        rows.push(match &summary.lever_arm_m {
            Some(arm) => Row::new(name, arm.each()[axis], "m", "from the inertial sensors"),
            None => Row::configured(name, lever_arm.each()[axis].value),
        });
    }
    let receiver = [
        (
            "Latency drift",
            summary.gnss_latency_drift_ppm,
            "ppm",
            "what the inertial clock loses on the receiver's",
        ),
        (
            "Position delay",
            summary.gnss_position_delay_ms,
            "ms",
            "later than velocity",
        ),
        (
            "Smoothing",
            summary.gnss_smoothing_s2,
            "s^2",
            "T^2/12 of a mean over T",
        ),
    ];
    rows.extend(receiver.map(|(name, quantity, unit, remark)| {
        Row::new(format!("{name} of the receiver"), quantity, unit, remark)
    }));
    let known = analysis.truth.is_some();
    let mut header = heads("| estimate | unit");
    if known {
        header.extend(heads("truth | error | error / sigma"));
    }
    header.push("remark".to_owned());
    Table::of("Results", header, rows.iter().map(|row| row.cells(known)))
}

struct Row<'a> {
    name: String,
    quantity: Quantity,
    unit: &'a str,
    truth: Option<f64>,
    remark: &'a str,
    estimated: bool,
}

impl<'a> Row<'a> {
    fn new(name: String, quantity: Quantity, unit: &'a str, remark: &'a str) -> Self {
        Self {
            name,
            quantity,
            unit,
            truth: None,
            remark,
            estimated: true,
        }
    }

    /// A configured value, not estimated.
    fn configured(name: String, value_m: f64) -> Self {
        let quantity = Quantity {
            value: value_m,
            sigma: 0.0,
            observability: Observability::Observable,
        };
        Self {
            estimated: false,
            ..Self::new(name, quantity, "m", "as configured, not estimated")
        }
    }

    fn cells(&self, known: bool) -> Vec<String> {
        let q = &self.quantity;
        let estimate = match (self.estimated, q.observable()) {
            (false, _) => fixed(3, q.value),
            (true, true) => words::with_sigma(q),
            (true, false) => "not observable".to_owned(),
        };
        let mut cells = vec![self.name.clone(), estimate, self.unit.to_owned()];
        let error = self
            .truth
            .filter(|_| q.observable())
            .map(|truth| q.value - truth);
        if known {
            let shown = [self.truth, error].map(|v| v.map(|v| digits(q.sigma, v)));
            cells.extend(shown.map(Option::unwrap_or_default));
            cells.push(error.map_or_else(String::new, |e| fixed(1, e / q.sigma)));
        }
        cells.push(self.remark(error).to_owned());
        cells
    }

    fn remark(&self, error: Option<f64>) -> &str {
        let q = &self.quantity;
        match error {
            _ if !q.observable() => q.observability.why(),
            Some(error) if error.abs() > GROSS * q.sigma => "wrong by more than its sigma allows",
            // Zero is no special heading.
            _ if self.name == HEADING => self.remark,
            _ if q.value.abs() < DISTINCT * q.sigma => "not distinct from zero",
            _ => self.remark,
        }
    }
}

/// A free INS over windows of a minute.
fn free(analysis: &Analysis) -> Table {
    let errors = &analysis.summary.velocity_error_mps;
    let rows = [
        ("sensors as logged", errors.before),
        ("estimates applied", errors.after),
    ];
    let rows =
        (rows.into_iter()).filter_map(|(name, value)| Some(vec![name.to_owned(), brief(value?)]));
    let title = format!(
        "Free INS: horizontal velocity error over a minute, RMS of {} windows",
        errors.windows
    );
    Table::of(title, heads("| m/s"), rows)
}

fn against_truth(analysis: &Analysis) -> Table {
    let row = |(name, error): (&str, HorizontalError)| {
        let [position, velocity] = [error.position_m, error.velocity_mps].map(brief);
        vec![name.to_owned(), position, velocity]
    };
    let rows = analysis.summary.against_truth.iter().flat_map(|errors| {
        [
            ("damped by GNSS", errors.damped),
            ("free, less the errors known by then", errors.free),
            ("free, readings as logged", errors.as_logged),
        ]
    });
    Table::of(
        "Against the truth of the log: horizontal errors over its second half, RMS, at true height",
        heads("| position, m | velocity, m/s"),
        rows.map(row),
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
    Table::of("What was not used", heads("| number | why"), rows)
}

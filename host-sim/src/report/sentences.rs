//! What the estimates mean, in plain words.

use ins_core::Phase;

use super::number::to_second_digit_of;
use crate::against_truth::TruthErrors;
use crate::held_ins::Error;
use crate::identify::Identification;
use crate::log::BodyAxes;
use crate::quantities::Quantity;
use crate::summary::Summary;

/// One sentence for each estimate.
pub fn sentences(summary: &Summary, found: &Identification) -> Vec<String> {
    let (q, axes) = (&summary.quantities, summary.body_axes);
    let mut sentences = vec![
        told("Azimuth", &q.azimuth_error_deg, azimuth),
        told("Heading at the end", &summary.heading_end_deg, |q| {
            format!("{} deg clockwise from north", with_sigma(q))
        }),
    ];
    for (axis, (name, quantity)) in q.accel_bias_mg.named().into_iter().enumerate() {
        let subject = format!("Accelerometer {name} ({})", across(axes, axis));
        sentences.push(told(&subject, quantity, |q| bias(q, "mg", "")));
    }
    for (axis, (name, quantity)) in q.gyro_bias_deg_h.named().into_iter().enumerate() {
        let subject = format!("Gyro {name} ({})", about(axes, axis));
        sentences.push(told(&subject, quantity, |q| {
            bias(q, "deg/h", &per_second(q))
        }));
    }
    sentences.push(told("GNSS latency", &q.gnss_latency_ms, latency));
    if found.end.phase != Phase::Navigating {
        sentences.insert(0, unaligned(found.end.phase).to_owned());
    }
    sentences
}

/// What the estimates are worth.
pub(super) fn verdict(summary: &Summary) -> String {
    let errors = &summary.velocity_error_mps;
    match (errors.before, errors.after) {
        (Some(before), Some(after)) => format!(
            "A free INS on these sensors gains {} m/s of horizontal velocity error (RMS over a \
             minute, {} windows) as logged, and {} m/s with the estimates applied: {} times less.",
            to_second_digit_of(before, before),
            errors.windows,
            to_second_digit_of(after, after),
            to_second_digit_of(before / after, before / after)
        ),
        _ => "No minute of navigation in this log to try the estimates on.".to_owned(),
    }
}

/// How far off the solution is, damped and free.
pub(super) fn against_truth(errors: &TruthErrors) -> String {
    let off = |error: &Error| {
        format!(
            "{} m and {} m/s",
            to_second_digit_of(error.position_m, error.position_m),
            to_second_digit_of(error.velocity_mps, error.velocity_mps)
        )
    };
    format!(
        "Horizontal errors over the second half (RMS): {} damped by GNSS; {} free, on readings less \
         the biases known by then; {} free, on readings as logged. Height is held in all of them.",
        off(&errors.damped),
        off(&errors.free),
        off(&errors.as_logged)
    )
}

fn told(subject: &str, quantity: &Quantity, sentence: impl Fn(&Quantity) -> String) -> String {
    if quantity.observable() {
        format!("{subject}: {}.", sentence(quantity))
    } else {
        format!(
            "{subject}: not observable, {}.",
            quantity.observability.why()
        )
    }
}

fn azimuth(q: &Quantity) -> String {
    let side = if q.value > 0.0 {
        "clockwise"
    } else {
        "counter-clockwise"
    };
    format!(
        "the heading it started with was {} deg too far {side}",
        size(q)
    )
}

fn bias(q: &Quantity, unit: &str, aside: &str) -> String {
    let side = if q.value > 0.0 { "high" } else { "low" };
    let action = if q.value > 0.0 {
        "subtract it"
    } else {
        "add it"
    };
    format!("reads {} {unit}{aside} too {side}; {action}", size(q))
}

fn per_second(q: &Quantity) -> String {
    // Consumer gyros are spoken of in degrees per second.
    let per_second = q.value.abs() / 3600.0;
    if per_second < 0.01 {
        String::new()
    } else {
        format!(" ({per_second:.3} deg/s)")
    }
}

fn latency(q: &Quantity) -> String {
    if q.value > 0.0 {
        format!("a fix shows the motion {} ms before its stamp", size(q))
    } else {
        format!(
            "inertial stamps are {} ms later than those of GNSS",
            size(q)
        )
    }
}

fn across(axes: BodyAxes, axis: usize) -> String {
    format!("positive {}", axes.direction(axis))
}

fn about(axes: BodyAxes, axis: usize) -> String {
    format!("about {}", axes.direction(axis))
}

pub(crate) fn unaligned(phase: Phase) -> &'static str {
    match phase {
        Phase::Levelling => "Never levelled: the log is too short or too restless.",
        _ => {
            "Heading never found: it needs a start or a braking with GNSS velocity, gyros that \
             feel Earth rate, or initial_heading_deg in meta.toml."
        }
    }
}

/// Value and spread, the sign of the value left out.
fn size(q: &Quantity) -> String {
    with_sigma(&Quantity {
        value: q.value.abs(),
        ..*q
    })
}

/// Value and spread, or why there is none.
pub(crate) fn in_words(q: &Quantity) -> String {
    if q.observable() {
        with_sigma(q)
    } else {
        q.observability.why().to_owned()
    }
}

/// Both to the second digit of the spread.
pub(crate) fn with_sigma(q: &Quantity) -> String {
    format!(
        "{} \u{b1} {}",
        to_second_digit_of(q.sigma, q.value),
        to_second_digit_of(q.sigma, q.sigma)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use ins_core::Observability;

    fn quantity(value: f64, sigma: f64) -> Quantity {
        Quantity {
            value,
            sigma,
            observability: Observability::Observable,
        }
    }

    #[test]
    fn sentences_say_what_to_do() {
        let high = told("Accelerometer x", &quantity(3.04, 0.1), |q| {
            bias(q, "mg", "")
        });
        assert_eq!(
            high,
            "Accelerometer x: reads 3.04 \u{b1} 0.10 mg too high; subtract it."
        );
        let low = told("Gyro z", &quantity(-720.0, 31.0), |q| {
            bias(q, "deg/h", &per_second(q))
        });
        assert_eq!(
            low,
            "Gyro z: reads 720 \u{b1} 31 deg/h (0.200 deg/s) too low; add it."
        );
        let late = told("GNSS latency", &quantity(-78.0, 2.0), latency);
        assert_eq!(
            late,
            "GNSS latency: inertial stamps are 78.0 \u{b1} 2.0 ms later than those of GNSS."
        );
        let missing = Quantity {
            observability: Observability::NeedsTurn,
            ..quantity(1.0, 2.0)
        };
        assert_eq!(
            told("Gyro z", &missing, latency),
            "Gyro z: not observable, needs a turn."
        );
    }
}

//! Whether a log can be meant as it stands: units, axes, time scales.

use ins_core::ImuOutput;
use nalgebra::Vector3;

use super::Log;
use super::axes::BodyAxes;
use super::clock::set_clock;
use super::error::LogError;
use super::findings::Findings;
use super::fixes::mend_fixes;
use super::motion::check_axes;
use super::paths::check_paths;
use super::rates::Rates;
use super::readings::check_readings;
use super::sensors::mend_sensors;
use super::turns::{check_turns, turning};
use super::typical::{SHORT_S, median_interval_s, within};

const GRAVITY_MPS2: f64 = 9.81;

/// Refuses what cannot be meant, warns of what looks suspicious.
pub(super) fn check(log: &mut Log, findings: &mut Findings) -> Result<(), LogError> {
    let interval_s = median_interval_s(log.imu.times());
    check_intervals(log, interval_s, findings)?;
    mend_fixes(log, findings)?;
    let mut rates = Rates::of(log, interval_s);
    check_accelerometer_unit(log, &rates, findings)?;
    let per_second = match log.meta.imu {
        ImuOutput::Rates => 1.0,
        ImuOutput::Increments => 1.0 / interval_s,
    };
    if mend_sensors(log, per_second, findings)? {
        rates = Rates::of(log, median_interval_s(log.imu.times()));
    }
    check_gravity_axis(log, &rates, findings)?;
    let together = set_clock(log, &rates, findings)?;
    let turning = turning(log, &rates);
    check_paths(log, turning.as_ref(), findings)?;
    check_turns(
        turning.as_ref(),
        together,
        log.duration_s(),
        &rates,
        findings,
    )?;
    let told = findings.warnings.len();
    check_axes(log, &rates, findings);
    // A track or gravity tells more exactly what the motion as a whole tells of any unit.
    if findings.warnings.len() == told {
        check_readings(log, &rates, findings)?;
    }
    Ok(())
}

fn check_intervals(log: &Log, imu: f64, findings: &mut Findings) -> Result<(), LogError> {
    let gnss = median_interval_s(log.gnss.iter().map(|fix| fix.time));
    let fixes_s = gnss * log.gnss.len() as f64;
    let found = |seconds: f64| {
        let digits = format!("{seconds:.6}");
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        format!("{digits} s from row to row (median)")
    };
    let refuse_imu = |cause: &str| {
        let expected = "inertial samples 1 to 100 ms apart";
        Err(findings.imu(expected, found(imu), cause).in_column("t_s"))
    };
    let refuse_gnss = |cause: &str| {
        let expected = "GNSS fixes 0.05 to 10 s apart";
        Err(findings.gnss(expected, found(gnss), cause).in_column("t_s"))
    };
    let milliseconds = "milliseconds for seconds: divide t_s by 1000";
    let nanoseconds = "microseconds or nanoseconds for seconds";
    // A strapdown needs ten samples a second at the very least; receivers give 0.1 to 20 fixes.
    match (imu, gnss) {
        (imu, _) if imu > 200.0 => refuse_imu(nanoseconds),
        (imu, _) if imu > 0.5 => refuse_imu(milliseconds),
        (_, gnss) if gnss > 20_000.0 => refuse_gnss(nanoseconds),
        (_, gnss) if gnss > 30.0 => refuse_gnss(milliseconds),
        (imu, _)
            if log.imu.len() > 1
                && (imu < 5e-5 || imu < 5e-4 && fixes_s > 30.0 * log.duration_s()) =>
        {
            refuse_imu("minutes or kiloseconds for seconds, or stamps of too few digits")
        }
        _ => {
            if gnss > 3.0 {
                let found = format!("{gnss:.1} s from row to row (median)");
                let cause = "too seldom to show turns and brakings: estimates come late, if at all";
                let expected = "GNSS fixes 0.05 to 2 s apart";
                let defect = findings.gnss(expected, found, cause);
                findings.warn(defect.in_column("t_s"));
            }
            if log.duration_s() < SHORT_S {
                let found = format!("{:.1} s", log.duration_s());
                let cause = "too short to align and to manoeuvre: nothing can be found";
                let expected = "a minute of motion and more";
                findings.warn(findings.imu(expected, found, cause));
            }
            Ok(())
        }
    }
}

fn check_accelerometer_unit(
    log: &Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let (norm, interval) = (rates.typical.force_norm_mps2, rates.typical.interval_s);
    let expected = "a median specific force near 9.81 m/s^2";
    // Beyond a fifth no unit is near, but a racing multirotor is; a unit is off by three times.
    if within(norm, GRAVITY_MPS2, 2.0) {
        // 5 %: twice the worst scale error and bias of consumer sensors.
        if !within(norm, GRAVITY_MPS2, 1.05) {
            let cause = "a large scale error, or a vehicle that turns and accelerates throughout";
            let found = format!("{norm:.3} m/s^2");
            findings.warn(findings.imu(expected, found, cause).in_column("accel"));
        }
        return Ok(());
    }
    let g = GRAVITY_MPS2;
    let guesses = match log.meta.imu {
        ImuOutput::Rates => [
            (1.0, "g for m/s^2: multiply by 9.80665"),
            (1000.0, "mg for m/s^2: multiply by 0.00980665"),
            (
                g * interval,
                "increments for rates: say imu = \"increments\" in meta.toml",
            ),
        ],
        ImuOutput::Increments => [
            (1.0, "g s for m/s: multiply by 9.80665"),
            (1000.0, "mg s for m/s: multiply by 0.00980665"),
            (
                g / interval,
                "rates for increments: say imu = \"rates\" in meta.toml",
            ),
        ],
    };
    let fitting: Vec<_> = guesses
        .iter()
        .filter(|(value, _)| within(norm, *value, 1.3))
        .collect();
    // Increments and rates are mistaken in the gyros too, units of the accelerometers are not.
    let sound = turning(log, rates)
        .filter(|fit| fit.correlation.abs() > 0.8)
        .is_some_and(|fit| within(fit.slope.abs(), 1.0, 1.5));
    let likeliest = if sound {
        fitting.first()
    } else {
        fitting.last()
    };
    let other = "another unit, or not the accelerometer's columns";
    let cause = likeliest.map_or(other, |(_, cause)| cause);
    let found = format!("{norm:.4}");
    let expected = match log.meta.imu {
        ImuOutput::Rates => expected,
        ImuOutput::Increments => "a median specific force (increment / interval) near 9.81 m/s^2",
    };
    Err(findings.imu(expected, found, cause).in_column("accel"))
}

fn check_gravity_axis(log: &Log, rates: &Rates, findings: &mut Findings) -> Result<(), LogError> {
    // Over minutes the vehicle's own accelerations cancel, and what is left points up.
    let mean = rates.typical.force_mps2;
    let axes = log.meta.body_axes;
    let tilt_deg = (mean.z / mean.norm()).clamp(-1.0, 1.0).acos().to_degrees();
    // Banked turns keep the mean along the aircraft's up axis, so only a mount tilts it.
    if tilt_deg < 30.0 {
        return Ok(());
    }
    let own = axes.from_rfu(mean);
    let axis = own.iamax();
    let sign = if own[axis] < 0.0 { '-' } else { '+' };
    let found = format!(
        "{sign}{:.2} m/s^2 on {}, median of the log ({:.2}, {:.2}, {:.2})",
        own[axis].abs(),
        ["x", "y", "z"][axis],
        own.x,
        own.y,
        own.z
    );
    let z = axes.direction(2);
    let reaction = if z == "up" { '+' } else { '-' };
    let expected = format!("gravity's reaction, {reaction}9.81 m/s^2, on z ({z} in {axes})");
    let defect = findings
        .imu(expected, found, gravity_cause(own, axes))
        .in_column("accel");
    // A sensor may well be mounted tilted; beyond 60 degrees another axis is the vertical one.
    if tilt_deg > 60.0 {
        return Err(defect);
    }
    findings.warn(LogError {
        cause: format!("sensors mounted {tilt_deg:.0} deg off level; if not, turn the axes").into(),
        ..defect
    });
    Ok(())
}

fn gravity_cause(own: Vector3<f64>, declared: BodyAxes) -> String {
    let fits: Vec<String> = BodyAxes::ALL
        .into_iter()
        .filter(|axes| axes.to_rfu(own).z > 0.5 * own.norm())
        .map(|axes| format!("\"{axes}\""))
        .collect();
    if fits.is_empty() {
        let axis = ["x", "y", "z"][own.iamax()];
        return format!(
            "wrong axes: {axis} is the vertical axis, and no body_axes has it there: reorder the \
             columns to {declared}"
        );
    }
    format!(
        "wrong axes or sign: body_axes = {} would fit; or else gravity is logged instead of \
         specific force: change the sign of all three accelerometers",
        fits.join(" or ")
    )
}

//! Signs and axes of the sensors against the motion that GNSS and the sensors themselves show.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::Log;
use super::axes::BodyAxes;
use super::curve::{Curve, turned};
use super::findings::Findings;
use super::rates::{Rate, Rates};
use super::turns::legs;
use crate::statistics::Line;

/// Correlation from which on a sign is beyond doubt, with the least number of intervals.
const CLEAR: f64 = 0.6;
const INTERVALS: usize = 30;

/// Warns where accelerometers show the motion in other axes than they are said to have.
pub(super) fn check_axes(log: &Log, rates: &Rates, findings: &mut Findings) {
    if let Some(correlation) = along_the_track(log, rates) {
        check_level_axes(log, &correlation, findings);
    }
    check_turning_gravity(log, rates, findings);
}

/// Accelerations right and forward: felt, and seen by GNSS.
type Pair = (Vector2<f64>, Vector2<f64>);

/// Correlations of the accelerations right and forward by the sensors (rows) with those by GNSS
/// (columns), for a vehicle that follows its nose; none without manoeuvres.
fn along_the_track(log: &Log, rates: &Rates) -> Option<Matrix2<f64>> {
    let mut curves: [Curve; 2] = Default::default();
    let mut sum = Vector3::zeros();
    for rate in rates.iter() {
        sum += rate.accel_mps2 * rate.interval_s;
        for (axis, curve) in curves.iter_mut().enumerate() {
            curve.push(rate.time_s, sum[axis]);
        }
    }
    let mut pairs: Vec<Pair> = Vec::new();
    for [(from_s, before), (to_s, after)] in legs(log) {
        if curves[0].reaches(from_s) && curves[0].reaches(to_s) {
            let speed = 0.5 * (before.norm() + after.norm());
            let right = -speed * turned(before, after);
            let ahead = after.norm() - before.norm();
            let felt = |axis: usize| curves[axis].at(to_s) - curves[axis].at(from_s);
            let felt = Vector2::new(felt(0), felt(1));
            let seconds = to_s - from_s;
            pairs.push((felt / seconds, Vector2::new(right, ahead) / seconds));
        }
    }
    // Half a minute of accelerations above those that a slope of the road feigns.
    let strong = |axis: usize| pairs.iter().filter(|p| p.1[axis].abs() > 0.5).count();
    if strong(0) < INTERVALS || strong(1) < INTERVALS {
        return None;
    }
    // Turns that go with brakings tell nothing of which is which.
    let of = |pick: &dyn Fn(&Pair) -> (f64, f64)| {
        Line::through(&pairs.iter().map(pick).collect::<Vec<_>>()).correlation
    };
    if of(&|p| (p.1.x, p.1.y)).abs() > 0.5 {
        return None;
    }
    Some(Matrix2::from_fn(|row, column| {
        of(&|p| (p.0[row], p.1[column]))
    }))
}

fn check_level_axes(log: &Log, correlation: &Matrix2<f64>, findings: &mut Findings) {
    let c = correlation;
    let expected = "accelerometers that feel brakings forward and turns to the right";
    let mut warn = |found: String, cause: String| {
        let defect = findings.imu(expected, found, cause);
        findings.warn(defect.in_column("accel"));
    };
    let axes = log.meta.body_axes;
    let column = |rfu: usize| {
        let own = (0..3).find(|&axis| axes.rfu_component(axis).0 == rfu);
        ["accel_x", "accel_y", "accel_z"][own.unwrap_or(rfu)]
    };
    if c[(0, 1)].abs() > CLEAR && c[(1, 0)].abs() > CLEAR {
        let sign = |value: f64| if value < 0.0 { "-" } else { "" };
        let found = format!(
            "{}right where forward is, {}forward where right is (correlations {:.2}, {:.2})",
            sign(c[(0, 1)]),
            sign(c[(1, 0)]),
            c[(0, 1)],
            c[(1, 0)]
        );
        let fits = BodyAxes::ALL
            .into_iter()
            .find(|other| turned_by(axes, *other, c));
        let cause = match fits {
            Some(other) => format!(
                "body_axes = \"{other}\" would fit; as it is heading and the names of the axes \
                 are a quarter turn off"
            ),
            None => "columns of another order, or a unit mounted across".to_owned(),
        };
        warn(found, cause);
        return;
    }
    for (axis, name) in [(0, "right"), (1, "forward")] {
        if c[(axis, axis)] < -CLEAR {
            let other = c[(1 - axis, 1 - axis)];
            let cause = if other < -CLEAR {
                "mounted backwards, or both level accelerometers of the wrong sign: heading is \
                 half a turn off"
                    .to_owned()
            } else {
                format!("{} has the wrong sign", column(axis))
            };
            let found = format!("the opposite {name} (correlation {:.2})", c[(axis, axis)]);
            warn(found, cause);
            if other < -CLEAR {
                return;
            }
        }
    }
}

/// Whether columns in `other` axes that are read as `axes` would correlate with the signs of `c`.
fn turned_by(axes: BodyAxes, other: BodyAxes, c: &Matrix2<f64>) -> bool {
    (0..2).all(|felt| {
        let true_rfu = other.to_rfu(axes.from_rfu(Vector3::ith(felt, 1.0)));
        let seen = 1 - felt;
        true_rfu[seen] * c[(felt, seen)] > 0.5
    })
}

/// Gravity turns in the body as the gyros say: where they show plainly the opposite, one of the
/// two has a sign that it should not have.
fn check_turning_gravity(log: &Log, rates: &Rates, findings: &mut Findings) {
    let mut sums = [Turning::default(); 2];
    let mut last: Option<Block> = None;
    for block in blocks(rates) {
        if let Some(last) = last.replace(block) {
            for (axis, sums) in sums.iter_mut().enumerate() {
                sums.add(axis, &last, &block);
            }
        }
    }
    for ((axis, name), sums) in [(0, "right"), (1, "forward")].into_iter().zip(sums) {
        let Turning { xx, xy, yy, times } = sums;
        let correlation = xy / (xx * yy).sqrt();
        if times < INTERVALS || correlation > -CLEAR {
            continue;
        }
        let found = format!("the opposite {name} (correlation {correlation:.2})");
        let cause = format!(
            "the accelerometer {name} or the gyro {} has the wrong sign against body_axes = \"{}\"",
            if axis == 0 { "forward" } else { "right" },
            log.meta.body_axes
        );
        let expected = "gravity that turns in the body as the gyros say";
        let defect = findings.imu(expected, found, cause);
        findings.warn(defect.in_column("gyro, accel"));
    }
}

/// Shorter than an attitude changes, longer than vibration.
const BLOCK_S: f64 = 0.2;

/// Mean rate and specific force.
type Block = (Vector3<f64>, Vector3<f64>);

/// Change of gravity on an axis from block to block: by the gyros, and as felt.
#[derive(Clone, Copy, Default)]
struct Turning {
    xx: f64,
    xy: f64,
    yy: f64,
    /// Clear ones.
    times: usize,
}

impl Turning {
    fn add(&mut self, axis: usize, last: &Block, block: &Block) {
        let turned = -0.5 * (last.0 + block.0) * BLOCK_S;
        let force = 0.5 * (last.1 + block.1);
        let (x, y) = (turned.cross(&force)[axis], (block.1 - last.1)[axis]);
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        // A degree and a half in a block: far above a road's unevenness.
        self.times += usize::from(x.abs() > 0.25);
    }
}

/// Successive blocks.
fn blocks(rates: &Rates) -> impl Iterator<Item = Block> {
    #[allow(clippy::cast_possible_truncation)] // Seconds of a log.
    let number = |rate: &Rate| (rate.time_s / BLOCK_S) as i64;
    let mut rates = rates.iter().peekable();
    std::iter::from_fn(move || {
        let first = rates.next()?;
        let (mut gyro, mut accel, mut n) = (first.gyro_radps, first.accel_mps2, 1.0);
        while let Some(rate) = rates.next_if(|rate| number(rate) == number(&first)) {
            gyro += rate.gyro_radps;
            accel += rate.accel_mps2;
            n += 1.0;
        }
        Some((gyro / n, accel / n))
    })
}

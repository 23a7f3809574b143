//! A function of smooth steps, with its exact integral and derivatives.

use super::noise::Random;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Integral from zero.
    pub integral: f64,
    pub value: f64,
    pub slope: f64,
    pub curvature: f64,
}

/// A smooth step by `change`: its slope rises to `peak`, holds and falls again.
///
/// Rise and fall are quintic, so that slope, second and third derivative are continuous.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    start: f64,
    change: f64,
    peak: f64,
    rise: f64,
    hold: f64,
}

impl Step {
    /// `peak` is lowered if a rise and a fall alone make the change.
    fn new(start: f64, change: f64, peak: f64, rise: f64) -> Self {
        let peak = peak.abs().min(change.abs() / rise).copysign(change);
        let hold = if peak == 0.0 {
            0.0
        } else {
            change / peak - rise
        };
        Self {
            start,
            change,
            peak,
            rise,
            hold,
        }
    }

    fn length(&self) -> f64 {
        2.0 * self.rise + self.hold
    }

    /// The step's contribution `x` beyond its start.
    fn at(&self, x: f64) -> Point {
        let Self {
            peak, rise, hold, ..
        } = *self;
        let rise_area = rise * rise / 7.0;
        if x <= 0.0 {
            Point::default()
        } else if x < rise {
            let q = Quintic::at(x / rise);
            Point {
                integral: peak * rise * rise * q.double_integral,
                value: peak * rise * q.integral,
                slope: peak * q.value,
                curvature: peak * q.slope / rise,
            }
        } else if x < rise + hold {
            let y = x - rise;
            Point {
                integral: peak * (rise_area + 0.5 * y * (rise + y)),
                value: peak * (0.5 * rise + y),
                slope: peak,
                curvature: 0.0,
            }
        } else if x < self.length() {
            // The fall is the rise mirrored.
            let left = self.length() - x;
            let q = Quintic::at(left / rise);
            Point {
                integral: self.area() - self.change * left + peak * rise * rise * q.double_integral,
                value: self.change - peak * rise * q.integral,
                slope: peak * q.value,
                curvature: -peak * q.slope / rise,
            }
        } else {
            Point {
                integral: self.area() + self.change * (x - self.length()),
                value: self.change,
                ..Point::default()
            }
        }
    }

    /// Integral to the end; the step is symmetrical about its middle.
    fn area(&self) -> f64 {
        self.change * (self.rise + 0.5 * self.hold)
    }
}

/// The quintic from 0 to 1 on [0, 1] whose first two derivatives vanish at both ends.
struct Quintic {
    double_integral: f64,
    integral: f64,
    value: f64,
    slope: f64,
}

impl Quintic {
    fn at(u: f64) -> Self {
        let u2 = u * u;
        let u4 = u2 * u2;
        Self {
            double_integral: u4 * u * (0.5 + u * (u / 7.0 - 0.5)),
            integral: u4 * (2.5 + u * (u - 3.0)),
            value: u2 * u * (10.0 + u * (6.0 * u - 15.0)),
            slope: 30.0 * u2 * (1.0 - u) * (1.0 - u),
        }
    }
}

/// A start value and consecutive steps.
#[derive(Clone, Debug)]
pub struct Profile {
    segments: Vec<Segment>,
    cursor: usize,
}

/// From the start of a step to the start of the next.
#[derive(Clone, Copy, Debug)]
struct Segment {
    step: Step,
    integral_before: f64,
    value_before: f64,
    value_after: f64,
}

impl Segment {
    fn at(&self, x: f64) -> Point {
        let beyond = x - self.step.start;
        let added = self.step.at(beyond);
        Point {
            integral: self.integral_before + self.value_before * beyond + added.integral,
            // Not the sum after the step: a car that has stopped has exactly zero speed.
            value: if beyond < self.step.length() {
                self.value_before + added.value
            } else {
                self.value_after
            },
            ..added
        }
    }
}

impl Profile {
    /// A constant.
    pub fn new(value: f64) -> Self {
        let first = Segment {
            step: Step::new(0.0, 0.0, 0.0, 1.0),
            integral_before: 0.0,
            value_before: value,
            value_after: value,
        };
        Self {
            segments: vec![first],
            cursor: 0,
        }
    }

    pub fn last_value(&self) -> f64 {
        self.segments[self.segments.len() - 1].value_after
    }

    /// Adds a step from `start` to `value` with slope up to `peak` (its sign does not matter)
    /// that builds up over `rise`; returns where it is over.
    ///
    /// # Panics
    /// If it starts before the last one is over.
    pub fn step_to(&mut self, value: f64, start: f64, peak: f64, rise: f64) -> f64 {
        let last = self.segments[self.segments.len() - 1];
        let last_end = last.step.start + last.step.length();
        assert!(
            start >= last_end || self.segments.len() == 1,
            "step at {start} overlaps the one that ends at {last_end}"
        );
        let step = Step::new(start, value - last.value_after, peak, rise);
        self.segments.push(Segment {
            step,
            integral_before: last.at(start).integral,
            value_before: last.value_after,
            value_after: value,
        });
        start + step.length()
    }

    /// The same with a slope and a rise drawn between bounds.
    pub(super) fn step_drawn(
        &mut self,
        random: &mut Random,
        value: f64,
        start: f64,
        [peak, rise]: [[f64; 2]; 2],
    ) -> f64 {
        let (peak, rise) = (random.uniform(peak), random.uniform(rise));
        self.step_to(value, start, peak, rise)
    }

    /// The function at `x`; searched from the last segment, so cheap if `x` grows slowly.
    pub fn at(&mut self, x: f64) -> Point {
        while self.cursor > 0 && x < self.segments[self.cursor].step.start {
            self.cursor -= 1;
        }
        while self
            .segments
            .get(self.cursor + 1)
            .is_some_and(|next| x >= next.step.start)
        {
            self.cursor += 1;
        }
        self.segments[self.cursor].at(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile() -> Profile {
        let mut profile = Profile::new(3.0);
        // With a hold, without one (the peak is lowered), downwards to zero.
        profile.step_to(7.0, 1.0, 1.5, 0.9);
        profile.step_to(7.1, 10.0, 2.0, 1.1);
        profile.step_to(0.0, 13.0, 2.0, 1.0);
        profile
    }

    #[test]
    fn derivatives_agree_with_differences() {
        const H: f64 = 1e-4;
        let mut profile = profile();
        for x in (1..2000).map(|k| f64::from(k) * 0.01) {
            let [before, now, after] = [x - H, x, x + H].map(|x| profile.at(x));
            // h^2/6 of the third derivative of a quintic rise within 1 s: below 1e-6.
            assert!((after.integral - before.integral - 2.0 * H * now.value).abs() < 1e-9);
            assert!((after.value - before.value - 2.0 * H * now.slope).abs() < 1e-9);
            assert!((after.slope - before.slope - 2.0 * H * now.curvature).abs() < 1e-9);
        }
    }

    #[test]
    fn ends_exactly_where_told() {
        let mut profile = profile();
        let end = Point {
            integral: profile.at(30.0).integral,
            ..Point::default()
        };
        assert_eq!(profile.at(30.0), end);
        assert_eq!(
            profile.at(9.9),
            Point {
                integral: profile.at(9.9).integral,
                value: 7.0,
                ..end
            }
        );
    }
}

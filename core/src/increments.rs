//! Rotation and velocity increments over one interval, from sensor readings.

use nalgebra::Vector3;

use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::math;
use crate::samples::{ImuOutput, ImuSample};

/// Longest interval, as a multiple of the usual one, without a missing sample. With one missing it is two,
/// between stamps as from the due time of the last: with jitter below three eighths of an interval at least
/// one of them is below this otherwise.
const MISSING_RATIO: f64 = 1.75;
/// Largest deviation of a stamp from its due time, in intervals, that is jitter.
const JITTER_RATIO: f64 = 0.5;
/// Least of it whose noise counts: in strong vibration it makes that of a good accelerometer.
const LEAST_JITTER_RATIO: f64 = 1e-3;
/// Memory of the jitter, in stamps, and of the usual interval where stamps are irregular.
const STAMPS: f64 = 16.0;
/// Successive gaps that show a lower rate: with one sample in five lost there are so many once in an hour.
const GAPS: u8 = 8;

/// Half the turn by which the two ends of a gap may disagree, rad: beyond it the heading would have to be
/// found anew.
const BRIDGEABLE_RAD: f64 = 0.3;
/// The same of a velocity, m/s: so much is corrected in an INS at once.
const BRIDGEABLE_MPS: f64 = 3.0;
/// Shortest gap in which a mount may slip, s: in a shorter one the force turns in vibration.
const SLIP_S: f64 = 0.25;

/// See [`Increments::unresolved_coning_radps`].
const HALF_RATE_CONING: f64 = core::f64::consts::PI * core::f64::consts::PI / 32.0;

/// Turn about one axis between samples that is ambiguous with one in the other direction, rad.
const AMBIGUOUS_RAD: f64 = core::f64::consts::PI;

/// Motion over one interval, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Interval {
    /// Duration, s.
    pub seconds: f64,
    /// Integral of angular rate against inertial space, rad.
    pub angle_rad: Vector3<f64>,
    /// Integral of specific force, m/s.
    pub force_mps: Vector3<f64>,
    /// Coning: rotation vector beyond `angle_rad`, rad.
    pub coning_rad: Vector3<f64>,
    /// Sculling: velocity gained beyond `force_mps` and its rotation, m/s.
    pub sculling_mps: Vector3<f64>,
}

impl Interval {
    /// The interval with constant biases subtracted.
    #[must_use]
    pub fn without_bias(&self, gyro_radps: &Vector3<f64>, accel_mps2: &Vector3<f64>) -> Self {
        Self {
            angle_rad: self.angle_rad - self.seconds * gyro_radps,
            force_mps: self.force_mps - self.seconds * accel_mps2,
            ..*self
        }
    }

    /// Rotation vector over the interval, rad.
    pub fn rotation_rad(&self) -> Vector3<f64> {
        self.angle_rad + self.coning_rad
    }

    /// Velocity gained from specific force, in the body axes of the interval's start, m/s.
    pub fn velocity_mps(&self) -> Vector3<f64> {
        let rotated = self.angle_rad.cross(&self.force_mps);
        self.force_mps + 0.5 * rotated + self.angle_rad.cross(&rotated) / 6.0 + self.sculling_mps
    }
}

/// Turns readings, rates or increments, into [`Interval`]s; remembers one reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Increments {
    output: ImuOutput,
    gyro: Vector3<f64>,
    accel: Vector3<f64>,
    /// Change from the reading before that one.
    gyro_change: Vector3<f64>,
    accel_change: Vector3<f64>,
    /// Interval of the remembered reading, s; zero if it is the first.
    previous_s: f64,
    /// Usual interval, s; zero until known.
    usual_s: f64,
    /// Successive intervals with samples missing.
    gaps: u8,
    /// Lateness of the last stamp against its due time, s.
    late_s: f64,
    /// The part of it that is the stamp's and not the sensor's, s.
    stamped_late_s: f64,
    /// Sums of the excess of an interval by its stamps, times the excess of velocity over that of `g` in
    /// the usual one, and times that of `g` in the excess, m. Equal where stamps are right; where the
    /// intervals are even the first is zero.
    longer_felt_m: f64,
    longer_stamped_m: f64,
}

impl Increments {
    /// Starts from a first reading, whose own interval is unknown: it gives no motion.
    pub fn new(output: ImuOutput, first: &ImuSample) -> Self {
        Self {
            output,
            gyro: first.gyro,
            accel: first.accel,
            ..Self::default()
        }
    }

    /// Begins again at a reading after a gap; the usual interval stays known.
    pub fn restart(&mut self, first: &ImuSample) {
        self.gyro = first.gyro;
        self.accel = first.accel;
        self.previous_s = 0.0;
        self.late_s = 0.0;
        self.stamped_late_s = 0.0;
    }

    /// Lateness of the last stamp against its sample, s: of increments whose size does not grow with their
    /// stamped interval, so that the sensor's own intervals are even. A rate is of its stamp.
    pub fn stamped_late_s(&self) -> f64 {
        self.stamped_late_s
    }

    /// Whether an interval of `seconds` has samples missing in it.
    pub fn has_gap(&self, seconds: f64) -> bool {
        let longest = MISSING_RATIO * self.usual_s;
        self.usual_s > 0.0 && seconds > longest && seconds + self.late_s > longest
    }

    /// Whether jitter of the stamps adds noise before a sample `seconds` after the last: to rates, and to
    /// increments where a late stamp was filled like a gap.
    pub(crate) fn jitters(&self, seconds: f64) -> bool {
        match self.output {
            ImuOutput::Rates => math::abs(self.late_s) > LEAST_JITTER_RATIO * self.usual_s,
            ImuOutput::Increments => self.gaps > 0 && seconds < 0.5 * self.usual_s,
        }
    }

    /// Noise that jitter adds before `sample`, `seconds` after the last: variances of the angle and of the
    /// velocity gained, per body axis, rad^2 and (m/s)^2.
    ///
    /// A stamp that is late moves time from the interval after it to the one before, whose mean readings
    /// differ. Whether the sample was as late as its stamp is not known: if so, what the readings were in
    /// between is as uncertain. An increment of a time that was filled already counts twice.
    pub(crate) fn jitter_noise(&self, sample: &ImuSample, seconds: f64) -> [Vector3<f64>; 2] {
        let (changes, moved) = match self.output {
            ImuOutput::Rates => (
                [
                    sample.gyro - self.gyro + self.gyro_change,
                    sample.accel - self.accel + self.accel_change,
                ],
                0.5 * self.late_s,
            ),
            ImuOutput::Increments => ([sample.gyro, sample.accel], 1.0 - seconds / self.usual_s),
        };
        changes.map(|change| change.component_mul(&change) * (moved * moved))
    }

    /// Most of the mean rate about each axis that may be coning which sampling does not resolve, by the last
    /// change of the readings, rad/s; it is the mean of many that tells.
    ///
    /// Rates `a` and `b` in quadrature turn the unit at `a b T / (2 p)`, with a phase of `p` in each interval
    /// `T`. The two-sample term leaves the less of that the slower they are, and all at `p = pi`. There
    /// the product of their changes is `4 a b / pi` on average, and `(2 / pi)^2` of that by increments.
    #[inline(never)]
    pub fn unresolved_coning_radps(&self) -> Vector3<f64> {
        let usual_s = math::max(self.usual_s, f64::MIN_POSITIVE);
        let change = self.gyro_change.abs();
        let products = Vector3::new(
            change.y * change.z,
            change.z * change.x,
            change.x * change.y,
        );
        products
            * match self.output {
                ImuOutput::Rates => usual_s / 8.0,
                ImuOutput::Increments => HALF_RATE_CONING / usual_s,
            }
    }

    /// Difference of the readings on both sides of a gap before `sample`, rad/s and m/s^2.
    pub fn ends_differ(&self, sample: &ImuSample) -> [Vector3<f64>; 2] {
        let reading_s = self.output.per_rate(self.usual_s);
        [sample.gyro - self.gyro, sample.accel - self.accel].map(|change| change / reading_s)
    }

    /// As [`Self::ends_differ`] if nothing is known between the ends, rad/s: twice the faster rate besides
    /// the difference.
    pub fn lost_turn(&self, sample: &ImuSample) -> Vector3<f64> {
        let (mut faster, mut slower) = (&self.gyro, &sample.gyro);
        if slower.norm_squared() > faster.norm_squared() {
            core::mem::swap(&mut faster, &mut slower);
        }
        (3.0 * faster - slower) / self.output.per_rate(self.usual_s)
    }

    /// Whether the two ends of a gap of `seconds` before `sample` agree.
    pub fn ends_agree(&self, sample: &ImuSample, seconds: f64) -> bool {
        let differ = self.ends_differ(sample);
        let [rate, accel] = differ.map(|change| 0.5 * seconds * math::largest(&change));
        let [_, change_mps2] = differ;
        let slipped = seconds > SLIP_S && self.slips(&sample.accel, &change_mps2);
        rate <= BRIDGEABLE_RAD && accel <= BRIDGEABLE_MPS && !slipped
    }

    /// Whether the specific force has turned in the body by more than 45 degrees: braking at a whole g does
    /// that. An INS corrects a smaller tilt, and keeps more of what it knows. In free fall nothing turns.
    fn slips(&self, accel: &Vector3<f64>, change_mps2: &Vector3<f64>) -> bool {
        let along = self.accel.dot(accel);
        let across = self.accel.cross(accel);
        let slight = change_mps2.norm_squared() < 0.5 * GRAVITY_EQUATOR_MPS2 * GRAVITY_EQUATOR_MPS2;
        !slight && across.norm_squared() > along * math::abs(along)
    }

    /// Whether a reading of a gyro is a turn that samples `seconds` apart cannot resolve.
    pub fn turns_too_far(&self, gyro: f64, seconds: f64) -> bool {
        gyro * seconds > AMBIGUOUS_RAD * self.output.per_rate(seconds)
    }

    /// Duration that a reading covers, `seconds` after the last, s: shorter if samples are missing before
    /// it.
    pub fn reading_seconds(&self, seconds: f64, gap: bool) -> f64 {
        if gap { self.usual_s } else { seconds }
    }

    /// The interval that ends at `sample`, stamped `seconds` (positive) after the last.
    ///
    /// Rates are integrated by the parabola through the last three readings, increments as they
    /// are. Coning and sculling are those of rates linear over the interval, or over the last two
    /// intervals (Savage 1998, two-sample algorithm); both give the same second-order terms, with
    /// `scale` as their only difference. A gap between increments is filled with the mean rate
    /// of its two ends.
    pub fn interval(&mut self, sample: &ImuSample, seconds: f64) -> Interval {
        self.interval_of(sample, seconds, self.has_gap(seconds))
    }

    /// The same, with the result of [`Self::has_gap`].
    #[inline]
    pub(crate) fn interval_of(&mut self, sample: &ImuSample, seconds: f64, gap: bool) -> Interval {
        let (usual_s, late_before_s) = (self.usual_s, self.stamped_late_s);
        self.follow_stamps(seconds, gap);
        if self.output == ImuOutput::Increments {
            self.compare_stamps(seconds, &sample.accel);
        }
        let seconds = seconds + late_before_s - self.stamped_late_s;
        let (gyro_change, accel_change) = (sample.gyro - self.gyro, sample.accel - self.accel);
        // A first reading is taken to span an interval like this one.
        let before = if self.previous_s > 0.0 {
            self.previous_s
        } else {
            seconds
        };
        let (angle, force, scale) = match self.output {
            ImuOutput::Rates => {
                let bend = self.bend(seconds, gap);
                let (bend_new, bend_old) = (bend / seconds, bend / before);
                let integral = |last: &Vector3<f64>, change: &Vector3<f64>, old: &Vector3<f64>| {
                    seconds * last + (0.5 * seconds - bend_new) * change + bend_old * old
                };
                (
                    integral(&self.gyro, &gyro_change, &self.gyro_change),
                    integral(&self.accel, &accel_change, &self.accel_change),
                    seconds * seconds / 12.0,
                )
            }
            ImuOutput::Increments if gap => {
                let ends = if self.previous_s > 0.0 { 2.0 } else { 1.0 };
                let previous = ends - 1.0;
                let fill = (seconds / usual_s - 1.0) / ends;
                (
                    sample.gyro + fill * (previous * self.gyro + sample.gyro),
                    sample.accel + fill * (previous * self.accel + sample.accel),
                    0.0,
                )
            }
            ImuOutput::Increments => {
                // Stamps of a burst are no intervals.
                let before = math::max(before, 0.5 * seconds);
                let scale = seconds * seconds / (6.0 * before * (before + seconds));
                (sample.gyro, sample.accel, scale)
            }
        };
        let coning = scale * self.gyro.cross(&sample.gyro);
        let sculling = scale * (self.gyro.cross(&sample.accel) + self.accel.cross(&sample.gyro));
        self.gyro = sample.gyro;
        self.accel = sample.accel;
        self.gyro_change = gyro_change;
        self.accel_change = accel_change;
        self.previous_s = match self.output {
            ImuOutput::Increments if gap => usual_s,
            ImuOutput::Rates | ImuOutput::Increments => seconds,
        };
        Interval {
            seconds,
            angle_rad: angle,
            force_mps: force,
            coning_rad: coning,
            sculling_mps: sculling,
        }
    }

    /// Correction of the trapezoid by the change of slope: the parabola through readings at `-T1`, 0 and
    /// `T2` integrates to it less `T2^3 / (6 (T1 + T2))` times the difference of the two slopes. None
    /// across a gap, without a reading before, or with one so much closer than the next that its slope
    /// would be extrapolated far.
    fn bend(&self, seconds: f64, gap: bool) -> f64 {
        if gap || self.previous_s < 0.5 * seconds {
            return 0.0;
        }
        seconds * seconds * seconds / (6.0 * (self.previous_s + seconds))
    }

    /// Tracks regular stamps by a second-order loop, critically damped, and irregular ones slowly; a few
    /// gaps do not count.
    fn follow_stamps(&mut self, seconds: f64, gap: bool) {
        self.gaps = if gap { self.gaps.saturating_add(1) } else { 0 };
        if self.usual_s <= 0.0 {
            self.usual_s = seconds;
            self.longer_stamped_m = GRAVITY_EQUATOR_MPS2 * seconds * seconds;
            self.longer_felt_m = self.longer_stamped_m;
            return;
        }
        let late_s = seconds + self.late_s - self.usual_s;
        if math::abs(late_s) < JITTER_RATIO * self.usual_s {
            self.late_s = late_s * (1.0 - 1.0 / STAMPS);
            self.usual_s += late_s / (4.0 * STAMPS * STAMPS);
        } else {
            self.late_s = 0.0;
            if !(1..GAPS).contains(&self.gaps) {
                self.usual_s += math::min(seconds - self.usual_s, self.usual_s) / STAMPS;
            }
        }
    }

    /// Regression of an increment's size on its stamped interval, and the lateness of the stamp by it;
    /// never so much that no time would pass.
    fn compare_stamps(&mut self, seconds: f64, accel: &Vector3<f64>) {
        let longer_s = seconds - self.usual_s;
        let usual_mps = GRAVITY_EQUATOR_MPS2 * self.usual_s;
        // Half the difference of the squares instead of a root, as they are almost equal.
        let felt_mps = 0.5 * (accel.norm_squared() / usual_mps - usual_mps);
        let stamped_mps = GRAVITY_EQUATOR_MPS2 * longer_s;
        if math::abs(longer_s) < self.usual_s {
            let keep = 1.0 - 1.0 / (STAMPS * STAMPS);
            self.longer_felt_m = keep * self.longer_felt_m + longer_s * felt_mps;
            self.longer_stamped_m = keep * self.longer_stamped_m + longer_s * stamped_mps;
        }
        let even = 1.5 - 2.0 * self.longer_felt_m / self.longer_stamped_m;
        let late_s = self.late_s * math::clamp(even, [0.0, 1.0]);
        let latest_s = self.stamped_late_s + seconds * (1.0 - 1.0 / STAMPS);
        self.stamped_late_s = math::min(late_s, latest_s);
    }
}

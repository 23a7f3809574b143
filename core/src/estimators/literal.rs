//! The thesis's estimators as printed, (7) to (11), each on its own manoeuvres.
//!
//! They read the integral of the controls, `U = INT w^C dt`, and hold in the quasi-steady regime:
//! manoeuvres long against `1 / w0`. What gyros are known to drift, from (9), is taken out of `U`
//! first, as the thesis does from stage to stage. Several manoeuvres are averaged by summing
//! numerators and denominators, never quotients; their scatter gives the spread.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::Verdict;
use super::innovations::Innovations;
use super::least_squares::LeastSquares;
use super::parameters::{Parameters, index};
use crate::config::Config;
use crate::earth::GRAVITY_EQUATOR_MPS2 as G;
use crate::history::{Moment, Past, Span};
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::time::Time;

/// Least change of acceleration that (7) and (11) use, m/s^2.
const LEAST_CHANGE_MPS2: f64 = 1.0;
/// Part of the peak acceleration above which a manoeuvre still lasts.
const STILL_LASTING: f64 = 0.8;
/// Steady time after a turn until the loop has settled, in units of `1 / w0`.
const SETTLING: f64 = 3.0;
/// Fading of (7) from one manoeuvre to the next: the azimuth itself drifts with the gyro.
const AZIMUTH_KEEP: f64 = 0.9;
/// Block over which (9) and (10) are averaged, s.
const BLOCK_S: f64 = 60.0;
/// Manoeuvres or blocks without which a scatter says nothing.
const LEAST_COUNT: f64 = 3.0;

/// Azimuth (7): `Phi_UP = g (Da_E INT w_E^C + Da_N INT w_N^C) / (Da_E^2 + Da_N^2)`, returned as
/// numerator and denominator. `change` is Da, m/s^2, `turned` INT w^C, rad; level axes E, N.
pub fn azimuth(change: &Vector2<f64>, turned: &Vector2<f64>) -> (f64, f64) {
    (G * change.dot(turned), change.norm_squared())
}

/// Level accelerometers (8): adds `DC [df_x; df_y] = g [INT w_N^C; -INT w_E^C]` to the equations.
/// Observability is `2 - 2 cos DH`: best at half a turn. `known` is what is compensated already.
/// Returns the growth of the sum of squared residuals.
pub fn level_accels(
    rows: &mut LeastSquares<2, 3>,
    change: &Matrix2<f64>,
    turned: &Vector2<f64>,
    known: &Vector2<f64>,
) -> f64 {
    let felt = (G * Vector2::new(turned.y, -turned.x) + change * known).cast::<f32>();
    let mut change: [[f32; 2]; 2] = change.cast().into();
    f64::from(rows.add(&mut change, felt.into(), [1.0; 2]))
}

/// Level gyros (9): `dw_x = w_E^C cos H - w_N^C sin H`, `dw_y = w_E^C sin H + w_N^C cos H`, with
/// `C` in the place of the heading so that it holds for a tilted unit too.
pub fn level_gyros(attitude: &Matrix3<f64>, control: &Vector3<f64>) -> Vector2<f64> {
    attitude.tr_mul(control).xy()
}

/// Vertical channel (10): `df_z = -f_UP^C`, `dw_z = w_UP^C`.
pub fn vertical(accel_up: f64, rate_up: f64) -> (f64, f64) {
    (-accel_up, rate_up)
}

/// Latency (11): `tau = (a_E DdV_E + a_N DdV_N) / (a_E^2 + a_N^2)`, returned as numerator and
/// denominator. `gained` is `DdV` of the free INS since the start of the acceleration, m/s.
pub fn latency(accel: &Vector2<f64>, gained: &Vector2<f64>) -> (f64, f64) {
    (accel.dot(gained), accel.norm_squared())
}

/// Weighted mean and its spread by scatter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Mean {
    weight: f64,
    value: f64,
    scatter: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64, weight: f64) {
        self.count += 1.0;
        self.weight += weight;
        let off = value - self.value;
        self.value += off * weight / self.weight;
        self.scatter += weight * off * (value - self.value);
    }

    /// Lets all before count for `keep` of what it did.
    fn fade(&mut self, keep: f64) {
        self.weight *= keep;
        self.scatter *= keep;
        self.count *= keep;
    }

    fn store(&self, parameters: &mut Parameters, which: usize) {
        if self.count >= LEAST_COUNT {
            let sigma = math::sqrt(self.scatter / ((self.count - 1.0) * self.weight));
            parameters.set(which, self.value, sigma);
        }
    }
}

/// A manoeuvre going on: where it began and what has been seen of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Going {
    start: Moment,
    start_attitude: Matrix3<f64>,
    start_difference: Vector2<f64>,
    start_accel: Vector2<f64>,
    /// Whether it began with gaining or with losing speed.
    kind: Option<Manoeuvre>,
    /// Whether it has turned.
    bent: bool,
    /// Whether its acceleration has been counted.
    counted: bool,
    peak: f64,
    /// (7): numerator and denominator at the last moment that the acceleration still lasted.
    azimuth: (f64, f64),
    /// (11): sums so far.
    latency: (f64, f64),
}

/// One block of (9) and (10).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Block {
    seconds: f64,
    gyros: Vector3<f64>,
    accel_up: f64,
}

/// Running sums of (7) to (11).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Literal {
    last: Option<Moment>,
    /// Mean attitude between the last two fixes.
    attitude: Matrix3<f64>,
    /// Since when the vehicle moves steadily.
    steady_since: Option<Time>,
    /// The manoeuvre from the last settled state on.
    going: Option<Going>,
    azimuth: Mean,
    latency: Mean,
    gyros: [Mean; 3],
    accel_up: Mean,
    level_accels: LeastSquares<2, 3>,
    level_misfit: f64,
    turns: f64,
    block: Block,
    level_innovations: Innovations,
    up_innovations: Innovations,
    parameters: Parameters,
}

/// One comparison with GNSS, as the literal estimators need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison<'a> {
    /// The INS at the moment of the fix.
    pub past: &'a Past,
    /// What the vehicle is doing.
    pub manoeuvre: Manoeuvre,
    /// INS minus GNSS velocity, ENU, m/s.
    pub difference_mps: Vector3<f64>,
    /// Whether the up component was measured.
    pub has_up: bool,
    /// `f_UP^C` since the last fix, m/s^2.
    pub accel_up_mps2: f64,
    /// Azimuth taken out since the start, rad.
    pub azimuth_removed_rad: f64,
    /// Latency already taken out, s.
    pub latency_applied_s: f64,
    /// Accelerometer biases already taken out, m/s^2.
    pub accel_compensation_mps2: Vector3<f64>,
    /// Bandwidth of the horizontal loop, rad/s.
    pub bandwidth_radps: f64,
}

impl Literal {
    /// Nothing known; the weak prior keeps the equations of (8) solvable.
    pub fn new(config: &Config) -> Self {
        // A weight that counts for nothing beside one turn.
        let weak = Vector2::repeat(1e3 * math::single(config.sensors.accel_bias_mps2));
        let innovations = Innovations::new(config.gnss.velocity_sigma_mps);
        Self {
            last: None,
            attitude: Matrix3::zeros(),
            steady_since: None,
            going: None,
            azimuth: Mean::default(),
            latency: Mean::default(),
            gyros: [Mean::default(); 3],
            accel_up: Mean::default(),
            level_accels: LeastSquares::from_prior(&weak),
            level_misfit: 0.0,
            turns: 0.0,
            block: Block::default(),
            level_innovations: innovations,
            up_innovations: innovations,
            parameters: config.prior(),
        }
    }

    /// Breaks off what was going on: the totals begin anew.
    pub fn restart(&mut self) {
        self.last = None;
        self.steady_since = None;
        self.going = None;
    }

    /// Takes one comparison.
    #[inline(never)]
    pub fn take(&mut self, now: &Comparison) -> Verdict {
        let (level, up) = (now.difference_mps.xy(), now.difference_mps.z);
        if self
            .level_innovations
            .noise(level.norm_squared(), 0.0, 1.0)
            .is_none()
        {
            return Verdict::Outlier;
        }
        let _ = self.level_innovations.measure(&level, 2.0, 1.0);
        if let Some(last) = self.last {
            self.average(&last, now);
        }
        self.last = Some(now.past.moment);
        self.follow(now);
        self.store_azimuth(now.azimuth_removed_rad);
        if now.has_up && self.up_innovations.noise(up * up, 0.0, 1.0).is_some() {
            let _ = self
                .up_innovations
                .measure(&Vector2::new(up, 0.0), 1.0, 1.0);
            Verdict::Used
        } else {
            Verdict::LevelUsed
        }
    }

    /// (9) and (10) at every fix.
    fn average(&mut self, last: &Moment, now: &Comparison) {
        let moment = &now.past.moment;
        let dt = moment.time.seconds_since(last.time);
        self.attitude = (moment.attitude_s - last.attitude_s) / dt;
        let turned = moment.control_tilt_rad - last.control_tilt_rad;
        let level = level_gyros(&self.attitude, &turned);
        let (accel_up, up) = vertical(now.accel_up_mps2 * dt, turned.z);
        // What the loop does before it first settles is levelling.
        if self.going.is_none() {
            return;
        }
        let block = &mut self.block;
        block.seconds += dt;
        block.gyros += Vector3::new(level.x, level.y, up);
        block.accel_up += accel_up;
        if block.seconds >= BLOCK_S {
            let Block {
                seconds,
                gyros,
                accel_up,
            } = *block;
            let means = gyros / seconds;
            let [x, y, z] = &mut self.gyros;
            x.add(means.x, seconds);
            y.add(means.y, seconds);
            // Before the azimuth is found there is no w_UP^C.
            if self.azimuth.count >= LEAST_COUNT {
                z.add(means.z, seconds);
            }
            self.accel_up
                .add(accel_up / seconds + now.accel_compensation_mps2.z, seconds);
            self.block = Block::default();
        }
    }

    /// Follows manoeuvres, each from one settled steady state to the next.
    fn follow(&mut self, now: &Comparison) {
        if self.settled(now) {
            if let Some(going) = self.going.filter(|going| going.bent) {
                self.end_turn(&going, now);
            }
            self.going = Some(self.begin(now));
            return;
        }
        let Some(mut going) = self.going else { return };
        match now.manoeuvre {
            Manoeuvre::Turning => going.bent = true,
            Manoeuvre::Accelerating | Manoeuvre::Braking if !going.bent => {
                let kind = *going.kind.get_or_insert(now.manoeuvre);
                if kind == now.manoeuvre {
                    self.measure_acceleration(&mut going, now);
                }
            }
            _ => {}
        }
        // The first straight piece only: what follows does not begin from a settled state.
        if going.kind.is_some_and(|kind| kind != now.manoeuvre) && !going.counted {
            going.counted = true;
            self.end_acceleration(&going, now);
        }
        self.going = Some(going);
    }

    fn settled(&mut self, now: &Comparison) -> bool {
        let time = now.past.moment.time;
        if !matches!(now.manoeuvre, Manoeuvre::Steady | Manoeuvre::Rest) {
            self.steady_since = None;
            return false;
        }
        let since = *self.steady_since.get_or_insert(time);
        time.seconds_since(since) * now.bandwidth_radps >= SETTLING
    }

    fn begin(&self, now: &Comparison) -> Going {
        Going {
            start: now.past.moment,
            start_attitude: self.attitude,
            start_difference: now.difference_mps.xy(),
            start_accel: now.past.accel_mps2.xy(),
            kind: None,
            bent: false,
            counted: false,
            peak: 0.0,
            azimuth: (0.0, 0.0),
            latency: (0.0, 0.0),
        }
    }

    /// INT w^C since the start of a manoeuvre, without the known drift of the gyros.
    fn turned(&self, start: &Moment, now: &Moment) -> Vector3<f64> {
        let drift = (now.attitude_s - start.attitude_s) * self.gyro_drift();
        now.control_tilt_rad - start.control_tilt_rad - drift
    }

    fn gyro_drift(&self) -> Vector3<f64> {
        let [x, y, z] = &self.gyros;
        Vector3::new(x.value, y.value, z.value)
    }

    fn measure_acceleration(&self, going: &mut Going, now: &Comparison) {
        let moment = &now.past.moment;
        let accel = now.past.accel_mps2.xy();
        let size = accel.norm();
        going.peak = math::max(going.peak, size);
        if size < STILL_LASTING * going.peak {
            return;
        }
        let change = accel - going.start_accel;
        going.azimuth = azimuth(&change, &self.turned(&going.start, moment).xy());
        let (top, bottom) = latency(&accel, &self.free_gain(going, now));
        going.latency.0 += top;
        going.latency.1 += bottom;
    }

    /// Growth of the velocity error that a free INS with drift-free gyros would have had.
    fn free_gain(&self, going: &Going, now: &Comparison) -> Vector2<f64> {
        let span = Span::between(&going.start, &now.past.moment);
        let drifted = -0.5 * span.force_mps.cross(&(span.attitude_s * self.gyro_drift()));
        let gained = now.difference_mps.xy() - going.start_difference;
        gained - span.control_velocity_mps.xy() - drifted.xy()
    }

    fn end_acceleration(&mut self, going: &Going, now: &Comparison) {
        let (top, bottom) = going.azimuth;
        if bottom > LEAST_CHANGE_MPS2 * LEAST_CHANGE_MPS2 {
            self.azimuth.fade(AZIMUTH_KEEP);
            self.azimuth
                .add(top / bottom + now.azimuth_removed_rad, bottom);
        }
        let (top, bottom) = going.latency;
        if bottom > LEAST_CHANGE_MPS2 * LEAST_CHANGE_MPS2 {
            self.latency
                .add(top / bottom + now.latency_applied_s, bottom);
        }
    }

    fn end_turn(&mut self, going: &Going, now: &Comparison) {
        let turned = self.turned(&going.start, &now.past.moment).xy();
        let change = (self.attitude - going.start_attitude)
            .fixed_view::<2, 2>(0, 0)
            .into_owned();
        let known = now.accel_compensation_mps2.xy();
        self.level_misfit += level_accels(&mut self.level_accels, &change, &turned, &known);
        self.turns += 1.0;
    }

    /// What is known of the parameters; the azimuth is that left at the last fix.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Azimuth error left in the INS at a moment after the last fix, rad.
    pub fn azimuth_left_rad(&self, moment: &Moment) -> f64 {
        let since = self.last.map_or(0.0, |last| {
            moment.control_tilt_rad.z - last.control_tilt_rad.z
        });
        self.parameters.value(index::AZIMUTH) + since
    }

    fn store_azimuth(&mut self, removed_rad: f64) {
        self.azimuth.store(&mut self.parameters, index::AZIMUTH);
        if self.azimuth.count >= LEAST_COUNT {
            self.parameters.shift(index::AZIMUTH, -removed_rad);
        }
    }

    /// Brings the parameters up to date.
    pub fn solve(&mut self) {
        let parameters = &mut self.parameters;
        self.latency.store(parameters, index::LATENCY);
        for (axis, gyro) in self.gyros.iter().enumerate() {
            gyro.store(parameters, index::GYRO + axis);
        }
        self.accel_up.store(parameters, index::ACCEL + 2);
        if self.turns >= LEAST_COUNT {
            let residual = self.level_misfit / (2.0 * self.turns - 2.0);
            for (axis, value) in self.level_accels.solve().iter().enumerate() {
                let sigma = math::sqrt(f64::from(self.level_accels.variance(axis)) * residual);
                parameters.set(index::ACCEL + axis, f64::from(*value), sigma);
            }
        }
    }
}

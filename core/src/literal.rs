//! The thesis's estimators as printed, (7) to (11), each on its own manoeuvres.
//!
//! They use the integral of the controls, `U = INT w^C dt`, and hold in the quasi-steady regime: manoeuvres
//! long against `1 / w0`. The drift by the gyros, from (9), is removed from `U` first, as in the stages of
//! the thesis. Several manoeuvres are averaged by summing numerators and denominators, never quotients;
//! their scatter gives the sigma.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::channel::Measured;
use crate::config::Config;
use crate::earth::GRAVITY_EQUATOR_MPS2 as G;
use crate::history::{PastState, Span};
use crate::innovations::{GateResult, Innovations};
use crate::least_squares::LeastSquares;
use crate::manoeuvre::Manoeuvre;
use crate::math;
use crate::measurement::Kind;
use crate::parameters::{Parameters, index};
use crate::time::Time;

/// Least change of acceleration that (7) and (11) use, m/s^2.
const LEAST_CHANGE_MPS2: f64 = 1.0;
/// A manoeuvre lasts while acceleration is above this part of its peak.
const STILL_LASTING: f64 = 0.8;
/// Steady time after a turn until the loop has settled, in units of `1 / w0`.
const SETTLING: f64 = 3.0;
/// Fading of (7) from one manoeuvre to the next, and of (9) and (10) from one block to the next: the
/// azimuth drifts with the gyro, and early blocks were before the compensations.
const KEEP: f64 = 0.9;
/// Block over which (9) and (10) are averaged, s.
const BLOCK_S: f64 = 60.0;
/// Least number of manoeuvres or blocks for a scatter.
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
    f64::from(rows.add(&mut change, felt.into(), [1.0; 2]).square)
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

/// Weighted mean, with its sigma by scatter.
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

    /// Multiplies the weight of all before by `keep`.
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

/// A time, and the sums until then.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Moment {
    time: Time,
    since_start: Span,
}

impl Moment {
    /// Integral of the controls of attitude until then, rad.
    fn turned(&self) -> &Vector3<f64> {
        &self.since_start.control_tilt_rad
    }
}

/// Manoeuvre in progress: its start and what has been measured.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct ActiveManoeuvre {
    start: Moment,
    start_attitude: Matrix3<f64>,
    start_difference: Vector2<f64>,
    start_accel: Vector2<f64>,
    /// Whether it began with acceleration or with braking.
    kind: Option<Manoeuvre>,
    /// Whether it has turned.
    has_turned: bool,
    /// Whether its acceleration has been used.
    counted: bool,
    peak: f64,
    /// (7): numerator and denominator at the end of the acceleration so far.
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
    now: Moment,
    last: Option<Moment>,
    /// Mean attitude between the last two fixes.
    attitude: Matrix3<f64>,
    /// Start of steady motion.
    steady_since: Option<Time>,
    /// Manoeuvre since the last settled state.
    active: Option<ActiveManoeuvre>,
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
    /// INS at the time of the fix.
    pub past: &'a PastState,
    /// The present manoeuvre.
    pub manoeuvre: Manoeuvre,
    /// INS minus GNSS velocity, ENU, m/s.
    pub difference_mps: Vector3<f64>,
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
    /// Starts without knowledge; the weak prior keeps the equations of (8) solvable.
    pub fn new(start: Time, config: &Config) -> Self {
        // A weight that is negligible beside one turn.
        let weak = Vector2::repeat(1e3 * math::single(config.sensors.accel_bias_mps2));
        Self {
            now: Moment {
                time: start,
                since_start: Span::default(),
            },
            last: None,
            attitude: Matrix3::zeros(),
            steady_since: None,
            active: None,
            azimuth: Mean::default(),
            latency: Mean::default(),
            gyros: [Mean::default(); 3],
            accel_up: Mean::default(),
            level_accels: LeastSquares::from_prior(&weak),
            level_misfit: 0.0,
            turns: 0.0,
            block: Block::default(),
            level_innovations: Innovations::default(),
            up_innovations: Innovations::default(),
            parameters: config.prior(),
        }
    }

    /// Time of the sums.
    pub fn horizon(&self) -> Time {
        self.now.time
    }

    /// Extends the sums by a span that ends at `to`.
    pub fn propagate(&mut self, span: &Span, to: Time) {
        self.now.time = to;
        self.now.since_start.extend(span);
    }

    /// Takes one kind of measurement of a comparison at the horizon; whether it passed the gate.
    #[inline(never)]
    pub fn take(&mut self, kind: Kind, now: &Comparison, config: &Config) -> bool {
        if kind.measured() == Measured::Position {
            return true;
        }
        let (innovations, difference, components) = if kind.is_up() {
            let up = Vector2::new(now.difference_mps.z, 0.0);
            (&mut self.up_innovations, up, 1.0)
        } else {
            let level = now.difference_mps.xy();
            (&mut self.level_innovations, level, 2.0)
        };
        let variance = kind.noise(config).variance() * innovations.scale;
        let credit = innovations.gate(self.now.time, &difference, components, 0.0, variance);
        if !matches!(credit, GateResult::Accepted(_)) {
            return false;
        }
        let sigmas = difference / math::sqrt(variance);
        let square = sigmas.norm_squared() / components;
        innovations.learn(square, 1.0, &sigmas, config.gnss.noise_range);
        if !kind.is_up() {
            if let Some(last) = self.last {
                self.average(&last, now);
            }
            self.last = Some(self.now);
            self.track_manoeuvre(now);
            self.store_azimuth(now.azimuth_removed_rad);
        }
        true
    }

    /// (9) and (10) at every fix.
    fn average(&mut self, last: &Moment, now: &Comparison) {
        let moment = self.now;
        let dt = moment.time.seconds_since(last.time);
        let attitude_s = moment.since_start.attitude_s - last.since_start.attitude_s;
        self.attitude = attitude_s / dt;
        let turned = moment.turned() - last.turned();
        let level = level_gyros(&self.attitude, &turned);
        let (accel_up, up) = vertical(now.accel_up_mps2 * dt, turned.z);
        // Before it first settles the loop is still levelling.
        if self.active.is_none() {
            return;
        }
        self.block.seconds += dt;
        self.block.gyros += Vector3::new(level.x, level.y, up);
        self.block.accel_up += accel_up;
        let seconds = self.block.seconds;
        if seconds >= BLOCK_S {
            let block = core::mem::take(&mut self.block);
            let means = block.gyros / seconds;
            let all = self.gyros.iter_mut().chain([&mut self.accel_up]);
            all.for_each(|mean| mean.fade(KEEP));
            let [x, y, z] = &mut self.gyros;
            x.add(means.x, seconds);
            y.add(means.y, seconds);
            // Before the azimuth is found there is no w_UP^C.
            if self.azimuth.count >= LEAST_COUNT {
                z.add(means.z, seconds);
            }
            let accel_up = block.accel_up / seconds + now.accel_compensation_mps2.z;
            self.accel_up.add(accel_up, seconds);
        }
    }

    /// Tracks manoeuvres, each from one settled steady state to the next.
    fn track_manoeuvre(&mut self, now: &Comparison) {
        if self.settled(now) {
            if let Some(active) = self.active.filter(|active| active.has_turned) {
                self.end_turn(&active, now);
            }
            self.active = Some(self.begin(now));
            return;
        }
        let Some(mut active) = self.active else {
            return;
        };
        match now.manoeuvre {
            Manoeuvre::Turning => active.has_turned = true,
            Manoeuvre::Accelerating | Manoeuvre::Braking if !active.has_turned => {
                let kind = *active.kind.get_or_insert(now.manoeuvre);
                if kind == now.manoeuvre {
                    self.measure_acceleration(&mut active, now);
                }
            }
            _ => {}
        }
        // The first straight part only: what follows does not start from a settled state.
        if active.kind.is_some_and(|kind| kind != now.manoeuvre) && !active.counted {
            active.counted = true;
            self.end_acceleration(&active, now);
        }
        self.active = Some(active);
    }

    fn settled(&mut self, now: &Comparison) -> bool {
        let time = self.now.time;
        if !matches!(now.manoeuvre, Manoeuvre::Steady | Manoeuvre::Rest) {
            self.steady_since = None;
            return false;
        }
        let since = *self.steady_since.get_or_insert(time);
        time.seconds_since(since) * now.bandwidth_radps >= SETTLING
    }

    fn begin(&self, now: &Comparison) -> ActiveManoeuvre {
        ActiveManoeuvre {
            start: self.now,
            start_attitude: self.attitude,
            start_difference: now.difference_mps.xy(),
            start_accel: now.past.accel_mps2.xy(),
            kind: None,
            has_turned: false,
            counted: false,
            peak: 0.0,
            azimuth: (0.0, 0.0),
            latency: (0.0, 0.0),
        }
    }

    /// INT w^C since the start of a manoeuvre, without the known drift of the gyros.
    fn turned(&self, start: &Moment, now: &Moment) -> Vector3<f64> {
        let attitude_s = now.since_start.attitude_s - start.since_start.attitude_s;
        now.turned() - start.turned() - attitude_s * self.gyro_drift()
    }

    fn gyro_drift(&self) -> Vector3<f64> {
        self.gyros.map(|gyro| gyro.value).into()
    }

    fn measure_acceleration(&self, active: &mut ActiveManoeuvre, now: &Comparison) {
        let moment = self.now;
        let accel = now.past.accel_mps2.xy();
        let size = accel.norm();
        active.peak = math::max(active.peak, size);
        if size < STILL_LASTING * active.peak {
            return;
        }
        let change = accel - active.start_accel;
        active.azimuth = azimuth(&change, &self.turned(&active.start, &moment).xy());
        let (top, bottom) = latency(&accel, &self.free_gain(active, now));
        active.latency.0 += top;
        active.latency.1 += bottom;
    }

    /// Growth of the velocity error of a free INS with drift-free gyros.
    fn free_gain(&self, active: &ActiveManoeuvre, now: &Comparison) -> Vector2<f64> {
        let (start, end) = (&active.start.since_start, &self.now.since_start);
        let force_mps = end.force_mps - start.force_mps;
        let drift = (end.attitude_s - start.attitude_s) * self.gyro_drift();
        let drifted = -0.5 * force_mps.cross(&drift);
        let gained = now.difference_mps.xy() - active.start_difference;
        // Less the controls of this span, with no tilt but their own.
        let controlled = end.control_velocity_mps
            - start.control_velocity_mps
            - force_mps.cross(&start.control_tilt_rad);
        gained - controlled.xy() - drifted.xy()
    }

    fn end_acceleration(&mut self, active: &ActiveManoeuvre, now: &Comparison) {
        let (top, bottom) = active.azimuth;
        if bottom > LEAST_CHANGE_MPS2 * LEAST_CHANGE_MPS2 {
            self.azimuth.fade(KEEP);
            self.azimuth
                .add(top / bottom + now.azimuth_removed_rad, bottom);
        }
        let (top, bottom) = active.latency;
        if bottom > LEAST_CHANGE_MPS2 * LEAST_CHANGE_MPS2 {
            self.latency
                .add(top / bottom + now.latency_applied_s, bottom);
        }
    }

    fn end_turn(&mut self, active: &ActiveManoeuvre, now: &Comparison) {
        let turned = self.turned(&active.start, &self.now).xy();
        let change = (self.attitude - active.start_attitude)
            .fixed_view::<2, 2>(0, 0)
            .into_owned();
        let known = now.accel_compensation_mps2.xy();
        self.level_misfit += level_accels(&mut self.level_accels, &change, &turned, &known);
        self.turns += 1.0;
    }

    /// Parameters as estimated; the azimuth is that left at the last fix.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Azimuth error left in the INS some time after the horizon, rad.
    pub fn azimuth_left_rad(&self, since: &Span) -> f64 {
        let unread = self.last.map_or(0.0, |last| {
            self.now.turned().z - last.turned().z + since.control_tilt_rad.z
        });
        self.parameters.value(index::AZIMUTH) + unread
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

#[cfg(test)]
#[path = "../tests/unit/literal.rs"]
mod tests;

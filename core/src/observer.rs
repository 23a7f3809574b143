//! The exact form of the compensation estimators: every control undone, all parameters jointly.
//!
//! Equation (6) of the thesis drops `K1 dV` and `dV'`, so (7) and (8) depend on the loop. Nothing
//! need be dropped, since every control is known. An observer follows the error of the damped INS
//! by the exact (1)-(2), `dV' = f x Phi + C df`, `Phi' = -w_in x Phi - C dw`, with the controls as
//! known inputs: its innovations do not depend on the loops. They are linear in corrections to
//! the parameters, through the error that a unit of each would cause, which the observer follows
//! in the same way.
//! With gains at the noise optimum the innovations are white, so plain least squares over them
//! is what a Kalman filter with all parameters in its state would find (Friedland's separate-bias
//! estimation, IEEE TAC 14, 1969); with parameters that walk, see `Observer::let_walk`.

use nalgebra::{Matrix3, SVector, Vector2, Vector3};

use crate::channel::{Channel, Growth, Measured, Renewal};
use crate::colour::{self, Colour, Sensitivity};
use crate::config::{Config, Noise};
use crate::constancy::Constancy;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::error_model::{Forcing, InsError, Passage, for_each_input, level_and_up};
use crate::followed::{Followed, UNIT_RESPONSES};
use crate::history::{Past, Span};
use crate::innovations::{
    Credit, Doubts, Innovations, LOST_S, StatedNoise, Surprise, against_described, is_ordinary,
};
use crate::jump::Jump;
use crate::least_squares::LeastSquares;
use crate::math::{self, singles};
use crate::measurement::{Difference, Kind};
use crate::parameters::{AGREES_SIGMAS, COUNT, PAIRS, Parameters, index};
use crate::process_noise::ProcessNoise;
use crate::solution::SolutionSigma;
use crate::time::Time;

/// One number for each parameter.
type Row = SVector<f32, COUNT>;
/// What a unit of each parameter adds to `R` measured components.
type By<const R: usize> = [[f32; R]; COUNT];

/// How long an error of scale or misalignment that a manoeuvre has caused is told from others, s:
/// then the observer has taken it for a tilt.
const MANOEUVRE_S: f64 = 10.0;
/// Spread of the velocity of an INS that has lost its way, m/s: a second of braking, or of ten that
/// it was doubted with a tilt of 0.1 rad; and of its tilt and azimuth, rad.
const LOST_MPS: f64 = 10.0;
const LOST_TILT_RAD: f64 = 0.05;
const LOST_AZIMUTH_RAD: f64 = 0.3;
/// Time for which an INS that is found to be lost has run away at the speed that it has then, s.
const ASTRAY_S: f64 = 0.5 * LOST_S;
/// Part of its run-to-run spread by which a bias may have changed then.
const LOST_BIAS: f64 = 0.1;
/// Time for which innovations must be too large before the INS is doubted, s; and vertical ones before
/// the vertical is: longer than a bump, and no manoeuvre tips the vertical velocity.
const DOUBT_S: f64 = 10.0;
const VERTICAL_DOUBT_S: f64 = 5.0;
/// Time over which the level attitude of the mount is averaged, at first and at most, s: some
/// manoeuvres, and some minutes for which a mount stays as it is.
const FIRST_LEVEL_S: f64 = 30.0;
const LEVEL_MEMORY_S: f64 = 600.0;
/// Angle beyond which up and what is felt as up, on the mean of some manoeuvres, show that the mount
/// has slipped: a bank tips the one, a long start the other, and a climb both by less.
const SLIPPED_RAD: f64 = 0.25;
/// Prior sigmas that no parameter is off by, and a tilt that no levelled INS has, rad.
const SOUND_SIGMAS: f64 = 30.0;
const SOUND_TILT_RAD: f64 = 1.0;
/// Gravity falls by this with height, `2 g / R`, 1/s^2.
const GRADIENT_PER_S2: f64 = 3.1e-6;
/// Heights on Earth, above and below where an INS begins that has not been told one, m.
const UNKNOWN_HEIGHT_M: f64 = 9000.0;
/// Square of the jerk that a swing of a velocity of unit variance leaves: a third of it is in the
/// means over a tenth of a second, their second difference is four times that, on two axes.
const SWING_PER_S4: f64 = 6e4;
/// Rate and acceleration of an ordinary manoeuvre, which a hole of a second may hide, rad/s and m/s^2:
/// a shorter one hides as much less, and a longer one no more.
const HIDDEN_RADPS: f64 = 0.1;
const HIDDEN_MPS2: f64 = 1.0;
const HIDDEN_S: f64 = 1.0;

/// An error that grows with a vector and is gone when the vector is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Manoeuvred {
    vector: Vector3<f32>,
    /// Square of it that is accounted for.
    square: f32,
}

impl Manoeuvred {
    /// By how much its square grows over a span that adds `change`, beyond what is accounted for:
    /// swinging to and fro adds nothing.
    fn grow(&mut self, change: &Vector3<f64>, seconds: f64) -> f64 {
        let keep = math::single(1.0 / (1.0 + seconds / MANOEUVRE_S));
        self.vector = self.vector * keep + singles(change);
        self.square *= keep * keep;
        let growth = self.vector.norm_squared() - self.square;
        if growth <= 0.0 {
            return 0.0;
        }
        self.square += growth;
        f64::from(growth)
    }
}

/// Before anything has moved.
const CONSTANT: [Constancy; COUNT] = [Constancy::NEW; COUNT];

/// Components of the INS error.
const COMPONENTS: usize = 9;

/// Observer of the INS error and running least squares of the parameters behind it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observer {
    /// As it is at the horizon with the parameters as they are known. The azimuth error is the
    /// first parameter.
    followed: Followed<f64>,
    /// What a unit of each parameter more would make of it.
    responses: [Followed<f32>; COUNT],
    level: Channel,
    vertical: Channel,
    innovations: [Innovations; 4],
    stated: [StatedNoise; 4],
    colours: [Colour; 4],
    /// To how strong that of heights is.
    height_sensitivity: Sensitivity,
    gyro_noise: ProcessNoise,
    surprise: Surprise,
    /// The same of the vertical, which goes wrong on its own.
    vertical_surprise: Surprise,
    doubts: Doubts,
    vertical_doubts: Doubts,
    azimuth_jump: Jump,
    /// Corrections to the parameters.
    corrections: LeastSquares<COUNT, PAIRS>,
    /// Last solution; the latency is that of its moment.
    parameters: Parameters,
    /// Specific force in the body at the level attitude of the mount, m/s^2.
    level_force_mps2: Vector3<f64>,
    gravity_mps2: f64,
    /// Time over which that is averaged, s.
    levelled_s: f64,
    /// How far up, and what is felt as up, are off its direction, body, on the mean of some manoeuvres.
    lately: [Vector3<f64>; 2],
    /// Whose spread is due next, and what the spreads of the parameters add to the variance of the
    /// INS error.
    next_spread: u8,
    added: InsError<f32>,
    /// How each parameter moves, and what is to be given back of the one whose turn it is.
    constancy: [Constancy; COUNT],
    given_back: Option<f32>,
    /// Since the horizon that the last solution was for, s; before it since the one before; and the
    /// azimuth's walk since then, rad^2.
    unsolved_s: f64,
    elapsed_s: f64,
    azimuth_walk: f64,
    /// The vertical in the body at the horizon, what is felt as that, how far it was tipped, and
    /// velocity pulled, ENU.
    up: Vector3<f64>,
    felt: Vector3<f64>,
    tipped: Manoeuvred,
    pulled: Manoeuvred,
    horizon: Time,
    last_level: Time,
    last_vertical: Time,
    /// When the biases of each axis last walked.
    walked: [Time; 3],
}

impl Observer {
    /// Starts on a level of some spread and with a vertical velocity of some variance;
    /// `level_force_mps2` is the specific force felt there, body. What is believed of the parameters
    /// comes by [`Self::believe`].
    pub fn new(
        start: Time,
        tilt_sigma_rad: f64,
        climb_variance: f64,
        level_force_mps2: Vector3<f64>,
        config: &Config,
    ) -> Self {
        let gnss = &config.gnss;
        let level = Channel::new(
            tilt_sigma_rad * tilt_sigma_rad,
            &gnss.velocity_mps,
            &gnss.position_m,
        );
        let mut vertical = Channel::new(0.0, &gnss.velocity_up_mps, &gnss.height_m);
        vertical.doubt(climb_variance, 0.0);
        vertical.doubt_position(UNKNOWN_HEIGHT_M * UNKNOWN_HEIGHT_M);
        Self {
            followed: Followed::zero(),
            responses: UNIT_RESPONSES,
            level,
            vertical,
            innovations: [Innovations::default(); 4],
            stated: [StatedNoise::default(); 4],
            colours: Kind::ALL.map(|kind| {
                let known = if kind == Kind::Height {
                    colour::CONFIGURED
                } else {
                    colour::CONFIGURED_ONCE
                };
                Colour::new(start, known)
            }),
            height_sensitivity: Sensitivity::NONE,
            gyro_noise: ProcessNoise::CONFIGURED,
            surprise: Surprise::default(),
            vertical_surprise: Surprise::default(),
            doubts: Doubts::default(),
            vertical_doubts: Doubts::default(),
            azimuth_jump: Jump::default(),
            corrections: LeastSquares::NOTHING,
            parameters: Parameters::NONE,
            level_force_mps2,
            levelled_s: FIRST_LEVEL_S,
            lately: [Vector3::zeros(); 2],
            next_spread: 0,
            added: InsError::zero(),
            constancy: CONSTANT,
            given_back: None,
            unsolved_s: 0.0,
            elapsed_s: 0.0,
            azimuth_walk: 0.0,
            gravity_mps2: level_force_mps2.norm(),
            up: level_force_mps2.normalize(),
            felt: level_force_mps2.normalize(),
            tipped: Manoeuvred::default(),
            pulled: Manoeuvred::default(),
            horizon: start,
            last_level: start,
            last_vertical: start,
            walked: [start; 3],
        }
    }

    /// Takes over what is believed of the parameters, before anything else.
    pub fn believe(&mut self, prior: &Parameters) {
        self.parameters = *prior;
        self.corrections = LeastSquares::from_prior(&prior.sigma);
        self.followed.error.tilt_rad.z = prior.value(index::AZIMUTH);
        let azimuth = prior.sigma(index::AZIMUTH);
        self.added.tilt_rad.z = math::single(azimuth * azimuth);
    }

    /// The moment it stands at.
    pub fn horizon(&self) -> Time {
        self.horizon
    }

    /// The error of the INS at the horizon.
    pub fn error(&self) -> &InsError {
        &self.followed.error
    }

    /// What is known of the parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Specific force in the body at the level attitude of the mount, m/s^2.
    pub fn level_force_mps2(&self) -> &Vector3<f64> {
        &self.level_force_mps2
    }

    /// How the level innovations compare with what they should be, and the vertical ones.
    pub fn surprise(&self) -> (&Surprise, &Surprise) {
        (&self.surprise, &self.vertical_surprise)
    }

    /// Spread of roll and pitch, rad, with all parameters known.
    pub fn tilt_sigma_rad(&self) -> f64 {
        math::sqrt(self.level.tilt())
    }

    /// Variance of the tilt that scale errors and misalignments of the gyros leave in turns about
    /// the vertical, along each body axis, rad^2. Gyros that read `p` of such a turn in a level
    /// direction tilt the platform by as much, and the level accelerometers seem biased by `-g p`:
    /// turns never tell one from the other, so it is neither estimated nor forgotten. With scale
    /// errors `s`, `p_k = u_k (s_k - sum s_j u_j^2)` on a unit whose up axis is `u`.
    pub fn unseen_tilt(&self, config: &Config) -> Vector3<f64> {
        let s = &config.sensors;
        let u2 = self
            .level_force_mps2
            .map(|f| (f / GRAVITY_EQUATOR_MPS2) * (f / GRAVITY_EQUATOR_MPS2));
        let u4 = u2.norm_squared();
        let misaligned = s.misalignment_rad * s.misalignment_rad;
        u2.map(|u2| {
            let scale = s.gyro_scale * s.gyro_scale * u2 * math::max(1.0 - 2.0 * u2 + u4, 0.0);
            scale + misaligned * math::max(1.0 - u2, 0.0)
        })
    }

    /// What else the biases of the accelerometers may hold, as a variance along each body axis,
    /// `(m/s^2)^2`: `g` times that tilt, and the gravity of a height that is not known.
    pub fn unseen_accel(&self, config: &Config) -> Vector3<f64> {
        let tilted = GRAVITY_EQUATOR_MPS2 * GRAVITY_EQUATOR_MPS2;
        let up = self.level_force_mps2 / GRAVITY_EQUATOR_MPS2;
        let lighter = GRADIENT_PER_S2 * GRADIENT_PER_S2 * self.vertical.position();
        self.unseen_tilt(config) * tilted + up.component_mul(&up) * lighter
    }

    /// Spread of position, velocity and attitude, ENU, `seconds` after the horizon.
    pub fn sigma(&self, seconds: f64, config: &Config) -> SolutionSigma {
        let unseen = 0.5 * self.unseen_tilt(config).sum();
        let (level, up) = (&self.level, &self.vertical);
        let sigma = |level: f64, up: f64, added: &Vector3<f32>| {
            (Vector3::new(level, level, up) + added.map(f64::from) * self.inflation())
                .map(math::sqrt)
        };
        let Self { added, .. } = self;
        let attitude_rad = sigma(level.tilt() + unseen, self.azimuth_walk, &added.tilt_rad);
        let mut velocity_mps = sigma(level.velocity(), up.velocity(), &added.velocity_mps);
        let mut position_m = sigma(level.position(), up.position(), &added.position_m);
        // A tilt pulls, and a velocity moves, the same way all the time.
        let pulled = GRAVITY_EQUATOR_MPS2 * seconds * attitude_rad;
        let grown =
            |at_horizon: f64, since: f64| math::sqrt(at_horizon * at_horizon + since * since);
        position_m = position_m.zip_map(&(velocity_mps * seconds), grown);
        velocity_mps = velocity_mps.zip_map(&Vector3::new(pulled.y, pulled.x, 0.0), grown);
        // Either of the two is wrong.
        let [velocity, climb, position, height] =
            (self.innovations.each_ref()).map(|kind| kind.disputed(self.horizon));
        let of = |own: [Vector2<f64>; 2], way: [Vector2<f64>; 2], kind: Kind| {
            if self.goes_on(kind) { own[0] } else { way[1] }
        };
        let level = of(velocity, position, Kind::Velocity);
        let up = of(climb, height, Kind::Climb);
        velocity_mps = velocity_mps.zip_map(&level.push(up.x), grown);
        position_m = position_m.zip_map(&position[0].push(height[0].x), grown);
        SolutionSigma {
            position_m,
            velocity_mps,
            attitude_rad,
        }
    }

    /// Inertial samples were missing for `seconds`, between readings that differ by so much, rad/s
    /// and m/s^2: what was filled in may be wrong by half of that, and by an ordinary manoeuvre.
    pub fn on_hole(&mut self, seconds: f64, ends_differ: [f64; 2]) {
        let [rate, accel] = ends_differ;
        let part = math::min(seconds / HIDDEN_S, 1.0);
        let rate = (HIDDEN_RADPS * part + 0.5 * rate) * seconds;
        // Gravity is felt elsewhere after a turn.
        let tipped = 0.5 * part * accel / GRAVITY_EQUATOR_MPS2;
        let accel = (HIDDEN_MPS2 * part + 0.5 * accel) * seconds;
        self.level
            .doubt(accel * accel, 0.01 * rate * rate + tipped * tipped);
        self.vertical.doubt(accel * accel, 0.0);
        let moved = 0.5 * accel * seconds;
        self.level.doubt_position(moved * moved);
        self.vertical.doubt_position(moved * moved);
        self.azimuth_walk += rate * rate;
    }

    /// The INS was found to be wrong, its velocity by this variance: all may be, by what it is when
    /// alignment ends and by some of its biases.
    #[inline(never)]
    fn on_lost(&mut self, variance: f64, config: &Config) {
        let gnss = &config.gnss;
        // What has tilted it has made it run away.
        let variance = math::max(variance, LOST_MPS * LOST_MPS);
        let tilt = variance * (LOST_TILT_RAD / LOST_MPS) * (LOST_TILT_RAD / LOST_MPS);
        self.level = Channel::new(tilt, &gnss.velocity_mps, &gnss.position_m);
        self.level.doubt(variance, 0.0);
        self.level.doubt_position(variance * ASTRAY_S * ASTRAY_S);
        self.forget_noise(&Vector3::z());
        self.lose_vertical(LOST_MPS * LOST_MPS, config);
        self.azimuth_walk += LOST_AZIMUTH_RAD * LOST_AZIMUTH_RAD;
        let prior = config.prior();
        for which in index::GYRO..index::GYRO + 6 {
            let changed = LOST_BIAS * prior.sigma(which);
            self.let_walk(which, math::single(changed * changed));
        }
        self.surprise = Surprise::default();
        self.doubts.add(self.horizon);
        self.azimuth_jump = Jump::default();
        self.gyro_noise.look_anew();
    }

    /// The same of the vertical alone, with this variance of the velocity more.
    #[inline(never)]
    fn lose_vertical(&mut self, variance: f64, config: &Config) {
        let gnss = &config.gnss;
        self.vertical = Channel::new(0.0, &gnss.velocity_up_mps, &gnss.height_m);
        self.vertical.doubt(variance, 0.0);
        self.vertical_surprise = Surprise::default();
        self.forget_noise(&Vector3::new(1.0, 1.0, 0.0));
    }

    /// Vertical velocities so far were wrong, and what they have shown.
    pub fn forget_vertical(&mut self, config: &Config) {
        self.lose_vertical(LOST_MPS * LOST_MPS, config);
        let prior = config.prior();
        let up = self.level_force_mps2 / GRAVITY_EQUATOR_MPS2;
        for first in [index::ACCEL, index::ACCEL_SCALE, index::LEVER_ARM] {
            for (which, up) in (first..).zip(&up) {
                let sigma = up * prior.sigma(which);
                self.let_walk(which, math::single(sigma * sigma));
            }
        }
    }

    /// What GNSS was thought to err by explained some of the INS's own error: `kept` says of which
    /// axes it is kept, by ones.
    fn forget_noise(&mut self, kept: &Vector3<f64>) {
        self.followed.keep_noise(kept);
        for response in estimated(&mut self.responses, &self.corrections) {
            response.keep_noise(&singles(kept));
        }
    }

    /// When it was last found to be wrong.
    pub fn doubted(&self) -> Option<Time> {
        self.doubts.last().max(self.vertical_doubts.last())
    }

    /// Whether believing it less does not mend it.
    pub fn is_hopeless(&self) -> bool {
        self.doubts.is_hopeless()
    }

    /// Whether all that it says can be: else it has been misled, and must begin anew from what is
    /// configured. No other error than an attitude that is far off keeps pulling the vertical.
    pub fn is_sound(&self, config: &Config) -> bool {
        let prior = config.prior();
        let credible = |(value, (prior, sigma)): (&f64, (&f64, &f32))| {
            math::abs(value - prior) <= SOUND_SIGMAS * f64::from(*sigma)
        };
        let parameters = prior.value.iter().zip(&prior.sigma);
        let error = &self.followed.error;
        self.parameters.value.iter().zip(parameters).all(credible)
            && !self.vertical_doubts.is_hopeless()
            && math::all_finite(&error.position_m)
            && math::all_finite(&error.velocity_mps)
            && error.tilt_rad.norm() < SOUND_TILT_RAD
            && self.level.tilt().is_finite()
    }

    /// The error of the INS after what has happened since the horizon, as estimated.
    pub fn error_after(&self, since: &Span, accel_mps2: &Vector3<f64>) -> InsError {
        let forcing = Forcing::over(since, &self.level_force_mps2, &self.parameters, accel_mps2);
        // The horizon is close: the frame stands still.
        let passage = Passage::over(since, &Vector3::zeros(), &forcing, &self.error().tilt_rad);
        self.followed.error.after(since, &passage, &forcing)
    }

    /// Compares the INS at the horizon, which must be a moment of the past, with a fix; whether it
    /// is taken.
    pub fn take(
        &mut self,
        past: &Past,
        kind: Kind,
        difference: &Difference,
        config: &Config,
    ) -> bool {
        let direct = self.shown_directly(past, kind.measured());
        let residual = difference.value - self.predicted(&direct, kind.measured(), difference);
        let by = self.shown_by(&direct, kind.measured());
        let bent = self.bent_variance(past, kind.measured()) + difference.more_variance;
        if kind.is_up() {
            let mut by = by.map(|by| [by.z]);
            self.measure(kind, &mut by, [residual.z], difference, bent, config)
        } else {
            let mut by = by.map(|by| [by.x, by.y]);
            let residual = [residual.x, residual.y];
            self.measure(kind, &mut by, residual, difference, bent, config)
        }
    }

    /// Takes the innovations of one kind, one for each of its axes.
    fn measure<const R: usize>(
        &mut self,
        kind: Kind,
        by: &mut By<R>,
        innovation: [f64; R],
        difference: &Difference,
        bent: f64,
        config: &Config,
    ) -> bool {
        let gnss = &config.gnss;
        let described = kind.noise(config);
        let number = kind as usize;
        let channel = if kind.is_up() {
            &mut self.vertical
        } else {
            &mut self.level
        };
        let (Some(innovations), Some(stated), Some(colour)) = (
            self.innovations.get_mut(number),
            self.stated.get_mut(number),
            self.colours.get_mut(number),
        ) else {
            return false;
        };
        // Of positions nothing else tells what lasts for longer than some minutes; of velocities
        // the innovations tell all.
        let absolute = gnss.trust_stated_sigma || kind.measured() == Measured::Position;
        let relative = match difference.stated_variance {
            Some(variance) if absolute => against_described(variance, described, gnss.noise_range),
            Some(variance) => stated.against_average(variance),
            None => 1.0,
        };
        let learnt = relative * innovations.scale();
        colour.scale(match kind.measured() {
            Measured::Velocity => learnt,
            Measured::Position => math::max(learnt, relative),
        });
        let noise = described.white * described.white * learnt / difference.fixes;
        let white = noise + bent;
        let predicted = channel.predicted(kind.measured());
        let (first_axis, components) = if kind.is_up() { (2, 1.0) } else { (0, 2.0) };
        let pair = Vector2::new(
            innovation.first().copied().unwrap_or(0.0),
            innovation.get(1).copied().unwrap_or(0.0),
        );
        // What the spread of the parameters adds is asked for only where it decides.
        let mut variance = predicted;
        if !is_ordinary(&pair, components * (predicted + white)) {
            variance += self.corrections.mean_variance(by);
        }
        let credit = innovations.judge(self.horizon, &pair, components, variance, white);
        let (surprise, last) = if kind.is_up() {
            (&mut self.vertical_surprise, &mut self.last_vertical)
        } else {
            (&mut self.surprise, &mut self.last_level)
        };
        let seconds = self.horizon.seconds_since(*last);
        *last = self.horizon;
        if kind == Kind::Velocity && seconds > 0.0 {
            let [azimuth, ..] = by;
            self.azimuth_jump
                .take(&innovation, azimuth, predicted + white, seconds);
        }
        let white = match credit {
            Credit::Taken(white) => white,
            Credit::Lost(variance) => {
                self.on_lost_by(kind, variance, config);
                return false;
            }
            // Of the level they say something once they agree. The vertical a single knock tips.
            Credit::Refused => {
                if kind.is_up() {
                    surprise.take(pair.norm_squared() / (variance + white), seconds);
                }
                return false;
            }
        };
        // Both level axes have the same covariance before and the same after.
        let tilt = channel.tilt();
        let gains = channel.update(kind.measured(), white);
        let total = predicted + white;
        for (axis, innovation) in (first_axis..).zip(innovation) {
            self.followed.correct(axis, &gains, innovation);
        }
        let single_gains = gains.map(math::single);
        let responses = estimated(&mut self.responses, &self.corrections);
        for (response, by) in responses.iter_mut().zip(by.iter()) {
            for (axis, by) in (first_axis..).zip(by) {
                response.correct(axis, &single_gains, -by);
            }
        }
        let weights = [math::single(1.0 / total); R];
        let added = self
            .corrections
            .add(by, innovation.map(math::single), weights);
        let square = f64::from(added.square) / components;
        surprise.take(square, seconds);
        // Of something else's variance they say nothing.
        if !gnss.trust_stated_sigma && difference.more_variance < noise {
            let sigmas = pair / math::sqrt(total * 0.5 * components);
            innovations.learn(square, &sigmas, gnss.noise_range);
            // While the parameters themselves are uncertain it says little of the noise.
            if f64::from(added.determinant) < 1.0 + components {
                self.learn_colour(kind, &pair, components, total, config);
            }
        }
        if kind == Kind::Height {
            self.height_sensitivity.take(&pair, total, white);
        }
        if !kind.is_up() {
            let variance = total * math::sqrt(f64::from(added.determinant));
            self.learn_gyro_noise(&pair, variance, gains.z, tilt, config);
        }
        true
    }

    /// Learns how strong the correlated noise of a kind is: of heights from an innovation of so many
    /// components and a variance of each, of the others from what is taken for it.
    fn learn_colour(
        &mut self,
        kind: Kind,
        innovation: &Vector2<f64>,
        components: f64,
        total: f64,
        config: &Config,
    ) {
        let range = config.gnss.noise_range;
        let Some(colour) = self.colours.get_mut(kind as usize) else {
            return;
        };
        if kind == Kind::Height {
            let sensitivity = &self.height_sensitivity;
            colour.learn(sensitivity, innovation, components, total, range);
            return;
        }
        let channel = if kind.is_up() {
            &self.vertical
        } else {
            &self.level
        };
        let square = self.followed.noise_square(kind);
        let left = channel.noise(kind.measured());
        colour.learn_of_estimate(self.horizon, square, left, kind.noise(config), range);
    }

    /// Learns how noisy the gyros are from a level innovation of a variance per component, which was
    /// taken with this gain of the tilt, known to a variance before.
    fn learn_gyro_noise(
        &mut self,
        innovation: &Vector2<f64>,
        variance: f64,
        gain: f64,
        tilt: f64,
        config: &Config,
    ) {
        let left = self.level.tilt();
        let process = &mut self.gyro_noise;
        process.moved(innovation, variance, gain, tilt - left);
        process.look(left, config.sensors.noise_range);
    }

    /// Fixes of a kind were refused for so long that it is the INS which is wrong, by this variance.
    fn on_lost_by(&mut self, kind: Kind, variance: f64, config: &Config) {
        match kind {
            Kind::Position if self.goes_on(Kind::Velocity) => self.level.doubt_position(variance),
            Kind::Height if self.goes_on(Kind::Climb) => self.vertical.doubt_position(variance),
            // Nothing else says how fast it is.
            Kind::Position => self.on_lost(variance / (ASTRAY_S * ASTRAY_S), config),
            Kind::Height => {
                self.lose_vertical(variance / (ASTRAY_S * ASTRAY_S), config);
                self.vertical.doubt_position(variance);
            }
            Kind::Climb => self.lose_vertical(variance, config),
            Kind::Velocity => self.on_lost(variance, config),
        }
    }

    /// Whether the INS was held against measurements of a kind of late.
    fn goes_on(&self, kind: Kind) -> bool {
        let innovations = self.innovations.get(kind as usize);
        innovations.is_some_and(|kind| kind.goes_on(self.horizon))
    }

    /// An INS whose innovations stay too large is not believed any more, nor is its vertical.
    pub fn doubt(&mut self, config: &Config) {
        if self.surprise.lasting_s >= DOUBT_S {
            self.on_lost(0.0, config);
        }
        if self.vertical_surprise.lasting_s > VERTICAL_DOUBT_S {
            self.lose_vertical(LOST_MPS * LOST_MPS, config);
            self.vertical_doubts.add(self.horizon);
        }
    }

    /// Variance per component of what is not linear in the parameters: of a latency in a motion that
    /// bends, of an antenna that swings on an unknown arm, and in a frame that points elsewhere. It goes
    /// as they become known; what jolts hide between two moments of the ring stays, and so does how skew a
    /// receiver smooths.
    fn bent_variance(&self, past: &Past, measured: Measured) -> f64 {
        let square = |x: f64| x * x;
        let p = &self.parameters;
        let latency = square(p.sigma(index::LATENCY));
        let azimuth = square(p.sigma(index::AZIMUTH));
        let arm_axis = |axis: usize| square(p.sigma(index::LEVER_ARM + axis));
        let arm = (arm_axis(0) + arm_axis(1) + arm_axis(2)) / 3.0;
        let (first, second, third, swing) = match measured {
            Measured::Velocity => (
                &past.accel_mps2,
                &past.jerk_mps3,
                &past.snap_mps4,
                &past.attitude_accel,
            ),
            Measured::Position => (
                &past.velocity_mps,
                &past.accel_mps2,
                &past.jerk_mps3,
                &past.attitude_rate,
            ),
        };
        let turned = 0.5 * azimuth * first.norm_squared();
        let swung = arm * swing.norm_squared() / 3.0;
        let bent = 0.25 * latency * second.norm_squared();
        // The times of an exponential of variance s have a third moment of 2 s^1.5.
        let smoothing_s2 = math::max(p.value(index::SMOOTHING), 0.0);
        let skew = square(smoothing_s2) * smoothing_s2 / 9.0 * third.norm_squared();
        let unseen = match measured {
            Measured::Velocity => self.unseen_variance(past),
            Measured::Position => 0.0,
        };
        unseen + skew + latency * (bent + swung + turned)
    }

    /// Variance of a velocity by what is too fast for the ring.
    fn unseen_variance(&self, past: &Past) -> f64 {
        let p = &self.parameters;
        let smoothing = 0.5 * p.sigma(index::SMOOTHING) * (1.0 - seen_jerk(past));
        past.unseen_velocity
            + past.unseen_rate * p.lever_arm().norm_squared()
            + 0.5 * smoothing * smoothing * past.jerk_mps3.norm_squared()
    }

    /// Carries the observer over a span that ends at `to`, in a frame that turns at `frame_rate`.
    pub fn propagate(
        &mut self,
        span: &Span,
        to: Time,
        frame_rate: &Vector3<f64>,
        accel_mps2: &Vector3<f64>,
        config: &Config,
    ) {
        let forcing = Forcing::over(span, &self.level_force_mps2, &self.parameters, accel_mps2);
        let passage = Passage::over(span, frame_rate, &forcing, &self.error().tilt_rad);
        self.followed.error = self.followed.error.after(span, &passage, &forcing);
        let azimuth_sigma = self.parameters.sigma(index::AZIMUTH);
        let azimuth = self.followed.error.tilt_rad.z;
        self.parameters.set(index::AZIMUTH, azimuth, azimuth_sigma);

        let [velocity, climb, position, height] = &self.colours;
        let gnss = &config.gnss;
        let renewal =
            |noise: &Noise, colour: &Colour| Renewal::over(span.seconds, noise, colour.strength());
        let level = [
            renewal(&gnss.velocity_mps, velocity),
            renewal(&gnss.position_m, position),
        ];
        let up = [
            renewal(&gnss.velocity_up_mps, climb),
            renewal(&gnss.height_m, height),
        ];
        self.height_sensitivity.renew(&up[1]);
        let kept = |renewals: &[Renewal; 2]| renewals.map(|renewal| renewal.keep);
        self.followed.renew(kept(&level), kept(&up));

        let single_passage = passage.single();
        let (level_keep, up_keep) = (kept(&level).map(math::single), kept(&up).map(math::single));
        let responses = estimated(&mut self.responses, &self.corrections);
        for response in responses.iter_mut() {
            response.error.carry(&single_passage);
            response.renew(level_keep, up_keep);
        }
        for_each_input(span, &self.level_force_mps2, |which, input| {
            if let Some(response) = responses.get_mut(which) {
                response.error.feed(&single_passage, &input.single());
            }
        });
        self.grow_noise(span, level, up, config);
        self.unsolved_s += span.seconds;
        self.horizon = to;
    }

    /// Lets the channels grow by the noises, with the correlated ones of GNSS.
    fn grow_noise(&mut self, span: &Span, level: [Renewal; 2], up: [Renewal; 2], config: &Config) {
        let s = &config.sensors;
        let shares = |noise: &[f64; 3], ratio: f64| {
            let noise = Vector3::from(*noise);
            let variance = noise.component_mul(&noise) * ratio;
            level_and_up(&span.attitude_s, span.seconds, &variance)
        };
        let (gyro_level, gyro_up) = shares(&s.gyro_noise, self.gyro_noise.ratio());
        let (accel_level, accel_up) = shares(&s.accel_noise, 1.0);
        self.gyro_noise
            .came(span.seconds, gyro_level * span.seconds);
        let growth = Growth {
            seconds: span.seconds,
            force_up_mps: span.force_mps.z,
            force_up_moved_m: span.force_moved_m.z,
            accel_noise: accel_level,
            gyro_noise: gyro_level,
        };
        self.level.propagate(&growth, level);
        self.vertical.propagate(
            &Growth {
                seconds: span.seconds,
                force_up_mps: 0.0,
                force_up_moved_m: 0.0,
                accel_noise: accel_up,
                gyro_noise: 0.0,
            },
            up,
        );
        self.azimuth_walk += gyro_up * span.seconds;
        self.doubt_manoeuvre(span, config);
    }

    /// Errors of scale and misalignment turn the platform as the vehicle turns and push it as the
    /// vehicle is pushed. What has no parameter is noise: of an error that grows with the turn
    /// itself, not with its square root.
    fn doubt_manoeuvre(&mut self, span: &Span, config: &Config) {
        let up = span.attitude_s.row(2).transpose() / span.seconds;
        let tipped = self.tipped.grow(&(up - self.up), span.seconds);
        self.up = up;
        let felt = span.attitude_s.tr_mul(&span.force_mps) / (span.seconds * span.seconds);
        if let Some(felt) = felt.try_normalize(0.5 * self.gravity_mps2) {
            self.felt = felt;
        }
        let cross = config.sensors.cross_axis_variance();
        let tilt = cross * tipped;
        self.level.doubt(0.0, tilt);
        self.azimuth_walk += tilt;
        let pull = Vector3::new(span.force_mps.x, span.force_mps.y, 0.0);
        let pulled = self.pulled.grow(&pull, span.seconds);
        self.level.doubt(cross * pulled, 0.0);
        // Level force on a tilted platform, as in a steep bank: the channels are otherwise apart.
        self.vertical
            .doubt((2.0 * cross + self.level.tilt()) * pulled, 0.0);
    }

    /// What receiver and antenna add to INS minus GNSS.
    fn shown_directly<'a>(&self, past: &'a Past, measured: Measured) -> Direct<'a> {
        let arm_m = self.parameters.lever_arm();
        Direct {
            arm_m,
            by_latency: by_latency(past, measured, &arm_m),
            by_smoothing: by_smoothing(past, measured, &arm_m),
            by_lever: by_lever(past, measured),
        }
    }

    /// INS minus GNSS as the parameters would have it.
    fn predicted(
        &self,
        direct: &Direct<'_>,
        measured: Measured,
        difference: &Difference,
    ) -> Vector3<f64> {
        let p = &self.parameters;
        let latency = p.value(index::LATENCY) + self.unsolved_s * p.value(index::CLOCK_DRIFT);
        let late = direct.by_latency * (latency - difference.latency_applied_s);
        let smoothed = direct.by_smoothing * p.value(index::SMOOTHING);
        self.followed.shows(measured) + late + smoothed - direct.by_lever * direct.arm_m
    }

    /// What a unit of each parameter more would add to that.
    fn shown_by(&self, direct: &Direct<'_>, measured: Measured) -> [Vector3<f32>; COUNT] {
        let mut by = [Vector3::zeros(); COUNT];
        let shown = self.responses.iter().take(self.corrections.count());
        for (by, response) in by.iter_mut().zip(shown) {
            *by = response.shows(measured);
        }
        let by_latency = singles(&direct.by_latency);
        let by_lever = direct.by_lever.map(math::single);
        let mut add = |which: usize, more: Vector3<f32>| {
            if let Some(by) = by.get_mut(which) {
                *by += more;
            }
        };
        add(index::LATENCY, by_latency);
        add(
            index::CLOCK_DRIFT,
            by_latency * math::single(self.unsolved_s),
        );
        for axis in 0..3 {
            add(index::LEVER_ARM + axis, -by_lever.column(axis));
        }
        add(index::SMOOTHING, singles(&direct.by_smoothing));
        by
    }

    /// What is assumed of the noise of GNSS velocity, as strong as configured.
    pub fn velocity_noise(&self, config: &Config) -> Noise {
        let [velocity, ..] = &self.colours;
        let noise = config.gnss.velocity_mps;
        Noise {
            correlated: noise.correlated * math::sqrt(velocity.ratio()),
            ..noise
        }
    }

    /// Makes azimuth and latency those of the horizon: the first of the pieces that end with a
    /// solution. Time that passes between them is the next solution's.
    #[inline(never)]
    pub fn come_to_horizon(&mut self) {
        self.come_to_now();
        self.elapsed_s = self.unsolved_s;
        self.unsolved_s = 0.0;
    }

    /// Lets the azimuth have walked.
    #[inline(never)]
    pub fn let_azimuth_walk(&mut self) {
        let known = self.parameters.sigma(index::AZIMUTH);
        let known = known * known + self.azimuth_walk;
        if let Some(jump) = self.azimuth_jump.square(known, self.inflation()) {
            self.azimuth_walk += jump;
            self.doubts.note(self.horizon);
        }
        self.let_walk(index::AZIMUTH, math::single(self.azimuth_walk));
        self.azimuth_walk = 0.0;
    }

    /// Lets the biases of one axis have walked, that of which they last did longest ago.
    #[inline(never)]
    pub fn let_biases_walk(&mut self, config: &Config) {
        let walked = self.walked.iter_mut().enumerate();
        let Some((axis, last)) = walked.min_by_key(|(_, last)| **last) else {
            return;
        };
        let seconds = self.horizon.seconds_since(*last);
        *last = self.horizon;
        let s = &config.sensors;
        for (first, walk) in [
            (index::GYRO, s.gyro_bias_walk),
            (index::ACCEL, s.accel_bias_walk),
        ] {
            self.let_walk(first + axis, math::single(walk * walk * seconds));
        }
    }

    /// Lets each of three parameters have walked by a variance.
    fn let_three_walk(&mut self, first: usize, variance: f64) {
        for which in first..first + 3 {
            self.let_walk(which, math::single(variance));
        }
    }

    /// Solves for the parameters.
    #[inline(never)]
    pub fn solve(&mut self) {
        let corrections = self.corrections.solve();
        self.corrections.count_from_solution();
        let mut total = Followed::<f64>::zero();
        let responses = estimated(&mut self.responses, &self.corrections);
        for (response, by) in responses.iter().zip(&corrections) {
            total.add_scaled(&response.double(), f64::from(*by));
        }
        self.followed.add_scaled(&total, 1.0);
        self.parameters.value += corrections.map(f64::from);
        for (constancy, by) in self.constancy.iter_mut().zip(&corrections) {
            constancy.moved(*by);
        }
    }

    /// Brings one spread up to date, each in its turn: of the parameters, and of what they add to
    /// the components of the INS error.
    #[inline(never)]
    pub fn spread_next(&mut self) {
        let turn = usize::from(self.next_spread);
        let which = turn / 2;
        if let Some(more) = self.given_back.take() {
            self.let_walk(which, more);
        } else if turn % 2 == 0 {
            self.add_up(which % COMPONENTS);
        } else {
            self.look_at(which);
        }
        // To give something back is a piece of work of its own.
        if self.given_back.is_none() {
            self.next_spread = if turn + 1 < 2 * COUNT {
                self.next_spread + 1
            } else {
                0
            };
        }
    }

    /// The spread of a parameter, and whether it moves as that says. The azimuth moves with the
    /// others, and walks as the gyros do.
    fn look_at(&mut self, which: usize) {
        if which >= self.corrections.count() {
            return;
        }
        let variance = self.corrections.variance(which);
        let sigma = math::sqrt(f64::from(variance) * self.inflation_of(which));
        let value = self.parameters.value(which);
        self.parameters.set(which, value, sigma);
        if let Some(constancy) = self.constancy.get_mut(which)
            && which != index::AZIMUTH
        {
            self.given_back = constancy.look(variance);
        }
    }

    /// What the spreads of the parameters add to the variance of one component.
    fn add_up(&mut self, component: usize) {
        let by: [f32; COUNT] = core::array::from_fn(|which| {
            self.responses
                .get(which)
                .and_then(|response| response.error.component(component))
                .copied()
                .unwrap_or(0.0)
        });
        let variance = self.corrections.variance_of(by);
        if let Some(added) = self.added.component_mut(component) {
            *added = variance;
        }
    }

    /// Factor by which colour that the model does not hold makes variances too small.
    fn inflation(&self) -> f64 {
        let [velocity, _, position, _] = &self.innovations;
        if velocity.has_learnt() {
            velocity.inflation()
        } else {
            position.inflation()
        }
    }

    /// The same, and by what it moves more than it should.
    fn inflation_of(&self, which: usize) -> f64 {
        let own = self.constancy.get(which).map_or(1.0, Constancy::inflation);
        self.inflation() * own
    }

    /// Makes azimuth and latency those of the horizon, where the other parameters have moved them.
    fn come_to_now(&mut self) {
        let azimuth = Row::from_fn(|which, _| match self.responses.get(which) {
            Some(response) if which != index::AZIMUTH => response.error.tilt_rad.z,
            _ => 0.0,
        });
        self.carry_forward(index::AZIMUTH, &azimuth);
        let responses = estimated(&mut self.responses, &self.corrections);
        for (response, unit) in responses.iter_mut().zip(&UNIT_RESPONSES) {
            response.error.tilt_rad.z = unit.error.tilt_rad.z;
        }
        let mut latency = Row::zeros();
        if let Some(drift) = latency.get_mut(index::CLOCK_DRIFT) {
            *drift = math::single(self.unsolved_s);
        }
        let before = self.corrections.variance(index::LATENCY);
        self.carry_forward(index::LATENCY, &latency);
        let drifted = self.corrections.variance(index::LATENCY) - before;
        if let Some(constancy) = self.constancy.get_mut(index::LATENCY) {
            constancy.walked(drifted);
        }
        let p = &mut self.parameters;
        p.shift(
            index::LATENCY,
            self.unsolved_s * p.value(index::CLOCK_DRIFT),
        );
    }

    /// Makes the biases of the accelerometers those of the mean attitude so far, where their
    /// scale errors have moved them: the first level was that of the biased accelerometers. Of a
    /// mount that has slipped it is the mean attitude since, and what their misalignments have
    /// moved them by is not known.
    #[inline(never)]
    pub fn level_anew(&mut self, config: &Config) {
        let slipped = self.slips();
        self.levelled_s = math::min(self.levelled_s + self.elapsed_s, LEVEL_MEMORY_S);
        let part = math::min(self.elapsed_s / self.levelled_s, 1.0);
        let level = self.level_force_mps2 / self.gravity_mps2;
        let mean = slipped.unwrap_or_else(|| level.lerp(&self.up, part));
        // The mean of directions is shorter than each, and gravity is not.
        let Some(mean) = mean.try_normalize(0.5) else {
            return;
        };
        let step = mean * self.gravity_mps2 - self.level_force_mps2;
        self.level_force_mps2 += step;
        for (axis, step) in step.iter().enumerate() {
            let (bias, scale) = (index::ACCEL + axis, index::ACCEL_SCALE + axis);
            let mut by = Row::zeros();
            if let Some(by) = by.get_mut(scale) {
                *by = math::single(*step);
            }
            self.carry_forward(bias, &by);
            self.parameters
                .shift(bias, step * self.parameters.value(scale));
        }
        if slipped.is_some() {
            self.levelled_s = FIRST_LEVEL_S;
            self.lately = [Vector3::zeros(); 2];
            let moved = config.sensors.cross_axis_variance() * step.norm_squared();
            self.let_three_walk(index::ACCEL, moved);
        }
    }

    /// The level attitude of the mount after it has slipped, if it has.
    fn slips(&mut self) -> Option<Vector3<f64>> {
        let part = math::min(self.elapsed_s / FIRST_LEVEL_S, 1.0);
        let level = self.level_force_mps2 / self.gravity_mps2;
        let mut off = true;
        for (lately, now) in self.lately.iter_mut().zip([self.up, self.felt]) {
            *lately += (now - level - *lately) * part;
            off &= lately.norm_squared() > SLIPPED_RAD * SLIPPED_RAD;
        }
        let [up, _] = self.lately;
        off.then(|| level + up)
    }

    /// Makes parameter `which` that of now, where it is greater by `by` times the later ones.
    fn carry_forward(&mut self, which: usize, by: &Row) {
        self.corrections.redefine(which, by);
        let Some(own) = self.responses.get(which).copied() else {
            return;
        };
        for (response, by) in self.responses.iter_mut().zip(by) {
            if *by != 0.0 {
                response.add_scaled(&own, -by);
            }
        }
    }

    /// Lets a parameter have walked by a variance.
    ///
    /// What the INS shows of it was caused by what it was before. That is what it is now less the
    /// step, of which the least squares know a part: the rest is noise of the INS (Hsieh and Chen,
    /// Optimal solution of the two-stage Kalman estimator, IEEE TAC 44, 1999).
    fn let_walk(&mut self, which: usize, variance: f32) {
        if let (Some(step), Some(mut caused)) = (
            self.corrections.diffuse(which, variance),
            self.responses.get(which).copied(),
        ) {
            if which == index::AZIMUTH {
                // The platform has turned with it.
                caused.error.tilt_rad.z = 0.0;
            }
            for (response, by) in self.responses.iter_mut().zip(&step.by) {
                response.add_scaled(&caused, *by);
            }
            let caused = caused.double();
            self.followed.add_scaled(&caused, -f64::from(step.z));
            let variance = f64::from(step.variance);
            for axis in 0..2 {
                self.level.doubt_along(&caused.states(axis), 0.5 * variance);
            }
            self.vertical.doubt_along(&caused.states(2), variance);
        }
        if let Some(constancy) = self.constancy.get_mut(which) {
            constancy.walked(variance);
        }
    }

    /// Latency `seconds` before the horizon and its spread, s.
    pub fn latency_before(&self, seconds: f64) -> (f64, f64) {
        let mut coefficients = Row::zeros();
        if let Some(now) = coefficients.get_mut(index::LATENCY) {
            *now = 1.0;
        }
        if let Some(drift) = coefficients.get_mut(index::CLOCK_DRIFT) {
            *drift = -math::single(seconds);
        }
        let p = &self.parameters;
        let value = p.value(index::LATENCY) - seconds * p.value(index::CLOCK_DRIFT);
        let variance = f64::from(self.corrections.variance_of(coefficients.into()));
        let inflation = self.inflation_of(index::LATENCY);
        (value, math::sqrt(variance * inflation))
    }

    /// Takes a measured azimuth error that is off by `residual` of what it should be; whether it is
    /// credible.
    pub fn take_azimuth(&mut self, residual_rad: f64, sigma_rad: f64) -> bool {
        let by: [f32; COUNT] = core::array::from_fn(|which| {
            self.responses
                .get(which)
                .map_or(0.0, |r| r.error.tilt_rad.z)
        });
        let noise = sigma_rad * sigma_rad;
        let own =
            f64::from(self.corrections.variance_of(by)) * self.inflation() + self.azimuth_walk;
        if residual_rad * residual_rad > AGREES_SIGMAS * AGREES_SIGMAS * (own + noise) {
            return false;
        }
        let mut row = by.map(|by| [by]);
        self.corrections.add(
            &mut row,
            [math::single(residual_rad)],
            [math::single(1.0 / noise)],
        );
        true
    }

    /// Adds a direct measurement of three parameters from `first` on, other than the azimuth.
    pub fn measure_directly(&mut self, first: usize, value: &Vector3<f64>, variance: f64) {
        let corrections = singles(&(value - self.parameters.vector(first)));
        self.corrections
            .add_direct(first, corrections.into(), math::single(variance));
    }
}

/// The responses to the parameters that are not known exactly.
fn estimated<'a>(
    responses: &'a mut [Followed<f32>; COUNT],
    parameters: &LeastSquares<COUNT, PAIRS>,
) -> &'a mut [Followed<f32>] {
    responses.get_mut(..parameters.count()).unwrap_or_default()
}

/// What a unit of latency and of smoothing adds to INS minus GNSS, and of the arm takes from it, with the
/// antenna on that arm.
struct Direct<'a> {
    arm_m: Vector3<f64>,
    by_latency: Vector3<f64>,
    by_smoothing: Vector3<f64>,
    by_lever: &'a Matrix3<f64>,
}

/// What a unit of latency adds to INS minus GNSS, with the antenna on such an arm `l`: by `C l` it is
/// away from the sensors, and by the derivatives of that it moves otherwise. What swings on an arm of
/// metres is felt in these more than in what the sensors do.
fn by_latency(past: &Past, measured: Measured, arm_m: &Vector3<f64>) -> Vector3<f64> {
    match measured {
        Measured::Velocity => past.accel_mps2 + past.attitude_accel * arm_m,
        Measured::Position => past.velocity_mps + past.attitude_rate * arm_m,
    }
}

/// What a unit of each component of that arm takes from it.
fn by_lever(past: &Past, measured: Measured) -> &Matrix3<f64> {
    match measured {
        Measured::Velocity => &past.attitude_rate,
        Measured::Position => &past.attitude,
    }
}

/// What a unit of smoothing adds to INS minus GNSS: a mean over times of variance `s` lies by
/// `s / 2` times the second derivative off.
fn by_smoothing(past: &Past, measured: Measured, arm_m: &Vector3<f64>) -> Vector3<f64> {
    -0.5 * match measured {
        Measured::Velocity => seen_jerk(past) * past.jerk_mps3,
        Measured::Position => by_latency(past, Measured::Velocity, arm_m),
    }
}

/// Part of the jerk that is the vehicle's, and not what swings faster than the ring leave in it:
/// they show in the fixes as well, and would be taken for smoothing.
fn seen_jerk(past: &Past) -> f64 {
    let jerk = past.jerk_mps3.norm_squared();
    jerk / (jerk + SWING_PER_S4 * past.unseen_velocity + 1e-9)
}

//! The lines of `host-sim rehearse --with`, for filters in Rust: docs/rehearse.md has them.
#![allow(dead_code, reason = "no filter wants all of it")]

use std::io::{BufRead, Result, Write, stdin, stdout};

/// What is told of unit and receiver, SI units.
#[derive(Clone, Copy, Debug)]
pub struct Unit {
    pub gyro_noise: f64,
    pub gyro_bias: f64,
    pub gyro_bias_walk: f64,
    pub accel_noise: f64,
    pub accel_bias: f64,
    pub accel_bias_walk: f64,
    pub velocity_sigma: f64,
    pub position_sigma: f64,
    pub height_sigma: f64,
    pub latency: f64,
}

/// Latitude and longitude, deg, and height, m; velocity north-east-down, m/s; roll, pitch and
/// heading, deg.
pub type State = [[f64; 3]; 3];

/// Where it begins, and one sigma of that; a heading that is not told is NaN.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub t: f64,
    pub state: State,
    pub position_m: f64,
    pub velocity_mps: f64,
    pub level_deg: f64,
    pub heading_deg: f64,
}

/// A filter.
pub trait Filter: Sized {
    /// Before the first sample.
    fn start(unit: &Unit, start: &Start) -> Option<Self>;
    /// Turned by `theta` rad and pushed by `dv` m/s, forward-right-down, over `dt` to `t`, s.
    fn imu(&mut self, t: f64, dt: f64, theta: [f64; 3], dv: [f64; 3]);
    /// Position and velocity as in [`State`], where it has them.
    fn gnss(&mut self, t: f64, position: Option<[f64; 3]>, velocity: Option<[f64; 3]>);
    /// None while there is none.
    fn solution(&self) -> Option<State>;
}

/// Answers until the end.
pub fn serve<F: Filter>() -> Result<()> {
    let (mut unit, mut filter) = (None, None::<F>);
    for line in stdin().lock().lines() {
        let line = line?;
        let (kind, rest) = line.split_once(',').unwrap_or((&line, ""));
        let fields = rest
            .split(',')
            .map(|field| field.parse().unwrap_or(f64::NAN));
        let n: Vec<f64> = fields.collect();
        let three = |at: usize| [n[at], n[at + 1], n[at + 2]];
        let whole = |three: [f64; 3]| (!three.iter().any(|x| x.is_nan())).then_some(three);
        match (kind, &mut filter) {
            ("unit", _) => unit = told(&n),
            ("start", _) => {
                let start = Start {
                    t: n[0],
                    state: [three(1), three(4), three(7)],
                    position_m: n[10],
                    velocity_mps: n[11],
                    level_deg: n[12],
                    heading_deg: n[13],
                };
                filter = unit.and_then(|unit| F::start(&unit, &start));
                writeln!(
                    stdout(),
                    "{}",
                    if filter.is_some() {
                        "ready,1"
                    } else {
                        "refused"
                    }
                )?;
            }
            ("imu", Some(filter)) => filter.imu(n[0], n[1], three(2), three(5)),
            ("gnss", Some(filter)) => filter.gnss(n[0], whole(three(1)), whole(three(4))),
            ("ask", Some(filter)) => match filter.solution() {
                Some(found) => {
                    let found = found
                        .concat()
                        .iter()
                        .map(f64::to_string)
                        .collect::<Vec<_>>()
                        .join(",");
                    writeln!(stdout(), "solution,{rest},{found}")?;
                }
                None => writeln!(stdout(), "none,{rest}")?,
            },
            _ => {}
        }
        stdout().flush()?;
    }
    Ok(())
}

fn told(n: &[f64]) -> Option<Unit> {
    let n: [f64; 10] = n.try_into().ok()?;
    Some(Unit {
        gyro_noise: n[0],
        gyro_bias: n[1],
        gyro_bias_walk: n[2],
        accel_noise: n[3],
        accel_bias: n[4],
        accel_bias_walk: n[5],
        velocity_sigma: n[6],
        position_sigma: n[7],
        height_sigma: n[8],
        latency: n[9],
    })
}

// --- for filters that want it ---

const EARTH_RADIUS_M: f64 = 6_371_000.0;

/// A position, some seconds on.
pub fn moved([lat, lon, h]: [f64; 3], [north, east, down]: [f64; 3], seconds: f64) -> [f64; 3] {
    let degrees = (seconds / EARTH_RADIUS_M).to_degrees();
    let east = east / lat.to_radians().cos();
    [
        lat + north * degrees,
        lon + east * degrees,
        h - down * seconds,
    ]
}

/// Body to north-east-down: w, x, y, z.
pub fn quaternion([roll, pitch, heading]: [f64; 3]) -> [f64; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] =
        [roll, pitch, heading].map(|deg| (0.5 * deg.to_radians()).sin_cos());
    let (w, x) = (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy);
    let (y, z) = (cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy);
    [w, x, y, z]
}

/// And back.
pub fn angles([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    let roll = (w * x + y * z).atan2(0.5 - x * x - y * y);
    let pitch = (2.0 * (w * y - x * z)).clamp(-1.0, 1.0).asin();
    let heading = (w * z + x * y).atan2(0.5 - y * y - z * z);
    [roll, pitch, heading].map(f64::to_degrees)
}

//! Flight plans: a TOML file, checked against the performance of the aircraft.

use std::path::Path;

use ins_core::earth::{Geodetic, LatLon};
use nalgebra::{Vector2, Vector3};
use serde::Deserialize;
use toml::Spanned;

use super::atmosphere::GRAVITY_MPS2;
use super::dynamics::Dynamics;
use super::input::{InputError, Source, read_text};
use super::performance::{best_climb, climb_rate_mps, max_speed, stall_speed_mps};
use super::wind::Turbulence;

#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub start: Start,
    pub wind_enu_mps: Vector3<f64>,
    pub turbulence: Turbulence,
    pub ground_height_m: f64,
    pub bank_rad: f64,
    pub vibration: bool,
    /// With a duration the legs are repeated until its end.
    pub duration_s: Option<f64>,
    pub legs: Vec<Leg>,
}

/// Initial steady level flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    pub position: Geodetic,
    pub heading_rad: f64,
    pub airspeed_mps: f64,
}

/// One leg of the flight; height and airspeed are held, and reached at the autopilot's limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    pub path: Path2d,
    pub height_m: f64,
    pub airspeed_mps: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Path2d {
    /// Along the line from the last waypoint to this one.
    To(LatLon),
    /// A heading, for a time.
    Heading { heading_rad: f64, duration_s: f64 },
    /// A turn with a bank, right positive, for a time.
    Bank { bank_rad: f64, duration_s: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    start: StartTable,
    #[serde(default)]
    air: AirTable,
    #[serde(default)]
    flight: FlightTable,
    leg: Vec<Spanned<LegTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StartTable {
    latitude_deg: Spanned<f64>,
    longitude_deg: Spanned<f64>,
    height_m: Spanned<f64>,
    heading_deg: Spanned<f64>,
    airspeed_mps: Spanned<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct AirTable {
    wind_from_deg: Option<Spanned<f64>>,
    wind_speed_mps: Option<Spanned<f64>>,
    turbulence: Turbulence,
    ground_height_m: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct FlightTable {
    bank_deg: Option<f64>,
    vibration: bool,
    duration_s: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LegTable {
    latitude_deg: Option<Spanned<f64>>,
    longitude_deg: Option<Spanned<f64>>,
    heading_deg: Option<Spanned<f64>>,
    bank_deg: Option<Spanned<f64>>,
    duration_s: Option<Spanned<f64>>,
    height_m: Option<Spanned<f64>>,
    airspeed_mps: Option<Spanned<f64>>,
}

impl Source<'_> {
    /// A number within bounds.
    fn within(
        &self,
        key: &str,
        value: &Spanned<f64>,
        [low, high]: [f64; 2],
        cause: &str,
    ) -> Result<f64, InputError> {
        let number = *value.get_ref();
        if (low..=high).contains(&number) {
            return Ok(number);
        }
        let [low, high] = [low, high].map(tenths);
        self.refuse(key, value, &format!("expected {low} to {high}; {cause}"))
    }

    fn refuse<T>(&self, key: &str, value: &Spanned<f64>, why: &str) -> Result<T, InputError> {
        let message = format!("`{key} = {}`: {why}", value.get_ref());
        Err(self.error(value.span().start, message))
    }

    /// An angle up to so many degrees either way, rad.
    fn angle(
        &self,
        key: &str,
        value: &Spanned<f64>,
        most_deg: f64,
        cause: &str,
    ) -> Result<f64, InputError> {
        let degrees = self.within(key, value, [-most_deg, most_deg], cause)?;
        Ok(degrees.to_radians())
    }

    fn place(
        &self,
        latitude: &Spanned<f64>,
        longitude: &Spanned<f64>,
    ) -> Result<LatLon, InputError> {
        let cause = "is it swapped with the longitude? Nearer to the poles nothing is flown";
        let latitude_rad = self.angle("latitude_deg", latitude, 80.0, cause)?;
        let cause = "east positive; is it counted to 360?";
        let longitude_rad = self.angle("longitude_deg", longitude, 180.0, cause)?;
        Ok(LatLon {
            latitude_rad,
            longitude_rad,
        })
    }

    fn heading(&self, key: &str, value: &Spanned<f64>) -> Result<f64, InputError> {
        self.angle(key, value, 360.0, "clockwise from north")
    }

    fn duration(&self, value: &Spanned<f64>) -> Result<f64, InputError> {
        self.within("duration_s", value, [1.0, LONGEST_S], "it is in seconds")
    }
}

impl Plan {
    pub fn read(file: &Path, dynamics: &Dynamics) -> Result<Self, InputError> {
        let text = read_text(file, "a flight plan")?;
        Self::parse(file, &text, dynamics)
    }

    /// Checks the text of a plan; `file` is for messages.
    pub fn parse(file: &Path, text: &str, dynamics: &Dynamics) -> Result<Self, InputError> {
        let source = Source { file, text };
        let table: File = source.parse("host-sim/plans/route_one_hour.toml")?;
        let cause = "height of the ground above the ellipsoid";
        let ground = (table.air.ground_height_m.as_ref())
            .map(|height| source.within("ground_height_m", height, GROUND_M, cause))
            .transpose();
        let checker = Checker {
            ground_height_m: ground?.unwrap_or(0.0),
            source,
            dynamics,
            bank_deg: table.flight.bank_deg.unwrap_or(BANK_DEG),
        };
        checker.plan(&table)
    }
}

/// A bound for a message: one decimal, rounded towards zero, so that it is accepted itself.
fn tenths(bound: f64) -> f64 {
    (10.0 * bound).trunc() / 10.0
}

struct Checker<'a> {
    source: Source<'a>,
    dynamics: &'a Dynamics,
    bank_deg: f64,
    ground_height_m: f64,
}

/// Default bank of turns.
const BANK_DEG: f64 = 20.0;
/// Waypoints closer than this are the same.
const SAME_PLACE_M: f64 = 1.0;
/// Height of the ground, from the Dead Sea to Everest, m.
const GROUND_M: [f64; 2] = [-500.0, 9000.0];
/// Longest leg at a fixed heading or bank, and longest flight.
const LONGEST_S: f64 = 86_400.0;

impl Checker<'_> {
    fn plan(&self, table: &File) -> Result<Plan, InputError> {
        let s = &self.source;
        let most_rad = self.dynamics.parameters.autopilot.maximum_bank_rad;
        let bank_rad = self.bank_deg.to_radians();
        if !(0.05..=most_rad).contains(&bank_rad) {
            let message = format!(
                "`bank_deg = {}`: expected 3 to {}, the most that the autopilot may ask for",
                self.bank_deg,
                tenths(most_rad.to_degrees())
            );
            return Err(s.error(s.key("bank_deg"), message));
        }
        let start = self.start(&table.start)?;
        let wind_enu_mps = self.wind(&table.air, &start)?;
        let duration_s = table.flight.duration_s.as_ref();
        let duration_s = duration_s
            .map(|duration| s.duration(duration))
            .transpose()?;
        let mut legs: Vec<Leg> = Vec::new();
        for leg in &table.leg {
            let before = legs.last();
            legs.push(self.leg(
                leg,
                before.map_or(start.position.height_m, |leg| leg.height_m),
                before.map_or(start.airspeed_mps, |leg| leg.airspeed_mps),
            )?);
        }
        if legs.is_empty() {
            return Err(s.error(0, "no legs; expected at least one [[leg]]".into()));
        }
        let plan = Plan {
            start,
            wind_enu_mps,
            turbulence: table.air.turbulence,
            ground_height_m: self.ground_height_m,
            bank_rad,
            vibration: table.flight.vibration,
            duration_s,
            legs,
        };
        let offsets: Vec<usize> = table.leg.iter().map(|leg| leg.span().start).collect();
        self.route(&plan, &offsets)?;
        Ok(plan)
    }

    fn wind(&self, air: &AirTable, start: &Start) -> Result<Vector3<f64>, InputError> {
        let s = &self.source;
        let (speed, from) = match (&air.wind_speed_mps, &air.wind_from_deg) {
            (Some(speed), Some(from)) => (speed, from),
            (Some(speed), None) if *speed.get_ref() != 0.0 => {
                let why = "expected `wind_from_deg` beside it: where the wind comes from";
                return s.refuse("wind_speed_mps", speed, why);
            }
            (None, Some(from)) => {
                let why = "expected `wind_speed_mps` beside it; without it there is no wind";
                return s.refuse("wind_from_deg", from, why);
            }
            (_, None) => return Ok(Vector3::zeros()),
        };
        let cause = "in more wind than half the airspeed turns and legs are not kept; \
                     is it in km/h or knots?";
        let most = [0.0, 0.5 * start.airspeed_mps];
        let speed_mps = s.within("wind_speed_mps", speed, most, cause)?;
        let (sin, cos) = libm::sincos(s.heading("wind_from_deg", from)?);
        Ok(-speed_mps * Vector3::new(sin, cos, 0.0))
    }

    fn start(&self, table: &StartTable) -> Result<Start, InputError> {
        let s = &self.source;
        let place = s.place(&table.latitude_deg, &table.longitude_deg)?;
        let position = at(place, self.height(&table.height_m)?);
        let heading_rad = s.heading("heading_deg", &table.heading_deg)?;
        let bank_rad = self.bank_deg.to_radians();
        let airspeed_mps = self.airspeed(&table.airspeed_mps, position.height_m, bank_rad)?;
        Ok(Start {
            position,
            heading_rad,
            airspeed_mps,
        })
    }

    /// Height and airspeed default to those of the leg before.
    fn leg(
        &self,
        spanned: &Spanned<LegTable>,
        height_before_m: f64,
        airspeed_before_mps: f64,
    ) -> Result<Leg, InputError> {
        let leg = spanned.get_ref();
        let path = self.path(spanned)?;
        let height_m = leg.height_m.as_ref();
        let height_m = height_m.map_or(Ok(height_before_m), |height| self.height(height))?;
        let turns_rad = self.bank_deg.to_radians();
        let bank_rad = match path {
            Path2d::Bank { bank_rad, .. } => turns_rad.max(bank_rad.abs()),
            _ => turns_rad,
        };
        // The previous speed must be valid at a new height and in a new bank as well.
        let changed = leg.height_m.as_ref().or(leg.bank_deg.as_ref());
        let carried = changed.map(|value| Spanned::new(value.span(), airspeed_before_mps));
        let airspeed_mps = match leg.airspeed_mps.as_ref().or(carried.as_ref()) {
            Some(airspeed) => self.airspeed(airspeed, height_m, bank_rad)?,
            None => airspeed_before_mps,
        };
        Ok(Leg {
            path,
            height_m,
            airspeed_mps,
        })
    }

    fn path(&self, spanned: &Spanned<LegTable>) -> Result<Path2d, InputError> {
        let s = &self.source;
        let leg = spanned.get_ref();
        let refused = |message: &str| s.error(spanned.span().start, message.to_owned());
        let duration = || match &leg.duration_s {
            Some(duration) => s.duration(duration),
            None => Err(refused(
                "leg without `duration_s`: expected one, since a heading or a bank has no end of \
                 its own",
            )),
        };
        let place = (&leg.latitude_deg, &leg.longitude_deg);
        match (place, &leg.heading_deg, &leg.bank_deg) {
            ((Some(latitude), Some(longitude)), None, None) if leg.duration_s.is_none() => {
                Ok(Path2d::To(s.place(latitude, longitude)?))
            }
            ((None, None), Some(heading), None) => Ok(Path2d::Heading {
                heading_rad: s.heading("heading_deg", heading)?,
                duration_s: duration()?,
            }),
            ((None, None), None, Some(bank)) => {
                let most_deg = (self.dynamics.parameters.autopilot.maximum_bank_rad).to_degrees();
                let cause = "the most that the autopilot may ask for";
                Ok(Path2d::Bank {
                    bank_rad: s.angle("bank_deg", bank, most_deg, cause)?,
                    duration_s: duration()?,
                })
            }
            _ => Err(refused(
                "leg is ambiguous: expected `latitude_deg` and `longitude_deg`, or `heading_deg` \
                 and `duration_s`, or `bank_deg` and `duration_s`",
            )),
        }
    }

    fn height(&self, height: &Spanned<f64>) -> Result<f64, InputError> {
        let value = *height.get_ref();
        let lowest = self.ground_height_m + 50.0;
        if value.is_nan() || value < lowest {
            let why = format!(
                "expected at least {lowest:.0}, 50 m above `ground_height_m`; heights are above the ellipsoid"
            );
            return self.source.refuse("height_m", height, &why);
        }
        let climb = best_climb(self.dynamics, value).map_or(-1.0, |trim| trim.climb_rate_mps);
        if climb < 0.3 {
            let ceiling = super::performance::ceiling_m(self.dynamics, 0.3);
            let name = &self.dynamics.parameters.name;
            let why = if ceiling < 1.0 {
                format!("the {name} does not climb at any height: look at its file")
            } else {
                format!("beyond the ceiling of the {name}, {ceiling:.0} m; is it in feet?")
            };
            return self.source.refuse("height_m", height, &why);
        }
        Ok(value)
    }

    /// True airspeed in turns of this bank.
    fn airspeed(
        &self,
        airspeed: &Spanned<f64>,
        height_m: f64,
        bank_rad: f64,
    ) -> Result<f64, InputError> {
        let value = *airspeed.get_ref();
        let p = &self.dynamics.parameters;
        // In a turn the stall speed grows with the root of the load factor.
        let load_root = libm::sqrt(libm::cos(bank_rad));
        let stall = stall_speed_mps(self.dynamics, height_m, 0.0) / load_root;
        let lowest = p.autopilot.stall_margin * stall;
        if value.is_nan() || value < lowest {
            let why = format!(
                "too slow at {height_m:.0} m: the {} stalls at {stall:.1} m/s in its turns; expected at least {} (true airspeed, margin {})",
                p.name,
                tenths(lowest + 0.1),
                p.autopilot.stall_margin
            );
            return self.source.refuse("airspeed_mps", airspeed, &why);
        }
        let most =
            max_speed(self.dynamics, height_m).map_or(0.0, |t| t.state.velocity_enu_mps.norm());
        let highest = 0.99 * most;
        if value > highest {
            let why = format!(
                "too fast at {height_m:.0} m: the {} reaches {most:.1} m/s in level flight; expected at most {}; is it in km/h or knots?",
                p.name,
                tenths(highest)
            );
            return self.source.refuse("airspeed_mps", airspeed, &why);
        }
        Ok(value)
    }

    /// Legs must be long enough for turns and climbs.
    fn route(&self, plan: &Plan, offsets: &[usize]) -> Result<(), InputError> {
        let (sin, cos) = libm::sincos(plan.start.heading_rad);
        let mut from = Some(plan.start.position);
        let mut turn_before_m = 0.0;
        self.repeats(plan, offsets)?;
        for (i, (leg, &offset)) in plan.legs.iter().zip(offsets).enumerate() {
            let Path2d::To(place) = leg.path else {
                // Where it ends depends on the wind: nothing to check until the next waypoint.
                (from, turn_before_m) = (None, 0.0);
                continue;
            };
            let to = at(place, leg.height_m);
            let Some(from) = from.replace(to) else {
                continue;
            };
            let track = to.enu_from(&from).xy();
            let length_m = track.norm();
            if length_m < SAME_PLACE_M {
                let message =
                    "leg ends where it begins: expected another waypoint than that before";
                return Err(self.source.error(offset, message.into()));
            }
            let direction = track / length_m;
            if i == 0 {
                let ahead = Vector2::new(sin, cos);
                turn_before_m = turn_m(plan, plan.start.airspeed_mps, ahead, direction);
            }
            let turn_after_m = match plan.legs.get(i + 1).map(|next| next.path) {
                Some(Path2d::To(next)) => {
                    let next = at(next, leg.height_m).enu_from(&to).xy().normalize();
                    turn_m(plan, leg.airspeed_mps, direction, next)
                }
                _ => 0.0,
            };
            let needed_m = turn_before_m + turn_after_m;
            if length_m < needed_m {
                return Err(self.source.error(
                    offset,
                    format!(
                        "leg of {length_m:.0} m is too short: the turns at its ends take {needed_m:.0} m at {:.0} m/s and {:.0} deg of bank; move the waypoints apart, fly slower or bank more",
                        leg.airspeed_mps, plan.bank_rad.to_degrees()
                    ),
                ));
            }
            self.climb(plan, leg, from.height_m, length_m, offset)?;
            turn_before_m = turn_after_m;
        }
        Ok(())
    }

    /// Legs that are flown again must not begin with one of no length.
    fn repeats(&self, plan: &Plan, offsets: &[usize]) -> Result<(), InputError> {
        let ends = [plan.legs.first(), plan.legs.last()].map(|leg| leg.map(|leg| leg.path));
        let [Some(Path2d::To(first)), Some(Path2d::To(last))] = ends else {
            return Ok(());
        };
        let [first, last] = [first, last].map(|place| at(place, plan.start.position.height_m));
        if plan.duration_s.is_none() || first.enu_from(&last).xy().norm() >= SAME_PLACE_M {
            return Ok(());
        }
        let message = "this waypoint is that of the first leg, which follows again, since there is \
                       a `duration_s`: expected another waypoint, no leg here, or no `duration_s`";
        let offset = offsets.last().copied().unwrap_or_default();
        Err(self.source.error(offset, message.into()))
    }

    fn climb(
        &self,
        plan: &Plan,
        leg: &Leg,
        from_m: f64,
        length_m: f64,
        offset: usize,
    ) -> Result<(), InputError> {
        let rise_m = leg.height_m - from_m;
        let time_s = length_m / (leg.airspeed_mps + plan.wind_enu_mps.norm());
        let needed_mps = rise_m / time_s;
        let highest = from_m.max(leg.height_m);
        let climb_mps = climb_rate_mps(self.dynamics, leg.airspeed_mps, highest).unwrap_or(0.0);
        let sink_mps = self.dynamics.parameters.autopilot.maximum_descent_mps;
        if needed_mps > 0.9 * climb_mps || -needed_mps > sink_mps {
            return Err(self.source.error(
                offset,
                format!(
                    "{rise_m:+.0} m within a leg of {length_m:.0} m takes {needed_mps:+.1} m/s: expected at most +{:.1} (open throttle at {:.0} m/s) and {:.1} down; make the leg longer or slower",
                    0.9 * climb_mps, leg.airspeed_mps, sink_mps
                ),
            ));
        }
        Ok(())
    }
}

pub(crate) fn at(place: LatLon, height_m: f64) -> Geodetic {
    Geodetic {
        latitude_rad: place.latitude_rad,
        longitude_rad: place.longitude_rad,
        height_m,
    }
}

/// Length of a leg used by a fly-by turn at its end, with the roll into it.
fn turn_m(plan: &Plan, airspeed_mps: f64, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    let fastest_mps = airspeed_mps + plan.wind_enu_mps.norm();
    lead_m(fastest_mps, plan.bank_rad, from, to)
}

/// Distance before a waypoint at which the turn from one direction to the next begins.
pub fn lead_m(ground_speed_mps: f64, bank_rad: f64, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    const ROLL_IN_S: f64 = 3.0;
    let angle_rad = libm::atan2(from.perp(&to).abs(), from.dot(&to));
    // In turns beyond 127 deg the aircraft overshoots the next leg and returns to it.
    let radius_m = ground_speed_mps * ground_speed_mps / (GRAVITY_MPS2 * libm::tan(bank_rad));
    let half = 0.5 * angle_rad;
    radius_m * libm::tan(half.min(1.107)) + 0.5 * ROLL_IN_S * ground_speed_mps * half.min(1.0)
}

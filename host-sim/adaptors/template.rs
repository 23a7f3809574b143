//! An algorithm under test for `host-sim rehearse --with`; `rustc -O template.rs` makes a program
//! of it.
//!
//! Dead reckoning: it goes on from the last fix with its velocity, level and along the track. Put
//! your own filter in its place.

mod lines;

use lines::{Filter, Start, State, Unit};

struct DeadReckoning {
    position: [f64; 3],
    velocity: [f64; 3],
}

impl Filter for DeadReckoning {
    fn start(_unit: &Unit, start: &Start) -> Option<Self> {
        let [position, velocity, _] = start.state;
        Some(Self { position, velocity })
    }

    fn imu(&mut self, _t: f64, dt: f64, _theta: [f64; 3], _dv: [f64; 3]) {
        self.position = lines::moved(self.position, self.velocity, dt);
    }

    fn gnss(&mut self, _t: f64, position: Option<[f64; 3]>, velocity: Option<[f64; 3]>) {
        self.position = position.unwrap_or(self.position);
        self.velocity = velocity.unwrap_or(self.velocity);
    }

    fn solution(&self) -> Option<State> {
        let [north, east, _] = self.velocity;
        let heading = east.atan2(north).to_degrees();
        Some([self.position, self.velocity, [0.0, 0.0, heading]])
    }
}

pub fn main() -> std::io::Result<()> {
    lines::serve::<DeadReckoning>()
}

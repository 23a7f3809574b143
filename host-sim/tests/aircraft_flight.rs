//! Flights of the simulated Cessna 172.

use std::path::Path;
use std::time::Instant;

use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::flight::{Flight, STEP_S};
use host_sim::aircraft::plan::Plan;
use host_sim::aircraft::trajectory::euler;
use host_sim::sim::Motion;

fn route() -> (Dynamics, Plan) {
    let dynamics = Dynamics::new(&cessna172());
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("plans/route_one_hour.toml");
    let plan = Plan::read(&file, &dynamics).unwrap_or_else(|error| panic!("{error}"));
    (dynamics, plan)
}

#[test]
fn flies_the_route() {
    let (dynamics, plan) = route();
    let started = Instant::now();
    let mut flight = Flight::new(&dynamics, &plan, 1).unwrap();
    let duration_s = flight.duration_s().unwrap_or_else(|error| panic!("{error}"));
    println!("{duration_s} s flown in {:?}", started.elapsed());
    for i in 0..(duration_s as u32) {
        let k = flight.kinematics(f64::from(i));
        if i % 20 == 0 {
            let node = flight.node();
            let angles = euler(&node.state);
            let air = node.state.air_data(&flight.inputs().wind);
            println!(
                "{i:5} {:8.4} {:8.4} h {:6.0} ->{:5.0} V {:5.1} ->{:3.0} vz {:5.1} roll {:6.1} pitch {:5.1} hdg {:6.1} b {:5.1} thr {:.2} el {:5.1}",
                flight.position().latitude_rad.to_degrees(), flight.position().longitude_rad.to_degrees(),
                node.state.height_m, flight.target().height_m, air.airspeed_mps, flight.target().airspeed_mps,
                k.velocity_enu_mps.z, angles.roll_rad.to_degrees(), angles.pitch_rad.to_degrees(),
                angles.heading_rad.to_degrees(), air.beta_rad.to_degrees(),
                flight.inputs().controls.throttle, flight.inputs().controls.surfaces.elevator_rad.to_degrees(),
            );
        }
    }
    assert!(STEP_S > 0.0);
}

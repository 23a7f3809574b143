use host_sim::{
    configure, identify,
    kalman::{Noise, Run},
    log,
};
use ins_core::earth::wrap_pi;
use std::path::Path;
fn main() {
    let folder = std::env::args().nth(1).unwrap();
    let every: usize = std::env::args().nth(2).map_or(20, |s| s.parse().unwrap());
    let (log, _) = log::read(Path::new(&folder)).unwrap();
    let config = configure::config(&log, configure::grade(&log, None));
    let noise = Noise::of_config(&config);
    let found = identify::identify(&log, config, &indicatif::ProgressBar::hidden()).unwrap();
    println!("{:?}", found.gnss_outcomes);
    let mut run = Run::new(&log.imu, &log.gnss, config, noise).unwrap();
    for (k, row) in found.history.iter().enumerate() {
        let mut t = None;
        while t.is_none_or(|t| t < row.time) {
            t = run.step(&mut |_, _| {});
            if t.is_none() {
                break;
            }
        }
        if k % every != 0 {
            continue;
        }
        let truth = log
            .truth
            .iter()
            .find(|s| s.time >= row.time)
            .map(|s| (s.euler().heading_rad.to_degrees(), s.velocity_enu_mps));
        let h = row
            .solution
            .map(|s| (s.euler().heading_rad.to_degrees(), s.velocity_enu_mps));
        let f = run.filter();
        let kh = f.map(|f| {
            (
                f.known.ins.heading_rad().to_degrees(),
                f.known.ins.velocity_enu_mps,
            )
        });
        let d = |a: Option<(f64, nalgebra::Vector3<f64>)>| {
            a.zip(truth).map_or("-".into(), |(a, b)| {
                format!(
                    "{:7.1} dv {:6.2}",
                    wrap_pi((a.0 - b.0).to_radians()).to_degrees(),
                    (a.1 - b.1).xy().norm()
                )
            })
        };
        let e = &row.estimates;
        println!(
            "{:7.1} truth {:7.1} v {:5.1} | core {} sig {:5.2} left {:6.2} | kal {} sig {:5.2} | {:?} | gz {:7.0} kal {:7.0} ax {:5.2} {:5.2} ay {:5.2} {:5.2} tau {:6.3}+-{:.3} {:6.3}+-{:.3}",
            row.time.as_seconds(),
            truth.map_or(0.0, |t| t.0),
            truth.map_or(0.0, |t| t.1.norm()),
            d(h),
            e.azimuth_error_rad.sigma.to_degrees(),
            row.azimuth_left_rad.to_degrees(),
            d(kh),
            f.map_or(0.0, |f| f.sigma(8).to_degrees()),
            row.phase,
            e.gyro_bias_radps[2].value / 4.848e-6,
            f.map_or(0.0, |f| f.known.gyro_bias_radps.z / 4.848e-6),
            e.accel_bias_mps2[0].value,
            f.map_or(0.0, |f| f.known.accel_bias_mps2.x),
            e.accel_bias_mps2[1].value,
            f.map_or(0.0, |f| f.known.accel_bias_mps2.y),
            e.gnss_latency_s.value,
            e.gnss_latency_s.sigma,
            f.map_or(0.0, |f| f.known.latency_s),
            f.map_or(0.0, |f| f.sigma(15))
        );
    }
}

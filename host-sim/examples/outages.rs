use host_sim::{configure, kalman::Noise, log, outage, truth::Truth};
use std::path::Path;
fn main() {
    for folder in std::env::args().skip(1) {
        let path = Path::new(&folder);
        let (log, _) = log::read(path).unwrap();
        let simulated = Truth::read(path).unwrap().is_some();
        let grade = configure::grade(&log, None);
        let config = configure::config(&log, grade);
        let noise = Noise::of_config(&config);
        let t = std::time::Instant::now();
        println!("{folder} {:?}", grade);
        if let Some(test) = outage::test(&log, simulated, config, noise).unwrap() {
            if std::env::var("V").is_ok() {
                for i in 0..test.navigators[0].outages.len() {
                    print!("{:7.1}", test.navigators[0].outages[i].start_s);
                    for d in &test.navigators {
                        print!(
                            " | {:8.2} {:7.2}",
                            d.outages[i].position_end_m, d.outages[i].velocity_end_mps
                        );
                    }
                    println!();
                }
            }
            for d in &test.navigators {
                println!(
                    "  {:14} n {:4} pos rms {:8.2} max {:8.2}  vel rms {:7.3} max {:7.3}",
                    d.navigator,
                    d.count,
                    d.position_rms_m,
                    d.position_max_m,
                    d.velocity_rms_mps,
                    d.velocity_max_mps
                );
            }
        }
        println!("  {:?}", t.elapsed());
    }
}

#[cfg(test)]
mod tests {
    use super::super::{fit, filter::*, record::Record};
    use crate::sim::*;
    use crate::sim::errors::*;
    use crate::log::*;
    use indicatif::ProgressBar;
    #[test]
    #[ignore]
    fn probe() {
        let kind = std::env::var("KIND").unwrap();
        let n: u64 = std::env::var("N").unwrap().parse().unwrap();
        let mut model = ErrorModel::hg1700();
        model.gyro_deg_h.bias = match kind.as_str() {
            "wave" => BiasModel::Wave { initial_sigma: 1.0, interval_s: 300.0, jump_mean: 0.2, jump_sigma: 1.0 },
            "cont" => BiasModel::Continuous { initial_sigma: 1.0, slope_sigma_per_s: 1.0/1200.0, correlated_sigma: 1.0, correlation_time_s: 200.0 },
            _ => BiasModel::constant(1.0),
        };
        if let Ok(w) = std::env::var("WHITE") { model.gyro_deg_h.white_noise = w.parse().unwrap(); }
        let mut records = vec![];
        for seed in 0..n {
            let mut c = DriveConfig::new(seed, crate::sim::Grade::Hg1700, 40.0);
            c.recording.errors = model.clone();
            let t = std::time::Instant::now();
            let drive = simulate(&c);
            let t1 = t.elapsed();
            let log = Log { meta: Meta { initial_heading_deg: drive.given_heading_rad.map(f64::to_degrees), grade: Some(crate::log::Grade::Hg1700), ..Meta::new(BodyAxes::Rfu, model.imu.output)}, imu: drive.imu, gnss: drive.gnss, truth: drive.truth };
            let found = crate::identify::identify(&log, crate::configure::config(&log, crate::log::Grade::Hg1700), &ProgressBar::hidden()).unwrap();
            let t2 = t.elapsed();
            let r = Record::new(&log, &found);
            println!("sim {t1:?} ident {t2:?} record {:?} epochs {} rest epochs {} rest blocks {}", t.elapsed(), r.epochs.len(), r.epochs.iter().filter(|e| e.rest_rate_radps.is_some()).count(), r.rest.iter().map(Vec::len).sum::<usize>());
            let mut r = r;
            if std::env::var("NOREST").is_ok() { for e in &mut r.epochs { if e.rest_rate_radps.is_some() { e.broken = true; } } }
            let dof: usize = r.rest.iter().map(|s| s.len()-1).sum::<usize>()*3;
            let ss: f64 = r.rest.iter().map(|s| { let m = s.iter().map(|b| b.rate_radps).sum::<nalgebra::Vector3<f64>>()/s.len() as f64; s.iter().map(|b| (b.rate_radps-m).norm_squared()*b.seconds).sum::<f64>()}).sum();
            println!("rest noise {} rest epoch rms {:?}", (ss/dof as f64).sqrt()/crate::quantities::DEG_H_RADPS, (r.epochs.iter().filter_map(|e| e.rest_rate_radps).map(|v| v.component_mul(&v)*2.0).sum::<nalgebra::Vector3<f64>>()/r.epochs.iter().filter_map(|e| e.rest_rate_radps).count() as f64).map(|v| v.sqrt()/crate::quantities::DEG_H_RADPS));
            records.push(r);
        }
        let deg_h = crate::quantities::DEG_H_RADPS;
        let t = std::time::Instant::now();
        for noise in [2.0, 5.0, 7.5, 10.0, 20.0] {
            let a = filter(&records[0], &Candidate { gyro_noise: noise*deg_h, accel_noise: 5e-4, gnss_sigma_mps: 0.1, dynamics: Dynamics::Continuous{sigma: 1e-9, correlation_time_s: 100.0}});
            println!("noise {noise} {} {:?}", a.log_likelihood, a.constants.map(|m| (m.value/deg_h, m.variance.sqrt()/deg_h)));
        }
        println!("filter {:?}", t.elapsed()/5);
        for k in [fit::Kind::Wave, fit::Kind::Continuous] {
            let t = std::time::Instant::now();
            let f = fit::fit(&records, 5e-4, Some(k)).unwrap();
            println!("{k:?} {:?} loglik {}", t.elapsed(), f.log_likelihood);
            println!("noise {:?}\ngnss {:?}\ninit {:?}", f.noise.scaled(1.0/deg_h), f.gnss_sigma_mps, f.initial_sigma.scaled(1.0/deg_h));
            match f.bias {
                fit::BiasFit::Wave{interval_s, jump_mean, jump_sigma} => println!("int {interval_s:?}\nmean {:?}\nsigma {:?}", jump_mean.scaled(1.0/deg_h), jump_sigma.scaled(1.0/deg_h)),
                fit::BiasFit::Continuous{slope_sigma, correlated_sigma, correlation_time_s} => println!("slope {:?}\nsigma {:?}\ntau {:?}", slope_sigma.scaled(1.0/deg_h), correlated_sigma.scaled(1.0/deg_h), correlation_time_s),
            }
        }
    }
}

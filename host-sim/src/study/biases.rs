//! The true biases at every moment of a simulated recording, drawn again as it drew them: what is
//! kept of a recording are those at its end.

use ins_core::Time;
use nalgebra::Vector3;

use crate::sim::drive::Recording;
use crate::sim::ideal::{Increments, Rates};
use crate::sim::imu::Imu;

/// Of the gyros, rad/s, and of the accelerometers, m/s^2.
pub(crate) type Biases = [Vector3<f64>; 2];

/// At the start, then after each inertial sample, lost ones too; without end.
pub(crate) fn biases(recording: &Recording) -> impl Iterator<Item = Biases> {
    let mut imu = Imu::new(&recording.errors, recording.seed);
    let (imu_hz, mut last) = (recording.imu_hz, Time::default());
    let (still, rates) = (Increments::default(), Rates::default());
    (0_u32..).map(move |count| {
        let time = Time::default().plus_seconds(f64::from(count) / imu_hz);
        if count > 0 {
            let _ = imu.measure(&still, &rates, time.seconds_since(last));
        }
        last = time;
        [imu.gyros.bias(), imu.accels.bias()]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Grade;
    use crate::sim::errors::BiasModel;
    use crate::sim::{DriveConfig, simulate};

    #[test]
    fn they_come_to_those_at_the_end_of_the_recording() {
        let mut recording = DriveConfig::new(3, Grade::Mems, 1.0).recording;
        recording.errors.imu.dropped_fraction = 0.1;
        recording.errors.imu.stamp_jitter_s = 0.002;
        recording.errors.accel_mps2.warming_sigma = 0.1;
        let wave = BiasModel::Wave {
            initial_sigma: 1.0,
            interval_s: 20.0,
            jump_mean: 1.0,
            jump_sigma: 1.0,
        };
        for gyro_bias in [wave, recording.errors.gyro_deg_h.bias.clone()] {
            recording.errors.gyro_deg_h.bias = gyro_bias;
            let all: Vec<Biases> = biases(&recording).take(6001).collect();
            let drive = simulate(&DriveConfig {
                recording: recording.clone(),
                initial_rest_s: None,
            });
            let end = [drive.errors.gyro_bias_radps, drive.errors.accel_bias_mps2];
            assert_eq!(all[6000], end.map(Vector3::from));
            assert_ne!(all[3000], all[6000]);
        }
    }
}

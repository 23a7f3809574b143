//! Allan deviation of readings at rest, from block means of a second up.

use std::path::Path;

use ins_core::rest::RestBlock;
use miette::Result;
use nalgebra::Vector3;

use super::interval::{Interval, sigma_of_squares};
use super::record::Record;
use crate::identify::quantities::DEG_H_RADPS;
use crate::page::{self, output};

/// Fewest clusters behind a point.
const LEAST_CLUSTERS: usize = 3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub tau_s: f64,
    /// Of each axis. The interval has the degrees of freedom of clusters that do not overlap: it is a
    /// little too wide.
    pub deviation: [Interval; 3],
}

/// Overlapping Allan deviation of series of readings, all at once: clusters of 1, 2, 4, ... .
pub fn allan(series: &[Vec<Vector3<f64>>], step_s: f64) -> Vec<Point> {
    (0..)
        .map(|power| 1_usize << power)
        .map_while(|size| {
            let pairs = || series.iter().filter(|s| s.len() >= 2 * size);
            let clusters: usize = pairs().map(|s| s.len() / size - 1).sum();
            let (mut squares, mut count) = (Vector3::zeros(), 0.0);
            for readings in pairs() {
                for pair in readings.windows(2 * size) {
                    let mean =
                        |part: &[Vector3<f64>]| part.iter().sum::<Vector3<f64>>() / size as f64;
                    let change = mean(&pair[size..]) - mean(&pair[..size]);
                    squares += change.component_mul(&change);
                    count += 1.0;
                }
            }
            (clusters >= LEAST_CLUSTERS).then(|| {
                let dof = clusters as f64;
                Point {
                    tau_s: size as f64 * step_s,
                    deviation: [0, 1, 2]
                        .map(|axis| sigma_of_squares(0.5 * squares[axis] / count * dof, dof)),
                }
            })
        })
        .collect()
}

/// Allan deviations of gyros, deg/h, and accelerometers, m/s^2, of all rest in some drives.
#[derive(Clone, Debug, PartialEq)]
pub struct AtRest {
    /// The gyros, body axes right-forward-up, deg/h.
    pub gyro_deg_h: Vec<Point>,
    pub accel_mps2: Vec<Point>,
}

impl AtRest {
    /// Of drives that rested; empty if none did.
    pub fn new(records: &[Record]) -> Self {
        let spans = || records.iter().flat_map(|record| &record.rest);
        let seconds: f64 = spans().flatten().map(|block| block.seconds).sum();
        let step_s = seconds / spans().map(Vec::len).sum::<usize>().max(1) as f64;
        let of = |value: fn(&RestBlock) -> Vector3<f64>| {
            let series: Vec<Vec<Vector3<f64>>> = spans()
                .map(|span| span.iter().map(value).collect())
                .collect();
            allan(&series, step_s)
        };
        Self {
            gyro_deg_h: of(|block| block.rate_radps / DEG_H_RADPS),
            accel_mps2: of(|block| block.force_mps2),
        }
    }

    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let mut names = "tau_s".to_owned();
        for kind in ["gyro_deg_h", "accel_mps2"] {
            for axis in ["right", "forward", "up"] {
                let name = format!("{kind}_{axis}");
                names.extend([",", &name, ",", &name, "_low,", &name, "_high"]);
            }
        }
        let row = |(gyro, accel): (&Point, &Point)| {
            let mut cells = vec![format!("{:.3}", gyro.tau_s)];
            for sigma in gyro.deviation.iter().chain(&accel.deviation) {
                cells.extend(sigma.each().map(|v| format!("{v:.4e}")));
            }
            cells
        };
        let points = self.gyro_deg_h.iter().zip(&self.accel_mps2);
        let text = page::csv(&names, points.map(row))?;
        Ok(output::write(folder, "allan.csv", text)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::noise::Random;

    #[test]
    fn white_noise_falls_with_the_root_of_the_cluster_time() {
        let mut random = Random::stream(5, "allan");
        let series: Vec<Vec<Vector3<f64>>> = [600, 3, 1200]
            .map(|length| {
                (0..length)
                    .map(|_| Vector3::from(random.normal3()))
                    .collect()
            })
            .to_vec();
        let points = allan(&series, 0.5);
        assert!((points[3].tau_s - 4.0).abs() < 1e-12);
        // Up to 256 clusters of 4 blocks and more.
        for point in &points[..6] {
            let expected = (0.5 / point.tau_s).sqrt();
            for sigma in point.deviation {
                assert!(sigma.holds(expected), "{} {sigma:?}", point.tau_s);
            }
        }
    }
}

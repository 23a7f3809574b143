//! ICAO standard atmosphere (Doc 7488), troposphere.

const TEMPERATURE_K: f64 = 288.15;
/// Temperature lapse, K/m.
const LAPSE_KPM: f64 = 0.0065;
pub const SEA_LEVEL_DENSITY_KGPM3: f64 = 1.225;
/// Standard gravity, m/s^2: the gravity of the flight dynamics.
pub const GRAVITY_MPS2: f64 = 9.806_65;
/// Gas constant of air, J/(kg K).
const GAS_CONSTANT: f64 = 287.052_87;
/// Density is proportional to temperature to this power.
const EXPONENT: f64 = GRAVITY_MPS2 / (GAS_CONSTANT * LAPSE_KPM) - 1.0;

/// Air density around a reference height.
///
/// Linear in height, to save a power in every stage of the integrator: 1 m from the reference the relative
/// error is below 1e-8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Density {
    reference_height_m: f64,
    reference_kgpm3: f64,
    slope_kgpm4: f64,
}

impl Density {
    /// Around `height_m`, limited to the troposphere.
    pub fn around(height_m: f64) -> Self {
        let height_m = height_m.clamp(-1000.0, 11_000.0);
        let temperature_k = TEMPERATURE_K - LAPSE_KPM * height_m;
        let reference_kgpm3 =
            SEA_LEVEL_DENSITY_KGPM3 * libm::pow(temperature_k / TEMPERATURE_K, EXPONENT);
        Self {
            reference_height_m: height_m,
            reference_kgpm3,
            slope_kgpm4: -reference_kgpm3 * EXPONENT * LAPSE_KPM / temperature_k,
        }
    }

    /// Density at a height near the reference, kg/m^3.
    pub fn at(&self, height_m: f64) -> f64 {
        self.reference_kgpm3 + self.slope_kgpm4 * (height_m - self.reference_height_m)
    }
}

pub fn density(height_m: f64) -> f64 {
    Density::around(height_m).reference_kgpm3
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ICAO Doc 7488 table values; the geopotential-geometric difference is within 1e-3 here.
    #[test]
    fn agrees_with_the_published_table() {
        for (height_m, published) in [
            (0.0, 1.225),
            (1000.0, 1.1117),
            (3000.0, 0.9093),
            (5000.0, 0.7364),
        ] {
            assert!(
                (density(height_m) / published - 1.0).abs() < 1.5e-3,
                "{height_m} m"
            );
        }
    }

    #[test]
    fn linear_form_is_tangent() {
        let around = Density::around(2000.0);
        assert!((around.at(2001.0) / density(2001.0) - 1.0).abs() < 1e-8);
        assert!((around.at(2010.0) / density(2010.0) - 1.0).abs() < 1e-6);
    }
}

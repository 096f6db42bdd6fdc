//! Coordinates u in which every prior is a standard normal distribution.
//!
//! The coordinate of a parameter x is u = Φ⁻¹(F(x)), where F is the prior's distribution function and Φ the standard normal distribution function. A
//! parameter that the data do not constrain is then standard normal for any prior. A parameter that may be near zero has tails that decay like those
//! of a normal. A mixture of t distributions approximates both well in u, but not in ln x.
//!
//! The unconstrained coordinate z of the sampler is a function of u, stored as a table of values and slopes that cubic polynomials interpolate.
//! Densities use the slope of the cubics as the Jacobian, so their integral has no interpolation error. Only the prior deviates from a standard
//! normal, by about 10⁻⁶.

use crate::LogDensity;
use base::distribution::Distribution;
use statrs::distribution::{ContinuousCDF, Normal};

/// Largest |u| in the table of a coordinate, beyond which lies a probability of 10⁻⁹ on either side. Beyond the table, the sampler's coordinate is
/// linear in u.
const REACH: f64 = 6.0;
/// Number of intervals between the nodes of a coordinate's table.
const N_INTERVALS: usize = 120;
const INTERVAL: f64 = 2.0 * REACH / N_INTERVALS as f64;

/// Log density of the standard normal distribution at a point of any dimension.
pub fn ln_standard_normal(point: &[f64]) -> f64 {
    let squares: f64 = point.iter().map(|u| u * u).sum();
    -0.5 * squares - 0.5 * point.len() as f64 * std::f64::consts::TAU.ln()
}

/// Returns the coordinate of a parameter value in which its prior is standard normal. Values far in a tail are moved to ±6.
pub fn to_normal_coordinate(prior: &Distribution, value: f64) -> f64 {
    Normal::standard().inverse_cdf(prior.cdf(value)).clamp(-REACH, REACH)
}

/// Posterior whose coordinates are transformed so that their priors are standard normal.
pub struct PriorCoordinates<'a> {
    posterior: &'a dyn LogDensity,
    scales: Vec<CoordinateScale>,
}

impl<'a> PriorCoordinates<'a> {
    /// Wraps a posterior. `priors` are the priors of its coordinates, in order.
    pub fn new(posterior: &'a dyn LogDensity, priors: impl IntoIterator<Item = Distribution>) -> Self {
        let scales = priors.into_iter().map(CoordinateScale::new).collect();
        Self { posterior, scales }
    }

    /// Returns the parameter value, in its natural unit, at the standard normal coordinate `u`. `coordinate` is the index of the parameter.
    pub fn natural(&self, coordinate: usize, u: f64) -> f64 {
        let scale = &self.scales[coordinate];
        scale.distribution.from_unconstrained(scale.at(u).0)
    }

    /// Returns the standard normal coordinate of a parameter value. `coordinate` is the index of the parameter. Values far in a tail are moved to ±6.
    pub fn from_natural(&self, coordinate: usize, value: f64) -> f64 {
        to_normal_coordinate(&self.scales[coordinate].distribution, value)
    }
}

impl LogDensity for PriorCoordinates<'_> {
    fn dimension(&self) -> usize {
        self.scales.len()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        let mut ln_slopes = vec![0.0; n];
        let mut sampled = vec![0.0; points.len()];
        for (d, scale) in self.scales.iter().enumerate() {
            for (i, ln_slope) in ln_slopes.iter_mut().enumerate() {
                let (z, slope) = scale.at(points[d * n + i]);
                sampled[d * n + i] = z;
                *ln_slope += slope.ln();
            }
        }
        self.posterior.log_density(&sampled, log_density);
        log_density.iter_mut().zip(&ln_slopes).for_each(|(value, ln_slope)| *value += ln_slope);
    }
}

/// Interpolated function from the standard normal coordinate u of one parameter to the sampler's unconstrained coordinate z.
struct CoordinateScale {
    distribution: Distribution,
    /// Value of the sampler's coordinate z and its slope dz/du at each node of u.
    nodes: Vec<(f64, f64)>,
}

impl CoordinateScale {
    fn new(distribution: Distribution) -> Self {
        let normal = Normal::standard();
        let node = |k: usize| {
            let u = INTERVAL * k as f64 - REACH;
            let z = distribution.to_unconstrained(distribution.quantile(normal.cdf(u)));
            (z, (ln_standard_normal(&[u]) - distribution.ln_pdf_unconstrained(z)).exp())
        };
        Self { distribution, nodes: (0..=N_INTERVALS).map(node).collect() }
    }

    /// Returns the sampler's coordinate z and its slope dz/du at the standard normal coordinate u.
    fn at(&self, u: f64) -> (f64, f64) {
        let along = (u + REACH) / INTERVAL;
        // A NaN selects the first interval, and the result is NaN.
        let k = (along.max(0.0) as usize).min(N_INTERVALS - 1);
        let ((z0, slope0), (z1, slope1)) = (self.nodes[k], self.nodes[k + 1]);
        let t = along - k as f64;
        if t < 0.0 {
            return (z0 + slope0 * INTERVAL * t, slope0);
        }
        if t > 1.0 {
            return (z1 + slope1 * INTERVAL * (t - 1.0), slope1);
        }
        let rise = z1 - z0;
        let (m0, m1) = (slope0 * INTERVAL, slope1 * INTERVAL);
        let (quadratic, cubic) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
        let z = z0 + t * (m0 + t * (quadratic + t * cubic));
        (z, (m0 + t * (2.0 * quadratic + 3.0 * t * cubic)) / INTERVAL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn examples() -> [Distribution; 6] {
        [
            Distribution::LogNormal { median: 1.8, log_sd: 1.25 },
            Distribution::Normal { mean: -0.4, sd: 2.5 },
            Distribution::HalfNormal { sd: 0.7 },
            Distribution::Uniform { lower: -1.0, upper: 3.0 },
            Distribution::LogUniform { lower: 0.01, upper: 50.0 },
            Distribution::Beta { alpha: 2.0, beta: 1.0, lower: 0.3, upper: 1.0 },
        ]
    }

    /// Checks that the parameter value at u has the prior probability Φ(u) below it, also between nodes. The prior of u is therefore standard normal.
    #[test]
    fn priors_are_standard_normals() {
        for distribution in examples() {
            let scale = CoordinateScale::new(distribution);
            for k in 0..97 {
                let u = -4.8 + 0.1 * f64::from(k) + 0.037;
                let (z, slope) = scale.at(u);
                let below = distribution.cdf(distribution.from_unconstrained(z));
                let expected = Normal::standard().cdf(u);
                assert!((below / expected - 1.0).abs() < 1e-5, "{distribution:?} at {u}: {below} {expected}");
                let ln_prior = distribution.ln_pdf_unconstrained(z) + slope.ln();
                assert!((ln_prior - ln_standard_normal(&[u])).abs() < 2e-4, "{distribution:?} at {u}: {ln_prior}");
            }
        }
    }

    /// Checks that the slope is the derivative of the interpolated coordinate z(u), and that z(u) increases, inside and beyond the table.
    #[test]
    fn slopes_are_the_derivatives_of_values() {
        for distribution in examples() {
            let scale = CoordinateScale::new(distribution);
            for k in 0..150 {
                let u = -7.47 + 0.1 * f64::from(k);
                let step = 1e-5;
                let difference = (scale.at(u + step).0 - scale.at(u - step).0) / (2.0 * step);
                let slope = scale.at(u).1;
                assert!(slope > 0.0 && (difference / slope - 1.0).abs() < 1e-5, "{distribution:?} at {u}");
            }
        }
    }
}

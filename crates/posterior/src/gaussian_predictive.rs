//! Predictive distributions that are nearly normal, described by their moments. They occur in long records, whose draws differ by less than the noise.
//!
//! A mixture is a normal distribution with small corrections if its components' means and variances are close together relative to the variance. The Gram–Charlier
//! series approximates its distribution function by Φ(t) − φ(t) [γ₁/6 (t² − 1) + γ₂/24 (t³ − 3t)]. Here t is the standardised position, Φ and φ are the distribution
//! function and density of the standard normal, γ₁ is the skewness and γ₂ the excess kurtosis. Quantiles and scores then have closed forms, which take a few operations
//! per draw. The mixture itself needs an error function per draw.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::full_check::FullCheck;

/// Probabilities of the quantiles that bound the predictive bands, and of the median.
pub const BAND_PROBABILITIES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Largest distance of a draw's normal distribution from the mean of all draws at which the series replaces the mixture. Differences of means are divided by the root
/// of the draws' mean variance, differences of variances by this mean variance. The neglected terms are then below 10⁻⁵ of a standard deviation.
const LARGEST_DISTANCE: f64 = 0.12;

/// Mean, standard deviation, skewness and excess kurtosis of one position's predictive distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NearNormal {
    pub mean_m: f64,
    pub sd_m: f64,
    skewness: f64,
    excess: f64,
}

/// Moments of means and variances over the draws, for each row of a block.
struct Sums {
    mean_m: Vec<f64>,
    variance_m2: Vec<f64>,
    /// Means over the draws of d², d³, d⁴, d w, d² w and w², then the largest |d| and |w|. Here d is a draw's mean minus the mixture's mean, and w is the draw's
    /// variance minus the mean variance.
    d2: Vec<f64>,
    d3: Vec<f64>,
    d4: Vec<f64>,
    dw: Vec<f64>,
    d2w: Vec<f64>,
    w2: Vec<f64>,
    largest_d: Vec<f64>,
    largest_w: Vec<f64>,
}

/// Predictive distributions of the given rows; `None` for a row whose distribution is too far from normal.
pub(super) fn near_normals(check: &FullCheck, rows: std::ops::Range<usize>) -> Vec<Option<NearNormal>> {
    if check.noise.components.iter().any(|components| components != &[1.0]) {
        return vec![None; rows.len()];
    }
    let sums = Sums::new(check, rows.clone());
    (0..rows.len()).map(|k| sums.near_normal(k)).collect()
}

impl Sums {
    fn new(check: &FullCheck, rows: std::ops::Range<usize>) -> Self {
        let zero = || vec![0.0; rows.len()];
        let mut sums = Self {
            mean_m: zero(),
            variance_m2: zero(),
            d2: zero(),
            d3: zero(),
            d4: zero(),
            dw: zero(),
            d2w: zero(),
            w2: zero(),
            largest_d: zero(),
            largest_w: zero(),
        };
        let equal = 1.0 / check.trajectories_m.len() as f64;
        let draws = || check.trajectories_m.iter().zip(&check.noise.sd_m);
        for (x, sd) in draws() {
            let values = x[rows.clone()].iter().zip(&sd[rows.clone()]);
            for ((mean, variance), (x, sd)) in sums.mean_m.iter_mut().zip(&mut sums.variance_m2).zip(values) {
                *mean += equal * x;
                *variance += equal * sd * sd;
            }
        }
        for (x, sd) in draws() {
            let (x, sd) = (&x[rows.clone()], &sd[rows.clone()]);
            for k in 0..rows.len() {
                let (d, w) = (x[k] - sums.mean_m[k], sd[k] * sd[k] - sums.variance_m2[k]);
                let d2 = d * d;
                sums.d2[k] += equal * d2;
                sums.d3[k] += equal * d2 * d;
                sums.d4[k] += equal * d2 * d2;
                sums.dw[k] += equal * d * w;
                sums.d2w[k] += equal * d2 * w;
                sums.w2[k] += equal * w * w;
                sums.largest_d[k] = if d.abs() > sums.largest_d[k] { d.abs() } else { sums.largest_d[k] };
                sums.largest_w[k] = if w.abs() > sums.largest_w[k] { w.abs() } else { sums.largest_w[k] };
            }
        }
        sums
    }

    fn near_normal(&self, k: usize) -> Option<NearNormal> {
        let within = self.variance_m2[k];
        let is_near =
            self.largest_d[k] <= LARGEST_DISTANCE * within.sqrt() && self.largest_w[k] <= LARGEST_DISTANCE * within;
        if !(is_near && within > 0.0) {
            return None;
        }
        let variance = within + self.d2[k];
        let third = self.d3[k] + 3.0 * self.dw[k];
        let fourth = self.d4[k] + 6.0 * self.d2w[k] + 3.0 * self.w2[k] - 3.0 * self.d2[k] * self.d2[k];
        let sd_m = variance.sqrt();
        Some(NearNormal {
            mean_m: self.mean_m[k],
            sd_m,
            skewness: third / (variance * sd_m),
            excess: fourth / (variance * variance),
        })
    }
}

/// Quantiles of the standard normal at the bands' probabilities.
pub(super) fn band_normals() -> [f64; 5] {
    BAND_PROBABILITIES.map(|probability| Normal::standard().inverse_cdf(probability))
}

impl NearNormal {
    /// Quantile (m) with the probability at which the standard normal distribution has the quantile `z` (Cornish & Fisher 1938).
    pub fn quantile_m(&self, z: f64) -> f64 {
        let Self { skewness, excess, .. } = *self;
        let shift = skewness / 6.0 * (z * z - 1.0) + excess / 24.0 * (z * z - 3.0) * z
            - skewness * skewness / 36.0 * (2.0 * z * z - 5.0) * z;
        self.mean_m + self.sd_m * (z + shift)
    }

    /// Continuous ranked probability score (m) of an observation y: E|X − y| − E|X − X′|/2. X and X′ are independent and have the distribution of the series.
    pub fn crps_m(&self, observed_m: f64) -> f64 {
        let standard = Normal::standard();
        let t = (observed_m - self.mean_m) / self.sd_m;
        let density = standard.pdf(t);
        let to_observed = 2.0 * density
            + t * (2.0 * standard.cdf(t) - 1.0)
            + density * (self.skewness * t / 3.0 + self.excess * (t * t - 1.0) / 12.0);
        let between = (1.0 - self.excess / 48.0) / std::f64::consts::PI.sqrt();
        self.sd_m * (to_observed - between)
    }
}

#[cfg(test)]
#[path = "gaussian_predictive_tests.rs"]
mod tests;

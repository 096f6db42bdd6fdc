//! Likelihood of an effect's size in one specimen, relative to no effect.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use statrs::function::erf::erfc;

use criticism::sketch::{EffectSignature, SignatureScore};

/// Upper limit of a log likelihood ratio, with which products of several ratios stay finite. Larger values would not change a result.
pub const LARGEST_LOG_RATIO: f64 = 170.0;
/// Width of a cell, in standard deviations, below which the cell is treated as a point.
const NARROW: f64 = 0.05;
/// Distance in standard deviations beyond which the tail of a normal distribution is treated as exponential.
const FAR: f64 = 8.0;

/// Likelihood ratio between an effect of a given size and no effect, for one specimen. A size is the distance of the effect's parameter from its null. The
/// amplitude of a size is a = ±(size/`unit`)^`power`, positive above the null and negative below it. The log likelihood ratio is `height` − ½(`norm`·a −
/// `z`)².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeLikelihood {
    /// Log likelihood ratio at the most likely amplitude. To first order, it is half the square of `z`.
    pub height: f64,
    /// Most likely amplitude, divided by its standard deviation.
    pub z: f64,
    /// Inverse of the amplitude's standard deviation. It is 0 if the specimen has no information on the effect.
    pub norm: f64,
    /// Size at which the amplitude of the effect is 1.
    pub unit: f64,
    /// Exponent of the size in the amplitude: 2 if the response to the effect begins with the square of its size, otherwise 1.
    pub power: f64,
    /// Largest possible sizes: below the null, then above it. A size of 0 excludes the side.
    pub reach: [f64; 2],
}

/// Side of an effect's null, which is the parameter value at which the effect vanishes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Below the null.
    Below,
    /// Above the null.
    Above,
}

impl SizeLikelihood {
    /// Makes the first-order likelihood from the score of the effect's signature in one record.
    pub fn of(asked: &EffectSignature, reading: SignatureScore) -> Self {
        let SignatureScore { z, norm } = reading;
        Self { height: 0.5 * z * z, z, norm, unit: asked.unit, power: asked.power, reach: asked.reach }
    }

    /// Makes the likelihood from a fit of the effect. `size` is the fitted distance from the null, `sd` its standard deviation, and `gain` the gain in log
    /// likelihood (nats).
    pub fn fitted(size: f64, sd: f64, gain: f64, reach: [f64; 2]) -> Self {
        Self { height: gain, z: size / sd, norm: 1.0 / sd, unit: 1.0, power: 1.0, reach }
    }

    /// Size at which the amplitude is `sigma` standard deviations from 0. The result is infinite if the specimen has no information on the effect.
    pub fn size_at(&self, sigma: f64) -> f64 {
        self.unit * (sigma / self.norm).powf(1.0 / self.power)
    }

    /// Logarithm of the mean likelihood ratio over the amplitudes between two sizes on one side of the null. The result is −∞ beyond the largest possible
    /// size, and at most [`LARGEST_LOG_RATIO`].
    pub fn ln_mean(&self, side: Side, [from, to]: [f64; 2]) -> f64 {
        let (reach, sign) = match side {
            Side::Below => (self.reach[0], -1.0),
            Side::Above => (self.reach[1], 1.0),
        };
        if from >= reach {
            return f64::NEG_INFINITY;
        }
        if self.norm <= 0.0 {
            return 0.0;
        }
        let at = |size: f64| sign * self.norm * (size / self.unit).powf(self.power) - self.z;
        let (a, b) = (at(from), at(to.min(reach)));
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        (self.height + ln_mean_normal(low, high)).min(LARGEST_LOG_RATIO)
    }
}

/// Logarithm of the mean of exp(−½d²) for d between `low` and `high`.
fn ln_mean_normal(low: f64, high: f64) -> f64 {
    let width = high - low;
    if width < NARROW {
        let middle = 0.5 * (low + high);
        return -0.5 * middle * middle;
    }
    // `near` is the distance from 0 to the nearest point of the interval.
    let near = if low > 0.0 {
        low
    } else if high < 0.0 {
        -high
    } else {
        0.0
    };
    if near > FAR {
        // In the tail, exp(−½(d + t)²) ≈ exp(−½d² − dt), where t is the distance beyond the nearer end.
        return -0.5 * near * near + (-(-width * near).exp_m1()).ln() - (width * near).ln();
    }
    let beyond = |d: f64| 0.5 * erfc(d * FRAC_1_SQRT_2);
    // The formula is chosen by the sign, so that no significant digits are lost by subtraction.
    let inside = if low >= 0.0 { beyond(low) - beyond(high) } else { beyond(-high) - beyond(-low) };
    0.5 * (2.0 * PI).ln() + inside.max(f64::MIN_POSITIVE).ln() - width.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the mean likelihood ratios over cells with sums over 20,000 points, on both sides of the null. Amplitudes are proportional to the size or
    /// to its square. The cells are near the peak and 30 standard deviations from it.
    #[test]
    fn means_over_cells_are_those_of_sums() {
        for (z, norm, power) in [(2.0, 3.0, 1.0), (-1.5, 0.7, 1.0), (25.0, 4.0, 2.0), (0.0, 1.0, 2.0), (30.0, 1.0, 1.0)]
        {
            let size_likelihood = SizeLikelihood { height: 0.5 * z * z, z, norm, unit: 0.8, power, reach: [1e9, 1e9] };
            for side in [Side::Below, Side::Above] {
                for cell in [[1e-3, 1.2e-3], [0.5, 0.7], [1.0, 3.0], [4.0, 5.5]] {
                    let sign = if side == Side::Above { 1.0 } else { -1.0 };
                    let [a, b] = cell.map(|size: f64| sign * norm * (size / 0.8).powf(power));
                    let n = 20_000;
                    let at = |k: usize| a + (b - a) * (k as f64 + 0.5) / f64::from(n as u32);
                    let log = |x: f64| 0.5 * z * z - 0.5 * (x - z).powi(2);
                    let largest = (0..n).map(|k| log(at(k))).fold(f64::NEG_INFINITY, f64::max);
                    let sum: f64 = (0..n).map(|k| (log(at(k)) - largest).exp()).sum();
                    let exact = (largest + (sum / n as f64).ln()).min(LARGEST_LOG_RATIO);
                    let found = size_likelihood.ln_mean(side, cell);
                    assert!(
                        (found - exact).abs() < 0.02 * (1.0 + 0.01 * exact.abs()),
                        "{z} {side:?} {cell:?}: {found} {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_the_support_leaves_out_has_no_likelihood_and_what_is_blind_says_nothing() {
        let size_likelihood =
            SizeLikelihood { height: 2.0, z: 2.0, norm: 1.0, unit: 1.0, power: 1.0, reach: [0.0, 3.0] };
        assert_eq!(size_likelihood.ln_mean(Side::Below, [0.1, 0.2]), f64::NEG_INFINITY);
        assert_eq!(size_likelihood.ln_mean(Side::Above, [3.0, 4.0]), f64::NEG_INFINITY);
        assert!((size_likelihood.ln_mean(Side::Above, [1.999, 2.001]) - 2.0).abs() < 1e-3);
        let blind = SizeLikelihood { height: 0.0, z: 0.0, norm: 0.0, ..size_likelihood };
        assert_eq!(blind.ln_mean(Side::Above, [0.1, 0.2]), 0.0);
        assert_eq!(size_likelihood.size_at(2.0), 2.0);
    }
}

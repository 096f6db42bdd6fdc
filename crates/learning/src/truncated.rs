//! Moments of normal distributions whose coordinates have lower bounds.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

/// Number of sweeps of the Gibbs sampler, and number of initial sweeps that are discarded (`N_UNCOUNTED`).
const N_SWEEPS: usize = 4000;
const N_UNCOUNTED: usize = 200;
const SEED: u64 = 0x7a11;

/// Mean and covariance of a normal vector truncated to coordinates above their bounds (−∞ for none). The Gibbs sampler draws each coordinate in turn, given the others.
/// `None` if the covariance has no inverse.
pub fn moments(centre: &[f64], covariance: &DMatrix<f64>, least: &[f64]) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = centre.len();
    let precision = covariance.clone().cholesky()?.inverse();
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut x: Vec<f64> = centre.iter().zip(least).map(|(centre, least)| centre.max(*least)).collect();
    let (mut sum, mut squares) = (vec![0.0; n], DMatrix::<f64>::zeros(n, n));
    for sweep in 0..N_SWEEPS {
        for k in 0..n {
            let others: f64 = (0..n).filter(|j| *j != k).map(|j| precision[(k, j)] * (x[j] - centre[j])).sum();
            let (mean, sd) = (centre[k] - others / precision[(k, k)], precision[(k, k)].sqrt().recip());
            x[k] = mean + sd * upper_normal((least[k] - mean) / sd, rng.random());
            x[k] = x[k].max(least[k]);
        }
        if sweep >= N_UNCOUNTED {
            // Sums of deviations from the centre lose no digits.
            let apart: Vec<f64> = x.iter().zip(centre).map(|(x, centre)| x - centre).collect();
            for i in 0..n {
                sum[i] += apart[i];
                (0..n).for_each(|j| squares[(i, j)] += apart[i] * apart[j]);
            }
        }
    }
    let count = (N_SWEEPS - N_UNCOUNTED) as f64;
    let shift: Vec<f64> = sum.iter().map(|sum| sum / count).collect();
    let covariance = DMatrix::from_fn(n, n, |i, j| squares[(i, j)] / count - shift[i] * shift[j]);
    Some((centre.iter().zip(shift).map(|(centre, shift)| centre + shift).collect(), covariance))
}

/// Returns a standard normal variable above a bound, from a uniform number between 0 and 1. It uses the upper tail probability, which keeps its digits where the lower
/// one rounds to 1.
fn upper_normal(bound: f64, uniform: f64) -> f64 {
    let normal = Normal::standard();
    let above = if bound.is_finite() { normal.sf(bound) } else { 1.0 };
    // If the tail underflows, the excess over the bound is exponential.
    if above < 1e-280 {
        return bound - (1.0 - uniform).ln() / bound;
    }
    -normal.inverse_cdf((above * (1.0 - uniform)).max(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two coordinates above 0 with correlation ρ have Rosenbaum's closed form: P = ¼ + asin(ρ)/2π, mean (1 + ρ)/(2√(2π) P). A coordinate truncated at a bound b far in
    /// its tail, beside a free one, has a mean that exceeds b by 1/b − 2/b³ to 1/b. For the two coordinates, 3,800 sweeps are worth at least 1,000 draws. The tolerance
    /// 0.1 is five of their standard errors.
    #[test]
    fn moments_are_those_of_closed_forms() {
        for rho in [-0.5_f64, 0.0, 0.7] {
            let covariance = DMatrix::from_row_slice(2, 2, &[1.0, rho, rho, 1.0]);
            let (mean, _) = moments(&[0.0, 0.0], &covariance, &[0.0, 0.0]).unwrap();
            let share = 0.25 + rho.asin() / (2.0 * std::f64::consts::PI);
            let exact = (1.0 + rho) / (2.0 * (2.0 * std::f64::consts::PI).sqrt() * share);
            assert!(mean.iter().all(|mean| (mean - exact).abs() < 0.1), "{rho}: {mean:?}, {exact}");
        }
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 1.0]);
        let (mean, covariance) = moments(&[3.0, -50.0], &covariance, &[f64::NEG_INFINITY, 0.0]).unwrap();
        assert!((mean[0] - 3.0).abs() < 0.2 && (covariance[(0, 0)] - 4.0).abs() < 0.5, "{mean:?}");
        assert!(
            (mean[1] - 0.02).abs() < 2e-3 && (covariance[(1, 1)].sqrt() - 0.02).abs() < 2e-3,
            "{mean:?} {covariance}"
        );
    }
}

//! Residual test of a fit. Refitted simulated oscillations give the size and correlation of residuals under noise alone.

use rayon::prelude::*;

use super::problem::{SweepFit, SweepProblem};
use base::error::Result;
use criticism::criteria::Criteria;
use sampling::ensemble::RandomStream;

/// Number of simulated oscillations. Three tests at a joint level of 1 % need probabilities of 1/300.
const N_SIMULATED: usize = 499;
/// Probability of all tests together below which residuals are not noise.
pub const LEAST_P: f64 = Criteria::SWEEP.least_noise_p;
/// First random stream of the simulations, apart from the seed's other streams.
const STREAM: u64 = 1 << 40;

/// Probabilities that noise alone gives residuals at least as extreme, one per test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualPValues {
    /// p of the correlation between residuals of neighbouring frequencies.
    pub p_neighbours: f64,
    /// p of the size of the fitted residuals; `None` if the fit estimates the size of the errors.
    pub p_size: Option<f64>,
    /// p of the size of the held-out residuals; `None` if no row is held out.
    pub p_heldout: Option<f64>,
}

impl ResidualPValues {
    /// Smallest p times the number of tests, at most 1.
    pub fn p(&self) -> f64 {
        let all: Vec<f64> = [Some(self.p_neighbours), self.p_size, self.p_heldout].into_iter().flatten().collect();
        (all.iter().copied().fold(1.0, f64::min) * all.len() as f64).min(1.0)
    }

    /// Returns `true` if the residuals may be noise.
    pub fn is_noise(&self) -> bool {
        self.p() >= LEAST_P
    }
}

/// Test statistics: the relative sum of the products of neighbouring residuals, and the sums of squared residuals of the fitted and of the held-out rows.
fn test_statistics(problem: &SweepProblem, fit: &SweepFit) -> Option<[f64; 3]> {
    let predicted = problem.predict(&fit.values)?;
    let residuals = problem.residuals(&predicted, &fit.values);
    let part = |of_heldout: bool| -> Vec<[f64; 2]> {
        let rows = problem.sweep.rows.iter().zip(&residuals).filter(|(row, _)| row.is_heldout == of_heldout);
        rows.map(|(_, residual)| *residual).collect()
    };
    let squares = |rows: &[[f64; 2]]| rows.iter().flatten().map(|r| r * r).sum::<f64>();
    let fitted = part(false);
    let neighbours: f64 = fitted.windows(2).map(|pair| pair[0][0] * pair[1][0] + pair[0][1] * pair[1][1]).sum();
    // Division by the squares removes the size, which has its own test.
    Some([neighbours / squares(&fitted), squares(&fitted), squares(&part(true))])
}

/// Tests the residuals of a fit. Simulated oscillations of the fit are refitted in the same way, and their statistics are counted.
///
/// # Errors
/// The errors of fitting.
pub fn test_residuals(problem: &SweepProblem, fit: &SweepFit, seed: u64) -> Result<Option<ResidualPValues>> {
    let (Some(predicted), Some(found)) = (problem.predict(&fit.values), test_statistics(problem, fit)) else {
        return Ok(None);
    };
    let simulate = |k: usize| -> Result<Option<[f64; 3]>> {
        let mut stream = RandomStream::new(seed, STREAM + k as u64);
        let other = problem.with_rows(problem.simulate_rows(&predicted, &fit.values, &mut stream));
        let refitted = other.fit_from(std::slice::from_ref(&fit.point))?;
        Ok(refitted.and_then(|refitted| test_statistics(&other, &refitted)))
    };
    let all: Vec<Option<[f64; 3]>> = (0..N_SIMULATED).into_par_iter().map(simulate).collect::<Result<_>>()?;
    let simulated: Vec<[f64; 3]> = all.into_iter().flatten().collect();
    let p = |k: usize| {
        let n_larger = simulated.iter().filter(|sizes| sizes[k] >= found[k]).count();
        (1 + n_larger) as f64 / (1 + simulated.len()) as f64
    };
    let has_heldout = problem.sweep.rows.iter().any(|row| row.is_heldout);
    Ok(Some(ResidualPValues {
        p_neighbours: p(0),
        p_size: problem.sweep.has_errors().then(|| p(1)),
        p_heldout: has_heldout.then(|| p(2)),
    }))
}

//! Tests whether the residuals of a fit are noise. Simulated oscillations without any misfit are fitted in the same way. They show how large and how
//! correlated residuals are by chance.

use rayon::prelude::*;

use super::problem::{SweepFit, SweepProblem};
use base::error::Result;
use criticism::criteria::Criteria;
use sampling::ensemble::RandomStream;

/// Number of simulated oscillations. Three tests at a joint level of 1 % need to resolve probabilities of 1/300.
const N_SIMULATED: usize = 499;
/// Joint probability of all tests below which residuals do not count as noise.
pub const LEAST_P: f64 = Criteria::SWEEP.least_noise_p;
/// Number of the random stream of the first simulation. Other uses of the seed have other stream numbers.
const STREAM: u64 = 1 << 40;

/// p of each residual test: the probability that noise alone gives residuals at least as extreme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualPValues {
    /// p of the correlation between residuals at neighbouring frequencies.
    pub p_neighbours: f64,
    /// p of the root mean square of the fitted residuals; `None` if the fit itself estimates the size of the errors.
    pub p_size: Option<f64>,
    /// p of the root mean square of the held-out residuals; `None` if no row is held out.
    pub p_heldout: Option<f64>,
}

impl ResidualPValues {
    /// Joint p of all tests: the smallest p times the number of tests, at most 1.
    pub fn p(&self) -> f64 {
        let all: Vec<f64> = [Some(self.p_neighbours), self.p_size, self.p_heldout].into_iter().flatten().collect();
        (all.iter().copied().fold(1.0, f64::min) * all.len() as f64).min(1.0)
    }

    /// Returns `true` if the residuals are consistent with noise.
    pub fn is_noise(&self) -> bool {
        self.p() >= LEAST_P
    }
}

/// Computes three test statistics. The first is the sum of products of neighbouring residuals, divided by the sum of squares. The second and third are the
/// sums of squared residuals of the fitted and of the held-out rows. `None` if the model has no prediction.
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
    // The division by the sum of squares makes the first statistic independent of the residuals' size, which the second statistic tests.
    Some([neighbours / squares(&fitted), squares(&fitted), squares(&part(true))])
}

/// Tests the residuals of a fit. Oscillations are simulated from the fit and fitted again. The p-value of a test is the fraction of simulated oscillations
/// whose test statistic is at least as large. `None` if the model has no prediction.
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
        // A law that the frequencies do not determine may have no maximum. Its prediction without a new fit then stands for it: without simulations, every residual would be noise.
        Ok(test_statistics(&other, refitted.as_ref().unwrap_or(fit)))
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

//! Is what a fit leaves noise? Simulated oscillations, fitted again, say how large and how smooth it would be.

use rayon::prelude::*;

use super::problem::{SweepFit, SweepProblem};
use base::error::Result;
use criticism::criteria::Criteria;
use sampling::ensemble::RandomStream;

/// Simulated oscillations: three questions at once at one per cent need probabilities of a three-hundredth.
const N_SIMULATED: usize = 499;
/// Probability, all questions together, below which what is left is no noise.
pub const LEAST_P: f64 = Criteria::SWEEP.least_noise_p;
/// Streams of the simulations, apart from others of the seed.
const STREAM: u64 = 1 << 40;

/// What a fit leaves: probabilities that noise leaves at least as much, each by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLike {
    /// Of residuals of neighbouring frequencies that agree so well.
    pub p_neighbours: f64,
    /// Of fitted residuals so large; `None` where their size was learnt.
    pub p_size: Option<f64>,
    /// Of held-out residuals so large; `None` where nothing is held out.
    pub p_heldout: Option<f64>,
}

impl NoiseLike {
    /// The smallest, times the number of questions asked.
    pub fn p(&self) -> f64 {
        let all: Vec<f64> = [Some(self.p_neighbours), self.p_size, self.p_heldout].into_iter().flatten().collect();
        (all.iter().copied().fold(1.0, f64::min) * all.len() as f64).min(1.0)
    }

    /// Whether it may be noise.
    pub fn is_noise(&self) -> bool {
        self.p() >= LEAST_P
    }
}

/// Sizes of what is left: products of neighbours, squares of fitted and of held-out rows.
fn sizes(problem: &SweepProblem, fit: &SweepFit) -> Option<[f64; 3]> {
    let predicted = problem.predicted(&fit.values)?;
    let residuals = problem.residuals(&predicted, &fit.values);
    let part = |of_heldout: bool| -> Vec<[f64; 2]> {
        let rows = problem.sweep.rows.iter().zip(&residuals).filter(|(row, _)| row.is_heldout == of_heldout);
        rows.map(|(_, residual)| *residual).collect()
    };
    let squares = |rows: &[[f64; 2]]| rows.iter().flatten().map(|r| r * r).sum::<f64>();
    let fitted = part(false);
    let neighbours: f64 = fitted.windows(2).map(|pair| pair[0][0] * pair[1][0] + pair[0][1] * pair[1][1]).sum();
    // Over their squares, so that the size, which has a question of its own, does not enter.
    Some([neighbours / squares(&fitted), squares(&fitted), squares(&part(true))])
}

/// Fits simulated oscillations of the fit as the measured one was fitted, and counts how often noise leaves as much.
///
/// # Errors
/// Those of fits.
pub fn noise_like(problem: &SweepProblem, fit: &SweepFit, seed: u64) -> Result<Option<NoiseLike>> {
    let (Some(predicted), Some(found)) = (problem.predicted(&fit.values), sizes(problem, fit)) else { return Ok(None) };
    let simulate = |k: usize| -> Result<Option<[f64; 3]>> {
        let mut stream = RandomStream::new(seed, STREAM + k as u64);
        let other = problem.with_rows(problem.simulated(&predicted, &fit.values, &mut stream));
        let refitted = other.fit_from(std::slice::from_ref(&fit.point))?;
        Ok(refitted.and_then(|refitted| sizes(&other, &refitted)))
    };
    let all: Vec<Option<[f64; 3]>> = (0..N_SIMULATED).into_par_iter().map(simulate).collect::<Result<_>>()?;
    let simulated: Vec<[f64; 3]> = all.into_iter().flatten().collect();
    let p = |k: usize| {
        let n_larger = simulated.iter().filter(|sizes| sizes[k] >= found[k]).count();
        (1 + n_larger) as f64 / (1 + simulated.len()) as f64
    };
    let has_heldout = problem.sweep.rows.iter().any(|row| row.is_heldout);
    Ok(Some(NoiseLike {
        p_neighbours: p(0),
        p_size: problem.sweep.has_errors().then(|| p(1)),
        p_heldout: has_heldout.then(|| p(2)),
    }))
}

//! Evidence ∫ p(data | θ) p(θ) dθ of a model with parameters θ, and weighted draws from the model's posterior.
//!
//! Two independent methods check each other: importance sampling from a mixture that is adapted to the posterior ([`importance`]), and sequential Monte
//! Carlo from the prior to the posterior ([`tempering`]).

mod charts;
mod coordinates;
mod estimate;
pub mod importance;
mod proposal;
pub mod tempering;
mod valley;
mod weighted;

pub use coordinates::{PriorCoordinates, to_normal_coordinate};
pub use estimate::estimate;
pub use valley::find_density_valley;
pub use weighted::WeightedDraws;

use crate::LogDensity;
use crate::check_log_densities;
use base::error::{Error, Result};
use rayon::prelude::*;

/// Estimate of the log evidence with its error, and draws from the posterior.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Log evidence ln ∫ p(data | θ) p(θ) dθ, in nats.
    pub ln_evidence: f64,
    /// Standard error of `ln_evidence`, in nats.
    pub standard_error: f64,
    /// Tail shape k̂ of the importance weights. Evidence and error are reliable if k̂ is below 0.7. `None` if the method uses no importance weights.
    pub pareto_k: Option<f64>,
    /// Weighted posterior draws, in the density's coordinates.
    pub draws: WeightedDraws,
    /// Number of evaluations of the density.
    pub n_evaluations: usize,
}

/// Number of points that one thread evaluates together, a multiple of the number of vector lanes.
const BATCH: usize = 256;
/// Largest accepted fraction of points with a NaN density. A few NaN occur in the tails of a proposal, but many NaN indicate a fault of the density.
const MOST_UNDEFINED: f64 = 0.01;

/// Evaluates the log densities of points, one vector of coordinates per point. Proposals reach far beyond the posterior's mass, where a model may
/// overflow. NaN is therefore replaced by −∞, unless it is too frequent.
///
/// # Errors
/// [`Error::Numerical`] for +∞, or if more than one point in a hundred is NaN.
fn evaluate(density: &dyn LogDensity, points: &[Vec<f64>]) -> Result<Vec<f64>> {
    let dimension = density.dimension();
    let batch = |points: &[Vec<f64>]| -> Result<(Vec<f64>, usize)> {
        let coordinates: Vec<f64> = (0..dimension).flat_map(|d| points.iter().map(move |point| point[d])).collect();
        let mut values = vec![0.0; points.len()];
        density.log_density(&coordinates, &mut values);
        let n_undefined = values.iter().filter(|value| value.is_nan()).count();
        values.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = f64::NEG_INFINITY);
        check_log_densities(dimension, &coordinates, &values)?;
        Ok((values, n_undefined))
    };
    let batches: Vec<(Vec<f64>, usize)> = points.par_chunks(BATCH).map(batch).collect::<Result<_>>()?;
    let n_undefined: usize = batches.iter().map(|(_, n)| n).sum();
    if n_undefined as f64 > MOST_UNDEFINED * points.len() as f64 {
        return Err(Error::numerical(
            format!("the log density is not a number at {n_undefined} of {} points", points.len()),
            "narrow the priors: the model cannot be computed in a large part of their range",
        ));
    }
    Ok(batches.into_iter().flat_map(|(values, _)| values).collect())
}

/// Returns the logarithm of the mean of weights, and the relative standard error of this mean. The weights are given by their logarithms.
fn ln_mean(ln_weights: &[f64]) -> (f64, f64) {
    let n = ln_weights.len() as f64;
    let top = ln_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return (top, f64::INFINITY);
    }
    let weights = || ln_weights.iter().map(|w| (w - top).exp());
    let mean = weights().sum::<f64>() / n;
    let variance = weights().map(|w| (w - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (top + mean.ln(), (variance / n).sqrt() / mean)
}

//! Ensemble sampler, convergence diagnostics, evidence, optima and least squares for any log density. This crate knows nothing about gels.

pub mod calibration;
pub mod checkpoint;
pub mod diagnostics;
pub mod ensemble;
pub mod evidence;
pub mod least_squares;
pub mod optimum;
pub mod pareto;
pub mod t_mixture;
#[cfg(test)]
mod test_densities;

pub use ensemble::{SampleOutcome, SamplerOptions, sample};

use base::{Error, Result};

/// Log density over unconstrained coordinates. It evaluates many points at once, so that the compiler can use vector instructions.
pub trait LogDensity: Sync {
    /// Number of coordinates of each point.
    fn dimension(&self) -> usize;
    /// Evaluates the log density of each point of a batch of n points and fills `log_density`.
    ///
    /// Coordinate d of point i is at `points[d * n + i]`, n = `log_density.len()`. −∞ means that the point is outside the support. NaN is a fault of the
    /// model and stops a sampler. The value of a point must not depend on the other points of its batch, not even in the last bit.
    fn log_density(&self, points: &[f64], log_density: &mut [f64]);
}

/// Returns an error that names the first point at which the log density is NaN or +∞.
pub(crate) fn check_log_densities(dimension: usize, points: &[f64], log_density: &[f64]) -> Result<()> {
    // The loop has no early exit, so that the compiler can use vector instructions.
    if log_density.iter().fold(true, |good, value| good & (*value < f64::INFINITY)) {
        return Ok(());
    }
    let n = log_density.len();
    let Some(i) = log_density.iter().position(|value| value.is_nan() || *value == f64::INFINITY) else { return Ok(()) };
    let point: Vec<f64> = (0..dimension).map(|d| points[d * n + i]).collect();
    Err(Error::numerical(
        format!("the log density is {} at the unconstrained point {point:?}", log_density[i]),
        "narrow the prior around this point and report it: the fault is in the model, not in the data",
    ))
}

//! Ensemble sampler, convergence diagnostics, evidence, optima and least squares. This crate contains nothing about gels.

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

/// Log density over an unconstrained space. It evaluates a batch of points at once, so that walkers share vector registers.
pub trait LogDensity: Sync {
    /// Number of coordinates of a point.
    fn dimension(&self) -> usize;
    /// Evaluates the log density of each point of a batch.
    ///
    /// `points` holds coordinate d of point i at `points[d * n + i]`, n = `log_density.len()`. −∞ means outside the
    /// support. NaN is a fault of the model and stops a sampler. The value of a point must not depend, to the last
    /// bit, on the other points of its batch.
    fn log_density(&self, points: &[f64], log_density: &mut [f64]);
}

/// Rejects NaN and +∞ with an error that names the point.
pub(crate) fn check_log_densities(dimension: usize, points: &[f64], log_density: &[f64]) -> Result<()> {
    // Without an early exit the compiler vectorises the scan.
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

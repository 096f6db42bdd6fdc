//! Ensemble sampler, convergence diagnostics, evidence, optima and least squares; knows no gel.

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

/// A log-density over an unconstrained space, evaluated for a batch of points at once so that walkers share vector registers.
pub trait LogDensity: Sync {
    /// Number of coordinates of a point.
    fn dimension(&self) -> usize;
    /// Log-density of each point of a batch.
    ///
    /// `points` holds coordinate d of point i at `points[d * n + i]`, n = `log_density.len()`. −∞ means outside the
    /// support; NaN is a fault of the model and stops a sampler. The value of a point must not depend, to the last
    /// bit, on which other points share its batch.
    fn log_density(&self, points: &[f64], log_density: &mut [f64]);
}

/// Refuses NaN and +∞, naming the point.
pub(crate) fn check_log_densities(dimension: usize, points: &[f64], log_density: &[f64]) -> Result<()> {
    // Without an early exit the scan is one vector instruction a few values.
    if log_density.iter().fold(true, |good, value| good & (*value < f64::INFINITY)) {
        return Ok(());
    }
    let n = log_density.len();
    let Some(i) = log_density.iter().position(|value| value.is_nan() || *value == f64::INFINITY) else { return Ok(()) };
    let point: Vec<f64> = (0..dimension).map(|d| points[d * n + i]).collect();
    Err(Error::numerical(
        format!("the log density is {} at the unconstrained point {point:?}", log_density[i]),
        "this is a fault of the model, not of the data: narrow the prior around this point, and report it",
    ))
}

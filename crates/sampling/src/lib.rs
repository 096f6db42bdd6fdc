//! Ensemble sampler, convergence diagnostics, evidence, optima and least squares for any log density. Nothing in this crate is specific to gels.

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

/// Log density over unconstrained coordinates, evaluated at many points at once, so that the compiler can use vector instructions.
pub trait LogDensity: Sync {
    /// Number of coordinates of each point.
    fn dimension(&self) -> usize;
    /// Evaluates the log density of each point of a batch of n points and fills `log_density`.
    ///
    /// Coordinate d of point i is at `points[d * n + i]`, with n = `log_density.len()`. The value −∞ means that a point is outside the support. NaN
    /// is a fault of the model and stops a sampler. The value of a point must not depend on the other points of its batch, not even in the last bit.
    fn log_density(&self, points: &[f64], log_density: &mut [f64]);

    /// [`Self::log_density`], except that a value below the point's entry in `floors` may be coarse, but not above it. This saves a density its
    /// preparations for regions in which no proposal is accepted.
    fn log_density_above(&self, points: &[f64], _floors: &[f64], log_density: &mut [f64]) {
        self.log_density(points, log_density);
    }
}

/// Returns an error if a log density is NaN or +∞; the error names the first such point.
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
        "narrow the prior so that it excludes this point, and report the point: the fault is in the model, not in the data",
    ))
}

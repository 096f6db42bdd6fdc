//! Constants of the fourth-order method, and the values from which its stages start.

use crate::fe::clock::FOURTH;

/// Number of stages of the fourth-order method.
pub(super) const N_STAGES: usize = FOURTH.nodes.len();

/// Diagonal coefficient of the method: a stage is an implicit Euler step of this fraction of the
/// step.
pub(super) const DIAGONAL: f64 = FOURTH.diagonal;

/// Computes the known part of a stage's value: `result` = `start` + step length × the sum of the
/// earlier stages' rates, weighted by the method's coefficients.
pub(super) fn predict(stage: usize, step_s: f64, start: &[f64], rates: &[Vec<f64>], result: &mut [f64]) {
    result.copy_from_slice(start);
    for (a, rates) in FOURTH.matrix[stage].iter().zip(rates) {
        for (value, rate) in result.iter_mut().zip(rates) {
            *value += a * step_s * rate;
        }
    }
}

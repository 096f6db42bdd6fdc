//! Constants of the fourth-order method, and the values from which its stages start.

use crate::fe::clock::FOURTH;

/// Number of stages of the fourth-order method.
pub(super) const N_STAGES: usize = FOURTH.nodes.len();

/// γ, the diagonal entry of the method's matrix A.
pub(super) const DIAGONAL: f64 = FOURTH.diagonal;

/// Computes the value from which `stage` starts: `result` = `start` + Δt Σ aᵢⱼ `rates`ⱼ over the
/// earlier stages j.
pub(super) fn predict(stage: usize, step_s: f64, start: &[f64], rates: &[Vec<f64>], result: &mut [f64]) {
    result.copy_from_slice(start);
    for (a, rates) in FOURTH.matrix[stage].iter().zip(rates) {
        for (value, rate) in result.iter_mut().zip(rates) {
            *value += a * step_s * rate;
        }
    }
}

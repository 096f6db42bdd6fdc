//! Starting values of the stages of the fourth-order method.

use crate::fe::clock::FOURTH;

/// Number of stages.
pub(super) const N_STAGES: usize = FOURTH.nodes.len();

/// γ, the diagonal of A.
pub(super) const DIAGONAL: f64 = FOURTH.diagonal;

/// `result` = `start` + Δt Σ aᵢⱼ `rates`ⱼ over the stages before `stage`.
pub(super) fn predict(stage: usize, step_s: f64, start: &[f64], rates: &[Vec<f64>], result: &mut [f64]) {
    result.copy_from_slice(start);
    for (a, rates) in FOURTH.matrix[stage].iter().zip(rates) {
        for (value, rate) in result.iter_mut().zip(rates) {
            *value += a * step_s * rate;
        }
    }
}

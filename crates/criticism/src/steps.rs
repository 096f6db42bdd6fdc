//! Gauss–Newton steps of a candidate's coordinates: full, partial and damped.

use nalgebra::{DMatrix, DVector};

use super::Candidate;
use models::model::N_LANES;

/// Dampings of the trial steps, relative to the diagonal of the curvature matrix.
const DAMPINGS: [f64; N_LANES - 1] = [0.1, 1e-2, 1.0, 1e-4, 10.0, 100.0, 1e4];
/// Dampings for candidates whose trajectories are computed one by one and whose steps are tried one after another.
const SLOW_DAMPINGS: [f64; 5] = [1e-4, 1e-2, 0.1, 1.0, 100.0];
/// Fractions of the undamped step. They are tried first, because narrow valleys of the objective bend.
const PARTS: [f64; 3] = [1.0, 0.5, 0.25];
/// Largest change of a coordinate in one step, in the coordinate's unit.
const LONGEST_STEP: f64 = 3.0;

/// Returns curvature and slope of ½‖r − Ax‖² at x = 0. The argument has the columns of A, followed by r.
pub(super) fn normal_equations(columns_and_residual: &[Vec<f64>]) -> (DMatrix<f64>, DVector<f64>) {
    let n = columns_and_residual.len().saturating_sub(1);
    let dot = |i: usize, j: usize| {
        columns_and_residual[i].iter().zip(&columns_and_residual[j]).map(|(a, b)| a * b).sum::<f64>()
    };
    let mut normal = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            normal[(i, j)] = dot(i, j);
            normal[(j, i)] = normal[(i, j)];
        }
    }
    (normal, DVector::from_fn(n, |i, _| dot(i, n)))
}

/// Partial and damped Gauss–Newton steps from a point.
pub(super) struct Steps {
    /// End points of the steps.
    pub trials: Vec<Vec<f64>>,
    /// Predicted decrease of half the sum of squared residuals by the full undamped step, if the curvature is constant.
    pub promised: f64,
}

impl Steps {
    /// Groups of steps to try at once, in order; single steps if trajectories are computed one by one.
    pub fn in_turn(&self, candidate: &Candidate) -> std::slice::Chunks<'_, Vec<f64>> {
        self.trials.chunks(if candidate.is_slow() { 1 } else { N_LANES })
    }
}

/// Computes full, partial and damped steps along `slope` for the curvature `normal`, inside the candidate's ends. Coordinates that push against an end stay there. `None`
/// if no coordinate can move.
pub(super) fn damped_steps(
    candidate: &Candidate,
    from: &[f64],
    normal: &DMatrix<f64>,
    slope: &DVector<f64>,
) -> Option<Steps> {
    let is_held = |k: usize| {
        let [lower, upper] = candidate.ends(k);
        (from[k] <= lower && slope[k] < 0.0) || (from[k] >= upper && slope[k] > 0.0)
    };
    let active: Vec<usize> = (0..candidate.dimension()).filter(|k| !is_held(*k) && normal[(*k, *k)] > 0.0).collect();
    if active.is_empty() {
        return None;
    }
    let scale: Vec<f64> = active.iter().map(|k| normal[(*k, *k)].sqrt()).collect();
    let scaled =
        DMatrix::from_fn(active.len(), active.len(), |i, j| normal[(active[i], active[j])] / (scale[i] * scale[j]));
    let slope = DVector::from_fn(active.len(), |i, _| slope[active[i]] / scale[i]);
    let (mut trials, mut promised) = (Vec::with_capacity(N_LANES), None);
    let is_slow = candidate.is_slow();
    let (undamped, dampings) = if is_slow { (&PARTS[..], &SLOW_DAMPINGS[..]) } else { (&PARTS[..1], &DAMPINGS[..]) };
    let damped = dampings.iter().map(|damping| (*damping, &PARTS[..1]));
    for (damping, parts) in std::iter::once((0.0, undamped)).chain(damped) {
        let mut damped = scaled.clone();
        (0..active.len()).for_each(|i| damped[(i, i)] += damping + 1e-12);
        let Some(factor) = damped.cholesky() else { continue };
        let step = factor.solve(&slope);
        promised.get_or_insert(0.5 * slope.dot(&step));
        for part in parts {
            let mut theta = from.to_vec();
            for (i, k) in active.iter().enumerate() {
                let [lower, upper] = candidate.ends(*k);
                let move_by = part * step[i] / scale[i];
                let longest = if *k < candidate.free.len() { LONGEST_STEP } else { f64::INFINITY };
                theta[*k] = (theta[*k] + move_by.clamp(-longest, longest)).clamp(lower, upper);
            }
            trials.push(theta);
        }
    }
    promised.map(|promised| Steps { trials, promised })
}

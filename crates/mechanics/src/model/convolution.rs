//! ∫ J dF for a piecewise-constant force, by one recursion a branch.

use crate::rheology::CreepCompliance;

/// Position (m) at every row, the limit from the left: `compliance_per_m` × ∫ J dF.
///
/// `time_s` (s) strictly increasing; `force_n` (N), row i holds on [tᵢ, tᵢ₊₁); the position is 0 at the first row.
pub fn convolve_m(compliance_per_m: f64, law: &CreepCompliance, time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
    let mut retarded_per_pa_n = vec![0.0; law.retarded.len()];
    let mut impulse_n_s = 0.0;
    let mut position_m = Vec::with_capacity(time_s.len());
    position_m.push(0.0);
    for row in 1..time_s.len() {
        let (step_s, force) = (time_s[row] - time_s[row - 1], force_n[row - 1]);
        for (state, mode) in retarded_per_pa_n.iter_mut().zip(&law.retarded) {
            let decay = (-step_s / mode.time_s).exp();
            *state = decay * *state + mode.compliance_per_pa * (1.0 - decay) * force;
        }
        impulse_n_s += force * step_s;
        let retarded: f64 = retarded_per_pa_n.iter().sum();
        let response = law.instantaneous_per_pa * force + retarded + law.fluidity_per_pa_s * impulse_n_s;
        position_m.push(compliance_per_m * response);
    }
    position_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rheology::RetardedMode;

    /// Against the superposition Σ ΔFₖ J(t − tₖ), written out.
    #[test]
    fn equals_the_superposition_of_force_steps() {
        let mut law = CreepCompliance::lethersich(&[3.5, 1.4, 47.0]);
        law.instantaneous_per_pa = 0.02;
        law.retarded.push(RetardedMode { compliance_per_pa: 0.1, time_s: 5.0 });
        let time_s = [0.0, 0.1, 0.15, 0.9, 1.0, 4.0, 4.5];
        let force_n = [1.0, 1.0, -2.0, -2.0, 0.5, 0.0, 0.0];
        let position = convolve_m(7.0, &law, &time_s, &force_n);
        for (row, t) in time_s.iter().enumerate() {
            let mut exact = 0.0;
            for switch in 0..row {
                let before = if switch == 0 { 0.0 } else { force_n[switch - 1] };
                exact += 7.0 * (force_n[switch] - before) * law.at(t - time_s[switch]);
            }
            assert!((position[row] - exact).abs() < 1e-13, "row {row}: {} against {exact}", position[row]);
        }
    }
}

//! Convolution ∫ J dF of the creep compliance J with a force F of steps or straight lines. Each exponential of J has its own recursion over
//! the rows.

use laws::rheology::CreepCompliance;
use record::Force;

/// Returns the position in m at every row: `compliance_per_m` times ∫ J dF, with J the creep compliance and F the force. A row's value is
/// the limit from the left.
///
/// `time_s` (s) is strictly increasing. The position is 0 at the first row.
pub fn convolve_m<'f>(
    compliance_per_m: f64,
    law: &CreepCompliance,
    time_s: &[f64],
    force: impl Into<Force<'f>>,
) -> Vec<f64> {
    let force = force.into();
    let mut retarded_per_pa_n = vec![0.0; law.retarded.len()];
    let mut impulse_n_s = 0.0;
    let mut position_m = Vec::with_capacity(time_s.len());
    position_m.push(0.0);
    for row in 1..time_s.len() {
        let (step_s, from_n) = (time_s[row] - time_s[row - 1], force.at_rows_n[row - 1]);
        let slope = force.slope_n_per_s(time_s, row - 1);
        for (state, mode) in retarded_per_pa_n.iter_mut().zip(&law.retarded) {
            let decay = (-step_s / mode.time_s).exp();
            *state = decay * *state + mode.compliance_per_pa * (1.0 - decay) * from_n;
            if slope != 0.0 {
                *state += mode.compliance_per_pa * slope * (step_s - mode.time_s * (1.0 - decay));
            }
        }
        impulse_n_s += force.impulse_n_s(time_s, row - 1);
        let retarded: f64 = retarded_per_pa_n.iter().sum();
        let response =
            law.instantaneous_per_pa * (from_n + slope * step_s) + retarded + law.fluidity_per_pa_s * impulse_n_s;
        position_m.push(compliance_per_m * response);
    }
    position_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use laws::rheology::RetardedMode;
    use record::ForceRule;

    /// Compares the recursion with the superposition Σ ΔFₖ J(t − tₖ) of the creep compliance J over the force steps ΔFₖ at the times tₖ.
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

    /// Checks a force of straight lines. The expected position adds the response to the first jump and, for each slope change ΔSₖ at a time
    /// tₖ, ΔSₖ times the integral of the creep compliance from 0 to t − tₖ. This integral has a closed form.
    #[test]
    fn lines_are_the_superposition_of_ramps() {
        let mut law = CreepCompliance::lethersich(&[3.5, 1.4, 47.0]);
        law.instantaneous_per_pa = 0.02;
        law.retarded.push(RetardedMode { compliance_per_pa: 0.1, time_s: 5.0 });
        let ramp = |t: f64| {
            let retarded = law.retarded.iter().map(|m| m.compliance_per_pa * (t + m.time_s * (-t / m.time_s).exp_m1()));
            law.instantaneous_per_pa * t + retarded.sum::<f64>() + 0.5 * law.fluidity_per_pa_s * t * t
        };
        let time_s = [0.0, 0.1, 0.15, 0.9, 1.0, 4.0, 4.5];
        let at_rows_n = [1.0, 1.0, -2.0, -2.0, 0.5, 0.0, 3.0];
        let slope = |row: usize| (at_rows_n[row + 1] - at_rows_n[row]) / (time_s[row + 1] - time_s[row]);
        let position = convolve_m(7.0, &law, &time_s, Force { at_rows_n: &at_rows_n, rule: ForceRule::Linear });
        for (row, t) in time_s.iter().enumerate().skip(1) {
            let bends = (0..row).map(|k| (slope(k) - if k == 0 { 0.0 } else { slope(k - 1) }) * ramp(t - time_s[k]));
            let exact = 7.0 * (at_rows_n[0] * law.at(*t) + bends.sum::<f64>());
            assert!((position[row] - exact).abs() < 1e-12, "row {row}: {} against {exact}", position[row]);
        }
    }
}

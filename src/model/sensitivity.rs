//! Derivatives of the reduced trajectory with respect to the logarithms of the law's parameters.

use crate::rheology::BaseLaw;

/// ∂x/∂ln θⱼ (m) at every row, one vector a parameter in the order of [`BaseLaw::parameters`], for the trajectory of
/// [`convolve_m`](super::convolve_m) and its arguments.
///
/// Lethersich: x = C (s/E + ∫F dt/c₂), where s relaxes towards F with the time τ = c₁/E. Over a step h, s ← d s + (1 − d) F with
/// d = exp(−h/τ), hence ∂s/∂ln τ ← d ∂s/∂ln τ + d (h/τ)(s − F); E acts on s/E directly and through τ, c₁ through τ alone.
pub fn log_sensitivities_m(
    compliance_per_m: f64,
    law: BaseLaw,
    parameters: &[f64],
    time_s: &[f64],
    force_n: &[f64],
) -> Vec<Vec<f64>> {
    match law {
        BaseLaw::Lethersich => {
            let (young_modulus_pa, viscosity_1_pa_s, viscosity_2_pa_s) = (parameters[0], parameters[1], parameters[2]);
            let rate_per_s = young_modulus_pa / viscosity_1_pa_s;
            let elastic_m_per_n = compliance_per_m / young_modulus_pa;
            let (mut retarded_n, mut by_log_time_n, mut impulse_n_s) = (0.0, 0.0, 0.0);
            let mut columns: Vec<Vec<f64>> = (0..3).map(|_| Vec::with_capacity(time_s.len())).collect();
            for row in 0..time_s.len() {
                if row > 0 {
                    let (step_s, force) = (time_s[row] - time_s[row - 1], force_n[row - 1]);
                    let decay = (-step_s * rate_per_s).exp();
                    by_log_time_n = decay * (by_log_time_n + step_s * rate_per_s * (retarded_n - force));
                    retarded_n = decay * retarded_n + (1.0 - decay) * force;
                    impulse_n_s += force * step_s;
                }
                columns[0].push(-elastic_m_per_n * (retarded_n + by_log_time_n));
                columns[1].push(elastic_m_per_n * by_log_time_n);
                columns[2].push(-compliance_per_m * impulse_n_s / viscosity_2_pa_s);
            }
            columns
        }
        BaseLaw::Burgers | BaseLaw::TwoElement | BaseLaw::Network(_) => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::convolve_m;

    /// Against central differences of the trajectory; irregular steps, changing force. With step 1e-5 their own error is about 1e-10 of
    /// the amplitude from truncation and rounding each.
    #[test]
    fn equal_central_differences_of_the_trajectory() {
        let time_s: Vec<f64> = (0..90).map(|i| 0.07 * i as f64 + if i % 5 == 0 { 0.03 } else { 0.0 }).collect();
        let force_n: Vec<f64> = (0..90).map(|i| [4.6e-6, -4.6e-6, 1e-6, 0.0][(i / 17) % 4]).collect();
        let law = BaseLaw::Lethersich;
        for parameters in [[3.527, 1.402, 47.37], [0.4, 9.0, 3.0], [60.0, 0.2, 500.0]] {
            let found = log_sensitivities_m(549.0, law, &parameters, &time_s, &force_n);
            let at = |j: usize, shift: f64| {
                let mut shifted = parameters;
                shifted[j] *= f64::exp(shift);
                convolve_m(549.0, &law.creep_compliance(&shifted).unwrap(), &time_s, &force_n)
            };
            for (j, column) in found.iter().enumerate() {
                let (above, below) = (at(j, 1e-5), at(j, -1e-5));
                let amplitude = above.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
                assert_eq!(column.len(), time_s.len());
                for (row, value) in column.iter().enumerate() {
                    let difference = (above[row] - below[row]) / 2e-5;
                    assert!((value - difference).abs() < 1e-9 * amplitude, "{j} {row}: {value} against {difference}");
                }
            }
        }
    }
}

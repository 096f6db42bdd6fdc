//! Log likelihood of each single position, for cross-validation.
//!
//! Let y be all positions, yᵢ one position, y₋ᵢ all others, and θ the parameters. Leaving out position i changes the likelihood by the factor p(yᵢ | y₋ᵢ, θ) = p(y |
//! θ)/p(y₋ᵢ | θ). The inverse of this factor is the importance weight of PSIS-LOO (Pareto-smoothed leave-one-out cross-validation). For correlated errors, the factor
//! differs from the one-step density (Bürkner, Gabry & Vehtari 2021, Comput. Stat. 36:1243, doi:10.1007/s00180-020-01045-4).
//!
//! Let the errors be normal with covariance C, and let r be the residuals. The density of yᵢ is then normal with the precision D = (C⁻¹)ᵢᵢ and the mean yᵢ − u/D, where
//! u = (C⁻¹r)ᵢ. One backward pass over the filter's innovations v, variances S and gains k computes both (de Jong 1988, Biometrika 75:594). With the adjoints ρ and M
//! of the state after row i, u = v/S − kᵀρ and D = 1/S + kᵀMk. Before row i the adjoints are h u + ρ and hhᵀ/S + (I − khᵀ)ᵀM(I − khᵀ), where h maps the state to the
//! position.

use nalgebra::{Matrix3, Vector3};

use super::NoiseLikelihood;
use super::likelihood::ln_student_constant;
use super::scales::FilterScales;
use super::terms::Equations;

/// Other positions on which a position's log likelihood is conditioned, in addition to the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Conditional {
    /// No other position, because errors are independent.
    Nothing,
    /// All other observed positions.
    AllOthers,
    /// All earlier positions. Under heavy tails with a process or gains, the density of a position given all others is not available.
    AllBefore,
}

/// State of the filter at an observed row. Variances are divided by the variance of the white noise.
struct FilterRow {
    /// Factor on each component of the state between the previous observed row and this row; 0 for a component that begins anew.
    decay: Vector3<f64>,
    observes: Vector3<f64>,
    gain: Vector3<f64>,
    innovation_m: f64,
    variance: f64,
}

impl NoiseLikelihood {
    /// Positions on which [`NoiseLikelihood::ln_pointwise`] conditions, which depend on the noise model.
    pub fn conditional(&self) -> Conditional {
        let Equations { process, cycles, heavy_tails } = self.model.equations();
        match (process || cycles, heavy_tails) {
            (false, _) => Conditional::Nothing,
            (true, false) => Conditional::AllOthers,
            (true, true) => Conditional::AllBefore,
        }
    }

    /// Indices of the record's observed rows, ascending.
    pub fn observed_rows(&self) -> impl Iterator<Item = usize> {
        self.rows.rows.iter().map(|row| row.index)
    }

    /// Log density of each observed position (nats for positions in m), given the parameters and the positions of [`NoiseLikelihood::conditional`].
    /// [`NoiseLikelihood::ln_likelihood`] describes the arguments. The result is −∞ for parameters outside their support.
    pub fn ln_pointwise(&self, position_m: &[f64], parameters: &[f64]) -> Vec<f64> {
        let Some(scales) = self.model.scales(parameters) else {
            return vec![f64::NEG_INFINITY; self.n_observed()];
        };
        let ln_density = |variance: f64, distance_m: f64| {
            let square = distance_m * distance_m / (variance * scales.noise_sd_m * scales.noise_sd_m);
            let scale = -scales.noise_sd_m.ln() - 0.5 * (2.0 * std::f64::consts::PI * variance).ln();
            if scales.dof.is_finite() {
                scale + ln_student_constant(scales.dof) - 0.5 * (scales.dof + 1.0) * (square / scales.dof).ln_1p()
            } else {
                scale - 0.5 * square
            }
        };
        if self.conditional() == Conditional::Nothing {
            let residuals = self.rows.rows.iter().zip(&self.observed_m).map(|(row, y)| y - position_m[row.index]);
            return residuals.map(|residual_m| ln_density(1.0, residual_m)).collect();
        }
        let visits = self.visits(position_m, &scales);
        if self.conditional() == Conditional::AllBefore {
            return visits.iter().map(|visit| ln_density(visit.variance, visit.innovation_m)).collect();
        }
        let mut out = vec![0.0; visits.len()];
        let (mut adjoint, mut information) = (Vector3::zeros(), Matrix3::zeros());
        for (visit, out) in visits.iter().zip(&mut out).rev() {
            let FilterRow { decay, observes, gain, innovation_m, variance } = visit;
            let weight = innovation_m / variance - gain.dot(&adjoint);
            let precision = 1.0 / variance + gain.dot(&(information * gain));
            *out = ln_density(1.0 / precision, weight / precision);
            let passes = Matrix3::identity() - gain * observes.transpose();
            let before = observes * observes.transpose() / *variance + passes.transpose() * information * passes;
            adjoint = decay.component_mul(&(adjoint + observes * weight));
            information = Matrix3::from_fn(|i, j| decay[i] * before[(i, j)] * decay[j]);
        }
        out
    }

    /// Runs the filter forward through the record and returns its state at each observed row.
    fn visits(&self, position_m: &[f64], scales: &FilterScales) -> Vec<FilterRow> {
        let has = |is_there: bool| f64::from(u8::from(is_there));
        let Equations { process, cycles, .. } = self.model.equations();
        let (ou, gains) = (has(process), has(cycles));
        let mut mean: Vector3<f64> = Vector3::zeros();
        let mut covariance: Matrix3<f64> = Matrix3::zeros();
        let steps: Vec<(f64, f64)> = self.rows.step_s.iter().map(|step_s| scales.step(*step_s)).collect();
        let visit = |(row, observed_m): (&super::rows::NoiseRow, &f64)| {
            let (decay, gained) = steps[row.step];
            let stays = has(!row.new_cycle);
            let decay = Vector3::new(decay, stays, stays);
            let begins = 1.0 - stays;
            mean = mean.component_mul(&decay);
            covariance = Matrix3::from_fn(|i, j| decay[i] * covariance[(i, j)] * decay[j]);
            covariance[(0, 0)] += gained;
            covariance[(1, 1)] += begins * scales.gain_per_m2;
            covariance[(2, 2)] += begins * scales.offset;
            let x = position_m[row.index];
            let observes = Vector3::new(ou, gains * x, gains);
            let innovation_m = observed_m - x - observes.dot(&mean);
            let direction = covariance * observes;
            let variance = 1.0 + observes.dot(&direction);
            let gain = direction / variance;
            let tail = if scales.dof.is_finite() {
                let square = innovation_m * innovation_m / (variance * scales.noise_sd_m * scales.noise_sd_m);
                (scales.dof + 1.0) / (scales.dof + square)
            } else {
                1.0
            };
            mean += gain * (tail * innovation_m);
            covariance -= gain * direction.transpose();
            FilterRow { decay, observes, gain, innovation_m, variance }
        };
        self.rows.rows.iter().zip(&self.observed_m).map(visit).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::super::NoiseModel;
    use super::super::dense_for_tests::{POINTS, TestRecord, covariance_m2, gaussian_models, model, parameters};
    use super::*;

    /// Compares the densities with those from the conditional precision and mean of each position, by dense algebra. Points at which the dense inverse loses more than
    /// half of its digits are left out; the filter's own tests cover them.
    #[test]
    fn normal_errors_have_the_conditional_density_given_all_others() {
        let record = TestRecord::irregular(60);
        let rows = record.observed_rows();
        let residual_m = DVector::from_iterator(rows.len(), rows.iter().map(|row| record.residual_m()[*row]));
        for model in gaussian_models() {
            let likelihood = NoiseLikelihood::new(model, &record.time_s, &record.cycle, &record.observed_m);
            for point in [POINTS[0], POINTS[1], POINTS[2], POINTS[4]] {
                let values = parameters(model, point);
                let inverse = covariance_m2(model, &record, &rows, &values).try_inverse().unwrap();
                let weight = &inverse * &residual_m;
                let found = likelihood.ln_pointwise(&record.position_m, &values);
                assert_eq!(found.len(), rows.len());
                for (i, found) in found.into_iter().enumerate() {
                    let precision = inverse[(i, i)];
                    let distance = weight[i] / precision;
                    let expected =
                        0.5 * (precision / (2.0 * std::f64::consts::PI)).ln() - 0.5 * distance * distance * precision;
                    assert!(
                        (found - expected).abs() < 1e-6 * expected.abs(),
                        "{model:?} {point:?} {i}: {found} {expected}"
                    );
                }
            }
        }
    }

    /// If the densities are unconditional or conditioned on the past, their product is the likelihood.
    #[test]
    fn independent_and_one_step_densities_add_up_to_the_likelihood() {
        let record = TestRecord::irregular(60);
        let of = |names: &[&str]| {
            let model = model(names);
            let likelihood = NoiseLikelihood::new(model, &record.time_s, &record.cycle, &record.observed_m);
            let values = parameters(model, POINTS[0]);
            let sum: f64 = likelihood.ln_pointwise(&record.position_m, &values).iter().sum();
            let whole = likelihood.ln_likelihood(&record.position_m, &values);
            assert!((sum / whole - 1.0).abs() < 1e-10, "{names:?}: {sum} {whole}");
            likelihood.conditional()
        };
        assert_eq!(of(&["white"]), Conditional::Nothing);
        assert_eq!(of(&["white", "student"]), Conditional::Nothing);
        assert_eq!(of(&["white", "ou", "student"]), Conditional::AllBefore);
        assert_eq!(of(&["white", "ou", "gain", "student"]), Conditional::AllBefore);
    }

    #[test]
    fn parameters_outside_their_support_have_no_density() {
        let record = TestRecord::irregular(12);
        let likelihood = NoiseLikelihood::new(NoiseModel::default(), &record.time_s, &record.cycle, &record.observed_m);
        let found = likelihood.ln_pointwise(&record.position_m, &[-1.0]);
        assert!(found.len() == likelihood.n_observed() && found.iter().all(|x| *x == f64::NEG_INFINITY));
    }
}

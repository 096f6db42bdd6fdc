//! Posterior of the creep law's parameters under white Gaussian noise, over the sampler's coordinates.

use super::LogDensity;
use super::prior::{NOISE, PriorSet};
use crate::model::{CreepLanes, Forward, SumOfSquares, TrainedRange};
use crate::rheology::BaseLaw;

/// Where a parameter's value comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// Coordinate of the sampler.
    Sampled(usize),
    /// `[fixed]` of `model.toml`, in the parameter's unit.
    Fixed(f64),
}

/// Log-posterior by the reduced model: prior + Gaussian likelihood of the compared positions.
///
/// A point outside the surrogate's trained range has log-density −∞: the prior is truncated there, to within the tail mass that
/// was declared when the range was chosen.
pub struct ReducedPosterior<'a> {
    law: BaseLaw,
    compliance_per_m: f64,
    trained: &'a [TrainedRange],
    data: SumOfSquares,
    priors: &'a PriorSet,
    /// The law's parameters in order, then the noise.
    sources: Vec<Source>,
}

impl<'a> ReducedPosterior<'a> {
    /// `priors` holds the sampled parameters, in the sampler's order; `fixed` the others by name.
    pub fn new(
        law: BaseLaw,
        compliance_per_m: f64,
        trained: &'a [TrainedRange],
        data: SumOfSquares,
        priors: &'a PriorSet,
        fixed: &std::collections::BTreeMap<String, f64>,
    ) -> Self {
        let names = law.parameters().iter().map(|p| p.name).chain([NOISE.name]);
        let source = |name: &str| match priors.names().position(|n| n == name) {
            Some(index) => Source::Sampled(index),
            None => Source::Fixed(fixed.get(name).copied().unwrap_or(f64::NAN)),
        };
        Self { law, compliance_per_m, trained, data, priors, sources: names.map(source).collect() }
    }

    /// All parameters, sampled and fixed, in natural units (the law's, then the noise) at a point of the sampler.
    pub fn natural(&self, point: &[f64]) -> Vec<f64> {
        natural(&self.sources, self.priors, point)
    }

    /// Displacement per force at unit creep compliance (1/m), and the ranges in which the reduced model may be asked.
    pub fn mechanics(&self) -> (f64, &[TrainedRange]) {
        (self.compliance_per_m, self.trained)
    }

    /// Number of positions that are compared.
    pub fn n_observed(&self) -> usize {
        self.data.n_observed()
    }
}

fn natural(sources: &[Source], priors: &PriorSet, point: &[f64]) -> Vec<f64> {
    let value = |source: &Source| match *source {
        Source::Sampled(index) => priors.priors()[index].distribution.from_unconstrained(point[index]),
        Source::Fixed(value) => value,
    };
    sources.iter().map(value).collect()
}

/// −n ln σ − RSS/(2σ²) − (n/2) ln 2π.
fn ln_gaussian(n_observed: usize, sum_m2: f64, noise_sd_m: f64) -> f64 {
    let n = n_observed as f64;
    -n * (noise_sd_m.ln() + 0.5 * (2.0 * std::f64::consts::PI).ln()) - 0.5 * sum_m2 / (noise_sd_m * noise_sd_m)
}

impl LogDensity for ReducedPosterior<'_> {
    fn dimension(&self) -> usize {
        self.priors.priors().len()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        if n == 0 {
            return;
        }
        let column = |source: &Source, out: &mut [f64]| match *source {
            Source::Sampled(index) => {
                let distribution = &self.priors.priors()[index].distribution;
                for (x, z) in out.iter_mut().zip(&points[index * n..]) {
                    *x = distribution.from_unconstrained(*z);
                }
            }
            Source::Fixed(value) => out.fill(value),
        };
        let mut values = vec![0.0; self.sources.len() * n];
        for (source, out) in self.sources.iter().zip(values.chunks_exact_mut(n)) {
            column(source, out);
        }
        log_density.fill(0.0);
        for (range, values) in self.trained.iter().zip(values.chunks_exact(n)) {
            for (density, value) in log_density.iter_mut().zip(values) {
                if !range.contains(*value) {
                    *density = f64::NEG_INFINITY;
                }
            }
        }
        self.priors.add_ln_pdf_unconstrained(points, log_density);
        debug_assert_eq!(self.law, BaseLaw::Lethersich);
        let (law, noise_sd_um) = values.split_at_mut(3 * n);
        let (young, viscosities) = law.split_at_mut(n);
        let (viscosity_1, viscosity_2) = viscosities.split_at_mut(n);
        for i in 0..n {
            viscosity_1[i] = young[i] / viscosity_1[i];
            young[i] = self.compliance_per_m / young[i];
            viscosity_2[i] = self.compliance_per_m / viscosity_2[i];
        }
        let lanes = CreepLanes { retarded_m_per_n: young, rate_per_s: viscosity_1, flow_m_per_n_s: viscosity_2 };
        let mut sum_m2 = vec![0.0; n];
        self.data.evaluate(lanes, &mut sum_m2);
        for i in 0..n {
            if log_density[i] > f64::NEG_INFINITY {
                log_density[i] += ln_gaussian(self.data.n_observed(), sum_m2[i], 1e-6 * noise_sd_um[i]);
            }
        }
    }
}

/// Log-likelihood of one point by any forward model, scalar: the reference of the vectorised one, and the way to the full-order model.
pub fn ln_likelihood(
    forward: &dyn Forward,
    observed_m: &[Option<f64>],
    law_parameters: &[f64],
    noise_sd_um: f64,
) -> crate::error::Result<f64> {
    let position_m = forward.trajectory_m(law_parameters)?;
    let pairs = position_m.iter().zip(observed_m).filter_map(|(x, y)| y.map(|y| (y - x) * (y - x)));
    let (mut n_observed, mut sum_m2) = (0, 0.0);
    for square in pairs {
        n_observed += 1;
        sum_m2 += square;
    }
    Ok(ln_gaussian(n_observed, sum_m2, 1e-6 * noise_sd_um))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ReducedForward;
    use std::collections::BTreeMap;

    /// The vectorised posterior equals prior plus scalar likelihood, with a parameter fixed and one point outside the trained range.
    #[test]
    fn equals_prior_plus_scalar_likelihood() {
        let all = PriorSet::named("porcine").expect("embedded");
        let priors = all.without(&["viscosity_1_pa_s"]);
        let fixed = BTreeMap::from([("viscosity_1_pa_s".to_string(), 1.4)]);
        let time_s: Vec<f64> = (0..80).map(|i| 0.05 * f64::from(i)).collect();
        let force_n: Vec<f64> = (0..80).map(|i| if i < 40 { 4.6e-6 } else { -4.6e-6 }).collect();
        let observed: Vec<Option<f64>> = (0..80).map(|i| (i % 5 != 0).then_some(1e-5 * f64::from(i))).collect();
        let range = |name: &str, lower, upper| TrainedRange { name: name.into(), lower, upper };
        let trained = [
            range("young_modulus_pa", 0.5, 20.0),
            range("viscosity_1_pa_s", 0.1, 9.0),
            range("viscosity_2_pa_s", 5.0, 500.0),
        ];
        let data = SumOfSquares::new(&time_s, &force_n, &observed);
        let posterior = ReducedPosterior::new(BaseLaw::Lethersich, 549.0, &trained, data, &priors, &fixed);
        let forward = ReducedForward {
            compliance_per_m: 549.0,
            law: BaseLaw::Lethersich,
            time_s: &time_s,
            force_n: &force_n,
            trained: &trained,
        };
        let naturals = [[3.5, 47.0, 4.0], [2.0, 100.0, 50.0], [25.0, 47.0, 4.0]];
        let n = naturals.len();
        let mut points = vec![0.0; 3 * n];
        for (i, natural) in naturals.iter().enumerate() {
            for (d, z) in priors.to_unconstrained(natural).into_iter().enumerate() {
                points[d * n + i] = z;
            }
        }
        let mut density = vec![0.0; n];
        posterior.log_density(&points, &mut density);
        for (i, [young, viscosity_2, noise]) in naturals.into_iter().enumerate().take(2) {
            let z: Vec<f64> = (0..3).map(|d| points[d * n + i]).collect();
            let prior: f64 = priors.priors().iter().zip(&z).map(|(p, z)| p.distribution.ln_pdf_unconstrained(*z)).sum();
            let likelihood =
                ln_likelihood(&forward, &observed, &[young, 1.4, viscosity_2], noise).expect("inside the range");
            assert!((density[i] / (prior + likelihood) - 1.0).abs() < 1e-11, "{} {}", density[i], prior + likelihood);
            assert_eq!(posterior.natural(&z).len(), 4);
        }
        assert_eq!(density[2], f64::NEG_INFINITY);
    }

    /// Batches of any size, over several lanes' passes, give every point the bits that it has alone.
    #[test]
    fn the_value_of_a_point_does_not_depend_on_its_batch() {
        let priors = PriorSet::named("porcine").expect("embedded");
        let time_s: Vec<f64> = (0..90).map(|i| 0.05 * f64::from(i)).collect();
        let force_n: Vec<f64> = (0..90).map(|i| if i < 45 { 4.6e-6 } else { -4.6e-6 }).collect();
        let observed: Vec<Option<f64>> = (0..90).map(|i| Some(1e-5 * f64::from(i))).collect();
        let data = SumOfSquares::new(&time_s, &force_n, &observed);
        let posterior = ReducedPosterior::new(BaseLaw::Lethersich, 549.0, &[], data, &priors, &BTreeMap::new());
        let coordinate = |point: usize, d: usize| (1.0 + d as f64) * (0.37 * point as f64 + d as f64).sin();
        let log_density = |points: &[usize]| {
            let batch: Vec<f64> = (0..4).flat_map(|d| points.iter().map(move |&point| coordinate(point, d))).collect();
            let mut values = vec![0.0; points.len()];
            posterior.log_density(&batch, &mut values);
            values.into_iter().map(f64::to_bits).collect::<Vec<u64>>()
        };
        let alone: Vec<u64> = (0..67).flat_map(|point| log_density(&[point])).collect();
        for size in [2, 3, 7, 8, 15, 16, 17, 31, 32, 33, 64, 67] {
            let points: Vec<usize> = (0..67).collect();
            for batch in points.chunks(size) {
                let expected: Vec<u64> = batch.iter().map(|&point| alone[point]).collect();
                assert_eq!(log_density(batch), expected, "batches of {size}");
            }
        }
    }
}

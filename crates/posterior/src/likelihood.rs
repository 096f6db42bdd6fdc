//! Posterior density over the sampler's coordinates, by the reduced model.
//!
//! Two methods compute the same density. A fast kernel serves the Lethersich law alone under white noise and a held force. All other models use the model's stages, the
//! response and the noise filter, for eight points at a time.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::noise::{NoiseLikelihood, NoiseModel};
use super::prior::PriorSet;
use base::elementary;
use base::error::Result;
use base::number::Dual;
use laws::rheology::{BaseLaw, LETHERSICH};
use models::model::{
    Compliance, CreepLanes, Forward, Lanes, Model, N_LANES, ResidualSumOfSquares, Response, TrainedRange,
};
use record::Force;
use sampling::LogDensity;

/// Source of a parameter's value: the sampler, or the table of fixed values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterSource {
    /// The value follows from the sampler's coordinate with this index.
    Sampled(usize),
    /// Fixed value from the table `[fixed]` of `model.toml`, in the parameter's unit.
    Fixed(f64),
}

/// Source of every parameter: the model's parameters in order, then the noise parameters.
pub fn sources(
    model: &Model,
    noise: NoiseModel,
    priors: &PriorSet,
    fixed: &BTreeMap<String, f64>,
) -> Vec<ParameterSource> {
    let of_noise = noise.parameters();
    let source = |name: &str| match priors.names().position(|label| label == name) {
        Some(index) => ParameterSource::Sampled(index),
        None => ParameterSource::Fixed(fixed.get(name).copied().unwrap_or(f64::NAN)),
    };
    model.parameters().iter().chain(&of_noise).map(|spec| source(spec.name)).collect()
}

/// Model, noise, mechanics, priors and fixed values of a posterior.
pub struct PosteriorParts<'a> {
    /// Law and effects of the posterior's model.
    pub model: &'a Model,
    /// Noise model, which determines the likelihood of the residuals.
    pub noise: NoiseModel,
    /// Factor, in 1/m, that converts the integral ∫J dF of creep compliance J over force increments dF into a position.
    pub compliance: Compliance,
    /// Ranges of the law's parameters in which the reduced model is valid; empty if it is valid everywhere.
    pub trained: &'a [TrainedRange],
    /// Priors of the sampled parameters, in the sampler's order.
    pub priors: &'a PriorSet,
    /// Values of the parameters that are not sampled.
    pub fixed: &'a BTreeMap<String, f64>,
}

/// Distance (nats) below the floor at which a coarse log density rejects a point. Trained trajectories are certified to 10⁻⁴ of the amplitude, which changes log densities
/// by a few nats in records with 10⁻³ of noise.
const COARSE_NATS: f64 = 30.0;

/// Prior probability beyond either end of a parameter's range. If the surrogate has no trained range, these ranges determine the tabulated rates.
const TABLE_TAIL: f64 = 1e-9;

/// Logarithms of the slowest and the fastest retardation rate E/c₁ (1/s) within the ranges of Young's modulus E and retardation viscosity c₁.
fn ln_rates(parts: &PosteriorParts<'_>) -> (f64, f64) {
    let ends = |name: &str| {
        let trained = parts.trained.iter().find(|range| range.name == name).map(|range| (range.lower, range.upper));
        let fixed = || parts.fixed.get(name).map(|value| (*value, *value));
        let of_prior = || {
            let distribution = parts.priors.get(name)?.distribution;
            Some((distribution.quantile(TABLE_TAIL), distribution.quantile(1.0 - TABLE_TAIL)))
        };
        fixed().or(trained).or_else(of_prior).unwrap_or((f64::NAN, f64::NAN))
    };
    let ((e_low, e_high), (c_low, c_high)) = (ends(LETHERSICH[0].name), ends(LETHERSICH[1].name));
    ((e_low / c_high).ln(), (e_high / c_low).ln())
}

/// Record that a posterior is conditioned on. All slices have one entry per row.
#[derive(Debug, Clone, Copy)]
pub struct FittedRecord<'a> {
    /// Time of each row in s.
    pub time_s: &'a [f64],
    /// Commanded force (N) at each row, with the rule for the force between rows.
    pub force: Force<'a>,
    /// Number of the recording to which each row belongs ([`super::recordings`]).
    pub recording: &'a [u32],
    /// Measured positions (m) that the likelihood compares with the model; `None` at all other rows.
    pub observed_m: &'a [Option<f64>],
}

/// Log posterior density by the reduced model: sum of log prior and log likelihood of the compared positions.
///
/// A point outside the surrogate's trained range has log density −∞. This truncates the prior. The lost probability is at most the tail mass with which the range was
/// chosen. The log density is also −∞ at a point at which an effect cannot be computed.
pub struct ReducedPosterior<'a> {
    parts: PosteriorParts<'a>,
    /// Source of every parameter: the model's parameters in order, then the noise parameters.
    sources: Vec<ParameterSource>,
    kernel: Kernel,
}

enum Kernel {
    /// Kernel for the Lethersich law without effects, under white noise and a force that holds between rows.
    Squares(ResidualSumOfSquares),
    /// General kernel for all models that [`Self::Squares`] does not cover.
    Stages { response: Response, noise: NoiseLikelihood },
}

impl<'a> ReducedPosterior<'a> {
    /// Creates the posterior of a model for a record, with the likelihood kernel that suits the model.
    pub fn new(parts: PosteriorParts<'a>, record: FittedRecord<'_>) -> Self {
        let PosteriorParts { model, noise, priors, fixed, .. } = parts;
        let FittedRecord { time_s, force, recording, observed_m } = record;
        let sources = sources(model, noise, priors, fixed);
        let is_plain = model.base() == BaseLaw::Lethersich && model.is_law_alone();
        let kernel = if is_plain && noise == NoiseModel::default() && !force.is_linear() {
            Kernel::Squares(ResidualSumOfSquares::new(time_s, force.at_rows_n, observed_m).tabulated(ln_rates(&parts)))
        } else {
            let n_rows = observed_m.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
            Kernel::Stages {
                response: Response::new(time_s, force, n_rows),
                noise: NoiseLikelihood::new(noise, time_s, recording, observed_m),
            }
        };
        Self { parts, sources, kernel }
    }

    /// Converts a point of the sampler to the natural values of all parameters, sampled and fixed: the model's parameters, then the noise parameters.
    pub fn natural(&self, point: &[f64]) -> Vec<f64> {
        let value = |source: &ParameterSource| match *source {
            ParameterSource::Sampled(index) => {
                self.parts.priors.priors()[index].distribution.from_unconstrained(point[index])
            }
            ParameterSource::Fixed(value) => value,
        };
        self.sources.iter().map(value).collect()
    }

    /// Computes the log density over natural values for a batch of n = `log_density.len()` points. Parameter d of point i is `points[d * n + i]`, in the units and the
    /// order of the priors. [`LogDensity::log_density`] is over the sampler's coordinates and differs by the Jacobian.
    pub fn log_density_natural(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        if n == 0 {
            return;
        }
        self.fill(
            log_density,
            |index, out| out.copy_from_slice(&points[index * n..(index + 1) * n]),
            |log_density| self.parts.priors.add_ln_pdf(points, log_density),
            None,
        );
    }

    /// Computes the log density of a batch: −∞ outside the trained ranges, otherwise prior plus likelihood. `natural(d, out)` writes the values of sampled parameter d
    /// at all points into `out`. `add_prior` adds the log prior. If `coarse` is given, the function trains no trajectories, and marks the points that would need them.
    fn fill(
        &self,
        log_density: &mut [f64],
        natural: impl Fn(usize, &mut [f64]),
        add_prior: impl FnOnce(&mut [f64]),
        coarse: Option<&mut [bool]>,
    ) {
        let n = log_density.len();
        let mut values = vec![0.0; self.sources.len() * n];
        for (source, out) in self.sources.iter().zip(values.chunks_exact_mut(n)) {
            match *source {
                ParameterSource::Sampled(index) => natural(index, out),
                ParameterSource::Fixed(value) => out.fill(value),
            }
        }
        log_density.fill(0.0);
        for (range, values) in self.parts.trained.iter().zip(values.chunks_exact(n)) {
            for (density, value) in log_density.iter_mut().zip(values) {
                if !range.contains(*value) {
                    *density = f64::NEG_INFINITY;
                }
            }
        }
        add_prior(log_density);
        self.add_ln_likelihood(&mut values, log_density, coarse);
    }

    /// [`LogDensity::log_density`], with `coarse` as in [`Self::fill`].
    fn fill_unconstrained(&self, points: &[f64], log_density: &mut [f64], coarse: Option<&mut [bool]>) {
        let n = log_density.len();
        if n == 0 {
            return;
        }
        let natural = |index: usize, out: &mut [f64]| {
            let distribution = &self.parts.priors.priors()[index].distribution;
            distribution.fill_from_unconstrained(&points[index * n..(index + 1) * n], out);
        };
        let add_prior = |log_density: &mut [f64]| self.parts.priors.add_ln_pdf_unconstrained(points, log_density);
        self.fill(log_density, natural, add_prior, coarse);
    }

    /// Displacement per force (1/m) at unit creep compliance and the experiment's Poisson ratio, and the parameter ranges in which the reduced model is valid.
    pub fn mechanics(&self) -> (f64, &[TrainedRange]) {
        (self.parts.compliance.experiment_per_m(), self.parts.trained)
    }

    /// Number of measured positions that the likelihood compares with the model.
    pub fn n_observed(&self) -> usize {
        match &self.kernel {
            Kernel::Squares(data) => data.n_observed(),
            Kernel::Stages { noise, .. } => noise.n_observed(),
        }
    }

    /// Adds the log likelihood of every point whose log density is not −∞. Parameter d of point i is `values[d * n + i]`, with n points.
    fn add_ln_likelihood(&self, values: &mut [f64], log_density: &mut [f64], mut coarse: Option<&mut [bool]>) {
        match &self.kernel {
            Kernel::Squares(data) => self.add_by_squares(data, values, log_density),
            Kernel::Stages { response, noise } => {
                let mut inside: Vec<usize> =
                    (0..log_density.len()).filter(|i| log_density[*i] > f64::NEG_INFINITY).collect();
                if self.parts.model.is_nonlinear() {
                    self.sort_by_trajectory(values, log_density.len(), &mut inside);
                }
                let mut scratch = Scratch::default();
                for chunk in inside.chunks(N_LANES) {
                    self.add_by_stages(
                        response,
                        noise,
                        values,
                        chunk,
                        &mut scratch,
                        log_density,
                        coarse.as_deref_mut(),
                    );
                }
            }
        }
    }

    /// Sorts points by their model parameters. Points that differ only in their noise become neighbours, so that their common trajectory is computed once.
    fn sort_by_trajectory(&self, values: &[f64], n: usize, points: &mut [usize]) {
        let n_model = self.parts.model.parameters().len();
        let of_model = |point: usize| (0..n_model).map(move |d| values[d * n + point]);
        let order = |a: &usize, b: &usize| {
            let differ = of_model(*a).zip(of_model(*b)).map(|(a, b)| a.total_cmp(&b));
            differ.reduce(Ordering::then).unwrap_or(Ordering::Equal).then(a.cmp(b))
        };
        points.sort_unstable_by(order);
    }

    fn add_by_squares(&self, data: &ResidualSumOfSquares, values: &mut [f64], log_density: &mut [f64]) {
        let (n, compliance_per_m) = (log_density.len(), self.parts.compliance.experiment_per_m());
        let Some(inside) = log_density.iter().position(|density| *density > f64::NEG_INFINITY) else { return };
        // A point with log density −∞ takes the values of another point, because its own could lie outside the tables.
        for values in values.chunks_exact_mut(n) {
            let value = values[inside];
            values
                .iter_mut()
                .zip(&*log_density)
                .filter(|(_, d)| **d == f64::NEG_INFINITY)
                .for_each(|(x, _)| *x = value);
        }
        let (law, noise_sd_um) = values.split_at_mut(3 * n);
        let (young, viscosities) = law.split_at_mut(n);
        let (viscosity_1, viscosity_2) = viscosities.split_at_mut(n);
        for i in 0..n {
            viscosity_1[i] = young[i] / viscosity_1[i];
            young[i] = compliance_per_m / young[i];
            viscosity_2[i] = compliance_per_m / viscosity_2[i];
        }
        let lanes = CreepLanes { retarded_m_per_n: young, rate_per_s: viscosity_1, flow_m_per_n_s: viscosity_2 };
        let mut space = vec![0.0; 2 * n];
        let (sum_m2, ln_noise) = space.split_at_mut(n);
        data.evaluate(lanes, sum_m2);
        noise_sd_um.iter_mut().for_each(|sd| *sd *= 1e-6);
        ln_noise.copy_from_slice(noise_sd_um);
        elementary::ln_all(ln_noise);
        for i in 0..n {
            if log_density[i] > f64::NEG_INFINITY {
                log_density[i] += ln_gaussian(data.n_observed(), sum_m2[i], noise_sd_um[i], ln_noise[i]);
            }
        }
    }

    /// Adds the log likelihood of at most [`N_LANES`] points by stages, response and noise filter. `points` holds the indices of the points. `coarse` is as in [`Self::fill`].
    #[expect(clippy::too_many_arguments, reason = "joins the parts of one likelihood")]
    fn add_by_stages(
        &self,
        response: &Response,
        noise: &NoiseLikelihood,
        values: &[f64],
        points: &[usize],
        scratch: &mut Scratch,
        log_density: &mut [f64],
        mut coarse: Option<&mut [bool]>,
    ) {
        let n = log_density.len();
        let n_model = self.parts.model.parameters().len();
        let mut is_coarse = false;
        scratch.clear();
        for &point in points {
            let is_same = |(d, parameter): (usize, &Dual)| parameter.value == values[d * n + point];
            if let Some(&lane) = scratch.lanes.last()
                && scratch.parameters.len() == n_model
                && scratch.parameters.iter().enumerate().all(is_same)
            {
                scratch.points.push(point);
                scratch.lanes.push(lane);
                if let Some(coarse) = &mut coarse {
                    coarse[point] = is_coarse;
                }
                continue;
            }
            scratch.parameters.clear();
            scratch.parameters.extend((0..n_model).map(|d| Dual::constant(values[d * n + point])));
            let stages = self.parts.model.stages(&scratch.parameters);
            match stages.and_then(|mut stages| {
                let compliance_per_m = self.parts.compliance.resolve(&mut stages)?;
                Ok((stages, compliance_per_m.value))
            }) {
                Ok((mut stages, compliance_per_m)) => {
                    if let Some(coarse) = &mut coarse {
                        is_coarse = stages.avoid_training(compliance_per_m);
                        coarse[point] = is_coarse;
                    }
                    scratch.points.push(point);
                    scratch.lanes.push(scratch.stages.len());
                    scratch.stages.push(stages);
                    scratch.compliances_per_m.push(compliance_per_m);
                }
                Err(_) => {
                    log_density[point] = f64::NEG_INFINITY;
                    // The model cannot be computed at this point, so no later point may reuse its trajectory.
                    scratch.parameters.clear();
                }
            }
        }
        if scratch.points.is_empty() {
            return;
        }
        let mut is_valid =
            response.trajectories_m(&scratch.stages, &scratch.compliances_per_m, &mut scratch.positions_m);
        let sums = scratch.positions_m.iter().fold([0.0; N_LANES], |mut sums, row| {
            sums.iter_mut().zip(&row.0).for_each(|(sum, x)| *sum += x);
            sums
        });
        // A trajectory whose numbers overflow cannot be computed either.
        is_valid.iter_mut().zip(sums).for_each(|(valid, sum)| *valid &= sum.is_finite());
        // If no point has a trajectory, `positions_m` may have too few rows.
        if !is_valid.contains(&true) {
            scratch.points.iter().for_each(|point| log_density[*point] = f64::NEG_INFINITY);
            return;
        }
        if scratch.stages.len() < scratch.points.len() {
            for row in &mut scratch.positions_m {
                let packed = row.0;
                row.0.iter_mut().zip(&scratch.lanes).for_each(|(x, lane)| *x = packed[*lane]);
            }
        }
        let of_lane = |d: usize, lane: usize| values[d * n + scratch.points[lane.min(scratch.points.len() - 1)]];
        let of_noise: Vec<[f64; N_LANES]> =
            (n_model..self.sources.len()).map(|d| std::array::from_fn(|lane| of_lane(d, lane))).collect();
        let mut ln_likelihood = [0.0; N_LANES];
        noise.ln_likelihood_lanes(&scratch.positions_m, &of_noise, &mut ln_likelihood);
        for (lane, (&point, &point_place)) in scratch.points.iter().zip(&scratch.lanes).enumerate() {
            if is_valid[point_place] {
                log_density[point] += ln_likelihood[lane];
            } else {
                log_density[point] = f64::NEG_INFINITY;
            }
        }
    }
}

/// Buffers for the at most eight points whose likelihood is computed together.
#[derive(Default)]
struct Scratch {
    parameters: Vec<Dual>,
    points: Vec<usize>,
    /// Index of each point's trajectory among the distinct trajectories of the pass.
    lanes: Vec<usize>,
    stages: Vec<models::effects::Stages>,
    compliances_per_m: Vec<f64>,
    positions_m: Vec<Lanes>,
}

impl Scratch {
    fn clear(&mut self) {
        self.points.clear();
        self.lanes.clear();
        self.stages.clear();
        self.compliances_per_m.clear();
    }
}

/// Log likelihood −n ln σ − S/(2σ²) − (n/2) ln 2π of n positions with residual sum of squares S (m²) under white noise of standard deviation σ (m).
fn ln_gaussian(n_observed: usize, sum_m2: f64, noise_sd_m: f64, ln_noise_sd_m: f64) -> f64 {
    /// Constant ln(2π)/2 of the normal log density.
    const HALF_LN_TAU: f64 = 0.918_938_533_204_672_7;
    -(n_observed as f64) * (ln_noise_sd_m + HALF_LN_TAU) - 0.5 * sum_m2 / (noise_sd_m * noise_sd_m)
}

impl LogDensity for ReducedPosterior<'_> {
    fn dimension(&self) -> usize {
        self.parts.priors.priors().len()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        self.fill_unconstrained(points, log_density, None);
    }

    fn log_density_above(&self, points: &[f64], floors: &[f64], log_density: &mut [f64]) {
        if !self.parts.model.is_nonlinear() || floors.iter().all(|floor| *floor == f64::NEG_INFINITY) {
            return self.log_density(points, log_density);
        }
        let n = log_density.len();
        let mut coarse = vec![false; n];
        self.fill_unconstrained(points, log_density, Some(&mut coarse));
        // Where the direct stepper fails, a trained trajectory may exist.
        let is_rejected = |i: usize| log_density[i].is_finite() && log_density[i] < floors[i] - COARSE_NATS;
        let wanted: Vec<usize> = (0..n).filter(|i| coarse[*i] && !is_rejected(*i)).collect();
        let of_wanted = |d: usize| wanted.iter().map(move |i| points[d * n + i]);
        let points: Vec<f64> = (0..self.dimension()).flat_map(of_wanted).collect();
        let mut values = vec![0.0; wanted.len()];
        self.log_density(&points, &mut values);
        wanted.iter().zip(values).for_each(|(i, value)| log_density[*i] = value);
    }
}

/// Log likelihood of one point by any forward model. It serves the full-order model and is the reference in tests of the vectorised likelihood.
pub fn ln_likelihood(
    forward: &dyn Forward,
    noise: &NoiseLikelihood,
    model_parameters: &[f64],
    noise_parameters: &[f64],
) -> Result<f64> {
    Ok(noise.ln_likelihood(&forward.trajectory_m(model_parameters)?, noise_parameters))
}

#[cfg(test)]
#[path = "likelihood_coarse_tests.rs"]
mod coarse_tests;
#[cfg(test)]
#[path = "likelihood_stages_tests.rs"]
mod stages_tests;
#[cfg(test)]
mod tests {
    use super::*;
    use models::model::SurrogateForward;
    use std::collections::BTreeMap;

    /// The vectorised log density equals log prior plus scalar log likelihood. One parameter is fixed, and one point lies outside the trained range.
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
        let model = Model::lethersich();
        let compliance = Compliance::fixed(549.0);
        let parts = PosteriorParts {
            model: &model,
            noise: NoiseModel::default(),
            compliance: compliance.clone(),
            trained: &trained,
            priors: &priors,
            fixed: &fixed,
        };
        let cycle = [1; 80];
        let record =
            FittedRecord { time_s: &time_s, force: (&force_n).into(), recording: &cycle, observed_m: &observed };
        let posterior = ReducedPosterior::new(parts, record);
        let response = Response::new(&time_s, &force_n, time_s.len());
        let forward = SurrogateForward { model: &model, compliance, response, trained: &trained };
        let noise_likelihood = NoiseLikelihood::new(NoiseModel::default(), &time_s, &cycle, &observed);
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
                ln_likelihood(&forward, &noise_likelihood, &[young, 1.4, viscosity_2], &[noise]).expect("in range");
            assert!((density[i] / (prior + likelihood) - 1.0).abs() < 1e-11, "{} {}", density[i], prior + likelihood);
            assert_eq!(posterior.natural(&z).len(), 4);
        }
        assert_eq!(density[2], f64::NEG_INFINITY);
    }

    /// A point has bitwise the same log density alone and in batches of any size, including batches of several passes.
    #[test]
    fn the_value_of_a_point_does_not_depend_on_its_batch() {
        let priors = PriorSet::named("porcine").expect("embedded");
        let time_s: Vec<f64> = (0..90).map(|i| 0.05 * f64::from(i)).collect();
        let force_n: Vec<f64> = (0..90).map(|i| if i < 45 { 4.6e-6 } else { -4.6e-6 }).collect();
        let observed: Vec<Option<f64>> = (0..90).map(|i| Some(1e-5 * f64::from(i))).collect();
        let (model, fixed, cycle) = (Model::lethersich(), BTreeMap::new(), [1; 90]);
        let parts = PosteriorParts {
            model: &model,
            noise: NoiseModel::default(),
            compliance: Compliance::fixed(549.0),
            trained: &[],
            priors: &priors,
            fixed: &fixed,
        };
        let record =
            FittedRecord { time_s: &time_s, force: (&force_n).into(), recording: &cycle, observed_m: &observed };
        let posterior = ReducedPosterior::new(parts, record);
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

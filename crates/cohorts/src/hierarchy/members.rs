//! Contribution of one experiment to the hierarchy: draws of its parameters under an interim prior, or its likelihood.

use nalgebra::{Cholesky, DMatrix, Dyn};
use rand::{Rng, RngExt};
use rand_distr::Distribution;
use rand_distr::weighted::WeightedAliasIndex;

use super::random::normals;

/// Draws of an experiment's parameters under the interim prior, the prior with which the experiment is sampled alone. The coordinates are unbounded.
#[derive(Debug, Clone)]
pub struct InterimDraws {
    /// Coordinates, draw after draw, `n_parameters` values per draw.
    pub coordinates: Vec<f64>,
    /// Logarithm of the interim prior's density over the coordinates, one value per draw.
    pub log_prior: Vec<f64>,
    /// Distribution that proposes the index of a draw, with weights proportional to the inverse of the interim prior's density. `None` if there are no
    /// draws.
    proposal: Option<WeightedAliasIndex<f64>>,
}

impl InterimDraws {
    /// Joins the coordinates of draws with the log density of the interim prior at each draw.
    pub fn new(coordinates: Vec<f64>, log_prior: Vec<f64>) -> Self {
        let least = log_prior.iter().copied().fold(f64::INFINITY, f64::min);
        let inverse = log_prior.iter().map(|log_prior| (least - log_prior).exp()).collect();
        Self { coordinates, log_prior, proposal: WeightedAliasIndex::new(inverse).ok() }
    }

    /// Number of draws.
    pub fn len(&self) -> usize {
        self.log_prior.len()
    }

    /// Returns `true` if there are no draws.
    pub fn is_empty(&self) -> bool {
        self.log_prior.is_empty()
    }

    /// Coordinates of the draw with this index.
    pub fn get(&self, index: usize) -> &[f64] {
        let p = self.coordinates.len() / self.len().max(1);
        &self.coordinates[index * p..(index + 1) * p]
    }

    fn propose(&self, rng: &mut impl Rng) -> usize {
        self.proposal.as_ref().map_or(0, |proposal| proposal.sample(rng))
    }

    /// Effective number of the draws (Kish) if they are re-weighted to a normal population with the given mean and precision matrix: 1/Σw² for weights w
    /// with the sum 1.
    pub fn effective_number(&self, mean: &[f64], precision: &DMatrix<f64>) -> f64 {
        let logs: Vec<f64> = (0..self.len())
            .map(|n| -0.5 * squared_distance(self.get(n), mean, precision) - self.log_prior[n])
            .collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut squares) = (0.0, 0.0);
        for log in logs {
            let weight = (log - largest).exp();
            sum += weight;
            squares += weight * weight;
        }
        sum * sum / squares
    }
}

/// Squared Mahalanobis distance (x − m)ᵀ P (x − m) of a point x from the mean m, with the precision matrix P.
pub(super) fn squared_distance(x: &[f64], mean: &[f64], precision: &DMatrix<f64>) -> f64 {
    let columns = precision.as_slice().chunks_exact(x.len());
    let mut sum = 0.0;
    for (column, (x_own, mean_own)) in columns.zip(x.iter().zip(mean)) {
        let product: f64 = column.iter().zip(x.iter().zip(mean)).map(|(p, (x, m))| p * (x - m)).sum();
        sum += (x_own - mean_own) * product;
    }
    sum
}

/// Exact likelihood of an experiment. A point first holds the coordinates of the pooled parameters, which the population describes. The other parameters
/// of the experiment's model follow.
pub trait ExperimentDensity: Sync {
    /// Log likelihood at a point. It includes the priors of the unpooled parameters, but *not* the interim prior of the pooled parameters. The value is −∞
    /// outside the support.
    fn ln_density(&self, point: &[f64]) -> f64;
    /// Draws of the experiment's parameters under the interim prior. Differences between these draws are proposed as Monte Carlo steps.
    fn archive(&self) -> &[Vec<f64>];
}

/// Form in which an experiment enters the hierarchy.
pub enum ExperimentMember<'a> {
    /// Draws that are re-weighted to the population (Hogg, Myers, Bovy 2010, ApJ 725:2166).
    Draws(&'a InterimDraws),
    /// Exact likelihood. Each step costs the computation of one trajectory.
    Exact(&'a dyn ExperimentDensity),
}

/// State of one experiment in a chain of the Gibbs sampler.
pub(super) struct ChainState {
    /// Coordinates of the experiment's pooled parameters, which the population describes.
    pub coordinates: Vec<f64>,
    index: usize,
    point: Vec<f64>,
    ln_density: f64,
    /// Number of Monte Carlo trials per sweep. The next two fields count the trials made and accepted so far.
    n_trials: usize,
    tried: usize,
    accepted: usize,
}

impl ChainState {
    /// Fixes the number of Monte Carlo trials per sweep so that about two trials are accepted, as far as counted. The number never increases.
    pub(super) fn freeze(&mut self) {
        let wanted = (WANTED_ACCEPTANCES * self.tried).div_ceil(self.accepted.max(1));
        self.n_trials = wanted.clamp(1, self.n_trials);
    }
}

/// Number of Monte Carlo trials per sweep in the first sweeps, which count the accepted trials.
const N_TRIALS: usize = 8;
/// Number of accepted trials per sweep for which [`ChainState::freeze`] aims.
const WANTED_ACCEPTANCES: usize = 2;
/// Fraction of the steps along archived draws that use the full difference of two draws. Such steps can lead from one posterior mode to another.
const WHOLE_STEPS: f64 = 0.1;

impl ExperimentMember<'_> {
    /// Returns `true` if there is no draw to start from.
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Draws(draws) => draws.is_empty(),
            Self::Exact(density) => density.archive().is_empty(),
        }
    }

    pub(super) fn start(&self, n_parameters: usize, rng: &mut impl Rng) -> ChainState {
        let (n_trials, tried, accepted) = (N_TRIALS, 0, 0);
        match self {
            Self::Draws(draws) => {
                let index = rng.random_range(0..draws.len());
                let coordinates = draws.get(index).to_vec();
                ChainState { coordinates, index, point: Vec::new(), ln_density: 0.0, n_trials, tried, accepted }
            }
            Self::Exact(density) => {
                let archive = density.archive();
                let point = archive[rng.random_range(0..archive.len())].clone();
                let ln_density = density.ln_density(&point);
                let coordinates = point[..n_parameters].to_vec();
                ChainState { coordinates, index: 0, point, ln_density, n_trials, tried, accepted }
            }
        }
    }

    /// Makes Monte Carlo steps of the experiment's parameters. The steps leave their distribution invariant, given the population's mean and precision
    /// matrix.
    pub(super) fn step(&self, place: &mut ChainState, mean: &[f64], precision: &DMatrix<f64>, rng: &mut impl Rng) {
        let mut distance = squared_distance(&place.coordinates, mean, precision);
        place.tried += place.n_trials;
        match self {
            Self::Draws(draws) => {
                for _ in 0..place.n_trials {
                    let index = draws.propose(rng);
                    let proposed = squared_distance(draws.get(index), mean, precision);
                    if rng.random::<f64>().ln() < 0.5 * (distance - proposed) {
                        (place.index, distance) = (index, proposed);
                        place.accepted += 1;
                    }
                }
                place.coordinates.copy_from_slice(draws.get(place.index));
            }
            Self::Exact(density) => {
                let steps = ExactSteps::new(*density, mean, precision);
                for _ in 0..place.n_trials {
                    let (point, ln_of_population) = steps.propose(place, rng);
                    let ln_density = density.ln_density(&point);
                    if rng.random::<f64>().ln() < ln_density - place.ln_density + ln_of_population {
                        place.coordinates.copy_from_slice(&point[..mean.len()]);
                        (place.point, place.ln_density) = (point, ln_density);
                        place.accepted += 1;
                    }
                }
            }
        }
    }
}

/// Proposes Monte Carlo steps for an experiment with an exact likelihood. Differences between archived draws suit parameters that the experiment
/// determines. Draws from the population suit parameters that only the population determines.
struct ExactSteps<'a> {
    density: &'a dyn ExperimentDensity,
    mean: &'a [f64],
    precision: &'a DMatrix<f64>,
    /// Cholesky factor of the population's precision matrix; `None` if the matrix is not positive definite.
    factor: Option<Cholesky<f64, Dyn>>,
}

impl<'a> ExactSteps<'a> {
    fn new(density: &'a dyn ExperimentDensity, mean: &'a [f64], precision: &'a DMatrix<f64>) -> Self {
        Self { density, mean, precision, factor: Cholesky::new(precision.clone()) }
    }

    /// Proposes a new point of the experiment's parameters. Also returns the population's contribution to the log acceptance ratio.
    fn propose(&self, place: &ChainState, rng: &mut impl Rng) -> (Vec<f64>, f64) {
        match &self.factor {
            Some(factor) if rng.random::<bool>() => (self.by_population(place, factor, rng), 0.0),
            _ => {
                let point = self.along_archive(place, rng);
                let distance = |x: &[f64]| squared_distance(&x[..self.mean.len()], self.mean, self.precision);
                let ln_of_population = 0.5 * (distance(&place.point) - distance(&point));
                (point, ln_of_population)
            }
        }
    }

    /// Proposes m + cos(θ)(φ − m) + sin(θ) ξ. Here φ are the present coordinates, m is the population's mean, ξ a deviation drawn from the population, and θ
    /// uniform between 0 and π/2. The proposal leaves the population's distribution invariant (preconditioned Crank–Nicolson; Cotter et al. 2013, Stat. Sci.
    /// 28:424).
    fn by_population(&self, place: &ChainState, factor: &Cholesky<f64, Dyn>, rng: &mut impl Rng) -> Vec<f64> {
        let mut fresh = normals(self.mean.len(), rng);
        factor.l_dirty().tr_solve_lower_triangular_mut(&mut fresh);
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * rng.random::<f64>()).sin_cos();
        let mut point = place.point.clone();
        for ((x, mean), fresh) in point.iter_mut().zip(self.mean).zip(fresh.iter()) {
            *x = mean + cos * (*x - mean) + sin * fresh;
        }
        point
    }

    fn along_archive(&self, place: &ChainState, rng: &mut impl Rng) -> Vec<f64> {
        let archive = self.density.archive();
        // This step scale is optimal for a normal target (ter Braak 2006, Stat. Comput. 16:239).
        let short = 2.38 / (2.0 * place.point.len() as f64).sqrt();
        let scale = if rng.random::<f64>() < WHOLE_STEPS { 1.0 } else { short };
        let from = &archive[rng.random_range(0..archive.len())];
        let to = &archive[rng.random_range(0..archive.len())];
        place.point.iter().zip(to.iter().zip(from)).map(|(x, (to, from))| x + scale * (to - from)).collect()
    }
}

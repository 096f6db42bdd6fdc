//! What is known of one experiment's parameters: draws under an interim prior, or its likelihood itself.

use nalgebra::DMatrix;
use rand::{Rng, RngExt};

/// Draws of an experiment's logarithmic parameters under the interim prior.
#[derive(Debug, Clone, PartialEq)]
pub struct InterimDraws {
    /// Parameters; `n_parameters` values a draw.
    pub log_parameters: Vec<f64>,
    /// Log-density of the interim prior over the logarithmic parameters, one value a draw.
    pub log_prior: Vec<f64>,
    /// Proposals are drawn in proportion to the inverse interim prior: cumulative, from 0 to 1.
    cumulative: Vec<f64>,
}

impl InterimDraws {
    /// Draws with the interim prior's log-density at each.
    pub fn new(log_parameters: Vec<f64>, log_prior: Vec<f64>) -> Self {
        let least = log_prior.iter().copied().fold(f64::INFINITY, f64::min);
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = log_prior
            .iter()
            .map(|log_prior| {
                sum += (least - log_prior).exp();
                sum
            })
            .collect();
        cumulative.iter_mut().for_each(|value| *value /= sum);
        Self { log_parameters, log_prior, cumulative }
    }

    /// Number of draws.
    pub fn len(&self) -> usize {
        self.log_prior.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.log_prior.is_empty()
    }

    /// Parameters of a draw.
    pub fn get(&self, index: usize) -> &[f64] {
        let p = self.log_parameters.len() / self.len().max(1);
        &self.log_parameters[index * p..(index + 1) * p]
    }

    pub(super) fn propose(&self, rng: &mut impl Rng) -> usize {
        let level: f64 = rng.random();
        self.cumulative.partition_point(|value| *value < level).min(self.len() - 1)
    }

    /// Effective number of draws, 1/Σw², where they are weighted to a normal population (Kish).
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

/// (x − m)ᵀ P (x − m).
pub(super) fn squared_distance(x: &[f64], mean: &[f64], precision: &DMatrix<f64>) -> f64 {
    let p = x.len();
    let mut sum = 0.0;
    for row in 0..p {
        let at_row = x[row] - mean[row];
        let mut product = 0.0;
        for column in 0..p {
            product += precision[(row, column)] * (x[column] - mean[column]);
        }
        sum += at_row * product;
    }
    sum
}

/// The likelihood of an experiment, its priors but for the pooled parameters included.
pub trait ExperimentDensity: Sync {
    /// Log-density at the sampler's coordinates *without* the interim prior of the pooled parameters; −∞ outside the support.
    fn ln_density(&self, point: &[f64]) -> f64;
    /// Logarithms of the pooled parameters at the sampler's coordinates.
    fn log_parameters(&self, point: &[f64]) -> Vec<f64>;
    /// Draws under the interim prior in the sampler's coordinates, from whose differences steps are proposed.
    fn archive(&self) -> &[Vec<f64>];
}

/// What one experiment brings to the hierarchy.
pub enum Member<'a> {
    /// Draws, re-weighted to the population (Hogg, Myers, Bovy 2010, ApJ 725:2166).
    Draws(InterimDraws),
    /// The likelihood: exact, at the cost of a trajectory a step.
    Exact(&'a dyn ExperimentDensity),
}

/// Where a chain stands in one experiment.
pub(super) struct Place {
    /// Logarithmic parameters.
    pub log_parameters: Vec<f64>,
    index: usize,
    point: Vec<f64>,
    ln_density: f64,
}

/// Trials a sweep for draws, which cost nothing, and for the likelihood.
const N_TRIALS_OF_DRAWS: usize = 8;
const N_TRIALS_OF_EXACT: usize = 3;
/// Share of the exact steps that go the whole way between two draws of the archive, from mode to mode.
const WHOLE_STEPS: f64 = 0.1;

impl Member<'_> {
    pub(super) fn start(&self, rng: &mut impl Rng) -> Place {
        match self {
            Self::Draws(draws) => {
                let index = rng.random_range(0..draws.len());
                Place { log_parameters: draws.get(index).to_vec(), index, point: Vec::new(), ln_density: 0.0 }
            }
            Self::Exact(density) => {
                let archive = density.archive();
                let point = archive[rng.random_range(0..archive.len())].clone();
                let (log_parameters, ln_density) = (density.log_parameters(&point), density.ln_density(&point));
                Place { log_parameters, index: 0, point, ln_density }
            }
        }
    }

    /// Steps that leave the conditional distribution given the population's mean and precision as it is.
    pub(super) fn step(&self, place: &mut Place, mean: &[f64], precision: &DMatrix<f64>, rng: &mut impl Rng) {
        let mut distance = squared_distance(&place.log_parameters, mean, precision);
        match self {
            Self::Draws(draws) => {
                for _ in 0..N_TRIALS_OF_DRAWS {
                    let index = draws.propose(rng);
                    let proposed = squared_distance(draws.get(index), mean, precision);
                    if rng.random::<f64>().ln() < 0.5 * (distance - proposed) {
                        (place.index, distance) = (index, proposed);
                    }
                }
                place.log_parameters.copy_from_slice(draws.get(place.index));
            }
            Self::Exact(density) => {
                let archive = density.archive();
                // Optimal for a normal target (ter Braak 2006, Stat. Comput. 16:239).
                let short = 2.38 / (2.0 * place.point.len() as f64).sqrt();
                for _ in 0..N_TRIALS_OF_EXACT {
                    let scale = if rng.random::<f64>() < WHOLE_STEPS { 1.0 } else { short };
                    let from = &archive[rng.random_range(0..archive.len())];
                    let to = &archive[rng.random_range(0..archive.len())];
                    let point: Vec<f64> = place
                        .point
                        .iter()
                        .zip(to.iter().zip(from))
                        .map(|(x, (to, from))| x + scale * (to - from))
                        .collect();
                    let log_parameters = density.log_parameters(&point);
                    let ln_density = density.ln_density(&point);
                    let proposed = squared_distance(&log_parameters, mean, precision);
                    let ln_ratio = ln_density - place.ln_density + 0.5 * (distance - proposed);
                    if rng.random::<f64>().ln() < ln_ratio {
                        distance = proposed;
                        *place = Place { log_parameters, index: 0, point, ln_density };
                    }
                }
            }
        }
    }
}

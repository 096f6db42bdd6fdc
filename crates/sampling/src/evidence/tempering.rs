//! Evidence by sequential Monte Carlo, in which particles move from the prior to the posterior.
//!
//! Particles are drawn from the prior p(θ) of the parameters θ. Their density becomes p(θ) p(data | θ)^φ, while the exponent φ rises from 0 to 1
//! (Neal 2001, doi:10.1023/A:1008923215028; Del Moral et al. 2006, doi:10.1111/j.1467-9868.2006.00553.x). Each rise of φ is chosen so that nine
//! tenths of the particles stay effective. The particles are then resampled, and moved until most of them have moved. All moves leave the density at
//! the present φ invariant. There are two kinds of moves. Jumps are draws from a proposal that is fitted to the particles, with one component per
//! mode (`charts`); jumps carry particles between modes. Steps follow the difference of two particles (ter Braak 2006, doi:10.1007/s11222-006-8769-1)
//! and need no proposal. The evidence is the product of the mean weights of all rises. Several independent replicates give its error.
//!
//! Particles may disappear from a region in which moves are rarely accepted, such as a narrow ridge beside a wide peak. The evidence is then too low
//! by this region's fraction of the mass, and the replicates do not show the error.

use rayon::prelude::*;

use super::charts::ProposalMixture;
use super::coordinates::ln_standard_normal;
use super::proposal::{Map, Proposal};
use super::weighted::{effective_size, normalised, resampled_indices};
use super::{Estimate, WeightedDraws, evaluate, ln_mean};
use crate::LogDensity;
use crate::ensemble::RandomStream;
use crate::optimum::Modes;
use base::error::{Error, Result};

/// Numbers of particles and replicates of a sequential Monte Carlo estimate, and the seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TemperingOptions {
    /// Number of particles per replicate.
    pub n_particles: usize,
    /// Number of independent replicates, at least two.
    pub n_replicates: usize,
    /// Seed of all replicates.
    pub seed: u64,
}

impl Default for TemperingOptions {
    fn default() -> Self {
        Self { n_particles: 800, n_replicates: 3, seed: 1 }
    }
}

/// Fraction of the particles that stay effective after a rise of the likelihood's exponent.
const KEPT_SHARE: f64 = 0.9;
/// Largest number of values of the likelihood's exponent between 0 and 1.
const MOST_TEMPERATURES: usize = 1_000;
/// Mean number of accepted moves per particle at which the moves for one exponent of the likelihood end. The moves also end after [`MOST_ROUNDS`]
/// rounds of one jump and one step each.
const WANTED_ACCEPTANCES: f64 = 3.0;
const MOST_ROUNDS: usize = 12;

/// Estimates the evidence by sequential Monte Carlo. The coordinates of the posterior must have standard normal priors ([`super::PriorCoordinates`]).
/// `modes` may be empty. Given modes, the proposal for jumps can be fitted mode by mode, to the particles nearest to each mode.
///
/// # Errors
/// [`Error::Numerical`] if no draw from the prior has a finite density, if the likelihood's exponent does not reach 1, or if the density is +∞ or
/// often NaN.
pub fn evidence(posterior: &dyn LogDensity, modes: &Modes, options: &TemperingOptions) -> Result<Estimate> {
    let one = |replicate: usize| Replicate::new((posterior, modes), options, replicate as u64)?.run();
    let runs: Vec<Finished> = (0..options.n_replicates.max(2)).into_par_iter().map(one).collect::<Result<_>>()?;
    let ln_evidences: Vec<f64> = runs.iter().map(|run| run.ln_evidence).collect();
    let (ln_evidence, scatter) = ln_mean(&ln_evidences);
    let n_runs = runs.len() as f64;
    // A few replicates may agree by chance. The error is therefore at least the error for particles that are independent at every exponent of the
    // likelihood.
    let least = (runs.iter().map(|run| run.variance).sum::<f64>() / n_runs / n_runs).sqrt();
    let n_evaluations = runs.iter().map(|run| run.n_evaluations).sum();
    // The draws of each replicate are weighted by its evidence.
    let ln_weights: Vec<f64> =
        runs.iter().flat_map(|run| std::iter::repeat_n(run.ln_evidence, run.points.len())).collect();
    let points = runs.into_iter().flat_map(|run| run.points).collect();
    let draws = WeightedDraws::new(points, &ln_weights);
    Ok(Estimate { ln_evidence, standard_error: scatter.max(least), pareto_k: None, draws, n_evaluations })
}

struct Finished {
    ln_evidence: f64,
    /// Variance of the log evidence for particles that are independent of each other at every exponent of the likelihood.
    variance: f64,
    points: Vec<Vec<f64>>,
    n_evaluations: usize,
}

#[derive(Clone)]
struct Particle {
    point: Vec<f64>,
    ln_prior: f64,
    ln_likelihood: f64,
}

impl Particle {
    fn tempered(&self, phi: f64) -> f64 {
        self.ln_prior + phi * self.ln_likelihood
    }
}

struct Replicate<'a> {
    posterior: &'a dyn LogDensity,
    modes: &'a Modes,
    particles: Vec<Particle>,
    phi: f64,
    ln_evidence: f64,
    variance: f64,
    stream: RandomStream,
    n_evaluations: usize,
}

impl<'a> Replicate<'a> {
    fn new(
        (posterior, modes): (&'a dyn LogDensity, &'a Modes),
        options: &TemperingOptions,
        replicate: u64,
    ) -> Result<Self> {
        let mut stream = RandomStream::new(options.seed, replicate);
        let dimension = posterior.dimension();
        let points = (0..options.n_particles).map(|_| (0..dimension).map(|_| stream.normal()).collect()).collect();
        let (particles, phi, ln_evidence, variance, n_evaluations) = (Vec::new(), 0.0, 0.0, 0.0, 0);
        let mut made = Self { posterior, modes, particles, phi, ln_evidence, variance, stream, n_evaluations };
        made.particles = made.particles_at(points)?;
        Ok(made)
    }

    fn particles_at(&mut self, points: Vec<Vec<f64>>) -> Result<Vec<Particle>> {
        self.n_evaluations += points.len();
        let values = evaluate(self.posterior, &points)?;
        let particle = |(point, value): (Vec<f64>, f64)| {
            let ln_prior = ln_standard_normal(&point);
            Particle { point, ln_prior, ln_likelihood: value - ln_prior }
        };
        Ok(points.into_iter().zip(values).map(particle).collect())
    }

    fn run(mut self) -> Result<Finished> {
        for _ in 0..MOST_TEMPERATURES {
            let weights = self.raise_temperature()?;
            let proposals = self.proposals(&weights);
            let picked = resampled_indices(&weights, self.particles.len(), &mut self.stream);
            self.particles = picked.into_iter().map(|i| self.particles[i].clone()).collect();
            if let Some((jumps, map)) = &proposals {
                self.move_particles(jumps, map)?;
            }
            if self.phi == 1.0 {
                let points = self.particles.into_iter().map(|particle| particle.point).collect();
                let Self { ln_evidence, variance, n_evaluations, .. } = self;
                return Ok(Finished { ln_evidence, variance, points, n_evaluations });
            }
        }
        Err(Error::numerical(
            format!(
                "sequential Monte Carlo reached only the power {:.2e} of the likelihood in {MOST_TEMPERATURES} steps",
                self.phi
            ),
            "give priors closer to values that explain the data",
        ))
    }

    /// Raises the likelihood's exponent as far as the fraction [`KEPT_SHARE`] of the particles stays effective. Returns the particles' weights for
    /// this rise.
    fn raise_temperature(&mut self) -> Result<Vec<f64>> {
        let increments = |phi: f64| -> Vec<f64> {
            self.particles.iter().map(|particle| (phi - self.phi) * particle.ln_likelihood).collect()
        };
        let n_finite = self.particles.iter().filter(|particle| particle.ln_likelihood.is_finite()).count();
        if n_finite == 0 {
            return Err(Error::numerical(
                "no draw from the prior has a finite log likelihood",
                "check the medians and spreads of the priors, and the units of the data",
            ));
        }
        let wanted = KEPT_SHARE * n_finite as f64;
        let leaves_enough = |phi: f64| effective_size(&normalised(&increments(phi))) >= wanted;
        let (mut lower, mut upper) = (self.phi, 1.0);
        if !leaves_enough(1.0) {
            for _ in 0..50 {
                let middle = 0.5 * (lower + upper);
                if leaves_enough(middle) { lower = middle } else { upper = middle }
            }
        }
        let ln_weights = increments(upper);
        let (ln_mean, error) = ln_mean(&ln_weights);
        self.ln_evidence += ln_mean;
        self.variance += error * error;
        self.phi = upper;
        Ok(normalised(&ln_weights))
    }

    /// Fits the proposal for jumps to the weighted particles. Returns the proposal, and the map in whose coordinates the particles make steps.
    fn proposals(&mut self, weights: &[f64]) -> Option<(ProposalMixture, Map)> {
        let points: Vec<Vec<f64>> = self.particles.iter().map(|particle| particle.point.clone()).collect();
        let one = Proposal::fitted(&points, weights, &mut self.stream)?;
        let map = one.map.clone();
        Some((
            ProposalMixture::best_of_single_or_split(Some(one), &points, weights, self.modes, &mut self.stream)?,
            map,
        ))
    }

    fn move_particles(&mut self, jumps: &ProposalMixture, map: &Map) -> Result<()> {
        let wanted = WANTED_ACCEPTANCES * self.particles.len() as f64;
        let mut n_accepted = 0;
        for _ in 0..MOST_ROUNDS {
            n_accepted += self.jump(jumps)?;
            n_accepted += self.step(map)?;
            if n_accepted as f64 >= wanted {
                break;
            }
        }
        Ok(())
    }

    fn jump(&mut self, proposal: &ProposalMixture) -> Result<usize> {
        let points = proposal.draw(self.particles.len(), self.posterior.dimension(), &mut self.stream);
        self.accept(points, |old, new| proposal.ln_density(old) - proposal.ln_density(new))
    }

    /// Proposes for each particle a step along the difference of two others, in the coordinates of `map`. Returns the number of accepted steps.
    fn step(&mut self, map: &Map) -> Result<usize> {
        let length = 2.38 / (2.0 * self.posterior.dimension() as f64).sqrt();
        let n = self.particles.len();
        let straight: Vec<Vec<f64>> =
            self.particles.iter().map(|particle| map.to_mixture_coordinates(&particle.point).0).collect();
        let mut one = |i: usize| {
            let (a, b) = self.stream.distinct_pair(n - 1);
            let other = |k: usize| &straight[(i + 1 + k) % n];
            let moved = straight[i].iter().zip(other(a)).zip(other(b));
            map.point(&moved.map(|((w, a), b)| w + length * (a - b)).collect::<Vec<_>>()).0
        };
        let proposals = (0..n).map(&mut one).collect();
        self.accept(proposals, |old, new| map.to_mixture_coordinates(new).1 - map.to_mixture_coordinates(old).1)
    }

    /// Accepts or rejects one proposed point per particle by the Metropolis–Hastings rule. `ln_factor` returns the logarithm of the correction factor
    /// for the present and the proposed point. Returns the number of accepted proposals.
    fn accept(&mut self, proposals: Vec<Vec<f64>>, ln_factor: impl Fn(&[f64], &[f64]) -> f64) -> Result<usize> {
        let proposed = self.particles_at(proposals)?;
        let mut n_accepted = 0;
        for (old, new) in self.particles.iter_mut().zip(proposed) {
            let ln_ratio = new.tempered(self.phi) - old.tempered(self.phi) + ln_factor(&old.point, &new.point);
            if self.stream.unit().ln() < ln_ratio {
                *old = new;
                n_accepted += 1;
            }
        }
        Ok(n_accepted)
    }
}

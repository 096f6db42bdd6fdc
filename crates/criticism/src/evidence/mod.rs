//! Evidence of a candidate: the probability of the fitted positions, averaged over the priors of all of its parameters.
//!
//! Every parameter of the law, the effects and the noise has a proper prior: the default one, or the one in the prior file. Parameters that two candidates share have
//! equal priors, so differences of log evidences are logarithms of Bayes factors. The priors of the law and of the noise are those of `sample`. They are stricter than
//! those of [`Subject::fit`], which only has to find an optimum.
//!
//! A posterior may have two modes, such as a small effect with one modulus and a large effect with another. Climbs therefore start from a fixed design in the effects'
//! own parameters, with the law and the noise refitted at each point. The proposal distribution covers every mode that the climbs reach. The weights of the draws give
//! each mode its fraction of the evidence.

mod starts;

use super::{Candidate, Fitted, Subject};
use base::error::{Error, InputPlace, Result, Setting};
use documents::diagnosis::{PosteriorMode, RefitParameter};
use models::model::Compliance;
use posterior::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use posterior::prior::PriorSet;
use posterior::problem::Problem;
use sampling::evidence::importance::{self, ImportanceOptions};
use sampling::evidence::tempering::{self, TemperingOptions};
use sampling::evidence::{Estimate, PriorCoordinates, WeightedDraws, estimate, find_density_valley};
use sampling::optimum::{Modes, find_modes, fit_local_gaussian};

pub use starts::Starts;

/// Method of computing an evidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EvidenceMethod {
    /// Importance sampling from a mixture adapted to the posterior.
    ImportanceSampling,
    /// Sequential Monte Carlo from the prior; used if the importance weights have too heavy a tail.
    SequentialMonteCarlo,
}

/// Evidence of a candidate, with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelEvidence {
    /// Log probability density of the fitted positions, in nats for positions in m.
    pub ln_evidence: f64,
    /// Standard error of the log evidence. If importance weights were unreliable, it is at least the difference between the two methods.
    pub standard_error: f64,
    /// Shape k̂ of a Pareto distribution fitted to the largest importance weights; `None` if another method was used.
    pub pareto_k: Option<f64>,
    /// Method that computed the evidence.
    pub method: EvidenceMethod,
    /// Estimates of the law's and the effects' sampled parameters, in the model's order, over all modes.
    pub parameters: Vec<RefitParameter>,
    /// Modes of the posterior, separated by a valley in an effect's parameter, the likelier one first; empty if there is one mode.
    pub modes: Vec<PosteriorMode>,
}

/// Effort with which an evidence is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EvidenceBudget {
    /// All starts of the design, learnt trajectories, and a second method if the first fails; used for the claim.
    Full,
    /// Fewer draws, and importance sampling alone; used for other models beside a claim.
    Brief,
}

/// Posterior of a candidate over the sampler's coordinates.
pub struct CandidatePosterior<'a> {
    subject: &'a Subject,
    problem: Problem,
    care: EvidenceBudget,
}

impl<'a> CandidatePosterior<'a> {
    /// Returns the posterior of a candidate. Columns of free amplitude have no prior, so the candidate must have none.
    ///
    /// # Errors
    /// [`Error::Input`] if the candidate has such columns or does not fit the experiment.
    pub fn new(subject: &'a Subject, candidate: &Candidate) -> Result<Self> {
        if !candidate.columns.is_empty() {
            return Err(Error::input(
                InputPlace::setting(Setting::Effects),
                "columns of free amplitude have no prior, so the model has no evidence",
                "ask for the evidence of a law with effects",
            ));
        }
        let mut specification = subject.specification().clone();
        specification.effects.clone_from(&candidate.effects);
        let problem = subject.problem().with_model(specification, subject.library())?;
        Ok(Self { subject, problem, care: EvidenceBudget::Full })
    }

    /// Priors of the sampled parameters.
    pub fn priors(&self) -> &PriorSet {
        &self.problem.priors
    }

    /// Log density: likelihood of the fitted positions, without outliers, times the priors.
    pub fn density(&self) -> ReducedPosterior<'_> {
        self.density_by(self.subject.compliance())
    }

    /// Log density for many draws. Trajectories of nonlinear laws are remembered.
    fn density_of_draws(&self) -> ReducedPosterior<'_> {
        self.density_by(self.subject.memory_compliance())
    }

    fn density_by(&self, compliance: &Compliance) -> ReducedPosterior<'_> {
        let record = &self.subject.experiment().record;
        let parts = PosteriorParts {
            model: &self.problem.model,
            noise: self.problem.noise,
            compliance: compliance.clone(),
            trained: &[],
            priors: &self.problem.priors,
            fixed: &self.problem.specification.fixed,
        };
        let (observed_m, recordings) = (&self.subject.fitted_m, self.problem.recordings());
        ReducedPosterior::new(
            parts,
            FittedRecord { time_s: &record.time_s, force: record.force(), recording: &recordings, observed_m },
        )
    }

    /// Finds the modes of the posterior, and points on ridges beside them, in [`PriorCoordinates`].
    ///
    /// # Errors
    /// [`Error::Numerical`] if a log density is +∞.
    pub fn modes(&self, candidate: &Candidate, fitted: &Fitted) -> Result<Modes> {
        let starts = self.starts(candidate, fitted);
        let density = self.density();
        let seen = PriorCoordinates::new(&density, self.priors().distributions());
        let of_natural =
            |natural: Vec<f64>| natural.iter().enumerate().map(|(d, x)| seen.from_natural(d, *x)).collect();
        let climbs: Vec<Vec<f64>> = starts.climbs.into_iter().map(of_natural).collect();
        let mut modes = find_modes(&seen, &climbs)?;
        for point in starts.ridges.into_iter().map(of_natural) {
            fit_local_gaussian(&seen, &point)?.iter().for_each(|touching| modes.add(touching));
        }
        Ok(modes)
    }

    /// Estimates the evidence by importance sampling from the modes.
    ///
    /// # Errors
    /// Errors of [`importance::evidence`].
    pub fn by_importance(&self, modes: &Modes, seed: u64) -> Result<Estimate> {
        let options = match (self.problem.model.is_nonlinear(), self.care) {
            (true, _) => ImportanceOptions::for_slow_density(),
            (false, EvidenceBudget::Full) => ImportanceOptions::default(),
            (false, EvidenceBudget::Brief) => ImportanceOptions::quick(),
        };
        let density = self.density_of_draws();
        let seen = PriorCoordinates::new(&density, self.priors().distributions());
        importance::evidence(&seen, modes, &ImportanceOptions { seed, ..options })
    }

    /// Estimates the evidence by sequential Monte Carlo.
    ///
    /// # Errors
    /// Errors of [`tempering::evidence`].
    pub fn by_tempering(&self, modes: &Modes, seed: u64) -> Result<Estimate> {
        let density = self.density_of_draws();
        let seen = PriorCoordinates::new(&density, self.priors().distributions());
        tempering::evidence(&seen, modes, &TemperingOptions { seed, ..TemperingOptions::default() })
    }

    fn estimate(&self, candidate: &Candidate, fitted: &Fitted, seed: u64) -> Result<(Estimate, EvidenceMethod)> {
        let modes = self.modes(candidate, fitted)?;
        if !self.problem.model.is_nonlinear() && self.care == EvidenceBudget::Full {
            let density = self.density_of_draws();
            let seen = PriorCoordinates::new(&density, self.priors().distributions());
            let found = estimate(&seen, &modes, seed)?;
            let method = match found.pareto_k {
                Some(_) => EvidenceMethod::ImportanceSampling,
                None => EvidenceMethod::SequentialMonteCarlo,
            };
            return Ok((found, method));
        }
        // Sequential Monte Carlo takes hundreds of thousands of trajectories. That is too many for models beside a claim, and for any diagnosis if trajectories are
        // computed one by one.
        let weighted = self.by_importance(&modes, seed)?;
        if importance::is_reliable(&weighted) {
            return Ok((weighted, EvidenceMethod::ImportanceSampling));
        }
        Err(Error::numerical(
            "the importance weights of its evidence are unreliable",
            "sample it with `extend`, which takes more draws",
        ))
    }
}

/// Evidence of a candidate for the subject's fitted positions, starting from its fit. It uses importance sampling, or sequential Monte Carlo if the
/// importance weights are unreliable.
///
/// # Errors
/// [`Error::Input`] if the candidate has columns of free amplitude, [`Error::Numerical`] if its posterior cannot be sampled.
pub fn evidence(subject: &Subject, candidate: &Candidate, fitted: &Fitted, seed: u64) -> Result<ModelEvidence> {
    evidence_with(subject, candidate, fitted, (EvidenceBudget::Full, seed))
}

/// Computes [`evidence`] with a given effort.
///
/// # Errors
/// Errors of [`evidence`].
pub(super) fn evidence_with(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    (care, seed): (EvidenceBudget, u64),
) -> Result<ModelEvidence> {
    let posterior = CandidatePosterior { care, ..CandidatePosterior::new(subject, candidate)? };
    let (estimate, method) = posterior.estimate(candidate, fitted, seed)?;
    Ok(evidence_of(&posterior, &estimate, method))
}

/// Posterior of [`evidence`] by importance sampling alone; `None` if the weights are unreliable. It is used for models whose evidence is not compared, since it avoids
/// minutes of sequential sampling.
///
/// # Errors
/// [`Error::Input`] if the candidate has columns of free amplitude.
pub fn posterior_by_importance(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    seed: u64,
) -> Result<Option<ModelEvidence>> {
    let posterior = CandidatePosterior::new(subject, candidate)?;
    match posterior.modes(candidate, fitted).and_then(|modes| posterior.by_importance(&modes, seed)) {
        Ok(estimate) if importance::is_reliable(&estimate) => {
            Ok(Some(evidence_of(&posterior, &estimate, EvidenceMethod::ImportanceSampling)))
        }
        Ok(_) | Err(Error::Numerical { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

fn evidence_of(posterior: &CandidatePosterior, estimate: &Estimate, method: EvidenceMethod) -> ModelEvidence {
    let density = posterior.density();
    let seen = PriorCoordinates::new(&density, posterior.priors().distributions());
    let parameters = parameters_of(posterior, &seen, &estimate.draws);
    let answers = split_modes(posterior, &seen, &estimate.draws);
    let Estimate { ln_evidence, standard_error, pareto_k, .. } = *estimate;
    ModelEvidence { ln_evidence, standard_error, pareto_k, method, parameters, modes: answers }
}

fn parameters_of(
    posterior: &CandidatePosterior,
    seen: &PriorCoordinates,
    draws: &WeightedDraws,
) -> Vec<RefitParameter> {
    let n_model = posterior.problem.model.parameters().len();
    let of_model = |name: &str| posterior.problem.model.parameters()[..n_model].iter().any(|spec| spec.name == name);
    let priors = posterior.priors().priors().iter().enumerate();
    priors
        .filter(|(_, prior)| of_model(&prior.name))
        .map(|(d, prior)| summary(draws, &prior.name, |point| seen.natural(d, point[d])))
        .collect()
}

/// Splits draws at the first valley in a parameter of an effect and returns the modes on both sides; empty if there is no valley.
fn split_modes(posterior: &CandidatePosterior, seen: &PriorCoordinates, draws: &WeightedDraws) -> Vec<PosteriorMode> {
    let n_before = posterior.problem.model.n_before_effects();
    let of_effects = &posterior.problem.model.parameters()[n_before..];
    let priors = posterior.priors().priors().iter().enumerate();
    let mut of_effects = priors.filter(|(_, prior)| of_effects.iter().any(|spec| spec.name == prior.name));
    let Some((d, bottom)) = of_effects.find_map(|(d, _)| Some((d, find_density_valley(draws, |point| point[d])?)))
    else {
        return Vec::new();
    };
    let side = |is_on: &dyn Fn(f64) -> bool| {
        let part = draws.restricted_to(|point| is_on(point[d]));
        let probability = draws.mean(|point| f64::from(u8::from(is_on(point[d]))));
        PosteriorMode { probability, parameters: parameters_of(posterior, seen, &part) }
    };
    let mut sides = vec![side(&|x| x < bottom), side(&|x| x >= bottom)];
    sides.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    sides
}

/// Estimate of one parameter from weighted draws. `of` returns its value in natural units at a draw.
pub fn summary(draws: &WeightedDraws, name: &str, of: impl Fn(&[f64]) -> f64) -> RefitParameter {
    let quantiles = draws.quantiles(&of, &[0.05, 0.95]);
    RefitParameter { name: name.into(), mean: draws.mean(&of), q05: quantiles[0], q95: quantiles[1] }
}

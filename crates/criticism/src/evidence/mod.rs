//! The evidence of a candidate: how probable the fitted positions are under all of its parameters that the priors allow.
//!
//! Every parameter has its proper prior, those of the effects and of the noise included (the default ones, or the prior file's), and parameters that
//! two candidates share have the same: so differences are logarithms of Bayes factors. The priors of the law and of the noise are those of
//! `sample`, not the looser ones of [`Subject::fit`], which has to find an optimum and nothing more.
//!
//! A posterior may give two answers: a little of an effect with one modulus, and much of it with another. Climbs therefore start from a fixed design in the
//! effects' own parameters, with the law and the noise fitted anew at each point of it, and the proposal covers every mode that they end in; the draws'
//! weights then give each the share that its evidence has.

mod starts;

use std::collections::BTreeMap;

use super::{Candidate, Fitted, Subject};
use base::error::{Error, Place, Result, Setting};
use documents::diagnosis::{Answer, RefitParameter};
use models::model::Compliance;
use posterior::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use posterior::prior::PriorSet;
use posterior::problem::Problem;
use sampling::evidence::importance::{self, ImportanceOptions};
use sampling::evidence::tempering::{self, TemperingOptions};
use sampling::evidence::{Estimate, PriorCoordinates, WeightedDraws, valley};
use sampling::optimum::{Modes, find_modes, touching};

pub use starts::Starts;

/// How an evidence was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EvidenceMethod {
    /// Importance sampling from a mixture that was adapted to the posterior.
    ImportanceSampling,
    /// Sequential Monte Carlo from the prior: where importance weights have too heavy a tail.
    SequentialMonteCarlo,
}

/// A candidate's evidence and what its parameters are.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelEvidence {
    /// Log probability density of the fitted positions, in nats for positions in m.
    pub ln_evidence: f64,
    /// Its standard error; where importance weights could not be believed, no less than how far the two methods are apart.
    pub standard_error: f64,
    /// Pareto k̂ of importance sampling; `None` where another method took over.
    pub pareto_k: Option<f64>,
    /// How it was computed.
    pub method: EvidenceMethod,
    /// The sampled parameters of the law and of the effects, in the model's order, over all answers.
    pub parameters: Vec<RefitParameter>,
    /// The parts of the posterior where a valley in an effect's parameter divides it, the likelier first; empty where there is one answer.
    pub answers: Vec<Answer>,
}

/// How much an evidence may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Care {
    /// From every start of the design, with trajectories that are learnt, and by another method where the first fails: for what is claimed.
    Full,
    /// By fewer draws, and by importance sampling alone: for what stands beside a claim.
    Brief,
}

/// The posterior of a candidate over the sampler's coordinates.
pub struct CandidatePosterior<'a> {
    subject: &'a Subject,
    problem: Problem,
    fixed: BTreeMap<String, f64>,
    care: Care,
}

impl<'a> CandidatePosterior<'a> {
    /// Of a candidate without columns of free amplitude, which have no prior.
    ///
    /// # Errors
    /// [`Error::Input`] for a candidate with such columns, or one that is no model of the experiment.
    pub fn new(subject: &'a Subject, candidate: &Candidate) -> Result<Self> {
        if !candidate.columns.is_empty() {
            return Err(Error::input(
                Place::setting(Setting::Effects),
                "columns of free amplitude have no prior, and so no evidence",
                "ask for the evidence of a law with effects",
            ));
        }
        let mut specification = subject.specification().clone();
        specification.effects.clone_from(&candidate.effects);
        let problem = subject.problem().with_model(specification, subject.library())?;
        let fixed = problem.specification.fixed.clone();
        Ok(Self { subject, problem, fixed, care: Care::Full })
    }

    /// Priors of the sampled parameters.
    pub fn priors(&self) -> &PriorSet {
        &self.problem.priors
    }

    /// The log density: that of the positions that are fitted, outliers left out, times the priors'.
    pub fn density(&self) -> ReducedPosterior<'_> {
        self.density_by(self.subject.compliance())
    }

    /// The same for many draws: a law that is not linear remembers its trajectories.
    fn density_of_draws(&self) -> ReducedPosterior<'_> {
        self.density_by(self.subject.local_compliance())
    }

    fn density_by(&self, compliance: &Compliance) -> ReducedPosterior<'_> {
        let record = &self.subject.experiment().record;
        let parts = PosteriorParts {
            model: &self.problem.model,
            noise: self.problem.noise,
            compliance: compliance.clone(),
            trained: &[],
            priors: &self.problem.priors,
            fixed: &self.fixed,
        };
        let (observed_m, recordings) = (&self.subject.fitted_m, self.problem.recordings());
        ReducedPosterior::new(
            parts,
            FittedRecord { time_s: &record.time_s, force: record.force(), recording: &recordings, observed_m },
        )
    }

    /// Tops of the posterior, and places on ridges beside them, in [`PriorCoordinates`].
    ///
    /// # Errors
    /// [`Error::Numerical`] when a log density is +∞.
    pub fn modes(&self, candidate: &Candidate, fitted: &Fitted) -> Result<Modes> {
        let starts = self.starts(candidate, fitted);
        let density = self.density();
        let seen = PriorCoordinates::new(&density, self.priors().distributions());
        let of_natural = |natural: Vec<f64>| natural.iter().enumerate().map(|(d, x)| seen.of_natural(d, *x)).collect();
        let climbs: Vec<Vec<f64>> = starts.climbs.into_iter().map(of_natural).collect();
        let mut modes = find_modes(&seen, &climbs)?;
        for point in starts.ridges.into_iter().map(of_natural) {
            touching(&seen, &point)?.iter().for_each(|touching| modes.add(touching));
        }
        Ok(modes)
    }

    /// The evidence by importance sampling from the modes.
    ///
    /// # Errors
    /// As [`importance::evidence`].
    pub fn by_importance(&self, modes: &Modes, seed: u64) -> Result<Estimate> {
        let options = match (self.is_slow(), self.care) {
            (true, _) => ImportanceOptions::of_slow_density(),
            (false, Care::Full) => ImportanceOptions::default(),
            (false, Care::Brief) => ImportanceOptions::in_brief(),
        };
        let density = self.density_of_draws();
        let seen = PriorCoordinates::new(&density, self.priors().distributions());
        importance::evidence(&seen, modes, &ImportanceOptions { seed, ..options })
    }

    /// The evidence by sequential Monte Carlo.
    ///
    /// # Errors
    /// As [`tempering::evidence`].
    pub fn by_tempering(&self, modes: &Modes, seed: u64) -> Result<Estimate> {
        let density = self.density_of_draws();
        let seen = PriorCoordinates::new(&density, self.priors().distributions());
        tempering::evidence(&seen, modes, &TemperingOptions { seed, ..TemperingOptions::default() })
    }

    /// Whether every trajectory is computed by itself.
    fn is_slow(&self) -> bool {
        self.problem.model.is_nonlinear()
    }

    fn estimate(&self, candidate: &Candidate, fitted: &Fitted, seed: u64) -> Result<(Estimate, EvidenceMethod)> {
        let modes = self.modes(candidate, fitted)?;
        let weighted = self.by_importance(&modes, seed);
        match weighted {
            Ok(estimate) if importance::is_reliable(&estimate) => Ok((estimate, EvidenceMethod::ImportanceSampling)),
            Ok(_) | Err(Error::Numerical { .. }) if !self.is_slow() && self.care == Care::Full => {
                let mut tempered = self.by_tempering(&modes, seed)?;
                // What replicates do not tell, as a part of the posterior that all of them lose, weights that reach it do.
                if let Ok(weighted) = weighted {
                    let apart = (tempered.ln_evidence - weighted.ln_evidence).abs();
                    tempered.standard_error = tempered.standard_error.max(apart);
                }
                Ok((tempered, EvidenceMethod::SequentialMonteCarlo))
            }
            // Hundreds of thousands of trajectories: too many for what stands beside a claim, and out of a diagnosis's reach where each is computed by itself.
            Ok(_) => Err(Error::numerical(
                format!("the weights of draws from the model with {} cannot be believed", candidate.effects.join(", ")),
                "sample it with `extend`, which takes more draws",
            )),
            Err(other) => Err(other),
        }
    }
}

/// The evidence of a candidate from its fit, for the subject's fitted positions: by importance sampling, or by sequential Monte Carlo where the
/// importance weights cannot be believed.
///
/// # Errors
/// [`Error::Input`] for a candidate with columns of free amplitude, [`Error::Numerical`] when its posterior cannot be sampled.
pub fn evidence(subject: &Subject, candidate: &Candidate, fitted: &Fitted, seed: u64) -> Result<ModelEvidence> {
    evidence_with(subject, candidate, fitted, (Care::Full, seed))
}

/// [`evidence`] with as much care as is asked for.
///
/// # Errors
/// As [`evidence`].
pub(super) fn evidence_with(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    (care, seed): (Care, u64),
) -> Result<ModelEvidence> {
    let posterior = CandidatePosterior { care, ..CandidatePosterior::new(subject, candidate)? };
    let (estimate, method) = posterior.estimate(candidate, fitted, seed)?;
    Ok(evidence_of(&posterior, &estimate, method))
}

/// The same by importance sampling alone; `None` where the weights cannot be believed. For models whose evidence is compared with nothing: no sequential
/// sampler is run for minutes.
///
/// # Errors
/// [`Error::Input`] for a candidate with columns of free amplitude.
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
    let answers = answers(posterior, &seen, &estimate.draws);
    let Estimate { ln_evidence, standard_error, pareto_k, .. } = *estimate;
    ModelEvidence { ln_evidence, standard_error, pareto_k, method, parameters, answers }
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

/// The two sides of the first valley in a parameter of an effect, where there is one.
fn answers(posterior: &CandidatePosterior, seen: &PriorCoordinates, draws: &WeightedDraws) -> Vec<Answer> {
    let n_before = posterior.problem.model.n_before_effects();
    let of_effects = &posterior.problem.model.parameters()[n_before..];
    let priors = posterior.priors().priors().iter().enumerate();
    let mut of_effects = priors.filter(|(_, prior)| of_effects.iter().any(|spec| spec.name == prior.name));
    let Some((d, bottom)) = of_effects.find_map(|(d, _)| Some((d, valley(draws, |point| point[d])?))) else {
        return Vec::new();
    };
    let side = |is_on: &dyn Fn(f64) -> bool| {
        let part = draws.part(|point| is_on(point[d]));
        let probability = draws.mean(|point| f64::from(u8::from(is_on(point[d]))));
        Answer { probability, parameters: parameters_of(posterior, seen, &part) }
    };
    let mut sides = vec![side(&|x| x < bottom), side(&|x| x >= bottom)];
    sides.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    sides
}

fn summary(draws: &WeightedDraws, name: &str, of: impl Fn(&[f64]) -> f64) -> RefitParameter {
    let quantiles = draws.quantiles(&of, &[0.05, 0.95]);
    RefitParameter { name: name.into(), mean: draws.mean(&of), q05: quantiles[0], q95: quantiles[1] }
}

//! The evidence of a candidate: how probable the fitted positions are under all of its parameters that the priors allow.
//!
//! Every parameter has its proper prior, those of the effects and of the noise included (the default ones, or the prior file's), and parameters that
//! two candidates share have the same: so differences are logarithms of Bayes factors. The priors of the law and of the noise are those of
//! `sample`, not the looser ones of [`Subject::fit`], which has to find an optimum and nothing more.
//!
//! A posterior may give two answers: a little of an effect with one modulus, and much of it with another. Climbs therefore start from a fixed design in the
//! effects' own parameters, with the law and the noise fitted anew at each point of it, and the proposal covers every mode that they end in; the draws'
//! weights then give each the share that its evidence has.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::diagnosis::{Answer, RefitParameter};
use super::{Candidate, Fitted, Free, Search, Subject};
use crate::error::{Error, Place, Result};
use crate::inference::evidence::importance::{self, ImportanceOptions};
use crate::inference::evidence::tempering::{self, TemperingOptions};
use crate::inference::evidence::{Estimate, PriorCoordinates, SavageDickey, WeightedDraws, savage_dickey, valley};
use crate::inference::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use crate::inference::optimum::find_modes;
use crate::inference::prior::{Prior, PriorSet};
use crate::model::Compliance;
use crate::workflow::problem::Problem;

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
pub struct Evidence {
    /// Log probability density of the fitted positions, in nats for positions in m.
    pub ln_evidence: f64,
    /// Its standard error.
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
    /// From few starts where trajectories are slow, by few draws there, and by importance sampling alone: for what stands beside a claim.
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
                Place::option("--with"),
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
        match self.care {
            Care::Full => self.density_by(self.subject.local_compliance()),
            Care::Brief => self.density(),
        }
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
        let observed_m = &self.subject.fitted_m;
        ReducedPosterior::new(
            parts,
            FittedRecord { time_s: &record.time_s, force_n: &record.force_n, cycle: &record.cycle, observed_m },
        )
    }

    /// Natural values at which climbs and walkers start: the fit, next to it, and the tops that fits come to from elsewhere in the priors of the effects'
    /// parameters, with the law fitted anew.
    pub fn starts(&self, candidate: &Candidate, fitted: &Fitted) -> Vec<Vec<f64>> {
        let at_fit = (&fitted.theta[..], &fitted.noise);
        let tops = self.other_tops(candidate, fitted);
        let of_tops = tops.iter().map(|top| self.start(candidate, (&top.theta, &top.noise), FARTHEST_TAIL));
        let of_fit = [FARTHEST_TAIL, START_QUANTILE].map(|tail| self.start(candidate, at_fit, tail));
        of_fit.into_iter().chain(of_tops).collect()
    }

    /// A point of a fit as a start: no nearer than a tail of the prior to an end of the support.
    fn start(&self, candidate: &Candidate, (theta, noise): (&[f64], &[f64; 5]), tail: f64) -> Vec<f64> {
        let mut natural = candidate.parameters(theta);
        natural.extend(noise);
        let names: Vec<&str> = self.problem.parameters().iter().map(|spec| spec.name).collect();
        let value = |name: &str| names.iter().position(|known| *known == name).map_or(f64::NAN, |place| natural[place]);
        self.priors().priors().iter().map(|prior| moved_inside(prior, value(&prior.name), tail)).collect()
    }

    /// Tops of the fit's objective, but the best, that are within reach of it: from a design in the effects' parameters, law and noise fitted at each of
    /// its points before those parameters are let go.
    fn other_tops(&self, candidate: &Candidate, fitted: &Fitted) -> Vec<Fitted> {
        let is_of_effect = |free: &Free| free.effect.is_some();
        if !candidate.free.iter().any(is_of_effect) {
            return Vec::new();
        }
        let of_law: Vec<f64> =
            candidate.free.iter().zip(&fitted.theta).filter(|(free, _)| !is_of_effect(free)).map(|(_, x)| *x).collect();
        // With the effects' parameters held.
        let on_profile = |number: u32| -> Option<Fitted> {
            let mut dimension = 0;
            let coordinate = |(free, at_fit): (&Free, &f64)| {
                if !is_of_effect(free) {
                    return *at_fit;
                }
                let p = 0.02 + 0.96 * f64::from(sobol_burley::sample(number, dimension, START_SEED));
                dimension += 1;
                free.quantile(p)
            };
            let mut theta: Vec<f64> = candidate.free.iter().zip(&fitted.theta).map(coordinate).collect();
            let held = candidate.held(&theta, is_of_effect);
            let with_law = self.subject.fit(&held, &[(of_law.clone(), fitted.noise)], Search::Local).ok()?;
            let mut law = with_law.theta.iter();
            for (free, theta) in candidate.free.iter().zip(&mut theta).filter(|(free, _)| !is_of_effect(free)) {
                *theta = law.next().copied().unwrap_or(free.clamped(*theta));
            }
            Some(Fitted { theta, ..with_law })
        };
        let n_starts = if self.is_slow() && self.care == Care::Brief { BRIEF_STARTS } else { EFFECT_STARTS };
        let mut profile: Vec<Fitted> = (0..n_starts).into_par_iter().filter_map(on_profile).collect();
        let of_effects: Vec<usize> = (0..candidate.free.len()).filter(|k| is_of_effect(&candidate.free[*k])).collect();
        if let (true, [only]) = (self.is_slow(), &of_effects[..]) {
            profile = near_local_tops(profile, |point| point.theta[*only]);
        }
        let top = |start: Fitted| self.subject.fit(candidate, &[(start.theta, start.noise)], Search::Local).ok();
        let mut tops: Vec<Fitted> = profile.into_par_iter().filter_map(top).collect();
        tops.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        let best = tops.first().map_or(fitted.objective, |top| top.objective.max(fitted.objective));
        let mut distinct: Vec<Fitted> = Vec::new();
        for top in tops.into_iter().filter(|top| top.objective > best - TOP_REACH_NATS) {
            let is_same = |other: &Fitted| {
                other.theta.iter().zip(&top.theta).all(|(a, b)| (a - b).abs() < SAME_TOP)
                    && (other.objective - top.objective).abs() < SAME_TOP_NATS
            };
            if !is_same(fitted) && !distinct.iter().any(is_same) {
                distinct.push(top);
            }
        }
        distinct.truncate(MOST_TOPS);
        distinct
    }

    fn by_importance(&self, starts: Vec<Vec<f64>>, seed: u64) -> Result<Estimate> {
        let density = self.density();
        let seen = PriorCoordinates::new(&density, self.priors());
        let of_natural = |natural: Vec<f64>| natural.iter().enumerate().map(|(d, x)| seen.of_natural(d, *x)).collect();
        let starts: Vec<Vec<f64>> = starts.into_iter().map(of_natural).collect();
        let modes = find_modes(&seen, &starts)?;
        let options = match (self.is_slow(), self.care) {
            (true, Care::Full) => ImportanceOptions::of_slow_density(),
            (true, Care::Brief) => ImportanceOptions::of_slow_density_in_brief(),
            (false, _) => ImportanceOptions::default(),
        };
        let density = self.density_of_draws();
        let seen = PriorCoordinates::new(&density, self.priors());
        importance::evidence(&seen, &modes, &ImportanceOptions { seed, ..options })
    }

    fn by_tempering(&self, seed: u64) -> Result<Estimate> {
        let density = self.density_of_draws();
        let seen = PriorCoordinates::new(&density, self.priors());
        tempering::evidence(&seen, &TemperingOptions { seed, ..TemperingOptions::default() })
    }

    /// Whether every trajectory is computed by itself.
    fn is_slow(&self) -> bool {
        self.problem.model.is_nonlinear()
    }

    fn estimate(&self, candidate: &Candidate, fitted: &Fitted, seed: u64) -> Result<(Estimate, EvidenceMethod)> {
        match self.by_importance(self.starts(candidate, fitted), seed) {
            Ok(estimate) if importance::is_reliable(&estimate) => Ok((estimate, EvidenceMethod::ImportanceSampling)),
            Ok(_) | Err(Error::Numerical { .. }) if !self.is_slow() && self.care == Care::Full => {
                Ok((self.by_tempering(seed)?, EvidenceMethod::SequentialMonteCarlo))
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

/// Quantile of the prior at which a climb starts where the fit is at an end of the support.
const START_QUANTILE: f64 = 0.05;
/// Tail of a prior within which a fit is at an end of the support.
const FARTHEST_TAIL: f64 = 1e-6;
/// Points of the design in the effects' parameters, at Sobol points of their priors, and the seed of those: the design is part of the method.
const EFFECT_STARTS: u32 = 12;
const BRIEF_STARTS: u32 = 4;
const START_SEED: u32 = 11;
/// Tops so far (nats) below the best weigh nothing, whatever their widths.
const TOP_REACH_NATS: f64 = 20.0;
/// Tops that are as near as this, in units of the priors' spreads and in nats, are one.
const SAME_TOP: f64 = 0.03;
const SAME_TOP_NATS: f64 = 0.1;
const MOST_TOPS: usize = 6;

/// Of points of a profile along one coordinate, those that stand no lower than both of their neighbours, and these neighbours: from the others climbs lead where
/// they lead from these.
fn near_local_tops(mut profile: Vec<Fitted>, coordinate: impl Fn(&Fitted) -> f64) -> Vec<Fitted> {
    profile.sort_by(|a, b| coordinate(a).total_cmp(&coordinate(b)));
    let height = |place: usize| profile[place].objective;
    let n = profile.len();
    let is_top = |place: usize| {
        (place == 0 || height(place - 1) <= height(place)) && (place + 1 == n || height(place + 1) <= height(place))
    };
    let is_near: Vec<bool> =
        (0..n).map(|place| (place.saturating_sub(1)..=(place + 1).min(n - 1)).any(is_top)).collect();
    profile.into_iter().zip(is_near).filter_map(|(point, is_near)| is_near.then_some(point)).collect()
}

/// A value, or one well inside the prior where it lies in a tail of less than `tail`: fits end at supports, where gradients vanish.
fn moved_inside(prior: &Prior, value: f64, tail: f64) -> f64 {
    let below = prior.distribution.cdf(value);
    if below < tail {
        prior.distribution.quantile(START_QUANTILE)
    } else if below > 1.0 - tail {
        prior.distribution.quantile(1.0 - START_QUANTILE)
    } else {
        value
    }
}

/// The evidence of a candidate from its fit, for the subject's fitted positions: by importance sampling, or by sequential Monte Carlo where the
/// importance weights cannot be believed.
///
/// # Errors
/// [`Error::Input`] for a candidate with columns of free amplitude, [`Error::Numerical`] when its posterior cannot be sampled.
pub fn evidence(subject: &Subject, candidate: &Candidate, fitted: &Fitted, seed: u64) -> Result<Evidence> {
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
) -> Result<Evidence> {
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
) -> Result<Option<Evidence>> {
    let posterior = CandidatePosterior::new(subject, candidate)?;
    match posterior.by_importance(posterior.starts(candidate, fitted), seed) {
        Ok(estimate) if importance::is_reliable(&estimate) => {
            Ok(Some(evidence_of(&posterior, &estimate, EvidenceMethod::ImportanceSampling)))
        }
        Ok(_) | Err(Error::Numerical { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// [`evidence`] by a method of the caller's choice.
///
/// # Errors
/// As [`evidence`].
pub fn evidence_by(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    seed: u64,
    method: EvidenceMethod,
) -> Result<Evidence> {
    let posterior = CandidatePosterior::new(subject, candidate)?;
    let estimate = match method {
        EvidenceMethod::ImportanceSampling => posterior.by_importance(posterior.starts(candidate, fitted), seed)?,
        EvidenceMethod::SequentialMonteCarlo => posterior.by_tempering(seed)?,
    };
    Ok(evidence_of(&posterior, &estimate, method))
}

/// ln of the Bayes factor of a candidate over the subject's base by the posterior density at the null of the one effect that the base does not
/// have.
///
/// # Errors
/// As [`evidence`].
pub fn bayes_factor_at_null(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    seed: u64,
) -> Result<SavageDickey> {
    let base = subject.base();
    let added: Vec<&Free> =
        candidate.free.iter().filter(|free| base.free.iter().all(|known| known.name != free.name)).collect();
    let refuse = |reason: String| Ok(SavageDickey::NotApplicable(reason));
    let (only, null) = match added[..] {
        [only] => match only.null {
            Some(null) => (only, only.coordinate.value(null)),
            None => return refuse(format!("{} has no null", only.name)),
        },
        [] => return refuse("the base has all of its parameters".into()),
        _ => {
            let unidentified: Vec<&str> =
                added.iter().filter(|free| free.is_unidentified_at_null()).map(|free| free.name).collect();
            return refuse(if unidentified.is_empty() {
                "more than one parameter is added to the base".into()
            } else {
                format!(
                    "{} means nothing at the null, where the density is then one of many widths that draws do not resolve",
                    unidentified.join(", ")
                )
            });
        }
    };
    let posterior = CandidatePosterior::new(subject, candidate)?;
    let (estimate, _) = posterior.estimate(candidate, fitted, seed)?;
    let place = posterior.priors().names().position(|name| name == only.name);
    let Some((place, prior)) = place.and_then(|place| Some((place, posterior.priors().priors().get(place)?))) else {
        return refuse(format!("{} is fixed", only.name));
    };
    let density = posterior.density();
    let seen = PriorCoordinates::new(&density, posterior.priors());
    let value = |point: &[f64]| seen.natural(place, point[place]);
    Ok(savage_dickey(&estimate.draws, value, null, &prior.distribution))
}

fn evidence_of(posterior: &CandidatePosterior, estimate: &Estimate, method: EvidenceMethod) -> Evidence {
    let density = posterior.density();
    let seen = PriorCoordinates::new(&density, posterior.priors());
    let parameters = parameters_of(posterior, &seen, &estimate.draws);
    let answers = answers(posterior, &seen, &estimate.draws);
    let Estimate { ln_evidence, standard_error, pareto_k, .. } = *estimate;
    Evidence { ln_evidence, standard_error, pareto_k, method, parameters, answers }
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
    let n_law = posterior.problem.model.base().parameters().len();
    let of_effects = &posterior.problem.model.parameters()[n_law..];
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn climbs_start_at_the_tops_of_a_profile_and_beside_them() {
        let kept = |heights: &[f64]| -> Vec<f64> {
            let point = |(place, objective): (usize, &f64)| Fitted {
                theta: vec![place as f64],
                noise: [1.0; 5],
                position_m: Vec::new(),
                objective: *objective,
                ln_likelihood: *objective,
            };
            // In any order.
            let profile: Vec<Fitted> = heights.iter().enumerate().map(point).rev().collect();
            near_local_tops(profile, |point| point.theta[0]).iter().map(|point| point.theta[0]).collect()
        };
        assert_eq!(kept(&[0.0, 1.0, 2.0, 5.0, 3.0, 2.0, 1.0]), [2.0, 3.0, 4.0]);
        assert_eq!(kept(&[9.0, 1.0, 0.0, 0.5, 0.0, -1.0, -2.0, 4.0]), [0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0]);
        assert_eq!(kept(&[1.0]), [0.0]);
        assert!(kept(&[]).is_empty());
    }
}

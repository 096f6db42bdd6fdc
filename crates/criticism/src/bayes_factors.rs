//! Bayes factors of effects over the base model: values for the leading effects, upper bounds for all other effects.
//!
//! The evidence of one model takes tens of thousands of trajectories. So it is computed only for the claimed effects (or else the leading effect) and for effects whose
//! Bayes factor may come near theirs. The gain of every other effect bounds its Bayes factor. Evidence is the mean of the likelihood over the prior. The log Bayes factor
//! is therefore at most the gain of the best fit plus the possible widening of the posterior of law and noise.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::Subject;
use super::evidence::{EvidenceBudget, ModelEvidence, evidence, evidence_with, posterior_by_importance};
use super::predicted::laplace;
use super::refit::Refitted;
use super::request::DiagnosisRequest;
use super::search::{SearchResult, Single};
use base::error::{Error, Result};
use documents::diagnosis::{PosteriorMode, RefitParameter};
use figures::number::format_significant;
use posterior::monitor::{Counter, Monitor};

/// Margin (nats) below the best log Bayes factor: no evidence is computed for an effect whose upper bound lies lower.
const REACH_NATS: f64 = 10.0;
/// Largest increase (nats) of a log Bayes factor because an effect widens the posterior of law and noise. The upper bound of the log Bayes factor is the gain plus this value.
const WIDENING_NATS: f64 = 5.0;

/// Logarithm (nats) of an effect's Bayes factor over the base model, or an upper bound of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum BayesFactor {
    /// Computed value.
    Known(f64),
    /// Upper bound, if the evidence was not computed.
    AtMost(f64),
    /// Neither value nor bound is known.
    Unknown,
}

/// Parameter estimates of a model, over all modes of its posterior; also for each mode if there are several.
#[derive(Debug, Clone, Default)]
pub(super) struct Parameters {
    pub all: Vec<RefitParameter>,
    pub modes: Vec<PosteriorMode>,
}

impl From<ModelEvidence> for Parameters {
    fn from(evidence: ModelEvidence) -> Self {
        Self { all: evidence.parameters, modes: evidence.modes }
    }
}

/// Log evidences of the base model and of the leading effects, with bounds for other effects.
pub(super) struct EvidenceSet {
    ln_base: f64,
    singles: BTreeMap<&'static str, ModelEvidence>,
    /// Upper bounds (nats) of the log Bayes factor, by slug, for effects whose evidence was not computed.
    bounds: BTreeMap<&'static str, f64>,
    /// Parameters of the model with all claimed effects, if several are claimed; else `None`.
    of_claim: Option<Parameters>,
    /// Remarks for the reader of the diagnosis.
    pub remarks: Vec<String>,
}

/// Outcome of computing an effect's evidence.
enum EvidenceOutcome {
    By(Result<ModelEvidence>),
    /// Not computed: the effect's gain bounds its Bayes factor far below the best one.
    Far,
    /// Not computed: the effect makes the model nonlinear, and its evidence would take too long. The effect is neither claimed nor leading.
    Slow,
}

impl EvidenceSet {
    /// Computes the evidence of the claimed effects. If the request is in full, also computes that of every effect whose Bayes factor may come near the best one.
    pub fn new(
        subject: &Subject,
        request: &DiagnosisRequest,
        (found, claim): (&SearchResult, Option<&Refitted>),
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let seed = request.seed;
        let mut evidence_set = Self {
            ln_base: f64::NAN,
            singles: BTreeMap::new(),
            bounds: BTreeMap::new(),
            of_claim: None,
            remarks: Vec::new(),
        };
        let claimed = claim.map_or(Vec::new(), |claim| found.added(claim));
        let gain = |single: &Single| single.gain.map_or(f64::NEG_INFINITY, |gain| gain.fitted);
        let at_most = |single: &Single| gain(single) + WIDENING_NATS;
        let mut worth: Vec<&Single> = found
            .singles
            .iter()
            .filter(|single| {
                claimed.contains(&single.slug) || (request.in_full && gain(single) > request.criteria.least_gain_nats)
            })
            .collect();
        // The claimed effects come first, then effects by gain: the best known evidence decides which others are worth computing.
        worth.sort_by(|a, b| {
            let is_claimed = |single: &Single| claimed.contains(&single.slug);
            is_claimed(b).cmp(&is_claimed(a)).then(gain(b).total_cmp(&gain(a)))
        });
        // Most experiments without a missing effect need no evidence at all.
        if !worth.is_empty() {
            evidence_set.ln_base = evidence(subject, &found.base.candidate, &found.base.fitted, seed)?.ln_evidence;
        }
        let counter = Counter::new(monitor, worth.len());
        // The claim, or else the leading effect, is computed first. The result decides which other evidences are computed, in parallel.
        let n_leading = claimed.len().max(1).min(worth.len());
        let (leading, others) = worth.split_at(n_leading);
        let mut best = f64::NEG_INFINITY;
        let (mut far, mut slow, mut failed): (Vec<&str>, Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new(), Vec::new());
        for (part, care) in [(leading, EvidenceBudget::Full), (others, EvidenceBudget::Brief)] {
            let weigh = |single: &&Single| {
                counter.add_one();
                let Refitted { candidate, fitted, .. } = single.refitted.as_ref()?;
                let weighed = if !claimed.contains(&single.slug) && at_most(single) < best - REACH_NATS {
                    EvidenceOutcome::Far
                } else if care == EvidenceBudget::Brief && candidate.model.is_nonlinear() {
                    EvidenceOutcome::Slow
                } else {
                    EvidenceOutcome::By(evidence_with(subject, candidate, fitted, (care, seed)))
                };
                Some(weighed)
            };
            let weighed: Vec<Option<EvidenceOutcome>> = part.par_iter().map(weigh).collect();
            for (single, weighed) in part.iter().zip(weighed) {
                match weighed {
                    None => continue,
                    Some(EvidenceOutcome::By(Ok(found))) => {
                        best = best.max(found.ln_evidence - evidence_set.ln_base);
                        evidence_set.singles.insert(single.slug, found);
                        continue;
                    }
                    Some(EvidenceOutcome::By(Err(Error::Numerical { .. }))) => failed.push(single.slug),
                    Some(EvidenceOutcome::By(Err(other))) => return Err(other),
                    Some(EvidenceOutcome::Far) => far.push(single.slug),
                    Some(EvidenceOutcome::Slow) => slow.push(single.slug),
                }
                evidence_set.bounds.insert(single.slug, at_most(single));
            }
        }
        let remarks = [
            (far, "the Bayes factors of ", format!(" are not computed: their gains put them more than {REACH_NATS:.0} nats below the best")),
            (slow, "the Bayes factors of ", " are not computed, because nonlinear laws take long: the document gives upper bounds, and intervals by a normal approximation around the fit".into()),
            (failed, "the evidence of ", " could not be computed: the document gives upper bounds of their Bayes factors, and intervals by a normal approximation around the fit".into()),
        ];
        let remarks = remarks.into_iter().filter(|(slugs, ..)| !slugs.is_empty());
        evidence_set.remarks.extend(remarks.map(|(slugs, start, end)| format!("{start}{}{end}", slugs.join(", "))));
        if let [slug] = claimed[..]
            && let BayesFactor::Known(factor) = evidence_set.factor(slug)
            && factor < 0.0
        {
            let factor = format_significant(factor.exp(), 2);
            evidence_set.remarks.push(format!("the evidence is against {slug}: its Bayes factor over the model without it is {factor}. Its fitted size is one that the prior holds unlikely, or the gain is chance: repeat the experiment before you rely on the claim"));
        }
        if let Some(claim) = claim.filter(|_| claimed.len() > 1) {
            evidence_set.of_claim = Some(evidence_set.of_larger_claim(subject, claim, seed)?);
        }
        Ok(evidence_set)
    }

    fn of_larger_claim(&mut self, subject: &Subject, claimed: &Refitted, seed: u64) -> Result<Parameters> {
        if let Some(found) = posterior_by_importance(subject, &claimed.candidate, &claimed.fitted, seed)? {
            return Ok(found.into());
        }
        self.remarks.push(
            "the evidence of the claim could not be computed: its intervals are normal approximations around the fit and cover one mode only"
                .into(),
        );
        Ok(Parameters { all: laplace(subject, claimed)?, modes: Vec::new() })
    }

    /// Returns the Bayes factor of an effect over the base, or its bound.
    pub fn factor(&self, slug: &str) -> BayesFactor {
        let known = self.singles.get(slug).map(|found| BayesFactor::Known(found.ln_evidence - self.ln_base));
        known.or_else(|| self.bounds.get(slug).copied().map(BayesFactor::AtMost)).unwrap_or(BayesFactor::Unknown)
    }

    /// Returns the parameters of the model with an effect. If several effects are claimed, the model of a claimed effect has all of them. If the evidence was not
    /// computed, the parameters come from a normal approximation around the fit.
    pub fn parameters(&self, subject: &Subject, single: &Single, is_claimed: bool) -> Result<Parameters> {
        match (&self.of_claim, self.singles.get(single.slug), &single.refitted) {
            (Some(of_claim), ..) if is_claimed => Ok(of_claim.clone()),
            (_, Some(found), _) => Ok(found.clone().into()),
            (_, None, Some(refitted)) => Ok(Parameters { all: laplace(subject, refitted)?, modes: Vec::new() }),
            (_, None, None) => Ok(Parameters::default()),
        }
    }
}

impl Parameters {
    /// Keeps only the parameters of the effects with these slugs.
    pub fn of(self, effects: &[&str]) -> Self {
        let is_own = |parameter: &RefitParameter| {
            let of = |slug: &&str| parameter.name.strip_prefix(*slug).is_some_and(|rest| rest.starts_with('.'));
            effects.iter().any(of)
        };
        let of_term = |list: Vec<RefitParameter>| list.into_iter().filter(is_own).collect();
        let answer = |answer: PosteriorMode| PosteriorMode { parameters: of_term(answer.parameters), ..answer };
        Self { all: of_term(self.all), modes: self.modes.into_iter().map(answer).collect() }
    }
}

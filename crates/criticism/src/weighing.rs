//! Which effects' evidence is computed, and what is known of the others'.
//!
//! An evidence takes tens of thousands of trajectories, so it is computed where it can matter: for the claim, or the leading effect where nothing is claimed,
//! and for what may come near that one. What an effect gains bounds its Bayes factor: the evidence is the mean of the likelihood over the prior, so that
//! ln B is at most the gain of the best fit and what the posterior of law and noise may widen by.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::Subject;
use super::evidence::{Care, ModelEvidence, evidence, evidence_with, posterior_by_importance};
use super::predicted::laplace;
use super::refit::Refitted;
use super::request::DiagnosisRequest;
use super::search::{SearchResult, Single};
use base::error::{Error, Result};
use documents::diagnosis::{Answer, RefitParameter};
use posterior::monitor::{Counter, Monitor};

/// An effect whose Bayes factor stays further (nats) below the best is as good as none.
const REACH_NATS: f64 = 10.0;
/// What the posterior of law and noise may widen by beside an effect, in nats: ln B stays below the gain and this.
const WIDENING_NATS: f64 = 5.0;

/// What is known of an effect's Bayes factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Factor {
    /// Its logarithm, computed.
    Known(f64),
    /// It stays below this, far below the best.
    AtMost(f64),
    /// Neither.
    Unknown,
}

/// Parameters of a model over all answers, and answer by answer where there are several.
#[derive(Debug, Clone, Default)]
pub(super) struct Parameters {
    pub all: Vec<RefitParameter>,
    pub answers: Vec<Answer>,
}

impl From<ModelEvidence> for Parameters {
    fn from(evidence: ModelEvidence) -> Self {
        Self { all: evidence.parameters, answers: evidence.answers }
    }
}

/// The evidences that were computed.
pub(super) struct Weighing {
    ln_base: f64,
    singles: BTreeMap<&'static str, ModelEvidence>,
    /// What effects whose evidence was not computed for that reason stay below.
    bounds: BTreeMap<&'static str, f64>,
    /// Parameters of a claim of several effects, which all of them share; none for other claims.
    of_claim: Option<Parameters>,
    /// What a reader should know.
    pub remarks: Vec<String>,
}

/// What became of an effect that was worth weighing.
enum Weighed {
    By(Result<ModelEvidence>),
    /// Its gain leaves it out of reach of the best.
    Far,
    /// A law that is not linear beside a claim.
    Slow,
}

impl Weighing {
    /// Weighs a claim, and, where the request is in full, all that may come near it.
    pub fn new(
        subject: &Subject,
        request: &DiagnosisRequest,
        (found, claim): (&SearchResult, Option<&Refitted>),
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let seed = request.seed;
        let mut own = Self {
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
        // The claim first, then by gain: the best that is known bounds the reach.
        worth.sort_by(|a, b| {
            let is_claimed = |single: &Single| claimed.contains(&single.slug);
            is_claimed(b).cmp(&is_claimed(a)).then(gain(b).total_cmp(&gain(a)))
        });
        // Nothing is weighed in most experiments that lack nothing.
        if !worth.is_empty() {
            own.ln_base = evidence(subject, &found.base.candidate, &found.base.fitted, seed)?.ln_evidence;
        }
        let counter = Counter::new(monitor, worth.len());
        // What is claimed, or leads where nothing is, bounds what is within reach; the rest is weighed side by side.
        let n_leading = claimed.len().max(1).min(worth.len());
        let (leading, others) = worth.split_at(n_leading);
        let mut best = f64::NEG_INFINITY;
        let (mut far, mut slow, mut failed): (Vec<&str>, Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new(), Vec::new());
        for (part, care) in [(leading, Care::Full), (others, Care::Brief)] {
            let weigh = |single: &&Single| {
                counter.add_one();
                let Refitted { candidate, fitted, .. } = single.refitted.as_ref()?;
                let weighed = if !claimed.contains(&single.slug) && at_most(single) < best - REACH_NATS {
                    Weighed::Far
                } else if care == Care::Brief && candidate.model.is_nonlinear() {
                    Weighed::Slow
                } else {
                    Weighed::By(evidence_with(subject, candidate, fitted, (care, seed)))
                };
                Some(weighed)
            };
            let weighed: Vec<Option<Weighed>> = part.par_iter().map(weigh).collect();
            for (single, weighed) in part.iter().zip(weighed) {
                match weighed {
                    None => continue,
                    Some(Weighed::By(Ok(found))) => {
                        best = best.max(found.ln_evidence - own.ln_base);
                        own.singles.insert(single.slug, found);
                        continue;
                    }
                    Some(Weighed::By(Err(Error::Numerical { .. }))) => failed.push(single.slug),
                    Some(Weighed::By(Err(other))) => return Err(other),
                    Some(Weighed::Far) => far.push(single.slug),
                    Some(Weighed::Slow) => slow.push(single.slug),
                }
                own.bounds.insert(single.slug, at_most(single));
            }
        }
        own.remarks.extend((!far.is_empty()).then(|| {
            format!(
                "the Bayes factors of {} are not computed: what these gain leaves them more than {REACH_NATS:.0} nats below the best",
                far.join(", ")
            )
        }));
        own.remarks.extend((!slow.is_empty()).then(|| {
            format!(
                "the Bayes factors of {} are not computed beside another effect's, since such a law takes long: there are bounds, and intervals by a normal approximation about the fit",
                slow.join(", ")
            )
        }));
        own.remarks.extend((!failed.is_empty()).then(|| {
            format!(
                "the posteriors of {} could not be weighed in reasonable time: of their Bayes factors there are bounds, and their intervals are those of a normal approximation about the fit",
                failed.join(", ")
            )
        }));
        if let Some(claim) = claim.filter(|_| claimed.len() > 1) {
            own.of_claim = Some(own.of_larger_claim(subject, claim, seed)?);
        }
        Ok(own)
    }

    fn of_larger_claim(&mut self, subject: &Subject, claimed: &Refitted, seed: u64) -> Result<Parameters> {
        if let Some(found) = posterior_by_importance(subject, &claimed.candidate, &claimed.fitted, seed)? {
            return Ok(found.into());
        }
        self.remarks.push(
            "the posterior of what is claimed could not be weighed: its intervals are those of a normal approximation about the fit, which knows of one answer only"
                .into(),
        );
        Ok(Parameters { all: laplace(subject, claimed)?, answers: Vec::new() })
    }

    /// What is known of an effect's Bayes factor over the base.
    pub fn factor(&self, slug: &str) -> Factor {
        let known = self.singles.get(slug).map(|found| Factor::Known(found.ln_evidence - self.ln_base));
        known.or_else(|| self.bounds.get(slug).copied().map(Factor::AtMost)).unwrap_or(Factor::Unknown)
    }

    /// Parameters of an effect: of a claim of several those of the whole model, else of the effect alone, by the normal approximation about its fit where
    /// its evidence was not computed.
    pub fn parameters(&self, subject: &Subject, single: &Single, is_claimed: bool) -> Result<Parameters> {
        match (&self.of_claim, self.singles.get(single.slug), &single.refitted) {
            (Some(of_claim), ..) if is_claimed => Ok(of_claim.clone()),
            (_, Some(found), _) => Ok(found.clone().into()),
            (_, None, Some(refitted)) => Ok(Parameters { all: laplace(subject, refitted)?, answers: Vec::new() }),
            (_, None, None) => Ok(Parameters::default()),
        }
    }
}

impl Parameters {
    /// Those of some effects alone.
    pub fn of(self, effects: &[&str]) -> Self {
        let is_own = |parameter: &RefitParameter| {
            let of = |slug: &&str| parameter.name.strip_prefix(*slug).is_some_and(|rest| rest.starts_with('.'));
            effects.iter().any(of)
        };
        let own = |list: Vec<RefitParameter>| list.into_iter().filter(is_own).collect();
        let answer = |answer: Answer| Answer { parameters: own(answer.parameters), ..answer };
        Self { all: own(self.all), answers: self.answers.into_iter().map(answer).collect() }
    }
}

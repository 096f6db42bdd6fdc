//! The verdict: a pure function of the evidence of a search and of [`Criteria`].
//!
//! The caller fills in the evidence in a fixed order:
//! 1. the additions that the search proposes;
//! 2. the residual test of the accepted model, and of the next one if it fails ([`Evidence::next_test`]);
//! 3. the residual of the leading effect alone, if structure of the law replaces it ([`Evidence::is_replaced_by_law`]);
//! 4. the rivals of a claim ([`Evidence::claim`]).
//!
//! A record, a sweep and a cohort fill in the evidence that they have. This module makes no fits and no simulations.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::criteria::Criteria;
use super::refit::Gain;
use documents::diagnosis::{self, Status, VerdictKind};
use posterior::misfit::Misfit;

/// Effects added to a model, with their gains and p from the search.
#[derive(Debug, Clone, PartialEq)]
pub struct Addition {
    /// Slugs of all effects beyond the base.
    pub effects: Vec<String>,
    /// Gain over the model of the previous round.
    pub gain: Gain,
    /// Gain over the base.
    pub over_base: Gain,
    /// p of `gain`, corrected for the search of its round.
    pub p: f64,
    /// Round of the search, from 0.
    pub round: usize,
}

impl Addition {
    /// One effect added to the base.
    pub fn single(effect: &str, gain: Gain, p: f64) -> Self {
        Self { effects: vec![effect.into()], gain, over_base: gain, p, round: 0 }
    }

    /// One effect of a sweep or a cohort, from its gains on fitted data, on future cycles and on the last held-out data.
    pub fn of_gains(effect: &str, fitted: f64, [future, last]: [Option<f64>; 2], p: f64) -> Self {
        Self::single(effect, Gain { fitted, future, last, largest_change: f64::INFINITY, rank: fitted }, p)
    }
}

/// Structure outside the library in a residual.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Gain (nats) of the refit with the structure, less the gain of the structure's family by chance.
    pub gain_nats: f64,
    /// p corrected for all families of structure.
    pub p_familywise: f64,
    /// True if the structure may belong to a law, unlike a slip or a vibration.
    pub is_of_law: bool,
    /// Slugs of library effects with nearly the same shape, and the cosine of each.
    pub twins: Vec<(String, f64)>,
}

/// Residual of a model compared with the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Residual {
    /// Residual of one record.
    Record {
        /// Size of the residual, and the part that recurs in every cycle.
        misfit: Misfit,
        /// Number of held-out positions, or of fitted ones if no cycle is held out.
        n_positions: usize,
        /// Error on the last held-out cycle, divided by the predictive noise. It is known for a claim, and for a base whose fitted recordings cannot show slow noise or a different
        /// gain of each recording. `None` for any other base, and if no cycle is held out.
        over_predicted: Option<f64>,
    },
    /// Probability that noise causes at least this large a residual of a sweep; NaN if the model cannot be evaluated.
    Sweep(f64),
    /// Number of a cohort's records whose residual exceeds the noise.
    Cohort(usize),
    /// Error of a cohort's claim on all held-out cycles, divided by its predictive noise; `None` if no cycle is held out.
    CohortClaim(Option<f64>),
}

impl Residual {
    /// Returns whether the residual exceeds the noise.
    pub fn exceeds_noise(&self, criteria: &Criteria) -> bool {
        match self {
            Self::Record { misfit, over_predicted, .. } => {
                misfit.is_too_large() || over_predicted.is_some_and(|factor| factor > criteria.claim_factor)
            }
            Self::Sweep(p) => p.is_nan() || *p < criteria.least_noise_p,
            Self::Cohort(n_records) => *n_records > 0,
            Self::CohortClaim(factor) => factor.is_some_and(|factor| factor > criteria.claim_factor),
        }
    }

    /// Returns whether the residual exceeds white noise of the known size, but may come from slow noise.
    fn is_doubtful(&self, criteria: &Criteria) -> bool {
        let Self::Record { misfit, n_positions, .. } = self else { return false };
        let (factor, n) = (misfit.heldout.unwrap_or(misfit.fitted).rms_m / misfit.noise_m, *n_positions as f64);
        let by_chance = ChiSquared::new(n).map_or(1.0, |chi| chi.sf(n * factor * factor));
        misfit.is_known && factor > criteria.doubtful_factor && by_chance < criteria.doubtful_p
    }
}

/// Result of testing the residual of a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResidualTest {
    /// Confirmed structure outside the library, the leading one first.
    pub structure: Vec<Structure>,
    /// True if the structure is in the base's residual and explains more than the model's effects.
    pub replaces_effects: bool,
    /// Residual of the model, or of the base if the structure replaces its effects; `None` if the search does not test it.
    pub residual: Option<Residual>,
}

/// A model that the search proposes.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimProposal {
    /// Effects and gains of the model.
    pub addition: Addition,
    /// Residual test of the model; `None` until it is made.
    pub test: Option<ResidualTest>,
    /// Residual of the base with the leading effect alone; computed if structure that may belong to the law replaces every proposal.
    pub alone: Option<Residual>,
}

impl From<Addition> for ClaimProposal {
    fn from(addition: Addition) -> Self {
        Self { addition, test: None, alone: None }
    }
}

/// An effect that may replace an effect of the claim.
#[derive(Debug, Clone, PartialEq)]
pub struct Rival {
    /// Slug of the effect.
    pub effect: String,
    /// Rank of the claim less rank of the rival, in nats.
    pub deficit_nats: f64,
    /// Distance (σ) between the models of claim and rival; known only for a single record, and `None` for a sweep or a cohort.
    pub separation_sigma: Option<f64>,
    /// Fraction of cohorts simulated from the rival in which the claim leads by at least as much as in the data; known only for a cohort.
    pub lead_p: Option<f64>,
}

/// Evidence for one effect alone, from which its status in the document follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectEvidence<'a> {
    /// Slug of the effect.
    pub effect: &'a str,
    /// Gain over the base; `None` if the effect cannot be added.
    pub gain_nats: Option<f64>,
    /// p of the gain, over the whole search.
    pub p: f64,
    /// Fraction of the effect's signature that the base cannot absorb; `None` if unknown.
    pub visible_fraction: Option<f64>,
}

impl Criteria {
    /// Returns whether an addition may be claimed. It must predict better than the model that it extends, and better than the base.
    pub fn passes(&self, addition: &Addition) -> bool {
        addition.p <= self.p_of_round(addition.round)
            && addition.gain.largest_change >= self.smallest_change
            && addition.over_base.fitted >= self.least_fitted_nats
            && self.predicts(&addition.gain)
            && self.predicts(&addition.over_base)
    }

    /// Returns whether a model predicts future cycles better than another model, without predicting the last cycle worse.
    fn predicts(&self, gain: &Gain) -> bool {
        let is_better = |least: f64| gain.future.is_some_and(|future| future > least);
        let is_kept = |last: f64| last > -self.largest_loss_nats;
        self.least_future_nats.is_none_or(is_better) && gain.last.map_or(self.least_future_nats.is_none(), is_kept)
    }

    /// Returns whether structure outside the library is more than chance.
    pub fn is_significant(&self, structure: &Structure) -> bool {
        structure.p_familywise <= self.largest_structure_p && structure.gain_nats >= self.least_structure_nats
    }

    /// Returns whether structure in a claim's residual gains too much to be an error of the claim's shape.
    pub fn adds_to_claim(&self, structure: &Structure, claim: &Addition) -> bool {
        structure.gain_nats >= self.least_structure_share * claim.over_base.fitted
    }

    /// Returns whether structure in the base's residual explains more than a claim. The threshold is lower if the claim's own residual also has structure (`has_beside`).
    pub fn replaces_claim(&self, structure: &Structure, claim: &Addition, has_beside: bool) -> bool {
        let gain_nats = claim.over_base.fitted;
        let chance_nats = self.chance_nats + self.larger_nats * claim.effects.len().saturating_sub(1) as f64;
        let lead_nats =
            if has_beside { 0.0 } else { self.structure_lead_nats + self.least_structure_share * gain_nats };
        structure.gain_nats > gain_nats - chance_nats + lead_nats
    }

    /// Returns whether structure resembles an effect that `is_effect` accepts.
    pub fn resembles_effect(&self, structure: &Structure, is_effect: impl Fn(&str) -> bool) -> bool {
        structure.twins.iter().any(|(slug, cosine)| *cosine > self.least_similar_cosine && is_effect(slug))
    }

    /// Returns whether the data cannot distinguish a rival from the claim.
    pub fn is_equivalent(&self, rival: &Rival) -> bool {
        rival.deficit_nats < self.equivalent_nats
            && rival.separation_sigma.is_none_or(|sigma| sigma < self.separated_sigma)
            && rival.lead_p.is_none_or(|p| p > self.least_rival_p)
    }
}

/// Evidence of a search, from which the verdict is decided.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Evidence {
    /// Models that may be claimed, in the order in which they are considered.
    pub proposals: Vec<ClaimProposal>,
    /// Residual test of the base; `None` until it is made.
    pub base: Option<ResidualTest>,
    /// Rivals of the claim.
    pub rivals: Vec<Rival>,
}

/// Conclusion of a diagnosis, without its sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Kind of the verdict.
    pub kind: VerdictKind,
    /// Index of the claimed proposal, or of the one that helps most if the verdict is [`VerdictKind::Unexplained`]; `None` for the base.
    pub proposal: Option<usize>,
    /// Effects of the claimed or helping proposal.
    pub effects: Vec<String>,
    /// Effects that the data cannot distinguish from `effects`.
    pub equivalent: Vec<String>,
    /// Residual on which the verdict rests.
    pub residual: Option<Residual>,
    /// True if that residual exceeds the noise or was not tested.
    pub exceeds_noise: bool,
    /// True if the residual test found structure outside the library.
    pub has_structure: bool,
    /// True if there is no claim although the residual does not look like the known noise.
    pub is_doubtful: bool,
}

impl Evidence {
    /// Returns the index of the accepted proposal (`None` for the base), and its residual test.
    fn accepted(&self, criteria: &Criteria) -> (Option<usize>, Option<&ResidualTest>) {
        for (place, ClaimProposal { addition, test, .. }) in self.proposals.iter().enumerate() {
            if !criteria.passes(addition) {
                continue;
            }
            match test {
                Some(test) if test.replaces_effects => return (None, Some(test)),
                // A misfit that remains does not justify several effects: only the leading effect of a larger model may be reported as helping.
                Some(test) if addition.effects.len() > 1 && test.exceeds_noise(criteria) => {}
                test => return (Some(place), test.as_ref()),
            }
        }
        (None, self.base.as_ref())
    }

    /// Returns the model whose residual must be tested next: a proposal, or the base (`Some(None)`). Returns `None` if the accepted model is already tested.
    pub fn next_test(&self, criteria: &Criteria) -> Option<Option<usize>> {
        let (proposal, test) = self.accepted(criteria);
        test.is_none().then_some(proposal)
    }

    /// Returns whether structure that may belong to the law has replaced every proposal. If so, the residual of the leading effect alone decides whether that effect helps.
    pub fn is_replaced_by_law(&self, criteria: &Criteria) -> bool {
        let (proposal, test) = self.accepted(criteria);
        let is_of_law = |test: &ResidualTest| test.structure.first().is_some_and(|first| first.is_of_law);
        proposal.is_none() && test.is_some_and(is_of_law)
    }

    /// Returns the index of the claimed proposal, whose rivals must be found next.
    pub fn claim(&self, criteria: &Criteria) -> Option<usize> {
        let verdict = decide_verdict(self, criteria);
        verdict.proposal.filter(|_| verdict.kind == VerdictKind::Missing)
    }
}

impl ResidualTest {
    fn exceeds_noise(&self, criteria: &Criteria) -> bool {
        self.residual.is_some_and(|residual| residual.exceeds_noise(criteria))
    }
}

/// Decides the verdict from the evidence.
///
/// An effect is missing if a proposal passes and its residual is noise. The verdict is unexplained if the residual of the accepted model exceeds the noise, or if
/// structure outside the library is the only finding. Else nothing is missing. A residual that was not tested does not count as noise.
pub fn decide_verdict(evidence: &Evidence, criteria: &Criteria) -> Verdict {
    let (standing, test) = evidence.accepted(criteria);
    let has_structure = test.is_some_and(|test| !test.structure.is_empty());
    let helps = |proposal: &ClaimProposal| proposal.alone.is_some_and(|alone| alone.exceeds_noise(criteria));
    let helping = evidence.proposals.iter().position(helps).filter(|_| evidence.is_replaced_by_law(criteria));
    let (proposal, residual) = match helping {
        Some(place) => (helping, evidence.proposals[place].alone),
        None => (standing, test.and_then(|test| test.residual)),
    };
    let exceeds_noise = test.is_none() || residual.is_some_and(|residual| residual.exceeds_noise(criteria));
    let kind = match proposal {
        _ if exceeds_noise => VerdictKind::Unexplained,
        Some(_) => VerdictKind::Missing,
        None if has_structure => VerdictKind::Unexplained,
        None => VerdictKind::None,
    };
    let is_equivalent = |rival: &&Rival| kind == VerdictKind::Missing && criteria.is_equivalent(rival);
    Verdict {
        kind,
        proposal,
        effects: proposal.map_or(Vec::new(), |place| evidence.proposals[place].addition.effects.clone()),
        equivalent: evidence.rivals.iter().filter(is_equivalent).map(|rival| rival.effect.clone()).collect(),
        residual,
        exceeds_noise,
        has_structure,
        is_doubtful: kind == VerdictKind::None && residual.is_some_and(|residual| residual.is_doubtful(criteria)),
    }
}

impl Verdict {
    /// Verdict for a document, with its sentence.
    pub fn document(&self, sentence: String) -> diagnosis::Verdict {
        let Self { kind, effects, equivalent, .. } = self.clone();
        diagnosis::Verdict { kind, effects, equivalent, base_law: None, sentence }
    }

    /// Status of an effect of the library under this verdict.
    pub fn status(&self, effect: &EffectEvidence, criteria: &Criteria) -> Status {
        let is_among = |list: &[String]| list.iter().any(|name| name == effect.effect);
        let gain_nats = effect.gain_nats.unwrap_or(f64::NEG_INFINITY);
        let is_hidden = effect.visible_fraction.is_none_or(|fraction| fraction < criteria.least_visible);
        if is_among(&self.effects) {
            if self.exceeds_noise { Status::Suggestive } else { Status::Claimed }
        } else if is_among(&self.equivalent) {
            Status::Equivalent
        } else if is_hidden && gain_nats < criteria.least_gain_nats {
            Status::Invisible
        } else if self.effects.is_empty()
            && !self.has_structure
            && gain_nats > criteria.least_gain_nats
            && effect.p <= criteria.suggestive_p
        {
            Status::Suggestive
        } else {
            Status::Unsupported
        }
    }
}

#[cfg(test)]
#[path = "verdict_tests.rs"]
mod tests;

//! The verdict: a pure function of the evidence of a search and of [`Criteria`].
//!
//! Evidence is filled in a fixed order: additions that the search proposes; the residual test of the model that stands, and of the next one where it does not ([`Evidence::open_test`]); the residual of the
//! leading effect alone, where structure of the law replaces it ([`Evidence::is_replaced_by_law`]); rivals of a claim ([`Evidence::claim`]). A record, a sweep and a cohort fill in the parts that they
//! have. Nothing here fits, reads or simulates.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::criteria::Criteria;
use super::refit::Gain;
use documents::diagnosis::{self, Status, VerdictKind};
use posterior::misfit::Misfit;

/// Effects added to a model, with the gains and the p that the search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Addition {
    /// Slugs of all effects beside the base.
    pub effects: Vec<String>,
    /// Gain over the model of the round before.
    pub gain: Gain,
    /// Gain over the base.
    pub over_base: Gain,
    /// p of `gain`, corrected for the search of its round.
    pub p: f64,
    /// Round of the search, from 0.
    pub round: usize,
}

impl Addition {
    /// One effect beside the base.
    pub fn single(effect: &str, gain: Gain, p: f64) -> Self {
        Self { effects: vec![effect.into()], gain, over_base: gain, p, round: 0 }
    }

    /// One effect of a sweep or a cohort: gains on fitted data, on future cycles and on the last held-out data.
    pub fn of_gains(effect: &str, fitted: f64, [future, last]: [Option<f64>; 2], p: f64) -> Self {
        Self::single(effect, Gain { fitted, future, last, largest_change: f64::INFINITY, rank: fitted }, p)
    }
}

/// Structure outside the library in a residual.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Gain of its refit, less what its family gains by chance.
    pub gain_nats: f64,
    /// p over all families.
    pub p_familywise: f64,
    /// Whether it may belong to a law: a slip or a vibration does not.
    pub is_of_law: bool,
    /// Effects of the library that look nearly the same, with the cosine.
    pub twins: Vec<(String, f64)>,
}

/// A residual beside the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Residual {
    /// Of one record.
    Record {
        /// Size and return.
        misfit: Misfit,
        /// Positions that were held out, or else fitted.
        n_positions: usize,
        /// Error on the held-out cycle over the predictive noise: of a claim, and of a base where fitted recordings cannot show slow noise and gains. `None` where no cycle is held out.
        over_predicted: Option<f64>,
    },
    /// Probability that noise leaves as much of a sweep; NaN where the model cannot be evaluated.
    Sweep(f64),
    /// Number of a cohort's records that leave more than noise.
    Cohort(usize),
    /// Error of a cohort's claim on all held-out cycles over its predictive noise; `None` where no cycle is held out.
    CohortClaim(Option<f64>),
}

impl Residual {
    /// Whether it is more than the noise allows.
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

    /// Whether it is larger than white noise of the known size, by no more than slow noise may make.
    fn is_doubtful(&self, criteria: &Criteria) -> bool {
        let Self::Record { misfit, n_positions, .. } = self else { return false };
        let (factor, n) = (misfit.heldout.unwrap_or(misfit.fitted).rms_m / misfit.noise_m, *n_positions as f64);
        let by_chance = ChiSquared::new(n).map_or(1.0, |chi| chi.sf(n * factor * factor));
        misfit.is_known && factor > criteria.doubtful_factor && by_chance < criteria.doubtful_p
    }
}

/// What is left beside a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResidualTest {
    /// Confirmed structure outside the library, the leading one first.
    pub structure: Vec<Structure>,
    /// Whether the structure is the base's, and explains more than the model's effects.
    pub replaces_effects: bool,
    /// Residual of the model, or of the base that the structure stands beside; `None` where the search does not test it.
    pub residual: Option<Residual>,
}

/// A model that the search proposes.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Its effects and gains.
    pub addition: Addition,
    /// What is left beside it; `None` until it is tested.
    pub test: Option<ResidualTest>,
    /// Residual of it alone, where structure of the law has replaced it.
    pub alone: Option<Residual>,
}

impl From<Addition> for Proposal {
    fn from(addition: Addition) -> Self {
        Self { addition, test: None, alone: None }
    }
}

/// An effect that may stand for one of the claim.
#[derive(Debug, Clone, PartialEq)]
pub struct Rival {
    /// Slug.
    pub effect: String,
    /// What it ranks behind the claim.
    pub deficit_nats: f64,
    /// Distance in σ between the two models, of one record.
    pub separation_sigma: Option<f64>,
    /// Share of simulated cohorts, made with it, in which the claim leads by as much.
    pub lead_p: Option<f64>,
}

/// An effect by itself, for its status.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectEvidence<'a> {
    /// Slug.
    pub effect: &'a str,
    /// Gain over the base; `None` where it cannot be added.
    pub gain_nats: Option<f64>,
    /// p over the whole search.
    pub p: f64,
    /// Share of its signature that the base cannot absorb; `None` where that is unknown.
    pub visible_fraction: Option<f64>,
}

impl Criteria {
    /// Whether an addition may be claimed. An addition to a model that was not claimed itself has to predict better than the base, too.
    pub fn passes(&self, addition: &Addition) -> bool {
        addition.p <= self.p_of_round(addition.round)
            && addition.gain.largest_change >= self.smallest_change
            && self.predicts(&addition.gain)
            && self.predicts(&addition.over_base)
    }

    /// Whether future cycles are predicted better, and the last one, which no fit has seen, not worse.
    fn predicts(&self, gain: &Gain) -> bool {
        let is_better = |least: f64| gain.future.is_some_and(|future| future > least);
        let is_kept = |last: f64| last > -self.largest_loss_nats;
        self.least_future_nats.is_none_or(is_better) && gain.last.map_or(self.least_future_nats.is_none(), is_kept)
    }

    /// Whether structure outside the library is more than chance.
    pub fn is_significant(&self, structure: &Structure) -> bool {
        structure.p_familywise <= self.largest_structure_p && structure.gain_nats >= self.least_structure_nats
    }

    /// Whether structure in the residual of a claim is more than an error of the claim's shape.
    pub fn is_beside(&self, structure: &Structure, claim: &Addition) -> bool {
        structure.gain_nats >= self.least_structure_share * claim.over_base.fitted
    }

    /// Whether structure in the base's residual explains more than a claim, whose own residual shows structure or none.
    pub fn is_instead(&self, structure: &Structure, claim: &Addition, has_beside: bool) -> bool {
        let gain_nats = claim.over_base.fitted;
        let chance_nats = self.chance_nats + self.larger_nats * claim.effects.len().saturating_sub(1) as f64;
        let lead_nats =
            if has_beside { 0.0 } else { self.structure_lead_nats + self.least_structure_share * gain_nats };
        structure.gain_nats > gain_nats - chance_nats + lead_nats
    }

    /// Whether structure looks like an effect of a kind.
    pub fn looks_like(&self, structure: &Structure, is_effect: impl Fn(&str) -> bool) -> bool {
        structure.twins.iter().any(|(slug, cosine)| *cosine > self.twin_cosine && is_effect(slug))
    }

    /// Whether the data cannot tell a rival from the claim.
    pub fn is_equivalent(&self, rival: &Rival) -> bool {
        rival.deficit_nats < self.equivalent_nats
            && rival.separation_sigma.is_none_or(|sigma| sigma < self.separated_sigma)
            && rival.lead_p.is_none_or(|p| p > self.least_rival_p)
    }
}

/// The evidence of a search.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Evidence {
    /// Models that may be claimed, in the order in which they are considered.
    pub proposals: Vec<Proposal>,
    /// What is left beside the base; `None` until it is tested.
    pub base: Option<ResidualTest>,
    /// Rivals of the claim.
    pub rivals: Vec<Rival>,
}

/// The conclusion, without its words.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Of which kind it is.
    pub kind: VerdictKind,
    /// Place, among the proposals, of the model that is claimed, or that helps most where the verdict is [`VerdictKind::Unexplained`]; `None` for the base.
    pub proposal: Option<usize>,
    /// Effects of that model.
    pub effects: Vec<String>,
    /// Effects that the data cannot tell from those.
    pub equivalent: Vec<String>,
    /// Residual that the verdict rests on.
    pub residual: Option<Residual>,
    /// Whether that is more than the noise allows, or untested.
    pub exceeds_noise: bool,
    /// Whether there is structure outside the library.
    pub has_structure: bool,
    /// Whether nothing is claimed though the residual does not look like the known noise.
    pub is_doubtful: bool,
}

impl Evidence {
    /// The proposal that stands (`None`: the base), with its residual test.
    fn standing(&self, criteria: &Criteria) -> (Option<usize>, Option<&ResidualTest>) {
        for (place, Proposal { addition, test, .. }) in self.proposals.iter().enumerate() {
            if !criteria.passes(addition) {
                continue;
            }
            match test {
                Some(test) if test.replaces_effects => return (None, Some(test)),
                // No effect is added for the sake of a misfit that stays: of a larger model only the leading effect may be said to help.
                Some(test) if addition.effects.len() > 1 && test.exceeds_noise(criteria) => {}
                test => return (Some(place), test.as_ref()),
            }
        }
        (None, self.base.as_ref())
    }

    /// The model whose residual has to be tested next: a proposal, or the base (`Some(None)`); `None` when the one that stands is tested.
    pub fn open_test(&self, criteria: &Criteria) -> Option<Option<usize>> {
        let (proposal, test) = self.standing(criteria);
        test.is_none().then_some(proposal)
    }

    /// Whether structure that may belong to the law has replaced every proposal: the residual of the leading effect alone decides whether that effect helps.
    pub fn is_replaced_by_law(&self, criteria: &Criteria) -> bool {
        let (proposal, test) = self.standing(criteria);
        let is_of_law = |test: &ResidualTest| test.structure.first().is_some_and(|first| first.is_of_law);
        proposal.is_none() && test.is_some_and(is_of_law)
    }

    /// Place of the proposal that is claimed: its rivals have to be found.
    pub fn claim(&self, criteria: &Criteria) -> Option<usize> {
        let verdict = verdict(self, criteria);
        verdict.proposal.filter(|_| verdict.kind == VerdictKind::Missing)
    }
}

impl ResidualTest {
    fn exceeds_noise(&self, criteria: &Criteria) -> bool {
        self.residual.is_some_and(|residual| residual.exceeds_noise(criteria))
    }
}

/// Decides.
///
/// An effect is missing where a proposal passes and its residual is noise. The law is wrong, and the cause unexplained, where the residual of the model that stands exceeds the noise, or where structure outside
/// the library is all that is found. Else nothing is missing. An untested residual is not noise.
pub fn verdict(evidence: &Evidence, criteria: &Criteria) -> Verdict {
    let (standing, test) = evidence.standing(criteria);
    let has_structure = test.is_some_and(|test| !test.structure.is_empty());
    let helps = |proposal: &Proposal| proposal.alone.is_some_and(|alone| alone.exceeds_noise(criteria));
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
    /// For a document, with its sentence.
    pub fn document(&self, sentence: String) -> diagnosis::Verdict {
        let Self { kind, effects, equivalent, .. } = self.clone();
        diagnosis::Verdict { kind, effects, equivalent, sentence }
    }

    /// Status of an effect of the library beside the verdict.
    pub fn status(&self, effect: &EffectEvidence, criteria: &Criteria) -> Status {
        let is_among = |list: &[String]| list.iter().any(|own| own == effect.effect);
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

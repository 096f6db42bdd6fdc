//! Counts the results of many challenges.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::play::{HiddenKind, Play};
use super::{NoiseKind, Protocol};

/// Counted results of many challenges, the body of `vitreo-uq/challenge/1`. Rates are from 0 to 1; a rate is `None` if no challenge counts towards it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Tally {
    /// Number of challenges that were played.
    pub played: usize,
    /// Number of challenges whose diagnosis failed.
    pub failed: usize,
    /// Confusion matrix of truths and verdicts.
    pub confusion: Vec<Confusion>,
    /// Fraction of challenges with a single hidden effect in which this effect is claimed or reported as equivalent to the claim.
    pub class_coverage: Option<f64>,
    /// Mean number of claimed effects and their reported equivalents, over the claims for a single hidden effect.
    pub mean_class_size: Option<f64>,
    /// Mean number of effects that the experiment cannot distinguish from the hidden effect, itself included. The mean is over the challenges of
    /// `mean_class_size`.
    pub ideal_class_size: Option<f64>,
    /// Fraction of challenges with a single hidden effect in which the leading effect is the hidden one or is equivalent to it.
    pub first_place_separated: Option<f64>,
    /// Fraction of challenges without a hidden effect in which an effect was claimed.
    pub false_claims: Option<f64>,
    /// Fraction of challenges without a hidden effect whose verdict is `unexplained`.
    pub false_unexplained: Option<f64>,
    /// Fraction of challenges with a hidden pair in which both effects are claimed or reported as equivalent to the claim.
    pub pair_coverage: Option<f64>,
    /// Fraction of challenges with physics outside the library whose verdict is `unexplained`.
    pub unexplained_called: Option<f64>,
    /// Fraction of challenges with physics outside the library in which the diagnosis claims an effect and reports no unexplained misfit.
    pub misattributed: Option<f64>,
    /// Fraction of rightly claimed single effects whose true size lies in the 90 % interval.
    pub interval_coverage_90: Option<f64>,
    /// Fraction of challenges with right claims whose error on the scored cycle is at most 1.1 times the drawn noise.
    pub heldout_at_true_noise: Option<f64>,
    /// Fraction of challenges with right claims whose error is at most 1.1 times the noise that the diagnosis predicts. The fraction shows whether predicted
    /// noise and error agree. It is 1 for any residual if the predicted noise is far too large.
    pub heldout_at_predictive_noise: Option<f64>,
    /// Counts for each combination of sort, protocol, noise and signal.
    pub groups: Vec<Group>,
}

/// Entry of the confusion matrix: number of challenges with one truth and one verdict.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Confusion {
    /// Truth: slugs joined by `+`, `none` or `outside`.
    pub truth: String,
    /// Verdict: slugs joined by `+`, `none`, `unexplained` or `failed`.
    pub said: String,
    /// Number of challenges with this truth and this verdict.
    pub count: usize,
}

/// Counts of the challenges with one sort, protocol, noise and signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Group {
    /// Sort of the challenges: the kind of physics that they hide.
    pub sort: HiddenKind,
    /// Protocol of the challenges.
    pub protocol: Protocol,
    /// Kind of noise of the challenges.
    pub noise: NoiseKind,
    /// Signal in noise standard deviations, rounded; `None` if nothing is hidden.
    pub signal_sigma: Option<u32>,
    /// Number of challenges that were played.
    pub played: usize,
    /// Number of right diagnoses: every hidden effect is claimed or equivalent to a claim, or the verdict is rightly `none` or `unexplained`.
    pub right: usize,
    /// Number of challenges in which an effect was claimed.
    pub claimed: usize,
}

/// Largest ratio of the error on the scored cycle to its noise at which the noise is said to explain the error.
const ALLOWED_RATIO: f64 = 1.1;

fn share(plays: &[&Play], is: impl Fn(&Play) -> bool) -> Option<f64> {
    (!plays.is_empty()).then(|| plays.iter().filter(|play| is(play)).count() as f64 / plays.len() as f64)
}

fn mean(plays: &[&Play], of: impl Fn(&Play) -> f64) -> Option<f64> {
    (!plays.is_empty()).then(|| plays.iter().map(|play| of(play)).sum::<f64>() / plays.len() as f64)
}

/// Counts the results of challenges: rates, confusion matrix and groups.
pub fn tally(plays: &[Play]) -> Tally {
    let of = |is: &dyn Fn(&Play) -> bool| -> Vec<&Play> { plays.iter().filter(|play| is(play)).collect() };
    let singles = of(&|play| play.sort == HiddenKind::Single);
    let claimed_singles = of(&|play| play.sort == HiddenKind::Single && play.is_claim());
    let pairs = of(&|play| play.sort == HiddenKind::Pair);
    let controls = of(&|play| matches!(play.sort, HiddenKind::None | HiddenKind::Apparatus));
    let outside = of(&|play| play.sort == HiddenKind::Outside);
    let sized = of(&|play| play.size_covered.is_some());
    let at_noise = |ratio: &dyn Fn(&Play) -> Option<f64>| {
        let named = of(&|play| !play.truth.effects.is_empty() && play.is_in_class() && ratio(play).is_some());
        share(&named, |play| ratio(play).is_some_and(|ratio| ratio <= ALLOWED_RATIO))
    };
    Tally {
        played: plays.len(),
        failed: plays.iter().filter(|play| play.failure.is_some()).count(),
        confusion: confusion(plays),
        class_coverage: share(&singles, Play::is_in_class),
        mean_class_size: mean(&claimed_singles, |play| play.class.len() as f64),
        ideal_class_size: mean(&claimed_singles, |play| play.truth.ideal_class.len() as f64),
        first_place_separated: share(&singles, Play::is_first_separated),
        false_claims: share(&controls, Play::is_claim),
        false_unexplained: share(&controls, |play| play.said == "unexplained"),
        pair_coverage: share(&pairs, Play::is_in_class),
        unexplained_called: share(&outside, |play| play.said == "unexplained"),
        misattributed: share(&outside, |play| play.is_claim() && play.unexplained.is_empty()),
        interval_coverage_90: share(&sized, |play| play.size_covered == Some(true)),
        heldout_at_true_noise: at_noise(&|play| play.heldout_over_true_noise),
        heldout_at_predictive_noise: at_noise(&|play| play.heldout_over_predictive_noise),
        groups: groups(plays),
    }
}

fn confusion(plays: &[Play]) -> Vec<Confusion> {
    let mut counts: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    plays.iter().for_each(|play| *counts.entry((&play.label, &play.said)).or_default() += 1);
    let entry =
        |((truth, said), count): ((&str, &str), usize)| Confusion { truth: truth.into(), said: said.into(), count };
    counts.into_iter().map(entry).collect()
}

fn groups(plays: &[Play]) -> Vec<Group> {
    let mut groups: BTreeMap<(HiddenKind, &str, &str, Option<u32>), Group> = BTreeMap::new();
    for play in plays {
        let (protocol, noise) = (play.truth.protocol, play.truth.noise);
        let signal_sigma = play.truth.signal_sigma().map(|sigma| sigma.round() as u32);
        let empty = Group { sort: play.sort, protocol, noise, signal_sigma, played: 0, right: 0, claimed: 0 };
        let group = groups.entry((play.sort, protocol.name(), noise.name(), signal_sigma)).or_insert(empty);
        group.played += 1;
        group.right += usize::from(play.is_right());
        group.claimed += usize::from(play.is_claim());
    }
    groups.into_values().collect()
}

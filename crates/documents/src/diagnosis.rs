//! Document of `diagnose` (formats §5, `vitreo-uq/diagnosis/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/diagnosis/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Diagnosis {
    /// Specimen identifier.
    pub experiment: String,
    /// Verdict of the diagnosis.
    pub verdict: Verdict,
    /// Cycles that every model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored held-out cycle; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Errors of the base model.
    pub base: BaseErrors,
    /// Errors of the model with the verdict's effects; `None` if the verdict names no effect.
    pub extended: Option<Errors>,
    /// Noise of the best model in the search, white and slow together, in µm. It may contain a misfit.
    pub search_noise_um: f64,
    /// Every effect of the library, as a candidate effect.
    pub candidates: Vec<CandidateEntry>,
    /// Pairs of effects that were refitted, best first.
    pub pairs: Vec<PairEntry>,
    /// Effects that this experiment hardly shows.
    pub blind_spots: Vec<String>,
    /// Smallest detectable size of each effect.
    pub smallest_detectable: Vec<SmallestDetectable>,
    /// Change of the protocol that would separate the equivalent effects; empty if there are none.
    pub separating_protocol: String,
    /// Noise estimates by several methods, with a statement on their agreement.
    pub noise: Vec<NoiseEstimate>,
    /// Misfits that no effect of the library explains.
    pub unexplained: Vec<UnexplainedMisfit>,
    /// All unexplained misfits together and their share of the predictive noise. `None` if nothing is unexplained or if this was not requested.
    pub discrepancy: Option<DiscrepancyEntry>,
    /// Rows (from 0) left out as outliers.
    pub outlier_rows: Vec<usize>,
    /// Further remarks for the reader.
    pub remarks: Vec<String>,
}

/// Smallest relative fall of an error that counts.
const LEAST_FALL: f64 = 0.01;
/// Largest p at which a gain is not attributed to chance.
pub const CHANCE_P: f64 = 0.05;

impl Diagnosis {
    /// Status of a candidate in words, given the verdict.
    pub fn status_words(&self, candidate: &CandidateEntry) -> &'static str {
        let (kind, is_named) = (self.verdict.kind, self.verdict.effects.contains(&candidate.effect));
        let is_chance = candidate.refit.is_none() || candidate.p_familywise > CHANCE_P;
        match candidate.status {
            Status::Claimed => "claimed",
            Status::Equivalent => "equivalent",
            Status::Suggestive if is_named => "helps, not enough",
            Status::Suggestive => "suggestive",
            Status::Invisible => "invisible here",
            Status::Unsupported if is_chance => "no more than chance",
            Status::Unsupported if kind == VerdictKind::Missing => "weaker than the claim",
            Status::Unsupported if !self.verdict.effects.is_empty() => "helps less",
            Status::Unsupported => "helps too little",
        }
    }

    /// Sentence on effects that gain likelihood beyond chance without lowering the scored cycle's error; `None` if there are none.
    pub fn gains_without_error(&self) -> Option<String> {
        let before_um = self.base.rmse_heldout_um?;
        let is_so = |candidate: &&CandidateEntry| {
            let after_um = candidate.refit.as_ref().and_then(|refit| refit.rmse_heldout_um);
            candidate.p_familywise <= CHANCE_P
                && after_um.is_some_and(|after_um| after_um > (1.0 - LEAST_FALL) * before_um)
        };
        let named: Vec<&str> =
            self.candidates.iter().filter(is_so).map(|candidate| candidate.effect.as_str()).collect();
        let verb = if named.len() == 1 { "gains" } else { "gain" };
        (!named.is_empty()).then(|| {
            format!(
                "{} {verb} likelihood, but the error does not fall: correlated noise can make such gains.",
                named.join(", ")
            )
        })
    }
}

/// Effects that cannot be searched for, grouped by reason. Reasons keep the order of their first occurrence.
pub fn group_by_reason<'a>(effects: impl Iterator<Item = (&'a str, Option<&'a str>)>) -> Vec<(&'a str, Vec<&'a str>)> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for (effect, refused) in effects {
        let Some(reason) = refused else { continue };
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, effects)) => effects.push(effect),
            None => reasons.push((reason, vec![effect])),
        }
    }
    reasons
}

/// Verdict of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Verdict {
    /// Kind of verdict.
    pub kind: VerdictKind,
    /// Effects that are needed. For an unexplained misfit: effects that help without being sufficient.
    pub effects: Vec<String>,
    /// Effects that this experiment cannot distinguish from the verdict's effects.
    pub equivalent: Vec<String>,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum VerdictKind {
    /// Effects of the library are needed.
    Missing,
    /// The model explains the data down to the noise.
    None,
    /// The model does not explain the data, and no effect is claimed. Effects that the verdict names help but do not suffice.
    Unexplained,
}

/// Errors of the base model's posterior, as in `extend` and `ladder`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct BaseErrors {
    /// Root mean square error of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square error of the scored cycle, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// Known or estimated noise that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
}

/// Errors of another model's best fit with the study's own noise terms. They are close to the errors of `extend`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Errors {
    /// Root mean square error of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square error of the scored cycle, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// Predictive noise of the scored cycle, in µm: root mean square standard deviation of fitted noise and parameter uncertainty together. It contains nothing
    /// else, so an error above it is a misfit.
    pub predictive_noise_um: Option<f64>,
}

/// Status of a candidate effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Claimed by the verdict.
    Claimed,
    /// Not distinguishable from a claimed effect.
    Equivalent,
    /// Gains too little to be claimed, or helps a model that remains wrong with it.
    Suggestive,
    /// Gains hardly any likelihood, or less than a competing effect.
    Unsupported,
    /// Not detectable in this experiment, or cannot be added to this model.
    Invisible,
}

/// One candidate effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CandidateEntry {
    /// Slug of the effect.
    pub effect: String,
    /// Status of the effect.
    pub status: Status,
    /// Score in standard deviations, averaged over posterior draws. It is the largest over parameters that are unidentified at the null.
    pub z: f64,
    /// p of the refit's gain, corrected for the whole search by bootstrap.
    pub p_familywise: f64,
    /// Share of the effect's signature that the base model cannot absorb.
    pub visible_fraction: f64,
    /// Value of the effect's first parameter that the score predicts.
    pub expected_parameter: Option<f64>,
    /// Refit with the effect; `None` if the effect cannot be added.
    pub refit: Option<Refit>,
    /// Effects with nearly equal signatures in this experiment.
    pub twins: Vec<String>,
    /// Reason why the effect cannot be added; `None` if it can.
    pub refused: Option<String>,
}

/// Refit of the model with an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Refit {
    /// Gain in log likelihood over the base model, with noise estimated anew for both.
    pub gain_nats: f64,
    /// Gain in the log score of later cycles, each predicted from the cycles before it.
    pub heldout_gain_nats: Option<f64>,
    /// Part of the log score gain that comes from the last cycle.
    pub last_cycle_gain_nats: Option<f64>,
    /// Root mean square error of the scored cycle, as in [`Errors`].
    pub rmse_heldout_um: Option<f64>,
    /// Largest change of the predicted positions from the base model's refit, divided by the noise.
    pub largest_change: f64,
    /// Log Bayes factor over the base model. `None` if the refit gains too little, or if it cannot come near the best effect.
    pub log_bayes_factor: Option<f64>,
    /// Upper bound of the log Bayes factor if it is not computed because the effect cannot come near the best one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_bayes_factor_at_most: Option<f64>,
    /// Parameters of the effect.
    pub parameters: Vec<RefitParameter>,
    /// Modes of the posterior if it has several, the most probable first. `parameters` averages over all of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<PosteriorMode>,
}

/// One of several modes of a posterior, separated from the others by a valley.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PosteriorMode {
    /// Share of the posterior in this mode.
    pub probability: f64,
    /// Parameters within this mode.
    pub parameters: Vec<RefitParameter>,
}

/// A parameter of a refit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RefitParameter {
    /// Name of the parameter.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A refitted pair of effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PairEntry {
    /// Slugs of the two effects.
    pub effects: Vec<String>,
    /// Gain in log likelihood over the base model.
    pub gain_nats: f64,
    /// Gain in the log score of later cycles over the base model.
    pub heldout_gain_nats: Option<f64>,
}

/// Smallest detectable size of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SmallestDetectable {
    /// Slug of the effect.
    pub effect: String,
    /// Value of the effect's first parameter; `None` if no value in the prior's range is detectable.
    pub parameter: Option<f64>,
}

/// Noise estimate by one method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NoiseEstimate {
    /// Method: `rest records`, `short-lag differences`, `cycle-to-cycle differences` or `restricted maximum likelihood`.
    pub from: String,
    /// Standard deviation of one position, in µm; `None` if the record does not allow the estimate.
    pub sd_um: Option<f64>,
    /// Standard error of `sd_um`, in µm.
    pub standard_error_um: Option<f64>,
    /// Sentence with source, estimate, unit and the noise components that the method cannot see.
    pub text: String,
}

/// A misfit that no effect of the library explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct UnexplainedMisfit {
    /// `slip`, `vibration`, `backlash`, `cycle-locked`, …
    pub kind: String,
    /// Sentence that tells the misfit's kind, time and size.
    pub sentence: String,
    /// Gain in log likelihood over the model without this structure.
    pub gain_nats: f64,
    /// p corrected for all structures that were searched for.
    pub p_familywise: f64,
    /// Root mean square, in µm.
    pub size_um: f64,
}

/// All unexplained misfits together, as one discrepancy term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct DiscrepancyEntry {
    /// Axis along which it was found: `time`, `cycle_phase`, `time_since_step`, `force` or `position`.
    pub axis: String,
    /// Sentence that tells the misfit's kind and place.
    pub sentence: String,
    /// Root mean square over the fitted rows, in µm, of the part that the model's parameters cannot absorb.
    pub size_um: f64,
    /// p corrected for all structures that were searched for.
    pub p_familywise: f64,
    /// Predictive noise without the discrepancy, in µm: root mean square standard deviation of learnt noise and parameter uncertainty. It refers to the scored
    /// cycle, or to the fitted cycles if none is scored.
    pub predictive_noise_um: f64,
    /// Predictive noise, in µm, if the discrepancy may recur at any phase and with either sign.
    pub predictive_noise_with_discrepancy_um: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_named_once_with_all_its_effects() {
        let effects = [("a", Some("no gel")), ("b", None), ("c", Some("no force")), ("d", Some("no gel"))];
        assert_eq!(group_by_reason(effects.into_iter()), [("no gel", vec!["a", "d"]), ("no force", vec!["c"])]);
    }
}

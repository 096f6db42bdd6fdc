//! Document of `diagnose` (formats §5, `vitreo-uq/diagnosis/1`).

use serde::{Deserialize, Serialize};

/// Result of `diagnose`: body of the JSON document `vitreo-uq/diagnosis/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Diagnosis {
    /// Specimen identifier.
    pub experiment: String,
    /// Verdict of the diagnosis.
    pub verdict: Verdict,
    /// Cycles that every model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored cycle, which is the last held-out one; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Errors of the base model, to which the diagnosis adds effects.
    pub base: BaseErrors,
    /// Errors of the model with the verdict's effects; `None` if the verdict names no effect.
    pub extended: Option<Errors>,
    /// Noise standard deviation that the best model of the search has learnt, with white and slow noise together, in µm. It may contain a misfit.
    pub search_noise_um: f64,
    /// Every effect of the library, as a candidate effect.
    pub candidates: Vec<CandidateEntry>,
    /// Pairs of effects with which the model was refitted, largest gain first.
    pub pairs: Vec<PairEntry>,
    /// Effects that this experiment can hardly show at any size.
    pub blind_spots: Vec<String>,
    /// Smallest detectable size of each effect in this experiment.
    pub smallest_detectable: Vec<SmallestDetectable>,
    /// Change of the protocol that would distinguish the equivalent effects; empty if there are none.
    pub separating_protocol: String,
    /// Estimates of the noise standard deviation by several methods.
    pub noise: Vec<NoiseEstimate>,
    /// Misfits that no effect of the library explains.
    pub unexplained: Vec<UnexplainedMisfit>,
    /// All unexplained misfits together, with their influence on predictions; `None` if there are none or if the user did not request this.
    pub discrepancy: Option<DiscrepancyEntry>,
    /// Numbers (from 0) of the rows left out as outliers.
    pub outlier_rows: Vec<usize>,
    /// Further remarks for the reader.
    pub remarks: Vec<String>,
}

/// Smallest relative decrease of an error that counts as an improvement.
const LEAST_FALL: f64 = 0.01;
/// Largest p at which a gain in likelihood is not attributed to chance.
pub const CHANCE_P: f64 = 0.05;

impl Diagnosis {
    /// Returns the status of a candidate effect in words, given the verdict.
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

    /// Returns a sentence on effects that increase the likelihood beyond chance but do not decrease the last held-out cycle's error; `None` if there are none.
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
                "{} {verb} likelihood, but the error does not fall. Correlated noise can cause such gains.",
                named.join(", ")
            )
        })
    }
}

/// Groups effects that cannot be added to a model by the reason. The input is each effect with its reason, or `None` if it can be added. Reasons keep the order
/// of their first occurrence.
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
    /// Kind of verdict: missing, none or unexplained.
    pub kind: VerdictKind,
    /// Effects that the model lacks. For an unexplained misfit: effects that help but do not suffice.
    pub effects: Vec<String>,
    /// Effects that this experiment cannot distinguish from the verdict's effects.
    pub equivalent: Vec<String>,
    /// Base law that explains the record without an effect; searched only if the model with the verdict's effects leaves more than 1.5 times the noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_law: Option<String>,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of verdicts of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum VerdictKind {
    /// The model lacks effects of the library.
    Missing,
    /// The model lacks no effect: its residuals are consistent with the noise.
    None,
    /// The model does not explain the data, and no effect is claimed. Effects that the verdict names help but do not suffice.
    Unexplained,
}

/// Errors of the base model's posterior, computed as in `extend` and `ladder`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct BaseErrors {
    /// Root mean square residual of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square residual of the scored (last held-out) cycle, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Noise standard deviation, known or estimated, that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
}

/// Errors of the best fit of an extended model, with the study's own noise terms. They are close to the errors that `extend` finds by sampling.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Errors {
    /// Root mean square residual of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square residual of the scored (last held-out) cycle, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Standard deviation of predicted positions in the scored cycle, as a root mean square over its rows, in µm. It comprises the fitted noise and the
    /// uncertainty of the parameters. A larger error is a misfit.
    pub predictive_noise_um: Option<f64>,
}

/// Status of a candidate effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The verdict claims that the model lacks the effect.
    Claimed,
    /// This experiment cannot distinguish the effect from a claimed one.
    Equivalent,
    /// The effect gains too little for a claim, or the model remains wrong with it.
    Suggestive,
    /// The effect gains hardly any likelihood, or less than a competing effect.
    Unsupported,
    /// This experiment cannot detect the effect, or the model cannot be extended by it.
    Invisible,
}

/// Results for one candidate effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CandidateEntry {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Status of the effect.
    pub status: Status,
    /// Score: estimated number of standard deviations by which the effect stands out from the noise. It is averaged over posterior draws, and is the largest
    /// over values of parameters that are unidentified at the null.
    pub z: f64,
    /// Probability that chance alone gives as large a gain as the refit's, corrected for the whole search by bootstrap.
    pub p_familywise: f64,
    /// Share (0 to 1) of the effect's squared signature that the base model cannot absorb.
    pub visible_fraction: f64,
    /// Value of the effect's first parameter that follows from the score, without a refit.
    pub expected_parameter: Option<f64>,
    /// Refit of the base model with the effect; `None` if the effect cannot be added.
    pub refit: Option<Refit>,
    /// Other effects with nearly equal signatures in this experiment.
    pub twins: Vec<String>,
    /// Reason why the effect cannot be added; `None` if it can.
    pub refused: Option<String>,
}

/// Result of refitting the base model with one effect added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Refit {
    /// Gain in log likelihood over the base model, in nats, with the noise estimated anew for both models.
    pub gain_nats: f64,
    /// Gain in the log score of later cycles, each predicted from the cycles before it, in nats.
    pub heldout_gain_nats: Option<f64>,
    /// Part of the gain in log score that comes from the last cycle, in nats.
    pub last_cycle_gain_nats: Option<f64>,
    /// Root mean square residual of the scored cycle, in µm, defined as in [`Errors`].
    pub rmse_heldout_um: Option<f64>,
    /// Largest change of a predicted position by the effect, divided by the noise standard deviation.
    pub largest_change: f64,
    /// Log Bayes factor over the base model, in nats. `None` if the gain is too small, or if the effect cannot come near the best one.
    pub log_bayes_factor: Option<f64>,
    /// Upper bound of the log Bayes factor, in nats, if the effect cannot come near the best one. In this case `log_bayes_factor` is not computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_bayes_factor_at_most: Option<f64>,
    /// Posteriors of the effect's parameters.
    pub parameters: Vec<RefitParameter>,
    /// Posteriors of the law's parameters beside the effect, for an effect of the verdict that has equivalents and for these; otherwise empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub law_parameters: Vec<RefitParameter>,
    /// Modes of the posterior, the most probable first; empty for a single mode. `parameters` averages over all modes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<PosteriorMode>,
}

/// One of several separate modes (peaks) of a posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PosteriorMode {
    /// Share of the posterior in this mode.
    pub probability: f64,
    /// Posteriors of the effect's parameters within this mode.
    pub parameters: Vec<RefitParameter>,
}

/// Posterior of one parameter of an added effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RefitParameter {
    /// Name of the parameter.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// 5 % quantile of the posterior.
    pub q05: f64,
    /// 95 % quantile of the posterior.
    pub q95: f64,
}

/// Result of refitting the base model with two effects added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PairEntry {
    /// Names of the two effects.
    pub effects: Vec<String>,
    /// Gain in log likelihood over the base model, in nats.
    pub gain_nats: f64,
    /// Gain over the base model in the log score of later cycles, in nats.
    pub heldout_gain_nats: Option<f64>,
}

/// Smallest size of an effect that the experiment can detect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SmallestDetectable {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Smallest detectable value of the effect's first parameter; `None` if no value in the prior's range is detectable.
    pub parameter: Option<f64>,
}

/// Estimate of the noise standard deviation by one method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NoiseEstimate {
    /// Method: `rest records`, `short-lag differences`, `cycle-to-cycle differences` or `restricted maximum likelihood`.
    pub from: String,
    /// Standard deviation of the error of one position, in µm; `None` if the method does not apply to the record.
    pub sd_um: Option<f64>,
    /// Standard error of `sd_um`, in µm.
    pub standard_error_um: Option<f64>,
    /// Sentence with the method, the estimate and the noise components that the method cannot see.
    pub text: String,
}

/// A misfit that no effect of the library explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct UnexplainedMisfit {
    /// Kind of misfit: `slip`, `vibration`, `backlash`, `cycle-locked`, …
    pub kind: String,
    /// Sentence that states the kind, time and size of the misfit.
    pub sentence: String,
    /// Gain in log likelihood over the model without the misfit, in nats.
    pub gain_nats: f64,
    /// Probability that chance alone gives as large a gain, corrected for all kinds of misfit searched for.
    pub p_familywise: f64,
    /// Root mean square of the misfit, in µm.
    pub size_um: f64,
}

/// All unexplained misfits of a model together, as one discrepancy: the part of the measurement that no effect explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct DiscrepancyEntry {
    /// Axis along which the discrepancy was found: `time`, `cycle_phase`, `time_since_step`, `force` or `position`.
    pub axis: String,
    /// Sentence that states the kind and place of the discrepancy.
    pub sentence: String,
    /// Root mean square of the discrepancy over the fitted rows, in µm, without the part that the model's parameters can absorb.
    pub size_um: f64,
    /// Probability that chance alone gives as large a gain, corrected for all kinds of misfit searched for.
    pub p_familywise: f64,
    /// Standard deviation of predictions without the discrepancy, as a root mean square, in µm. It comprises the learnt noise and the uncertainty of the
    /// parameters, in the scored cycle. If no cycle is scored, it refers to the fitted cycles.
    pub predictive_noise_um: f64,
    /// Standard deviation of predictions, in µm, if the discrepancy may recur at any phase and with either sign.
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

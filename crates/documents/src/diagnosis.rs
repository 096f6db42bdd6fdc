//! The document of `diagnose` (formats §5, `vitreo-uq/diagnosis/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/diagnosis/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Diagnosis {
    /// Specimen identifier.
    pub experiment: String,
    /// What is concluded.
    pub verdict: Verdict,
    /// Cycles that every model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The cycle that was scored, if there is one.
    pub heldout_cycles: Vec<u32>,
    /// The base model's errors.
    pub base: BaseErrors,
    /// Errors of the model with the effects of the verdict; `None` when it names none.
    pub extended: Option<Errors>,
    /// The noise that the search learnt beside the best model, white and slow together, in µm; it may hold a misfit.
    pub search_noise_um: f64,
    /// Every effect of the library.
    pub candidates: Vec<CandidateEntry>,
    /// Pairs of effects that were refitted, best first.
    pub pairs: Vec<PairEntry>,
    /// Effects of which this experiment shows next to nothing.
    pub blind_spots: Vec<String>,
    /// The smallest size of each effect that would have been seen.
    pub smallest_detectable: Vec<SmallestDetectable>,
    /// A change of the protocol that would separate what this experiment cannot; empty when there is nothing to separate.
    pub separating_protocol: String,
    /// What the noise was learnt to be, three ways, and whether they agree.
    pub noise: Vec<NoiseEstimate>,
    /// Structure that no effect of the library explains.
    pub unexplained: Vec<UnexplainedEntry>,
    /// What it amounts to and adds to predictions; `None` where nothing is unexplained, or nobody asked.
    pub discrepancy: Option<DiscrepancyEntry>,
    /// Rows (from 0) that were left out as outliers.
    pub outlier_rows: Vec<usize>,
    /// What a reader should know besides.
    pub remarks: Vec<String>,
}

/// Share by which an error has to fall to be seen.
const LEAST_FALL: f64 = 0.01;
/// p above which a gain is no more than chance makes.
const CHANCE_P: f64 = 0.05;

impl Diagnosis {
    /// Standing of a candidate in words, beside what the verdict says; empty where there is nothing to say.
    pub fn standing(&self, candidate: &CandidateEntry) -> &'static str {
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
            Status::Unsupported => "not what is left",
        }
    }

    /// Which effects gain likelihood beyond chance although the error on the scored cycle does not fall with them; `None` where there are none.
    pub fn gains_without_error(&self) -> Option<String> {
        let before_um = self.base.rmse_heldout_um?;
        let is_so = |own: &&CandidateEntry| {
            let after_um = own.refit.as_ref().and_then(|refit| refit.rmse_heldout_um);
            own.p_familywise <= CHANCE_P && after_um.is_some_and(|after_um| after_um > (1.0 - LEAST_FALL) * before_um)
        };
        let named: Vec<&str> = self.candidates.iter().filter(is_so).map(|own| own.effect.as_str()).collect();
        let verb = if named.len() == 1 { "gains" } else { "gain" };
        (!named.is_empty()).then(|| {
            format!(
                "{} {verb} likelihood, but the error does not fall: correlated noise can make such gains.",
                named.join(", ")
            )
        })
    }
}

/// Effects that cannot be looked for, each reason once, in the order in which reasons come.
pub fn by_reason<'a>(effects: impl Iterator<Item = (&'a str, Option<&'a str>)>) -> Vec<(&'a str, Vec<&'a str>)> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for (effect, refused) in effects {
        let Some(reason) = refused else { continue };
        match reasons.iter_mut().find(|(own, _)| *own == reason) {
            Some((_, effects)) => effects.push(effect),
            None => reasons.push((reason, vec![effect])),
        }
    }
    reasons
}

/// The conclusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Verdict {
    /// Of which kind it is.
    pub kind: VerdictKind,
    /// Effects that are needed, or, of an unexplained misfit, what helps without being enough.
    pub effects: Vec<String>,
    /// Effects that this experiment cannot tell from those.
    pub equivalent: Vec<String>,
    /// In plain words.
    pub sentence: String,
}

/// Kinds of conclusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum VerdictKind {
    /// Effects of the library are needed.
    Missing,
    /// The model explains the data down to the noise.
    None,
    /// It does not, and no effect is claimed: what is named helps most, and is not the cause.
    Unexplained,
}

/// Errors of the base model: of its posterior, as `extend` and `ladder` show them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct BaseErrors {
    /// Root mean square error of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Of the scored cycle.
    pub rmse_heldout_um: Option<f64>,
    /// The noise that errors are measured against, known or estimated, in µm; `None` where it is unknown.
    pub noise_um: Option<f64>,
}

/// Errors of another model: of its best fit with the study's own noise terms, close to those that `extend` finds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Errors {
    /// Root mean square error of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Of the scored cycle.
    pub rmse_heldout_um: Option<f64>,
    /// Total predictive noise of the scored cycle, in µm: root mean square standard deviation of the noise as it was fitted, and of what uncertain parameters
    /// add. Nothing else is in it, so that an error above it is a misfit.
    pub predictive_noise_um: Option<f64>,
}

/// Standing of a candidate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Part of the verdict.
    Claimed,
    /// Cannot be told from what is claimed.
    Equivalent,
    /// Gains, but not enough to be claimed; or helps a model that stays wrong with it.
    Suggestive,
    /// Gains nothing worth a word, or less than what stands in its place.
    Unsupported,
    /// Does not show in this experiment, or cannot be added to this model.
    Invisible,
}

/// One effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CandidateEntry {
    /// Slug.
    pub effect: String,
    /// Standing.
    pub status: Status,
    /// Score in standard deviations, averaged over posterior draws; the largest over what is unidentified at the null.
    pub z: f64,
    /// p of the refit's gain, corrected for the whole search by bootstrap.
    pub p_familywise: f64,
    /// Share of its signature that the base model cannot absorb.
    pub visible_fraction: f64,
    /// Value of its first parameter that the score expects.
    pub expected_parameter: Option<f64>,
    /// The refit; `None` where the effect cannot be added.
    pub refit: Option<Refit>,
    /// Effects of nearly the same shape here.
    pub twins: Vec<String>,
    /// Why it cannot be added, if it cannot.
    pub refused: Option<String>,
}

/// A refit with an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Refit {
    /// Gain in log likelihood over the base, noise estimated anew for both.
    pub gain_nats: f64,
    /// Gain in the log score of future cycles, each predicted from those before it.
    pub heldout_gain_nats: Option<f64>,
    /// The part of it that the last cycle gives.
    pub last_cycle_gain_nats: Option<f64>,
    /// Root mean square error of the scored cycle, as in [`Errors`].
    pub rmse_heldout_um: Option<f64>,
    /// Largest change of the predicted positions against the base's refit, over the noise.
    pub largest_change: f64,
    /// Log Bayes factor over the base; `None` where the refit gains too little to be worth the computation, or cannot come near the best.
    pub log_bayes_factor: Option<f64>,
    /// What it stays below where it is not computed because it cannot come near the best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_bayes_factor_at_most: Option<f64>,
    /// Parameters of the effect.
    pub parameters: Vec<RefitParameter>,
    /// The answers that the posterior gives where it gives more than one, the likelier first; `parameters` is over all of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<Answer>,
}

/// One answer of a posterior that gives several: a part of it, with a valley between it and the rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Answer {
    /// Its share of the posterior.
    pub probability: f64,
    /// Parameters, given that it is this one.
    pub parameters: Vec<RefitParameter>,
}

/// A parameter of a refit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RefitParameter {
    /// Name.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A pair of effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PairEntry {
    /// Slugs.
    pub effects: Vec<String>,
    /// Gain over the base.
    pub gain_nats: f64,
    /// Gain in the log score of future cycles over the base.
    pub heldout_gain_nats: Option<f64>,
}

/// The smallest size of an effect that would have been seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SmallestDetectable {
    /// Slug.
    pub effect: String,
    /// Value of its first parameter; `None` where none inside the prior's range would.
    pub parameter: Option<f64>,
}

/// The noise, as one way of learning shows it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NoiseEstimate {
    /// How it was learnt: `rest records`, `short-lag differences`, `cycle-to-cycle differences` or `restricted maximum likelihood`.
    pub from: String,
    /// Standard deviation of one position, in µm; `None` where the record does not allow it.
    pub sd_um: Option<f64>,
    /// Standard error of it, in µm.
    pub standard_error_um: Option<f64>,
    /// Source, estimate and unit in plain words, and what does not show in it.
    pub text: String,
}

/// Structure that no effect of the library explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct UnexplainedEntry {
    /// `slip`, `vibration`, `backlash`, `cycle-locked`, …
    pub kind: String,
    /// In plain words: what, when, how large.
    pub sentence: String,
    /// Gain in log likelihood over the model that it was looked for in.
    pub gain_nats: f64,
    /// p corrected for all that was looked for.
    pub p_familywise: f64,
    /// Root mean square, in µm.
    pub size_um: f64,
}

/// What no effect of the library explains, all of it together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct DiscrepancyEntry {
    /// Along what it was found: `time`, `cycle_phase`, `time_since_step`, `force` or `position`.
    pub axis: String,
    /// In plain words: what and where.
    pub sentence: String,
    /// Root mean square over the fitted rows, in µm, of what the model's parameters cannot absorb.
    pub size_um: f64,
    /// p corrected for all that was looked for.
    pub p_familywise: f64,
    /// Predictive noise, in µm, beside it: root mean square standard deviation of the learnt noise and of what uncertain parameters add, in the scored
    /// cycle, or where none is in the fitted ones.
    pub predictive_noise_um: f64,
    /// The same when it may come again, at any phase and with either sign.
    pub predictive_noise_with_discrepancy_um: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_named_once_with_all_its_effects() {
        let effects = [("a", Some("no gel")), ("b", None), ("c", Some("no force")), ("d", Some("no gel"))];
        assert_eq!(by_reason(effects.into_iter()), [("no gel", vec!["a", "d"]), ("no force", vec!["c"])]);
    }
}

//! Document of `extend` (formats §5, `vitreo-uq/extension/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::RefitParameter;
use super::errors::ModelErrors;
use super::posterior::{ModelSummary, ParameterSummary, Warning};
use super::trust::Trust;

/// Body of `vitreo-uq/extension/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExtensionSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The new revision.
    pub revision: String,
    /// The extended revision.
    pub from: String,
    /// The added effects.
    pub effects: Vec<String>,
    /// The whole extended model.
    pub model: ModelSummary,
    /// Cycles that both models were fitted to.
    pub fitted_cycles: Vec<u32>,
    /// Held-out cycles that both models are scored on.
    pub heldout_cycles: Vec<u32>,
    /// Noise that errors are compared with, in µm.
    pub noise_um: Option<f64>,
    /// Errors of the model without the added effects.
    pub before: ModelErrors,
    /// Errors of the model with the added effects.
    pub after: ModelErrors,
    /// Posterior of the extended model's parameters.
    pub parameters: Vec<ParameterSummary>,
    /// True if both posteriors have converged.
    pub converged: bool,
    /// Modes of the posterior that differ in a parameter of the added effects, the most probable first; empty for a single mode.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<ExtensionMode>,
    /// Effects that the diagnoses could not distinguish from the added effects and from those of earlier revisions.
    #[serde(default)]
    pub equivalents: Vec<EquivalentEffects>,
    /// Summary of the figures, as a sentence.
    pub sentence: String,
    /// Trust in the extended model, with the reason.
    #[serde(default)]
    pub trust: Trust,
    /// Warnings on the extended model.
    pub warnings: Vec<Warning>,
}

/// One of several modes of a posterior, separated from the others by a valley.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExtensionMode {
    /// The parameter that the modes differ in.
    pub parameter: String,
    /// Share of the posterior in this mode.
    pub probability: f64,
    /// Mean of the parameter within this mode.
    pub mean: f64,
    /// 5 % quantile within this mode.
    pub q05: f64,
    /// 95 % quantile within this mode.
    pub q95: f64,
}

/// Effects of a model, with the equivalent effects that the preceding diagnosis reported.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentEffects {
    /// The revision that added the effects.
    pub revision: String,
    /// The added effects.
    pub effects: Vec<String>,
    /// Equivalent effects that may replace the added effects, or one of them if several were added; empty if there are none.
    pub rivals: Vec<String>,
    /// The revision whose diagnosis reports the rivals. `None` if no diagnosis claimed the effects before, so that their rivals were not tested.
    pub diagnosis_of: Option<String>,
    /// Refits by the diagnosis for every effect, then for every rival; empty without a rival.
    pub refits: Vec<EquivalentRefit>,
}

/// Refit with one of several equivalent effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentRefit {
    /// Slug of the effect.
    pub effect: String,
    /// Root mean square error on the scored cycle, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Parameters of the effect.
    pub parameters: Vec<RefitParameter>,
}

impl EquivalentEffects {
    /// Text "or: a, b" beside the effects' names; `None` without rivals.
    pub fn alternative(&self) -> Option<String> {
        (!self.rivals.is_empty()).then(|| format!("or: {}", self.rivals.join(", ")))
    }

    /// Sentence on the effects' rivals; `None` if the diagnosis found no rival.
    pub fn sentence(&self) -> Option<String> {
        let names = self.effects.join(" and ");
        match &self.diagnosis_of {
            None => Some(format!(
                "The rivals of {names} were not tested: no diagnosis claimed it before {} added it.",
                self.revision
            )),
            Some(_) if self.rivals.is_empty() => None,
            Some(diagnosed) => {
                let which = if self.effects.len() > 1 { "one of " } else { "" };
                let rivals = self.rivals.join(" or ");
                Some(format!("The diagnosis of {diagnosed} cannot tell {which}{names} from {rivals}."))
            }
        }
    }
}

impl ExtensionSummary {
    /// True if the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.converged && self.trust.is_sound()
    }
}

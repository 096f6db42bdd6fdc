//! The document of `extend` (formats §5, `vitreo-uq/extension/1`).

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
    /// The revision that was written.
    pub revision: String,
    /// The revision that was extended.
    pub from: String,
    /// The effects that were added.
    pub effects: Vec<String>,
    /// The whole model.
    pub model: ModelSummary,
    /// Cycles that both models were fitted to.
    pub fitted_cycles: Vec<u32>,
    /// Cycles that both models are scored on.
    pub heldout_cycles: Vec<u32>,
    /// The noise that misfits are measured against, in µm.
    pub noise_um: Option<f64>,
    /// The model without the added effects.
    pub before: ModelErrors,
    /// The model with them.
    pub after: ModelErrors,
    /// Posterior of the extended model's parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Whether both posteriors have converged.
    pub converged: bool,
    /// Answers that the posterior gives for a parameter of the added effects, the likelier first; empty where it gives one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<ExtensionAnswer>,
    /// For the added effects and those of earlier revisions: what their diagnosis could not tell from them.
    #[serde(default)]
    pub equivalents: Vec<EquivalentEffects>,
    /// What the figures say.
    pub sentence: String,
    /// How far the extended model can be trusted, and why.
    #[serde(default)]
    pub trust: Trust,
    /// What the user should know of the extended model.
    pub warnings: Vec<Warning>,
}

/// One of several answers: a part of the posterior, with a valley between it and the rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExtensionAnswer {
    /// The parameter that the answers differ in.
    pub parameter: String,
    /// Share of the posterior.
    pub probability: f64,
    /// Mean of the parameter, given that it is this answer.
    pub mean: f64,
    /// 5 % quantile, likewise.
    pub q05: f64,
    /// 95 % quantile, likewise.
    pub q95: f64,
}

/// Effects of a model, with those that the diagnosis before they were added could not tell from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentEffects {
    /// The revision that added the effects.
    pub revision: String,
    /// The effects that were added.
    pub effects: Vec<String>,
    /// Effects that may stand for them, or for one of them where there are several; empty where there is none.
    pub rivals: Vec<String>,
    /// The revision whose diagnosis says so; `None` where no diagnosis claimed the effects before, so that their rivals were not tested.
    pub diagnosis_of: Option<String>,
    /// Refits of that diagnosis: of every effect, then of every rival. Empty where there is no rival.
    pub refits: Vec<EquivalentRefit>,
}

/// A refit with one of several equivalent effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentRefit {
    /// Slug of the effect.
    pub effect: String,
    /// Root mean square error on the scored cycle, in µm; `None` where none is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Parameters of the effect.
    pub parameters: Vec<RefitParameter>,
}

impl EquivalentEffects {
    /// "or: a, b", as it stands beside the effects' names; `None` without rivals.
    pub fn alternative(&self) -> Option<String> {
        (!self.rivals.is_empty()).then(|| format!("or: {}", self.rivals.join(", ")))
    }

    /// What a reader must know of the effects' names; `None` where the diagnosis found no rival.
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
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.converged && self.trust.is_sound()
    }
}

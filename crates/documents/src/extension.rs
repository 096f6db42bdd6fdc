//! Document of `extend` (formats §5, `vitreo-uq/extension/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::RefitParameter;
use super::errors::ModelErrors;
use super::posterior::{ModelSummary, ParameterSummary, Warning};
use super::trust::Trust;

/// Result of `extend`, which adds effects to a model: body of the JSON document `vitreo-uq/extension/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExtensionSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// Name of the new revision.
    pub revision: String,
    /// Name of the revision that the new one extends.
    pub from: String,
    /// Effects that the new revision adds.
    pub effects: Vec<String>,
    /// The whole extended model, including noise terms.
    pub model: ModelSummary,
    /// Cycles that both models were fitted to.
    pub fitted_cycles: Vec<u32>,
    /// Held-out cycles that both models are scored on.
    pub heldout_cycles: Vec<u32>,
    /// Noise standard deviation that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Errors of the model without the added effects.
    pub before: ModelErrors,
    /// Errors of the model with the added effects.
    pub after: ModelErrors,
    /// Posteriors of the extended model's parameters.
    pub parameters: Vec<ParameterSummary>,
    /// True if the posteriors of the model before and after have both converged.
    pub converged: bool,
    /// Modes (peaks) of the posterior that differ in a parameter of the added effects, the most probable first; empty for a single mode.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<ExtensionMode>,
    /// Effects that the diagnoses could not distinguish from the effects that this or an earlier revision added.
    #[serde(default)]
    pub equivalents: Vec<EquivalentEffects>,
    /// Summary of the comparison as a sentence.
    pub sentence: String,
    /// Trust in the extended model, with the reason.
    #[serde(default)]
    pub trust: Trust,
    /// Warnings on the extended model.
    pub warnings: Vec<Warning>,
}

/// One of several separate modes (peaks) of a posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExtensionMode {
    /// Name of the parameter in which the modes differ.
    pub parameter: String,
    /// Share of the posterior in this mode.
    pub probability: f64,
    /// Mean of the parameter within this mode.
    pub mean: f64,
    /// 5 % quantile of the parameter within this mode.
    pub q05: f64,
    /// 95 % quantile of the parameter within this mode.
    pub q95: f64,
}

/// Effects that a revision added, with the equivalent effects that the diagnosis before it reported.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentEffects {
    /// Name of the revision that added the effects.
    pub revision: String,
    /// Effects that the revision added.
    pub effects: Vec<String>,
    /// Equivalent effects, any of which may replace the added effects, or one of several added effects; empty if there are none.
    pub rivals: Vec<String>,
    /// Name of the revision whose diagnosis reports the equivalent effects. `None` if no diagnosis claimed the added effects, so that equivalents were not
    /// tested.
    pub diagnosis_of: Option<String>,
    /// Results of the diagnosis for the added effects, then for the equivalent effects; empty if there are no equivalent effects.
    pub refits: Vec<EquivalentRefit>,
}

/// Refit of a diagnosis with one of several equivalent effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentRefit {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Root mean square residual of the scored (last held-out) cycle, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Posteriors of the effect's parameters, then of the law's parameters beside it.
    pub parameters: Vec<RefitParameter>,
}

impl EquivalentRefit {
    /// Name of a parameter, with the effect for a parameter of the law.
    pub fn label(&self, parameter: &RefitParameter) -> String {
        if parameter.name.contains('.') {
            parameter.name.clone()
        } else {
            format!("{}, with {}", parameter.name, self.effect)
        }
    }
}

impl EquivalentEffects {
    /// Text "or: a, b" with the equivalent effects, to be shown beside the added effects; `None` if there are none.
    pub fn alternative(&self) -> Option<String> {
        (!self.rivals.is_empty()).then(|| format!("or: {}", self.rivals.join(", ")))
    }

    /// Sentence on the equivalent effects; `None` if the diagnosis found none.
    pub fn sentence(&self) -> Option<String> {
        let names = self.effects.join(" and ");
        match &self.diagnosis_of {
            None => Some(format!(
                "The equivalents of {names} were not tested, because no diagnosis claimed it before {} added it.",
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
    /// True if the draws have converged and the result is not untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.converged && self.trust.is_sound()
    }
}

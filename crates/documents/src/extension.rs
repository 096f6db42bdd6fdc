//! The document of `extend` (formats §5, `vitreo-uq/extension/1`).

use serde::{Deserialize, Serialize};

use super::posterior::{ModelSummary, ParameterSummary, Warning};

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
    pub before: Misfit,
    /// The model with them.
    pub after: Misfit,
    /// Posterior of the extended model's parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Whether both posteriors have converged.
    pub converged: bool,
    /// Answers that the posterior gives for a parameter of the added effects, the likelier first; empty where it gives one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<ExtensionAnswer>,
    /// What the figures say.
    pub sentence: String,
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

/// Root mean square distance of the posterior mean from the positions, by full finite elements, in µm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Misfit {
    /// On the fitted cycles.
    pub rmse_fitted_um: f64,
    /// On the cycle that was held out; `None` if there is none.
    pub rmse_heldout_um: Option<f64>,
}

impl ExtensionSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.converged && !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

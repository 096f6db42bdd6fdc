//! The document of `effects` (formats §5, `vitreo-uq/effects/1`).

use serde::{Deserialize, Serialize};

use super::posterior::ModelSummary;

/// Body of `vitreo-uq/effects/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EffectsSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model that effects would be added to.
    pub model: ModelSummary,
    /// Noise (µm) at which visibility was computed.
    pub noise_um: f64,
    /// The library.
    pub effects: Vec<EffectEntry>,
}

/// One effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EffectEntry {
    /// Name in commands and files.
    pub slug: String,
    /// `load`, `mechanics` or `observation`.
    pub stage: String,
    /// What it adds.
    pub summary: String,
    /// Its equation.
    pub equation: String,
    /// Its parameters.
    pub parameters: Vec<ParameterEntry>,
    /// Share of its signature, in squared units of the white noise, that neither the base model nor the other noise can absorb; the largest over
    /// parameters that mean nothing at the null. `None` where the effect cannot be added.
    pub visible_fraction: Option<f64>,
    /// Standard error with which this experiment would know the first parameter near its null, in that parameter's unit.
    pub standard_error: Option<f64>,
    /// Effects whose visible part has the same shape: to first order only the support's sign tells them apart.
    pub twins: Vec<String>,
    /// Why the effect cannot be added here, if it cannot.
    pub refused: Option<String>,
}

/// One parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterEntry {
    /// Name `slug.name`.
    pub name: String,
    /// Symbol in the equation.
    pub symbol: String,
    /// Unit.
    pub unit: String,
    /// Ends of the support; `None` for an infinite one.
    pub support: [Option<f64>; 2],
    /// Value at which the effect is not there; `None` where the parameter means nothing then.
    pub null: Option<f64>,
    /// Default prior for this experiment.
    pub prior: String,
}

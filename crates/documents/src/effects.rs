//! Document of `effects` (formats §5, `vitreo-uq/effects/1`).

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
    /// Noise standard deviation at which detectability is computed, in µm.
    pub noise_um: f64,
    /// Every effect of the library.
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
    /// The mechanism that the effect adds.
    pub summary: String,
    /// Equation of the effect.
    pub equation: String,
    /// Parameters of the effect.
    pub parameters: Vec<ParameterEntry>,
    /// Share of the effect's signature that neither the base model nor the other noise terms can absorb, in squared units of the white noise. It is the largest
    /// over parameters that are unidentified at the null; `None` if the effect cannot be added.
    pub visible_fraction: Option<f64>,
    /// Standard error of the first parameter near its null in this experiment, in that parameter's unit.
    pub standard_error: Option<f64>,
    /// Effects whose signatures have nearly the same visible part, up to sign and size. To first order, only the sign that a one-sided parameter allows
    /// distinguishes them.
    pub twins: Vec<String>,
    /// Reason why the effect cannot be added here; `None` if it can.
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
    /// Lower and upper end of the support; `None` for an infinite end.
    pub support: [Option<f64>; 2],
    /// Value at which the effect vanishes; `None` if the parameter is unidentified at the null.
    pub null: Option<f64>,
    /// Default prior for this experiment.
    pub prior: String,
}

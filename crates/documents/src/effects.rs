//! Document of `effects` (formats §5, `vitreo-uq/effects/1`).

use serde::{Deserialize, Serialize};

use super::posterior::ModelSummary;

/// Result of `effects`: body of the JSON document `vitreo-uq/effects/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EffectsSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model that effects would be added to.
    pub model: ModelSummary,
    /// Noise standard deviation for which the detectability of effects is computed, in µm.
    pub noise_um: f64,
    /// Every effect of the library.
    pub effects: Vec<EffectEntry>,
}

/// An effect of the library, with its detectability in one experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EffectEntry {
    /// Name of the effect in commands and files.
    pub slug: String,
    /// Stage of the model that the effect changes: `load`, `mechanics` or `observation`.
    pub stage: String,
    /// The mechanism that the effect adds, in words.
    pub summary: String,
    /// Equation of the effect.
    pub equation: String,
    /// Parameters of the effect.
    pub parameters: Vec<ParameterEntry>,
    /// Share (0 to 1) of the effect's squared signature that neither the base model nor the other noise terms can absorb, in units of the white noise. It is
    /// the largest share over the values of parameters that are unidentified at the null. `None` if the effect cannot be added.
    pub visible_fraction: Option<f64>,
    /// Standard error of the effect's first parameter close to its null, in that parameter's unit; `None` if the data do not determine it.
    pub standard_error: Option<f64>,
    /// Other effects whose detectable signature is nearly proportional to that of this effect. The record distinguishes such effects at best by the sign that a
    /// parameter allows.
    pub twins: Vec<String>,
    /// Reason why the effect cannot be added to the model; `None` if it can.
    pub refused: Option<String>,
}

/// One parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterEntry {
    /// Name of the parameter, preceded by the effect's name: `slug.name`.
    pub name: String,
    /// Symbol of the parameter in the effect's equation.
    pub symbol: String,
    /// Unit of the parameter.
    pub unit: String,
    /// Lower and upper end of the parameter's support; `None` for an infinite end.
    pub support: [Option<f64>; 2],
    /// Null, the value at which the effect vanishes; `None` if the parameter has no such value.
    pub null: Option<f64>,
    /// Default prior of the parameter for this experiment.
    pub prior: String,
}

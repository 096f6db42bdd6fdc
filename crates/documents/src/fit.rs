//! The document of `fit` (formats §5, `vitreo-uq/fit/1`).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::posterior::{ModelSummary, Warning};
use super::trust::Trust;

/// Body of `vitreo-uq/fit/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct FitSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model.
    pub model: ModelSummary,
    /// Parameters held at a value, in the unit of their name.
    pub fixed: BTreeMap<String, f64>,
    /// One entry an estimated parameter.
    pub parameters: Vec<FittedParameter>,
    /// Sum of squared residuals, in m².
    pub objective_m2: f64,
    /// Root mean square residual of the fitted positions, in µm: the estimate of the noise.
    pub rmse_um: f64,
    /// Root mean square misfit of the held-out cycles, predicted by the estimate, in µm; `None` where no cycle is held out.
    #[serde(default)]
    pub rmse_heldout_um: Option<f64>,
    /// Positions that were fitted.
    pub fitted_positions: usize,
    /// The noise that the misfit is measured against, in µm.
    pub noise_um: Option<f64>,
    /// Steps tried from the start that led to the estimate.
    pub iterations: usize,
    /// Whether both of the paper's tolerances were met, inside the prior's range.
    pub converged: bool,
    /// Starts that were searched from.
    pub starts: usize,
    /// Starts that led to this same minimum.
    pub starts_agreeing: usize,
    /// Largest distance of the reduced from the full finite-element trajectory at the estimate, over the whole record, in µm; `None`
    /// for an instrument.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// Displacement that the mesh's error makes, in µm; `None` where it is not known.
    pub fe_discretisation_um: Option<f64>,
    /// How far the result can be trusted, and why.
    #[serde(default)]
    pub trust: Trust,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

impl FitSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.trust.is_sound()
    }
}

/// Estimate of one parameter, in the unit of its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct FittedParameter {
    /// Name, with unit.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Standard error by the delta method; `None` where the data do not determine the parameter.
    pub standard_error: Option<f64>,
}

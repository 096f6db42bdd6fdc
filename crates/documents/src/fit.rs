//! Document of `fit` (formats §5, `vitreo-uq/fit/1`).

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
    /// Fixed parameters and their values, each in the unit of its name.
    pub fixed: BTreeMap<String, f64>,
    /// Estimated parameters.
    pub parameters: Vec<FittedParameter>,
    /// Sum of squared residuals, in m².
    pub objective_m2: f64,
    /// Root mean square residual of the fitted positions, in µm. It estimates the noise.
    pub rmse_um: f64,
    /// Root mean square residual of the held-out cycles, predicted with the estimate, in µm; `None` if no cycle is held out.
    #[serde(default)]
    pub rmse_heldout_um: Option<f64>,
    /// Number of fitted positions.
    pub fitted_positions: usize,
    /// Noise that the residual is compared with, in µm.
    pub noise_um: Option<f64>,
    /// Number of steps tried from the start that led to the estimate.
    pub iterations: usize,
    /// True if both of the paper's tolerances are met inside the prior's range.
    pub converged: bool,
    /// Number of starts.
    pub starts: usize,
    /// Number of starts that led to this minimum.
    pub starts_agreeing: usize,
    /// Largest distance of the surrogate from the full-order trajectory at the estimate, over the whole record, in µm; `None` for an instrument.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// Error of the displacement due to the mesh, in µm; `None` if it is unknown.
    pub fe_discretisation_um: Option<f64>,
    /// Trust in the result, with the reason.
    #[serde(default)]
    pub trust: Trust,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl FitSummary {
    /// True if the result is sound (exit code 0).
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

//! Document of `fit` (formats §5, `vitreo-uq/fit/1`).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::posterior::{ModelSummary, Warning};
use super::trust::Trust;

/// Result of `fit`: body of the JSON document `vitreo-uq/fit/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct FitSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The fitted model.
    pub model: ModelSummary,
    /// Fixed parameters and their values. Each name contains the unit of its value.
    pub fixed: BTreeMap<String, f64>,
    /// Estimated parameters.
    pub parameters: Vec<FittedParameter>,
    /// Sum of squared residuals at the estimate, in m². The fit minimises it.
    pub objective_m2: f64,
    /// Root mean square residual of the fitted positions, in µm. It estimates the noise standard deviation.
    pub rmse_um: f64,
    /// Root mean square residual of the held-out cycles, predicted with the estimate, in µm; `None` if no cycle is held out.
    #[serde(default)]
    pub rmse_heldout_um: Option<f64>,
    /// Number of fitted positions.
    pub fitted_positions: usize,
    /// Noise standard deviation that the residuals are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Number of optimisation steps tried from the starting point that led to the estimate.
    pub iterations: usize,
    /// True if the paper's two tolerances are met and the estimate lies inside the prior's range.
    pub converged: bool,
    /// Number of starting points of the optimisation.
    pub starts: usize,
    /// Number of starting points from which the optimisation reached the estimate.
    pub starts_agreeing: usize,
    /// Largest distance of the surrogate from the full-order trajectory at the estimate, over the whole record, in µm; `None` without finite elements.
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
    /// True unless the result is untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.trust.is_sound()
    }
}

/// Estimate of one parameter with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct FittedParameter {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Estimate, in the unit of the parameter's name.
    pub value: f64,
    /// Standard error by the delta method; `None` if the data do not determine the parameter.
    pub standard_error: Option<f64>,
}

//! Errors of a model's predicted positions, shared by several documents.

use serde::{Deserialize, Serialize};

/// Root mean square residuals of a model, in µm.
///
/// The prediction of a sampled model is its posterior mean, computed with the full-order model. The prediction of any other model is its best fit (formats §4).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ModelErrors {
    /// Root mean square residual of the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square residual of the last held-out cycle, which no fit uses, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
}

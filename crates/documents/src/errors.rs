//! Errors of a model, shared by several documents.

use serde::{Deserialize, Serialize};

/// Root mean square distance (µm) of a model's prediction from the positions.
///
/// The prediction of a sampled revision is the posterior mean of the full-order model. The prediction of a model that is not sampled is its best fit (formats
/// §4).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ModelErrors {
    /// Error on the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Error on the last held-out cycle, which no fit uses, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
}

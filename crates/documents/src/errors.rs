//! Errors of a model, which several documents share.

use serde::{Deserialize, Serialize};

/// Root mean square distance (µm) of a model's prediction from the positions.
///
/// Of a revision the prediction is the posterior mean, by full finite elements; of a model that was not sampled it is that of its best fit (formats §4).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ModelErrors {
    /// On the fitted cycles.
    pub rmse_fitted_um: f64,
    /// On the last held-out cycle, which no fit has seen; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
}

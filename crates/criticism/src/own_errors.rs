//! Errors of a model as `extend` and `ladder` show them: fitted with the noise terms that it is written with, over every position.

use base::error::Result;
use documents::errors::ModelErrors;

use super::refit::Refitted;
use super::{Search, Subject};

/// Errors (µm) of the best fit of a model with the noise terms that the base model is written with, and no others, from the fit of a search; of its posterior mean they are close to those.
/// `subject` has every position, those that a search leaves out as outliers too.
///
/// # Errors
/// As [`Subject::fit`].
pub fn own_errors(subject: &Subject, model: &Refitted) -> Result<ModelErrors> {
    let subject = subject.clone().with_own_noise();
    let start = (model.fitted.theta.clone(), model.fitted.noise);
    let fitted = subject.fit(&model.candidate, &[start], Search::Local)?;
    let um = |positions_m: &[Option<f64>]| fitted.rmse_m(positions_m).map(|rmse_m| 1e6 * rmse_m);
    Ok(ModelErrors { rmse_fitted_um: um(&subject.fitted_m).unwrap_or(0.0), rmse_heldout_um: um(&subject.scored_m) })
}

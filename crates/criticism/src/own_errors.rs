//! Fit and errors of a model as the commands `extend` and `ladder` show them. The fit uses the noise terms of the specification, and the errors cover every position.

use base::error::Result;
use documents::errors::ModelErrors;

use super::refit::Refitted;
use super::{Fitted, Search, Subject};

/// Returns the errors (µm) of a model's best fit with only the noise terms of the base's specification. The fit starts from the model's fit in a search. The errors are close to
/// those of the model's posterior mean. `subject` has every position, also those that a search excludes as outliers.
///
/// # Errors
/// Errors of [`Subject::fit`].
pub fn own_errors(subject: &Subject, model: &Refitted) -> Result<ModelErrors> {
    let (subject, fitted) = own_fit(subject, model)?;
    let um = |positions_m: &[Option<f64>]| fitted.rmse_m(positions_m).map(|rmse_m| 1e6 * rmse_m);
    Ok(ModelErrors { rmse_fitted_um: um(&subject.fitted_m).unwrap_or(0.0), rmse_heldout_um: um(&subject.scored_m) })
}

/// Best fit of a model with only the noise terms of the base's specification, and the subject with this noise.
///
/// # Errors
/// Errors of [`Subject::fit`].
pub fn own_fit(subject: &Subject, model: &Refitted) -> Result<(Subject, Fitted)> {
    let subject = subject.clone().with_specified_noise();
    let start = (model.fitted.theta.clone(), model.fitted.noise);
    let fitted = subject.fit(&model.candidate, &[start], Search::Local)?;
    Ok((subject, fitted))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseValues;
    use crate::test_replica::{base_fit, simulated};

    /// Errors follow their definition for any prediction. If a scored position moves by d in either direction, the sum of the two mean squares increases by 2d²/n, and
    /// the fitted errors stay unchanged. The search weights rows by slow noise, which the specified noise lacks. So the fit with the specified noise is closer to the
    /// fitted positions.
    #[test]
    fn errors_are_root_mean_squares_of_the_own_fit() {
        let (base, fitted) = base_fit();
        let data = simulated(&base, &fitted.theta, &NoiseValues::new([4.0, 8.0, 1.0, 0.01, 1.0]), 12);
        let of_search = data.fit(&base, &[], Search::Wide).expect("fits");
        let search_um = 1e6 * of_search.rmse_m(&data.fitted_m).expect("fitted");
        let model = Refitted::at(&data, base, of_search).expect("a model");
        let moved = |by_um: f64| {
            let mut position_m: Vec<f64> =
                data.fitted_m.iter().zip(&data.scored_m).map(|(a, b)| a.or(*b).unwrap_or(0.0)).collect();
            let row = data.scored_m.iter().rposition(Option::is_some).expect("scored");
            position_m[row] += 1e-6 * by_um;
            own_errors(&data.with_positions(&position_m), &model).expect("fits")
        };
        let [left, still, right] = [-300.0, 0.0, 300.0].map(moved);
        let square = |errors: ModelErrors| errors.rmse_heldout_um.expect("scored").powi(2);
        let n = data.scored_m.iter().flatten().count() as f64;
        let added = n * (square(left) + square(right) - 2.0 * square(still)) / (2.0 * 300.0 * 300.0);
        assert!((added - 1.0).abs() < 1e-9, "{added}");
        assert_eq!((left.rmse_fitted_um, right.rmse_fitted_um), (still.rmse_fitted_um, still.rmse_fitted_um));
        assert!(still.rmse_fitted_um < search_um - 0.001, "{} {search_um}", still.rmse_fitted_um);
    }
}

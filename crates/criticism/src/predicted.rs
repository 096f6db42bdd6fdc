//! First-order predictions of a model at its fit: parameters and positions.

use super::refit::Refitted;
use super::tangent::Tangent;
use super::{Candidate, Fitted, Free, Subject};
use base::error::Result;
use documents::diagnosis::RefitParameter;
use nalgebra::{DMatrix, DVector};

/// 95 % quantile of a standard normal distribution; its negative is the 5 % quantile.
const Q95: f64 = 1.644_853_626_951_472_2;

/// Predictive noise (µm) of a model: the fitted noise plus the uncertainty of the parameters, as a root mean square over the rows that have a position.
pub(super) fn predictive_noise_um(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    positions_m: &[Option<f64>],
) -> Option<f64> {
    noise_um(subject, (candidate, fitted), positions_m, f64::INFINITY)
}

/// Largest root mean square residual (µm) allowed for a claim over the rows that have a position: its predictive noise. If the noise is given, the variance from row to
/// row is at most twice the given variance: white and slow noise of this size each. The limit is needed because a learnt noise may contain a misfit.
pub fn allowed_noise_um(
    subject: &Subject,
    (candidate, fitted): (&Candidate, &Fitted),
    positions_m: &[Option<f64>],
) -> Option<f64> {
    let given_m = if subject.is_noise_known() { subject.reference_noise_m() } else { f64::INFINITY };
    noise_um(subject, (candidate, fitted), positions_m, 2.0 * given_m * given_m)
}

/// Error of a claim on the scored cycle, divided by its allowed predictive noise; `None` if no cycle is scored.
pub fn error_over_predicted_noise(subject: &Subject, model: (&Candidate, &Fitted)) -> Option<f64> {
    let error_m = model.1.rmse_m(&subject.scored_m)?;
    Some(1e6 * error_m / allowed_noise_um(subject, model, &subject.scored_m)?)
}

/// Error of a model on the scored cycle, divided by the error expected from white noise and the uncertainty of its parameters. `sample` makes this prediction by default.
/// The white noise is the known or estimated noise, or the root mean square residual of the fitted cycles if that is larger. `None` if no cycle is scored.
pub fn error_over_white_noise(subject: &Subject, model: (&Candidate, &Fitted)) -> Option<f64> {
    let (candidate, fitted) = model;
    let error_m = fitted.rmse_m(&subject.scored_m)?;
    let (white, noise_m) = with_white_noise(subject, fitted)?;
    let of_parameters_um = noise_um(subject, (candidate, &white), &subject.scored_m, 0.0)?;
    Some(1e6 * error_m / of_parameters_um.hypot(1e6 * noise_m))
}

/// A fit with white noise in place of the learnt noise, and the white noise (m) of its positions. `None` if no row is fitted.
fn with_white_noise(subject: &Subject, fitted: &Fitted) -> Option<(Fitted, f64)> {
    let noise_m = subject.reference_noise_m().max(fitted.rmse_m(&subject.fitted_m)?);
    Some((Fitted { noise: subject.noise_prior().white().map(f64::exp), ..fitted.clone() }, noise_m))
}

/// Distance of the scored positions from a model's prediction, per position: √(rᵀΣ⁻¹r/n) with the covariance Σ of white noise and of the uncertain parameters. It is about 1 for a
/// model that is right, however uncertain its parameters are. The white noise is that of [`error_over_white_noise`]. `None` if no cycle is scored.
pub fn distance_from_prediction(subject: &Subject, (candidate, fitted): (&Candidate, &Fitted)) -> Option<f64> {
    let (white, noise_m) = with_white_noise(subject, fitted)?;
    let factor = Tangent::new(subject, candidate, &white).ok()?.position_factor_m(subject, candidate, &white).ok()?;
    let rows = subject.scored_m.iter().zip(&fitted.position_m).zip(&factor);
    let of_scored = rows.filter_map(|((y, x), factor)| Some(((y.as_ref()? - x) / noise_m, factor / noise_m)));
    let (mut n, mut squares) = (0, 0.0);
    let (mut slope, mut curvature) =
        (DVector::zeros(factor[0].len()), DMatrix::identity(factor[0].len(), factor[0].len()));
    for (residual, factor) in of_scored {
        n += 1;
        squares += residual * residual;
        slope += residual * &factor;
        curvature += &factor * factor.transpose();
    }
    let absorbed = curvature.cholesky()?.solve(&slope).dot(&slope);
    Some(((squares - absorbed) / f64::from(n)).sqrt()).filter(|distance| distance.is_finite())
}

/// Predictive noise (µm) whose variance from row to row is limited to `most_m2` (m²).
fn noise_um(
    subject: &Subject,
    (candidate, fitted): (&Candidate, &Fitted),
    positions_m: &[Option<f64>],
    most_m2: f64,
) -> Option<f64> {
    let record = &subject.experiment().record;
    let tangent = Tangent::new(subject, candidate, fitted).ok()?;
    let of_parameters_m2 = tangent.position_variance_m2(subject, candidate, fitted).ok()?;
    let recordings = subject.problem().recordings();
    let of_noise_m = subject.noise().marginal_sd_m(&record.time_s, &recordings, &fitted.position_m, &fitted.noise);
    let of_rows_m2 = (1e-6 * subject.noise().row_sd_um(&fitted.noise)).powi(2);
    let excess_m2 = (of_rows_m2 - most_m2).max(0.0);
    let variances_m2 = of_parameters_m2.iter().zip(&of_noise_m).map(|(variance, sd)| variance + sd * sd - excess_m2);
    let of_rows: Vec<f64> =
        positions_m.iter().zip(variances_m2).filter_map(|(y, variance)| y.map(|_| variance)).collect();
    (!of_rows.is_empty()).then(|| 1e6 * (of_rows.iter().sum::<f64>() / of_rows.len() as f64).sqrt())
}

/// Parameters of a model with intervals from a normal approximation around its fit.
pub(super) fn laplace(subject: &Subject, model: &Refitted) -> Result<Vec<RefitParameter>> {
    let tangent = Tangent::new(subject, &model.candidate, &model.fitted)?;
    let sds = tangent.standard_deviations();
    let parameter = |(k, free): (usize, &Free)| {
        let theta = model.fitted.theta[k];
        let at = |sds_away: f64| free.value(free.clamped(theta + sds_away * sds[k]));
        RefitParameter { name: free.name.into(), mean: free.value(theta), q05: at(-Q95), q95: at(Q95) }
    };
    Ok(model.candidate.free.iter().enumerate().map(parameter).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_replica::{base_fit, replica};

    /// Dense algebra with the covariance of all scored rows, from central differences of the law and normal equations with prior rows.
    #[test]
    fn distance_is_that_of_the_dense_covariance() {
        let (candidate, fitted) = base_fit();
        let subject = replica();
        let noise_m = subject.reference_noise_m().max(fitted.rmse_m(&subject.fitted_m).expect("fitted rows"));
        let column = |k: usize| -> Vec<f64> {
            let moved = |by: f64| {
                let mut theta = fitted.theta.clone();
                theta[k] += by;
                subject.trajectory_m(&candidate, &theta).expect("a model")
            };
            moved(1e-4).iter().zip(moved(-1e-4)).map(|(up, down)| (up - down) / 2e-4).collect()
        };
        let columns: Vec<Vec<f64>> = (0..candidate.free.len()).map(column).collect();
        let rows_of = |positions_m: &[Option<f64>]| -> Vec<usize> {
            (0..positions_m.len()).filter(|row| positions_m[*row].is_some()).collect()
        };
        let derivatives = |rows: &[usize]| DMatrix::from_fn(rows.len(), columns.len(), |i, k| columns[k][rows[i]]);
        let of_fitted = derivatives(&rows_of(&subject.fitted_m));
        let white_m = subject.noise_prior().white().map(f64::exp)[0] * 1e-6;
        let priors = candidate.free.iter().map(|free| free.prior.map_or(0.0, |(_, sd)| 1.0 / (sd * sd))).collect();
        let precision = of_fitted.transpose() * &of_fitted / (white_m * white_m)
            + DMatrix::from_diagonal(&DVector::from_vec(priors));
        let scored = rows_of(&subject.scored_m);
        let of_scored = derivatives(&scored);
        let covariance = DMatrix::identity(scored.len(), scored.len()) * (noise_m * noise_m)
            + &of_scored * precision.try_inverse().expect("regular") * of_scored.transpose();
        let residual = DVector::from_fn(scored.len(), |i, _| {
            subject.scored_m[scored[i]].expect("a position") - fitted.position_m[scored[i]]
        });
        let solved = covariance.lu().solve(&residual).expect("regular");
        let expected = (solved.dot(&residual) / scored.len() as f64).sqrt();
        let found = distance_from_prediction(subject, (&candidate, &fitted)).expect("a scored cycle");
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} against {expected}");
    }
}

//! What a model at its fit says of parameters and positions to first order.

use super::refit::Refitted;
use super::tangent::Tangent;
use super::{Candidate, Fitted, Free, Subject};
use base::error::Result;
use documents::diagnosis::RefitParameter;

/// 5 % and 95 % quantiles of a normal, in standard deviations.
const Q95: f64 = 1.644_853_626_951_472_2;

/// Total predictive noise (µm) of a model over the rows that have a position: the noise as it was fitted, and what uncertain parameters add.
pub(super) fn predictive_noise_um(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    positions_m: &[Option<f64>],
) -> Option<f64> {
    let record = &subject.experiment().record;
    let tangent = Tangent::new(subject, candidate, fitted).ok()?;
    let of_parameters_m2 = tangent.position_variance_m2(subject, candidate, fitted).ok()?;
    let of_noise_m = subject.noise().marginal_sd_m(&record.time_s, &record.cycle, &fitted.position_m, &fitted.noise);
    let variances_m2 = of_parameters_m2.iter().zip(&of_noise_m).map(|(variance, sd)| variance + sd * sd);
    let of_rows: Vec<f64> =
        positions_m.iter().zip(variances_m2).filter_map(|(y, variance)| y.map(|_| variance)).collect();
    (!of_rows.is_empty()).then(|| 1e6 * (of_rows.iter().sum::<f64>() / of_rows.len() as f64).sqrt())
}

/// Normal approximation of the free parameters at a fit.
pub(super) fn laplace(subject: &Subject, model: &Refitted) -> Result<Vec<RefitParameter>> {
    let tangent = Tangent::new(subject, &model.candidate, &model.fitted)?;
    let sds = tangent.standard_deviations();
    let parameter = |(k, free): (usize, &Free)| {
        let theta = model.fitted.theta[k];
        let at = |sds_away: f64| free.coordinate.value(free.clamped(theta + sds_away * sds[k]));
        RefitParameter { name: free.name.into(), mean: free.coordinate.value(theta), q05: at(-Q95), q95: at(Q95) }
    };
    Ok(model.candidate.free.iter().enumerate().map(parameter).collect())
}

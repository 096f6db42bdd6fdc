//! Restricted maximum likelihood. The parameters of the mean are integrated out, so that the noise estimate includes the part that they absorb.
//!
//! L⁻¹ whitens the noise of the positions y, and f are the model's positions. The residuals are r = L⁻¹(y − f), and A = L⁻¹∂f/∂θ has additional rows for the law's
//! priors. The integral over θ of the likelihood around a fit is ln p(y | θ̂) + ½‖r_A‖² − ½ ln det AᵀA, up to a constant. The part of r that A absorbs is r_A = AA⁺r.

use nalgebra::{DMatrix, DVector};

use super::{NoiseEstimateSd, RestrictedSpread};
use crate::NoiseValues;
use crate::derivatives::columns_m;
use crate::noise_fit::{LogNoise, Objective, climb, natural};
use crate::{Candidate, Fitted, Subject};
use base::error::Result;

/// Step of the finite differences that give the curvature, in logarithms of the noise parameters.
const DIFFERENCE: f64 = 0.15;

/// Parameters of the mean around a fit, which absorb a part of the noise.
pub(super) struct Absorbed<'a> {
    subject: &'a Subject,
    position_m: &'a [f64],
    /// Derivatives of the position and, last, the residuals (m); one value per row of the record.
    columns_m: Vec<Vec<f64>>,
    /// For each coordinate, the precision of its prior, and the prior's pull at the fit: precision times (mean − fit).
    prior: Vec<(f64, f64)>,
}

impl<'a> Absorbed<'a> {
    pub fn new(subject: &'a Subject, candidate: &Candidate, fitted: &'a Fitted) -> Result<Self> {
        let mut columns_m = columns_m(subject, candidate, &fitted.theta)?;
        let pairs = subject.fitted_m.iter().zip(&fitted.position_m);
        columns_m.push(pairs.map(|(y, x)| y.map_or(0.0, |y| y - x)).collect());
        let mut prior = vec![(0.0, 0.0); columns_m.len() - 1];
        for (k, free) in candidate.free.iter().enumerate() {
            if let Some((mean, sd)) = free.prior {
                prior[k] = (1.0 / (sd * sd), (mean - fitted.theta[k]) / (sd * sd));
            }
        }
        Ok(Self { subject, position_m: &fitted.position_m, columns_m, prior })
    }

    /// Change of the log likelihood (nats) at the fit because the mean's parameters are integrated out. The noise parameters are in their units.
    pub fn correction(&self, noise: &NoiseValues) -> f64 {
        let white = self.subject.fitted.whiten(&self.columns_m, self.position_m, noise);
        let Some((residual, columns)) = white.split_last() else { return 0.0 };
        let n = columns.len();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut precision = DMatrix::from_fn(n, n, |i, j| dot(&columns[i], &columns[j]));
        let mut pull = DVector::from_fn(n, |i, _| dot(&columns[i], residual));
        for (k, (weight, towards)) in self.prior.iter().enumerate() {
            precision[(k, k)] += weight;
            pull[k] += towards;
        }
        // The matrix is scaled to a unit diagonal, so that units cost no digits. An invisible effect adds nothing.
        let scale: Vec<f64> = precision.diagonal().iter().map(|d| d.max(f64::MIN_POSITIVE).sqrt()).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| precision[(i, j)] / (scale[i] * scale[j]));
        let pull = DVector::from_fn(n, |i, _| pull[i] / scale[i]);
        let Some(factor) = scaled.cholesky() else { return f64::NEG_INFINITY };
        let ln_det: f64 = factor.l_dirty().diagonal().iter().zip(&scale).map(|(l, s)| 2.0 * (l * s).ln()).sum();
        0.5 * pull.dot(&factor.solve(&pull)) - 0.5 * ln_det
    }
}

/// Learns the noise that maximises the restricted likelihood, with the noise prior of every fit.
///
/// # Errors
/// Errors of the candidate's derivatives at its fit.
pub(super) fn learn(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<RestrictedSpread> {
    let absorbed = Absorbed::new(subject, candidate, fitted)?;
    let prior = subject.noise_prior();
    let likelihood = Objective::new(&subject.fitted, &prior, &fitted.position_m);
    let objective = |points: &[LogNoise]| -> Vec<f64> {
        let values = likelihood.evaluate(points);
        points.iter().zip(values).map(|(point, value)| value + absorbed.correction(&natural(point))).collect()
    };
    let (log_noise, _) = climb(&objective, &prior, &[fitted.noise.map(f64::ln)], 0.1);
    let noise = natural(&log_noise);
    let of_rows = prior.of_rows();
    let sds_um = of_rows.iter().filter(|(_, is_sd)| *is_sd).map(|(place, _)| noise[*place]);
    let sd_um = sds_um.reduce(f64::hypot).unwrap_or(0.0);
    // Derivative of the logarithm of one row's standard deviation: each parameter's fraction of the variance.
    let slope = |(place, is_sd): &(usize, bool)| (*place, if *is_sd { (noise[*place] / sd_um).powi(2) } else { 0.0 });
    let slopes: Vec<(usize, f64)> = of_rows.iter().map(slope).collect();
    let relative_error = relative_error(&objective, &log_noise, &slopes);
    Ok(RestrictedSpread {
        row: NoiseEstimateSd { sd_m: 1e-6 * sd_um, standard_error_m: 1e-6 * sd_um * relative_error },
        model: subject.noise(),
        noise,
    })
}

/// Standard error of a function of the noise parameters. `slopes` has, for each parameter's index, the function's slope with respect to the parameter's logarithm. The
/// covariance follows from the curvature of the objective at its maximum `top`.
fn relative_error(objective: &dyn Fn(&[LogNoise]) -> Vec<f64>, top: &LogNoise, slopes: &[(usize, f64)]) -> f64 {
    let n = slopes.len();
    let moved = |steps: &[(usize, f64)]| {
        let mut point = *top;
        steps.iter().for_each(|(index, sign)| point[slopes[*index].0] += sign * DIFFERENCE);
        point
    };
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    let mut points = vec![*top];
    for i in 0..n {
        points.extend([moved(&[(i, 1.0)]), moved(&[(i, -1.0)])]);
    }
    for (i, j) in &pairs {
        for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            points.push(moved(&[(*i, a), (*j, b)]));
        }
    }
    let values = objective(&points);
    let over = DIFFERENCE * DIFFERENCE;
    let mut curvature = DMatrix::zeros(n, n);
    for i in 0..n {
        curvature[(i, i)] = (2.0 * values[0] - values[1 + 2 * i] - values[2 + 2 * i]) / over;
    }
    for (at, (i, j)) in values[1 + 2 * n..].chunks(4).zip(pairs) {
        curvature[(i, j)] = -(at[0] - at[1] - at[2] + at[3]) / (4.0 * over);
        curvature[(j, i)] = curvature[(i, j)];
    }
    // The data do not determine the correlation time of a negligible process. Directions without curvature get a variance of order one, like their prior.
    let eigen = curvature.symmetric_eigen();
    let slope = DVector::from_iterator(n, slopes.iter().map(|(_, slope)| *slope));
    let variance: f64 =
        (0..n).map(|k| eigen.eigenvectors.column(k).dot(&slope).powi(2) / eigen.eigenvalues[k].max(1.0)).sum();
    variance.sqrt()
}

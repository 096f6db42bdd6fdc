//! Least-squares fit of an external program's parameters to data and prior, which locates the region of the data.

use std::sync::{Mutex, PoisonError};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::outside::ExternalModel;
use crate::problem::{Problem, TAIL_MASS};
use base::error::{Error, Result};
use sampling::least_squares::{Fit, LeastSquaresProblem, Tolerances, fit};

/// Prior probability beyond the range of the starts, at either end.
const START_TAIL: f64 = 0.05;
/// Number of starts per free parameter at which the program is evaluated. The fit continues from the best start.
const STARTS_PER_PARAMETER: u32 = 8;
/// Seed of the scrambled Sobol sequence of starts. It is fixed, because the starts are part of the method.
const START_SEED: u32 = 7;
/// Distance, in the logarithm, that a parameter keeps from the ends of its prior's range, because of rounding.
const ROUNDING: f64 = 1e-9;
/// Step in a parameter's logarithm for finite differences.
const STEP: f64 = 1e-3;
/// Tolerances of the search: a hundredth of the rounding of a parameter box, so that they do not change the box.
const TOLERANCES: Tolerances = Tolerances { objective: 1e-3, parameters: 1e-3, max_iterations: 40 };

/// Largest number of successive fits. Each fit uses the residual of the previous fit as noise.
const ROUNDS: usize = 4;
/// Relative change of the noise between two fits below which no further fit follows.
const SAME_NOISE: f64 = 0.1;
/// Largest number of times that the distance from the best fit to an end of a parameter box is shortened.
const SHORTENINGS: i32 = 16;
/// Factor of each shortening of the distance from the best fit to an end of a parameter box.
const SHORTER: f64 = 0.75;
/// Largest relative increase of the sum of squares at an end of a parameter box, divided by the squared number of standard deviations. The limit is wide, because an
/// added effect may lead to parameters far from the best fit of the base model. At 16 standard deviations, the residuals may be five times as large as at the best fit.
const FAR: f64 = 0.1;

/// Best fit of the external program to data and prior.
#[derive(Debug)]
pub(super) struct DataFit {
    /// Logarithms of the free parameters at the best fit.
    pub ln: Vec<f64>,
    /// Distances in the logarithm, down and up from the best fit, to the ends of each box: `reaches[width][parameter]`. There is one box for every requested width.
    pub reaches: Vec<Vec<[f64; 2]>>,
    /// Residual of the best fit divided by the noise; at least 1.
    pub over_noise: f64,
}

/// Fits the program to the positions of the fitted cycles. The coordinates are logarithms of the parameters with indices `free`. The other parameters have the values
/// of `template`. `widths` are half widths of the requested boxes, in standard deviations.
///
/// # Errors
/// [`Error::Numerical`] with the server's message if the program fails at every start.
pub(super) fn fit_to_data(
    problem: &Problem,
    outside: &ExternalModel,
    template: &[f64],
    free: &[usize],
    noise_m: f64,
    widths: &[f64],
) -> Result<DataFit> {
    let observed = problem.positions_of(&problem.experiment.calibration_cycles);
    let observed: Vec<(usize, f64)> = observed.iter().enumerate().filter_map(|(row, y)| Some((row, (*y)?))).collect();
    let names: Vec<&str> = problem.model.base().parameters().iter().map(|spec| spec.name).collect();
    let quantile = |k: usize, p: f64| problem.range_of(names[k], p).lower.ln();
    let prior = |k: &usize| {
        let range = problem.range_of(names[*k], TAIL_MASS);
        // This keeps the ends inside the range, although their logarithms are rounded.
        let ln_ends = (range.lower.ln() + ROUNDING, range.upper.ln() - ROUNDING);
        Prior { middle: quantile(*k, 0.5), sd: 0.5 * (quantile(*k, 0.8413) - quantile(*k, 0.1587)), ln_ends }
    };
    let priors = free.iter().map(prior).collect();
    let mut distances =
        FitResiduals { problem, outside, template, free, noise_m, observed, priors, refusal: Mutex::default() };
    let sobol = |index: u32| -> Vec<f64> {
        let of = |(d, k): (u32, &usize)| {
            let coordinate = f64::from(sobol_burley::sample(index, d, START_SEED));
            quantile(*k, START_TAIL + (1.0 - 2.0 * START_TAIL) * coordinate)
        };
        (0_u32..).zip(free).map(of).collect()
    };
    let n_starts = STARTS_PER_PARAMETER * u32::try_from(free.len()).unwrap_or(1);
    let medians: Vec<f64> = free.iter().map(|k| quantile(*k, 0.5)).collect();
    let starts: Vec<Vec<f64>> = std::iter::once(medians).chain((0..n_starts).map(sobol)).collect();
    let sums: Vec<Option<f64>> =
        starts.par_iter().map(|start| distances.residuals(start).map(|matrix| matrix.norm_squared())).collect();
    let best = sums.iter().zip(&starts).filter_map(|(sum, start)| Some((sum.filter(|sum| sum.is_finite())?, start)));
    let Some((_, start)) = best.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        let refusal = distances.refusal.into_inner().unwrap_or_else(PoisonError::into_inner);
        return Err(refusal
            .unwrap_or_else(|| Error::numerical("the model has no prediction at any start", "give another prior")));
    };
    // The sampler counts the model's misfit as noise. The noise of this fit is therefore increased to the residual, which gives the prior more weight.
    let mut found = None;
    let mut at: Vec<f64> = start.clone();
    for _ in 0..ROUNDS {
        let misses = distances.residuals(&at).map_or(1.0, |matrix| distances.misfit(matrix.as_slice()));
        let louder = (misses * distances.noise_m).max(noise_m);
        if found.is_some() && (louder / distances.noise_m - 1.0).abs() < SAME_NOISE {
            break;
        }
        distances.noise_m = louder;
        let entry = fit(&distances, &at, &TOLERANCES)?;
        at = entry.theta.clone();
        found = Some(entry);
    }
    let Some(found) = found else { return Err(Error::numerical("the program was not fitted", "give another prior")) };
    let of_width = |n_sd: &f64| -> Vec<[f64; 2]> {
        (0..free.len()).into_par_iter().map(|k| [-n_sd, *n_sd].map(|n_sd| distances.reach(&found, k, n_sd))).collect()
    };
    let reaches = widths.iter().map(of_width).collect();
    Ok(DataFit { reaches, ln: found.theta, over_noise: distances.noise_m / noise_m })
}

/// Prior of a free parameter's logarithm: median and standard deviation.
struct Prior {
    middle: f64,
    sd: f64,
    /// Ends of the prior's range, which leaves the probability [`TAIL_MASS`] on either side.
    ln_ends: (f64, f64),
}

/// Residuals of the fit: distances from the measured positions divided by the noise, then distances from the prior's medians divided by its standard deviations.
struct FitResiduals<'a> {
    problem: &'a Problem,
    outside: &'a ExternalModel,
    template: &'a [f64],
    free: &'a [usize],
    noise_m: f64,
    observed: Vec<(usize, f64)>,
    priors: Vec<Prior>,
    /// First error that the program's server returned during the fit.
    refusal: Mutex<Option<Error>>,
}

impl FitResiduals<'_> {
    /// Root mean square of the residuals of the positions, without the residuals of the prior.
    fn misfit(&self, residuals: &[f64]) -> f64 {
        let n = self.observed.len();
        (residuals.iter().take(n).map(|residual| residual * residual).sum::<f64>() / n.max(1) as f64).sqrt()
    }

    /// Distance, in the logarithm, from the best fit to the end of a box of `n_sd` standard deviations for parameter `k`. The other parameters move along according to
    /// the covariance. The distance is shortened where the sum of squares rises much faster than a parabola.
    fn reach(&self, found: &Fit, k: usize, n_sd: f64) -> f64 {
        let n = found.theta.len();
        let variance = found.objective / self.observed.len().max(1) as f64;
        // If the residuals are below the noise, the noise determines the standard errors.
        let widened = 1.0 / variance.min(1.0).sqrt();
        let step = widened * n_sd * found.standard_errors[k];
        if !step.is_finite() {
            return f64::INFINITY;
        }
        let follows: Vec<f64> = (0..n).map(|j| found.covariance[j * n + k] / found.covariance[k * n + k]).collect();
        let most = found.objective * (1.0 + FAR * n_sd * n_sd);
        let is_near = |step: f64| {
            let moved = |((ln, follows), prior): ((&f64, &f64), &Prior)| {
                (ln + follows * step).clamp(prior.ln_ends.0, prior.ln_ends.1)
            };
            let moved: Vec<f64> = found.theta.iter().zip(&follows).zip(&self.priors).map(moved).collect();
            self.residuals(&moved).is_some_and(|matrix| matrix.norm_squared() <= most)
        };
        let shortened = |times: i32| step * SHORTER.powi(times);
        let near = (0..SHORTENINGS).map(shortened).find(|step| is_near(*step));
        near.unwrap_or(shortened(SHORTENINGS)).abs()
    }
}

impl LeastSquaresProblem for FitResiduals<'_> {
    fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>> {
        let mut parameters = self.template.to_vec();
        self.free.iter().zip(theta).for_each(|(k, ln)| parameters[*k] = ln.exp());
        let is_inside = |(ln, prior): (&f64, &Prior)| (prior.ln_ends.0..=prior.ln_ends.1).contains(ln);
        if !theta.iter().zip(&self.priors).all(is_inside) {
            return None;
        }
        let record = &self.problem.experiment.record;
        let position_m = match self.outside.position_m(&parameters, &record.time_s, record.force()) {
            Ok(position_m) => position_m,
            Err(error) => {
                self.refusal.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                return None;
            }
        };
        let mut left: Vec<f64> = self.observed.iter().map(|(row, y)| (position_m[*row] - y) / self.noise_m).collect();
        if self.problem.experiment.fits_position_offset {
            let mean = left.iter().sum::<f64>() / left.len().max(1) as f64;
            left.iter_mut().for_each(|left| *left -= mean);
        }
        let of_priors = theta.iter().zip(&self.priors).map(|(ln, prior)| (ln - prior.middle) / prior.sd);
        Some(DVector::from_vec(left.into_iter().chain(of_priors).collect()))
    }

    fn jacobian(&self, theta: &[f64]) -> Option<DMatrix<f64>> {
        let here = self.residuals(theta)?;
        let column = |d: usize| {
            // The step is taken downwards if an upward step would leave the prior's range.
            let stepped = |step: f64| {
                let mut moved = theta.to_vec();
                moved[d] += step;
                Some((self.residuals(&moved)? - &here) / step)
            };
            stepped(STEP).or_else(|| stepped(-STEP))
        };
        let columns: Vec<DVector<f64>> = (0..theta.len()).into_par_iter().map(column).collect::<Option<_>>()?;
        (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
    }
}

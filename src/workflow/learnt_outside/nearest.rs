//! Where the data lead the other program's parameters: a least-squares fit by asking, with the prior beside the data.

use std::sync::{Mutex, PoisonError};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::inference::least_squares::{Fit, Residuals, Tolerances, fit};
use crate::workflow::outside::Outside;
use crate::workflow::problem::{Problem, TAIL_MASS};

/// Quantiles between which starts are looked for.
const START_TAIL: f64 = 0.05;
/// Starts for every parameter, of which the best is gone on from.
const STARTS_PER_PARAMETER: u32 = 8;
/// Seed of their scrambled Sobol sequence: the starts are part of the method.
const START_SEED: u32 = 7;
/// Steps of logarithms by which slopes are taken.
const STEP: f64 = 1e-3;
/// Where the search ends: a hundredth of what a box is rounded to.
const TOLERANCES: Tolerances = Tolerances { objective: 1e-3, parameters: 1e-3, max_iterations: 40 };

/// Where the data lead: logarithms of the free parameters, and how well they are known.
#[derive(Debug)]
pub(super) struct Nearest {
    pub ln: Vec<f64>,
    pub ln_sd: Vec<f64>,
}

/// Fits the calibration cycles, over logarithms of the parameters in `free`; others have the values of `template`.
///
/// # Errors
/// [`Error::Numerical`] with the server's words where it has no answer at any start.
pub(super) fn nearest(
    problem: &Problem,
    outside: &Outside,
    template: &[f64],
    free: &[usize],
    noise_m: f64,
) -> Result<Nearest> {
    let observed = problem.positions_of(&problem.experiment.calibration_cycles);
    let observed: Vec<(usize, f64)> = observed.iter().enumerate().filter_map(|(row, y)| Some((row, (*y)?))).collect();
    let names: Vec<&str> = problem.model.base().parameters().iter().map(|spec| spec.name).collect();
    let quantile = |k: usize, p: f64| problem.range_of(names[k], p).lower.ln();
    let priors =
        free.iter().map(|k| (quantile(*k, 0.5), 0.5 * (quantile(*k, 0.8413) - quantile(*k, 0.1587)))).collect();
    let distances =
        Distances { problem, outside, template, free, noise_m, observed, priors, refusal: Mutex::default() };
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
        starts.par_iter().map(|start| distances.residuals(start).map(|own| own.norm_squared())).collect();
    let best = sums.iter().zip(&starts).filter_map(|(sum, start)| Some((sum.filter(|sum| sum.is_finite())?, start)));
    let Some((_, start)) = best.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        let refusal = distances.refusal.into_inner().unwrap_or_else(PoisonError::into_inner);
        return Err(
            refusal.unwrap_or_else(|| Error::numerical("the model has no answer at any start", "give another prior"))
        );
    };
    let Fit { theta, standard_errors, objective, .. } = fit(&distances, start, &TOLERANCES)?;
    let n = distances.observed.len();
    // Errors are those of the noise at least, and larger where the model misses the data by more.
    let misfit = (objective / n.max(1) as f64).sqrt();
    let widened = |sd: &f64| if sd.is_finite() { sd / misfit.min(1.0) } else { f64::INFINITY };
    Ok(Nearest { ln: theta, ln_sd: standard_errors.iter().map(widened).collect() })
}

/// Distances from the measured positions over the noise, then those from the prior's medians over its spread.
struct Distances<'a> {
    problem: &'a Problem,
    outside: &'a Outside,
    template: &'a [f64],
    free: &'a [usize],
    noise_m: f64,
    observed: Vec<(usize, f64)>,
    /// Middle and standard deviation of every free logarithm.
    priors: Vec<(f64, f64)>,
    /// The first refusal.
    refusal: Mutex<Option<Error>>,
}

impl Residuals for Distances<'_> {
    fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>> {
        let mut parameters = self.template.to_vec();
        self.free.iter().zip(theta).for_each(|(k, ln)| parameters[*k] = ln.exp());
        let names = self.problem.model.base().parameters();
        let is_inside = |k: &usize| {
            let range = self.problem.range_of(names[*k].name, TAIL_MASS);
            range.contains(parameters[*k])
        };
        if !self.free.iter().all(is_inside) {
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
        let of_priors = theta.iter().zip(&self.priors).map(|(ln, (middle, sd))| (ln - middle) / sd);
        Some(DVector::from_vec(left.into_iter().chain(of_priors).collect()))
    }

    fn jacobian(&self, theta: &[f64]) -> Option<DMatrix<f64>> {
        let here = self.residuals(theta)?;
        let column = |d: usize| {
            // Away from the end of the prior's range, if it is near.
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

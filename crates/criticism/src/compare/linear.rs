//! Linear fits of bias columns around a model's fit, each with its own estimate of the noise.
//!
//! Near its fit, a model's predicted positions f̂ change linearly to f̂ + A δ: A has the derivatives, δ the changes of the coordinates. Columns C with amplitudes a are added:
//! f̂ + A δ + C a. Noise estimated from residuals that contain the bias described by C would absorb that bias. So δ, a and the noise are fitted together, and the gain of C is
//! a likelihood ratio.

use nalgebra::DVector;

use super::super::derivatives::columns_m;
use super::super::noise_fit::{self, LogNoise, NoisePrior};
use super::super::{Candidate, Fitted, Subject};
use super::normal::{Normal, NormalSolution};
use crate::NoiseValues;
use base::error::{Error, Result};
use posterior::noise::{NoiseLikelihood, ProductRequest};
use posterior::patterns::rows::{ByCycle, Columns};
use sampling::ensemble::RandomStream;

/// A model linearised around its fit.
pub struct Linear {
    noise_prior: NoisePrior,
    /// Predicted positions (m) at the fit, one value per row of the record.
    position_m: Vec<f64>,
    /// Derivatives of the predicted position (m per unit of the coordinate): one column per coordinate.
    derivatives_m: Vec<Vec<f64>>,
    /// For each coordinate's prior: 1/sd, and (mean − fit)/sd; zeros if there is no prior.
    priors: Vec<(f64, f64)>,
    base_noise: LogNoise,
}

/// Joint fit of the model's coordinates, of the amplitudes of additional columns, and of the noise.
#[derive(Debug, Clone)]
pub struct LinearFit {
    /// Log posterior in nats, up to a constant that all fits of one record share.
    pub objective: f64,
    /// Correction (m) of the predicted positions by the fitted coordinates and columns, one value per row of the record.
    pub correction_m: Vec<f64>,
    /// Noise parameters in their units.
    pub noise: NoiseValues,
    log_noise: LogNoise,
}

/// Best coordinates and column amplitudes of a model at given noise parameters.
struct Mean {
    solved: NormalSolution,
    log_noise: LogNoise,
    /// Log posterior in nats, up to the constant of [`LinearFit::objective`].
    objective: f64,
}

impl Linear {
    /// Linearises a candidate around its fit.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the model has no derivatives.
    pub fn new(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Self> {
        let priors = candidate.free.iter().zip(&fitted.theta);
        let prior = |(free, theta): (&crate::Free, &f64)| {
            free.prior.map_or((0.0, 0.0), |(mean, sd)| (1.0 / sd, (mean - theta) / sd))
        };
        let mut priors: Vec<(f64, f64)> = priors.map(prior).collect();
        priors.resize(candidate.dimension(), (0.0, 0.0));
        Ok(Self {
            noise_prior: subject.noise_prior(),
            position_m: fitted.position_m.clone(),
            derivatives_m: columns_m(subject, candidate, &fitted.theta)?,
            priors,
            base_noise: fitted.noise.map(f64::ln),
        })
    }

    /// Predicted positions (m) of the model at its fit, one value per row of the record.
    pub fn position_m(&self) -> &[f64] {
        &self.position_m
    }

    /// Fits the model without additional columns. `residual_m` holds measured minus predicted positions (m), one value per row.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the normal equations have no solution.
    pub fn fit_base(&self, likelihood: &NoiseLikelihood, residual_m: &[f64]) -> Result<LinearFit> {
        let none = Columns::default();
        let mut fits = self.best(likelihood, residual_m, &[&none], &[self.base_noise, self.noise_prior.white()])?;
        fits.pop().ok_or_else(|| no_solution("no start"))
    }

    /// Fits the model with the columns of each test. The fits start from the noise of a fit without columns, and from white noise of the known or estimated size.
    ///
    /// # Errors
    /// Errors of [`Linear::fit_base`].
    pub fn fit_with(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        looks: &[&Columns],
        base: &LinearFit,
    ) -> Result<Vec<LinearFit>> {
        self.best(likelihood, residual_m, looks, &[base.log_noise, self.noise_prior.white()])
    }

    /// Fits each test from the better of the given starts: first the mean position, then the noise, then the mean position again. The fit need not converge, because the
    /// calibration takes exactly the same steps.
    fn best(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        looks: &[&Columns],
        starts: &[LogNoise],
    ) -> Result<Vec<LinearFit>> {
        let mut best: Vec<Mean> = Vec::new();
        for start in starts {
            let means = self.means(likelihood, residual_m, looks, start)?;
            if best.is_empty() {
                best = means;
                continue;
            }
            for (best, mean) in best.iter_mut().zip(means) {
                if mean.objective > best.objective {
                    *best = mean;
                }
            }
        }
        let corrections_m: Vec<Vec<f64>> =
            looks.iter().zip(&best).map(|(look, mean)| self.correction_m(look, &mean.solved)).collect();
        let noises = self.settle(likelihood, residual_m, &best, &corrections_m);
        let mut fits = Vec::with_capacity(looks.len());
        for (((look, mean), correction_m), noise) in looks.iter().zip(best).zip(corrections_m).zip(noises) {
            fits.push(match noise {
                Some(noise) => {
                    let again = self.mean(likelihood, residual_m, look, &noise)?;
                    fit_of(&again, self.correction_m(look, &again.solved))
                }
                None => fit_of(&mean, correction_m),
            });
        }
        Ok(fits)
    }

    /// Re-estimates the noise for each fitted mean position; `None` if the noise does not change. Means with equal initial noise are treated together.
    fn settle(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        means: &[Mean],
        corrections_m: &[Vec<f64>],
    ) -> Vec<Option<LogNoise>> {
        let mut noises = vec![None; means.len()];
        for start in distinct(means) {
            let members: Vec<usize> = (0..means.len()).filter(|k| means[*k].log_noise == start).collect();
            let left =
                |k: &usize| -> Vec<f64> { residual_m.iter().zip(&corrections_m[*k]).map(|(r, c)| r - c).collect() };
            let left_m: Vec<Vec<f64>> = members.iter().map(left).collect();
            let slices: Vec<&[f64]> = left_m.iter().map(Vec::as_slice).collect();
            let settled = noise_fit::settle(likelihood, &self.noise_prior, &self.position_m, &slices, &start);
            members.iter().zip(settled).for_each(|(k, noise)| noises[*k] = noise);
        }
        noises
    }

    /// Returns predicted positions (m) at the model's fit plus a correction. The noise is fitted around them.
    fn moved_m(&self, correction_m: &[f64]) -> Vec<f64> {
        self.position_m.iter().zip(correction_m).map(|(f, correction)| f + correction).collect()
    }

    /// Correction (m) of the predicted positions by the solved amplitudes of derivatives and columns, one value per row of the record.
    fn correction_m(&self, columns: &Columns, solved: &NormalSolution) -> Vec<f64> {
        let mut correction_m = columns.by_cycle.as_ref().map_or_else(
            || vec![0.0; self.position_m.len()],
            |by_cycle| by_cycle.place.iter().map(|place| place.map_or(0.0, |place| solved.of_cycles[place])).collect(),
        );
        for (column, amplitude) in self.derivatives_m.iter().chain(&columns.dense).zip(solved.amplitudes.iter()) {
            correction_m.iter_mut().zip(column).for_each(|(sum, value)| *sum += amplitude * value);
        }
        correction_m
    }

    fn mean(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &Columns,
        log_noise: &LogNoise,
    ) -> Result<Mean> {
        let mut means = self.means(likelihood, residual_m, &[columns], log_noise)?;
        means.pop().ok_or_else(|| no_solution("the test has no columns"))
    }

    /// Best coordinates and column amplitudes of each test at given noise parameters, by generalised least squares.
    fn means(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        looks: &[&Columns],
        log_noise: &LogNoise,
    ) -> Result<Vec<Mean>> {
        let noise = noise_fit::natural(log_noise);
        let n_common = self.derivatives_m.len() + 1;
        let mut columns: Vec<&[f64]> = self.derivatives_m.iter().map(Vec::as_slice).collect();
        columns.push(residual_m);
        let mut ranges = Vec::with_capacity(looks.len());
        for look in looks {
            ranges.push(columns.len()..columns.len() + look.dense.len());
            columns.extend(look.dense.iter().map(Vec::as_slice));
        }
        let with_cycles = looks.iter().position(|look| look.by_cycle.is_some());
        let asked = ProductRequest { columns: &columns, n_common, own: &ranges, with_cycles };
        let products = likelihood
            .white_products(&asked, &self.position_m, &noise)
            .ok_or_else(|| no_solution("a noise parameter is outside its support"))?;
        let of_noise = products.ln_constant + self.noise_prior.ln_density(log_noise);
        let mut cycles = products.cycles;
        let mut means = Vec::with_capacity(looks.len());
        for ((number, look), products) in looks.iter().enumerate().zip(products.sets) {
            // The residuals, which all tests share, follow a test's own columns.
            let n = products.nrows();
            let order: Vec<usize> = (0..n_common - 1).chain(n_common..n).chain(std::iter::once(n_common - 1)).collect();
            let of_cycles = if with_cycles == Some(number) { std::mem::take(&mut cycles) } else { Vec::new() };
            let normal = Normal {
                products: products.select_rows(&order).select_columns(&order),
                cycles: of_cycles.into_iter().map(|cycle| cycle.ordered(&order)).collect(),
                has_column: look.by_cycle.as_ref().map_or(Vec::new(), |by_cycle| by_cycle.has_column.clone()),
                priors: self.priors.clone(),
            };
            let solved = normal.solve().ok_or_else(|| no_solution("the columns contain values that are not finite"))?;
            let pulls = self.priors.iter().zip(solved.amplitudes.iter());
            let of_prior: f64 = pulls.map(|((inverse_sd, pull), step)| -0.5 * (pull - step * inverse_sd).powi(2)).sum();
            let objective = of_noise + of_prior - 0.5 * solved.left;
            means.push(Mean { solved, log_noise: *log_noise, objective });
        }
        Ok(means)
    }

    /// Returns weighted sums (m) of the correction to the predicted positions, with standard errors, under the noise of a fit. Each vector in `weights` has one weight per row.
    ///
    /// # Errors
    /// Errors of [`Linear::fit_base`].
    pub fn weighted_means_m(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &Columns,
        fit: &LinearFit,
        weights: &[Vec<f64>],
    ) -> Result<Vec<(f64, f64)>> {
        let solved = self.mean(likelihood, residual_m, columns, &fit.log_noise)?.solved;
        let of_weights = |weights: &Vec<f64>| {
            let dot = |column: &Vec<f64>| column.iter().zip(weights).map(|(c, w)| c * w).sum::<f64>();
            let all = self.derivatives_m.iter().chain(&columns.dense);
            solved.weighted(&DVector::from_iterator(solved.amplitudes.len(), all.map(dot)))
        };
        Ok(weights.iter().map(of_weights).collect())
    }

    /// Returns the mean correction (m) over the fitted rows of each cycle that has a column, with its standard error.
    ///
    /// # Errors
    /// Errors of [`Linear::fit_base`].
    pub fn cycle_means_m(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        by_cycle: &ByCycle,
        is_fitted: &[bool],
        fit: &LinearFit,
    ) -> Result<Vec<(f64, f64)>> {
        let columns = Columns { dense: Vec::new(), by_cycle: Some(by_cycle.clone()) };
        let solved = self.mean(likelihood, residual_m, &columns, &fit.log_noise)?.solved;
        let n = self.derivatives_m.len();
        let mut sums = vec![(0.0, DVector::zeros(n)); by_cycle.has_column.len()];
        for (row, place) in by_cycle.place.iter().enumerate().filter(|(row, _)| is_fitted[*row]) {
            if let Some((count, sum)) = place.and_then(|place| sums.get_mut(place)) {
                *count += 1.0;
                sum.iter_mut().zip(&self.derivatives_m).for_each(|(sum, column)| *sum += column[row]);
            }
        }
        let in_cycles = solved.in_cycles();
        let with_column = sums.into_iter().zip(&in_cycles).enumerate().filter(|(cycle, _)| by_cycle.has_column[*cycle]);
        let mean = |(cycle, ((count, sum), in_cycle))| solved.weighted_in_cycle(&(sum / count), cycle, in_cycle);
        Ok(with_column.map(mean).collect())
    }

    /// Returns the residuals of a fit at the fitted rows, in order, whitened by the fit's noise.
    pub fn whitened(&self, likelihood: &NoiseLikelihood, residual_m: &[f64], fit: &LinearFit) -> Vec<f64> {
        let left_m: Vec<f64> = residual_m.iter().zip(&fit.correction_m).map(|(r, c)| r - c).collect();
        likelihood.whiten(&[left_m], &self.position_m, &fit.noise).concat()
    }

    /// Draws noise parameters, in their units, from their posterior at the fit of the model alone: `n` draws with a random stream of `seed`.
    pub fn noise_draws(&self, likelihood: &NoiseLikelihood, base: &LinearFit, n: usize, seed: u64) -> Vec<NoiseValues> {
        let moved_m = self.moved_m(&base.correction_m);
        let mut stream = RandomStream::new(seed, u64::MAX);
        let draws = noise_fit::draws(likelihood, &self.noise_prior, &moved_m, &base.log_noise, n, &mut stream);
        draws.iter().map(noise_fit::natural).collect()
    }

    /// Standard deviation (m) of the position at every row due to the uncertainty of the coordinates, under the noise of a fit.
    ///
    /// # Errors
    /// Errors of [`Linear::fit_base`].
    pub fn position_sd_m(&self, likelihood: &NoiseLikelihood, noise: &NoiseValues) -> Result<Vec<f64>> {
        let nothing_m = vec![0.0; self.position_m.len()];
        let solved = self.mean(likelihood, &nothing_m, &Columns::default(), &noise.map(f64::ln))?.solved;
        let mut slope = DVector::zeros(self.derivatives_m.len());
        let at_row = |row: usize| {
            slope.iter_mut().zip(&self.derivatives_m).for_each(|(slope, column)| *slope = column[row]);
            solved.weighted(&slope).1
        };
        Ok((0..self.position_m.len()).map(at_row).collect())
    }
}

/// Returns the distinct noise parameters among the given fits.
fn distinct(means: &[Mean]) -> Vec<LogNoise> {
    let mut noises: Vec<LogNoise> = Vec::new();
    for mean in means {
        if !noises.contains(&mean.log_noise) {
            noises.push(mean.log_noise);
        }
    }
    noises
}

fn fit_of(mean: &Mean, correction_m: Vec<f64>) -> LinearFit {
    let noise = noise_fit::natural(&mean.log_noise);
    LinearFit { objective: mean.objective, correction_m, noise, log_noise: mean.log_noise }
}

fn no_solution(why: &str) -> Error {
    Error::numerical(
        format!("the misfit cannot be tested around this fit: {why}"),
        "fix one of the model's parameters, or check the record for values that are far off",
    )
}

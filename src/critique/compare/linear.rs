//! Fits of columns about a fit of a model, the noise estimated anew for each.
//!
//! Near its fit a model is linear, f̂ + A δ, and columns C add to it: f̂ + A δ + C a. Noise that was estimated from residuals which still hold what
//! C describes has swallowed it; so δ, a and the noise are found together, and what C gains is a likelihood ratio.

use nalgebra::{DMatrix, DVector};

use super::super::fit::columns_m;
use super::super::noise_fit::{self, LogNoise, NoisePrior};
use super::super::{Candidate, Fitted, Subject};
use crate::error::{Error, Result};
use crate::inference::ensemble::RandomStream;
use crate::inference::noise::NoiseLikelihood;

/// What is added to the normal equations of columns of unit length: directions that the model or other columns hold already get no amplitude.
const RIDGE: f64 = 1e-7;

/// A model about its fit.
pub struct Linear {
    noise_prior: NoisePrior,
    /// f̂ (m), one value a row of the record.
    position_m: Vec<f64>,
    /// Derivatives (m a unit of the coordinate).
    derivatives_m: Vec<Vec<f64>>,
    /// 1/sd and distance to the mean over sd of the priors of coordinates; zeros where there is none.
    priors: Vec<(f64, f64)>,
    base_noise: LogNoise,
}

/// The best mean and noise with some columns.
#[derive(Debug, Clone)]
pub struct LinearFit {
    /// Log posterior in nats, up to a constant that all fits of one record share.
    pub objective: f64,
    /// A δ + C a (m), one value a row of the record.
    pub correction_m: Vec<f64>,
    /// The noise's parameters in their units.
    pub noise: [f64; 5],
    log_noise: LogNoise,
}

/// Amplitudes with their covariance.
struct Solved {
    amplitudes: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Linear {
    /// About a fit of a candidate.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the model has no derivatives.
    pub fn new(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Self> {
        let priors = candidate.free.iter().zip(&fitted.theta);
        let prior = |(free, theta): (&crate::critique::Free, &f64)| {
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

    /// f̂ (m) at every row of the record.
    pub fn position_m(&self) -> &[f64] {
        &self.position_m
    }

    /// Derivatives (m a unit of the coordinate), one column a coordinate.
    pub fn derivatives_m(&self) -> &[Vec<f64>] {
        &self.derivatives_m
    }

    /// Fits the model alone to positions less f̂ (m, one value a row).
    ///
    /// # Errors
    /// [`Error::Numerical`] where the normal equations have no solution.
    pub fn fit_base(&self, likelihood: &NoiseLikelihood, residual_m: &[f64]) -> Result<LinearFit> {
        let starts = [self.base_noise, self.noise_prior.white()];
        self.best(likelihood, residual_m, &[], &starts)
    }

    /// Fits the model with columns, from the noise of a fit without them and from noise as small as the yardstick.
    ///
    /// # Errors
    /// As [`Linear::fit_base`].
    pub fn fit_with(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        base: &LinearFit,
    ) -> Result<LinearFit> {
        self.best(likelihood, residual_m, columns, &[base.log_noise, self.noise_prior.white()])
    }

    /// Climbs from the better of the starts.
    fn best(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        starts: &[LogNoise],
    ) -> Result<LinearFit> {
        let mut best: Option<(f64, LogNoise)> = None;
        for start in starts {
            let objective = self.fit_at(likelihood, residual_m, columns, *start)?.objective;
            if best.is_none_or(|(best, _)| objective > best) {
                best = Some((objective, *start));
            }
        }
        let (_, start) = best.ok_or_else(|| no_solution("no start"))?;
        self.climb(likelihood, residual_m, columns, start)
    }

    /// Mean, noise, and the mean again: the calibration repeats exactly this, so that it need not be iterated to rest.
    fn climb(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        start: LogNoise,
    ) -> Result<LinearFit> {
        let (correction_m, _) = self.mean(likelihood, residual_m, columns, &start)?;
        let moved_m = self.moved_m(&correction_m);
        let (log_noise, _) = noise_fit::fit(likelihood, &self.noise_prior, &moved_m, &start, false);
        self.fit_at(likelihood, residual_m, columns, log_noise)
    }

    /// The best mean under a noise.
    fn fit_at(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        log_noise: LogNoise,
    ) -> Result<LinearFit> {
        let (correction_m, of_prior) = self.mean(likelihood, residual_m, columns, &log_noise)?;
        let noise = noise_fit::natural(&log_noise);
        let objective = likelihood.ln_likelihood(&self.moved_m(&correction_m), &noise)
            + self.noise_prior.ln_density(&log_noise)
            + of_prior;
        Ok(LinearFit { objective, correction_m, noise, log_noise })
    }

    /// The position to which the noise is fitted: f̂ and a correction.
    fn moved_m(&self, correction_m: &[f64]) -> Vec<f64> {
        self.position_m.iter().zip(correction_m).map(|(f, correction)| f + correction).collect()
    }

    /// The best correction (m) under one noise, and the log prior of the coordinates there.
    fn mean(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        log_noise: &LogNoise,
    ) -> Result<(Vec<f64>, f64)> {
        let solved = self.solve(likelihood, residual_m, columns, &noise_fit::natural(log_noise))?;
        let mut correction_m = vec![0.0; self.position_m.len()];
        for (column, amplitude) in self.derivatives_m.iter().chain(columns).zip(solved.amplitudes.iter()) {
            correction_m.iter_mut().zip(column).for_each(|(sum, value)| *sum += amplitude * value);
        }
        let pulls = self.priors.iter().zip(solved.amplitudes.iter());
        let of_prior = pulls.map(|((inverse_sd, pull), step)| -0.5 * (pull - step * inverse_sd).powi(2)).sum();
        Ok((correction_m, of_prior))
    }

    /// Generalised least squares.
    fn solve(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        noise: &[f64; 5],
    ) -> Result<Solved> {
        let mut all: Vec<Vec<f64>> = self.derivatives_m.iter().chain(columns).cloned().collect();
        all.push(residual_m.to_vec());
        let white = likelihood.whiten(&all, &self.position_m, noise);
        let n = all.len() - 1;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut normal = DMatrix::zeros(n, n);
        let mut slope = DVector::zeros(n);
        for i in 0..n {
            for j in 0..=i {
                normal[(i, j)] = dot(&white[i], &white[j]);
                normal[(j, i)] = normal[(i, j)];
            }
            slope[i] = dot(&white[i], &white[n]);
        }
        for (k, (inverse_sd, pull)) in self.priors.iter().enumerate() {
            normal[(k, k)] += inverse_sd * inverse_sd;
            slope[k] += inverse_sd * pull;
        }
        let scale: Vec<f64> = (0..n).map(|k| normal[(k, k)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        let scaled =
            DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j] + if i == j { RIDGE } else { 0.0 });
        let factor = scaled.cholesky().ok_or_else(|| no_solution("columns that are not finite"))?;
        let amplitudes = factor.solve(&DVector::from_fn(n, |i, _| slope[i] * scale[i]));
        let inverse = factor.inverse();
        Ok(Solved {
            amplitudes: DVector::from_fn(n, |i, _| amplitudes[i] * scale[i]),
            covariance: DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]),
        })
    }

    /// Weighted means w·(A δ + C a), in m, with their standard errors, under the noise of a fit.
    ///
    /// # Errors
    /// As [`Linear::fit_base`].
    pub fn weighted_means_m(
        &self,
        likelihood: &NoiseLikelihood,
        residual_m: &[f64],
        columns: &[Vec<f64>],
        fit: &LinearFit,
        weights: &[Vec<f64>],
    ) -> Result<Vec<(f64, f64)>> {
        let solved = self.solve(likelihood, residual_m, columns, &fit.noise)?;
        let of_weights = |weights: &Vec<f64>| {
            let dot = |column: &Vec<f64>| column.iter().zip(weights).map(|(c, w)| c * w).sum::<f64>();
            let v = DVector::from_iterator(solved.amplitudes.len(), self.derivatives_m.iter().chain(columns).map(dot));
            (v.dot(&solved.amplitudes), v.dot(&(&solved.covariance * &v)).max(0.0).sqrt())
        };
        Ok(weights.iter().map(of_weights).collect())
    }

    /// L⁻¹ (y − f̂ − A δ) at the fitted rows in order.
    pub fn whitened(&self, likelihood: &NoiseLikelihood, residual_m: &[f64], fit: &LinearFit) -> Vec<f64> {
        let left_m: Vec<f64> = residual_m.iter().zip(&fit.correction_m).map(|(r, c)| r - c).collect();
        likelihood.whiten(&[left_m], &self.position_m, &fit.noise).concat()
    }

    /// Noise's parameters in their units as the record leaves them possible beside the fit of the model alone, `n` draws with a stream of `seed`.
    pub fn noise_draws(&self, likelihood: &NoiseLikelihood, base: &LinearFit, n: usize, seed: u64) -> Vec<[f64; 5]> {
        let moved_m = self.moved_m(&base.correction_m);
        let mut stream = RandomStream::new(seed, u64::MAX);
        let draws = noise_fit::draws(likelihood, &self.noise_prior, &moved_m, &base.log_noise, n, &mut stream);
        draws.iter().map(noise_fit::natural).collect()
    }

    /// Standard deviation (m) that the uncertainty of the coordinates gives the position at every row, under the noise of a fit.
    ///
    /// # Errors
    /// As [`Linear::fit_base`].
    pub fn position_sd_m(&self, likelihood: &NoiseLikelihood, noise: &[f64; 5]) -> Result<Vec<f64>> {
        let solved = self.solve(likelihood, &vec![0.0; self.position_m.len()], &[], noise)?;
        let at_row = |row: usize| {
            let slope = DVector::from_iterator(self.derivatives_m.len(), self.derivatives_m.iter().map(|c| c[row]));
            slope.dot(&(&solved.covariance * &slope)).max(0.0).sqrt()
        };
        Ok((0..self.position_m.len()).map(at_row).collect())
    }
}

fn no_solution(why: &str) -> Error {
    Error::numerical(
        format!("the misfit cannot be looked at about this fit: {why}"),
        "fix one of the model's parameters, or look for values in the record that are far off",
    )
}

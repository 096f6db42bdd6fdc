//! Log scores of a model's predictions of unseen cycles: each cycle given the cycles before it and their noise.
//!
//! The model is linearised around its fit, and its law has priors. The size of an effect has a mixture of normal priors about its null. The narrowest prior has a fifth
//! of the information that an average cycle has about the size. The broadest has the width of the effect's default prior. A broad prior alone would penalise an effect
//! that only later cycles show, because the first cycles do not determine it. A narrow prior alone would shrink a large effect. Under each prior the parameters are
//! integrated out, and the log score of cycle c given the earlier ones is exact:
//!
//!   ln p(y_c | y_<c) = ln Z_c − ln Z_{c−1},
//!   ln Z_c = ℓ_c(θ̂) − ½ d'Λ₀d + ½ b'M⁻¹b + ½ ln det Λ₀ − ½ ln det M + ln P(θ ∈ S | M⁻¹b, M⁻¹) − ln P(θ ∈ S | d, Λ₀⁻¹)
//!
//! Here ℓ_c is the log likelihood of all rows up to cycle c at the fit θ̂. A and r are the whitened derivatives and residuals of these rows. The prior has mean θ₀ and
//! precision Λ₀. Further, d = θ₀ − θ̂, M = Λ₀ + AᵀA and b = Aᵀr + Λ₀d. Whitening goes forward in time, so the first rows of A and r depend on the first cycles alone. The
//! two probabilities P integrate the normal distributions of posterior and prior over the support S, the candidate's ends. They respect the sign of an effect: data that
//! favour the other sign give it no gain.

use nalgebra::{DMatrix, DVector};

use super::box_probability::{ln_box_probability, ln_within};
use super::derivatives::columns_m;
use super::noise_fit::of_future;
use super::{Candidate, Fitted, Subject};
use base::error::Result;
use posterior::noise::NoiseLikelihood;

/// Log scores of future cycles, in nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FutureScore {
    /// Score of all cycles but the first, each given the cycles before it.
    pub all: f64,
    /// Score of the last cycle, given the cycles before it.
    pub last: f64,
}

/// Information of the narrowest prior of an effect's size, as a fraction of the average information of one cycle.
const PRIOR_CYCLES: f64 = 0.2;
/// Number of priors in the mixture for an effect's size; their precisions form a geometric progression.
const N_SCALES: usize = 5;
/// Standard deviation of the vague prior of a column's amplitude, in m.
const AMPLITUDE_SD_M: f64 = 1e-3;

/// Log scores of a candidate's predictions of future cycles; `None` if no cycle is held out.
///
/// # Errors
/// [`base::Error::Numerical`] if the candidate has no derivatives.
pub fn future_score(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Option<FutureScore>> {
    let record = &subject.experiment().record;
    if subject.scored_m.iter().all(Option::is_none) {
        return Ok(None);
    }
    let both = subject.observed_m();
    // The gains of three cycles may by chance hardly scatter, and the prediction of a fourth cycle would then be overconfident. All models use the same least gain, so it
    // does not contribute to a model's gain over another.
    let noise = of_future(subject.noise(), fitted.noise);
    let mut columns = columns_m(subject, candidate, &fitted.theta)?;
    let n = columns.len();
    columns.push(both.iter().zip(&fitted.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect());
    let white = subject.all.whiten(&columns, &fitted.position_m, &noise);
    let observed: Vec<usize> = (0..both.len()).filter(|row| both[*row].is_some()).collect();
    let mut cycles: Vec<u32> = observed.iter().map(|row| record.cycle[*row]).collect();
    cycles.dedup();
    let (broadest, prior_step) = prior(candidate, &fitted.theta);
    let reach: Vec<[f64; 2]> = (0..n).map(|k| candidate.ends(k).map(|end| end - fitted.theta[k])).collect();
    let sizes: Vec<usize> = (0..candidate.free.len()).filter(|k| candidate.free[*k].null.is_some()).collect();
    let narrowest =
        |size: usize| PRIOR_CYCLES * visible_information(&white[..n], &broadest, candidate, size) / cycles.len() as f64;
    let narrowest: Vec<f64> = sizes.iter().map(|size| narrowest(*size).max(broadest[*size])).collect();
    let n_scales = if sizes.is_empty() { 1 } else { N_SCALES };
    let precisions = (0..n_scales).map(|scale| {
        let share = if n_scales > 1 { scale as f64 / (n_scales - 1) as f64 } else { 0.0 };
        let mut precision = broadest.clone();
        for (size, narrow) in sizes.iter().zip(&narrowest) {
            precision[*size] = narrow * (broadest[*size] / narrow).powf(share);
        }
        precision
    });
    let precisions: Vec<Vec<f64>> = precisions.collect();
    let recordings = subject.problem().recordings();
    let ln_evidence = |until: u32| {
        let n_rows = observed.iter().take_while(|row| record.cycle[**row] <= until).count();
        let rows: Vec<Option<f64>> =
            both.iter().zip(&record.cycle).map(|(y, cycle)| y.filter(|_| *cycle <= until)).collect();
        let likelihood = NoiseLikelihood::new(subject.noise(), &record.time_s, &recordings, &rows);
        let ln_likelihood = likelihood.ln_likelihood(&fitted.position_m, &noise);
        let dot = |i: usize, j: usize| -> f64 {
            white[i][..n_rows].iter().zip(&white[j][..n_rows]).map(|(a, b)| a * b).sum()
        };
        let told = DMatrix::from_fn(n, n, dot);
        let slope = DVector::from_fn(n, |i, _| dot(i, n));
        // The evidence of the mixture: its priors have equal weights.
        let each: Vec<f64> =
            precisions.iter().map(|precision| ln_integral(&told, &slope, precision, &prior_step, &reach)).collect();
        let largest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = each.iter().map(|value| (value - largest).exp()).sum::<f64>() / each.len() as f64;
        ln_likelihood + largest + mean.ln()
    };
    let (Some(first), Some(last)) = (cycles.first(), cycles.last()) else { return Ok(None) };
    let before_last = cycles.iter().rev().nth(1).unwrap_or(first);
    let whole = ln_evidence(*last);
    Ok(Some(FutureScore { all: whole - ln_evidence(*first), last: whole - ln_evidence(*before_last) }))
}

/// Logarithm of the integral of exp(b'δ − ½ δ'Iδ) over a normal prior of δ, with b = `slope` and I = `told`. The prior has mean `step` and precisions `precision`, and
/// ends at `reach`. The result is the change of the log likelihood at the fit because δ is uncertain.
fn ln_integral(told: &DMatrix<f64>, slope: &DVector<f64>, precision: &[f64], step: &[f64], reach: &[[f64; 2]]) -> f64 {
    let n = precision.len();
    let total = DMatrix::from_fn(n, n, |i, j| told[(i, j)] + if i == j { precision[i] } else { 0.0 });
    let pull = DVector::from_fn(n, |i, _| slope[i] + precision[i] * step[i]);
    let ln_prior: f64 = (0..n).map(|i| 0.5 * precision[i].ln() - 0.5 * precision[i] * step[i].powi(2)).sum();
    let Some(factor) = total.cholesky() else { return f64::NEG_INFINITY };
    let ln_det: f64 = factor.l_dirty().diagonal().iter().map(|l| 2.0 * l.ln()).sum();
    let mean = factor.solve(&pull);
    let from_mean = |side: usize| -> Vec<f64> { (0..n).map(|i| reach[i][side] - mean[i]).collect() };
    let ln_posterior_inside = ln_box_probability(&factor.inverse(), &from_mean(0), &from_mean(1));
    let of_prior = |i: usize| {
        let [lower, upper] = reach[i].map(|end| (end - step[i]) * precision[i].sqrt());
        ln_within(lower, upper)
    };
    let ln_prior_inside: f64 = (0..n).map(of_prior).sum();
    ln_prior + 0.5 * pull.dot(&mean) - 0.5 * ln_det + ln_posterior_inside - ln_prior_inside
}

/// Information of all rows about the size of an effect: its squared whitened derivative, less the part that the law's parameters absorb.
fn visible_information(white: &[Vec<f64>], prior_precision: &[f64], candidate: &Candidate, size: usize) -> f64 {
    let law: Vec<usize> = (0..candidate.free.len()).filter(|k| candidate.free[*k].effect.is_none()).collect();
    let dot = |i: usize, j: usize| -> f64 { white[i].iter().zip(&white[j]).map(|(a, b)| a * b).sum() };
    let precision = DMatrix::from_fn(law.len(), law.len(), |i, j| {
        dot(law[i], law[j]) + if i == j { prior_precision[law[i]] } else { 0.0 }
    });
    let shared = DVector::from_fn(law.len(), |i, _| dot(law[i], size));
    let absorbed = precision.cholesky().map_or(0.0, |factor| shared.dot(&factor.solve(&shared)));
    (dot(size, size) - absorbed).max(1e-9)
}

/// Precision of each coordinate's prior, and the prior's mean less the fit.
fn prior(candidate: &Candidate, theta: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let of_free = candidate.free.iter().zip(theta).map(|(free, theta)| {
        let (mean, sd) = free.prior.unwrap_or_else(|| {
            let spread = 0.5 * (free.quantile(0.95) - free.quantile(0.05)).abs();
            (free.null.unwrap_or_else(|| free.quantile(0.5)), spread.max(1e-6))
        });
        (1.0 / (sd * sd), mean - theta)
    });
    let of_columns = theta[candidate.free.len()..].iter().map(|theta| (1.0 / AMPLITUDE_SD_M.powi(2), -theta));
    of_free.chain(of_columns).unzip()
}

#[cfg(test)]
#[path = "future_tests.rs"]
mod tests;

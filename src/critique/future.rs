//! How well a model predicts cycles that it has not seen: each from those before it, given the noise of those before it.
//!
//! The model is taken as linear around its fit, with the law's priors. The size of an effect has a mixture of normal priors about its null, from one that
//! is worth a fifth of what a cycle tells of it on average up to its default's spread: the broad one alone would make an effect that only later cycles show
//! pay for what the first could not know, the narrow one alone would shrink a large effect away. Under each the log score of cycle c given the earlier
//! ones is exact, parameters integrated out,
//!
//!   ln p(y_c | y_<c) = ln Z_c − ln Z_{c−1},  ln Z_c = ℓ_c(θ̂) − ½ d'Λ₀d + ½ b'M⁻¹b + ½ ln det Λ₀ − ½ ln det M
//!
//! with ℓ_c the log likelihood of all rows up to cycle c at the fit θ̂, A and r their whitened derivatives and residuals, d = θ₀ − θ̂, M = Λ₀ + AᵀA and
//! b = Aᵀr + Λ₀d. Whitening goes forward in time, so the first rows of A and r are those of the first cycles alone.

use nalgebra::{DMatrix, DVector};

use super::fit::columns_m;
use super::noise_fit::GAIN_FLOOR;
use super::{Candidate, Fitted, Subject};
use crate::error::Result;
use crate::inference::noise::NoiseLikelihood;

/// Log scores of future cycles, in nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FutureScore {
    /// Of all cycles but the first, each given those before it.
    pub all: f64,
    /// Of the last cycle, given those before it.
    pub last: f64,
}

/// Cycles that the narrowest prior of an effect's size is worth.
const PRIOR_CYCLES: f64 = 0.2;
/// Priors of an effect's size, in geometric progression.
const N_SCALES: usize = 5;
/// Standard deviation of an amplitude of a column, in m: vague.
const AMPLITUDE_SD_M: f64 = 1e-3;

/// Log scores of a candidate at its fit; `None` when no cycle is held out.
///
/// # Errors
/// [`crate::Error::Numerical`] where the candidate has no derivatives.
pub fn future_score(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Option<FutureScore>> {
    let record = &subject.experiment().record;
    if subject.scored_m.iter().all(Option::is_none) {
        return Ok(None);
    }
    let both: Vec<Option<f64>> = subject.fitted_m.iter().zip(&subject.scored_m).map(|(a, b)| a.or(*b)).collect();
    let mut noise = fitted.noise;
    noise[3] = noise[3].max(GAIN_FLOOR);
    let mut columns = columns_m(subject, candidate, &fitted.theta)?;
    let n = columns.len();
    columns.push(both.iter().zip(&fitted.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect());
    let white = subject.all.whiten(&columns, &fitted.position_m, &noise);
    let observed: Vec<usize> = (0..both.len()).filter(|row| both[*row].is_some()).collect();
    let mut cycles: Vec<u32> = observed.iter().map(|row| record.cycle[*row]).collect();
    cycles.dedup();
    let (broadest, prior_step) = prior(candidate, &fitted.theta);
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
    let ln_evidence = |until: u32| {
        let n_rows = observed.iter().take_while(|row| record.cycle[**row] <= until).count();
        let rows: Vec<Option<f64>> =
            both.iter().zip(&record.cycle).map(|(y, cycle)| y.filter(|_| *cycle <= until)).collect();
        let likelihood = NoiseLikelihood::new(subject.noise(), &record.time_s, &record.cycle, &rows);
        let ln_likelihood = likelihood.ln_likelihood(&fitted.position_m, &noise);
        let dot = |i: usize, j: usize| -> f64 {
            white[i][..n_rows].iter().zip(&white[j][..n_rows]).map(|(a, b)| a * b).sum()
        };
        let told = DMatrix::from_fn(n, n, dot);
        let slope = DVector::from_fn(n, |i, _| dot(i, n));
        // The mixture's evidence: its priors have equal weights.
        let each: Vec<f64> =
            precisions.iter().map(|precision| ln_integral(&told, &slope, precision, &prior_step)).collect();
        let largest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = each.iter().map(|value| (value - largest).exp()).sum::<f64>() / each.len() as f64;
        ln_likelihood + largest + mean.ln()
    };
    let (Some(first), Some(last)) = (cycles.first(), cycles.last()) else { return Ok(None) };
    let before_last = cycles.iter().rev().nth(1).unwrap_or(first);
    let whole = ln_evidence(*last);
    Ok(Some(FutureScore { all: whole - ln_evidence(*first), last: whole - ln_evidence(*before_last) }))
}

/// ln of the integral of exp(b'δ − ½ δ'Iδ) over a normal prior of δ with mean `step`: what the log likelihood at the fit gains or loses by it.
fn ln_integral(told: &DMatrix<f64>, slope: &DVector<f64>, precision: &[f64], step: &[f64]) -> f64 {
    let n = precision.len();
    let total = DMatrix::from_fn(n, n, |i, j| told[(i, j)] + if i == j { precision[i] } else { 0.0 });
    let pull = DVector::from_fn(n, |i, _| slope[i] + precision[i] * step[i]);
    let ln_prior: f64 = (0..n).map(|i| 0.5 * precision[i].ln() - 0.5 * precision[i] * step[i].powi(2)).sum();
    match total.cholesky() {
        Some(factor) => {
            let ln_det: f64 = factor.l_dirty().diagonal().iter().map(|l| 2.0 * l.ln()).sum();
            ln_prior + 0.5 * pull.dot(&factor.solve(&pull)) - 0.5 * ln_det
        }
        None => f64::NEG_INFINITY,
    }
}

/// What all rows tell of a size beside the law's parameters: its squared whitened derivative less what those absorb.
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

/// Precision of each coordinate's prior, and its mean less the fit.
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
mod tests {
    use super::*;
    use crate::critique::test_replica::{WHITE, base_fit, replica, simulated};

    /// Log density of a normal vector by dense algebra.
    fn ln_normal(x: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let factor = covariance.clone().cholesky().expect("positive definite");
        let half_ln_det: f64 = factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum();
        let form = x.dot(&factor.solve(x));
        -0.5 * form - half_ln_det - 0.5 * x.len() as f64 * std::f64::consts::TAU.ln()
    }

    /// The linearised model as one joint normal of all rows, by dense algebra: the log score of the last cycle is that of all rows less that of the
    /// others. Every third row, so that the dense covariance stays small.
    #[test]
    fn scores_are_those_of_the_joint_normal() {
        let (base, fitted) = base_fit();
        let noise = [4.0, 3.0, 0.7, 0.012, 2.0];
        let subject = simulated(&base, &fitted.theta, &noise, 5);
        let left_out: Vec<usize> = (0..subject.fitted_m.len()).filter(|row| row % 3 != 0).collect();
        let subject = subject.without_rows(&left_out);
        let fitted = Fitted { noise, ..fitted };
        let score = future_score(&subject, &base, &fitted).expect("derivatives").expect("a cycle is held out");
        let record = &subject.experiment().record;
        let both: Vec<Option<f64>> = subject.fitted_m.iter().zip(&subject.scored_m).map(|(a, b)| a.or(*b)).collect();
        let columns = columns_m(&subject, &base, &fitted.theta).expect("derivatives");
        let (precision, step) = prior(&base, &fitted.theta);
        let ln_density = |until: u32| {
            let rows: Vec<usize> =
                (0..both.len()).filter(|row| both[*row].is_some() && record.cycle[*row] <= until).collect();
            let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                let (a, b) = (rows[i], rows[j]);
                let white = if a == b { 4e-6_f64.powi(2) } else { 0.0 };
                let lag_s = (record.time_s[a] - record.time_s[b]).abs();
                let process = 3e-6_f64.powi(2) * (-lag_s / 0.7).exp();
                let same = f64::from(u8::from(record.cycle[a] == record.cycle[b]));
                let gain = same * (0.012_f64.powi(2) * fitted.position_m[a] * fitted.position_m[b] + 2e-6_f64.powi(2));
                let law: f64 = (0..columns.len()).map(|k| columns[k][a] * columns[k][b] / precision[k]).sum();
                white + process + gain + law
            });
            let residual = DVector::from_fn(rows.len(), |i, _| {
                let row = rows[i];
                let moved: f64 = (0..columns.len()).map(|k| columns[k][row] * step[k]).sum();
                both[row].map_or(0.0, |y| y - fitted.position_m[row] - moved)
            });
            ln_normal(&residual, &covariance)
        };
        let (all, last) = (ln_density(4) - ln_density(1), ln_density(4) - ln_density(3));
        assert!((score.all - all).abs() < 1e-6 * all.abs(), "{} {all}", score.all);
        assert!((score.last - last).abs() < 1e-6 * last.abs(), "{} {last}", score.last);
    }

    /// With an effect that is linear in the position, the score is that of a mixture of five joint normals of all rows, by dense algebra: its size about
    /// its null with precisions from a fifth of what a cycle tells of it beside the law, in geometric progression to the default prior's.
    #[test]
    fn scores_with_an_effect_are_those_of_a_mixture_of_joint_normals() {
        let (base, fitted) = base_fit();
        let noise = [4.0, 3.0, 0.7, 0.012, 2.0];
        let candidate = replica().extended(&["tracking-drift"]).expect("addable");
        let size = candidate.free.len() - 1;
        let mut theta = candidate.embed(&base, &fitted.theta);
        theta[size] = candidate.free[size].coordinate.theta(4e-7);
        let subject = simulated(&candidate, &theta, &noise, 6);
        let left_out: Vec<usize> = (0..subject.fitted_m.len()).filter(|row| row % 4 != 0).collect();
        let subject = subject.without_rows(&left_out);
        let position_m = subject.trajectory_m(&candidate, &theta).expect("a model");
        let fitted = Fitted { theta, noise, position_m, ..fitted };
        let score = future_score(&subject, &candidate, &fitted).expect("derivatives").expect("a cycle is held out");
        let record = &subject.experiment().record;
        let both: Vec<Option<f64>> = subject.fitted_m.iter().zip(&subject.scored_m).map(|(a, b)| a.or(*b)).collect();
        let columns = columns_m(&subject, &candidate, &fitted.theta).expect("derivatives");
        let rows_until = |until: u32| -> Vec<usize> {
            (0..both.len()).filter(|row| both[*row].is_some() && record.cycle[*row] <= until).collect()
        };
        let of_noise = |rows: &[usize]| {
            DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                let (a, b) = (rows[i], rows[j]);
                let white = if a == b { 4e-6_f64.powi(2) } else { 0.0 };
                let process = 3e-6_f64.powi(2) * (-(record.time_s[a] - record.time_s[b]).abs() / 0.7).exp();
                let same = f64::from(u8::from(record.cycle[a] == record.cycle[b]));
                let (x, y) = (fitted.position_m[a], fitted.position_m[b]);
                white + process + same * (0.012_f64.powi(2) * x * y + 2e-6_f64.powi(2))
            })
        };
        let of_law: Vec<(f64, f64)> = candidate.free.iter().filter_map(|free| free.prior).collect();
        assert_eq!(of_law.len(), size);
        // What all rows tell of the size beside the law: the size's posterior precision where it has no prior.
        let rows = rows_until(4);
        let inverse = of_noise(&rows).try_inverse().expect("regular");
        let a = DMatrix::from_fn(rows.len(), size + 1, |i, k| columns[k][rows[i]]);
        let mut told = a.transpose() * inverse * &a;
        (0..size).for_each(|k| told[(k, k)] += 1.0 / of_law[k].1.powi(2));
        let visible = 1.0 / told.try_inverse().expect("regular")[(size, size)];
        let free = &candidate.free[size];
        let broadest = (0.5 * (free.quantile(0.95) - free.quantile(0.05))).powi(-2);
        let narrowest = 0.2 * visible / 4.0;
        assert!(narrowest > 10.0 * broadest, "{narrowest} {broadest}");
        let ln_density = |until: u32| {
            let rows = rows_until(until);
            let noise = of_noise(&rows);
            let each = (0..5).map(|scale| {
                let precision = narrowest * (broadest / narrowest).powf(f64::from(scale) / 4.0);
                let variance = |k: usize| if k < size { of_law[k].1.powi(2) } else { 1.0 / precision };
                let step = |k: usize| if k < size { of_law[k].0 - fitted.theta[k] } else { -fitted.theta[k] };
                let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                    let column = |k: usize| columns[k][rows[i]] * columns[k][rows[j]] * variance(k);
                    noise[(i, j)] + (0..=size).map(column).sum::<f64>()
                });
                let residual = DVector::from_fn(rows.len(), |i, _| {
                    let row = rows[i];
                    let moved: f64 = (0..=size).map(|k| columns[k][row] * step(k)).sum();
                    both[row].map_or(0.0, |y| y - fitted.position_m[row] - moved)
                });
                ln_normal(&residual, &covariance)
            });
            let each: Vec<f64> = each.collect();
            let largest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            largest + (each.iter().map(|value| (value - largest).exp()).sum::<f64>() / 5.0).ln()
        };
        let (all, last) = (ln_density(4) - ln_density(1), ln_density(4) - ln_density(3));
        assert!((score.all - all).abs() < 1e-5, "{} {all}", score.all);
        assert!((score.last - last).abs() < 1e-5, "{} {last}", score.last);
    }

    /// A gain that three cycles show to be nothing is floored: the score of the last cycle is that of a per cent.
    #[test]
    fn the_gain_of_a_new_cycle_is_not_known_to_be_nothing() {
        let (base, fitted) = base_fit();
        let score = |gain: f64| {
            let mut noise = WHITE;
            noise[3] = gain;
            let fitted = Fitted { noise, ..fitted.clone() };
            future_score(replica(), &base, &fitted).expect("derivatives").expect("a cycle is held out").last
        };
        assert_eq!(score(1e-5), score(0.01));
        assert!(score(0.05) < score(0.01));
    }
}

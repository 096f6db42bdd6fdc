//! Diagnostics of ensembles, whose walkers are correlated with each other.
//!
//! Let `x[e][s][w]` be a parameter in ensemble e, step s, walker w, and z the normal scores of its ranks over all draws.
//! - R̂: the steps of every ensemble are split into a first and a last half. Each half with *all its walkers' draws* is a
//!   chain. R̂ is the larger of the values for z and for the folded scores.
//! - Effective sample size of a quantity g: z for the bulk, 1{x ≤ q₀.₀₅} and 1{x ≤ q₀.₉₅} for the tails, x for the mean.
//!   The per-step averages `ḡ[e][s]` over walkers form one time series per ensemble (split in halves). Let τ_ḡ and
//!   Var ḡ be their integrated time and variance over n steps and m ensembles. The mean's error is Var ḡ·τ_ḡ/(m n), and
//!   ESS = Var g/(Var ḡ·τ_ḡ/(m n)). This includes correlation of either sign between walkers.
//! - Autocorrelation time: draws over ESS of the mean, in steps. It is the number of steps that one walker alone would need.

use super::autocovariance::{integrate, sample_variance, sum};
use super::chains::Chains;
use super::ranks::{BlomScores, Sorted};

/// All draws of one parameter: value of ensemble e, step s, walker w at `values[(e·n_steps + s)·n_walkers + w]`.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawColumn {
    /// Independent ensembles.
    pub n_ensembles: usize,
    /// Steps of each ensemble.
    pub n_steps: usize,
    /// Walkers of each ensemble.
    pub n_walkers: usize,
    /// The values.
    pub values: Vec<f64>,
}

/// Summary of one parameter's draws, with diagnostics of its accuracy.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ParameterDiagnostics {
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// Median.
    pub median: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Rank-normalised split R̂, with one chain per ensemble and all its walkers pooled.
    pub rhat: f64,
    /// Effective number of draws for location.
    pub ess_bulk: f64,
    /// Effective number of draws for the 5 % and 95 % quantiles, whichever is smaller.
    pub ess_tail: f64,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// Integrated autocorrelation time of the mean, in the steps of the column.
    pub autocorrelation_time: f64,
}

/// Summary of a column. Values that cannot be computed (fewer than eight steps, no variation) are NaN.
/// `blom` must have the same length as the column.
pub fn diagnose(column: &DrawColumn, blom: &BlomScores) -> ParameterDiagnostics {
    let n = column.values.len();
    let mean = sum(&column.values) / n as f64;
    let sd = sample_variance(&column.values).sqrt();
    let sorted = Sorted::new(&column.values);
    let quantile = |probability| sorted.quantile(probability);
    let (q05, median, q95) = (quantile(0.05), quantile(0.5), quantile(0.95));
    let scores = sorted.normal_scores(blom);
    let rhat = pooled_rhat(column, &scores).max(pooled_rhat(column, &sorted.folded_normal_scores(median, blom)));
    let below = |limit: f64| -> Vec<f64> { column.values.iter().map(|&x| f64::from(x <= limit)).collect() };
    let ess_tail = ess(column, &below(q05)).min(ess(column, &below(q95)));
    let ess_mean = ess(column, &column.values);
    ParameterDiagnostics {
        mean,
        sd,
        q05,
        median,
        q95,
        rhat,
        ess_bulk: ess(column, &scores),
        ess_tail,
        mcse_mean: sd / ess_mean.sqrt(),
        autocorrelation_time: n as f64 / ess_mean,
    }
}

/// Autocorrelation time of the mean in the column's steps: the part of [`diagnose`] without sorting. NaN if undefined.
pub fn autocorrelation_time(column: &DrawColumn) -> f64 {
    column.values.len() as f64 / ess(column, &column.values)
}

/// Per-step averages over walkers of a quantity in the column's layout, one chain per ensemble.
pub fn walker_averages(column: &DrawColumn, quantity: &[f64]) -> Chains {
    let average = |walkers: &[f64]| sum(walkers) / column.n_walkers as f64;
    let chain = |steps: &[f64]| steps.chunks_exact(column.n_walkers).map(average).collect();
    Chains::new(quantity.chunks_exact((column.n_steps * column.n_walkers).max(1)).map(chain).collect())
}

/// Effective number of draws for the mean of a quantity in the column's layout. NaN if undefined.
pub fn ess(column: &DrawColumn, quantity: &[f64]) -> f64 {
    let averages = walker_averages(column, quantity).split();
    let variance = sample_variance(quantity);
    let Some(integrated) = integrate(&averages) else { return f64::NAN };
    let n_averages = (averages.n_chains() * averages.n_draws()) as f64;
    variance * n_averages / (integrated.variance * integrated.time)
}

/// √(((n − 1)/n)·W + B) / √W over half ensembles with the draws of all their walkers. NaN for fewer than two ensembles.
fn pooled_rhat(column: &DrawColumn, scores: &[f64]) -> f64 {
    let half = column.n_steps / 2 * column.n_walkers;
    if column.n_ensembles < 2 || half < 2 * column.n_walkers {
        return f64::NAN;
    }
    let mut means = Vec::with_capacity(2 * column.n_ensembles);
    let mut within = 0.0;
    for ensemble in scores.chunks_exact(column.n_steps * column.n_walkers) {
        for draws in [&ensemble[..half], &ensemble[ensemble.len() - half..]] {
            means.push(sum(draws) / half as f64);
            within += sample_variance(draws) / (2 * column.n_ensembles) as f64;
        }
    }
    let n = half as f64;
    ((n - 1.0) / n + sample_variance(&means) / within).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostics::convergence;
    use rand::{RngExt, SeedableRng};

    /// AR(1) walkers with a common part: correlation `common` between walkers at every lag.
    fn column(n_steps: usize, n_walkers: usize, phi: f64, common: f64) -> DrawColumn {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(17);
        let mut normal = || -> f64 { rng.sample(rand_distr::StandardNormal) };
        let innovation = (1.0 - phi * phi).sqrt();
        let mut values = Vec::new();
        for _ in 0..4 {
            let mut shared = normal();
            let mut entry: Vec<f64> = (0..n_walkers).map(|_| normal()).collect();
            for _ in 0..n_steps {
                shared = phi * shared + innovation * normal();
                for x in &mut entry {
                    *x = phi * *x + innovation * normal();
                    values.push(common.sqrt() * shared + (1.0 - common).sqrt() * *x);
                }
            }
        }
        DrawColumn { n_ensembles: 4, n_steps, n_walkers, values }
    }

    #[test]
    fn one_walker_an_ensemble_is_the_definition_for_chains() {
        let column = column(500, 1, 0.5, 0.0);
        let chains = Chains::new(column.values.chunks(500).map(<[f64]>::to_vec).collect());
        let found = diagnose(&column, &BlomScores::new(column.values.len()));
        for (ours, theirs) in [
            (found.rhat, convergence::rhat(&chains)),
            (found.ess_bulk, convergence::ess_bulk(&chains)),
            (found.ess_tail, convergence::ess_tail(&chains)),
            (found.mcse_mean, convergence::mcse_mean(&chains)),
        ] {
            assert!((ours / theirs - 1.0).abs() < 5e-3, "{ours} against {theirs}");
        }
    }

    /// R̂ of four ensembles of eight walkers and 500 steps each, with the last one's draws shifted and scaled.
    fn rhat_with_one_ensemble(shift: f64, scale: f64) -> f64 {
        let mut column = column(500, 8, 0.5, 0.0);
        let first = 3 * column.n_steps * column.n_walkers;
        column.values[first..].iter_mut().for_each(|x| *x = shift + scale * *x);
        diagnose(&column, &BlomScores::new(column.values.len())).rhat
    }

    /// A shift of one ensemble in four by δ sd gives the means of the eight half chains a variance of 8/7·(1/4)(3/4)δ². R̂ is 1.026 for
    /// δ = ½, above the limit of 1.01 for a run, and 1.059 for δ = ¾. An ensemble's mean has a standard error of √(3/4000) = 0.03,
    /// which varies R̂ by 0.004 to 0.005. A doubled scale about an equal median appears only in the folded scores.
    #[test]
    fn one_ensemble_unlike_the_others_is_seen_by_rhat() {
        assert!(rhat_with_one_ensemble(0.0, 1.0) < 1.005);
        assert!(rhat_with_one_ensemble(0.5, 1.0) > 1.01);
        assert!(rhat_with_one_ensemble(0.75, 1.0) > 1.04);
        assert!(rhat_with_one_ensemble(0.0, 2.0) > 1.05);
    }

    /// Var of the mean of W walkers with mutual correlation c is σ²(c + (1 − c)/W): the effective number falls by a factor of
    /// 1 + (W − 1)c. The estimate's relative error is about 6 % (n = 80,000 steps, τ = 3); the tolerance is six of these.
    #[test]
    fn correlation_between_walkers_is_charged() {
        let (n_steps, n_walkers) = (20_000, 8);
        for common in [0.0, 0.3] {
            let column = column(n_steps, n_walkers, 0.5, common);
            let found = diagnose(&column, &BlomScores::new(column.values.len())).ess_bulk;
            let exact = (4 * n_steps * n_walkers) as f64 / 3.0 / (1.0 + (n_walkers - 1) as f64 * common);
            assert!((found / exact - 1.0).abs() < 0.36, "{found} against {exact}");
        }
    }
}

//! Convergence check, which tells in numbers and in words whether a run has enough draws.

use super::draws::Draws;
use super::options::ConvergenceCriteria;
use crate::diagnostics::ranks::BlomScores;
use crate::diagnostics::{DrawColumn, ParameterDiagnostics, diagnose, ensembles};
use rayon::prelude::*;

/// Result of a convergence check.
#[derive(Debug, Clone)]
pub(super) struct ConvergenceReport {
    /// Diagnostics of each coordinate, with autocorrelation times in steps.
    pub parameters: Vec<ParameterDiagnostics>,
    /// Longest autocorrelation time of the coordinates, in steps; NaN if unknown.
    pub autocorrelation_time: f64,
    /// Convergence criteria that are not met, in words; empty if all are met.
    pub unmet_criteria: Vec<String>,
    /// Estimated factor by which the number of steps must grow to meet the criteria: 1 if all are met, ∞ if unknown.
    pub shortfall: f64,
}

/// Checks the draws kept since the end of the burn-in against the convergence criteria.
pub(super) fn check_convergence(draws: &Draws, demands: &ConvergenceCriteria) -> ConvergenceReport {
    let blom = BlomScores::new(draws.len());
    let columns: Vec<(ParameterDiagnostics, f64)> = (0..draws.dimension)
        .into_par_iter()
        .map(|d| {
            let column = draws.column(d);
            let mut found = diagnose(&column, &blom);
            found.autocorrelation_time *= draws.store_every as f64;
            (found, walker_rhat(&column))
        })
        .collect();
    let parameters: Vec<ParameterDiagnostics> = columns.iter().map(|column| column.0).collect();
    let n_points = draws.len() as f64 * draws.store_every as f64;
    let longest = |p: &ParameterDiagnostics| longer(p.autocorrelation_time, n_points / p.ess_bulk);
    let time = parameters.iter().map(longest).fold(0.0, longer);
    let n_steps = draws.n_steps as f64 * draws.store_every as f64;
    let rhat_walkers = columns.iter().map(|column| column.1).fold(0.0, f64::max);
    let mut verdict =
        ConvergenceReport { parameters, autocorrelation_time: time, unmet_criteria: Vec::new(), shortfall: 1.0 };
    verdict.demand_length(n_steps, demands);
    verdict.check_ess(demands);
    verdict.check_rhat(rhat_walkers, demands);
    verdict
}

/// Returns the longest autocorrelation time of the coordinates' means, in steps; NaN if one is unknown. This costs much less than
/// [`check_convergence`].
pub(super) fn autocorrelation_time(draws: &Draws) -> f64 {
    let times: Vec<f64> =
        (0..draws.dimension).into_par_iter().map(|d| ensembles::autocorrelation_time(&draws.column(d))).collect();
    times.into_iter().fold(0.0, longer) * draws.store_every as f64
}

/// Returns the larger of two times, or NaN if one of them is NaN. `f64::max` ignores NaN.
fn longer(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

impl ConvergenceReport {
    fn demand_length(&mut self, n_steps: f64, demands: &ConvergenceCriteria) {
        let times = n_steps / self.autocorrelation_time;
        if times >= demands.autocorrelation_times {
            return;
        }
        self.raise_shortfall(demands.autocorrelation_times / times);
        self.unmet_criteria.push(if times.is_nan() {
            format!("{n_steps} steps after the burn-in are too few to estimate the autocorrelation time")
        } else {
            format!(
                "{n_steps} steps after the burn-in are {times:.0} autocorrelation times ({:.0} steps each); {} are required",
                self.autocorrelation_time, demands.autocorrelation_times
            )
        });
    }

    fn check_ess(&mut self, demands: &ConvergenceCriteria) {
        for (name, of) in [("bulk", (|p| p.ess_bulk) as fn(&ParameterDiagnostics) -> f64), ("tail", |p| p.ess_tail)] {
            let worst = worst(&self.parameters, |p| -of(p));
            let Some((d, ess)) = worst.map(|(d, value)| (d, -value)) else { continue };
            // A NaN fails this comparison.
            if ess >= demands.ess {
                continue;
            }
            self.raise_shortfall(demands.ess / ess);
            self.unmet_criteria.push(format!(
                "the effective sample size ({name}) of parameter {} is {ess:.0}; at least {} is required",
                d + 1,
                demands.ess
            ));
        }
    }

    fn check_rhat(&mut self, rhat_walkers: f64, demands: &ConvergenceCriteria) {
        if let Some((d, rhat)) = worst(&self.parameters, |p| p.rhat)
            && (rhat > demands.rhat || rhat.is_nan())
        {
            // The excess of R̂ over 1 decreases in proportion to the number of steps.
            self.raise_shortfall(((rhat - 1.0) / (demands.rhat - 1.0)).max(1.2));
            self.unmet_criteria.push(format!(
                "R̂ of parameter {} is {rhat:.3}; at most {} is allowed",
                d + 1,
                demands.rhat
            ));
        }
        if rhat_walkers > demands.rhat_walkers {
            self.raise_shortfall(2.0);
            self.unmet_criteria.push(format!(
                "walkers stay in separate regions (R̂ over walkers is {rhat_walkers:.2}): the weights of the regions come from \
                 the Laplace approximations at the start, not from sampling"
            ));
        }
    }

    fn raise_shortfall(&mut self, factor: f64) {
        self.shortfall = if factor.is_nan() { f64::INFINITY } else { self.shortfall.max(factor) };
    }
}

/// Returns the index of the parameter for which `of` is largest, and this value; `None` without parameters. NaN counts as the largest value.
fn worst(parameters: &[ParameterDiagnostics], of: impl Fn(&ParameterDiagnostics) -> f64) -> Option<(usize, f64)> {
    let key = |value: f64| if value.is_nan() { f64::INFINITY } else { value };
    let values = parameters.iter().map(of).enumerate();
    values.max_by(|a, b| key(a.1).total_cmp(&key(b.1)))
}

/// Returns the convergence measure R̂ = √(1 + B/W) with one chain per walker, without splitting or ranking. B is the variance between walkers, and W
/// the variance within walkers.
fn walker_rhat(column: &DrawColumn) -> f64 {
    let (n, n_walkers) = (column.n_steps as f64, column.n_walkers);
    let mut sums = vec![(0.0, 0.0); column.n_ensembles * n_walkers];
    // The mean of all values is subtracted first, so that sums of squares lose no significant digits.
    let centre = column.values.iter().sum::<f64>() / column.values.len() as f64;
    for (ensemble, draws) in column.values.chunks_exact((column.n_steps * n_walkers).max(1)).enumerate() {
        for step in draws.chunks_exact(n_walkers) {
            for (sum, x) in sums[ensemble * n_walkers..].iter_mut().zip(step) {
                let x = x - centre;
                *sum = (sum.0 + x, sum.1 + x * x);
            }
        }
    }
    let n_chains = sums.len() as f64;
    let within = sums.iter().map(|(s, q)| (q - s * s / n) / (n - 1.0)).sum::<f64>() / n_chains;
    let between = sums.iter().map(|(s, _)| (s / n).powi(2)).sum::<f64>() / (n_chains - 1.0);
    (1.0 + between / within).sqrt()
}

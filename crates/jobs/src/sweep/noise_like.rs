//! Tests whether the residuals of a fit are noise. Simulated oscillations without any misfit are fitted in the same way. They show how large and how
//! correlated residuals are by chance.

use rayon::prelude::*;

use super::problem::{SweepFit, SweepProblem};
use super::spectrum::{SPECTRUM_ERROR, fit_spectrum};
use base::error::Result;
use criticism::criteria::Criteria;
use record::rows_by_frequency;
use sampling::ensemble::RandomStream;

/// Numbers of simulated oscillations without and with repeats. Four tests at a joint level of 1 % need to resolve probabilities of 1/400, five of 1/500.
const N_SIMULATED: [usize; 2] = [499, 599];
/// Statistic of repeats where there are none.
const NO_REPEATS: f64 = -1.0;
/// Joint probability of all tests below which residuals do not count as noise.
pub const LEAST_P: f64 = Criteria::SWEEP.least_noise_p;
/// Number of the random stream of the first simulation. Other uses of the seed have other stream numbers.
const STREAM: u64 = 1 << 40;

/// p of each residual test: the probability that noise alone gives residuals at least as extreme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualPValues {
    /// p of the correlation between residuals at neighbouring frequencies.
    pub p_neighbours: f64,
    /// p of the root mean square of the fitted residuals; `None` if the fit itself estimates the size of the errors.
    pub p_size: Option<f64>,
    /// p of the root mean square of the held-out residuals; `None` if no row is held out.
    pub p_heldout: Option<f64>,
    /// p of the ratio of the law's squared residuals to those of the best passive linear law; `None` for known errors and for very long tables.
    pub p_spectrum: Option<f64>,
    /// p of the largest residual of the best passive linear law, relative to the size of the errors; `None` for very long tables.
    pub p_row: Option<f64>,
    /// p of the common differences between repeats of the sweep; `None` if fewer than five frequencies have several rows.
    pub p_repeats: Option<f64>,
    /// Frequency (Hz) of the row with this residual, if the residuals are noise without this row, and no noise with it; `None` otherwise.
    pub outlying_hz: Option<f64>,
}

impl ResidualPValues {
    /// Joint p of all tests: the smallest p times the number of tests, at most 1.
    pub fn p(&self) -> f64 {
        (self.smallest() * self.all().len() as f64).min(1.0)
    }

    /// The smallest p of a test.
    pub fn smallest(&self) -> f64 {
        self.all().into_iter().fold(1.0, f64::min)
    }

    fn all(&self) -> Vec<f64> {
        [Some(self.p_neighbours), self.p_size, self.p_heldout, self.p_spectrum, self.p_row, self.p_repeats]
            .into_iter()
            .flatten()
            .collect()
    }

    /// Returns `true` if repeats of the sweep differ alike at all frequencies, which no law explains.
    pub fn repeats_differ(&self) -> bool {
        self.p_repeats.is_some_and(|p| p * (self.all().len() as f64) < LEAST_P)
    }

    /// Returns `true` if the residuals are consistent with noise.
    pub fn is_noise(&self) -> bool {
        self.p() >= LEAST_P
    }
}

/// Statistics of the residuals' tests.
struct Statistics {
    /// The sum of products of neighbouring residuals, divided by the sum of squares; the sums of squared residuals of the fitted and of the held-out rows; their
    /// sum over the fitted rows, relative to that of the best passive linear law; the largest of the latter's squared residuals relative to the mean one of the law or
    /// of the errors; and the part of the squared differences between repeats that a common difference of each makes.
    sizes: [f64; 6],
    /// Index of the row with that largest residual; `None` if no passive linear law was fitted.
    outlying: Option<usize>,
}

/// `None` if the model has no prediction.
fn test_statistics(problem: &SweepProblem, fit: &SweepFit) -> Option<Statistics> {
    let predicted = problem.predict(&fit.values)?;
    let residuals = problem.residuals(&predicted, &fit.values);
    let part = |of_heldout: bool| -> Vec<[f64; 2]> {
        let rows = problem.sweep.rows.iter().zip(&residuals).filter(|(row, _)| row.is_heldout == of_heldout);
        rows.map(|(_, residual)| *residual).collect()
    };
    let squares = |rows: &[[f64; 2]]| rows.iter().flatten().map(|r| r * r).sum::<f64>();
    let fitted = part(false);
    let neighbours: f64 = fitted.windows(2).map(|pair| pair[0][0] * pair[1][0] + pair[0][1] * pair[1][1]).sum();
    // The division by the sum of squares makes the first statistic independent of the residuals' size, which the second statistic tests.
    let mut sizes = [
        neighbours / squares(&fitted),
        squares(&fitted),
        squares(&part(true)),
        0.0,
        0.0,
        part_of_repeats(problem, &residuals).unwrap_or(NO_REPEATS),
    ];
    let mut outlying = None;
    if let Some(spectrum) = fit_spectrum(&problem.sweep) {
        let form = problem.sweep.form;
        let rows: Vec<usize> = (0..predicted.len()).filter(|row| !problem.sweep.rows[*row].is_heldout).collect();
        let of_law: f64 = rows
            .iter()
            .map(|row| (&problem.sweep.rows[*row], &predicted[*row]))
            .zip(&spectrum.weights)
            .map(|((row, pair), weight)| {
                let ([storage, loss], [law_storage, law_loss]) = (form.moduli(row.pair), form.moduli(*pair));
                (weight * (storage - law_storage)).powi(2) + (weight * (loss - law_loss)).powi(2)
            })
            .sum();
        let n = rows.len() as f64;
        // Each row has two moduli. Stated errors have the size 1 in units of themselves.
        let least = if problem.sweep.has_errors() { 2.0 } else { 2.0 * SPECTRUM_ERROR * SPECTRUM_ERROR };
        let largest = rows.iter().zip(&spectrum.squares).max_by(|a, b| a.1.total_cmp(b.1));
        outlying = largest.map(|(row, _)| *row);
        sizes[3] = of_law / (spectrum.squares.iter().sum::<f64>() + n * least);
        sizes[4] = largest.map_or(0.0, |(_, square)| square / (of_law / n).max(least));
    }
    Some(Statistics { sizes, outlying })
}

/// Smallest number of frequencies with several rows from which differences between repeats are tested.
const FEWEST_REPEATED: usize = 5;

/// Share of a common difference in the squared differences between repeats. A sweep of a gel that has changed, or of another gel, differs by a common factor.
///
/// The first row of every frequency with several rows belongs to the first repeat, the second to the next, and so on. The errors of a wrong law are equal in all repeats
/// of a frequency, and leave the differences. `None` for too few such frequencies.
fn part_of_repeats(problem: &SweepProblem, residuals: &[[f64; 2]]) -> Option<f64> {
    let mut by_repeat: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut rest = residuals;
    for rows in rows_by_frequency(&problem.sweep.rows) {
        let (here, after) = rest.split_at(rows.len());
        rest = after;
        let middle = mean(here);
        for (number, residual) in here.iter().enumerate().filter(|_| here.len() > 1) {
            by_repeat.resize(by_repeat.len().max(number + 1), Vec::new());
            by_repeat[number].push([0, 1].map(|k| residual[k] - middle[k]));
        }
    }
    let squares = |pairs: &[[f64; 2]]| pairs.iter().flatten().map(|x| x * x).sum::<f64>();
    let common: f64 = by_repeat.iter().map(|pairs| pairs.len() as f64 * squares(&[mean(pairs)])).sum();
    let all: f64 = by_repeat.iter().map(|pairs| squares(pairs)).sum();
    (by_repeat.first()?.len() >= FEWEST_REPEATED).then(|| if all > 0.0 { common / all } else { 0.0 })
}

fn mean(pairs: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).sum::<f64>() / pairs.len() as f64)
}

/// Tests the residuals of a fit. If a row departs from every passive linear law, the other rows are tested alone: the row is named if the law then passes. `None` if the model
/// has no prediction.
///
/// # Errors
/// The errors of fitting.
pub fn test_residuals(problem: &SweepProblem, fit: &SweepFit, seed: u64) -> Result<Option<ResidualPValues>> {
    let Some((mut left, outlying)) = test(problem, fit, seed)? else { return Ok(None) };
    if let Some(row) = outlying.filter(|_| !left.is_noise() && left.p_row.is_some_and(|p| p < LEAST_P)) {
        let mut rows = problem.sweep.rows.clone();
        let outlying_hz = rows.remove(row).frequency_hz;
        let others = problem.with_rows(rows);
        let refitted = others.fit(seed, std::slice::from_ref(&fit.point))?;
        let tested = refitted.map(|fit| test(&others, &fit, seed)).transpose()?.flatten();
        left.outlying_hz = tested.filter(|(left, _)| left.is_noise()).map(|_| outlying_hz);
    }
    Ok(Some(left))
}

/// Tests the residuals of a fit. Oscillations are simulated from the fit and fitted again. The p-value of a test is the fraction of simulated oscillations
/// whose test statistic is at least as large. Also returns the index of the row with the largest residual of the best passive linear law.
fn test(problem: &SweepProblem, fit: &SweepFit, seed: u64) -> Result<Option<(ResidualPValues, Option<usize>)>> {
    let (Some(predicted), Some(found)) = (problem.predict(&fit.values), test_statistics(problem, fit)) else {
        return Ok(None);
    };
    let simulate = |k: usize| -> Result<Option<Statistics>> {
        let mut stream = RandomStream::new(seed, STREAM + k as u64);
        let other = problem.with_rows(problem.simulate_rows(&predicted, &fit.values, &mut stream));
        let refitted = other.fit_from(std::slice::from_ref(&fit.point))?;
        // A law that the frequencies do not determine may have no maximum. Its prediction without a new fit then stands for it: without simulations, every residual would be noise.
        Ok(test_statistics(&other, refitted.as_ref().unwrap_or(fit)))
    };
    let all: Vec<Option<Statistics>> = (0..N_SIMULATED[usize::from(found.sizes[5] != NO_REPEATS)])
        .into_par_iter()
        .map(simulate)
        .collect::<Result<_>>()?;
    let simulated: Vec<[f64; 6]> = all.into_iter().flatten().map(|statistics| statistics.sizes).collect();
    let p = |k: usize| {
        let n_larger = simulated.iter().filter(|sizes| sizes[k] >= found.sizes[k]).count();
        (1 + n_larger) as f64 / (1 + simulated.len()) as f64
    };
    let has_heldout = problem.sweep.rows.iter().any(|row| row.is_heldout);
    let left = ResidualPValues {
        p_neighbours: p(0),
        p_size: problem.sweep.has_errors().then(|| p(1)),
        p_heldout: has_heldout.then(|| p(2)),
        p_spectrum: found.outlying.filter(|_| !problem.sweep.has_errors()).map(|_| p(3)),
        p_row: found.outlying.map(|_| p(4)),
        p_repeats: (found.sizes[5] != NO_REPEATS).then(|| p(5)),
        outlying_hz: None,
    };
    Ok(Some((left, found.outlying)))
}

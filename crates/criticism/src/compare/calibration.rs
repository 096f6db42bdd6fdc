//! Significance of the tests for a misfit, calibrated by simulated records of noise.
//!
//! Most tests (panels) add columns of bias terms to the model. The gain of such a test is the increase of the log likelihood by the fit of these columns.
//!
//! Each record is simulated from the fitted model, with noise parameters drawn from their posterior. If noise is slow, the best-fit noise is too small and would raise false
//! alarms. White errors are drawn from the whitened residuals, so they may have any distribution. Each simulated record goes through the fits of the measured record. The p of a
//! test follows from a gamma distribution with the mean and variance of its simulated gains. The smallest p of each simulated record corrects this p for the number of tests.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Gamma};

use super::SIGNIFICANT;
use super::linear::{Linear, LinearFit};
use crate::NoiseValues;
use crate::Subject;
use base::error::Result;
use base::parameter::NOISE_SD;
use posterior::noise::NoiseLikelihood;
use posterior::patterns::rows::Columns;
use posterior::whiteness::{ljung_box, runs};
use sampling::ensemble::RandomStream;

/// Fits of one record: the model alone, and the model with the bias terms of each test.
pub struct TestStatistics {
    /// Fit of the model alone.
    pub base: LinearFit,
    /// Fits of the model with the added bias terms (columns) of each test, such as biases by the time since the force step. One fit per test.
    pub panel_fits: Vec<LinearFit>,
    /// Whitened residuals of the model alone.
    pub whitened: Vec<f64>,
    /// Statistics of all tests: first the gain (nats) of each test that adds bias terms to the model, then the results of the runs test and of the Ljung–Box test.
    pub statistics: Vec<f64>,
}

/// p values of all test statistics of one record, with the statistics' means and critical values from simulated records.
#[derive(Debug, Clone, PartialEq)]
pub struct Significance {
    /// p of each test statistic, without correction for the number of tests.
    pub p: Vec<f64>,
    /// p of each test statistic, corrected for the number of tests.
    pub p_familywise: Vec<f64>,
    /// Mean of each test statistic over the simulated records.
    pub mean: Vec<f64>,
    /// Smallest significant value of each test statistic.
    pub critical: Vec<f64>,
}

/// Tests one record: fits the model alone and with the bias terms of each test in `panels`, and computes all test statistics. `residual_m` holds measured minus predicted
/// positions (m), one value per row.
///
/// # Errors
/// [`base::Error::Numerical`] if a fit has no solution.
pub fn run_tests(
    linear: &Linear,
    likelihood: &NoiseLikelihood,
    residual_m: &[f64],
    panels: &[Columns],
) -> Result<TestStatistics> {
    let base = linear.fit_base(likelihood, residual_m)?;
    let with = linear.fit_with(likelihood, residual_m, &panels.iter().collect::<Vec<_>>(), &base)?;
    let whitened = linear.whitened(likelihood, residual_m, &base);
    let mut statistics: Vec<f64> = with.iter().map(|fit| (fit.objective - base.objective).max(0.0)).collect();
    statistics.push(runs(&whitened));
    statistics.push(ljung_box(&whitened));
    Ok(TestStatistics { base, panel_fits: with, whitened, statistics })
}

/// Simulates noise (m) at every row of a subject's record: white errors drawn from `pool` (whitened residuals of mean square 1), plus the other terms of the noise.
fn simulated_noise_m(
    subject: &Subject,
    position_m: &[f64],
    noise: &NoiseValues,
    pool: &[f64],
    stream: &mut RandomStream,
) -> Vec<f64> {
    let (record, recordings) = (&subject.experiment().record, subject.problem().recordings());
    let white_um = subject.noise().value(noise, &NOISE_SD);
    let mut terms = subject.noise().draw_terms(noise, stream);
    (0..record.n_rows())
        .map(|row| {
            let step_s = (row > 0).then(|| record.time_s[row] - record.time_s[row - 1]);
            let begins_cycle = row == 0 || recordings[row] != recordings[row - 1];
            let of_terms: Vec<[f64; 2]> = terms.iter_mut().map(|draw| draw(step_s, begins_cycle, stream)).collect();
            let sign = if stream.unit() < 0.5 { -1.0 } else { 1.0 };
            let white = sign * pool[stream.below(pool.len())];
            let error_um = of_terms.iter().fold(white_um * white, |sum, [error_um, _]| sum + error_um);
            1e-6 * error_um + of_terms.iter().map(|[_, gain]| gain).sum::<f64>() * position_m[row]
        })
        .collect()
}

/// Whitened residuals scaled to a mean square of 1.
fn pool_of(whitened: &[f64]) -> Vec<f64> {
    let mean_square = whitened.iter().map(|r| r * r).sum::<f64>() / whitened.len().max(1) as f64;
    whitened.iter().map(|r| r / mean_square.max(f64::MIN_POSITIVE).sqrt()).collect()
}

/// Returns the p values of one record, from `n_simulations` simulated records with random streams of `seed`.
///
/// # Errors
/// Errors of [`run_tests`].
pub fn calibrate_significance(
    subject: &Subject,
    linear: &Linear,
    panels: &[Columns],
    test_statistics: &TestStatistics,
    n_simulations: usize,
    seed: u64,
) -> Result<Significance> {
    let pool = pool_of(&test_statistics.whitened);
    let noises = linear.noise_draws(&subject.fitted, &test_statistics.base, n_simulations, seed);
    let of_one = |number: usize| -> Result<Vec<f64>> {
        let mut stream = RandomStream::new(seed, number as u64);
        let noise_m = simulated_noise_m(subject, linear.position_m(), &noises[number], &pool, &mut stream);
        let fitted = subject.fitted_m.iter().zip(linear.position_m()).zip(&noise_m);
        let observed_m: Vec<Option<f64>> = fitted.map(|((y, f), e)| y.map(|_| f + e)).collect();
        let likelihood = subject.fitted.with_observed(&observed_m);
        let residual_m: Vec<f64> = observed_m.iter().zip(&noise_m).map(|(y, e)| y.map_or(0.0, |_| *e)).collect();
        Ok(run_tests(linear, &likelihood, &residual_m, panels)?.statistics)
    };
    let simulated: Vec<Vec<f64>> = (0..n_simulations).into_par_iter().map(of_one).collect::<Result<_>>()?;
    Ok(corrected(&test_statistics.statistics, &simulated))
}

/// Computes p of each test statistic from the simulated records, without and with correction for the number of tests.
fn corrected(values: &[f64], simulated: &[Vec<f64>]) -> Significance {
    let tails: Vec<Option<Gamma>> = (0..values.len()).map(|k| tail(simulated.iter().map(|s| s[k]))).collect();
    let p_of = |k: usize, value: f64| tails[k].as_ref().map_or(1.0, |gamma| gamma.sf(value));
    let smallest: Vec<f64> = simulated
        .iter()
        .map(|statistics| statistics.iter().enumerate().map(|(k, value)| p_of(k, *value)).fold(1.0, f64::min))
        .collect();
    let p: Vec<f64> = values.iter().enumerate().map(|(k, value)| p_of(k, *value)).collect();
    let familywise = |p: &f64| (1 + smallest.iter().filter(|s| *s <= p).count()) as f64 / (1 + simulated.len()) as f64;
    let mean = |k: usize| simulated.iter().map(|statistics| statistics[k]).sum::<f64>() / simulated.len().max(1) as f64;
    let mut sorted = smallest.clone();
    sorted.sort_by(f64::total_cmp);
    // The corrected p is (1 + number of records with a smallest p at or below p)/(1 + number of records). It must be below 0.05.
    let place = (SIGNIFICANT * (1 + simulated.len()) as f64).ceil() as usize;
    let least_p = sorted.get(place.saturating_sub(2)).copied().unwrap_or(0.0);
    let critical =
        tails.iter().map(|tail| tail.as_ref().map_or(f64::INFINITY, |gamma| gamma.inverse_cdf(1.0 - least_p)));
    Significance {
        p_familywise: p.iter().map(familywise).collect(),
        mean: (0..values.len()).map(mean).collect(),
        critical: critical.collect(),
        p,
    }
}

/// Gamma distribution with the mean and variance of some values; `None` if either is not positive.
fn tail(values: impl Iterator<Item = f64> + Clone) -> Option<Gamma> {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean > 0.0 && variance > 0.0).then(|| Gamma::new(mean * mean / variance, mean / variance).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve statistics of a simulated record: halves of squared normals, like gains. Three of them are equal.
    fn record(number: u64) -> Vec<f64> {
        let mut stream = RandomStream::new(3, number);
        let mut half_square = || 0.5 * stream.normal().powi(2);
        let mut statistics: Vec<f64> = (0..10).map(|_| half_square()).collect();
        statistics.extend([statistics[0], statistics[0]]);
        statistics
    }

    /// In 600 records of noise, 5 % (30 records) may have a finding. The allowed deviation is six standard deviations (false failures below 1e-6). The standard deviation includes
    /// the scatter of the 999 simulated records, which all 600 records share.
    #[test]
    fn records_of_noise_show_something_as_often_as_they_may() {
        let simulated: Vec<Vec<f64>> = (0..999).map(record).collect();
        let is_false_alarm =
            |number: &u64| corrected(&record(*number), &simulated).p_familywise.iter().any(|p| *p < 0.05);
        let n = (10_000..10_600).filter(is_false_alarm).count();
        let sd = (600.0_f64 * 0.05 * 0.95 * (1.0 + 600.0 / 999.0)).sqrt();
        assert!((n as f64 - 30.0).abs() < 6.0 * sd, "{n} of 600");
    }

    #[test]
    fn what_no_simulated_record_shows_is_as_rare_as_they_can_tell() {
        let simulated: Vec<Vec<f64>> = (0..99).map(record).collect();
        let mut values = record(5_000);
        values[4] = 60.0;
        let significance = corrected(&values, &simulated);
        assert_eq!(significance.p_familywise[4], 0.01);
        assert!(significance.p[4] < 1e-6);
        values[4] = 1.01 * significance.critical[4];
        assert!(corrected(&values, &simulated).p_familywise[4] < SIGNIFICANT);
        values[4] = 0.9 * significance.critical[4];
        assert!(corrected(&values, &simulated).p_familywise[4] >= SIGNIFICANT);
    }
}

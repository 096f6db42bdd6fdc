//! Comparison of a model with a record: many tests of its misfit, corrected together.
//!
//! Every test ([`posterior::patterns::panels`]) is a set of columns added to the model. The gain of these columns is a likelihood ratio with the noise estimated anew ([`linear`]). Records
//! simulated from the model and its fitted noise decide whether the gain is significant ([`calibration`]).

pub mod calibration;
mod explained_findings;
pub mod figures;
pub mod linear;
mod normal;
mod sentences;

use crate::NoiseValues;
use calibration::{Significance, TestStatistics, calibrate_significance, run_tests};
use documents::comparison::{ColumnBias, Comparison, InapplicableTest, TestEntry};
use documents::errors::ModelErrors;
use explained_findings::RecordResults;
use linear::Linear;

use super::own_errors::own_errors;
use super::refit::Refitted;
use super::residual_structure::measure_misfit;
use super::{Candidate, Fitted, Subject, outliers};
use base::error::Result;
use posterior::patterns::panels::{self, Panel};
use posterior::patterns::rows::{Column, Columns, TestRows};
use posterior::whiteness;

/// Family-wise probability below which a test's result is a finding.
pub const SIGNIFICANT: f64 = 0.05;
/// Largest and smallest default number of simulated records; long records get the smallest. The p over all tests then comes in steps of 1/60.
const N_SIMULATIONS: (usize, usize) = (199, 59);
/// Total number of fitted rows in all simulated records above which fewer records are simulated.
const SIMULATED_ROWS: usize = 3_000_000;

/// Default number of simulated records for a number of fitted rows.
pub fn default_simulations(n_fitted: usize) -> usize {
    (SIMULATED_ROWS / n_fitted.max(1)).clamp(N_SIMULATIONS.1, N_SIMULATIONS.0)
}

/// Result of a comparison, with the data of its figures.
pub struct ComparisonResult {
    /// Document of the comparison.
    pub comparison: Comparison,
    /// The experiment, without outliers.
    pub subject: Subject,
    /// Best fit of the model.
    pub fitted: Fitted,
    /// Standard deviation (m) of the model's position due to its parameters' uncertainty, one value per row.
    pub position_sd_m: Vec<f64>,
    /// Whitened residuals, one entry per row, the scored cycle included: residuals divided by their standard deviation given the earlier residuals. The noise is estimated
    /// together with the leading finding, because the fit's own noise has absorbed part of the misfit.
    pub whitened: Vec<Option<f64>>,
    /// Time (s) since the last force step before each row.
    pub time_since_step_s: Vec<Option<f64>>,
    /// Ends (s) of the bins of the time since a step, equally spaced in logarithm.
    pub lag_ends_s: Vec<f64>,
}

/// Compares a candidate with the record: fits it and tests where it fails. `errors` are the errors of its sampled posterior on the same cycles. With `None`, the document shows
/// the errors of the best fit.
///
/// # Errors
/// [`base::Error::Numerical`] if the candidate cannot be fitted or has no derivatives.
pub fn compare_model(
    subject: &Subject,
    candidate: &Candidate,
    errors: Option<ModelErrors>,
    n_simulations: usize,
    seed: u64,
) -> Result<ComparisonResult> {
    let whole = subject;
    let (subject, fitted, outlier_rows) = outliers::exclude_outliers(whole, candidate)?;
    let subject = &subject;
    let linear = Linear::new(subject, candidate, &fitted)?;
    let record = &subject.experiment().record;
    let is_fitted = subject.fitted_m.iter().map(Option::is_some).collect();
    let rows = TestRows::new(record, &fitted.position_m, is_fitted);
    let (panels, left_out) = panels::panels(&rows);
    let columns: Vec<Columns> = panels.iter().map(Panel::values).collect();
    let residual_m = residuals_m(&subject.fitted_m, &fitted.position_m);
    let test_statistics = run_tests(&linear, &subject.fitted, &residual_m, &columns)?;
    let significance = calibrate_significance(subject, &linear, &columns, &test_statistics, n_simulations, seed)?;
    let mut entries = Vec::with_capacity(panels.len() + 2);
    for (k, panel) in panels.iter().enumerate() {
        let bars = bars(subject, &linear, &residual_m, panel, rows.is_fitted(), &test_statistics.panel_fits[k])?;
        let rms_um = 1e6 * rms_m(subject, &test_statistics.panel_fits[k].correction_m);
        entries.push(TestEntry {
            is_along_force: panel.is_along_force,
            rms_um: Some(rms_um),
            ..entry(k, panel.place, panel.title, bars, &test_statistics, &significance)
        });
    }
    entries.extend(whiteness_entries(&test_statistics, &significance));
    let noise_um = subject.noise_um();
    let significant: Vec<usize> = (0..entries.len()).filter(|k| entries[*k].p_familywise < SIGNIFICANT).collect();
    let shown = RecordResults {
        linear: &linear,
        likelihood: &subject.fitted,
        residual_m: &residual_m,
        columns: &columns,
        primary: panels.iter().position(|panel| panel.place == "input_correlation"),
        looks: &test_statistics,
    };
    let standings = explained_findings::order_findings(&shown, &significant, &significance)?;
    let noise = standings
        .first()
        .and_then(|leading| test_statistics.panel_fits.get(leading.statistic))
        .map_or(&fitted.noise, |fit| &fit.noise);
    let findings = standings
        .iter()
        .map(|s| {
            sentences::describe_finding(&entries[s.statistic], noise_um, s.explained_by.map(|source| &entries[source]))
        })
        .collect();
    let compared = Refitted { candidate: candidate.clone(), fitted: fitted.clone(), future: None };
    let errors = errors.map_or_else(|| own_errors(whole, &compared), Ok)?;
    let experiment = subject.experiment();
    let mut comparison = Comparison {
        experiment: experiment.specimen_id.clone(),
        effects: candidate.effects.clone(),
        fitted_cycles: experiment.calibration_cycles.clone(),
        heldout_cycles: experiment.heldout_cycles.clone(),
        outlier_rows,
        rmse_fitted_um: errors.rmse_fitted_um,
        rmse_heldout_um: errors.rmse_heldout_um,
        noise_um,
        sentence: String::new(),
        findings,
        panels: entries,
        left_out: left_out
            .into_iter()
            .map(|left| InapplicableTest { place: left.place.into(), reason: left.reason.into() })
            .collect(),
        simulated_records: n_simulations,
    };
    let misfit = (!subject.is_noise_unknown()).then(|| measure_misfit(subject, &compared, &[])).transpose()?;
    comparison.sentence = sentences::describe_comparison(&comparison, misfit);
    Ok(ComparisonResult {
        comparison,
        position_sd_m: linear.position_sd_m(&subject.fitted, &fitted.noise)?,
        whitened: whitened(subject, &fitted, noise),
        time_since_step_s: rows.time_since_step_s(),
        lag_ends_s: rows.lag_ends_s(MAP_LAG_BINS),
        subject: subject.clone(),
        fitted,
    })
}

/// Root mean square of values (m) over the fitted rows.
fn rms_m(subject: &Subject, values_m: &[f64]) -> f64 {
    let fitted = || values_m.iter().zip(&subject.fitted_m).filter(|(_, y)| y.is_some()).map(|(value, _)| value);
    (fitted().map(|value| value * value).sum::<f64>() / fitted().count().max(1) as f64).sqrt()
}

/// Number of bins of the time since a step in the failure map.
const MAP_LAG_BINS: usize = 12;

fn residuals_m(observed_m: &[Option<f64>], position_m: &[f64]) -> Vec<f64> {
    observed_m.iter().zip(position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect()
}

/// Whitened residuals of the fitted and scored rows; `None` in other rows.
fn whitened(subject: &Subject, fitted: &Fitted, noise: &NoiseValues) -> Vec<Option<f64>> {
    let both = subject.observed_m();
    let residual_m = residuals_m(&both, &fitted.position_m);
    let mut white = subject.all.whiten(&[residual_m], &fitted.position_m, noise).concat().into_iter();
    both.iter().map(|y| y.and_then(|_| white.next())).collect()
}

/// Bias (µm) in each column of a panel, with its standard error. The noise is estimated together with the panel's columns.
fn bars(
    subject: &Subject,
    linear: &Linear,
    residual_m: &[f64],
    panel: &Panel,
    is_fitted: &[bool],
    fit: &linear::LinearFit,
) -> Result<Vec<ColumnBias>> {
    let masked = |column: &Column| -> Vec<f64> {
        let fitted = column.values.iter().zip(&subject.fitted_m);
        fitted.map(|(value, y)| y.map_or(0.0, |_| *value)).collect()
    };
    let weight = |column: &Column| -> Vec<f64> {
        let masked = masked(column);
        let square: f64 = masked.iter().map(|value| value * value).sum();
        masked.iter().map(|value| value / square).collect()
    };
    let means = match &panel.by_cycle {
        Some(by_cycle) => linear.cycle_means_m(&subject.fitted, residual_m, by_cycle, is_fitted, fit)?,
        None => {
            let weights: Vec<Vec<f64>> = panel.columns.iter().map(weight).collect();
            linear.weighted_means_m(&subject.fitted, residual_m, &panel.values(), fit, &weights)?
        }
    };
    let bar = |(column, (mean_m, sd_m)): (&Column, (f64, f64))| ColumnBias {
        label: column.label.clone(),
        phrase: column.phrase.clone(),
        lag_s: column.lag_s,
        stretches_s: stretches_s(&subject.experiment().record.time_s, &column.values),
        bias_um: 1e6 * mean_m,
        sd_um: 1e6 * sd_m,
    };
    let bars = panel.columns.iter().zip(means).map(bar).collect();
    Ok(if panel.place == "harmonics" { amplitudes(bars) } else { bars })
}

/// Largest number of stretches of time of one column that a document lists. If a column has more, the document lists none.
const MOST_STRETCHES: usize = 400;

/// Starts and ends (s) of the stretches of rows in which a column is not zero. Each row counts from the time of the previous row to its own.
fn stretches_s(time_s: &[f64], values: &[f64]) -> Vec<[f64; 2]> {
    let rows: Vec<usize> = (0..values.len()).filter(|row| values[*row] != 0.0).collect();
    let stretch = |rows: &[usize]| Some([time_s[rows.first()?.saturating_sub(1)], time_s[*rows.last()?]]);
    let stretches: Vec<[f64; 2]> = rows.chunk_by(|a, b| a + 1 == *b).filter_map(stretch).collect();
    if stretches.len() > MOST_STRETCHES { Vec::new() } else { stretches }
}

/// Combines the cosine and sine columns of each harmonic, which are neighbours, into one amplitude.
fn amplitudes(bars: Vec<ColumnBias>) -> Vec<ColumnBias> {
    let amplitude = |pair: &[ColumnBias]| {
        let size_um = pair.iter().map(|bar| bar.bias_um.powi(2)).sum::<f64>().sqrt();
        let square: f64 = pair.iter().map(|bar| (bar.bias_um * bar.sd_um).powi(2)).sum();
        let sd_um = square.sqrt() / size_um.max(f64::MIN_POSITIVE);
        ColumnBias { bias_um: size_um, sd_um, ..pair[0].clone() }
    };
    bars.chunk_by(|a, b| a.label == b.label).map(amplitude).collect()
}

/// Entry of the test with the index `k`, which is neither along the force nor has a bias in µm.
fn entry(
    k: usize,
    place: &str,
    title: &str,
    bars: Vec<ColumnBias>,
    test_statistics: &TestStatistics,
    significance: &Significance,
) -> TestEntry {
    TestEntry {
        place: place.into(),
        title: title.into(),
        is_along_force: false,
        gain_nats: test_statistics.statistics[k],
        gain_by_chance_nats: significance.mean[k],
        rms_um: None,
        p: significance.p[k],
        p_familywise: significance.p_familywise[k],
        bars,
    }
}

/// Entries of the tests for runs and for autocorrelation. Their bars are correlations instead of biases in µm.
fn whiteness_entries(test_statistics: &TestStatistics, significance: &Significance) -> [TestEntry; 2] {
    let n = test_statistics.whitened.len();
    let sd_um = whiteness::white_limit(n) / 1.96;
    let correlation = |(rho, lag): (&f64, usize)| ColumnBias {
        label: lag.to_string(),
        phrase: format!("at lag {lag}"),
        lag_s: None,
        stretches_s: Vec::new(),
        bias_um: *rho,
        sd_um,
    };
    let rho = whiteness::autocorrelation(&test_statistics.whitened);
    let score = whiteness::runs_score(&test_statistics.whitened);
    let first = test_statistics.panel_fits.len();
    let made = |k, place, title, bars| entry(k, place, title, bars, test_statistics, significance);
    let of_runs = ColumnBias {
        label: "score".into(),
        phrase: String::new(),
        lag_s: None,
        stretches_s: Vec::new(),
        bias_um: score,
        sd_um: 1.0,
    };
    [
        made(first, "runs", "runs of one sign (standard score)", vec![of_runs]),
        made(
            first + 1,
            "autocorrelation",
            "autocorrelation of whitened residuals: lag",
            rho.iter().zip(1..).map(correlation).collect(),
        ),
    ]
}

#[cfg(test)]
mod tests;

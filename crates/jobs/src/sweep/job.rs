//! `sample` for an oscillation: samples the posterior, tests the residuals and summarises both.

use super::noise_like::{ResidualPValues, test_residuals};
use super::problem::{SweepFit, SweepProblem};
use base::error::{Error, Result};
use base::parameter::RELATIVE_NOISE;
use documents::oscillation::{Frequencies, OscillationMisfit, OscillationSummary};
use documents::posterior::{ModelSummary, Warning, WarningKind};
use figures::number::format_significant;
use posterior::modes::several_modes;
use posterior::monitor::Monitor;
use posterior::sample::{
    natural_columns, plain_summaries, sample_without_checkpoint, sampler_summary, with_parameter_names,
};
use record::SweepForm;
use sampling::SamplerOptions;
use sampling::diagnostics::DrawColumn;
use sampling::ensemble::SampleOutcome;

/// Number of draws from which the posterior's predictions are computed.
const N_DRAWS: usize = 400;
/// Ratio of a parameter's 95 % to its 5 % posterior quantile above which the data count as not determining the parameter.
const UNDETERMINED: f64 = 30.0;
/// Number of starting points for the sampler's search for modes.
const N_STARTS: usize = 96;

/// Posterior of an oscillation with its draws and predictions.
pub struct SweepResult {
    /// Document that describes the posterior.
    pub summary: OscillationSummary,
    /// Draws, with the diagnostics of the sampler.
    pub outcome: SampleOutcome,
    /// Draws of each sampled parameter, in its natural unit.
    pub columns: Vec<DrawColumn>,
    /// Values of all parameters in natural units, fixed ones included, for some of the draws.
    pub values: Vec<Vec<f64>>,
    /// Posterior mean of the two predicted values of each row: G′ and G″ in Pa, or modulus in Pa and phase in rad.
    pub mean: Vec<[f64; 2]>,
}

/// Samples the posterior and tests the residuals.
///
/// # Errors
/// [`Error::Interrupted`] when stopped; otherwise the errors of sampling and fitting.
pub fn run(problem: &SweepProblem, options: &SamplerOptions, monitor: &dyn Monitor) -> Result<SweepResult> {
    monitor.stage("sampling the posterior");
    let starts = problem.starts(options.seed, N_STARTS);
    let outcome = sample_without_checkpoint(problem, &starts, options, monitor)?;
    monitor.stage("testing the residuals");
    let columns = natural_columns(&problem.priors, &outcome);
    let values: Vec<Vec<f64>> = outcome.draws.subsample(N_DRAWS).iter().map(|point| problem.values(point)).collect();
    let mean = mean_prediction(problem, &values)?;
    let fit = problem.fit(options.seed, &outcome.draws.subsample(1))?.ok_or_else(no_fit)?;
    let left = test_residuals(problem, &fit, options.seed)?.ok_or_else(no_fit)?;
    let of_fit = problem.predict(&fit.values).ok_or_else(no_fit)?;
    let mut summary = OscillationSummary {
        experiment: problem.sweep.specimen_id.clone(),
        model: model_summary(problem),
        parameters: plain_summaries(&problem.priors, &columns),
        sampler: sampler_summary(options, &outcome),
        frequencies: frequencies(problem),
        poisson_ratio: problem.sweep.poisson_ratio,
        misfit: misfit(problem, &of_fit, &fit, &left),
        converged: outcome.converged,
        warnings: Vec::new(),
    };
    let messages = with_parameter_names(&outcome.messages, &problem.priors);
    let modes = several_modes(&problem.priors, &columns, |name| name != RELATIVE_NOISE.name);
    summary.warnings = warnings(problem, &summary, &left, (&messages, modes));
    Ok(SweepResult { summary, outcome, columns, values, mean })
}

/// Summary of the model for documents. Its noise is `known` if the table states the errors, or `relative` if one relative error is inferred.
pub(super) fn model_summary(problem: &SweepProblem) -> ModelSummary {
    let noise = if problem.sweep.has_errors() { "known" } else { "relative" };
    ModelSummary { noise: vec![noise.into()], ..problem.specification.summary() }
}

pub(crate) fn no_fit() -> Error {
    Error::numerical("the law has no prediction at these frequencies", "check the table's units, and the priors")
}

fn mean_prediction(problem: &SweepProblem, values: &[Vec<f64>]) -> Result<Vec<[f64; 2]>> {
    let all: Vec<Vec<[f64; 2]>> = values.iter().filter_map(|values| problem.predict(values)).collect();
    let n = all.len() as f64;
    if all.is_empty() {
        return Err(no_fit());
    }
    let mean = |row: usize| [0, 1].map(|k| all.iter().map(|predicted| predicted[row][k]).sum::<f64>() / n);
    Ok((0..problem.sweep.rows.len()).map(mean).collect())
}

pub(crate) fn frequencies(problem: &SweepProblem) -> Frequencies {
    let rows = &problem.sweep.rows;
    let heldout = rows.iter().filter(|row| row.is_heldout).count();
    let [lowest_hz, highest_hz] = problem.sweep.range_hz();
    Frequencies { fitted: rows.len() - heldout, heldout, lowest_hz, highest_hz }
}

/// Summarises the residuals of a prediction. The standard deviations of the errors are those of the fit.
pub(crate) fn misfit(
    problem: &SweepProblem,
    predicted: &[[f64; 2]],
    fit: &SweepFit,
    left: &ResidualPValues,
) -> OscillationMisfit {
    let sweep = &problem.sweep;
    let residuals = problem.residuals(predicted, &fit.values);
    let mut relative = [Vec::new(), Vec::new()];
    let (mut heldout, mut errors) = (Vec::new(), Vec::new());
    for ((row, pair), residual) in sweep.rows.iter().zip(predicted).zip(&residuals) {
        let [storage, loss] = sweep.form.moduli(*pair);
        let [measured_storage, measured_loss] = sweep.form.moduli(row.pair);
        let size = storage.hypot(loss);
        relative[usize::from(row.is_heldout)]
            .extend([(measured_storage - storage) / size, (measured_loss - loss) / size]);
        if row.is_heldout {
            heldout.extend(residual);
        }
        let sd = problem.sd(row, *pair, &fit.values);
        // The error of a phase angle is already relative.
        let over = [size, if sweep.form == SweepForm::ModulusAndPhase { 1.0 } else { size }];
        errors.extend([sd[0] / over[0], sd[1] / over[1]]);
    }
    let rms = |values: &[f64]| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let [fitted, unseen] = relative;
    OscillationMisfit {
        relative_fitted: rms(&fitted),
        relative_heldout: (!unseen.is_empty()).then(|| rms(&unseen)),
        heldout_over_error: (!heldout.is_empty()).then(|| rms(&heldout)),
        error_relative: rms(&errors),
        errors_known: sweep.has_errors(),
        p: left.p(),
        repeats_differ: left.repeats_differ(),
    }
}

/// Warning that the best fit to one oscillation leaves more than measurement errors; `None` if it does not.
///
/// # Errors
/// The errors of fitting.
pub(crate) fn misfit_alone(problem: &SweepProblem, seed: u64) -> Result<Option<Warning>> {
    let fit = problem.fit(seed, &[])?.ok_or_else(no_fit)?;
    let left = test_residuals(problem, &fit, seed)?.ok_or_else(no_fit)?;
    Ok(misfit_warning(&left))
}

/// Sentence on repeats of a sweep that are not repeats.
pub const REPEATS_DIFFER: &str = "repeats of the sweep differ at all frequencies alike";
/// Reason and remedy.
pub const SEVERAL_GELS: &str = "the gel changed, or the rows are of several gels: give every sweep a table of its own";

fn misfit_warning(left: &ResidualPValues) -> Option<Warning> {
    if left.is_noise() {
        return None;
    }
    let warning = |text: String, advice: String| Some(Warning { kind: WarningKind::MisfitAboveNoise, text, advice });
    let p = left.p();
    if let Some(frequency_hz) = left.outlying_hz {
        let place = format_significant(frequency_hz, 4);
        let advice = "measure this row again, or remove it from the table, and run the same command";
        let text = format!("no linear law explains the row at {place} Hz together with the other rows (p = {p:.3})");
        return warning(text, advice.into());
    }
    if left.repeats_differ() {
        let advice = format!("{SEVERAL_GELS}, and sample them together to see whether they agree");
        return warning(format!("{REPEATS_DIFFER}, which no law explains (p = {p:.3})"), advice);
    }
    let smallest = |of: Option<f64>| of.is_some_and(|of| of <= left.smallest());
    let text = match () {
        () if smallest(left.p_size) => {
            format!("the residuals of the law exceed the table's errors (p = {p:.3})")
        }
        () if smallest(left.p_spectrum) => {
            format!(
                "another linear law fits much better: the residuals of this law are larger than measurement errors (p = {p:.3})"
            )
        }
        () if smallest(Some(left.p_neighbours)) => {
            format!(
                "residuals of neighbouring frequencies are correlated, which measurement errors are not (p = {p:.3})"
            )
        }
        () if smallest(left.p_row) => {
            format!("some rows depart from every linear law by more than measurement errors (p = {p:.3})")
        }
        () => format!("residuals of held-out frequencies are larger than measurement errors (p = {p:.3})"),
    };
    warning(text, "run `diagnose`, or `compare --laws`, which tries every law".into())
}

fn warnings(
    problem: &SweepProblem,
    summary: &OscillationSummary,
    left: &ResidualPValues,
    (messages, modes): (&[String], Option<Warning>),
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |kind, text: String, advice: &str| warnings.push(Warning { kind, text, advice: advice.into() });
    if !summary.converged {
        let text = "the draws have not converged".into();
        warn(WarningKind::NotConverged, text, "give more steps (--steps), or a narrower prior");
    }
    messages.iter().for_each(|text| warn(WarningKind::Sampler, text.clone(), "check figures/trace.png"));
    if let Some(misfit) = misfit_warning(left) {
        warn(misfit.kind, misfit.text, &misfit.advice);
    }
    let law = problem.model.parameters();
    let has_modes = modes.is_some();
    if let Some(modes) = modes {
        warn(modes.kind, modes.text, &modes.advice);
    }
    for parameter in summary.parameters.iter().filter(|_| !has_modes) {
        let is_of_law = law.iter().any(|spec| spec.name == parameter.name && spec.unit.starts_with("Pa"));
        if is_of_law && parameter.q95 > UNDETERMINED * parameter.q05 {
            let text = format!("these frequencies do not determine {}", parameter.name);
            warn(
                WarningKind::Undetermined,
                text,
                "measure lower or higher frequencies, use a simpler law, or fix the parameter with --set",
            );
        }
    }
    if summary.frequencies.heldout == 0 {
        let text = "no frequency is held out, so nothing checks the law's predictions".into();
        warn(WarningKind::NothingHeldOut, text, "hold frequencies out with `heldout_hz` in [measurement]");
    }
    if problem.sweep.n_incomplete > 0 {
        let text = format!("{} rows lack a number and are ignored", problem.sweep.n_incomplete);
        warn(WarningKind::NoiseUnknown, text, "complete these rows if they were measured");
    }
    if !problem.sweep.has_errors() {
        let text = format!("the table gives no errors, so one relative error is inferred as `{}`", RELATIVE_NOISE.name);
        warn(WarningKind::NoiseUnknown, text, "add columns `storage_sd_pa` and `loss_sd_pa` if the errors are known");
    }
    warnings
}

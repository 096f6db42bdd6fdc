//! Samples a posterior: prepares the surrogate, runs the ensemble sampler, checks draws by full finite elements and summarises the results.

use std::path::Path;
use std::time::Instant;

use super::advice::{WarningInputs, far_from_prior, impossible_positions_warning, warnings};
use super::full_check::{self, FullCheck, N_CHECK_DRAWS, NaturalDraw, mean_trajectory, rmse_m};
use super::heldout::{self, Score};
use super::judgement::{Judgement, median_row_sd_um};
use super::large_displacement;
use super::log_score::log_score;
use super::modes::several_modes;
use super::prepared::{KeptSurrogate, PreparedModel};
use super::problem::{Problem, TAIL_MASS};
use crate::likelihood::ReducedPosterior;
use crate::monitor::Monitor;
use crate::prior::PriorSet;
use crate::starts::starts;
use crate::trust::trust;
use base::distribution::Distribution;
use base::error::{Error, InputPlace, Result, Setting};
use base::files::write_atomically;
use documents::posterior::*;
use documents::trust::Trust;
use models::effects::POSITION_OFFSET;
use record::{Experiment, NoiseOrigin, ReferenceNoise};
use sampling::checkpoint;
use sampling::diagnostics::ranks::BlomScores;
use sampling::diagnostics::{DrawColumn, ParameterDiagnostics, diagnose};
use sampling::ensemble::{Checkpointing, Progress, RunControl, SampleOutcome};
use sampling::{LogDensity, SamplerOptions, sample as sample_density};

/// Largest number of rows at which posterior draws are predicted. A million rows take 3.4 GB of memory.
const MOST_ROWS: usize = 1_200_000;
/// Time between two writes of the checkpoint file.
const CHECKPOINT_INTERVAL: std::time::Duration = std::time::Duration::from_secs(10);

/// Request for sampling a posterior.
#[derive(Clone)]
pub struct SampleRequest<'a> {
    /// Settings of the sampler.
    pub options: SamplerOptions,
    /// Surrogate from an earlier run. It is used only if it was built from this problem's inputs.
    pub kept_surrogate: Option<KeptSurrogate>,
    /// File that keeps the sampler's state; `None` for no checkpoints.
    pub checkpoint: Option<&'a Path>,
    /// True to resume from the checkpoint, if that file exists.
    pub resume: bool,
}

/// Result of sampling a posterior.
pub struct SampleResult {
    /// Summary of the posterior, as written to `posterior.json`.
    pub summary: PosteriorSummary,
    /// Model that was sampled, with its surrogate.
    pub model: PreparedModel,
    /// Draws with the sampler's diagnostics.
    pub outcome: SampleOutcome,
    /// Draws in the parameters' units: one column per sampled parameter.
    pub columns: Vec<DrawColumn>,
    /// Predictive quantiles (m) of the position at every row, for the probabilities in [`crate::gaussian_predictive::BAND_PROBABILITIES`].
    pub bands_m: Vec<[f64; 5]>,
    /// Noise standard deviation with which residuals are compared; `None` if it is neither given nor estimated.
    pub yardstick: Option<ReferenceNoise>,
    /// Name of each stage and its wall-clock duration in s.
    pub timing_s: Vec<(&'static str, f64)>,
}

/// Refuses a record with so many rows that the predictions of all draws would not fit into memory.
///
/// # Errors
/// [`Error::Input`] with the remedy.
pub fn refuse_too_many_rows(n_rows: usize) -> Result<()> {
    if n_rows <= MOST_ROWS {
        return Ok(());
    }
    let every = n_rows.div_ceil(MOST_ROWS);
    Err(Error::input(
        InputPlace::default().at_key("measurement"),
        format!("the record has {n_rows} rows, but posterior draws can be predicted at {MOST_ROWS} rows at most"),
        format!("average every {every} rows into one, or use `fit`, which takes the whole record"),
    ))
}

/// Refuses a problem with every parameter fixed, or with too many rows for the predictions.
///
/// # Errors
/// [`Error::Input`] in both cases.
pub fn refuse_nothing_to_sample(problem: &Problem) -> Result<()> {
    refuse_too_many_rows(problem.experiment.record.n_rows())?;
    if problem.priors.priors().is_empty() {
        return Err(Error::input(
            InputPlace::setting(Setting::Fixed),
            "every parameter is fixed, so there is nothing to infer",
            "leave at least one parameter free, or use `simulate`",
        ));
    }
    Ok(())
}

/// Samples a posterior, checks it and summarises it.
///
/// # Errors
/// [`base::Error::Interrupted`] if the user stops the run, whose checkpoint is kept; errors of surrogate, sampler and checks.
pub fn run(problem: &Problem, request: &SampleRequest, monitor: &dyn Monitor) -> Result<SampleResult> {
    refuse_too_many_rows(problem.experiment.record.n_rows())?;
    let mut timing_s = Vec::new();
    let mut clock = Instant::now();
    let mut lap = |stage: &'static str| {
        timing_s.push((stage, clock.elapsed().as_secs_f64()));
        clock = Instant::now();
    };
    let model = PreparedModel::new(problem, request.kept_surrogate.clone(), monitor)?;
    lap("surrogate");
    let posterior = model.posterior();
    let outcome = sample(&model, &posterior, request, monitor)?;
    lap("sampling");
    monitor.stage(&match (problem.outside(), problem.finite_elements()) {
        (Some(outside), _) => format!("checking by {}", outside.title()),
        (None, Some(_)) => "checking by full finite elements".into(),
        (None, None) => "predicting all cycles".into(),
    });
    let columns = natural_columns(&problem.priors, &outcome);
    let spread = outcome.draws.subsample(N_CHECK_DRAWS);
    let draws: Vec<NaturalDraw> = spread.iter().map(|point| posterior.natural(point)).collect();
    let check = full_check::check(&model, &draws)?;
    lap("full finite elements");
    let bands_m = heldout::bands_m(&check);
    let heldout_m = problem.positions_of(&problem.experiment.heldout_cycles);
    let score = heldout::score(&check, &bands_m, &problem.experiment.record, &heldout_m, request.options.seed);
    lap("held-out score");
    let large_displacement = large_displacement::estimate(problem, &columns, &check)?;
    lap("large displacements");
    let yardstick = problem.experiment.reference_noise();
    let summary = summarise(&model, request, &outcome, &columns, &check, score, large_displacement, yardstick);
    lap("summary");
    Ok(SampleResult { summary, model, outcome, columns, bands_m, yardstick, timing_s })
}

/// Draws from the posterior without checks.
///
/// # Errors
/// [`base::Error::Interrupted`] if the user stops the run; errors of the sampler.
pub fn sample(
    model: &PreparedModel,
    posterior: &ReducedPosterior,
    request: &SampleRequest,
    monitor: &dyn Monitor,
) -> Result<SampleOutcome> {
    monitor.stage("sampling the posterior");
    let problem = &model.problem;
    if problem.specification.noise.iter().any(|n| n == "gain") && problem.experiment.calibration_cycles.len() < 2 {
        monitor.warn(
            "gain and offset differ from cycle to cycle, but only one cycle is fitted: the prior alone determines their spread",
        );
    }
    let starts = starts(model, request.options.seed)?;
    let resumed = match request.checkpoint {
        Some(path) if request.resume => checkpoint::read(path)?,
        _ => None,
    };
    let progress = |progress: &Progress| monitor.sampling(progress);
    let sink = |bytes: &[u8]| match request.checkpoint {
        Some(path) => write_atomically(path, bytes),
        None => Ok(()),
    };
    let control = RunControl {
        stop: monitor.stop(),
        progress: Some(&progress),
        checkpoint: request.checkpoint.map(|_| Checkpointing { sink: &sink, interval: CHECKPOINT_INTERVAL }),
        resume: resumed.as_deref(),
        fingerprint: fingerprint(problem, posterior),
    };
    with_draws(sample_density(posterior, &starts, &request.options, &control)?, &request.options)
}

fn with_draws(outcome: SampleOutcome, options: &SamplerOptions) -> Result<SampleOutcome> {
    if outcome.draws.is_empty() {
        let found = format!("burn-in took all {} steps, so no draw was kept", options.max_steps);
        return Err(Error::numerical(found, format!("give more steps ({}); thousands are usual", Setting::Steps)));
    }
    Ok(outcome)
}

/// Samples a density without checkpoints.
///
/// # Errors
/// [`Error::Numerical`] if no draw was kept, [`Error::Interrupted`] if stopped; errors of the sampler.
pub fn sample_without_checkpoint(
    density: &dyn LogDensity,
    starts: &[Vec<f64>],
    options: &SamplerOptions,
    monitor: &dyn Monitor,
) -> Result<SampleOutcome> {
    let progress = |progress: &Progress| monitor.sampling(progress);
    let control = RunControl { stop: monitor.stop(), progress: Some(&progress), ..RunControl::default() };
    with_draws(sample_density(density, starts, options, &control)?, options)
}

/// Text of all inputs of the log density. The sampler stores the hash of this text in the checkpoint, so that a run with other inputs does not resume from the
/// checkpoint.
fn fingerprint(problem: &Problem, posterior: &ReducedPosterior) -> String {
    let Problem { experiment, specification, priors, .. } = problem;
    let version = env!("CARGO_PKG_VERSION");
    let (compliance_per_m, trained) = posterior.mechanics();
    let Experiment {
        specimen_id,
        species,
        region,
        apparatus,
        record,
        calibration_cycles,
        heldout_cycles,
        noise_sd_m,
        fits_position_offset,
        source,
        control,
        // It follows from the rows.
        largest_strain: _,
    } = experiment;
    let cycles = (calibration_cycles, heldout_cycles);
    let described =
        (specimen_id, species, region, apparatus, cycles, noise_sd_m, fits_position_offset, source, control);
    let rows = record.sha256();
    format!("{version} {described:?} {rows} {specification:?} {priors:?} {:x} {trained:?}", compliance_per_m.to_bits())
}

/// Converts draws from the sampler's coordinates to the parameters' units. Returns one column per sampled parameter, in the order of the priors.
pub fn natural_columns(priors: &PriorSet, outcome: &SampleOutcome) -> Vec<DrawColumn> {
    let column = |(d, prior): (usize, &crate::prior::Prior)| {
        let mut column = outcome.draws.column(d);
        column.values.iter_mut().for_each(|z| *z = prior.distribution.from_unconstrained(*z));
        column
    };
    priors.priors().iter().enumerate().map(column).collect()
}

#[expect(clippy::too_many_arguments, reason = "joins everything that the job has found into one document")]
fn summarise(
    prepared: &PreparedModel,
    request: &SampleRequest,
    outcome: &SampleOutcome,
    columns: &[DrawColumn],
    check: &FullCheck,
    score: Option<Score>,
    large_displacement: Option<LargeDisplacement>,
    yardstick: Option<ReferenceNoise>,
) -> PosteriorSummary {
    let problem = &prepared.problem;
    let parameters = parameter_summaries(prepared, columns, check);
    let mean_m = mean_trajectory(&check.trajectories_m, None);
    let fitted = problem.positions_of(&problem.experiment.calibration_cycles);
    let learnt_noise_um = median_row_sd_um(problem.noise, &check.noise.parameters);
    let surrogate = prepared.surrogate.as_ref();
    let log_score = log_score(problem, &check.trajectories_m, &check.noise.parameters);
    let heldout = HeldoutSummary {
        fitted_cycles: problem.experiment.calibration_cycles.clone(),
        cycles: problem.experiment.heldout_cycles.clone(),
        fe_runs: (problem.finite_elements().is_some() || problem.outside().is_some()).then_some(check.fe_runs),
        rmse_um: score.as_ref().map(|s| 1e6 * s.rmse_m),
        rmse_fitted_um: 1e6 * rmse_m(&mean_m, &fitted),
        noise_um: yardstick.map(|y| 1e6 * y.sd_m),
        noise_origin: yardstick.map_or("unknown".into(), |y| noise_origin_text(y.origin).into()),
        coverage_50: score.as_ref().map(|s| s.coverage[0]),
        coverage_90: score.as_ref().map(|s| s.coverage[1]),
        coverage_50_expected: score.as_ref().map(|s| s.coverage_expected[0]),
        coverage_90_expected: score.as_ref().map(|s| s.coverage_expected[1]),
        joint_p: score.as_ref().map(|s| s.joint_p),
        crps_um: score.as_ref().map(|s| 1e6 * s.crps_m),
        log_score_nats: log_score.map(|s| s.nats),
        log_score_mcse_nats: log_score.map(|s| s.standard_error_nats),
        surrogate_vs_fe_max_um: check.surrogate_vs_full_max_m.map(|x| 1e6 * x),
        pareto_k: check.pareto_k,
    };
    let budget = ErrorBudget {
        noise: learnt_noise_um,
        fe_discretisation: check.discretisation_m.map(|x| 1e6 * x),
        surrogate: heldout.surrogate_vs_fe_max_um,
        monte_carlo: 1e6 * monte_carlo_m(&check.trajectories_m, &mean_m),
    };
    let mut summary = PosteriorSummary {
        experiment: problem.experiment.specimen_id.clone(),
        model: problem.specification.summary(),
        parameters,
        sampler: sampler_summary(&request.options, outcome),
        surrogate: SurrogateSummary {
            modes: surrogate.map(|s| s.n_modes()),
            max_relative_error: prepared.max_relative_error,
            fe_unknowns: surrogate.map(|s| s.fe_unknowns),
            snapshot_runs: surrogate.map(|s| s.snapshot_runs),
            singular_values: surrogate.map(|s| above_rounding(&s.singular_values)),
            max_projection_error: surrogate.map(|s| s.max_projection_error),
        },
        heldout,
        error_budget_um: budget,
        largest_strain: check.largest_strain,
        large_displacement,
        at_edge_of_range: at_edge_of_range(prepared, columns),
        converged: outcome.converged,
        trust: Trust::default(),
        warnings: Vec::new(),
    };
    let messages = with_parameter_names(&outcome.messages, &problem.priors);
    let drawn = (&check.trajectories_m[..], &check.noise.parameters[..]);
    let judgement = &Judgement::of_draws(problem, drawn, summary.heldout.joint_p, yardstick);
    let offset = summary.parameters.iter().find(|parameter| parameter.name == POSITION_OFFSET);
    let impossible_positions = impossible_positions_warning(&problem.experiment, offset.map(|offset| offset.median));
    let findings = WarningInputs { summary: &summary, judgement, sampler_messages: &messages, impossible_positions };
    summary.warnings = warnings(&findings);
    if summary.at_edge_of_range.is_empty() {
        summary.warnings.extend(far_from_prior(problem, &summary.parameters));
    }
    let of_large = large_displacement::warnings(&summary);
    summary.warnings.extend(of_large);
    let of_model = |name: &str| problem.model.parameters().iter().any(|spec| spec.name == name);
    summary.warnings.extend(several_modes(&problem.priors, columns, of_model));
    summary.warnings.extend(check.n_refused.map(refused_warning));
    summary.warnings.extend(at_edge_of_box(prepared, columns));
    summary.warnings.extend(problem.finite_elements().into_iter().flat_map(|fe| fe.mesh_warnings.clone()));
    summary.trust = trust(&summary.warnings);
    summary
}

/// Names of the sampled law parameters whose draws accumulate at or beyond an end of the range that a fit searches: more than 5 % of them lie in the outermost 0.1 % of
/// the range, on a logarithmic scale, or outside. A prior of the usual shape has almost no draws there.
fn at_edge_of_range(prepared: &PreparedModel, columns: &[DrawColumn]) -> Vec<String> {
    let problem = &prepared.problem;
    let of_law = &problem.model.parameters()[..problem.model.n_before_effects()];
    // Other priors end at physical bounds, which data may well reach.
    let has_tails = |name: &str| {
        problem.priors.get(name).is_some_and(|prior| matches!(prior.distribution, Distribution::LogNormal { .. }))
    };
    let searched = |name: &str| {
        let is_searched = of_law.iter().any(|spec| spec.name == name) && has_tails(name);
        is_searched.then(|| problem.range_of(name, TAIL_MASS))
    };
    let crowds = |(name, column): (&str, &DrawColumn)| {
        let trained = prepared.trained.iter().find(|range| range.name == name).cloned();
        let range = trained.or_else(|| searched(name))?;
        let margin = 1e-3 * (range.upper / range.lower).ln();
        let is_outermost = |x: &&f64| (**x / range.lower).ln() < margin || (range.upper / **x).ln() < margin;
        let n_outermost = column.values.iter().filter(is_outermost).count();
        (20 * n_outermost > column.values.len()).then(|| name.to_string())
    };
    problem.priors.names().zip(columns).filter_map(crowds).collect()
}

/// Warning about an external program's parameters whose draws accumulate at an end of the surrogate's trained range: more than 1 % of them lie in the outermost 5 % of
/// the range, on a logarithmic scale. Only ends inside the prior's range count.
fn at_edge_of_box(prepared: &PreparedModel, columns: &[DrawColumn]) -> Option<Warning> {
    let problem = &prepared.problem;
    let outside = problem.outside()?;
    let crowds = |(name, column): (&str, &DrawColumn)| {
        let range = prepared.trained.iter().find(|range| range.name == name)?;
        let prior = problem.range_of(name, TAIL_MASS);
        let margin = 0.05 * (range.upper / range.lower).ln();
        let is_outermost = |x: &&f64| {
            range.lower > prior.lower && (**x / range.lower).ln() < margin
                || range.upper < prior.upper && (range.upper / **x).ln() < margin
        };
        (100 * column.values.iter().filter(is_outermost).count() > column.values.len()).then(|| name.to_string())
    };
    let names: Vec<String> = problem.priors.names().zip(columns).filter_map(crowds).collect();
    (!names.is_empty()).then(|| Warning {
        kind: WarningKind::EdgeOfRange,
        text: format!(
            "the posterior of {} reaches an end of the parameter range in which the surrogate of {} was trained: its interval is cut off",
            names.join(", "),
            outside.title()
        ),
        advice: "this range lies around the best fit of the base law alone, far from the posterior with effects: give a prior whose medians lie nearer to this posterior \
            (--prior), or a known noise (noise_um)".into(),
    })
}

/// Replaces coordinate numbers in a message of the sampler by parameter names. The highest number is replaced first, because the text `1` is also the beginning of
/// `10`.
pub fn with_parameter_names(messages: &[String], priors: &PriorSet) -> Vec<String> {
    let names: Vec<&str> = priors.names().collect();
    let named = |message: &String| {
        let numbered = names.iter().enumerate().rev();
        numbered.fold(message.clone(), |text, (k, name)| text.replace(&format!("parameter {}", k + 1), name))
    };
    messages.iter().map(named).collect()
}

/// Origin of the noise standard deviation, in words.
pub fn noise_origin_text(origin: NoiseOrigin) -> &'static str {
    match origin {
        NoiseOrigin::Known => "known",
        NoiseOrigin::Rest { .. } => "estimated from rests",
        NoiseOrigin::ShortLag { .. } => "estimated from short lags",
    }
}

/// Leading singular values, up to and including the first value that is a rounding error (at most 1e-14).
fn above_rounding(singular_values: &[f64]) -> Vec<f64> {
    let kept = singular_values.iter().take_while(|s| **s > 1e-14).count();
    singular_values[..(kept + 1).min(singular_values.len())].to_vec()
}

/// Summary of a parameter's draws. The biases due to surrogate and mesh are left empty.
fn parameter_summary(name: &str, d: &ParameterDiagnostics) -> ParameterSummary {
    ParameterSummary {
        name: name.into(),
        mean: d.mean,
        sd: d.sd,
        q05: d.q05,
        median: d.median,
        q95: d.q95,
        ess_bulk: d.ess_bulk,
        ess_tail: d.ess_tail,
        rhat: d.rhat,
        mcse_mean: d.mcse_mean,
        surrogate_bias_sd: None,
        discretisation_bias_sd: None,
    }
}

/// Summaries of the draws of all parameters with a prior, in natural units.
pub fn plain_summaries(priors: &PriorSet, columns: &[DrawColumn]) -> Vec<ParameterSummary> {
    let blom = BlomScores::new(columns.first().map_or(0, |column| column.values.len()));
    priors.names().zip(columns).map(|(name, column)| parameter_summary(name, &diagnose(column, &blom))).collect()
}

/// Summary of the sampler's settings and diagnostics.
pub fn sampler_summary(options: &SamplerOptions, outcome: &SampleOutcome) -> SamplerSummary {
    SamplerSummary {
        walkers: options.n_walkers,
        ensembles: options.n_ensembles,
        steps: outcome.n_steps,
        acceptance: outcome.acceptance,
        autocorrelation_time: outcome.autocorrelation_time,
        likelihood_evaluations: outcome.likelihood_evaluations,
        walkers_reseeded: outcome.walkers_reseeded,
    }
}

fn parameter_summaries(prepared: &PreparedModel, columns: &[DrawColumn], check: &FullCheck) -> Vec<ParameterSummary> {
    let problem = &prepared.problem;
    let (specs, draws) = (problem.parameters(), &check.draws);
    let law = problem.model.base().parameters();
    let relative_mesh_error = problem
        .finite_elements()
        .and_then(|fe| fe.comparison)
        .map(|comparison| comparison.relative_error(prepared.compliance.experiment_per_m()));
    let summary = |plain: ParameterSummary| {
        let place = specs.iter().position(|spec| spec.name == plain.name).unwrap_or(specs.len() - 1);
        // The surrogate's bias is the importance-weighted mean of the checked draws minus their plain mean.
        let surrogate_bias_sd = check.weights.as_ref().map(|weights| {
            let equal = 1.0 / draws.len() as f64;
            weights.iter().zip(draws).map(|(w, draw)| (w - equal) * draw[place]).sum::<f64>() / plain.sd
        });
        // The trajectory depends on the compliance divided by a modulus or a viscosity. A relative error of the compliance thus causes an equal relative error of
        // moduli and viscosities. It does not affect other parameters.
        let is_stress = law.get(place).is_some_and(|spec| spec.unit.starts_with("Pa"));
        let discretisation_bias_sd =
            relative_mesh_error.map(|e| if is_stress { e * plain.mean / plain.sd } else { 0.0 });
        ParameterSummary { surrogate_bias_sd, discretisation_bias_sd, ..plain }
    };
    plain_summaries(&problem.priors, columns).into_iter().map(summary).collect()
}

/// Warning about draws for which the model can be computed on the fitted rows, but not on the whole record.
fn refused_warning(n_refused: usize) -> Warning {
    Warning {
        kind: WarningKind::DrawsRefused,
        text: format!(
            "the model cannot be computed on the whole record for {n_refused} posterior draws: an effect exceeds its range of validity"
        ),
        advice: "give the effect a narrower prior, or leave it out".into(),
    }
}

/// Monte Carlo error of the mean trajectory in m: root mean square of its standard error at all rows.
fn monte_carlo_m(trajectories_m: &[Vec<f64>], mean_m: &[f64]) -> f64 {
    let n = trajectories_m.len() as f64;
    let squares: f64 = trajectories_m.iter().flat_map(|t| t.iter().zip(mean_m)).map(|(x, m)| (x - m).powi(2)).sum();
    (squares / (n * (n - 1.0)) / mean_m.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::SilentMonitor;
    use crate::replica;
    use crate::study::ModelSpecification;
    use models::model::Compliance;

    #[test]
    fn long_records_are_refused_with_what_to_do() {
        assert!(refuse_too_many_rows(1_000_000).is_ok());
        let error = refuse_too_many_rows(10_000_000).unwrap_err().to_string();
        assert!(error.contains("10000000 rows") && error.contains("average every 9 rows"), "{error}");
    }

    /// A run must not resume from a checkpoint of another mesh. The fingerprint therefore contains the mechanics, too.
    #[test]
    fn other_mechanics_have_another_fingerprint() {
        let (experiment, _) = replica::embedded().expect("embedded");
        let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
        let of = |compliance_per_m: f64| {
            let trained = problem.training_ranges();
            let model = PreparedModel::given(&problem, Compliance::fixed(compliance_per_m), trained);
            fingerprint(&problem, &model.posterior())
        };
        assert_eq!(of(549.0), of(549.0));
        assert_ne!(of(549.0), of(549.0 * (1.0 + f64::EPSILON)));
    }
}

//! Files of a revision: model, surrogate, posterior, draws, figures and timing.

use figures::labels::model_title;
use std::path::Path;

use super::exchange::record_groups;
use base::error::{Error, Result};
use base::files::{write_atomically, write_json_atomically};
use documents::posterior::ModelSummary;
use figures::corner::{CornerOptions, ParameterColumn, Posterior, PriorCurve, corner};
use figures::density::Support;
use figures::draws::{DrawTable, write_draws_csv};
use figures::labels::parameter_label;
use figures::netcdf::write_draws_netcdf;
use figures::palette::series;
use figures::predictions::{Predictions, write_predictions};
use figures::predictive::{Band, CycleKind, CycleSpan, PredictiveData, predictive};
use figures::singular_values::{Family, singular_values};
use figures::svg::{Svg, write_figure};
use figures::trace::{EnsembleTrace, ParameterTrace, trace};
use laws::rheology::LETHERSICH;
use posterior::gaussian_predictive::BAND_PROBABILITIES;
use posterior::prepared::SURROGATE_NAME;
use posterior::prior::PriorSet;
use posterior::problem::Problem;
use posterior::replica::TABLE_I;
use posterior::sample::SampleResult;
use posterior::study::{
    Kept, ModelSpecification, POSTERIOR_NAME, PREDICTIONS_NAME, PRIOR_COPY, Provenance, WithProvenance, effect_file,
};
use record::Experiment;
use sampling::diagnostics::DrawColumn;
use sampling::diagnostics::autocovariance::autocovariance;
use sampling::diagnostics::ensembles::walker_averages;
use sampling::ensemble::SampleOutcome;

/// Subdirectory of a revision that holds copies of the effects that come from files. A separate directory prevents name clashes: an effect may be called
/// `prior`, for example.
const EFFECT_COPIES: &str = "effects";

/// Path of an effect's copy, relative to the revision's directory.
pub(super) fn effect_copy(slug: &str) -> String {
    format!("{EFFECT_COPIES}/{slug}.toml")
}
/// Key of an imported mesh in the list of inputs (`inputs_sha256`) of a document's header. The hash covers the mesh file and its unit of length.
pub const MESH_INPUT: &str = "mesh";
/// Number of points on the curve of a prior's density.
const PRIOR_POINTS: usize = 400;

/// Writes all files of a revision into `dir`. `header` returns the header of a JSON document, given the kind of document.
pub fn write(dir: &Path, result: &SampleResult, header: &dyn Fn(&str) -> Provenance) -> Result<()> {
    let problem = &result.model.problem;
    write_model(dir, &problem.specification, &problem.priors)?;
    write_document(&dir.join(POSTERIOR_NAME), header("posterior"), &result.summary)?;
    if let Some(kept) = result.model.to_keep()? {
        write_document(&dir.join(SURROGATE_NAME), header("surrogate"), &Kept::new(kept))?;
    }
    let table = arrange_draws(&problem.priors, &result.outcome, &result.columns);
    write_draws_csv(&dir.join("draws.csv"), &table)?;
    let record = &problem.experiment.record;
    let position_um: Vec<Option<f64>> = record.position_m.iter().map(|x| x.map(|x| 1e6 * x)).collect();
    let groups = record_groups(&result.model, &result.outcome.draws, header("posterior").seed);
    write_draws_netcdf(&dir.join("posterior.nc"), &table, &groups)?;
    let predictions = predictions(&record.time_s, result);
    write_predictions(&dir.join(PREDICTIONS_NAME), &predictions)?;
    write_figures(&dir.join("figures"), problem, result, &position_um, &predictions)
}

/// Writes `model.toml`, and copies of the prior and the effects that come from files. The revision therefore stays complete if those files change or
/// disappear.
pub(crate) fn write_model(dir: &Path, specification: &ModelSpecification, priors: &PriorSet) -> Result<()> {
    let mut specification = specification.clone();
    if !PriorSet::builtin_names().any(|name| name == specification.prior) {
        write_atomically(&dir.join(PRIOR_COPY), priors.text().as_bytes())?;
        specification.prior = PRIOR_COPY.into();
    }
    for slug in &specification.effects {
        if let Some(definition) = effect_file::definition(slug) {
            make_folder(&dir.join(EFFECT_COPIES))?;
            write_atomically(&dir.join(effect_copy(slug)), definition.to_string().as_bytes())?;
        }
    }
    specification.write(&dir.join("model.toml"))
}

/// Adds the hashes of the prior and of an imported mesh to the inputs in a header.
pub fn with_inputs(header: Provenance, problem: &Problem) -> Provenance {
    let mut header = header.with_quantities(problem.experiment.quantities());
    if let Some(hash) = problem.finite_elements().and_then(|fe| fe.mesh_file_sha256.clone()) {
        header.inputs_sha256.insert(MESH_INPUT.into(), hash);
    }
    with_prior(header, &problem.priors)
}

/// Adds the hash of the prior to the inputs in a header.
pub fn with_prior(header: Provenance, priors: &PriorSet) -> Provenance {
    let name = priors.name();
    let is_embedded = PriorSet::builtin_names().any(|embedded| embedded == name);
    let name = if is_embedded { format!("prior {name}") } else { PRIOR_COPY.into() };
    header.with_input(name, priors.text().as_bytes())
}

/// Returns `true` if the input called `name` in a document's header is a file of the experiment, not a prior or a mesh.
pub fn is_measurement_file(name: &str) -> bool {
    name != PRIOR_COPY && name != MESH_INPUT && !name.starts_with("prior ")
}

/// Writes the wall-clock time of each stage, in seconds, into `timing.json`. The file is separate because the times differ from run to run.
pub fn write_timing(dir: &Path, timing_s: &[(&'static str, f64)], provenance: Provenance) -> Result<()> {
    let stages: std::collections::BTreeMap<&str, f64> = timing_s.iter().copied().collect();
    write_document(&dir.join("timing.json"), provenance, &serde_json::json!({ "wall_s": stages }))
}

pub(crate) fn write_document(path: &Path, provenance: Provenance, body: &impl serde::Serialize) -> Result<()> {
    write_json_atomically(path, &WithProvenance { provenance, body })
}

/// Arranges the posterior draws as a table with parameter names and units. The files for other programs (CSV, NetCDF) are written from this table.
pub(crate) fn arrange_draws(priors: &PriorSet, outcome: &SampleOutcome, columns: &[DrawColumn]) -> DrawTable {
    let draws = &outcome.draws;
    let mut values = Vec::with_capacity(draws.len() * columns.len());
    let mut log_density = Vec::with_capacity(draws.len());
    for ensemble in 0..draws.n_ensembles {
        for walker in 0..draws.n_walkers {
            for step in 0..draws.n_steps {
                let index = (ensemble * draws.n_steps + step) * draws.n_walkers + walker;
                values.extend(columns.iter().map(|column| column.values[index]));
                log_density.push(draws.log_density[index]);
            }
        }
    }
    let names: Vec<String> = priors.names().map(String::from).collect();
    DrawTable {
        units: names.iter().map(|name| parameter_label(name).unit).collect(),
        parameter_names: names,
        n_ensembles: draws.n_ensembles,
        n_walkers: draws.n_walkers,
        n_steps: draws.n_steps,
        values,
        log_density,
    }
}

fn make_folder(dir: &Path) -> Result<()> {
    std::fs::create_dir_all(dir)
        .map_err(|source| Error::at_path("create", dir, source, "make the study directory writable"))
}

/// Quantiles of the predicted position at every row of the record, in µm, noise included.
fn predictions(time_s: &[f64], result: &SampleResult) -> Predictions {
    let quantile = |k: usize| result.bands_m.iter().map(|row| 1e6 * row[k]).collect::<Vec<f64>>();
    let quantiles_um = std::array::from_fn::<_, { BAND_PROBABILITIES.len() }, _>(quantile);
    Predictions { time_s: time_s.to_vec(), quantiles_um }
}

fn write_figures(
    dir: &Path,
    problem: &Problem,
    result: &SampleResult,
    position_um: &[Option<f64>],
    predictions: &Predictions,
) -> Result<()> {
    make_folder(dir)?;
    let mut figures = vec![
        ("corner", draw_record_corner(problem, result)?),
        ("predictive", predictive_figure(problem, result, position_um, predictions)?),
        ("trace", draw_trace(&problem.experiment.specimen_id, &problem.priors, &result.outcome, &result.columns)?),
    ];
    if let Some(surrogate) = &result.model.surrogate {
        let shown: Vec<f64> = surrogate.singular_values.iter().take(12).copied().collect();
        let family = Family { label: "the law", singular_values: &shown, n_chosen: surrogate.n_modes() };
        let heading = format!("{}: singular values of the snapshots", problem.experiment.specimen_id);
        figures.push(("singular_values", singular_values(&[family], surrogate.tolerance, &heading)?));
    }
    use rayon::prelude::*;
    let quantities = problem.experiment.quantities();
    figures.into_par_iter().map(|(stem, svg)| write_figure(dir, stem, &svg.translated(quantities))).collect()
}

fn draw_record_corner(problem: &Problem, result: &SampleResult) -> Result<Svg> {
    let id = &problem.experiment.specimen_id;
    let is_replica = id == "porcine-replica";
    let reference = |name: &str| {
        let place = LETHERSICH.iter().position(|p| p.name == name).filter(|_| is_replica)?;
        TABLE_I.get(place).copied()
    };
    draw_corner(id, &result.summary.model, &problem.priors, &result.columns, &reference)
}

/// Draws the corner plot of the posterior draws, in the parameters' natural units. The plot shows the priors, and a reference value of each parameter for
/// which `reference` returns one.
pub(crate) fn draw_corner(
    id: &str,
    model: &ModelSummary,
    priors: &PriorSet,
    columns: &[DrawColumn],
    reference: &dyn Fn(&str) -> Option<f64>,
) -> Result<Svg> {
    let curves: Vec<(Vec<f64>, Vec<f64>)> =
        priors.priors().iter().zip(columns).map(|(prior, column)| prior_curve(prior, &column.values)).collect();
    let labels: Vec<_> = priors.names().map(parameter_label).collect();
    let columns = priors.priors().iter().zip(columns).zip(curves.iter().zip(&labels));
    let parameters = columns
        .map(|((prior, column), ((x, density), label))| {
            let (lower, upper) = prior.distribution.support();
            ParameterColumn {
                name: &prior.name,
                symbol: &label.symbol,
                unit: &label.unit,
                draws: &column.values,
                support: Support { lower, upper },
                prior: Some(PriorCurve { x, density }),
                reference: reference(&prior.name),
            }
        })
        .collect();
    let posterior = Posterior { label: id, colour: series(0), parameters };
    let title = format!("{id}: posterior of the {} model", model_title(model));
    let options = CornerOptions { title: &title, reference_label: "Table I of the paper", ..CornerOptions::default() };
    corner(&[posterior], &options)
}

/// Density of a prior, as abscissae and ordinates of a curve. The curve covers three times the range of the draws.
pub fn prior_curve(prior: &posterior::prior::Prior, draws: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let lowest = draws.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = draws.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (start, width) = (lowest - (highest - lowest), 3.0 * (highest - lowest));
    let x: Vec<f64> = (0..PRIOR_POINTS).map(|i| start + width * i as f64 / (PRIOR_POINTS - 1) as f64).collect();
    let density = x.iter().map(|x| prior.distribution.ln_pdf(*x).exp()).collect();
    (x, density)
}

/// Start, end and use of each cycle: fitted, held out or unused.
pub fn cycle_spans(experiment: &Experiment) -> Vec<CycleSpan> {
    let record = &experiment.record;
    let mut spans: Vec<CycleSpan> = Vec::new();
    for (time_s, cycle) in record.time_s.iter().zip(&record.cycle) {
        if let Some(last) = spans.last_mut() {
            last.end_s = *time_s;
            if last.cycle == i64::from(*cycle) {
                continue;
            }
        }
        let kind = if experiment.calibration_cycles.contains(cycle) {
            CycleKind::Calibration
        } else if experiment.heldout_cycles.contains(cycle) {
            CycleKind::HeldOut
        } else {
            CycleKind::Unused
        };
        spans.push(CycleSpan { cycle: i64::from(*cycle), start_s: *time_s, end_s: *time_s, kind });
    }
    spans
}

fn predictive_figure(
    problem: &Problem,
    result: &SampleResult,
    position_um: &[Option<f64>],
    predictions: &Predictions,
) -> Result<Svg> {
    let record = &problem.experiment.record;
    let [lower_90, lower_50, median, upper_50, upper_90] = &predictions.quantiles_um;
    let force_un: Vec<f64> = record.force_n.iter().map(|f| 1e6 * f).collect();
    let noise = &result.summary.heldout.noise_origin;
    let noise_name = noise.clone();
    let summary = &result.summary;
    let by = if summary.heldout.fe_runs.is_some() { summary.model.full_model() } else { "the creep law" };
    predictive(&PredictiveData {
        title: &format!("{}: measured position and prediction by {by}", problem.experiment.specimen_id),
        time_s: &record.time_s,
        position_um,
        force_un: &force_un,
        median_um: median,
        band_50_um: Band { lower: lower_50, upper: upper_50 },
        band_90_um: Band { lower: lower_90, upper: upper_90 },
        cycles: &cycle_spans(&problem.experiment),
        noise: result.yardstick.map(|y| (1e6 * y.sd_m, noise_name.as_str())),
    })
}

/// Draws the trace plot: the draws of each parameter against the sampler's step.
pub(crate) fn draw_trace(id: &str, priors: &PriorSet, outcome: &SampleOutcome, columns: &[DrawColumn]) -> Result<Svg> {
    let table = arrange_draws(priors, outcome, columns);
    let labels: Vec<String> = priors.names().map(|name| parameter_label(name).axis()).collect();
    let n_ensembles = table.n_ensembles;
    let summaries: Vec<Vec<_>> = (0..labels.len())
        .map(|p| (0..n_ensembles).map(|ensemble| table.walker_summary(ensemble, p)).collect())
        .collect();
    let autocorrelations: Vec<Vec<Vec<f64>>> = columns.iter().map(autocorrelation).collect();
    let store_every = outcome.draws.store_every;
    let parameters: Vec<ParameterTrace> = labels
        .iter()
        .enumerate()
        .map(|(p, label)| ParameterTrace {
            label,
            ensembles: summaries[p]
                .iter()
                .map(|s| EnsembleTrace { mean: &s.mean, lower: &s.lower, upper: &s.upper, walkers: Vec::new() })
                .collect(),
            autocorrelation: autocorrelations[p].iter().map(Vec::as_slice).collect(),
            autocorrelation_time_steps: Some(outcome.parameters[p].autocorrelation_time / store_every as f64),
        })
        .collect();
    let every = if store_every == 1 { "every step".into() } else { format!("every {store_every}th step") };
    let heading = format!(
        "{id}: {} ensembles of {} walkers after burn-in, {every} kept",
        outcome.draws.n_ensembles, outcome.draws.n_walkers
    );
    trace(&parameters, 0, &heading)
}

/// Autocorrelation of each ensemble's average over its walkers. The result has one vector per ensemble, with one value per lag.
fn autocorrelation(column: &DrawColumn) -> Vec<Vec<f64>> {
    let averages = walker_averages(column, &column.values);
    averages
        .iter()
        .map(|series| {
            let covariance = autocovariance(series);
            let variance = covariance.first().copied().unwrap_or(f64::NAN);
            covariance.iter().map(|c| c / variance).collect()
        })
        .collect()
}

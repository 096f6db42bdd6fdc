//! Computes the curve of a model for parameters that the user sets with sliders (a *trial*).

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use vitreo_uq::posterior::study::ModelSpecification;

use serde::{Deserialize, Serialize};
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::documents::posterior::PosteriorSummary;
use vitreo_uq::figures::labels::parameter_label;
use vitreo_uq::figures::predictions::Predictions;
use vitreo_uq::jobs::first_revision::kept_surrogate;
use vitreo_uq::models::effects::Library;
use vitreo_uq::models::model::Forward;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::{POSTERIOR_NAME, Study, WithProvenance};

use super::rows::{FileCache, PlotRows, Window, select_rows};

/// The slider of an effect's parameter ranges between the prior quantiles of this probability and of 1 minus it.
const TAIL: f64 = 0.02;
/// Largest factor between the ends of a slider for the law's parameter and its posterior median.
const MAX_SLIDER_FACTOR: f64 = 3.0;

/// Request for a trial from the page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct TrialRequest {
    /// Name of the item.
    pub item: String,
    /// Name of the revision that the trial starts from.
    pub revision: String,
    /// Names of effects that are added to those of the revision.
    #[serde(default)]
    pub effects: Vec<String>,
    /// Values of parameters by name. Parameters that are not listed keep the revision's values.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
    /// Time range to show.
    #[serde(flatten)]
    pub window: Window,
}

/// A model that is prepared for trials, with its sliders.
pub struct Trial {
    model: PreparedModel,
    knobs: Vec<ParameterSlider>,
}

/// Slider for a parameter on the page.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterSlider {
    name: String,
    symbol: String,
    unit: String,
    value: f64,
    low: f64,
    high: f64,
    /// Null of the effect; `None` for a parameter of the law.
    null_value: Option<f64>,
    is_logarithmic: bool,
}

/// Effect that the user can add on the page.
#[derive(Debug, Serialize)]
pub struct EffectOption {
    slug: &'static str,
    summary: &'static str,
}

/// Sliders of a trial, and effects that the user can add.
#[derive(Debug, Serialize)]
pub struct TrialControls<'a> {
    knobs: &'a [ParameterSlider],
    effects: Vec<EffectOption>,
}

/// Curve of a trial, and its root mean square distance from the measurement.
#[derive(Debug, Serialize)]
pub struct Curve {
    #[serde(flatten)]
    rows: PlotRows,
    tried_um: Vec<f64>,
    tried_residual_um: Vec<Option<f64>>,
    rmse_fitted_um: Option<f64>,
    rmse_heldout_um: Option<f64>,
}

/// Returns the prepared model of a trial. It is prepared once and then cached.
pub fn trial(memory: &FileCache<Trial>, study: &Path, tried: &TrialRequest) -> Result<Arc<Trial>> {
    let TrialRequest { revision, effects, .. } = tried;
    let key = study.join(revision).join(effects.join(","));
    let posterior = study.join(revision).join(POSTERIOR_NAME);
    memory.get(&key, &[posterior], || Trial::new(study, revision, effects))
}

impl Trial {
    fn new(study: &Path, revision: &str, effects: &[String]) -> Result<Self> {
        let study = Study::open(study)?;
        let dir = study.revision_dir(revision)?;
        let (experiment, _) = study.read_experiment()?;
        let mut specification = ModelSpecification::of_revision(&dir, &Library::default())?;
        specification.effects.extend(effects.iter().cloned());
        let problem = Problem::new(experiment, specification, None, &SilentMonitor)?;
        let model = PreparedModel::unverified(&problem, kept_surrogate(&study, &SilentMonitor), &SilentMonitor)?;
        let path = dir.join(POSTERIOR_NAME);
        let bytes = files::read(&path, Content::Document, "make the study again")?;
        let posterior: WithProvenance<PosteriorSummary> = serde_json::from_slice(&bytes).map_err(|error| {
            Error::input(InputPlace::file(&path).at_line(error.line()), error.to_string(), "make the study again")
        })?;
        let knobs = knobs(&problem, &posterior.body);
        Ok(Self { model, knobs })
    }

    /// Sliders of this trial, and effects that the user can add.
    pub fn knobs(&self) -> TrialControls<'_> {
        let names = &self.model.problem.specification.effects;
        let library = Library::default();
        let others = library.effects().iter().filter(|effect| !names.iter().any(|slug| slug == effect.slug()));
        let effects =
            others.map(|effect| EffectOption { slug: effect.slug(), summary: effect.description().summary }).collect();
        TrialControls { knobs: &self.knobs, effects }
    }

    /// Curve of the model for the parameter values of the request, at the rows that a plot with these predictions shows.
    pub fn curve(&self, tried: &TrialRequest, predictions: Option<&Predictions>) -> Result<Curve> {
        let problem = &self.model.problem;
        let value = |name: &str| {
            let parameter_slider = self.knobs.iter().find(|knob| knob.name == name);
            let asked = tried.parameters.get(name).copied().filter(|value| value.is_finite());
            asked
                .and_then(|value| parameter_slider.map(|knob| value.clamp(knob.low, knob.high)))
                .or(parameter_slider.map(|knob| knob.value))
                .or_else(|| problem.specification.fixed.get(name).copied())
                .unwrap_or(f64::NAN)
        };
        let parameters: Vec<f64> = problem.model.parameters().iter().map(|spec| value(spec.name)).collect();
        let position_m = self.model.forward().trajectory_m(&parameters)?;
        let experiment = &problem.experiment;
        let rmse_um = |cycles: &[u32]| {
            let observed = problem.positions_of(cycles);
            let errors = observed.iter().zip(&position_m).filter_map(|(y, x)| Some((1e6 * ((*y)? - x)).powi(2)));
            let (n, sum) = errors.fold((0_usize, 0.0), |(n, sum), square| (n + 1, sum + square));
            (n > 0).then(|| (sum / n as f64).sqrt())
        };
        let rows = select_rows(experiment, predictions, None, tried.window);
        Ok(Curve {
            tried_residual_um: rows
                .chosen
                .iter()
                .map(|row| experiment.record.position_m[*row].map(|measured_m| 1e6 * (measured_m - position_m[*row])))
                .collect(),
            tried_um: rows.chosen.iter().map(|row| 1e6 * position_m[*row]).collect(),
            rmse_fitted_um: rmse_um(&experiment.calibration_cycles),
            rmse_heldout_um: rmse_um(&experiment.heldout_cycles),
            rows,
        })
    }
}

/// Sliders of a model. They are at the revision's values, and for added effects at the null.
fn knobs(problem: &Problem, posterior: &PosteriorSummary) -> Vec<ParameterSlider> {
    let model = &problem.model;
    let n_before = model.n_before_effects();
    let of_effects: Vec<_> = model.effects().iter().flat_map(|effect| effect.parameters()).collect();
    let knob = |(place, spec): (usize, &vitreo_uq::base::parameter::ParameterSpec)| {
        let prior = problem.priors.get(spec.name)?.distribution;
        let told = posterior
            .parameters
            .iter()
            .find(|parameter| parameter.name == spec.name)
            .map(|parameter_summary| parameter_summary.median);
        let null = place.checked_sub(n_before).and_then(|k| (of_effects[k].null)(model.scales()));
        let [mut low, mut high] = [prior.quantile(TAIL), prior.quantile(1.0 - TAIL)];
        let value = told.or(null).unwrap_or_else(|| prior.quantile(0.5));
        let is_logarithmic = null.is_none() && low > 0.0;
        if is_logarithmic && told.is_some() {
            (low, high) = (low.max(value / MAX_SLIDER_FACTOR), high.min(value * MAX_SLIDER_FACTOR));
        }
        (low, high) = (low.min(value), high.max(value));
        let label = parameter_label(spec.name);
        let unit = if label.unit == "–" { String::new() } else { label.unit };
        Some(ParameterSlider {
            name: spec.name.into(),
            symbol: label.symbol,
            unit,
            value,
            low,
            high,
            null_value: null,
            is_logarithmic,
        })
    };
    model.parameters().iter().enumerate().filter_map(knob).collect()
}

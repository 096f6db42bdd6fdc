//! Prepared model: a problem (experiment, law, effects, priors, noise) with its reduced model and the reduced model's verified error.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cache::{self, ModelInputs};
use super::learnt_displacement::{fit_base_law, learn_displacements};
use super::learnt_outside::{self, ExternalSurrogate};
use super::mechanics::{FiniteElements, Mechanics};
use super::monitor::{Counter, Monitor, WarningMonitor};
use super::outside::ExternalModel;
use super::problem::{Problem, TAIL_MASS};
use crate::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use crate::prior::PriorSet;
use crate::study::{Kept, WithProvenance};
use base::error::Result;
use base::files::{Content, kind, read_if_there};
use laws::rheology::BaseLaw;
use laws::stages::{ReducedField, Stages};
use models::effects::{Effect, FieldEffect, Library, Stage};
use models::model::{Compliance, Forward, FullOrderForward, Response, SurrogateForward, TrainedRange};
use models::surrogate::{FieldModels, Surrogate, Training, n_pieces, trajectory};
use record::{Experiment, Force, Record};

/// File name of a revision's surrogate.
pub const SURROGATE_NAME: &str = "surrogate.json";
/// Smallest singular value, relative to the largest, of a mode that the surrogate keeps.
const POD_TOLERANCE: f64 = 1e-6;
/// Number of full-order runs that verify the reduced model if the model has effects.
const VERIFICATION_RUNS: u32 = 8;
/// Number of full-order runs that verify a model whose effects solve for a field. Each run takes about ten seconds.
const SLOW_VERIFICATION_RUNS: u32 = 2;
/// Prior probability beyond the range of the verification points, at either end.
const VERIFICATION_TAIL: f64 = 0.02;
/// Seed of the scrambled Sobol sequence of verification points. It is fixed, because the points are part of the method.
const VERIFICATION_SEED: u32 = 3;

/// A problem (experiment, law, effects, priors, noise, mechanics) with the reduced model that computes its trajectories.
#[derive(Clone)]
pub struct PreparedModel {
    /// Experiment with law, effects, priors, noise and mechanics.
    pub problem: Problem,
    /// Surrogate; `None` for an instrument, whose compliance is given.
    pub surrogate: Option<Surrogate>,
    /// Field models: reduced models of the effects that change the displacement field. Empty without such effects.
    pub fields: FieldModels,
    /// Displacement per force at unit creep compliance, in 1/m. It does not change, because [`PreparedModel::local_compliance`] is made from it once.
    pub compliance: Compliance,
    /// Parameter ranges in which the reduced model is valid; empty for an instrument.
    pub trained: Vec<TrainedRange>,
    /// Largest distance between reduced and full-order trajectories outside the training set, divided by their amplitude; `None` for an instrument.
    pub max_relative_error: Option<f64>,
    /// Largest error of a surrogate that was trained for this record; `None` without such a surrogate. For large displacements, the error is divided by the
    /// displacement. For an external program, it is divided by the noise standard deviation.
    pub learnt_error: Option<f64>,
    /// Compliance whose nonlinear laws reuse trajectories that are trained for the problem's record. Clones share it.
    local: Arc<OnceLock<Compliance>>,
}

/// Content of the file [`SURROGATE_NAME`]: the surrogate of the law, the field models of effects, and the hashes of their inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptSurrogate {
    /// SHA-256 of all inputs from which the surrogate was built.
    pub built_from_sha256: String,
    /// SHA-256 of all inputs that the field models share.
    #[serde(default)]
    pub fields_built_from_sha256: String,
    /// Reduced models of the effects that change the displacement field.
    #[serde(default)]
    pub fields: FieldModels,
    /// Surrogate of the law.
    #[serde(flatten)]
    pub surrogate: Surrogate,
}

impl KeptSurrogate {
    /// Reads the surrogate that an earlier run wrote to a revision; `None` if the file is absent or was changed. A changed file causes a warning to `monitor`. The
    /// inputs are compared later, when the surrogate is used.
    pub fn read(revision_dir: &Path, monitor: &dyn Monitor) -> Option<Self> {
        let path = revision_dir.join(SURROGATE_NAME);
        kind(&path)?;
        let document: Option<WithProvenance<Kept<Self>>> =
            read_if_there(&path, Content::Document).and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let kept = document.and_then(|document| document.body.unchanged()).filter(|kept| kept.surrogate.is_whole());
        if kept.is_none() {
            monitor.warn(&format!(
                "{} is damaged or was changed, and is not used: the surrogate is trained anew",
                path.display()
            ));
        }
        kept
    }
}

impl PreparedModel {
    /// Prepares a model. It uses the surrogate `kept` if this was built from the problem's inputs; otherwise it trains a new surrogate. Separate full-order runs verify
    /// a model with effects. A nonlinear law needs no such runs, because its reduced model was verified when it was built. Each run would take minutes.
    pub fn new(problem: &Problem, kept: Option<KeptSurrogate>, monitor: &dyn Monitor) -> Result<Self> {
        let mut prepared = Self::unverified(problem, kept, monitor)?;
        if let (Some(fe), false) = (problem.finite_elements(), problem.is_exponential()) {
            let of_field = problem
                .model
                .field()
                .and_then(|(slug, _)| prepared.fields.verification_error(slug))
                .or(prepared.learnt_error);
            let found = match of_field {
                Some(found) => found,
                None => {
                    monitor.stage("verifying the reduced model on full finite-element runs");
                    let n_runs =
                        if problem.model.field().is_none() { VERIFICATION_RUNS } else { SLOW_VERIFICATION_RUNS };
                    verify(problem, fe, &prepared.compliance, n_runs)?.relative_error
                }
            };
            prepared.max_relative_error = prepared.max_relative_error.map(|error| error.max(found));
        }
        Ok(prepared)
    }

    /// Compares two trajectories of this reduced model with full finite elements of the apparatus. This tests a model from the cache again, because its stored error
    /// dates from its construction. Returns `None` without finite elements.
    ///
    /// # Errors
    /// Errors of the full-order model.
    pub fn verify_now(&self, monitor: &dyn Monitor) -> Result<Option<Verification>> {
        let Some(fe) = self.problem.finite_elements() else { return Ok(None) };
        monitor.stage("checking the reduced model on two full finite-element runs");
        verify(&self.problem, fe, &self.compliance, SLOW_VERIFICATION_RUNS).map(Some)
    }

    /// Prepares the model like [`PreparedModel::new`], but without the full-order runs that verify the effects.
    pub fn unverified(problem: &Problem, kept: Option<KeptSurrogate>, monitor: &dyn Monitor) -> Result<Self> {
        let fe = match &*problem.mechanics {
            Mechanics::Instrument { compliance_per_m } => {
                return Ok(Self::given(problem, Compliance::fixed(*compliance_per_m), Vec::new()));
            }
            Mechanics::External(external_model) => {
                return Self::for_external(problem, external_model, problem.model.effects(), monitor);
            }
            Mechanics::FiniteElements(fe) => fe,
        };
        let fields = field_models(fe, kept.as_ref(), problem.model.effects(), monitor)?;
        let (_, surrogate) = surrogate(problem, fe, kept, monitor)?;
        let mut compliance = with_fields(surrogate.compliance(fe.poisson_ratio)?, &fields);
        let mut learnt_error = None;
        if problem.model.field().is_some_and(|(_, field)| field.is_learnt_for_record()) {
            let law = fit_base_law(problem, &compliance)?;
            let with_load = problem.model.effects().iter().any(|effect| effect.stage() == Stage::Load);
            let (stepper, error) = learn_displacements(problem, &law, with_load, monitor)?;
            compliance = compliance.with_trained(move || Some(stepper.clone()));
            learnt_error = Some(error);
        }
        Ok(Self {
            compliance,
            learnt_error,
            fields,
            trained: problem.training_ranges(),
            max_relative_error: Some(surrogate.max_relative_error),
            surrogate: Some(surrogate),
            problem: problem.clone(),
            local: Arc::default(),
        })
    }

    /// Creates the model of a problem from a known compliance and the valid ranges (`trained`) of the law's parameters, without a surrogate.
    pub fn given(problem: &Problem, compliance: Compliance, trained: Vec<TrainedRange>) -> Self {
        Self {
            problem: problem.clone(),
            surrogate: None,
            fields: FieldModels::default(),
            compliance,
            trained,
            max_relative_error: None,
            learnt_error: None,
            local: Arc::default(),
        }
    }

    /// Trains the surrogate of an external program. The surrogate serves every model whose effects are among `effects`.
    pub fn for_external(
        problem: &Problem,
        external_model: &ExternalModel,
        effects: &[&'static dyn Effect],
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let is_load = |effect: &&'static dyn Effect| effect.stage() == Stage::Load;
        let with_load = effects.iter().any(is_load) && external_model.force_refusal().is_none();
        let ExternalSurrogate { stepper, trained, over_noise } =
            learnt_outside::learn_external(problem, external_model, with_load, monitor)?;
        let answers = move |_: &Stages| Ok(Some(ReducedField::Stepped(stepper.clone())));
        let compliance = Compliance::fixed(1.0).with_spread(answers);
        Ok(Self { learnt_error: Some(over_noise), ..Self::given(problem, compliance, trained) })
    }

    /// Prepares a model whose compliance also serves further `effects` of a library. It is trained over the widest range of Poisson ratios that any of these effects
    /// needs, and contains the models of their displacement fields.
    ///
    /// # Errors
    /// Errors of surrogate and field models.
    pub fn for_effects(
        problem: &Problem,
        library: &Library,
        effects: &[&'static dyn Effect],
        kept: Option<KeptSurrogate>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        if let Some(outside) = problem.outside() {
            return Self::for_external(problem, outside, &[problem.model.effects(), effects].concat(), monitor);
        }
        let Some(fe) = problem.finite_elements() else {
            return Self::unverified(problem, kept, &WarningMonitor(monitor));
        };
        let (widest, wanted) = effect_requirements(problem, fe, library, effects)?;
        let fields = field_models(fe, kept.as_ref(), &wanted, monitor)?;
        let widest = Self::unverified(widest.as_ref().unwrap_or(problem), kept, &WarningMonitor(monitor))?;
        Ok(Self { compliance: with_fields(widest.compliance.clone(), &fields), problem: problem.clone(), ..widest })
    }

    /// Returns the surrogate and the field models with the hashes of their inputs, for a file in a revision; `None` without a surrogate.
    pub fn to_keep(&self) -> Result<Option<KeptSurrogate>> {
        let problem = &self.problem;
        let (Some(fe), Some(surrogate)) = (problem.finite_elements(), self.surrogate.clone()) else { return Ok(None) };
        let fields_built_from_sha256 = fields_built_from(fe).sha256();
        let (built_from_sha256, fields) = (surrogate_built_from(problem, fe)?.sha256(), self.fields.clone());
        Ok(Some(KeptSurrogate { built_from_sha256, fields_built_from_sha256, fields, surrogate }))
    }
}

/// Returns the surrogate of the law with its inputs. A surrogate from the study (`kept`) or the cache is used if its inputs are equal; otherwise a new surrogate is
/// trained.
pub fn surrogate(
    problem: &Problem,
    fe: &FiniteElements,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<(ModelInputs, Surrogate)> {
    let (law, parameters) = training_law(problem)?;
    let training = training(problem, fe, law, &parameters)?;
    let built_from = built_from(fe, &training);
    let sha256 = built_from.sha256();
    let kept = kept.filter(|kept| kept.built_from_sha256 == sha256).map(|kept| kept.surrogate);
    let cached = || cache::read::<Surrogate>(&built_from, monitor).filter(Surrogate::is_whole);
    let surrogate = match kept.or_else(cached) {
        Some(kept) => {
            monitor.stage("using the kept surrogate");
            kept
        }
        None => {
            monitor.stage("training the surrogate on full finite-element runs");
            let trained = Surrogate::train(&fe.stiffness, &training)?;
            cache::write(&built_from, &trained);
            trained
        }
    };
    Ok((built_from, surrogate))
}

/// Inputs from which a problem's surrogate is built; their hash identifies it.
pub fn surrogate_built_from(problem: &Problem, fe: &FiniteElements) -> Result<ModelInputs> {
    let (law, parameters) = training_law(problem)?;
    Ok(built_from(fe, &training(problem, fe, law, &parameters)?))
}

/// Returns the field models (reduced models of displacement fields) that the effects need. Field models from the study (`kept`) or the cache are used if their inputs
/// are equal; others are built.
pub fn field_models(
    fe: &FiniteElements,
    kept: Option<&KeptSurrogate>,
    effects: &[&'static dyn Effect],
    monitor: &dyn Monitor,
) -> Result<FieldModels> {
    let kept = kept.filter(|kept| kept.fields_built_from_sha256 == fields_built_from(fe).sha256());
    let mut fields = kept.map_or_else(FieldModels::default, |kept| kept.fields.clone());
    for effect in effects {
        let slug = effect.slug();
        let is_asked = effect.field().is_some_and(|field| !fields.has(slug) && !field.is_learnt_for_record());
        if is_asked {
            fields = fields.merged_with(field_model(fe, *effect, monitor)?);
        }
    }
    Ok(fields)
}

/// Returns the field model of one effect (its reduced displacement fields), from the cache or newly built.
pub fn field_model(fe: &FiniteElements, effect: &'static dyn Effect, monitor: &dyn Monitor) -> Result<FieldModels> {
    let built_from = field_built_from(fe, effect.slug());
    let cached = cache::read::<FieldModels>(&built_from, monitor);
    if let Some(cached) = cached.filter(|cached| cached.has(effect.slug())) {
        return Ok(cached);
    }
    let words = effect.field().map_or("an effect", FieldEffect::words);
    monitor.stage(&format!("reducing full finite elements with {words}"));
    let counter = Counter::new(monitor, n_pieces(effect));
    let built = FieldModels::build(effect, &fe.surroundings(), &|| counter.add_one())?;
    cache::write(&built_from, &built);
    Ok(built)
}

/// Inputs of an effect's field model (its reduced displacement fields), which depend only on the apparatus.
pub fn field_built_from(fe: &FiniteElements, slug: &str) -> ModelInputs {
    fields_built_from(fe).with("effect", slug)
}

/// Adds the contributions of the field models (reduced displacement fields of effects) to a compliance.
pub fn with_fields(compliance: Compliance, fields: &FieldModels) -> Compliance {
    let fields = Arc::new(fields.clone());
    compliance.with_spread(move |stages| fields.spread(stages))
}

impl PreparedModel {
    /// Uses this reduced model for another problem, whose apparatus, law and effects are the same.
    pub fn for_problem(&self, problem: Problem) -> Self {
        let [own, other] = [&self.problem, &problem].map(|problem| &problem.experiment.record);
        let has_own_rows = own.time_s == other.time_s && own.force() == other.force();
        let local = if has_own_rows { self.local.clone() } else { Arc::default() };
        Self { problem, local, ..self.clone() }
    }

    /// Compliance for many laws that are near each other: trajectories of nonlinear laws are trained for the problem's record, and reused.
    pub fn local_compliance(&self) -> &Compliance {
        let record = &self.problem.experiment.record;
        self.local.get_or_init(|| trajectory::with_trajectory_cache(&self.compliance, &record.time_s, record.force()))
    }

    /// Log posterior of the fitted cycles by the reduced model, with [`PreparedModel::local_compliance`].
    pub fn posterior(&self) -> ReducedPosterior<'_> {
        let problem = &self.problem;
        let record = &problem.experiment.record;
        let (Record { time_s, .. }, force) = (record, record.force());
        let parts = PosteriorParts {
            model: &problem.model,
            noise: problem.noise,
            compliance: self.local_compliance().clone(),
            trained: &self.trained,
            priors: &problem.priors,
            fixed: &problem.specification.fixed,
        };
        let observed_m = &problem.positions_of(&problem.experiment.calibration_cycles);
        ReducedPosterior::new(parts, FittedRecord { time_s, force, recording: &problem.recordings(), observed_m })
    }

    /// Reduced forward model over the whole record.
    pub fn forward(&self) -> SurrogateForward<'_> {
        let record = &self.problem.experiment.record;
        self.forward_over(Response::new(&record.time_s, record.force(), record.n_rows()))
    }

    /// Reduced forward model over the first `n_rows` rows, for many laws that are near each other.
    pub fn local_forward(&self, n_rows: usize) -> SurrogateForward<'_> {
        let record = &self.problem.experiment.record;
        let compliance = self.local_compliance().clone();
        SurrogateForward { compliance, ..self.forward_over(Response::new(&record.time_s, record.force(), n_rows)) }
    }

    /// Reduced forward model over the rows for which `response` was prepared.
    pub(super) fn forward_over(&self, response: Response) -> SurrogateForward<'_> {
        let compliance = self.compliance.clone();
        SurrogateForward { model: &self.problem.model, compliance, response, trained: &self.trained }
    }
}

/// Requirements of further `effects` of a library. The first value is the problem extended by an effect that needs a wider range of Poisson ratios; `None` if no effect
/// needs one. The second value lists the problem's effects, then all further effects that suit the problem.
///
/// # Errors
/// Errors of a model's stages.
pub fn effect_requirements(
    problem: &Problem,
    fe: &FiniteElements,
    library: &Library,
    effects: &[&'static dyn Effect],
) -> Result<(Option<Problem>, Vec<&'static dyn Effect>)> {
    let values = problem.poisson_ratios(fe)?;
    let (mut widest, mut wanted) = (None, problem.model.effects().to_vec());
    for effect in effects {
        let mut specification = problem.specification.clone();
        if specification.effects.iter().any(|slug| slug == effect.slug()) {
            continue;
        }
        specification.effects.push(effect.slug().into());
        let Ok(extended) = problem.with_model(specification, library) else { continue };
        wanted.push(*effect);
        let asked = extended.poisson_ratios(fe)?;
        if asked[0] < values[0] || asked[1] > values[1] {
            // At most one effect of the library needs another Poisson ratio, so a later effect does not overwrite this value.
            widest = Some(extended);
        }
    }
    Ok((widest, wanted))
}

/// Law of the training runs, and the training ranges of its parameters. The surrogate's modes do not depend on the law. For laws other than sums of exponentials, the
/// training uses the Lethersich law over its porcine prior.
fn training_law(problem: &Problem) -> Result<(BaseLaw, Vec<TrainedRange>)> {
    let law = problem.model.base();
    if law.is_exponential() {
        return Ok((law, problem.training_ranges()));
    }
    let law = BaseLaw::default();
    let priors = PriorSet::named("porcine")?;
    let boxes = priors.box_quantiles(TAIL_MASS);
    let ranges = law.parameters().iter().zip(boxes);
    Ok((law, ranges.map(|(p, (lower, upper))| TrainedRange { name: p.name.into(), lower, upper }).collect()))
}

/// Training inputs of the surrogate: load up to the last fitted row, law, and all Poisson ratios of the model. Later rows are not used, because they serve the held-out
/// check. The training leaves effects out, because only the Poisson ratio changes the surrogate's fields.
fn training<'a>(
    problem: &'a Problem,
    fe: &FiniteElements,
    law: BaseLaw,
    parameters: &'a [TrainedRange],
) -> Result<Training<'a>> {
    let (time_s, force) = training_load(problem);
    let poisson_ratio = problem.poisson_ratios(fe)?;
    Ok(Training { law, parameters, poisson_ratio, time_s, force, tolerance: POD_TOLERANCE })
}

/// Times (s) and commanded forces up to the last fitted row, with which the surrogate is trained.
pub fn training_load(problem: &Problem) -> (&[f64], Force<'_>) {
    let Experiment { record, calibration_cycles, .. } = &problem.experiment;
    let n_rows = record.cycle.iter().rposition(|cycle| calibration_cycles.contains(cycle)).map_or(0, |last| last + 1);
    (&record.time_s[..n_rows], record.force().first(n_rows))
}

/// Result of a comparison of the reduced model with full finite elements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verification {
    /// Number of full-order runs in the comparison.
    pub n_runs: usize,
    /// Largest distance between a reduced and a full-order trajectory, divided by the amplitude of the full-order trajectory.
    pub relative_error: f64,
}

/// Compares the reduced model, including effects, with the full-order model at `n_runs` Sobol points of the priors. Points at which an effect cannot be computed are
/// left out.
fn verify(problem: &Problem, fe: &FiniteElements, compliance: &Compliance, n_runs: u32) -> Result<Verification> {
    let (time_s, force) = training_load(problem);
    let model = &problem.model;
    let full = FullOrderForward::new(model, &fe.stiffness, fe.full_order()?.clone(), time_s, force)
        .in_surroundings(fe.surroundings());
    let response = Response::new(time_s, force, time_s.len());
    let reduced = SurrogateForward { model, compliance: compliance.clone(), response, trained: &[] };
    let relative_error = |index: u32| {
        let quantile = |(d, name): (u32, &str)| {
            let coordinate = f64::from(sobol_burley::sample(index, d, VERIFICATION_SEED));
            let probability = VERIFICATION_TAIL + (1.0 - 2.0 * VERIFICATION_TAIL) * coordinate;
            problem.range_of(name, probability).lower
        };
        let names = model.parameters().iter().map(|p| p.name);
        let parameters: Vec<f64> = (0_u32..).zip(names).map(quantile).collect();
        let (full_m, reduced_m) = (full.trajectory_m(&parameters).ok()?, reduced.trajectory_m(&parameters).ok()?);
        let amplitude = full_m.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        let distance = reduced_m.iter().zip(&full_m).fold(0.0_f64, |d, (r, x)| d.max((r - x).abs()));
        Some(if amplitude > 0.0 { distance / amplitude } else { 0.0 })
    };
    let errors: Vec<f64> = (0..n_runs).into_par_iter().filter_map(relative_error).collect();
    Ok(Verification { n_runs: errors.len(), relative_error: errors.into_iter().fold(0.0, f64::max) })
}

/// Inputs that all field models (reduced displacement fields of effects) share: mesh, Poisson ratio, sizes and masses.
fn fields_built_from(fe: &FiniteElements) -> ModelInputs {
    ModelInputs::new("displacement field")
        .with_mesh(&fe.mesh)
        .with("apparatus", fe.sizes)
        .with("poisson_ratio", fe.poisson_ratio)
}

/// Inputs of a surrogate: the mesh and all inputs of its training.
fn built_from(fe: &FiniteElements, training: &Training) -> ModelInputs {
    let Training { law, parameters, poisson_ratio, time_s, force, tolerance } = training;
    ModelInputs::new("surrogate")
        .with_mesh(&fe.mesh)
        .with("robot_radius_m", fe.sizes.robot_radius_m)
        .with("outer_radius_m", fe.sizes.outer_radius_m)
        .with("law", law)
        .with("parameters", parameters)
        .with("poisson_ratio", poisson_ratio)
        .with_record(time_s, *force)
        .with("tolerance", tolerance)
}

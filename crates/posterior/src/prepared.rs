//! The prepared model: an experiment, law, effects, priors and noise, with the reduced model that answers for them and its verified error.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cache::{self, BuiltFrom};
use super::learnt_displacement::{learnt, nearest_law};
use super::learnt_outside::{self, Learnt};
use super::mechanics::{FiniteElements, Mechanics};
use super::monitor::{Counter, Monitor, Warnings};
use super::outside::Outside;
use super::problem::{Problem, TAIL_MASS};
use crate::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use crate::prior::PriorSet;
use crate::study::{Kept, WithProvenance};
use base::error::Result;
use base::files::{Content, kind, read_if_there};
use laws::rheology::BaseLaw;
use laws::stages::{Spread, Stages};
use models::effects::{Effect, Field, Library, Stage};
use models::model::{Compliance, Forward, FullForward, ReducedForward, Response, TrainedRange};
use models::surrogate::{FieldModels, Surrogate, Training, n_pieces, trajectory};
use record::{Experiment, Force, Record};

/// The file of a revision that keeps its surrogate.
pub const SURROGATE_NAME: &str = "surrogate.json";
/// Singular values below this fraction of the largest carry no mode.
const POD_TOLERANCE: f64 = 1e-6;
/// Full-order runs by which a model with effects is verified.
const VERIFICATION_RUNS: u32 = 8;
/// The same with effects whose field is solved for: each takes some ten seconds.
const SLOW_VERIFICATION_RUNS: u32 = 2;
/// They are taken between these quantiles of the priors.
const VERIFICATION_TAIL: f64 = 0.02;
/// Seed of their scrambled Sobol sequence: the design is part of the method, not of a run.
const VERIFICATION_SEED: u32 = 3;

/// A model that is ready to be asked: the problem (experiment, law, effects, priors, noise, mechanics) and what computes its trajectories.
#[derive(Clone)]
pub struct PreparedModel {
    /// The experiment and the model of it.
    pub problem: Problem,
    /// The surrogate; `None` for an instrument, whose compliance is given.
    pub surrogate: Option<Surrogate>,
    /// Models of effects that change the displacement field, as far as the model has any.
    pub fields: FieldModels,
    /// Displacement per force at unit creep compliance.
    pub compliance: Compliance,
    /// Ranges of the law's parameters in which it may be asked; empty for an instrument.
    pub trained: Vec<TrainedRange>,
    /// Largest distance from full-order trajectories on runs that did not train it, relative to their amplitude; `None` for an instrument.
    pub max_relative_error: Option<f64>,
    /// The same of an effect that was learnt for the record, or, over the noise, of another program; `None` without them.
    pub learnt_error: Option<f64>,
}

/// A surrogate as it is kept on disk, with what it was built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptSurrogate {
    /// Hash of everything that the surrogate depends on.
    pub built_from_sha256: String,
    /// Hash of everything that the models of effects' fields depend on.
    #[serde(default)]
    pub fields_built_from_sha256: String,
    /// Models of effects that change the displacement field.
    #[serde(default)]
    pub fields: FieldModels,
    /// The surrogate.
    #[serde(flatten)]
    pub surrogate: Surrogate,
}

impl KeptSurrogate {
    /// The surrogate that an earlier run left in a revision, if there is one that can be used; whether it is of the same input is looked at when it
    /// is. One that was changed since is not used, and `monitor` says so.
    pub fn read(revision_dir: &Path, monitor: &dyn Monitor) -> Option<Self> {
        let path = revision_dir.join(SURROGATE_NAME);
        kind(&path)?;
        let document: Option<WithProvenance<Kept<Self>>> =
            read_if_there(&path, Content::Document).and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let kept = document.and_then(|document| document.body.unchanged()).filter(|kept| kept.surrogate.is_whole());
        if kept.is_none() {
            monitor.warn(&format!(
                "{} is not as this program wrote it, and is not used: the surrogate is trained anew",
                path.display()
            ));
        }
        kept
    }
}

impl PreparedModel {
    /// Takes the kept surrogate if it was built from the same input, else trains one; a model with effects is verified on full-order runs of its
    /// own. A law that is not linear was compared with full-order runs when its reduced model was built, which serves: one such run over a whole record
    /// takes minutes.
    pub fn new(problem: &Problem, kept: Option<KeptSurrogate>, monitor: &dyn Monitor) -> Result<Self> {
        let mut prepared = Self::unverified(problem, kept, monitor)?;
        if let (Some(fe), false) = (problem.finite_elements(), problem.is_exponential()) {
            let of_field =
                problem.model.field().and_then(|(slug, _)| prepared.fields.verified(slug)).or(prepared.learnt_error);
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

    /// Compares two trajectories of the reduced model, as it is asked now, with full finite elements of the apparatus: what a kept model says of itself is of the day it was
    /// built. `None` without finite elements.
    ///
    /// # Errors
    /// Whatever the full model refuses.
    pub fn check_now(&self, monitor: &dyn Monitor) -> Result<Option<Verification>> {
        let Some(fe) = self.problem.finite_elements() else { return Ok(None) };
        monitor.stage("checking the reduced model on two full finite-element runs");
        verify(&self.problem, fe, &self.compliance, SLOW_VERIFICATION_RUNS).map(Some)
    }

    /// As [`PreparedModel::new`], verified for the law alone.
    pub fn unverified(problem: &Problem, kept: Option<KeptSurrogate>, monitor: &dyn Monitor) -> Result<Self> {
        let fe = match &*problem.mechanics {
            Mechanics::Instrument { compliance_per_m } => {
                return Ok(Self::given(problem, Compliance::given(*compliance_per_m), Vec::new()));
            }
            Mechanics::Outside(own) => return Self::of_outside(problem, own, problem.model.effects(), monitor),
            Mechanics::FiniteElements(fe) => fe,
        };
        let fields = field_models(fe, kept.as_ref(), problem.model.effects(), monitor)?;
        let (_, surrogate) = surrogate(problem, fe, kept, monitor)?;
        let mut compliance = with_fields(surrogate.compliance(fe.poisson_ratio)?, &fields);
        let mut learnt_error = None;
        if problem.model.field().is_some_and(|(_, field)| field.is_learnt_for_record()) {
            let law = nearest_law(problem, &compliance)?;
            let with_load = problem.model.effects().iter().any(|effect| effect.stage() == Stage::Load);
            let (stepper, error) = learnt(problem, &law, with_load, monitor)?;
            compliance = compliance.with_learnt(move || Some(stepper.clone()));
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
        })
    }

    /// A problem with a compliance that is known, and the ranges of the law's parameters in which it may be asked.
    pub fn given(problem: &Problem, compliance: Compliance, trained: Vec<TrainedRange>) -> Self {
        Self {
            problem: problem.clone(),
            surrogate: None,
            fields: FieldModels::default(),
            compliance,
            trained,
            max_relative_error: None,
            learnt_error: None,
        }
    }

    /// What stands for another program, for models with any of some effects.
    pub fn of_outside(
        problem: &Problem,
        own: &Outside,
        effects: &[&'static dyn Effect],
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let is_load = |effect: &&'static dyn Effect| effect.stage() == Stage::Load;
        let with_load = effects.iter().any(is_load) && own.answers_own_force_alone().is_none();
        let Learnt { stepper, trained, over_noise } = learnt_outside::learnt(problem, own, with_load, monitor)?;
        let answers = move |_: &Stages| Ok(Some(Spread::Stepped(stepper.clone())));
        let compliance = Compliance::given(1.0).with_spread(answers);
        Ok(Self { learnt_error: Some(over_noise), ..Self::given(problem, compliance, trained) })
    }

    /// The model whose compliance serves some effects of a library as well: trained over the widest range of Poisson ratios that one of them asks for, with the models of all their fields.
    ///
    /// # Errors
    /// Whatever building these models refuses.
    pub fn for_effects(
        problem: &Problem,
        library: &Library,
        effects: &[&'static dyn Effect],
        kept: Option<KeptSurrogate>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        if let Some(outside) = problem.outside() {
            return Self::of_outside(problem, outside, &[problem.model.effects(), effects].concat(), monitor);
        }
        let Some(fe) = problem.finite_elements() else { return Self::unverified(problem, kept, &Warnings(monitor)) };
        let (widest, wanted) = asked_for(problem, fe, library, effects)?;
        let fields = field_models(fe, kept.as_ref(), &wanted, monitor)?;
        let widest = Self::unverified(widest.as_ref().unwrap_or(problem), kept, &Warnings(monitor))?;
        Ok(Self { compliance: with_fields(widest.compliance.clone(), &fields), problem: problem.clone(), ..widest })
    }

    /// The surrogate with the hash of what it was built from.
    pub fn to_keep(&self) -> Result<Option<KeptSurrogate>> {
        let problem = &self.problem;
        let (Some(fe), Some(surrogate)) = (problem.finite_elements(), self.surrogate.clone()) else { return Ok(None) };
        let fields_built_from_sha256 = fields_built_from(fe).sha256();
        let (built_from_sha256, fields) = (surrogate_built_from(problem, fe)?.sha256(), self.fields.clone());
        Ok(Some(KeptSurrogate { built_from_sha256, fields_built_from_sha256, fields, surrogate }))
    }
}

/// The law's surrogate with what it was built from: a kept one where that was the same, in the study or in the cache, else a new one.
pub fn surrogate(
    problem: &Problem,
    fe: &FiniteElements,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<(BuiltFrom, Surrogate)> {
    let (law, parameters) = training_law(problem)?;
    let training = training(problem, fe, law, &parameters)?;
    let built_from = built_from(fe, &training);
    let sha256 = built_from.sha256();
    let kept = kept.filter(|kept| kept.built_from_sha256 == sha256).map(|kept| kept.surrogate);
    let cached = || cache::read::<Surrogate>(&built_from, monitor).filter(Surrogate::is_whole);
    let surrogate = match kept.or_else(cached) {
        Some(kept) => {
            monitor.stage("taking the surrogate that is there");
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

/// What the surrogate that a problem takes is built from.
pub fn surrogate_built_from(problem: &Problem, fe: &FiniteElements) -> Result<BuiltFrom> {
    let (law, parameters) = training_law(problem)?;
    Ok(built_from(fe, &training(problem, fe, law, &parameters)?))
}

/// The models of fields that effects ask for: kept ones where they were built from the same, in the study or in the cache, else new ones.
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
            fields = fields.or(field_model(fe, *effect, monitor)?);
        }
    }
    Ok(fields)
}

/// The model of the field that one effect asks for: a kept one where it was built from the same, else a new one.
pub fn field_model(fe: &FiniteElements, effect: &'static dyn Effect, monitor: &dyn Monitor) -> Result<FieldModels> {
    let built_from = field_built_from(fe, effect.slug());
    let cached = cache::read::<FieldModels>(&built_from, monitor);
    if let Some(cached) = cached.filter(|cached| cached.has(effect.slug())) {
        return Ok(cached);
    }
    let words = effect.field().map_or("an effect", Field::words);
    monitor.stage(&format!("reducing full finite elements with {words}"));
    let counter = Counter::new(monitor, n_pieces(effect));
    let built = FieldModels::build(effect, &fe.surroundings(), &|| counter.add_one())?;
    cache::write(&built_from, &built);
    Ok(built)
}

/// What the model of an effect's field is built from: the apparatus alone.
pub fn field_built_from(fe: &FiniteElements, slug: &str) -> BuiltFrom {
    fields_built_from(fe).with("effect", slug)
}

/// The compliance with the terms of fields.
pub fn with_fields(compliance: Compliance, fields: &FieldModels) -> Compliance {
    let fields = Arc::new(fields.clone());
    compliance.with_spread(move |stages| fields.spread(stages))
}

impl PreparedModel {
    /// The same reduced model for a problem that differs in its positions, cycles or priors alone.
    pub fn for_problem(&self, problem: Problem) -> Self {
        Self { problem, ..self.clone() }
    }

    /// Log-posterior of the calibration cycles by the reduced model. A law that is not linear remembers its trajectories.
    pub fn posterior(&self) -> ReducedPosterior<'_> {
        let problem = &self.problem;
        let record = &problem.experiment.record;
        let (Record { time_s, .. }, force) = (record, record.force());
        let parts = PosteriorParts {
            model: &problem.model,
            noise: problem.noise,
            compliance: trajectory::local(&self.compliance, time_s, force),
            trained: &self.trained,
            priors: &problem.priors,
            fixed: &problem.specification.fixed,
        };
        let observed_m = &problem.positions_of(&problem.experiment.calibration_cycles);
        ReducedPosterior::new(parts, FittedRecord { time_s, force, recording: &problem.recordings(), observed_m })
    }

    /// The reduced forward model over the whole record.
    pub fn forward(&self) -> ReducedForward<'_> {
        let record = &self.problem.experiment.record;
        self.forward_over(Response::new(&record.time_s, record.force(), record.n_rows()))
    }

    /// The same over the first rows, by the compliance that the posterior takes.
    pub fn forward_up_to(&self, n_rows: usize) -> ReducedForward<'_> {
        let record = &self.problem.experiment.record;
        let (time_s, force) = (&record.time_s, record.force());
        let compliance = trajectory::local(&self.compliance, time_s, force);
        ReducedForward { compliance, ..self.forward_over(Response::new(time_s, force, n_rows)) }
    }

    /// The same over the rows of a response.
    pub(super) fn forward_over(&self, response: Response) -> ReducedForward<'_> {
        let compliance = self.compliance.clone();
        ReducedForward { model: &self.problem.model, compliance, response, trained: &self.trained }
    }
}

/// What a library's effects ask for beside a problem: the problem with the widest range of Poisson ratios, where one of them asks for more than the problem itself; and all whose fields are
/// modelled, its own first.
///
/// # Errors
/// Whatever the stages of a model refuse.
pub fn asked_for(
    problem: &Problem,
    fe: &FiniteElements,
    library: &Library,
    effects: &[&'static dyn Effect],
) -> Result<(Option<Problem>, Vec<&'static dyn Effect>)> {
    let own = problem.poisson_ratios(fe)?;
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
        if asked[0] < own[0] || asked[1] > own[1] {
            // One effect at most asks for another ratio.
            widest = Some(extended);
        }
    }
    Ok((widest, wanted))
}

/// The law of the training runs. The modes do not depend on it, so a network's are trained by the Lethersich law over its default prior.
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

/// Training on the load up to the last calibration row: what comes after is left to the held-out check. The modes are those of the law alone,
/// over all Poisson ratios that the model asks for, since no other effect of this program changes the field.
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

/// Times and forces up to the last calibration row.
pub fn training_load(problem: &Problem) -> (&[f64], Force<'_>) {
    let Experiment { record, calibration_cycles, .. } = &problem.experiment;
    let n_rows = record.cycle.iter().rposition(|cycle| calibration_cycles.contains(cycle)).map_or(0, |last| last + 1);
    (&record.time_s[..n_rows], record.force().first(n_rows))
}

/// What full finite elements say of a reduced model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verification {
    /// Full-order runs that it was compared with.
    pub n_runs: usize,
    /// Largest distance of the reduced from the full-order trajectory, relative to the latter's amplitude.
    pub relative_error: f64,
}

/// Compares the reduced model with its effects with the full-order one at Sobol points of the priors. Points at which an effect has no model are left out.
fn verify(problem: &Problem, fe: &FiniteElements, compliance: &Compliance, n_runs: u32) -> Result<Verification> {
    let (time_s, force) = training_load(problem);
    let model = &problem.model;
    let full =
        FullForward::new(model, &fe.stiffness, fe.poisson_ratio, time_s, force)?.in_surroundings(fe.surroundings());
    let response = Response::new(time_s, force, time_s.len());
    let reduced = ReducedForward { model, compliance: compliance.clone(), response, trained: &[] };
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

/// What models of fields are built from: the mesh, sizes, weights and the Poisson ratio.
fn fields_built_from(fe: &FiniteElements) -> BuiltFrom {
    BuiltFrom::new("displacement field")
        .with_mesh(&fe.mesh)
        .with("apparatus", fe.sizes)
        .with("poisson_ratio", fe.poisson_ratio)
}

/// What a law's surrogate is built from: the mesh and everything in the training.
fn built_from(fe: &FiniteElements, training: &Training) -> BuiltFrom {
    let Training { law, parameters, poisson_ratio, time_s, force, tolerance } = training;
    BuiltFrom::new("surrogate")
        .with_mesh(&fe.mesh)
        .with("robot_radius_m", fe.sizes.robot_radius_m)
        .with("outer_radius_m", fe.sizes.outer_radius_m)
        .with("law", law)
        .with("parameters", parameters)
        .with("poisson_ratio", poisson_ratio)
        .with_record(time_s, *force)
        .with("tolerance", tolerance)
}

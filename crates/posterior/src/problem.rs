//! Inference problem: an experiment joined with law, effects, priors, noise and mechanics.

use std::sync::Arc;

use super::mechanics::{FiniteElements, Mechanics, MeshFile};
use super::model_priors::read_priors;
use super::outside::{ExternalForward, ExternalModel};
use crate::monitor::Monitor;
use crate::noise::{NoiseLikelihood, NoiseModel};
use crate::prior::PriorSet;
use crate::recordings::recordings;
use crate::study::ModelSpecification;
use base::distribution::Distribution;
use base::error::{Error, InputPlace, Result, Setting};
use base::number::Dual;
use base::parameter::ParameterSpec;
use models::effects::{FieldEffect, Library, Stage};
use models::model::{FullOrderForward, Model, TrainedRange};
use record::{Apparatus, CharacteristicSizes, Experiment};

/// Prior mass beyond either end of the surrogate's trained range; the prior is truncated there.
pub const TAIL_MASS: f64 = 1e-9;

/// An experiment with its checked model and the mechanics of its apparatus.
#[derive(Clone)]
pub struct Problem {
    /// Experiment with its record.
    pub experiment: Experiment,
    /// Model as specified in `model.toml`, with optional parameters fixed at their nulls.
    pub specification: ModelSpecification,
    /// Law and effects of the problem.
    pub model: Model,
    /// Noise model of the measured positions.
    pub noise: NoiseModel,
    /// Priors of the sampled parameters.
    pub priors: PriorSet,
    /// Finite elements, an instrument or an external program; shared by the models of one experiment.
    pub mechanics: Arc<Mechanics>,
}

impl Problem {
    /// Checks a model with built-in effects against the experiment, and builds the mechanics.
    pub fn new(
        experiment: Experiment,
        specification: ModelSpecification,
        mesh_file: Option<&MeshFile>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        Self::with_library(experiment, specification, &Library::default(), mesh_file, monitor)
    }

    /// Checks a model with effects of a given library against the experiment, and builds the mechanics.
    pub fn with_library(
        experiment: Experiment,
        specification: ModelSpecification,
        library: &Library,
        mesh_file: Option<&MeshFile>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let checked = check(&experiment, specification, library)?;
        let mechanics = match checked.model.base().outside() {
            Some(law) => {
                refuse_mesh_outside(mesh_file)?;
                monitor.stage(&format!("connecting to {}", law.url()));
                let medians = checked.medians(law.parameters());
                Mechanics::External(Box::new(ExternalModel::connect(law, &experiment.record, &medians)?))
            }
            None => {
                if matches!(experiment.apparatus, Apparatus::Robot { .. }) {
                    monitor.stage("meshing the body and assembling the finite elements");
                }
                Mechanics::new(&experiment.apparatus, mesh_file)?
            }
        };
        if let Mechanics::FiniteElements(fe) = &mechanics {
            fe.mesh_warnings.iter().for_each(|w| monitor.warn(&format!("{}; {}", w.text, w.advice)));
        }
        let Checked { specification, model, noise, priors } = checked;
        refuse_without_mesh(&model, &mechanics)?;
        refuse_without_density(&model, &experiment)?;
        Ok(Self { experiment, specification, model, noise, priors, mechanics: Arc::new(mechanics) })
    }

    /// Checks the model against the experiment and joins it with existing mechanics.
    ///
    /// # Errors
    /// [`Error::Input`] if the model does not suit the experiment.
    pub fn with_mechanics(
        experiment: Experiment,
        specification: ModelSpecification,
        library: &Library,
        mechanics: Arc<Mechanics>,
    ) -> Result<Self> {
        let Checked { specification, model, noise, priors } = check(&experiment, specification, library)?;
        refuse_without_mesh(&model, &mechanics)?;
        refuse_without_density(&model, &experiment)?;
        Ok(Self { experiment, specification, model, noise, priors, mechanics })
    }

    /// Returns the problem of another model with this experiment and its mechanics.
    ///
    /// # Errors
    /// [`Error::Input`] if the model does not suit the experiment.
    pub fn with_model(&self, specification: ModelSpecification, library: &Library) -> Result<Self> {
        self.with_experiment(self.experiment.clone(), specification, library)
    }

    /// Returns the problem of another model and another record of this apparatus, with the existing mechanics.
    ///
    /// # Errors
    /// [`Error::Input`] if the model does not suit the experiment.
    pub fn with_experiment(
        &self,
        experiment: Experiment,
        specification: ModelSpecification,
        library: &Library,
    ) -> Result<Self> {
        Self::with_mechanics(experiment, specification, library, self.mechanics.clone())
    }

    /// Returns the problem of the same gel with another apparatus and record. Parameters keep their meaning: sizes of the record stay those of the original, to which the
    /// law's stresses refer, and sizes of robot and gel become those of the new apparatus.
    ///
    /// # Errors
    /// [`Error::Input`] if the new apparatus does not support an effect of the model.
    pub fn for_apparatus(&self, experiment: Experiment, mechanics: Arc<Mechanics>) -> Result<Self> {
        let sizes = experiment.scales();
        let scales = CharacteristicSizes {
            poisson_ratio: sizes.poisson_ratio,
            robot_radius_m: sizes.robot_radius_m,
            outer_radius_m: sizes.outer_radius_m,
            is_position_controlled: sizes.is_position_controlled,
            ..*self.model.scales()
        };
        let effects = self.model.effects().to_vec();
        let model = Model::new(self.model.base(), effects, scales, &InputPlace::setting(Setting::Effects))?;
        refuse_without_mesh(&model, &mechanics)?;
        refuse_without_density(&model, &experiment)?;
        let (specification, priors) = (self.specification.clone(), self.priors.clone());
        Ok(Self { experiment, specification, model, noise: self.noise, priors, mechanics })
    }

    /// Replaces the positions (m, one entry per row) and keeps model and priors. Priors that depend on the range of positions still use the range of the original
    /// record.
    pub fn with_positions(&self, position_m: Vec<Option<f64>>) -> Self {
        let mut experiment = self.experiment.clone();
        experiment.record.position_m = position_m;
        Self { experiment, ..self.clone() }
    }

    /// Parameters of the model, then of the noise.
    pub fn parameters(&self) -> Vec<ParameterSpec> {
        self.model.parameters().iter().copied().chain(self.noise.parameters()).collect()
    }

    /// Returns true if the model has no effects and its law's creep is a finite sum of exponentials. The exponential step is then exact while the force holds.
    pub fn is_exponential(&self) -> bool {
        self.model.is_law_alone() && self.model.base().is_exponential()
    }

    /// Finite elements, if the mechanics have any.
    pub fn finite_elements(&self) -> Option<&FiniteElements> {
        match &*self.mechanics {
            Mechanics::FiniteElements(fe) => Some(fe),
            Mechanics::Instrument { .. } | Mechanics::External(_) => None,
        }
    }

    /// External program, if it replaces the base law.
    pub fn outside(&self) -> Option<&ExternalModel> {
        match &*self.mechanics {
            Mechanics::External(outside) => Some(outside),
            Mechanics::FiniteElements(_) | Mechanics::Instrument { .. } => None,
        }
    }

    /// Forward model of the external program over the whole record; `None` without an external program.
    pub fn outside_forward(&self) -> Option<ExternalForward<'_>> {
        let record = &self.experiment.record;
        self.outside()
            .map(|external_model| ExternalForward::new(external_model, &self.model, &record.time_s, record.force()))
    }

    /// Range of a parameter: its prior without the probability `tail` on either side, or its fixed value as both ends.
    pub fn range_of(&self, name: &str, tail: f64) -> TrainedRange {
        let (lower, upper) = match self.priors.get(name) {
            Some(prior) => (prior.distribution.quantile(tail), prior.distribution.quantile(1.0 - tail)),
            None => {
                let value = self.specification.fixed.get(name).copied().unwrap_or(f64::NAN);
                (value, value)
            }
        };
        TrainedRange { name: name.to_string(), lower, upper }
    }

    /// Range of a parameter in which the surrogate of an external program was trained; `None` without a program or before the training.
    pub fn learnt_range(&self, name: &str) -> Option<&TrainedRange> {
        let trained = &self.outside()?.trained_box()?.trained;
        trained.iter().find(|range| range.name == name && range.lower < range.upper)
    }

    /// Distribution from which starts of a parameter are drawn: its prior, or the range in which the surrogate of an external program was trained. `None` for a fixed
    /// parameter.
    pub fn starts_of(&self, name: &str) -> Option<Distribution> {
        let prior = self.priors.get(name)?.distribution;
        let learnt = self.learnt_range(name);
        Some(learnt.map_or(prior, |range| Distribution::LogUniform { lower: range.lower, upper: range.upper }))
    }

    /// Training ranges of the law's parameters for a surrogate: the prior's range without [`TAIL_MASS`] on either side, or the fixed value.
    pub fn training_ranges(&self) -> Vec<TrainedRange> {
        self.model.base().parameters().iter().map(|p| self.range_of(p.name, TAIL_MASS)).collect()
    }

    /// Smallest and largest Poisson ratio that the model needs, from its stages at both ends of every effect's prior.
    pub fn poisson_ratios(&self, fe: &FiniteElements) -> Result<[f64; 2]> {
        let specs = self.model.parameters();
        let middle: Vec<Dual> = specs.iter().map(|p| self.range_of(p.name, 0.5).lower.into()).collect();
        let mut ratios = [fe.poisson_ratio; 2];
        for (index, spec) in specs.iter().enumerate().skip(self.model.base().parameters().len()) {
            let range = self.range_of(spec.name, TAIL_MASS);
            for end in [range.lower, range.upper] {
                let mut parameters = middle.clone();
                parameters[index] = end.into();
                // An effect that cannot be computed at these parameters needs no Poisson ratio.
                let asked = self.model.stages(&parameters).ok().and_then(|stages| stages.poisson_ratio);
                if let Some(ratio) = asked {
                    ratios = [ratios[0].min(ratio.value), ratios[1].max(ratio.value)];
                }
            }
        }
        Ok(ratios)
    }

    /// Positions (m) of the given cycles, one entry per row of the record; `None` at other rows.
    pub fn positions_of(&self, cycles: &[u32]) -> Vec<Option<f64>> {
        let record = &self.experiment.record;
        let pairs = record.position_m.iter().zip(&record.cycle);
        let is_wanted = record.cycle_filter(cycles);
        pairs.map(|(position, cycle)| position.filter(|_| is_wanted(*cycle))).collect()
    }

    /// Recording number of each row, from 1. Each recording has its own gain and offset.
    pub fn recordings(&self) -> Vec<u32> {
        recordings(&self.experiment.record)
    }

    /// Likelihood of the given cycles' positions under the model's noise.
    pub fn noise_likelihood(&self, cycles: &[u32]) -> NoiseLikelihood {
        let record = &self.experiment.record;
        NoiseLikelihood::new(self.noise, &record.time_s, &self.recordings(), &self.positions_of(cycles))
    }

    /// Full-order forward model over the whole record; `None` without finite elements.
    pub fn full_forward(&self) -> Result<Option<FullOrderForward<'_>>> {
        let record = &self.experiment.record;
        self.finite_elements()
            .map(|fe| {
                let at_ratio = fe.full_order()?.clone();
                let full = FullOrderForward::new(&self.model, &fe.stiffness, at_ratio, &record.time_s, record.force());
                Ok(full.in_surroundings(fe.surroundings()))
            })
            .transpose()
    }
}

/// Refuses an effect that the robot, the mesh or the external program does not support.
fn refuse_without_mesh(model: &Model, mechanics: &Mechanics) -> Result<()> {
    let fe = match mechanics {
        Mechanics::FiniteElements(fe) => fe,
        Mechanics::Instrument { .. } => return Ok(()),
        Mechanics::External(outside) => return refuse_unsupported_loads(model, outside),
    };
    match model.field().and_then(|(slug, field)| Some((slug, field.lacks(&fe.surroundings())?))) {
        None => Ok(()),
        Some((slug, reason)) => Err(Error::input(
            InputPlace::setting(Setting::Effects),
            format!("`{slug}` cannot be computed for this robot and mesh: {reason}"),
            "leave it out, or use another mesh",
        )),
    }
}

/// Refuses an effect that needs masses if the density of robot or gel is missing.
fn refuse_without_density(model: &Model, experiment: &Experiment) -> Result<()> {
    let Apparatus::Robot { robot, vitreous } = &experiment.apparatus else { return Ok(()) };
    let missing = [("robot", robot.density_kg_m3), ("vitreous", vitreous.density_kg_m3)];
    let missing = missing.iter().find(|(_, density)| density.is_none());
    match (model.field(), missing) {
        (Some((slug, FieldEffect::Pair(pair))), Some((table, _))) if pair.has_mass() => Err(Error::input(
            InputPlace::setting(Setting::Effects),
            format!("`{slug}` needs a density, but [{table}] has none"),
            format!("add `density_kg_m3` to [{table}] of experiment.toml"),
        )),
        _ => Ok(()),
    }
}

/// Refuses effects that change the load if the external program predicts only under the record's own force.
fn refuse_unsupported_loads(model: &Model, outside: &ExternalModel) -> Result<()> {
    let load = model.effects().iter().find(|effect| effect.stage() == Stage::Load);
    match (load, outside.force_refusal()) {
        (Some(effect), Some(reason)) => Err(Error::input(
            InputPlace::setting(Setting::Effects),
            format!(
                "`{}` changes the force, but the external program predicts only under the record's own force: {reason}",
                effect.slug()
            ),
            "leave it out; effects of observation are possible",
        )),
        _ => Ok(()),
    }
}

fn refuse_mesh_outside(mesh_file: Option<&MeshFile>) -> Result<()> {
    mesh_file.map_or(Ok(()), |_| {
        let found = "the law is an external program and has no mesh here";
        Err(Error::input(InputPlace::setting(Setting::Mesh), found, "leave it out"))
    })
}

/// Refuses fixed values that lie inside their support but at which the model cannot be evaluated for this experiment.
fn refuse_fixed_without_model(specification: &ModelSpecification, model: &Model, priors: &PriorSet) -> Result<()> {
    if specification.fixed.is_empty() {
        return Ok(());
    }
    let value = |name: &str| {
        let median = || priors.get(name).map_or(f64::NAN, |prior| prior.distribution.quantile(0.5));
        specification.fixed.get(name).copied().unwrap_or_else(median)
    };
    let middle: Vec<Dual> = model.parameters().iter().map(|p| value(p.name).into()).collect();
    match model.stages(&middle) {
        Err(Error::Numerical { what, remedy }) => Err(Error::input(InputPlace::setting(Setting::Fixed), what, remedy)),
        other => other.map(|_| ()),
    }
}

/// Model that has passed all checks against the experiment.
struct Checked {
    specification: ModelSpecification,
    model: Model,
    noise: NoiseModel,
    priors: PriorSet,
}

impl Checked {
    /// Value of each parameter in `specs`: its fixed value, or the median of its prior.
    fn medians(&self, specs: &[ParameterSpec]) -> Vec<f64> {
        let median = |name: &str| self.priors.get(name).map(|prior| prior.distribution.quantile(0.5));
        let value = |name: &str| self.specification.fixed.get(name).copied().or_else(|| median(name));
        specs.iter().map(|spec| value(spec.name).unwrap_or(f64::NAN)).collect()
    }
}

/// Checks a model against an experiment and returns its law, effects, noise and priors.
fn check(experiment: &Experiment, specification: ModelSpecification, library: &Library) -> Result<Checked> {
    let scales = experiment.scales();
    let specification = specification.with_nulls(&scales, library);
    let effects = specification.effects(library);
    if let Some(unknown) = specification.effects.iter().find(|slug| library.get(slug).is_none()) {
        return Err(Error::input(
            InputPlace::setting(Setting::Effects),
            format!("there is no effect `{unknown}`"),
            "name effects that `vitreo-uq effects` lists, or give the library that contains it",
        ));
    }
    let model = Model::new(specification.base, effects, scales, &InputPlace::setting(Setting::Effects))?;
    let noise = specification.noise_model(&InputPlace::setting(Setting::Noise))?;
    let all_priors = read_priors(&specification.prior, &model, noise, library)?;
    for (name, value) in &specification.fixed {
        let spec = model.parameters().iter().copied().chain(noise.parameters()).find(|spec| spec.name == name);
        if !spec.is_some_and(|spec| value.is_finite() && spec.support.contains(*value)) {
            let names: Vec<&str> = all_priors.names().collect();
            return Err(Error::input(
                InputPlace::setting(Setting::Fixed),
                format!("{name} = {value}"),
                format!("set one of {} to a value inside its support", names.join(", ")),
            ));
        }
    }
    refuse_fixed_without_model(&specification, &model, &all_priors)?;
    let fixed: Vec<&str> = specification.fixed.keys().map(String::as_str).collect();
    let priors = all_priors.without(&fixed);
    Ok(Checked { specification, model, noise, priors })
}

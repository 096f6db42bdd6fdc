//! Model of a base law and a valid combination of effects (physics §5).

use crate::effects::{Effect, FieldEffect, Stage, nuisances};
use base::error::{Error, InputPlace, Result};
use base::number::Dual;
use base::parameter::ParameterSpec;
use laws::rheology::BaseLaw;
use laws::stages::{Spatial, Stages};
use record::CharacteristicSizes;

/// Base law with effects. The parameters are those of the law, then of the experiment's nuisances, then of each effect.
#[derive(Clone)]
pub struct Model {
    base: BaseLaw,
    effects: Vec<&'static dyn Effect>,
    scales: CharacteristicSizes,
    parameters: Vec<ParameterSpec>,
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let slugs: Vec<&str> = self.effects.iter().map(|effect| effect.slug()).collect();
        write!(f, "{:?} with {slugs:?} at {:?}", self.base, self.scales)
    }
}

impl Model {
    /// Combines a law and effects. Error messages show `place` as the place where the user named the effects.
    ///
    /// # Errors
    /// [`Error::Input`] with the reason if the combination is invalid.
    pub fn new(
        base: BaseLaw,
        effects: Vec<&'static dyn Effect>,
        scales: CharacteristicSizes,
        place: &InputPlace,
    ) -> Result<Self> {
        let refuse = |found: String, remedy: &str| Err(Error::input(place.clone(), found, remedy));
        for (place_in_list, effect) in effects.iter().enumerate() {
            let slug = effect.slug();
            if effects[..place_in_list].iter().any(|other| other.slug() == slug) {
                return refuse(format!("`{slug}` is named twice"), "name it once");
            }
            if let Some(reason) = external_conflict(*effect, &base).or_else(|| effect.conflict(&base)) {
                return refuse(
                    format!("`{slug}` cannot be added to the {} law: {reason}", base.title()),
                    &format!("use another base law ({}), or leave the effect out", base::error::Setting::Base),
                );
            }
            if effect.needs_finite_elements() && scales.poisson_ratio.is_none() {
                return refuse(
                    format!("`{slug}` needs finite elements, and an instrument has none"),
                    "leave it out; effects on the force, the creep compliance or the recorded position work for instruments",
                );
            }
            if effect.depends_on_position() && scales.depth_exponent.is_some_and(|exponent| exponent != 1.0) {
                return refuse(
                    format!(
                        "`{slug}` needs a position proportional to the force; an indenter's depth is not proportional"
                    ),
                    "leave it out; other effects on the force, the creep compliance or the recorded position work for indenters",
                );
            }
        }
        let fields: Vec<&str> = effects.iter().filter(|e| e.changes_field()).map(|e| e.slug()).collect();
        if fields.len() > 1 {
            return refuse(
                format!("{} both change the displacement field", fields.join(" and ")),
                "keep one of them: a model has at most one effect that changes the field",
            );
        }
        if let Some(entry) = effects.iter().find(|effect| effect.depends_on_state()) {
            let is_other = |other: &&&dyn Effect| {
                other.slug() != entry.slug() && (other.depends_on_state() || other.depends_on_position())
            };
            if let Some(other) = effects.iter().find(is_other) {
                return refuse(
                    format!("`{}` and `{}` both make a quantity depend on a state", entry.slug(), other.slug()),
                    "keep one of them, or write both into one formula",
                );
            }
        }
        if let Some((field, model)) = effects.iter().find_map(|e| Some((e, e.field()?))) {
            let barred = effects.iter().find_map(|other| Some((other, other.conflict_with_field(model)?)));
            if let Some((other, reason)) = barred {
                return refuse(
                    format!("`{}` and `{}` cannot be combined: {reason}", field.slug(), other.slug()),
                    "leave one of them out",
                );
            }
        }
        if let Some(nonlinear) = effects.iter().find(|effect| effect.is_nonlinear()) {
            let is_other =
                |effect: &&&dyn Effect| effect.stage() == Stage::Mechanics && effect.slug() != nonlinear.slug();
            if let Some(other) = effects.iter().find(is_other) {
                return refuse(
                    format!("`{}` and `{}` cannot be combined", nonlinear.slug(), other.slug()),
                    "leave one out: only effects of load and observation can be combined with a nonlinear law",
                );
            }
        }
        if scales.is_position_controlled {
            if base.outside().is_some() {
                let found = "an external program cannot follow a prescribed position".to_string();
                return refuse(found, "give a record with a prescribed force, or name another law");
            }
            if let Some(effect) = effects.iter().find(|effect| needs_prescribed_force(**effect)) {
                return refuse(
                    format!("`{}` needs a prescribed force", effect.slug()),
                    "leave it out: its model cannot follow a prescribed position",
                );
            }
        }
        let all = nuisances(&scales).iter().chain(&effects);
        let of_effects = all.flat_map(|effect| effect.parameters()).map(|parameter| parameter.spec);
        let parameters = base.parameters().iter().copied().chain(of_effects).collect();
        Ok(Self { base, effects, scales, parameters })
    }

    /// Lethersich law without effects, which needs no sizes of an experiment.
    pub fn lethersich() -> Self {
        let (base, scales) = (BaseLaw::Lethersich, CharacteristicSizes::default());
        Self { base, effects: Vec::new(), scales, parameters: base.parameters().to_vec() }
    }

    /// Constitutive law to which the effects are added.
    pub fn base(&self) -> BaseLaw {
        self.base
    }

    /// Effects, in the order in which they are applied.
    pub fn effects(&self) -> &[&'static dyn Effect] {
        &self.effects
    }

    /// Nuisances, which are unknowns of the experiment itself. Their parameters come before the effects' parameters.
    pub fn nuisances(&self) -> &'static [&'static dyn Effect] {
        nuisances(&self.scales)
    }

    /// Number of parameters of the law and the nuisances together. These parameters come before the effects' parameters.
    pub fn n_before_effects(&self) -> usize {
        let of_nuisances = self.nuisances().iter().map(|effect| effect.parameters().len());
        self.base.parameters().len() + of_nuisances.sum::<usize>()
    }

    /// Returns `true` if the model has no effects and no nuisances, and the position is linear in the force (unlike an indenter's
    /// depth).
    pub fn is_law_alone(&self) -> bool {
        let is_linear = self.scales.depth_exponent.is_none_or(|exponent| exponent == 1.0);
        self.effects.is_empty() && self.nuisances().is_empty() && is_linear
    }

    /// Returns `true` if an effect makes the law nonlinear. Computing a trajectory then takes a thousand times as long.
    pub fn is_nonlinear(&self) -> bool {
        self.effects.iter().any(|effect| effect.is_nonlinear())
    }

    /// Characteristic sizes of the experiment, which scale the effects and their priors.
    pub fn scales(&self) -> &CharacteristicSizes {
        &self.scales
    }

    /// Parameters of the law, then of the nuisances, then of each effect.
    pub fn parameters(&self) -> &[ParameterSpec] {
        &self.parameters
    }

    /// Returns the stages (equations) of the model at `parameters`, which are in SI units and in the order of [`Self::parameters`].
    ///
    /// # Errors
    /// [`Error::Numerical`] if a parameter is outside its support, or if an effect has no model at these parameters.
    pub fn stages(&self, parameters: &[Dual]) -> Result<Stages> {
        for (spec, parameter) in self.parameters.iter().zip(parameters) {
            if !spec.support.contains(parameter.value) {
                return Err(Error::numerical(
                    format!("{} = {} is outside {}", spec.name, parameter.value, spec.support),
                    "give a value inside the support",
                ));
            }
        }
        let (law, mut rest) = parameters.split_at(self.base.parameters().len());
        let mut stages = Stages::of_law(self.base.elements(law));
        stages.base = Some(self.base);
        stages.is_position_controlled = self.scales.is_position_controlled;
        stages.observation.depth_exponent = self.scales.depth_exponent.unwrap_or(1.0).into();
        if self.base.outside().is_some() {
            // The external program returns the position itself, not its power.
            stages.observation.depth_exponent = Dual::ONE;
            stages.spatial = Some(Spatial::External(law.to_vec()));
        }
        let mut of_field = None;
        for effect in self.nuisances().iter().chain(&self.effects) {
            let (duals, others) = rest.split_at(effect.parameters().len());
            match effect.field() {
                Some(_) => of_field = Some((effect, duals)),
                None => effect.apply(duals, &self.scales, &mut stages)?,
            }
            rest = others;
        }
        if let Some((effect, entry)) = of_field {
            effect.apply(entry, &self.scales, &mut stages)?;
        }
        Ok(stages)
    }

    /// Effect that changes the displacement field, as its slug and its equations; `None` if no effect does.
    pub fn field(&self) -> Option<(&'static str, FieldEffect)> {
        self.effects.iter().find_map(|effect| Some((effect.slug(), effect.field()?)))
    }
}

/// Returns `true` if an effect can only be computed for a prescribed force, because it changes the field, is nonlinear or depends on the position.
fn needs_prescribed_force(effect: &dyn Effect) -> bool {
    effect.changes_field() || effect.depends_on_state() || effect.depends_on_position()
}

/// Reason why an effect cannot be added to an external law; `None` if it can. Only effects on the load or on the observation can
/// be added.
fn external_conflict(effect: &dyn Effect, base: &BaseLaw) -> Option<&'static str> {
    base.outside()?;
    if effect.depends_on_state() || effect.stage() == Stage::Mechanics {
        return Some("it changes the law or the gel, which the other program computes");
    }
    effect.depends_on_position().then_some("a force that depends on the position acts within the other program's model")
}

//! Reduced models of effects on the displacement field, one for each effect of a problem.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::hyper::{self, HyperModel, HyperSettings};
use super::spread::FieldModes;
use super::three_terms::{N_SHAPES, ThreeTerms};
use crate::effects::{Effect, FieldEffect};
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::poroelastic::{PoreModel, PoreSpectrum, SpectrumSettings};
use elements::fe::spatial::GelAndRobot;
use laws::rheology::SpreadTerm;
use laws::stages::{LinearField, ReducedField, SharedStepper, Spatial, Stages};

/// Fraction of the largest singular value below which modes are dropped.
const TOLERANCE: f64 = 1e-6;

/// Reduced model of one effect on the displacement field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FieldModel {
    /// Terms of a linear effect whose field has no shape parameter.
    Modes(FieldModes),
    /// Terms of a linear effect whose field depends on a shape parameter, such as a pocket's radius.
    ThreeTerms(ThreeTerms),
    /// Terms of an effect with pore flow.
    Pores(PoreSpectrum),
    /// Hyper-reduced model of a nonlinear law.
    Nonlinear(HyperModel),
}

/// Reduced models, by the slugs of their effects. Only models of requested effects are present.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FieldModels(BTreeMap<String, FieldModel>);

/// Number of tasks in building the reduced model of an effect, for progress reports.
pub fn n_pieces(effect: &dyn Effect) -> usize {
    match effect.field() {
        None => 0,
        Some(field) if field.is_learnt_for_record() => 0,
        Some(FieldEffect::Pair(pair)) if pair.shape().is_some() => N_SHAPES,
        Some(FieldEffect::Pair(_) | FieldEffect::Pores(_)) => 1,
        Some(FieldEffect::Nonlinear(family)) => HyperSettings::of(family).n_runs(),
        Some(_) => 0,
    }
}

impl FieldModel {
    /// Builds the reduced model of one effect, if its field needs such a model. It calls `piece_done` after every task, from any thread.
    fn build(
        effect: &dyn Effect,
        surroundings: &GelAndRobot<'_>,
        piece_done: &(dyn Fn() + Sync),
    ) -> Result<Option<Self>> {
        let Some(field) = effect.field() else { return Ok(None) };
        Ok(Some(match field {
            FieldEffect::Pair(pair) => match pair.shape() {
                Some(shape) => Self::ThreeTerms(ThreeTerms::new(pair, shape, surroundings, TOLERANCE, piece_done)?),
                None => {
                    let system = pair.system(surroundings, None)?.system;
                    let modes = FieldModes::new(&system, &pair.splitting(&surroundings.sizes), TOLERANCE)?;
                    piece_done();
                    Self::Modes(modes)
                }
            },
            FieldEffect::Pores(drained_range) => {
                let model = PoreModel::new(surroundings.mesh, surroundings.stiffness, surroundings.poisson_ratio)?;
                let drained_poisson_ratio = drained_range(surroundings.poisson_ratio);
                let settings = SpectrumSettings { drained_poisson_ratio, ..SpectrumSettings::default() };
                let spectrum = PoreSpectrum::build(&model, &settings)?;
                piece_done();
                Self::Pores(spectrum)
            }
            FieldEffect::Nonlinear(family) => {
                Self::Nonlinear(hyper::build(surroundings, family, &HyperSettings::of(family), piece_done)?)
            }
            // The model of large displacements is trained for each record, not here (`surrogate::trajectory`).
            _ => return Ok(None),
        }))
    }

    /// Returns the terms of a linear effect; `None` if this model is of another kind.
    fn terms(&self, field: &LinearField) -> Result<Option<Vec<SpreadTerm>>> {
        Ok(match (self, field.shape) {
            (Self::Modes(modes), None) => Some(terms_of(modes)),
            (Self::ThreeTerms(model), Some(shape)) => Some(model.terms(shape)?),
            (Self::Pores(pores), Some(drained_poisson_ratio)) => {
                let undrained = SpreadTerm { weight: Dual::ONE, number: Dual::ZERO };
                let flowing = pores.terms(drained_poisson_ratio)?;
                let flowing = flowing.iter().map(|term| SpreadTerm { weight: term.weight, number: term.area_m2 });
                Some([undrained].into_iter().chain(flowing).collect())
            }
            _ => None,
        })
    }
}

impl FieldModels {
    /// Builds the reduced model of one effect, if its field needs such a model. It calls `piece_done` after every task, from any thread.
    ///
    /// # Errors
    /// Errors of the full-order models.
    pub fn build(effect: &dyn Effect, surroundings: &GelAndRobot<'_>, piece_done: &(dyn Fn() + Sync)) -> Result<Self> {
        let model = FieldModel::build(effect, surroundings, piece_done)?;
        Ok(Self(model.map(|model| (effect.slug().to_string(), model)).into_iter().collect()))
    }

    /// Returns the models of both sets. If both have an effect, the model of `self` is kept.
    pub fn merged_with(self, other: Self) -> Self {
        let mut all = other.0;
        all.extend(self.0);
        Self(all)
    }

    /// Returns `true` if the effect with this slug has a model.
    pub fn has(&self, slug: &str) -> bool {
        self.0.contains_key(slug)
    }

    /// Largest difference of a nonlinear law's model from full-order runs at verification, relative to their amplitude. `None`
    /// for other effects.
    pub fn verification_error(&self, slug: &str) -> Option<f64> {
        match self.0.get(slug) {
            Some(FieldModel::Nonlinear(model)) => Some(model.reduced().max_relative_error),
            _ => None,
        }
    }

    /// Reduced model of the effect on the displacement field that the stages contain; `None` without such an effect.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the model was not built. [`Error::OutsideTrainedRange`] if the shape parameter is outside its
    /// trained range.
    pub fn spread(&self, stages: &Stages) -> Result<Option<ReducedField>> {
        let missing = || {
            Error::numerical("the reduced model was not built for this effect", "build it for a model with this effect")
        };
        match &stages.spatial {
            None => Ok(None),
            Some(Spatial::Large { .. } | Spatial::External(_)) => Err(missing()),
            Some(Spatial::Linear(field)) => {
                let model = self.0.get(field.effect).ok_or_else(missing)?;
                let terms = model.terms(field)?.ok_or_else(missing)?;
                Ok(Some(ReducedField::Terms { beside: field.beside.clone(), terms }))
            }
            Some(Spatial::Nonlinear(law)) => {
                let of_family = |model: &FieldModel| match model {
                    FieldModel::Nonlinear(model) if model.reduced().family == law.family() => Some(model.clone()),
                    _ => None,
                };
                let model = self.0.values().find_map(of_family).ok_or_else(missing)?;
                Ok(Some(ReducedField::Stepped(SharedStepper(Arc::new(model)))))
            }
        }
    }
}

/// Returns terms whose weights are relative to the base law's compliance. At the effect's null the terms reproduce this compliance exactly.
fn terms_of(modes: &FieldModes) -> Vec<SpreadTerm> {
    let pairs = || modes.weights.iter().zip(&modes.numbers);
    // If the effect's null is a rigid element, only terms with an eigenvalue of 0 move at the null. If its null is a vanishing element, all
    // terms move.
    let stuck: f64 = pairs().filter(|(_, number)| **number == 0.0).map(|(weight, _)| weight).sum();
    let base = if stuck > 0.0 { stuck } else { modes.weights.iter().sum() };
    let term = |(weight, number): (&f64, &f64)| SpreadTerm { weight: (weight / base).into(), number: (*number).into() };
    pairs().map(term).collect()
}

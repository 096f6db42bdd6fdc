//! Effects that make a quantity depend on a state (physics §5.3), from a user's file or learnt from data.

use std::sync::{Mutex, PoisonError};

use super::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, Stages};
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::BaseLaw;
use laws::stages::{Function, Operation, Quantity, State, StateFunction, StateLaw};
use record::CharacteristicSizes;

/// Quantity that may depend on a state, as named by the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QuantityName {
    /// Force on the robot.
    Force,
    /// Observed position of the robot.
    Position,
    /// Modulus or viscosity of an element of the law, by the name of its parameter.
    Element(&'static str),
}

impl QuantityName {
    /// Name of the quantity in files and documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::Position => "position",
            Self::Element(name) => name,
        }
    }
}

/// Effect that makes a quantity of the model depend on a state (physics §5.3).
pub struct StateEffect {
    /// Name of the effect in commands, files and parameter names.
    pub slug: &'static str,
    /// Description of the effect in a few words.
    pub summary: &'static str,
    /// Equation of the effect, as text.
    pub equation: &'static str,
    /// Quantity that depends on the state.
    pub quantity: QuantityName,
    /// State on which the quantity depends.
    pub state: State,
    /// Operation (multiply or add) by which the function changes the quantity.
    pub operation: Operation,
    /// Function of the state that changes the quantity.
    pub function: &'static dyn StateFunction,
    /// Parameters of the function.
    pub parameters: &'static [EffectParameter],
}

/// Effects defined in files, each with its definition. Users refer to them by slug, as to the program's own effects.
static DEFINED: Mutex<Vec<(&'static StateEffect, toml::Table)>> = Mutex::new(Vec::new());

/// Defines an effect, which can be used by its slug until the program ends. Equal definitions give one effect.
///
/// # Errors
/// Returns the existing definition with this slug if it differs.
pub fn define(definition: toml::Table, effect: StateEffect) -> std::result::Result<&'static StateEffect, toml::Table> {
    let mut defined = DEFINED.lock().unwrap_or_else(PoisonError::into_inner);
    match defined.iter().find(|(known, _)| known.slug == effect.slug) {
        Some((known, map)) if *map == definition => Ok(known),
        Some((_, entry)) => Err(entry.clone()),
        None => {
            // The effect is leaked, because names of effects and parameters must be static. Only few files are read, so little
            // memory is lost.
            let effect: &'static StateEffect = Box::leak(Box::new(effect));
            defined.push((effect, definition));
            Ok(effect)
        }
    }
}

/// Effect that a file defines with this slug, and its definition; `None` without such an effect.
pub fn defined(slug: &str) -> Option<(&'static StateEffect, toml::Table)> {
    let defined = DEFINED.lock().unwrap_or_else(PoisonError::into_inner);
    defined.iter().find(|(effect, _)| effect.slug == slug).cloned()
}

/// Effect from a file that has a parameter of this name, and the parameter.
pub(super) fn with_parameter(name: &str) -> Option<(&'static dyn Effect, &'static EffectParameter)> {
    let defined = DEFINED.lock().unwrap_or_else(PoisonError::into_inner);
    defined.iter().find_map(|(effect, _)| {
        let parameter = effect.parameters.iter().find(|parameter| parameter.spec.name == name)?;
        Some((*effect as &dyn Effect, parameter))
    })
}

impl Effect for StateEffect {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: self.slug,
            stage: match self.quantity {
                QuantityName::Force => Stage::Load,
                QuantityName::Position => Stage::Observation,
                QuantityName::Element(_) => Stage::Mechanics,
            },
            summary: self.summary,
            equation: self.equation,
            parameters: self.parameters,
        }
    }
    fn depends_on_position(&self) -> bool {
        self.depends_on_state() && (self.state.depends_on_motion() || self.quantity == QuantityName::Position)
    }
    fn depends_on_state(&self) -> bool {
        true
    }
    fn conflict_with_field(&self, _field: FieldEffect) -> Option<&'static str> {
        Some("a quantity that depends on a state cannot be combined with a computed displacement field")
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        let QuantityName::Element(name) = self.quantity else { return None };
        match base.leaf(name) {
            Some(_) => None,
            None if base.parameters().iter().any(|spec| spec.name == name) => Some(
                "its quantity is an order, or its element occurs twice or is nested too deeply (allowed: an element in series, or a part of a parallel body in series)",
            ),
            None => Some("the law has no parameter with the name of its quantity"),
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let quantity = match self.quantity {
            QuantityName::Force => Quantity::Force,
            QuantityName::Position => Quantity::Position,
            QuantityName::Element(name) => {
                let leaf = stages.base.and_then(|base| base.leaf(name));
                Quantity::Element(leaf.ok_or_else(|| {
                    Error::numerical(format!("the law has no element of {name}"), "name a parameter of the law")
                })?)
            }
        };
        stages.state_law = Some(StateLaw {
            quantity,
            state: self.state,
            operation: self.operation,
            function: Function(self.function),
            parameters: parameters.to_vec(),
        });
        Ok(())
    }
}

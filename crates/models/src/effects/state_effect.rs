//! Effects that let a quantity depend on a state (physics §5.3): what stands in a user's file, and what is learnt from data.

use std::sync::{Mutex, PoisonError};

use super::{Effect, EffectParameter, Field, Stage, Stages};
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::BaseLaw;
use laws::stages::{Function, Operation, Quantity, State, StateFunction, StateLaw};
use record::Scales;

/// What depends, by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QuantityName {
    /// The force on the robot.
    Force,
    /// The observed position.
    Position,
    /// A modulus or viscosity of the law, by the name of its parameter.
    Element(&'static str),
}

impl QuantityName {
    /// As files and documents have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::Position => "position",
            Self::Element(name) => name,
        }
    }
}

/// An effect by which a quantity depends on a state.
#[derive(Debug)]
pub struct StateEffect {
    /// Name.
    pub slug: &'static str,
    /// What it adds.
    pub summary: &'static str,
    /// Its equation.
    pub equation: &'static str,
    /// What depends.
    pub quantity: QuantityName,
    /// On what.
    pub state: State,
    /// How.
    pub operation: Operation,
    /// The function.
    pub function: &'static dyn StateFunction,
    /// Its parameters.
    pub parameters: &'static [EffectParameter],
}

/// Effects that files have defined, each with its definition: they may be named wherever the program's own may.
static DEFINED: Mutex<Vec<(&'static StateEffect, toml::Table)>> = Mutex::new(Vec::new());

/// Makes an effect one that may be named from now on, for as long as the program runs. The same definition twice is one effect.
///
/// # Errors
/// The definition that the name has already, where it is another.
pub fn define(definition: toml::Table, effect: StateEffect) -> std::result::Result<&'static StateEffect, toml::Table> {
    let mut defined = DEFINED.lock().unwrap_or_else(PoisonError::into_inner);
    match defined.iter().find(|(known, _)| known.slug == effect.slug) {
        Some((known, own)) if *own == definition => Ok(known),
        Some((_, own)) => Err(own.clone()),
        None => {
            // Names of effects and parameters are static everywhere, and few files are read.
            let effect: &'static StateEffect = Box::leak(Box::new(effect));
            defined.push((effect, definition));
            Ok(effect)
        }
    }
}

/// The effect of a name that a file has defined, with its definition.
pub fn defined(slug: &str) -> Option<(&'static StateEffect, toml::Table)> {
    let defined = DEFINED.lock().unwrap_or_else(PoisonError::into_inner);
    defined.iter().find(|(effect, _)| effect.slug == slug).cloned()
}

/// The defined effect that has a parameter of this name.
pub(super) fn with_parameter(name: &str) -> Option<(&'static dyn Effect, &'static EffectParameter)> {
    let defined = DEFINED.lock().unwrap_or_else(PoisonError::into_inner);
    defined.iter().find_map(|(effect, _)| {
        let parameter = effect.parameters.iter().find(|parameter| parameter.spec.name == name)?;
        Some((*effect as &dyn Effect, parameter))
    })
}

impl Effect for StateEffect {
    fn slug(&self) -> &'static str {
        self.slug
    }
    fn stage(&self) -> Stage {
        match self.quantity {
            QuantityName::Force => Stage::Load,
            QuantityName::Position => Stage::Observation,
            QuantityName::Element(_) => Stage::Mechanics,
        }
    }
    fn summary(&self) -> &'static str {
        self.summary
    }
    fn equation(&self) -> &'static str {
        self.equation
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        self.parameters
    }
    fn acts_on_position(&self) -> bool {
        self.depends_on_state() && (self.state.is_of_motion() || self.quantity == QuantityName::Position)
    }
    fn depends_on_state(&self) -> bool {
        true
    }
    fn barred_beside(&self, _field: Field) -> Option<&'static str> {
        Some("a quantity that depends on a state is not run where the displacement field is solved for")
    }
    fn conflict(&self, base: &BaseLaw) -> Option<&'static str> {
        let QuantityName::Element(name) = self.quantity else { return None };
        match base.leaf(name) {
            Some(_) => None,
            None if base.parameters().iter().any(|spec| spec.name == name) => Some(
                "its quantity is an order, or of an element that is neither in series nor a part of a body of elements in parallel, or that stands twice",
            ),
            None => Some("the law has no parameter of its quantity's name"),
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
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

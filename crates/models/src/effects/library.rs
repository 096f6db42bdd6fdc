//! Library of the program's effects and of users' effects.

use std::sync::{Mutex, PoisonError};

use super::{EFFECTS, Effect, EffectParameter, NUISANCES, state_effect};

/// Effects that users have added to any library of this run. Figures look up the labels of the effects' parameters here.
static ADDED: Mutex<Vec<&'static dyn Effect>> = Mutex::new(Vec::new());

/// Effects that models may name, in the order in which they are applied.
#[derive(Clone)]
pub struct Library(Vec<&'static dyn Effect>);

impl Default for Library {
    /// Library of the program's own effects.
    fn default() -> Self {
        Self(EFFECTS.to_vec())
    }
}

impl Library {
    /// Library of the program's effects with these slugs.
    pub fn only(slugs: &[&str]) -> Self {
        Self(EFFECTS.iter().copied().filter(|effect| slugs.contains(&effect.slug())).collect())
    }

    /// Adds effects to this library only. The new effects are applied after the present ones.
    pub fn with_all(mut self, effects: impl IntoIterator<Item = &'static dyn Effect>) -> Self {
        self.0.extend(effects);
        self
    }

    /// Adds an effect, which is applied after the present ones. [`parameter_named`] then finds its parameters.
    pub fn with(mut self, effect: &'static dyn Effect) -> Self {
        let mut added = ADDED.lock().unwrap_or_else(PoisonError::into_inner);
        if added.iter().all(|known| known.slug() != effect.slug()) {
            added.push(effect);
        }
        self.0.push(effect);
        self
    }

    /// All effects, in the order in which they are applied.
    pub fn effects(&self) -> &[&'static dyn Effect] {
        &self.0
    }

    /// Effect with this slug in the library or from a file; `None` without such an effect.
    pub fn get(&self, slug: &str) -> Option<&'static dyn Effect> {
        let entry = self.0.iter().copied().find(|effect| effect.slug() == slug);
        entry.or_else(|| state_effect::defined(slug).map(|(effect, _)| effect as &dyn Effect))
    }

    /// Returns `true` if one of these effects has a nonlinear law.
    pub fn any_nonlinear<'a>(&self, slugs: impl IntoIterator<Item = &'a str>) -> bool {
        slugs.into_iter().any(|slug| self.get(slug).is_some_and(|effect| effect.is_nonlinear()))
    }
}

/// Effect that has a parameter of this name, and the parameter. The search covers the program's effects, an experiment's nuisances, effects
/// from files, and effects that were added to any library of this run.
pub fn parameter_named(name: &str) -> Option<(&'static dyn Effect, &'static EffectParameter)> {
    if let Some(found) = state_effect::with_parameter(name) {
        return Some(found);
    }
    let added = ADDED.lock().unwrap_or_else(PoisonError::into_inner);
    EFFECTS.iter().chain(NUISANCES).chain(added.iter()).find_map(|effect| {
        let parameter = effect.parameters().iter().find(|parameter| parameter.spec.name == name)?;
        Some((*effect, parameter))
    })
}

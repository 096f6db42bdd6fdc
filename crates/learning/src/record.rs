//! Learning from one of many records: results for every pair and every formula, which the caller sums over records.

use rayon::prelude::*;

use super::distil::{as_effect, fit_with_effect};
use super::fit::fit_under;
use super::formulas::{FormulaText, formulas};
use super::pairs::{StateKind, state_range};
use super::search::{PairSearch, fitted_base, with_own_noise};
use base::error::Result;
use criticism::Subject;
use criticism::refit::Refitted;
use laws::stages::State;
use models::effects::StateEffect;
use posterior::monitor::Monitor;

/// A record to which every pair (a quantity as a function of a state) is fitted. Its cycles are scored with the noise terms of the model's
/// specification.
pub struct LearningRecord {
    found: PairSearch,
    subject: Subject,
    base: Refitted,
}

/// Gains of one pair (a quantity as a function of a state) in a record.
#[derive(Debug, Clone, PartialEq)]
pub struct PairGain {
    /// Name of the pair, equal in all records.
    pub slug: &'static str,
    /// Name of the quantity.
    pub quantity: &'static str,
    /// Name of the state.
    pub state: &'static str,
    /// Gain in ln evidence, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of unseen cycles, in nats; `None` if no cycle is held out.
    pub heldout_gain_nats: Option<f64>,
}

/// A formula that is fitted to many records.
pub struct Formula {
    /// Text and parameters of the formula.
    pub written: FormulaText,
    /// Text of the effect's file.
    pub file: String,
    effect: &'static StateEffect,
}

/// Result of testing a formula in a record from which it was not learnt.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaTest {
    /// Gain in the log score of the last cycle, which no fit has seen, in nats.
    pub last_cycle_gain_nats: f64,
    /// Errors (µm) on the held-out cycle, without the formula and with it.
    pub rmse_um: [f64; 2],
    /// Fitted values of the formula's parameters, in the order in which the formula lists them.
    pub values: Vec<f64>,
}

impl LearningRecord {
    /// Fits every pair to a record.
    ///
    /// # Errors
    /// Errors of fitting the model.
    pub fn new(subject: &Subject, is_monotone: bool, monitor: &dyn Monitor) -> Result<Self> {
        let (subject, base) = fitted_base(subject)?;
        let found = PairSearch::new(&subject, base, is_monotone, monitor)?;
        let (subject, base) = with_own_noise(&found.subject, &found.base)?;
        Ok(Self { found, subject, base })
    }

    /// Returns the gains of every pair that is a function of a state.
    pub fn pair_gains(&self) -> Vec<PairGain> {
        let of_base = self.found.base.future;
        let of = |learnt: &super::fit::PairFit| {
            let pair = &self.found.pairs[learnt.pair];
            matches!(pair.kind, StateKind::Function { .. }).then(|| PairGain {
                slug: pair.effect.slug(),
                quantity: pair.quantity,
                state: pair.state,
                evidence_nats: learnt.evidence_nats,
                heldout_gain_nats: learnt.future.zip(of_base).map(|(future_score, base)| future_score.all - base.all),
            })
        };
        self.found.learnt.iter().filter_map(of).collect()
    }

    /// Finds the pair with the name `slug` (a quantity as a function of a state). Returns its state and the range of this state in the record,
    /// extended to include 0. Returns `None` if there is no such pair, or if the pair is a memory (a spectrum of retardation times).
    pub fn range(&self, slug: &str) -> Option<(State, [f64; 2])> {
        let pair = self.found.pairs.iter().find(|pair| pair.effect.slug() == slug)?;
        let StateKind::Function { state, visited, .. } = &pair.kind else { return None };
        Some((*state, state_range(visited)))
    }

    /// Returns the gain (nats) of a pair's function in the log score of unseen cycles, with the noise terms of the model's specification.
    pub fn function_gain_nats(&self, slug: &str) -> Option<f64> {
        let learnt = self.found.learnt.iter().find(|pair_fit| self.found.pairs[pair_fit.pair].effect.slug() == slug)?;
        let (_, future) = fit_under(&self.subject, learnt)?;
        Some(future.all - self.base.future?.all)
    }

    /// Returns the formulas that may replace the function of the pair `slug` over the range `range` of its state.
    pub fn formulas(&self, slug: &str, state: State, range: [f64; 2]) -> Vec<Formula> {
        let Some(pair) = self.found.pairs.iter().find(|pair| pair.effect.slug() == slug) else { return Vec::new() };
        let of = |written: FormulaText| {
            let (file, effect) = as_effect(&written, pair)?;
            Some(Formula { written, file, effect })
        };
        formulas(state, range).into_iter().filter_map(of).collect()
    }

    /// Returns the gains (nats) of formulas in the log score of unseen cycles; `None` for a formula without a fit.
    pub fn gains_nats(&self, formulas: &[Formula]) -> Vec<Option<f64>> {
        let gain = |formula: &Formula| {
            let (_, refitted) = fit_with_effect(&self.subject, &self.base, formula.effect)?;
            Some(refitted.future?.all - self.base.future?.all)
        };
        formulas.par_iter().map(gain).collect()
    }
}

/// Tests a formula in a record from which it was not learnt; `None` if it has no fit or no cycle is held out.
///
/// # Errors
/// Errors of fitting the model.
pub fn test_formula(subject: &Subject, formula: &Formula) -> Result<Option<FormulaTest>> {
    let (subject, base) = fitted_base(subject)?;
    let (subject, base) = with_own_noise(&subject, &base)?;
    let Some((entry, refitted)) = fit_with_effect(&subject, &base, formula.effect) else { return Ok(None) };
    let Some((after, before)) = refitted.future.zip(base.future) else { return Ok(None) };
    let rmse = |model: &Refitted| model.fitted.rmse_m(&entry.scored_m).map(|rmse| 1e6 * rmse);
    let Some((rmse_before, rmse_after)) = rmse(&base).zip(rmse(&refitted)) else { return Ok(None) };
    let all = refitted.candidate.parameters(&refitted.fitted.theta);
    let value = |name: &str| {
        let is_it = |spec: &&base::parameter::ParameterSpec| spec.name.rsplit('.').next() == Some(name);
        let parameter_spec = formula.effect.parameters.iter().map(|parameter| &parameter.spec).find(is_it)?;
        let place = refitted.candidate.model.parameters().iter().position(|spec| spec.name == parameter_spec.name)?;
        Some(all[place])
    };
    let values = formula.written.parameters.iter().map(|parameter| value(parameter.name).unwrap_or(f64::NAN)).collect();
    Ok(Some(FormulaTest { last_cycle_gain_nats: after.last - before.last, rmse_um: [rmse_before, rmse_after], values }))
}

//! Steps of the command `learn`: fits every pair of a quantity and a state, judges the leading pair, tabulates its function and replaces it by a formula.

use super::distil::FittedFormula;
use super::drawn::tabulate_function;
use super::fit::PairFit;
use super::function::Function;
use super::pairs::StateKind;
use super::search::{EQUAL_NATS, PairSearch, Request, fitted_base};
use super::words::{describe_pair, is_rising};
use base::error::Result;
use criticism::Subject;
use criticism::own_errors::own_errors;
use criticism::refit::Refitted;
use criticism::residual_structure::measure_misfit;
use documents::errors::ModelErrors;
use documents::learned::{EquivalentPair, Learned, LearnedKind, LearnedPair, LearnedVerdict, Retardation};
use posterior::monitor::Monitor;
use record::Control;

/// Result of learning, with the file of the formula.
pub struct LearningResult {
    /// Document of the learning.
    pub learned: Learned,
    /// Text of the effect's file; `None` if there is no formula.
    pub file: Option<String>,
}

/// Learns a function of a state, or a memory, from a record.
///
/// # Errors
/// Errors of fitting the base model.
pub fn learn(subject: &Subject, request: &Request, monitor: &dyn Monitor) -> Result<LearningResult> {
    monitor.stage("fitting the model");
    let whole = subject;
    let (subject, base) = fitted_base(whole)?;
    let found = PairSearch::new(&subject, base, request.is_monotone, monitor)?;
    let base_errors = request.base_errors.map_or_else(|| own_errors(whole, &found.base), Ok)?;
    monitor.stage("simulating searches without anything to learn");
    let p = found.p(request, monitor)?;
    let chosen = match found.choose_pair(p) {
        Ok(chosen) => chosen,
        Err(why) => return found.nothing(base_errors, p, &why),
    };
    monitor.stage("comparing with the library");
    let preferred = found.find_preferred_effects(chosen, monitor);
    monitor.stage("writing the function as a formula");
    let (chosen, distilled) = found.write_formula(chosen);
    monitor.stage("averaging the function over priors");
    let function = Function::averaged(&found.subject, chosen, &found.pairs[chosen.pair])?;
    let errors = Errors { whole, base: base_errors };
    found.learned(chosen, distilled, function.as_ref(), (p, preferred), &errors)
}

/// Returns a sentence on the quantity and the state that `learn` would choose for a model's residual; `None` if no pair helps. `subject` has no outliers. No simulated searches
/// confirm the choice.
///
/// # Errors
/// Errors of [`learn`].
pub fn preview_learning(subject: &Subject, base: &Refitted, monitor: &dyn Monitor) -> Result<Option<String>> {
    let found = PairSearch::new(subject, base.clone(), false, monitor)?;
    let Ok(chosen) = found.choose_pair(0.0) else { return Ok(None) };
    let pair = &found.pairs[chosen.pair];
    let Some(share) = found.explained(&chosen.fitted).filter(|share| *share > 0.0) else { return Ok(None) };
    let function = Function::of_search(&found.subject, chosen, pair)?;
    let rises = function
        .and_then(|function| tabulate_function(&found.subject, &function, pair))
        .map(|learned_function| is_rising(&learned_function));
    Ok(Some(format!(
        "{} explains {:.0} % of the residual; `vitreo-uq learn STUDY` writes it as a formula",
        describe_pair(pair, rises),
        100.0 * share
    )))
}

/// Data for the document's errors: the record on which models are judged, and the known errors of the base model.
struct Errors<'a> {
    /// The record with its outliers.
    whole: &'a Subject,
    /// Errors of the base model, which lacks the learnt dependence.
    base: ModelErrors,
}

impl PairSearch {
    fn document(&self, base: ModelErrors, p: f64, verdict: LearnedVerdict) -> Learned {
        let experiment = self.subject.experiment();
        let of_base = self.base.future;
        let entry = |learnt: &PairFit| {
            let pair = &self.pairs[learnt.pair];
            let future = learnt.future.zip(of_base);
            LearnedPair {
                quantity: pair.quantity.into(),
                state: pair.state.into(),
                evidence_nats: learnt.evidence_nats,
                heldout_gain_nats: future.map(|(future_score, base)| future_score.all - base.all),
                last_cycle_gain_nats: future.map(|(future_score, base)| future_score.last - base.last),
                rmse_heldout_um: learnt.fitted.rmse_m(&self.subject.scored_m).map(|rmse_m| 1e6 * rmse_m),
            }
        };
        Learned {
            experiment: experiment.specimen_id.clone(),
            verdict,
            fitted_cycles: experiment.calibration_cycles.clone(),
            heldout_cycles: experiment.heldout_cycles.clone(),
            monotone: self.is_monotone,
            function: None,
            formula: None,
            memory: Vec::new(),
            base,
            learned: None,
            with_formula: None,
            noise_um: self.subject.noise_um(),
            p_familywise: p,
            explained_fraction: None,
            pairs: self.learnt.iter().map(entry).collect(),
        }
    }

    fn nothing(&self, base: ModelErrors, p: f64, why: &str) -> Result<LearningResult> {
        let mut sentence = format!(
            "Nothing was learnt: no dependence of a quantity on a state explains more than the model does ({why})."
        );
        if self.subject.experiment().control == Control::Position {
            sentence += " Only a free memory was tried: functions of a state need a commanded force, and this record commands a position.";
        }
        if measure_misfit(&self.subject, &self.base, &[])?.is_too_large() {
            sentence += " The model's residual exceeds the noise: `vitreo-uq diagnose` shows whether an effect of the library explains it.";
        }
        let verdict = LearnedVerdict {
            kind: LearnedKind::Nothing,
            quantity: String::new(),
            state: String::new(),
            equivalent: Vec::new(),
            library: Vec::new(),
            sentence,
        };
        Ok(LearningResult { learned: self.document(base, p, verdict), file: None })
    }

    fn learned(
        &self,
        chosen: &PairFit,
        distilled: Option<FittedFormula>,
        function: Option<&Function>,
        (p, library): (f64, Vec<String>),
        errors: &Errors,
    ) -> Result<LearningResult> {
        let pair = &self.pairs[chosen.pair];
        let (candidate, fitted) = function.map_or((&chosen.candidate, &chosen.fitted), Function::best);
        let model = Refitted { candidate: candidate.clone(), fitted: fitted.clone(), future: chosen.future };
        let drawn = function.and_then(|function| tabulate_function(&self.subject, function, pair));
        let formula =
            distilled.as_ref().zip(drawn.as_ref()).map(|(fitted_formula, drawn)| fitted_formula.document(drawn));
        let is_equal =
            |other: &&PairFit| self.is_another(other, pair) && other.evidence_nats >= chosen.evidence_nats - EQUAL_NATS;
        let equal = self.learnt.iter().filter(is_equal).map(|other| {
            let pair = &self.pairs[other.pair];
            EquivalentPair { quantity: pair.quantity.into(), state: pair.state.into() }
        });
        let equivalent: Vec<EquivalentPair> = equal.collect();
        let after = own_errors(errors.whole, &model)?;
        let with_formula =
            distilled.as_ref().map(|fitted_formula| own_errors(errors.whole, &fitted_formula.refitted)).transpose()?;
        let mut sentence = self.gain_in_words(pair, errors.base, after, drawn.as_ref());
        sentence += &self.formula_in_words(pair, with_formula, formula.as_ref().zip(drawn.as_ref()));
        sentence += &self.limits_in_words(chosen, &model, &library)?;
        let verdict = LearnedVerdict {
            kind: LearnedKind::Learned,
            quantity: pair.quantity.into(),
            state: pair.state.into(),
            equivalent,
            library,
            sentence,
        };
        let mut learned = self.document(errors.base, p, verdict);
        learned.learned = Some(after);
        learned.explained_fraction = self.explained(&model.fitted);
        learned.function = drawn;
        if let StateKind::Memory(creep) = &pair.kind {
            let shares = chosen.candidate.parameters(&chosen.fitted.theta);
            let first = shares.len() - creep.times_s.len();
            let all = creep.times_s.iter().zip(&shares[first..]);
            learned.memory = all.map(|(time_s, share)| Retardation { time_s: *time_s, share: *share }).collect();
        }
        learned.with_formula = with_formula;
        learned.formula = formula;
        Ok(LearningResult { learned, file: distilled.map(|fitted_formula| fitted_formula.file) })
    }
}

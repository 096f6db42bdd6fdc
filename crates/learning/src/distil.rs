//! Search for a formula that replaces a learnt function, chosen by its prediction of unseen cycles.

use rayon::prelude::*;

use super::formulas::{FormulaText, Parameter, formulas};
use super::pairs::{Pair, StateKind, state_range};
use base::number::Dual;
use criticism::refit::Refitted;
use criticism::{Search, Subject, Tangent};
use documents::learned::{FormulaParameter, LearnedFormula, LearnedFunction};
use models::effects::{Effect, StateEffect};
use posterior::study::effect_file;

/// Penalty of each parameter of a formula beyond the first, in nats of the log score of unseen cycles.
const NATS_PER_PARAMETER: f64 = 1.0;
/// Name of the file that a formula is written to.
pub const FILE_NAME: &str = "learned-effect.toml";

/// A formula with its fit.
pub struct FittedFormula {
    /// Text of the formula, as in its file.
    pub text: String,
    /// Fitted parameters of the formula.
    pub parameters: Vec<FormulaParameter>,
    /// The base model with the formula as an effect, at its fit.
    pub refitted: Refitted,
    /// Log score of unseen cycles, in nats, less the penalty of the parameters.
    pub score: f64,
    /// Text of the effect's file.
    pub file: String,
    effect: &'static StateEffect,
}

impl FittedFormula {
    /// Returns the formula's entry of the document. Its factors are at the tabulated states of `function`, relative to the reference state of `function`.
    pub fn document(&self, function: &LearnedFunction) -> LearnedFormula {
        let states: Vec<f64> = function.points.iter().map(|point| point.state).collect();
        LearnedFormula {
            text: self.text.clone(),
            parameters: self.parameters.clone(),
            file: FILE_NAME.into(),
            factors: factors(&self.refitted, self.effect, &states, function.reference_state),
        }
    }
}

/// Finds the formula with the fewest parameters, at most `most_parameters`, that predicts unseen cycles with a log score of at least `least_score` nats. Of several such
/// formulas, the best predictor wins. Returns `None` if no formula reaches the score.
pub fn find_simplest_formula(
    subject: &Subject,
    base: &Refitted,
    pair: &Pair,
    (least_score, most_parameters): (f64, usize),
) -> Option<FittedFormula> {
    let StateKind::Function { state, visited, .. } = &pair.kind else { return None };
    let [low, high] = state_range(visited);
    let mut written = formulas(*state, [low, high]);
    written.retain(|written| written.parameters.len() <= most_parameters);
    let fitted = |written: &FormulaText| {
        let (text, effect) = as_effect(written, pair)?;
        let (entry, refitted) = fit_with_effect(subject, base, effect)?;
        Some((text, entry, refitted, effect))
    };
    let all: Vec<_> = written.par_iter().map(|written| (written, fitted(written))).collect();
    let score = |refitted: &Refitted| -> f64 {
        let n = refitted.candidate.free.len() - base.candidate.free.len();
        let future = refitted.future.map_or(refitted.fitted.objective, |future| future.all);
        future - NATS_PER_PARAMETER * n.saturating_sub(1) as f64
    };
    let found = all.into_iter().filter_map(|(written, fitted)| Some((written, fitted?)));
    let mut found: Vec<_> = found.filter(|(_, (_, _, refitted, _))| score(refitted) >= least_score).collect();
    found.sort_by(|(formula_text, (_, _, a, _)), (other, (_, _, b, _))| {
        formula_text.parameters.len().cmp(&other.parameters.len()).then(score(b).total_cmp(&score(a)))
    });
    // A formula whose parameters the data do not determine is rejected.
    let (written, file, refitted, effect, formula_parameters) =
        found.into_iter().find_map(|(written, (file, subject, refitted, effect))| {
            let item = parameters(&subject, &refitted, written, effect)?;
            let in_order = written
                .parameters
                .iter()
                .filter_map(|p| Some((p, item.iter().find(|formula_parameter| formula_parameter.name == p.name)?)));
            let is_told = |(parameter, formula_parameter): (&Parameter, &FormulaParameter)| {
                !parameter.has_null || formula_parameter.q05 > 0.0 || formula_parameter.q95 < 0.0
            };
            let are_told = in_order.into_iter().all(is_told);
            are_told.then_some((written, file, refitted, effect, item))
        })?;
    Some(FittedFormula {
        text: written.text.clone(),
        parameters: formula_parameters,
        score: score(&refitted),
        refitted,
        file,
        effect,
    })
}

/// Makes an effect of a formula for a pair (quantity and state). Returns the text of its file and the effect; `None` if the text is not valid.
pub fn as_effect(written: &FormulaText, pair: &Pair) -> Option<(String, &'static StateEffect)> {
    let slug = format!("learned-{}-by-{}", pair.quantity, pair.state).replace('_', "-");
    let summary = format!("{} depends on {}", pair.quantity, pair.state.replace('_', " "));
    let text = written.file(&slug, pair.quantity, pair.state, &summary);
    // Effects live until the program ends; a command makes only some dozens of formulas.
    let effect: &'static StateEffect = Box::leak(Box::new(effect_file::parsed(FILE_NAME.as_ref(), &text).ok()?));
    Some((text, effect))
}

/// Fits a base model with one more effect, and returns the model with its subject; `None` if the experiment cannot have the effect.
pub fn fit_with_effect(
    subject: &Subject,
    base: &Refitted,
    effect: &'static StateEffect,
) -> Option<(Subject, Refitted)> {
    let entry = with_effect(subject, effect)?;
    let candidate = entry.extended(&[effect.slug]).ok()?;
    let refitted = Refitted::new(&entry, candidate, &[base], Search::Local).ok()?;
    Some((entry, refitted))
}

/// Values and intervals of a formula's parameters, from a normal approximation in the coordinates of the search.
fn parameters(
    subject: &Subject,
    refitted: &Refitted,
    written: &FormulaText,
    effect: &StateEffect,
) -> Option<Vec<FormulaParameter>> {
    let tangent = Tangent::new(subject, &refitted.candidate, &refitted.fitted).ok()?;
    let sds = tangent.standard_deviations();
    let of = |spec: &base::parameter::ParameterSpec| {
        let name = spec.name.rsplit('.').next().unwrap_or(spec.name);
        let place = refitted.candidate.free.iter().position(|free| free.name == spec.name)?;
        let (free, theta) = (&refitted.candidate.free[place], refitted.fitted.theta[place]);
        let at = |z: f64| free.coordinate.value(free.clamped(theta + z * sds[place].min(1e6)));
        let unit = written.parameters.iter().find(|parameter| parameter.name == name)?.unit.clone();
        Some(FormulaParameter { name: name.into(), unit, value: at(0.0), q05: at(-NORMAL_90), q95: at(NORMAL_90) })
    };
    effect.parameters.iter().map(|parameter| of(&parameter.spec)).collect()
}

/// Half width of a 90 % interval, in standard deviations.
pub const NORMAL_90: f64 = 1.645;

/// Factors of a fitted formula at given states, relative to its factor at a reference state.
fn factors(refitted: &Refitted, effect: &StateEffect, states: &[f64], reference: f64) -> Vec<f64> {
    let all = refitted.candidate.parameters(&refitted.fitted.theta);
    let named = refitted.candidate.model.parameters();
    let value = |name: &str| named.iter().position(|spec| spec.name == name).map_or(f64::NAN, |place| all[place]);
    let duals: Vec<Dual> = effect.parameters.iter().map(|p| Dual::constant(value(p.spec.name))).collect();
    let at = |state: f64| effect.function.value(Dual::constant(state), &duals).value;
    states.iter().map(|state| at(*state) / at(reference)).collect()
}

/// Returns the subject with one more effect in its library; `None` if the experiment cannot have the effect.
pub fn with_effect(subject: &Subject, effect: &'static StateEffect) -> Option<Subject> {
    let library = subject.library().clone().with_all([effect as &dyn Effect]);
    subject.with_library(&library).ok()
}

//! Sentences of the document on a learnt function.

use super::drawn::{is_outside_band, share_beyond};
use super::fit::PairFit;
use super::pairs::{Pair, StateKind};
use super::search::{EQUAL_NATS, PairSearch};
use base::error::Result;
use criticism::refit::Refitted;
use criticism::residual_structure::measure_misfit;
use documents::errors::ModelErrors;
use documents::learned::{LearnedFormula, LearnedFunction, LearnedPoint};
use figures::number::format_significant;

/// Fraction of held-out rows whose state lies beyond the fitted states, above which the verdict mentions them.
const MOST_BEYOND: f64 = 0.1;

impl PairSearch {
    /// Sentence on the learnt dependence and its gain.
    pub fn gain_in_words(
        &self,
        pair: &Pair,
        before: ModelErrors,
        after: ModelErrors,
        drawn: Option<&LearnedFunction>,
    ) -> String {
        let error = |model_errors: ModelErrors| model_errors.rmse_heldout_um.unwrap_or(model_errors.rmse_fitted_um);
        let cycle = if after.rmse_heldout_um.is_some() { "last held-out cycle" } else { "fitted cycles" };
        let words = describe_pair(pair, drawn.map(is_rising));
        let first = words.chars().next().map_or(String::new(), |c| c.to_uppercase().to_string());
        format!(
            "{first}{} changes the error on the {cycle} from {} to {} µm (noise {}).",
            words.chars().skip(1).collect::<String>(),
            format_significant(error(before), 3),
            format_significant(error(after), 3),
            self.subject
                .noise_um()
                .map_or("unknown".into(), |noise_um| format!("{} µm", format_significant(noise_um, 3)))
        )
    }

    pub fn formula_in_words(
        &self,
        pair: &Pair,
        with_formula: Option<ModelErrors>,
        written: Option<(&LearnedFormula, &LearnedFunction)>,
    ) -> String {
        let mut sentence = String::new();
        match with_formula.zip(written) {
            Some((errors, (formula, drawn))) => {
                let left = errors.rmse_heldout_um.unwrap_or(errors.rmse_fitted_um);
                sentence +=
                    &format!(" As a formula: {}, {} µm.", formula.product(pair.quantity), format_significant(left, 3));
                if is_outside_band(&formula.factors, &drawn.points) {
                    sentence += " The formula lies outside the function's band: it is fitted with the noise of the study's model, but the function with every kind of noise.";
                }
            }
            None if matches!(pair.kind, StateKind::Function { .. }) => {
                sentence += " No short formula predicts unseen cycles as well.";
            }
            None => {}
        }
        if let StateKind::Function { visited, .. } = &pair.kind {
            let beyond = share_beyond(&self.subject, visited);
            if beyond > MOST_BEYOND {
                sentence += &format!(
                    " In {:.0} % of the held-out rows the {} lies outside the range of the fitted rows: there the prediction is an extrapolation.",
                    100.0 * beyond,
                    pair.state.replace('_', " ")
                );
            }
        }
        sentence
    }

    /// Sentences on alternatives to the learnt pair and on the remaining residual.
    pub fn limits_in_words(&self, chosen: &PairFit, model: &Refitted, library: &[String]) -> Result<String> {
        let mut sentence = String::new();
        if !library.is_empty() {
            sentence += &format!(" The library's {} predicts as well and is preferable.", quoted(library));
        }
        let pair = &self.pairs[chosen.pair];
        let is_near = |other: &&PairFit| {
            self.is_another(other, pair) && (other.evidence_nats - chosen.evidence_nats).abs() <= EQUAL_NATS
        };
        let named = |other: &PairFit| {
            let pair = &self.pairs[other.pair];
            format!("{} by {}", pair.quantity, pair.state.replace('_', " "))
        };
        let leading = &self.learnt[0];
        let ahead_nats = leading.evidence_nats - chosen.evidence_nats;
        if ahead_nats > EQUAL_NATS {
            sentence += &format!(
                " Evidence alone prefers {} by {ahead_nats:.0} nats, but none of its formulas of equal length predicts better.",
                named(leading)
            );
        }
        let near: Vec<String> = self.learnt.iter().filter(is_near).map(named).collect();
        if !near.is_empty() {
            sentence += &format!(" This experiment cannot distinguish it from {}.", near.join(", "));
        }
        if measure_misfit(&self.subject, model, &[])?.is_too_large() {
            sentence += " Its residual still exceeds the noise.";
        }
        Ok(sentence)
    }
}

/// Phrase for the quantity that a learnt function multiplies.
pub fn quantity_words(quantity: &str) -> String {
    match quantity {
        "force" => "the force".into(),
        "position" => "the scale of the observed position".into(),
        name => format!("`{name}`"),
    }
}

/// Phrase for a pair; `rises` is the direction of its dependence, if known.
pub fn describe_pair(pair: &Pair, rises: Option<bool>) -> String {
    if pair.quantity == "creep" {
        return "a memory with additional retardation times".into();
    }
    let quantity = quantity_words(pair.quantity);
    let way = match rises {
        Some(true) => "rising",
        Some(false) => "falling",
        None => "changing",
    };
    format!("{quantity} {way} with the {}", pair.state.replace('_', " "))
}

/// Returns whether the factor at the state farthest from 0 is larger than at the state nearest to 0.
pub fn is_rising(function: &LearnedFunction) -> bool {
    let by_size = |a: &&LearnedPoint, b: &&LearnedPoint| a.state.abs().total_cmp(&b.state.abs());
    let [near, far] = [function.points.iter().min_by(by_size), function.points.iter().max_by(by_size)];
    near.zip(far).is_some_and(|(near, far)| far.factor > near.factor)
}

fn quoted(slugs: &[String]) -> String {
    slugs.iter().map(|slug| format!("`{slug}`")).collect::<Vec<_>>().join(" or ")
}

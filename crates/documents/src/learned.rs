//! Document of `learn` (formats §5, `vitreo-uq/learned/1`).

use serde::{Deserialize, Serialize};

use super::errors::ModelErrors;

/// Result of `learn`: body of the JSON document `vitreo-uq/learned/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Learned {
    /// Specimen identifier.
    pub experiment: String,
    /// Verdict of the search for a dependence of one quantity on a state.
    pub verdict: LearnedVerdict,
    /// Cycles that every model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored cycle, which is the last held-out one; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// True if the user requested monotone functions only.
    #[serde(default)]
    pub monotone: bool,
    /// The learnt function; `None` if nothing was learnt, or retardations were learnt instead.
    pub function: Option<LearnedFunction>,
    /// Formula that replaces the learnt function; `None` if no formula predicts as well.
    pub formula: Option<LearnedFormula>,
    /// Learnt retardations, which extend the law's creep compliance; empty if a function was learnt instead.
    pub memory: Vec<Retardation>,
    /// Errors of the posterior of the model without the learnt part, as in `extend` and `ladder`.
    pub base: ModelErrors,
    /// Errors of the best fit with the learnt part and the study's own noise terms; `None` if nothing was learnt.
    pub learned: Option<ModelErrors>,
    /// Errors of the best fit with the formula and the study's own noise terms; `None` without a formula.
    pub with_formula: Option<ModelErrors>,
    /// Noise standard deviation, known or estimated, that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Probability that chance alone gives as large a gain as the best pair's, corrected for the whole search.
    pub p_familywise: f64,
    /// Explained share of the squared error in excess of the noise, on the last held-out cycle; on the fitted cycles if none is held out.
    pub explained_fraction: Option<f64>,
    /// Every pair of quantity and state that the search has tried, best first.
    pub pairs: Vec<LearnedPair>,
}

/// Verdict of the search for a dependence of one quantity on a state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedVerdict {
    /// Kind of verdict: learnt or not.
    pub kind: LearnedKind,
    /// Quantity that depends on the state, such as a parameter of the law; empty if nothing was learnt.
    pub quantity: String,
    /// State on which the quantity depends, such as the position; empty if nothing was learnt.
    pub state: String,
    /// Pairs of quantity and state that this experiment cannot distinguish from the verdict's pair.
    pub equivalent: Vec<EquivalentPair>,
    /// Effects of the library that fit as well as the learnt function, and are therefore preferred to it.
    pub library: Vec<String>,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of verdicts of the search for a dependence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LearnedKind {
    /// A dependence of a quantity on a state was learnt.
    Learned,
    /// Nothing was learnt.
    Nothing,
}

/// A pair of a quantity and a state that it may depend on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentPair {
    /// Quantity that depends on the state, such as a parameter of the law.
    pub quantity: String,
    /// State on which the quantity depends, such as the position.
    pub state: String,
}

/// A learnt function of a state: the factor by which a quantity changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedFunction {
    /// Unit of the state.
    pub state_unit: String,
    /// Lowest and highest value of the state in the fitted rows.
    pub visited: [f64; 2],
    /// Value of the state at which the factor is 1. Of the states in the fitted rows, the function is best known there.
    pub reference_state: f64,
    /// Posterior of the quantity at the reference state; absent if the quantity is no parameter of the law.
    pub at_reference: Option<QuantityAtReference>,
    /// Points of the function.
    pub points: Vec<LearnedPoint>,
}

/// Posterior of the dependent quantity at the reference state, in the unit of its parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct QuantityAtReference {
    /// Posterior median of the quantity.
    pub value: f64,
    /// 5 % quantile of the quantity's posterior.
    pub q05: f64,
    /// 95 % quantile of the quantity's posterior.
    pub q95: f64,
}

/// A point of the learnt function: a state and the factor of the quantity there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedPoint {
    /// Value of the state.
    pub state: f64,
    /// Ratio of the quantity to its value at the reference state.
    pub factor: f64,
    /// 5 % quantile of the factor.
    pub q05: f64,
    /// 95 % quantile of the factor.
    pub q95: f64,
}

/// A learnt formula, which replaces the learnt function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedFormula {
    /// Formula for the factor, in terms of the state and the formula's parameters.
    pub text: String,
    /// Parameters of the formula.
    pub parameters: Vec<FormulaParameter>,
    /// Name of the formula's file beside this document. `extend --with` reads it.
    pub file: String,
    /// Factors by the formula at the states of the learnt function's points, relative to the reference state.
    pub factors: Vec<f64>,
}

impl LearnedFormula {
    /// Text of the quantity multiplied by the formula, with parentheses only around sums.
    pub fn product(&self, quantity: &str) -> String {
        let mut depth = 0;
        let is_sum = self.text.chars().any(|c| {
            depth += match c {
                '(' => 1,
                ')' => -1,
                _ => 0,
            };
            depth == 0 && (c == '+' || c == '-')
        });
        if is_sum { format!("{quantity} × ({})", self.text) } else { format!("{quantity} × {}", self.text) }
    }
}

/// A parameter of a formula.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct FormulaParameter {
    /// Name of the parameter in the formula.
    pub name: String,
    /// Unit of the parameter.
    pub unit: String,
    /// Fitted value of the parameter.
    pub value: f64,
    /// 5 % quantile of the parameter's posterior.
    pub q05: f64,
    /// 95 % quantile of the parameter's posterior.
    pub q95: f64,
}

/// A retardation that is added to the law.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Retardation {
    /// Retardation time, in s.
    pub time_s: f64,
    /// Compliance of this retardation divided by the law's compliance after one hold.
    pub share: f64,
}

/// Result of the search for one pair of a quantity and a state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedPair {
    /// Quantity that depends on the state, such as a parameter of the law.
    pub quantity: String,
    /// State on which the quantity depends, such as the position.
    pub state: String,
    /// Gain in log evidence over the model without the dependence, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of later cycles, each predicted from the cycles before it, in nats; `None` if no cycle is held out.
    pub heldout_gain_nats: Option<f64>,
    /// Part of the gain in log score that comes from the last cycle, in nats; `None` if no cycle is held out.
    pub last_cycle_gain_nats: Option<f64>,
    /// Root mean square residual of the last held-out cycle, in µm, from a fit with all noise terms; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::LearnedFormula;

    #[test]
    fn sums_have_parentheses() {
        let product = |text: &str| {
            let formula =
                LearnedFormula { text: text.into(), parameters: Vec::new(), file: String::new(), factors: Vec::new() };
            formula.product("force")
        };
        assert_eq!(product("1 + rate*time"), "force × (1 + rate*time)");
        assert_eq!(product("exp(rate*(time - limit))"), "force × exp(rate*(time - limit))");
        assert_eq!(product("(1 + abs(position)/scale)^power"), "force × (1 + abs(position)/scale)^power");
    }
}

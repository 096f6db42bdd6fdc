//! Document of `learn` (formats §5, `vitreo-uq/learned/1`).

use serde::{Deserialize, Serialize};

use super::errors::ModelErrors;

/// Body of `vitreo-uq/learned/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Learned {
    /// Specimen identifier.
    pub experiment: String,
    /// Verdict of the search.
    pub verdict: LearnedVerdict,
    /// Cycles that every model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored held-out cycle; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// True if functions had to be monotone.
    #[serde(default)]
    pub monotone: bool,
    /// The learnt function; `None` if nothing was learnt, or retardations were learnt instead.
    pub function: Option<LearnedFunction>,
    /// Formula that reproduces the function; `None` if no formula does.
    pub formula: Option<LearnedFormula>,
    /// Learnt retardations; empty if a function was learnt instead.
    pub memory: Vec<Retardation>,
    /// Errors of the model without the learnt part. They come from its posterior, as in `extend` and `ladder`, where the last cycle is scored.
    pub base: ModelErrors,
    /// Errors with the learnt part, for the best fit with the study's own noise terms; `None` if nothing was learnt.
    pub learned: Option<ModelErrors>,
    /// Errors with the formula, for the best fit with the study's own noise terms; `None` without a formula.
    pub with_formula: Option<ModelErrors>,
    /// Known or estimated noise that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// p of the best pair's gain, corrected for the whole search.
    pub p_familywise: f64,
    /// Explained share of the squared error above the noise, on the held-out cycle; on the fitted cycles if none is held out.
    pub explained_fraction: Option<f64>,
    /// Every pair that was tried, best first.
    pub pairs: Vec<LearnedPair>,
}

/// Verdict of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedVerdict {
    /// Kind of verdict.
    pub kind: LearnedKind,
    /// The dependent quantity; empty if nothing was learnt.
    pub quantity: String,
    /// The state on which the quantity depends; empty if nothing was learnt.
    pub state: String,
    /// Pairs that this experiment cannot distinguish from this one.
    pub equivalent: Vec<EquivalentPair>,
    /// Effects of the library that fit equally well and are preferable.
    pub library: Vec<String>,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LearnedKind {
    /// A dependence was learnt.
    Learned,
    /// Nothing was learnt.
    Nothing,
}

/// A pair of a quantity and a state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentPair {
    /// The dependent quantity.
    pub quantity: String,
    /// The state on which the quantity depends.
    pub state: String,
}

/// A learnt function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedFunction {
    /// Unit of the state.
    pub state_unit: String,
    /// Lowest and highest state in the fitted rows.
    pub visited: [f64; 2],
    /// State at which the factors are 1. It is the state of the fitted rows at which the function is best known.
    pub reference_state: f64,
    /// The quantity at the reference state; absent if it is no parameter of the law.
    pub at_reference: Option<QuantityAtReference>,
    /// Points of the function.
    pub points: Vec<LearnedPoint>,
}

/// The dependent quantity at the reference state, in its parameter's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct QuantityAtReference {
    /// Median.
    pub value: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A point of the function: ratio of the quantity to its value at the reference state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedPoint {
    /// State.
    pub state: f64,
    /// Ratio of the quantity to its value at the reference state.
    pub factor: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A learnt formula.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedFormula {
    /// Formula in the state and the parameters.
    pub text: String,
    /// Parameters of the formula.
    pub parameters: Vec<FormulaParameter>,
    /// File beside this document that `extend --with` reads.
    pub file: String,
    /// Factors at the states of the function's points, relative to the reference state.
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
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Fitted value.
    pub value: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
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

/// Result for one pair of quantity and state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedPair {
    /// The dependent quantity.
    pub quantity: String,
    /// The state on which the quantity depends.
    pub state: String,
    /// Gain in ln evidence over the model without the dependence.
    pub evidence_nats: f64,
    /// Gain in the log score of cycles, each predicted from the cycles before it.
    pub heldout_gain_nats: Option<f64>,
    /// Part of the log score gain that comes from the last cycle.
    pub last_cycle_gain_nats: Option<f64>,
    /// Error of the search on the scored cycle, in µm, from a fit with every kind of noise.
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

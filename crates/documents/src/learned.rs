//! The document of `learn` (formats §5, `vitreo-uq/learned/1`).

use serde::{Deserialize, Serialize};

use super::errors::ModelErrors;

/// Body of `vitreo-uq/learned/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Learned {
    /// Specimen identifier.
    pub experiment: String,
    /// What is concluded.
    pub verdict: LearnedVerdict,
    /// Cycles that every model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The cycle that was scored, if there is one.
    pub heldout_cycles: Vec<u32>,
    /// Whether functions were to rise or fall throughout.
    #[serde(default)]
    pub monotone: bool,
    /// The function; `None` where nothing was learnt, or a memory.
    pub function: Option<LearnedFunction>,
    /// The formula that says the same; `None` where none does.
    pub formula: Option<LearnedFormula>,
    /// The retardations that were learnt; empty where a function was.
    pub memory: Vec<Retardation>,
    /// Errors of the model without it: of its posterior, as `extend` and `ladder` show them, where the last cycle is scored.
    pub base: ModelErrors,
    /// Errors with it, of the best fit with the study's own noise terms; `None` where nothing was learnt.
    pub learned: Option<ModelErrors>,
    /// Errors with the formula, likewise; `None` where there is none.
    pub with_formula: Option<ModelErrors>,
    /// The noise that errors are measured against, known or estimated, in µm; `None` where it is unknown.
    pub noise_um: Option<f64>,
    /// p of the leading pair's gain, corrected for the whole search.
    pub p_familywise: f64,
    /// Share of the squared error on the held-out cycle that goes, the noise's taken off; of the fitted ones where none is held out.
    pub explained_fraction: Option<f64>,
    /// Every pair that was looked at, best first.
    pub pairs: Vec<LearnedPair>,
}

/// The conclusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedVerdict {
    /// Whether anything was learnt.
    pub kind: LearnedKind,
    /// What depends; empty where nothing was learnt.
    pub quantity: String,
    /// On what.
    pub state: String,
    /// Pairs that this experiment cannot tell from it.
    pub equivalent: Vec<EquivalentPair>,
    /// Effects of the library that do as well, and are to be preferred.
    pub library: Vec<String>,
    /// In words.
    pub sentence: String,
}

/// Whether anything was learnt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LearnedKind {
    /// Something was.
    Learned,
    /// Nothing was.
    Nothing,
}

/// A pair of a quantity and a state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentPair {
    /// What depends.
    pub quantity: String,
    /// On what.
    pub state: String,
}

/// A learnt function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedFunction {
    /// Unit of the state.
    pub state_unit: String,
    /// Lowest and highest state that fitted rows visited.
    pub visited: [f64; 2],
    /// State at which the factors are 1: of those that fitted rows visit, the one over which the function is known best.
    pub reference_state: f64,
    /// The quantity at the reference state; absent where it is no parameter of the law.
    pub at_reference: Option<QuantityAtReference>,
    /// Its values.
    pub points: Vec<LearnedPoint>,
}

/// The quantity that depends, at the reference state, in its parameter's unit.
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

/// A value of the function: the quantity over what it is at the reference state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedPoint {
    /// State.
    pub state: f64,
    /// Factor of the quantity.
    pub factor: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A formula.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedFormula {
    /// The formula, of the state and the parameters.
    pub text: String,
    /// Its parameters.
    pub parameters: Vec<FormulaParameter>,
    /// The file beside this document that `extend --with` takes.
    pub file: String,
    /// Factors at the states of the function's points, over that at the reference state.
    pub factors: Vec<f64>,
}

impl LearnedFormula {
    /// What becomes of a quantity: a product, with parentheses only about sums.
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
    /// Value at the fit.
    pub value: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A retardation beside the law.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Retardation {
    /// Its time in s.
    pub time_s: f64,
    /// Its compliance over what the law's is at the time of a hold.
    pub share: f64,
}

/// A pair that was looked at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedPair {
    /// What depends.
    pub quantity: String,
    /// On what.
    pub state: String,
    /// Gain in ln evidence over the model without it.
    pub evidence_nats: f64,
    /// Gain in the log score of cycles given those before them.
    pub heldout_gain_nats: Option<f64>,
    /// The part of it that the last cycle gives.
    pub last_cycle_gain_nats: Option<f64>,
    /// Error of the search on the scored cycle: of a fit with every kind of noise.
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

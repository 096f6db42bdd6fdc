//! Document of `learn` on several records (formats §5, `vitreo-uq/learned-cohort/1`).

use serde::{Deserialize, Serialize};

use super::learned::EquivalentPair;

/// Result of `learn` on several records: body of the JSON document `vitreo-uq/learned-cohort/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedCohort {
    /// Verdict of the search for a dependence that all records share.
    pub verdict: LearnedCohortVerdict,
    /// Quantity that depends on the state, such as a parameter of the law; empty if nothing was learnt.
    pub quantity: String,
    /// State on which the quantity depends, such as the position; empty if nothing was learnt.
    pub state: String,
    /// Pairs of quantity and state that the training records cannot distinguish from the learnt pair.
    pub equivalent: Vec<EquivalentPair>,
    /// Gain of the learnt pair in log evidence over all training records, in nats.
    pub evidence_nats: f64,
    /// Gain of the learnt pair in the log score of unseen cycles of the training records, in nats.
    pub heldout_gain_nats: f64,
    /// The formula for the dependence; `None` if nothing was learnt.
    pub formula: Option<CohortFormula>,
    /// Records that the formula was learnt from.
    pub learnt_from: Vec<TrainingRecord>,
    /// Records that test the formula. The search did not use them.
    pub confirmed_on: Vec<ConfirmedOn>,
    /// Gain of the formula in the log score of the test records' last cycles, in nats; `None` if nothing was learnt.
    pub confirmation_nats: Option<f64>,
    /// Upper bound exp(−gain) of the probability of the test records' gain if they lack the effect; `None` if nothing was learnt.
    pub largest_p: Option<f64>,
    /// Every pair of quantity and state that the search tried in all suitable training records, best first.
    pub pairs: Vec<CohortPair>,
}

/// Verdict of the search for a dependence that all records share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedCohortVerdict {
    /// Kind of verdict: confirmed, not confirmed or nothing learnt.
    pub kind: LearnedCohortKind,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of verdicts of the search over several records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LearnedCohortKind {
    /// A formula was learnt, and the test records confirm it.
    Confirmed,
    /// A formula was learnt, and the test records do not confirm it.
    NotConfirmed,
    /// Nothing was learnt.
    Nothing,
}

/// A formula for all records, with separate parameters for each record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortFormula {
    /// Formula for the factor, in terms of the state and the formula's parameters, in SI units.
    pub text: String,
    /// Names of the formula's parameters.
    pub parameters: Vec<String>,
    /// Units of the formula's parameters, in the order of their names.
    pub units: Vec<String>,
    /// Name of the formula's file, which `extend --with` reads.
    pub file: String,
    /// Gain in the log score of the training records' unseen cycles, in nats.
    pub heldout_gain_nats: f64,
}

/// Result of the learnt pair in one training record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct TrainingRecord {
    /// Name of the record.
    pub experiment: String,
    /// Gain of the learnt pair in log evidence, in nats.
    pub evidence_nats: f64,
    /// Gain of the learnt pair in the log score of unseen cycles, in nats.
    pub heldout_gain_nats: f64,
}

/// Result of the formula in one test record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ConfirmedOn {
    /// Name of the record.
    pub experiment: String,
    /// Gain of the formula in the log score of the last cycle, which no fit uses, in nats.
    pub last_cycle_gain_nats: f64,
    /// Root mean square residual of the held-out cycle without the formula, in µm.
    pub rmse_before_um: f64,
    /// Root mean square residual of the held-out cycle with the formula, in µm.
    pub rmse_after_um: f64,
    /// Values of the formula's parameters in this record, in the order of their names.
    pub values: Vec<f64>,
}

/// Result of one pair of quantity and state over all training records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortPair {
    /// Quantity that depends on the state, such as a parameter of the law.
    pub quantity: String,
    /// State on which the quantity depends, such as the position.
    pub state: String,
    /// Gain in log evidence over the model without the dependence, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of unseen cycles over the model without the dependence, in nats.
    pub heldout_gain_nats: f64,
}

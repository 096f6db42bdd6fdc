//! Document of `learn` on several records (formats §5, `vitreo-uq/learned-cohort/1`).

use serde::{Deserialize, Serialize};

use super::learned::EquivalentPair;

/// Body of `vitreo-uq/learned-cohort/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedCohort {
    /// Verdict of the search.
    pub verdict: LearnedCohortVerdict,
    /// The dependent quantity; empty if nothing was learnt.
    pub quantity: String,
    /// The state on which the quantity depends; empty if nothing was learnt.
    pub state: String,
    /// Pairs that the training records cannot distinguish from this one.
    pub equivalent: Vec<EquivalentPair>,
    /// Gain in ln evidence over all training records, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of the training records' unseen cycles, in nats.
    pub heldout_gain_nats: f64,
    /// The formula; `None` if nothing was learnt.
    pub formula: Option<CohortFormula>,
    /// Training records.
    pub learnt_from: Vec<TrainingRecord>,
    /// Test records, with the formula added. They had no part in the training.
    pub confirmed_on: Vec<ConfirmedOn>,
    /// Gain of the test records in the log score of their last cycles, in nats; `None` if nothing was learnt.
    pub confirmation_nats: Option<f64>,
    /// Upper bound of the probability of so large a gain if the test records lack the effect: exp(−gain).
    pub largest_p: Option<f64>,
    /// Every pair that was tried in all suitable training records, best first.
    pub pairs: Vec<CohortPair>,
}

/// Verdict of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedCohortVerdict {
    /// Kind of verdict.
    pub kind: LearnedCohortKind,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of verdicts.
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
    /// Formula in the state and the parameters, in SI units.
    pub text: String,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Units of the parameters.
    pub units: Vec<String>,
    /// Name of the formula's file, which `extend --with` reads.
    pub file: String,
    /// Gain in the log score of the training records' unseen cycles, in nats.
    pub heldout_gain_nats: f64,
}

/// A training record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct TrainingRecord {
    /// Name of the record.
    pub experiment: String,
    /// Gain of the pair in ln evidence, in nats.
    pub evidence_nats: f64,
    /// Gain of the pair in the log score of unseen cycles, in nats.
    pub heldout_gain_nats: f64,
}

/// A test record of the formula.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ConfirmedOn {
    /// Name of the record.
    pub experiment: String,
    /// Gain of the formula in the log score of the last cycle, which no fit uses, in nats.
    pub last_cycle_gain_nats: f64,
    /// Error on the held-out cycle without the formula, in µm.
    pub rmse_before_um: f64,
    /// Error on the held-out cycle with the formula, in µm.
    pub rmse_after_um: f64,
    /// Parameters of the formula in this record, in the order of their names.
    pub values: Vec<f64>,
}

/// Result of a pair over all training records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortPair {
    /// The dependent quantity.
    pub quantity: String,
    /// The state on which the quantity depends.
    pub state: String,
    /// Gain in ln evidence, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of unseen cycles, in nats.
    pub heldout_gain_nats: f64,
}

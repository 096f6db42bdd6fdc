//! The document of `learn` over several records (formats §5, `vitreo-uq/learned-cohort/1`).

use serde::{Deserialize, Serialize};

use super::learned::EquivalentPair;

/// Body of `vitreo-uq/learned-cohort/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedCohort {
    /// What is concluded.
    pub verdict: LearnedCohortVerdict,
    /// What depends; empty where nothing was learnt.
    pub quantity: String,
    /// On what.
    pub state: String,
    /// Pairs that the records it was learnt from cannot tell from it.
    pub equivalent: Vec<EquivalentPair>,
    /// Gain in ln evidence over all records it was learnt from, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of their unseen cycles, in nats.
    pub heldout_gain_nats: f64,
    /// The formula; `None` where nothing was learnt.
    pub formula: Option<CohortFormula>,
    /// Records that it was learnt from.
    pub learnt_from: Vec<LearntFrom>,
    /// Records that had no part in that, with the formula added.
    pub confirmed_on: Vec<ConfirmedOn>,
    /// Gain of those in the log score of their last cycles, in nats; `None` where nothing was learnt.
    pub confirmation_nats: Option<f64>,
    /// Largest probability of so large a gain in records that do not have it: e to the minus gain.
    pub largest_p: Option<f64>,
    /// Every pair that was looked at in all records it could be learnt from, best first.
    pub pairs: Vec<CohortPair>,
}

/// The conclusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearnedCohortVerdict {
    /// Whether anything was learnt, and confirmed.
    pub kind: LearnedCohortKind,
    /// In words.
    pub sentence: String,
}

/// Whether anything was learnt, and confirmed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LearnedCohortKind {
    /// Something was learnt, and records that had no part in it have it.
    Confirmed,
    /// Something was learnt, and records that had no part in it do not show it.
    NotConfirmed,
    /// Nothing was learnt.
    Nothing,
}

/// A formula for all records, each with parameters of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortFormula {
    /// Of the state and the parameters, SI units.
    pub text: String,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Their units.
    pub units: Vec<String>,
    /// Name of its file, which `extend --with` takes.
    pub file: String,
    /// Its gain in the log score of unseen cycles of the records it was learnt from, in nats.
    pub heldout_gain_nats: f64,
}

/// A record that was learnt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LearntFrom {
    /// Name of the record.
    pub experiment: String,
    /// What the pair gains in ln evidence, in nats.
    pub evidence_nats: f64,
    /// And in the log score of unseen cycles.
    pub heldout_gain_nats: f64,
}

/// A record that the formula was tried on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ConfirmedOn {
    /// Name of the record.
    pub experiment: String,
    /// What the formula gains in the log score of the last cycle, which no fit has seen, in nats.
    pub last_cycle_gain_nats: f64,
    /// Error on the held-out cycle without it.
    pub rmse_before_um: f64,
    /// With it.
    pub rmse_after_um: f64,
    /// The formula's parameters in this record, in the order of their names.
    pub values: Vec<f64>,
}

/// A pair over all records that were learnt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortPair {
    /// What depends.
    pub quantity: String,
    /// On what.
    pub state: String,
    /// Gain in ln evidence, in nats.
    pub evidence_nats: f64,
    /// Gain in the log score of unseen cycles, in nats.
    pub heldout_gain_nats: f64,
}

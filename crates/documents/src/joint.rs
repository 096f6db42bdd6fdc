//! The document of `sample` on several records of one specimen (formats §5, `vitreo-uq/joint/1`).

use serde::{Deserialize, Serialize};

use super::posterior::{ModelSummary, ParameterSummary, SamplerSummary, Warning};

/// Body of `vitreo-uq/joint/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct JointSummary {
    /// The model, with the noise of every record.
    pub model: ModelSummary,
    /// The law's parameters, which all records share, then each record's own, named `record 1: …`.
    pub parameters: Vec<ParameterSummary>,
    /// How the draws were made.
    pub sampler: SamplerSummary,
    /// The records, each with the law that it alone would have.
    pub records: Vec<JointRecord>,
    /// Whether they agree.
    pub agreement: Agreement,
    /// Whether the draws have converged.
    pub converged: bool,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

impl JointSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// One record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct JointRecord {
    /// Specimen identifier.
    pub id: String,
    /// `creep` or `oscillation`.
    pub kind: String,
    /// The law at its own best fit.
    pub law: Vec<LawEstimate>,
}

/// A parameter of the law at one record's best fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LawEstimate {
    /// Name, with unit.
    pub name: String,
    /// Value.
    pub value: f64,
    /// One standard deviation below, in the coordinate in which it has no bounds.
    pub lower: f64,
    /// One above.
    pub upper: f64,
}

/// A law for each record against one for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// Twice the difference of the log-likelihoods.
    pub statistic: f64,
    /// Parameters that separate laws have more.
    pub degrees_of_freedom: usize,
    /// Probability of a difference as large, were there one law: χ² of as many degrees of freedom (S. S. Wilks 1938).
    pub p: f64,
}

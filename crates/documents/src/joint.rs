//! Document of `sample` on several records of one specimen (formats §5, `vitreo-uq/joint/1`).

use serde::{Deserialize, Serialize};

use super::posterior::{ModelSummary, ParameterSummary, SamplerSummary, Warning};

/// Body of `vitreo-uq/joint/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct JointSummary {
    /// The model, with the noise terms of every record.
    pub model: ModelSummary,
    /// Parameters of the law, shared by all records, then each record's own parameters, named `record 1: …`.
    pub parameters: Vec<ParameterSummary>,
    /// Statistics of the sampler.
    pub sampler: SamplerSummary,
    /// The records, each with the law fitted to it alone.
    pub records: Vec<JointRecord>,
    /// Test of the records' agreement.
    pub agreement: Agreement,
    /// True if the draws have converged.
    pub converged: bool,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl JointSummary {
    /// True if the result is sound (exit code 0).
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
    /// Parameters of the law at this record's best fit.
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
    /// Value one standard deviation below, computed in the unbounded coordinate.
    pub lower: f64,
    /// Value one standard deviation above, computed in the unbounded coordinate.
    pub upper: f64,
}

/// Likelihood-ratio test of one law for each record against one law for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// Twice the difference of the log likelihoods.
    pub statistic: f64,
    /// Number of additional parameters of the separate laws.
    pub degrees_of_freedom: usize,
    /// Probability of a difference at least as large under one common law, from χ² with that many degrees of freedom (S. S. Wilks 1938).
    pub p: f64,
}

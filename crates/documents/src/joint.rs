//! Document of `sample` on several records of one specimen (formats §5, `vitreo-uq/joint/1`).

use serde::{Deserialize, Serialize};

use super::posterior::{ModelSummary, ParameterSummary, SamplerSummary, Warning};

/// Result of `sample` on several records of one specimen: body of the JSON document `vitreo-uq/joint/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct JointSummary {
    /// The model, with the noise terms of every record.
    pub model: ModelSummary,
    /// Posteriors of all parameters: first those of the law, shared by all records, then those of each record, named `record 1: …`.
    pub parameters: Vec<ParameterSummary>,
    /// Statistics of the sampler.
    pub sampler: SamplerSummary,
    /// The records, each with the law that is fitted to it alone.
    pub records: Vec<JointRecord>,
    /// Test whether one law describes all records.
    pub agreement: Agreement,
    /// True if the draws have converged.
    pub converged: bool,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl JointSummary {
    /// True if no warning makes the result untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// One of the records, with the law that is fitted to it alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct JointRecord {
    /// Specimen identifier.
    pub id: String,
    /// Kind of record: `creep` or `oscillation`.
    pub kind: String,
    /// Parameters of the law at the best fit to this record alone.
    pub law: Vec<LawEstimate>,
}

/// A parameter of the law at the best fit to one record, with its interval of one standard deviation either way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LawEstimate {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Estimate, in the unit of the parameter's name.
    pub value: f64,
    /// Lower end of the interval: one standard deviation below the estimate in the sampler's unbounded coordinate.
    pub lower: f64,
    /// Upper end of the interval: one standard deviation above the estimate in the sampler's unbounded coordinate.
    pub upper: f64,
}

/// Likelihood-ratio test of separate laws for the records against one common law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// Twice the difference of the log likelihoods of separate laws and of one common law.
    pub statistic: f64,
    /// Number of parameters that separate laws have in addition to one common law.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least as large under one common law, from the χ² distribution with `degrees_of_freedom` (S. S. Wilks 1938).
    pub p: f64,
}

//! Document of `check` (formats §5, `vitreo-uq/check/1`).

use serde::{Deserialize, Serialize};

/// Result of `check`: body of the JSON document `vitreo-uq/check/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CheckSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The record as the program understands it, for the user to confirm.
    pub understood: RecordReading,
    /// Contradictions between the table's rows and `experiment.toml`, certain ones first.
    pub contradictions: Vec<Contradiction>,
}

/// A record as the program understands it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RecordReading {
    /// Number of rows in the table.
    pub rows: usize,
    /// Number of rows that have a position.
    pub positions: usize,
    /// Number of cycles in the record.
    pub cycles: u32,
    /// Sentences that describe the apparatus, the times, the force, the positions and the cycles.
    pub sentences: Vec<String>,
}

/// A contradiction between the table's rows and `experiment.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Contradiction {
    /// Short name for the kind of contradiction.
    pub kind: String,
    /// True if the contradiction is certain. The program fits nothing before the user resolves it.
    pub certain: bool,
    /// Sentence that describes the contradiction.
    pub text: String,
    /// Advice on how to resolve the contradiction.
    pub advice: String,
}

impl CheckSummary {
    /// True if no contradiction is certain, so that the record can be fitted.
    pub fn is_sound(&self) -> bool {
        self.contradictions.iter().all(|contradiction| !contradiction.certain)
    }
}

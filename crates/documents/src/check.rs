//! Document of `check` (formats §5, `vitreo-uq/check/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/check/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CheckSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The program's reading of the record.
    pub understood: RecordReading,
    /// Contradictions between rows and description, certain ones first.
    pub contradictions: Vec<Contradiction>,
}

/// The program's reading of a record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RecordReading {
    /// Number of rows.
    pub rows: usize,
    /// Number of rows with a position.
    pub positions: usize,
    /// Number of cycles.
    pub cycles: u32,
    /// Sentences on apparatus, times, force, positions and cycles.
    pub sentences: Vec<String>,
}

/// A contradiction between the rows and their description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Contradiction {
    /// Kind of contradiction.
    pub kind: String,
    /// True if the contradiction is certain. Nothing is fitted before it is resolved.
    pub certain: bool,
    /// Description of the contradiction.
    pub text: String,
    /// Advice to the user.
    pub advice: String,
}

impl CheckSummary {
    /// True if no contradiction is certain.
    pub fn is_sound(&self) -> bool {
        self.contradictions.iter().all(|contradiction| !contradiction.certain)
    }
}

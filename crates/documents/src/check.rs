//! The document of `check` (formats §5, `vitreo-uq/check/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/check/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CheckSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// What was understood.
    pub understood: UnderstoodRecord,
    /// What contradicts it, the certain first.
    pub contradictions: Vec<Contradiction>,
}

/// What was understood of a record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct UnderstoodRecord {
    /// Rows.
    pub rows: usize,
    /// Rows with a position.
    pub positions: usize,
    /// Cycles.
    pub cycles: u32,
    /// In words: apparatus, times, force, positions, cycles.
    pub sentences: Vec<String>,
}

/// Something in the rows that contradicts their description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Contradiction {
    /// Which kind it is.
    pub kind: String,
    /// Whether it is certain, so that nothing is fitted before it is settled.
    pub certain: bool,
    /// What was found.
    pub text: String,
    /// What to do.
    pub advice: String,
}

impl CheckSummary {
    /// Whether nothing is certainly wrong.
    pub fn is_sound(&self) -> bool {
        self.contradictions.iter().all(|contradiction| !contradiction.certain)
    }
}

//! The document of `init` (formats §5, `vitreo-uq/init/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/init/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InitSummary {
    /// The directory that was written.
    pub directory: String,
    /// Directories of the experiments, one a track, where a table of several tracks became a cohort; else empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub experiments: Vec<String>,
    /// Name of the table in it.
    pub file: String,
    /// What was understood of the table, one sentence each.
    pub reasons: Vec<String>,
    /// Columns of time, force, position (or x and y) and, if the table has one, cycle; of an oscillation frequency and moduli.
    pub columns: Vec<InitColumn>,
    /// Other columns, which are kept in the file and not read.
    pub others: Vec<String>,
    /// Rows.
    pub rows: usize,
    /// Rows without a position.
    pub rows_without_position: usize,
    /// Keys of `experiment.toml` that are left to be filled in.
    pub unknown: Vec<String>,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InitColumn {
    /// time, force, position, position_x, position_y or cycle; frequency, storage, loss, modulus or phase.
    pub role: String,
    /// Name in the header, or `column N`.
    pub name: String,
    /// Unit, or how times are written; empty for cycles.
    pub unit: String,
    /// Smallest and largest value in s, µN and µm; `None` for cycles, for x and y, which become one position, and for oscillations.
    pub range: Option<[f64; 2]>,
}

impl InitSummary {
    /// Whether the experiment can be read as it stands.
    pub fn is_complete(&self) -> bool {
        self.unknown.is_empty()
    }
}

//! Document of `init` (formats §5, `vitreo-uq/init/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/init/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InitSummary {
    /// The new directory.
    pub directory: String,
    /// Directories of the experiments, one for each track, if a table of several tracks became a cohort; otherwise empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub experiments: Vec<String>,
    /// Name of the table in the directory.
    pub file: String,
    /// Decisions on the table's content, one sentence each.
    pub reasons: Vec<String>,
    /// Columns of time, force, position (or x and y) and, if present, cycle. For an oscillation: columns of frequency and moduli.
    pub columns: Vec<InitColumn>,
    /// Other columns. They stay in the file and are not read.
    pub others: Vec<String>,
    /// Number of rows.
    pub rows: usize,
    /// Number of rows without a position.
    pub rows_without_position: usize,
    /// Keys of `experiment.toml` that the user must fill in.
    pub unknown: Vec<String>,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InitColumn {
    /// Role of the column: time, force, position, position_x, position_y or cycle; frequency, storage, loss, modulus or phase.
    pub role: String,
    /// Name in the header, or `column N`.
    pub name: String,
    /// Unit, or format of the times; empty for cycles.
    pub unit: String,
    /// Smallest and largest value, in s, µN or µm. `None` for cycles, for oscillations, and for x and y, which become one position.
    pub range: Option<[f64; 2]>,
}

impl InitSummary {
    /// True if the experiment can be read without further input.
    pub fn is_complete(&self) -> bool {
        self.unknown.is_empty()
    }
}

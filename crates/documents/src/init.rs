//! Document of `init` (formats §5, `vitreo-uq/init/1`).

use serde::{Deserialize, Serialize};

/// Result of `init`: body of the JSON document `vitreo-uq/init/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InitSummary {
    /// Directory that `init` has created for the experiment or cohort.
    pub directory: String,
    /// Directories of the cohort's experiments, one for each track in the table; empty for a table with a single track.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub experiments: Vec<String>,
    /// Name of the table's file in the new directory.
    pub file: String,
    /// Sentences on the program's decisions about the table's content.
    pub reasons: Vec<String>,
    /// Columns that the program uses: time, force, position (or x and y) and, if present, cycle. For an oscillation: frequency and moduli.
    pub columns: Vec<InitColumn>,
    /// Names of the columns that the program does not use. They stay in the file.
    pub others: Vec<String>,
    /// Number of rows in the table.
    pub rows: usize,
    /// Number of rows without a position.
    pub rows_without_position: usize,
    /// Keys of `experiment.toml` that the user must fill in.
    pub unknown: Vec<String>,
}

/// A column of the user's table and the program's use of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InitColumn {
    /// Quantity in the column: time, force, position, position_x, position_y or cycle; stress and strain for such a table; for an oscillation frequency, storage, loss,
    /// modulus or phase.
    pub role: String,
    /// Name of the column in the table's header, or `column N`; for columns of an oscillation with equal names `column N: NAME`.
    pub name: String,
    /// Unit of the column, or the format of its times; empty for cycles.
    pub unit: String,
    /// Smallest and largest value in the column, in s, µN or µm. `None` for cycles, oscillations, and the coordinates x and y.
    pub range: Option<[f64; 2]>,
}

impl InitSummary {
    /// True if the user need not fill in any key before the experiment can be read.
    pub fn is_complete(&self) -> bool {
        self.unknown.is_empty()
    }
}

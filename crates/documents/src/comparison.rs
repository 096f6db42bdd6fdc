//! The document of `compare` (formats §5, `vitreo-uq/comparison/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/comparison/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Comparison {
    /// Specimen identifier.
    pub experiment: String,
    /// Effects of the model that is looked at.
    pub effects: Vec<String>,
    /// Cycles that the model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The cycle that was scored, if there is one.
    pub heldout_cycles: Vec<u32>,
    /// Rows (from 0) that were left out as outliers.
    pub outlier_rows: Vec<usize>,
    /// Root mean square error of the fitted cycles, in µm: of the model's posterior, as `extend` and `ladder` show it.
    pub rmse_fitted_um: f64,
    /// Of the scored cycle, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// The noise that errors are measured against, known or estimated, in µm; `None` where it is unknown.
    pub noise_um: Option<f64>,
    /// All in all, in plain words.
    pub sentence: String,
    /// Where the model fails, clearest first; what only echoes another finding comes after those.
    pub findings: Vec<Finding>,
    /// Every look.
    pub panels: Vec<PanelEntry>,
    /// Looks that have no meaning in this experiment.
    pub left_out: Vec<LeftOutEntry>,
    /// Records that were simulated to correct the looks together.
    pub simulated_records: usize,
}

/// A place where the model fails.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Finding {
    /// Stable name of the look.
    #[serde(rename = "where")]
    pub place: String,
    /// In plain words.
    pub sentence: String,
    /// Size of the fitted bias where it is clearest, or its root mean square where no single place is clear, in µm; `None` for `runs` and
    /// `autocorrelation`, which have none.
    pub size_um: Option<f64>,
    /// Its standard error, in µm; `None` for a root mean square.
    pub size_sd_um: Option<f64>,
    /// The finding whose bias leaves little of this one: both show the same misfit.
    pub echo_of: Option<String>,
    /// p corrected for all looks.
    pub p_familywise: f64,
}

/// One look.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PanelEntry {
    /// Stable name.
    #[serde(rename = "where")]
    pub place: String,
    /// What its bars stand over.
    pub title: String,
    /// Whether positive biases are along force or motion rather than along the axis.
    pub is_along_force: bool,
    /// Gain in log likelihood of its columns, noise estimated anew; for `runs` and `autocorrelation` half their χ² statistic.
    pub gain_nats: f64,
    /// What noise alone would gain, on average.
    pub gain_by_chance_nats: f64,
    /// Root mean square of the bias that its columns describe, over the fitted rows, in µm; `None` for `runs` and `autocorrelation`.
    pub rms_um: Option<f64>,
    /// p of this look alone.
    pub p: f64,
    /// p corrected for all looks.
    pub p_familywise: f64,
    /// Biases in µm; for `runs` a standard score, for `autocorrelation` correlations.
    pub bars: Vec<Bar>,
}

/// The bias in one column of a look.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Bar {
    /// Short name.
    pub label: String,
    /// Where it is, as the end of a sentence.
    pub phrase: String,
    /// From and to, in s after a force step, where that is what it is about.
    pub lag_s: Option<[f64; 2]>,
    /// What the measurement has beyond the model, in µm at the column's largest.
    pub bias_um: f64,
    /// Its standard error.
    pub sd_um: f64,
}

/// A look that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LeftOutEntry {
    /// Stable name.
    #[serde(rename = "where")]
    pub place: String,
    /// Why.
    pub reason: String,
}

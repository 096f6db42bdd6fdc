//! Document of `compare` (formats §5, `vitreo-uq/comparison/1`).

use serde::{Deserialize, Serialize};

/// Body of `vitreo-uq/comparison/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Comparison {
    /// Specimen identifier.
    pub experiment: String,
    /// Effects of the compared model.
    pub effects: Vec<String>,
    /// Cycles that the model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored held-out cycle; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Rows (from 0) left out as outliers.
    pub outlier_rows: Vec<usize>,
    /// Root mean square error of the fitted cycles, in µm, for the model's posterior as in `extend` and `ladder`.
    pub rmse_fitted_um: f64,
    /// Root mean square error of the scored cycle, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// Known or estimated noise that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Summary as a sentence.
    pub sentence: String,
    /// Findings, clearest first. Explained findings come last.
    pub findings: Vec<Finding>,
    /// Every test.
    pub panels: Vec<TestEntry>,
    /// Tests that do not apply to this experiment.
    pub left_out: Vec<LeftOutEntry>,
    /// Number of simulated records that correct the tests' p values jointly.
    pub simulated_records: usize,
}

/// A misfit that a test has found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Finding {
    /// Stable name of the test.
    #[serde(rename = "where")]
    pub place: String,
    /// Finding as a sentence.
    pub sentence: String,
    /// Size of the fitted bias where it is clearest, in µm; its root mean square if no single column is clear. `None` for `runs` and `autocorrelation`, which
    /// have no bias.
    pub size_um: Option<f64>,
    /// Standard error of the size, in µm; `None` for a root mean square.
    pub size_sd_um: Option<f64>,
    /// The finding that explains this one. After correction for its bias, little of this finding remains: both show the same misfit.
    pub echo_of: Option<String>,
    /// p corrected for all tests.
    pub p_familywise: f64,
}

/// One test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct TestEntry {
    /// Stable name of the test.
    #[serde(rename = "where")]
    pub place: String,
    /// Title of the test's axis.
    pub title: String,
    /// True if positive biases point along the force or motion instead of along the axis.
    pub is_along_force: bool,
    /// Gain in log likelihood by the test's columns, with noise estimated anew. For `runs` and `autocorrelation`: half of their χ² statistic.
    pub gain_nats: f64,
    /// Mean gain by noise alone.
    pub gain_by_chance_nats: f64,
    /// Root mean square of the columns' bias over the fitted rows, in µm; `None` for `runs` and `autocorrelation`.
    pub rms_um: Option<f64>,
    /// p of this test alone.
    pub p: f64,
    /// p corrected for all tests.
    pub p_familywise: f64,
    /// Biases, in µm. For `runs`: a standard score; for `autocorrelation`: correlations.
    pub bars: Vec<ColumnBias>,
}

/// Bias in one column of a test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ColumnBias {
    /// Short name.
    pub label: String,
    /// Place of the column, as the end of a sentence.
    pub phrase: String,
    /// Start and end of the column, in s after a force step; `None` if the test is not about time since a force step.
    pub lag_s: Option<[f64; 2]>,
    /// Starts and ends, in s, of the times to which the column applies; empty if there are more than 400, or if the test does not divide the record.
    #[serde(default)]
    pub stretches_s: Vec<[f64; 2]>,
    /// Measurement minus model, in µm, at the column's largest value.
    pub bias_um: f64,
    /// Standard error of the bias, in µm.
    pub sd_um: f64,
}

/// A test that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LeftOutEntry {
    /// Stable name of the test.
    #[serde(rename = "where")]
    pub place: String,
    /// Reason why it was left out.
    pub reason: String,
}

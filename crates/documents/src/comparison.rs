//! Document of `compare` (formats §5, `vitreo-uq/comparison/1`).

use serde::{Deserialize, Serialize};

/// Result of `compare`, which looks for misfits of a model: body of the JSON document `vitreo-uq/comparison/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Comparison {
    /// Specimen identifier.
    pub experiment: String,
    /// Effects that the compared model contains.
    pub effects: Vec<String>,
    /// Cycles that the model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored cycle, which is the last held-out one; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Numbers (from 0) of the rows left out as outliers.
    pub outlier_rows: Vec<usize>,
    /// Root mean square residual of the fitted cycles, in µm, for the model's posterior as in `extend` and `ladder`.
    pub rmse_fitted_um: f64,
    /// Root mean square residual of the scored cycle, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Noise standard deviation, known or estimated, that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Summary of the findings as a sentence.
    pub sentence: String,
    /// Misfits that the tests have found, clearest first. Findings that another one explains come last.
    pub findings: Vec<Finding>,
    /// Every test of the residuals that applies to this experiment.
    pub panels: Vec<TestEntry>,
    /// Tests of the residuals that do not apply to this experiment.
    pub left_out: Vec<InapplicableTest>,
    /// Number of simulated records from which the tests' p values are computed.
    pub simulated_records: usize,
}

/// A misfit that a test has found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Finding {
    /// Name of the test in files.
    #[serde(rename = "where")]
    pub place: String,
    /// The finding as a sentence.
    pub sentence: String,
    /// Largest clear bias of the test's columns, in µm; the root mean square of all biases if no single column is clear. `None` for `runs` and
    /// `autocorrelation`, which have no bias.
    pub size_um: Option<f64>,
    /// Standard error of the size, in µm; `None` for a root mean square.
    pub size_sd_um: Option<f64>,
    /// Test whose finding explains this one: after correction for its bias, little of this finding remains. `None` if no other finding does.
    pub echo_of: Option<String>,
    /// Probability that chance alone gives as large a gain, corrected for all tests.
    pub p_familywise: f64,
}

/// A test of the residuals, with the bias in each of its columns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct TestEntry {
    /// Name of the test in files.
    #[serde(rename = "where")]
    pub place: String,
    /// Title of the test's horizontal axis.
    pub title: String,
    /// True if positive biases point along the force or the motion; false if they point along the axis of the positions.
    pub is_along_force: bool,
    /// Gain in log likelihood by a bias in each of the test's columns, in nats, with the noise estimated anew. For `runs` and `autocorrelation`: half of their
    /// χ² statistic.
    pub gain_nats: f64,
    /// Mean gain of simulated records that contain noise only, in nats.
    pub gain_by_chance_nats: f64,
    /// Root mean square of the bias over the fitted rows, in µm; `None` for `runs` and `autocorrelation`.
    pub rms_um: Option<f64>,
    /// Probability that chance alone gives as large a gain in this test.
    pub p: f64,
    /// Probability that chance alone gives as large a gain, corrected for all tests.
    pub p_familywise: f64,
    /// Bias of each column, in µm. For `runs`: one standard score. For `autocorrelation`: correlations.
    pub bars: Vec<ColumnBias>,
}

/// Mean residual in one column of a test. A column is a group of rows, such as a range of times since a force step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ColumnBias {
    /// Short name of the column, for the axis of the figure.
    pub label: String,
    /// Description of the column, as the end of a sentence.
    pub phrase: String,
    /// Start and end of the column, in s after a force step; `None` if the test does not group rows by the time since a force step.
    pub lag_s: Option<[f64; 2]>,
    /// Stretches of time that belong to the column, each with start and end in s; empty if there are more than 400, or if the test does not divide the record.
    #[serde(default)]
    pub stretches_s: Vec<[f64; 2]>,
    /// Measurement minus model, in µm, at the column's largest value.
    pub bias_um: f64,
    /// Standard error of the bias, in µm.
    pub sd_um: f64,
}

/// A test of the residuals that does not apply to this experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct InapplicableTest {
    /// Name of the test in files.
    #[serde(rename = "where")]
    pub place: String,
    /// Reason why the test does not apply.
    pub reason: String,
}

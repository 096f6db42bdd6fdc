//! Document of a simulation-based calibration (`vitreo-uq/calibration/1`). The calibration tests if intervals of simulated records' posteriors contain the true
//! values as often as they should.

use serde::{Deserialize, Serialize};

use super::posterior::ModelSummary;

/// Result of a simulation-based calibration: body of the JSON document `vitreo-uq/calibration/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Calibration {
    /// Specimen identifier of the experiment whose protocol is simulated.
    pub experiment: String,
    /// Model of the calibration. Its prior supplies the true values, and its posteriors are tested.
    pub model: ModelSummary,
    /// Form of the model that simulated the records.
    pub simulated_by: Simulator,
    /// Number of simulated records.
    pub replicates: usize,
    /// Number of replicates (simulated records) that were sampled and converged. Only their true values are ranked.
    pub ranked: usize,
    /// Number of replicates that were sampled but did not converge. The calibration does not count them.
    pub not_converged: usize,
    /// Number of replicates whose sampling failed.
    pub failed: usize,
    /// Number of prior draws that the model could not simulate. New draws replaced them, so they do not belong to the tested prior.
    pub redrawn: usize,
    /// Number of posterior draws among which each true value is ranked.
    pub draws: usize,
    /// Smallest and largest number of ranks in a bin of the histogram that a calibrated posterior gives with probability 99 %.
    pub bin_interval_99: [usize; 2],
    /// Results for the sampled parameters in their order, then for the log density of the posterior.
    pub quantities: Vec<CalibratedQuantity>,
    /// Verdict on the calibration.
    pub verdict: CalibrationVerdict,
}

/// Forms of the model that can simulate the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Simulator {
    /// The full finite-element model. The calibration then includes the surrogate's error.
    FullFiniteElements,
    /// The exact closed form for an instrument, which has no finite elements.
    ClosedForm,
}

/// Ranks of one quantity's true values among the posterior draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CalibratedQuantity {
    /// Name of the parameter with its unit, or `log_density`.
    pub name: String,
    /// Number of ranks in each bin of the histogram, from the lowest rank to the highest. All bins are equally wide.
    pub counts: Vec<usize>,
    /// χ² statistic of the histogram, with one degree of freedom fewer than there are bins; `null` if too few replicates are ranked.
    pub chi_square: Option<f64>,
    /// Deviation of the mean rank from its expectation, in standard errors; negative if the posteriors lie too high.
    pub place: Option<f64>,
    /// Deviation of the ranks' spread about the middle from its expectation, in standard errors; positive if the posteriors are too narrow.
    pub spread: Option<f64>,
    /// Probability that chance alone gives as large a χ².
    pub p_chi_square: Option<f64>,
    /// Smallest p of the tests of χ², place and spread, corrected for the tests of all quantities (Holm).
    pub p_holm: Option<f64>,
    /// Mean of the posteriors' standardised errors, (true value − posterior mean)/posterior standard deviation, in the sampler's coordinates; `null` for the
    /// log density.
    pub z_mean: Option<f64>,
    /// Standard deviation of the posteriors' standardised errors, (true value − posterior mean)/posterior standard deviation; `null` for the log density.
    pub z_sd: Option<f64>,
    /// Share of true values inside the central 50 % intervals.
    pub coverage_50: Coverage,
    /// Share of true values inside the central 90 % intervals.
    pub coverage_90: Coverage,
}

/// Share of true values inside posterior intervals of one probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Coverage {
    /// Share of true values inside their intervals; `null` if no replicate is ranked.
    pub share: Option<f64>,
    /// Exact 95 % confidence interval of the probability that an interval contains the true value (Clopper and Pearson).
    pub interval_95: [f64; 2],
}

/// Verdict of a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CalibrationVerdict {
    /// Kind of verdict: calibrated, miscalibrated or undecided.
    pub kind: CalibrationKind,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of calibration verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CalibrationKind {
    /// No test contradicts the posteriors.
    Calibrated,
    /// True values lie outside the posterior intervals more or less often than they should.
    Miscalibrated,
    /// The replicates are too few for a decision.
    Undecided,
}

//! Document of a simulation-based calibration (`vitreo-uq/calibration/1`). It tests if posteriors of simulated records contain the true values as often as
//! their intervals state.

use serde::{Deserialize, Serialize};

use super::posterior::ModelSummary;

/// Body of `vitreo-uq/calibration/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Calibration {
    /// Specimen of the experiment.
    pub experiment: String,
    /// Model whose prior is drawn from, and that simulates and samples the records.
    pub model: ModelSummary,
    /// Model that simulated the records.
    pub simulated_by: Simulator,
    /// Number of simulated records.
    pub replicates: usize,
    /// Replicates whose true values are ranked: sampled and converged.
    pub ranked: usize,
    /// Replicates that were sampled but did not converge. They are not counted.
    pub not_converged: usize,
    /// Replicates whose sampling failed.
    pub failed: usize,
    /// Prior draws that the model refused and that were drawn again. The remaining draws define the prior.
    pub redrawn: usize,
    /// Number of posterior draws that each true value is ranked among.
    pub draws: usize,
    /// Fewest and most ranks in a bin of a histogram. A calibrated bin lies between them with probability 99 %.
    pub bin_interval_99: [usize; 2],
    /// Sampled parameters in their order, then the posterior's log density.
    pub quantities: Vec<CalibratedQuantity>,
    /// Verdict on the calibration.
    pub verdict: CalibrationVerdict,
}

/// Model that simulated the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Simulator {
    /// The full finite-element model. The test includes the surrogate's error.
    FullFiniteElements,
    /// The exact closed form of an instrument.
    ClosedForm,
}

/// Ranks of one quantity's true values among the posterior draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CalibratedQuantity {
    /// Name of the parameter with its unit, or `log_density`.
    pub name: String,
    /// Ranks in bins of equal width, from the lowest to the highest.
    pub counts: Vec<usize>,
    /// χ² of the bins, with one degree of freedom fewer than there are bins; `null` if too few replicates are ranked.
    pub chi_square: Option<f64>,
    /// Mean rank, in standard errors; negative if the posteriors lie too high.
    pub place: Option<f64>,
    /// Mean squared distance of the ranks from the middle, in standard errors; positive if the posteriors are too narrow.
    pub spread: Option<f64>,
    /// p of χ².
    pub p_chi_square: Option<f64>,
    /// Smallest p of χ², place and spread, corrected for the tests of all quantities (Holm).
    pub p_holm: Option<f64>,
    /// Mean of (true value − posterior mean)/posterior standard deviation, in the sampler's coordinates; `null` for the log density.
    pub z_mean: Option<f64>,
    /// Standard deviation of (true value − posterior mean)/posterior standard deviation; `null` for the log density.
    pub z_sd: Option<f64>,
    /// Coverage of the central 50 % intervals.
    pub coverage_50: Coverage,
    /// Coverage of the central 90 % intervals.
    pub coverage_90: Coverage,
}

/// Share of true values that lie inside their intervals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Coverage {
    /// Share of true values inside; `null` if no replicate is ranked.
    pub share: Option<f64>,
    /// Exact 95 % interval of the share's probability (Clopper and Pearson).
    pub interval_95: [f64; 2],
}

/// Verdict of a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CalibrationVerdict {
    /// Kind of verdict.
    pub kind: CalibrationKind,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Kinds of calibration verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CalibrationKind {
    /// No test speaks against the posteriors.
    Calibrated,
    /// True values do not lie where the posteriors predict them.
    Miscalibrated,
    /// Too few replicates to decide.
    Undecided,
}

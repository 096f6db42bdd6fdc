//! The document of a simulation-based calibration (`vitreo-uq/calibration/1`): whether posteriors of simulated records hold the truths as often as they say.

use serde::{Deserialize, Serialize};

use super::posterior::ModelSummary;

/// Body of `vitreo-uq/calibration/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Calibration {
    /// Specimen of the experiment.
    pub experiment: String,
    /// The model that was drawn from, simulated and sampled.
    pub model: ModelSummary,
    /// What simulated the records.
    pub simulated_by: Simulator,
    /// Records that were simulated.
    pub replicates: usize,
    /// Replicates whose truths are ranked: sampled and converged.
    pub ranked: usize,
    /// Replicates that were sampled and had not converged; what they say is not counted.
    pub not_converged: usize,
    /// Replicates that could not be sampled.
    pub failed: usize,
    /// Draws from the prior that were thrown away, because the model refuses them: the prior is what is left.
    pub redrawn: usize,
    /// Posterior draws that every truth is ranked among.
    pub draws: usize,
    /// Fewest and most ranks in a bin of a histogram, with a probability of 99 % where all is well.
    pub bin_interval_99: [usize; 2],
    /// Sampled parameters in order, and last the log-density of the posterior.
    pub quantities: Vec<CalibratedQuantity>,
    /// What follows.
    pub verdict: CalibrationVerdict,
}

/// What simulated the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Simulator {
    /// The full finite-element model: the reduced model's error is part of what is tested.
    FullFiniteElements,
    /// The closed form of an instrument, which is exact.
    ClosedForm,
}

/// One quantity: where its truths rank among posterior draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CalibratedQuantity {
    /// Name of the parameter, with unit; or `log_density`.
    pub name: String,
    /// Ranks in bins of equal width, from the lowest to the highest.
    pub counts: Vec<usize>,
    /// χ² of the bins, with as many degrees of freedom as there are bins, less one; `null` where too few are ranked.
    pub chi_square: Option<f64>,
    /// Mean rank in standard errors: negative for posteriors that lie too high.
    pub place: Option<f64>,
    /// Mean squared distance of ranks from the middle, in standard errors: positive for posteriors that are too narrow.
    pub spread: Option<f64>,
    /// p of χ².
    pub p_chi_square: Option<f64>,
    /// The smallest p of χ², place and spread, corrected for all of them over all quantities (Holm).
    pub p_holm: Option<f64>,
    /// Mean of (truth − posterior mean)/posterior standard deviation, in the sampler's coordinates; `null` for the log-density.
    pub z_mean: Option<f64>,
    /// Standard deviation of the same.
    pub z_sd: Option<f64>,
    /// The central intervals of 50 %.
    pub coverage_50: Coverage,
    /// The central intervals of 90 %.
    pub coverage_90: Coverage,
}

/// How many truths intervals hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Coverage {
    /// Share of the truths that are inside; `null` where nothing is ranked.
    pub share: Option<f64>,
    /// Exact 95 % interval of that share's probability (Clopper and Pearson).
    pub interval_95: [f64; 2],
}

/// What a calibration comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CalibrationVerdict {
    /// In one word.
    pub kind: CalibrationKind,
    /// In plain English.
    pub sentence: String,
}

/// Verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CalibrationKind {
    /// Nothing speaks against the posteriors.
    Calibrated,
    /// Truths are not where the posteriors say.
    Miscalibrated,
    /// Too few replicates to tell.
    Undecided,
}

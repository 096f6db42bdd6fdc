//! The documents of `sample` and `diagnose` on an oscillation (formats §5, `vitreo-uq/oscillation/1` and `vitreo-uq/oscillation-diagnosis/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::Verdict;
use super::posterior::{ModelSummary, ParameterSummary, SamplerSummary, Warning};

/// Body of `vitreo-uq/oscillation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model; its noise is `known` or `relative`.
    pub model: ModelSummary,
    /// One entry a sampled parameter.
    pub parameters: Vec<ParameterSummary>,
    /// How the draws were made.
    pub sampler: SamplerSummary,
    /// What was measured.
    pub frequencies: Frequencies,
    /// Poisson ratio by which shear moduli are Young's over 2 + 2ν.
    pub poisson_ratio: f64,
    /// What the posterior's mean leaves.
    pub misfit: OscillationMisfit,
    /// Whether the draws have converged.
    pub converged: bool,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

impl OscillationSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// The frequencies of an oscillation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Frequencies {
    /// Frequencies that were fitted.
    pub fitted: usize,
    /// Frequencies that no fit has seen.
    pub heldout: usize,
    /// The lowest, in Hz.
    pub lowest_hz: f64,
    /// The highest, in Hz.
    pub highest_hz: f64,
}

/// What a model leaves of an oscillation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationMisfit {
    /// Root mean square distance of G′ and G″ from the model, over |G*|, fitted frequencies.
    pub relative_fitted: f64,
    /// The same of held-out frequencies.
    pub relative_heldout: Option<f64>,
    /// Root mean square of both numbers' distances over their standard deviations, held-out frequencies: 1 where the model is right.
    pub heldout_over_error: Option<f64>,
    /// Median of the learnt relative error, or root mean square of the table's own errors over |G*|.
    pub error_relative: f64,
    /// Whether the table says its errors.
    pub errors_known: bool,
    /// Probability that noise leaves neighbouring frequencies that agree so well, held-out ones so far off, or, where errors are known, fitted ones so far off:
    /// the smallest times their number, by simulated oscillations that were fitted again.
    pub p: f64,
}

/// Body of `vitreo-uq/oscillation-diagnosis/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationDiagnosis {
    /// Specimen identifier.
    pub experiment: String,
    /// The model without further effects.
    pub model: ModelSummary,
    /// The conclusion.
    pub verdict: Verdict,
    /// What the model leaves.
    pub base: OscillationMisfit,
    /// What it leaves with the effects of the verdict, if it has any.
    pub extended: Option<OscillationMisfit>,
    /// Effects that change the law, the largest gain first.
    pub candidates: Vec<OscillationCandidate>,
    /// Simulated searches by which gains are judged.
    pub searches: usize,
}

/// An effect that was tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationCandidate {
    /// Its slug.
    pub effect: String,
    /// What it gains in log-likelihood of fitted frequencies, in nats.
    pub gain_nats: f64,
    /// The same of held-out frequencies.
    pub heldout_gain_nats: Option<f64>,
    /// Share of simulated searches without any effect whose largest gain is as large.
    pub p_familywise: f64,
    /// Its parameters at the fit, each with the range that one standard deviation either way reaches.
    pub parameters: Vec<OscillationEstimate>,
}

/// A fitted parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationEstimate {
    /// Name, with unit.
    pub name: String,
    /// Value.
    pub value: f64,
    /// One standard deviation below, in the coordinate in which it has no bounds.
    pub lower: f64,
    /// One above.
    pub upper: f64,
}

//! Documents of `sample` and `diagnose` on an oscillation (formats §5, `vitreo-uq/oscillation/1` and `vitreo-uq/oscillation-diagnosis/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::Verdict;
use super::posterior::{ModelSummary, ParameterSummary, SamplerSummary, Warning};

/// Body of `vitreo-uq/oscillation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model. Its noise term is `known` or `relative`.
    pub model: ModelSummary,
    /// Sampled parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Statistics of the sampler.
    pub sampler: SamplerSummary,
    /// Measured frequencies.
    pub frequencies: Frequencies,
    /// Poisson ratio ν. Shear moduli are Young's moduli divided by 2 + 2ν.
    pub poisson_ratio: f64,
    /// Residuals of the posterior mean.
    pub misfit: OscillationMisfit,
    /// True if the draws have converged.
    pub converged: bool,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl OscillationSummary {
    /// True if the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// The frequencies of an oscillation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Frequencies {
    /// Number of fitted frequencies.
    pub fitted: usize,
    /// Number of held-out frequencies, which no fit uses.
    pub heldout: usize,
    /// Lowest frequency, in Hz.
    pub lowest_hz: f64,
    /// Highest frequency, in Hz.
    pub highest_hz: f64,
}

/// Residuals of a model on an oscillation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationMisfit {
    /// Root mean square distance of G′ and G″ from the model, divided by |G*|, over the fitted frequencies.
    pub relative_fitted: f64,
    /// Root mean square distance of G′ and G″ from the model, divided by |G*|, over the held-out frequencies.
    pub relative_heldout: Option<f64>,
    /// Root mean square distance of G′ and G″ in standard deviations, over the held-out frequencies; 1 if the model is right.
    pub heldout_over_error: Option<f64>,
    /// Median of the learnt relative error, or root mean square of the table's own errors divided by |G*|.
    pub error_relative: f64,
    /// True if the table states its errors.
    pub errors_known: bool,
    /// Smallest of the tests' p values, multiplied by their number. The tests are the agreement of neighbouring residuals, the held-out distance and, with
    /// known errors, the fitted distance. The p values come from simulated oscillations that are fitted again.
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
    /// Verdict of the diagnosis.
    pub verdict: Verdict,
    /// Residuals of the model.
    pub base: OscillationMisfit,
    /// Residuals with the verdict's effects; `None` if the verdict names none.
    pub extended: Option<OscillationMisfit>,
    /// Candidate effects that change the law, largest gain first.
    pub candidates: Vec<OscillationCandidate>,
    /// Number of simulated searches that gains are compared with.
    pub searches: usize,
}

/// A candidate effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationCandidate {
    /// Slug of the effect.
    pub effect: String,
    /// Gain in log likelihood of the fitted frequencies, in nats.
    pub gain_nats: f64,
    /// Gain in log likelihood of the held-out frequencies, in nats.
    pub heldout_gain_nats: Option<f64>,
    /// Share of simulated searches without any effect whose largest gain is at least as large.
    pub p_familywise: f64,
    /// Fitted parameters of the effect, each with its range of one standard deviation either way.
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
    /// Value one standard deviation below, computed in the unbounded coordinate.
    pub lower: f64,
    /// Value one standard deviation above, computed in the unbounded coordinate.
    pub upper: f64,
}

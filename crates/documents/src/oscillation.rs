//! Documents of `sample` and `diagnose` on an oscillation (formats §5, `vitreo-uq/oscillation/1` and `vitreo-uq/oscillation-diagnosis/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::Verdict;
use super::posterior::{ModelSummary, ParameterSummary, SamplerSummary, Warning};

/// Result of `sample` on an oscillation: body of the JSON document `vitreo-uq/oscillation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The sampled model. Its noise term is `known` or `relative`.
    pub model: ModelSummary,
    /// Posteriors of all sampled parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Statistics of the sampler.
    pub sampler: SamplerSummary,
    /// Number and range of the measured frequencies.
    pub frequencies: Frequencies,
    /// Poisson's ratio of the gel. It converts Young's moduli of the law into the measured shear moduli.
    pub poisson_ratio: f64,
    /// Residuals of the best fit.
    pub misfit: OscillationMisfit,
    /// True if the draws have converged.
    pub converged: bool,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl OscillationSummary {
    /// True if no warning makes the result untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// Number and range of the frequencies of an oscillation.
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

/// Residuals of a model on an oscillation, a table of storage and loss moduli against frequency.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationMisfit {
    /// Root mean square residual of the storage and loss moduli, relative to the modulus of the complex modulus, over the fitted frequencies.
    pub relative_fitted: f64,
    /// Root mean square residual of the storage and loss moduli, relative to the modulus of the complex modulus, over the held-out frequencies; `None` if there
    /// are none.
    pub relative_heldout: Option<f64>,
    /// Root mean square residual over the held-out frequencies, in standard deviations of the measurement error; 1 if the model is right. `None` without
    /// held-out frequencies.
    pub heldout_over_error: Option<f64>,
    /// Root mean square of the standard deviations of the measurement error, learnt or stated in the table, relative to the modulus of the complex modulus.
    pub error_relative: f64,
    /// True if the table states the errors of its moduli.
    pub errors_known: bool,
    /// Smallest p of the tests of the residuals, multiplied by the number of tests. The tests compare neighbouring residuals, the size of held-out residuals
    /// and, for known errors, the size of fitted residuals; for unknown ones, the law with the best passive linear law. A last test looks for single rows that no such
    /// law explains. The p values come from simulated and refitted oscillations.
    pub p: f64,
    /// True if repeats of the sweep differ alike at all frequencies, which no law explains.
    pub repeats_differ: bool,
}

/// Result of `diagnose` on an oscillation: body of the JSON document `vitreo-uq/oscillation-diagnosis/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationDiagnosis {
    /// Specimen identifier.
    pub experiment: String,
    /// The base model, to which the diagnosis adds effects.
    pub model: ModelSummary,
    /// Verdict of the diagnosis.
    pub verdict: Verdict,
    /// Residuals of the base model's best fit.
    pub base: OscillationMisfit,
    /// Residuals of the best fit with the verdict's effects; `None` if the verdict names no effect.
    pub extended: Option<OscillationMisfit>,
    /// Results for all effects that change the law, largest gain first.
    pub candidates: Vec<OscillationCandidate>,
    /// Number of simulated searches that the gains are compared with.
    pub searches: usize,
}

/// Result for one candidate effect of the diagnosis of an oscillation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationCandidate {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Gain in log likelihood of the fitted frequencies, in nats.
    pub gain_nats: f64,
    /// Gain in log likelihood of the held-out frequencies, in nats.
    pub heldout_gain_nats: Option<f64>,
    /// Share of simulated searches without any effect whose largest gain reaches this effect's gain.
    pub p_familywise: f64,
    /// Estimates of the effect's parameters.
    pub parameters: Vec<OscillationEstimate>,
}

/// Estimate of one parameter, with an interval of one standard deviation either way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct OscillationEstimate {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Estimate, in the unit of the parameter's name.
    pub value: f64,
    /// Lower end of the interval: one standard deviation below the estimate in the sampler's unbounded coordinate.
    pub lower: f64,
    /// Upper end of the interval: one standard deviation above the estimate in the sampler's unbounded coordinate.
    pub upper: f64,
}
